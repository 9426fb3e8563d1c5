"""The stiffness that the hand feels of a drawn loop at rest: from a single tick, or from its frame.

If nothing changes, every block holds the outputs that it would have if it ran: a state at rest is the same in all ticks,
whichever blocks run in them. So the schedule does not matter, and a tick in which every block runs is enough. A loop that
drifts, or that conserves a combination of its states, has no unique state at rest; then that result is not known.

A position that only adds up the states of a loop, and is read by none, depends on how it got there: a tick does not determine
it, a frame does. `static_port_response` has loops that neither of the two determines.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine.loops.from_drawing import Ports
from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.monodromy.drift import MarginalModes, relative_row
from wavesweep.engine.monodromy.interconnect import all_sums, connect
from wavesweep.engine.monodromy.open_frame import OpenFrame
from wavesweep.engine.monodromy.rounding import ENTRIES, ROUNDING
from wavesweep.engine.response.bounded_sums import ordered_products
from wavesweep.engine.response.linear_systems import solved

SURE = 1e-9  # relative error up to which a stiffness is known; as a share of a rigid wall's, what counts as nothing felt


@dataclass(frozen=True, slots=True, eq=False)
class DcGain:
    """Loops at rest under a unit force of the hand, and a number p of them that is one scalar gain.

    shown: `(loops, 3, 2)`; the rows are position (m), force against the hand (N) and the number's product. The first column is
    for the case that the signal which the number multiplies is 0; the second is the change for a 1 of that signal. error:
    bounds on the errors. free: whether there is such a number. A fourth row is the signal that another number multiplies, whose
    product is added to that of the first one.
    """

    shown: np.ndarray
    error: np.ndarray
    free: bool

    def stiffness(self, at, p, second=0.0) -> np.ndarray:
        """Return the stiffness (N/m) that the hand feels of the loops `at` if the number is p, `(n,)` all.

        second: the number of the fourth row. NaN: not known to SURE. If nothing is swept, one loop represents all.

        The product of the number is p times the signal that it multiplies, and that signal is `F_0/(p - F_1)` (Sherman and
        Morrison 1950); of F the product of the other number is a part.
        """
        at = at if len(self.shown) > 1 else 0 * at
        (still, change), (unsure, of_change) = (
            np.moveaxis(rows.take(at, axis=0), (-1, -2), (0, 1)) for rows in (self.shown, self.error)
        )
        with np.errstate(all="ignore"):
            if self.free:
                if len(still) > 3:
                    still, unsure = _less(still, unsure, second)
                    change, of_change = _less(change, of_change, second)
                left = p - change[2]
                of_left = of_change[2] + ROUNDING * (np.abs(p) + np.abs(change[2]))
                sizes = np.abs(still[:2] * left), np.abs(still[2] * change[:2])
                error = unsure[:2] * np.abs(left) + np.abs(still[:2]) * of_left + ROUNDING * sum(sizes)
                error = error + unsure[2] * np.abs(change[:2]) + np.abs(still[2]) * of_change[:2]
                limits, rigid = still[:2] * left + still[2] * change[:2], np.abs(still[1] / still[0])
            else:
                limits, error, rigid = still[:2], unsure[:2], 0.0
            stiffness, off = limits[1] / limits[0], error / np.abs(limits)
            stiffness = np.where((off[1] >= 1) & (error[1] <= SURE * rigid * np.abs(limits[0])), 0.0, stiffness)
            return np.where((off[0] <= SURE) & ((off[1] <= SURE) | (stiffness == 0)), stiffness, np.nan)


def _less(rows, errors, second):
    """The first three rows with the fourth one times a number taken from the third, and the errors."""
    product = second * rows[3]
    third = rows[2] - product
    error = errors[2] + np.abs(second) * errors[3] + ROUNDING * (np.abs(rows[2]) + np.abs(product))
    return np.stack([*rows[:2], third]), np.stack([*errors[:2], error])


def tick_dcgain(drawn: MultirateLoop, ports: Ports, product: str = "", factor: str = "") -> DcGain:
    """Return the loops at rest.

    product, factor: the number's product is that input of the drawing, and it would multiply the signal `factor`; if they are
    empty, the drawing is the whole loop. Errors: IllPosedLoopError if the loop of direct terms through all blocks is singular.

    With the number's product F, `E X + B F + g = 0` and `C X + D F + d = r` hold at rest; r is the signal that the number
    multiplies.
    """
    signals = (ports.position, *((ports.reaction,) if ports.reaction else ()), *((factor,) if factor else ()))
    drawn = drawn.living(signals)
    blocks = [placed.block for placed in drawn.placed]
    block = connect("rest", blocks, all_sums(blocks, drawn.sums), drawn.inputs, signals, terms=True)
    hand, free = drawn.inputs.index(ports.force), drawn.inputs.index(product) if factor else None
    structure = block.batch, hand, bool(ports.reaction), free
    at_rest = _at_rest(block.E, block.B, block.C, block.D, *structure)
    sizes = _at_rest(*block.terms, *structure)
    with np.errstate(all="ignore"):
        X, dX = solved(at_rest.A, ENTRIES * sizes.A, at_rest.right, ENTRIES * np.abs(sizes.right))
        shown = ordered_products(at_rest.rows, X) + at_rest.direct
        size = ordered_products(sizes.rows, np.abs(X)) + sizes.direct
        error = ordered_products(np.abs(at_rest.rows), dX) + (ENTRIES + X.shape[-2] * ROUNDING) * size
    return DcGain(shown.reshape(-1, 3, 2), error.reshape(-1, 3, 2), bool(factor))


class DcEquations(NamedTuple):
    """The equations at rest, `A X = right`; `rows X + direct` is shown by `DcGain`."""

    A: np.ndarray
    right: np.ndarray
    rows: np.ndarray
    direct: np.ndarray


def _at_rest(E, B, C, D, batch, hand, reacts, free):
    """Return the equations at rest.

    hand, free: inputs that are the hand's force and the number's product, None without a number. reacts: whether the second
    signal is the force against the hand. They may be made of sizes as well; only `right` has the other sign then.
    """
    n, order = E.shape[-1], E.shape[-1] + (free is not None)
    A, right, rows, direct = (np.zeros((*batch, *shape)) for shape in ((order, order), (order, 2), (3, order), (3, 2)))
    A[..., :n, :n], right[..., :n, 0] = E, -B[..., hand]
    for row in range(1 + reacts):
        rows[..., row, :n], direct[..., row, 0] = C[..., row, :], D[..., row, hand]
    if not reacts:
        direct[..., 1, 0] = 1
    if free is not None:
        A[..., :n, n], A[..., n, :n], A[..., n, n] = B[..., free], C[..., -1, :], D[..., -1, free]
        right[..., n, 0], right[..., n, 1] = -D[..., -1, hand], 1
        rows[..., : 1 + reacts, n], rows[..., 2, n] = D[..., :-1, free], 1
    return DcEquations(A, right, rows, direct)


SURELY = 2  # a sum below so many bounds on its rounding counts as 0


def shows_at_rest(drawn: MultirateLoop, ports: Ports, read: tuple[str, ...]) -> bool:
    """Whether every tick shows the force against the hand with no more held than the loop needs; read: see `open_frame`."""
    held, placed = drawn.held(read), {scheduled.block.name: scheduled for scheduled in drawn.placed}
    sources = (source.rpartition(".") for source in drawn.sources(ports.reaction))
    return bool(ports.reaction) and all(
        name in placed and (placed[name].every == 1 or port in held[name]) for name, _, port in sources if name
    )


def frame_dcgain(drawn: MultirateLoop, ports: Ports, frame: OpenFrame, drift: MarginalModes) -> DcGain | None:
    """Return the loops at rest, free in the number that the frame is without; None if the frame does not determine them.

    frame: with the hand's force; its signals are first the one that the number multiplies, then perhaps the one that another
    number of the same sum multiplies, and last the force against the hand. drift: that of the open loop.

    Unknowns X are the states that the two signals depend on, and the number's product F. At rest `E X + B F + g = 0` and
    `C X + D F + d = r`; r is the signal that the number multiplies. A share of the position that no state reads changes in a
    frame by `G X + H F + h`. With `l (E, B; C, D) = (G, H)` it changes by the hand's force alone if it is relative to `l X`:
    not at all in the mean, if something holds the device, and then it keeps the first moment of the force over the frame.
    Accuracy: errors follow from the bounds on those of the frame's entries.
    """
    position = _position(drawn, ports.position, frame.ticks.states)
    if drift.varying or position is None:
        return None
    position = relative_row(position, frame.relative)
    with np.errstate(all="ignore"):
        return _Equations.of(frame, drift, position).resting(drawn.ticks)


def _position(drawn, signal, states):
    """The row of a position over the states of a frame; None if it is more than a sum of them."""
    row, placed = np.zeros((1, len(states))), {scheduled.block.name: scheduled for scheduled in drawn.placed}
    for source, gain in drawn.sums.get(signal, {signal: 1.0}).items():
        name, _, port = source.rpartition(".")
        if name not in placed or placed[name].every > 1:
            return None
        block = placed[name].block
        at = block.outputs.index(port)
        if np.any(block.D[..., at, :]):
            return None
        entries = np.asarray(gain)[..., None, None] * block.C[..., at : at + 1, :]
        term = np.zeros((*entries.shape[:-1], len(states)))
        term[..., [states.index(f"{name}.{state}") for state in block.states]] = entries
        row = row + term
    return row


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """The equations at rest, and the sizes of the terms of their entries, times their rounding.

    P `(..., n + 3, n + 3)`: rows of the states, those that leads move being relative to them, of the signal that the number
    multiplies, of the force against the hand and of the position, and perhaps a further one of the signal that another number
    multiplies; columns of the states, of the product, and of a hand's force that is constant, and of one that grows with every
    tick.
    """

    P: np.ndarray
    dP: np.ndarray

    @classmethod
    def of(cls, frame, drift, position):
        n, leads = len(frame.ticks.states), drift.leads
        order = [state for state in range(n) if state not in leads] + leads
        sizes = frame.dE + ROUNDING * np.abs(frame.E), frame.dB + ROUNDING * np.abs(frame.B), frame.dC, frame.dD
        batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in (frame.E, frame.B, frame.C, frame.D, position)))
        second, pair = frame.C.shape[-2] > 2, []
        for (E, B, C, D), place in (((frame.E, frame.B, frame.C, frame.D), position), (sizes, ROUNDING * np.abs(position))):
            P = np.zeros((*batch, n + 3 + second, n + 3))
            P[..., :n, : n - len(leads)], P[..., :n, n:] = E[..., order, :][..., order[: n - len(leads)]], B[..., order, :]
            P[..., n : n + 2, :n], P[..., n : n + 2, n:] = C[..., [0, -1], :][..., order], D[..., [0, -1], :]
            P[..., n + 2, :n] = place[..., 0, order]
            if second:
                P[..., n + 3, :n], P[..., n + 3, n:] = C[..., 1, order], D[..., 1, :]
            pair.append(P)
        return cls(*pair)

    def resting(self, ticks) -> DcGain:
        """The loops at rest; ticks: of the frame."""
        n, P, dP = self.P.shape[-1] - 3, self.P, self.dP
        determined, adding = self._unknowns(n)
        at = np.array([*determined, n])
        A, dA = (np.ascontiguousarray(equations[..., at[:, None], at]) for equations in (P, dP))
        right, unsure = np.zeros((2, *A.shape[:-1], 2))
        right[..., 0], unsure[..., 0], right[..., -1, 1] = -P[..., at, n + 1], dP[..., at, n + 1], 1
        if adding:
            inverse = solved(A, dA, np.broadcast_to(np.eye(at.size), A.shape), np.zeros_like(A))
            X = _product(inverse, (right, unsure))
        else:
            X, inverse = solved(A, dA, right, unsure), (0 * A, 0 * A)
        # Of the share of the position that is read by no state: the change in a frame, and what it is relative to.
        share = P[..., n + 2 : n + 3, :][..., adding]
        change, of_change = share @ P[..., adding, :], np.abs(share) @ dP[..., adding, :]
        law = _product((change[..., at], of_change[..., at]), inverse)
        by_law = _product(law, (P[..., at, n + 1 :], dP[..., at, n + 1 :]))
        moment = change[..., n + 1 :] - by_law[0], of_change[..., n + 1 :] + by_law[1]
        held = (np.abs(moment[0][..., 0]) <= SURELY * moment[1][..., 0]) & (np.abs(law[0][..., -1]) <= SURELY * law[1][..., -1])
        unit = np.zeros_like(A[..., :1, :])
        unit[..., -1] = 1
        pairs = []
        for equations, of_law, product in ((P, law[0], unit), (dP, law[1], 0 * unit)):
            position = equations[..., n + 2 : n + 3, :][..., at]
            position[..., :-1] += of_law[..., :-1]
            reaction, second = equations[..., n + 1 : n + 2, :][..., at], equations[..., n + 3 :, :][..., at]
            pairs.append(np.concatenate([position, reaction, product, second], axis=-2))
        shown, error = _product(pairs, X)
        for rows, of_moment, equations in zip((shown, error), moment, (P, dP), strict=True):
            rows[..., 0, 0] += of_moment[..., 0, 1] / ticks
            rows[..., 1, 0] += equations[..., n + 1, n + 1]
            rows[..., 3:, 0] += equations[..., n + 3 :, n + 1]
        error[..., 0, :] = np.where(held, error[..., 0, :], np.inf)
        return DcGain(*(rows.reshape(-1, *rows.shape[-2:]) for rows in (shown, error)), True)

    def _unknowns(self, n):
        """Indices of the states that the signals depend on, and of those that the position alone reads."""
        reads = (self.P != 0).any(tuple(range(self.P.ndim - 2)))[:, :n]
        shown = np.flatnonzero(reads[n + 2]).tolist()
        rows, determined = [n, n + 1, *range(n + 3, self.P.shape[-2]), *shown], set()
        for row in rows:
            new = set(np.flatnonzero(reads[row]).tolist()) - determined
            determined |= new
            rows += sorted(new)
        return sorted(determined), [state for state in shown if state not in determined]


def _product(left, right):
    """The product of two matrices, each a pair with bounds on the errors of its entries; in a batch as for one loop alone."""
    (a, da), (b, db) = ([np.ascontiguousarray(matrix) for matrix in pair] for pair in (left, right))
    size, sizes = np.abs(a), np.abs(b)
    return a @ b, da @ (sizes + db) + size @ (db + a.shape[-1] * ROUNDING * sizes)
