"""The stiffness that the hand feels of a drawn loop at rest: from a single tick, or from its frame.

If nothing changes, every block holds the outputs that it would have if it ran: a state at rest is
the same in all ticks, whichever blocks run in them. So the schedule does not matter, and a tick in
which every block runs is enough. A loop that drifts, or that conserves a combination of its states,
has no unique state at rest; then that result is not known.

A position that only adds up the states of a loop, and is read by none, depends on how it got there:
a tick does not determine it, a frame does. `static_port_response` has loops that neither of the two
determines.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine.blocks import MultirateLoop, Ports, all_sums, connect
from wavesweep.engine.doubles import ENTRY_ROUNDING, SHORT_SUM_ROUNDING
from wavesweep.engine.frames import MarginalModes, OpenFrame, relative_row
from wavesweep.engine.response import ordered_products, solved

# relative error up to which a stiffness is known; as a share of a rigid wall's, what counts as
# nothing felt
KNOWN_AT_REST = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class DcGain:
    """Loops at rest under a unit force of the hand, and a number p of them that is one scalar gain.

    shown: `(loops, 3, 2)`; the rows are position (m), force against the hand (N) and the number's
    product. The first column is for the case that the signal which the number multiplies is 0; the
    second is the change for a 1 of that signal. error: bounds on the errors. free: whether there is
    such a number. A fourth row is the signal that another number multiplies, whose product is added
    to that of the first one.
    """

    shown: np.ndarray
    error: np.ndarray
    free: bool

    def stiffness(self, at, p, second=0.0) -> np.ndarray:
        """Return the stiffness (N/m) that the hand feels of the loops `at` if the number is p,
        `(n,)` all.

        second: the number of the fourth row. NaN: not known to KNOWN_AT_REST. If nothing is swept,
        one loop represents all.

        The product of the number is p times the signal that it multiplies, and that signal is
        `F_0/(p - F_1)` (Sherman and Morrison 1950); of F the product of the other number is a part.
        """
        if len(self.shown) == 1:
            at = 0 * at
        # Of each row F_0, for a signal of 0, and F_1, the change for a 1 of the signal.
        still, change = np.moveaxis(self.shown.take(at, axis=0), (-1, -2), (0, 1))
        of_still, of_change = np.moveaxis(self.error.take(at, axis=0), (-1, -2), (0, 1))
        with np.errstate(all="ignore"):
            limits, error, rigid = still[:2], of_still[:2], 0.0
            if self.free:
                if len(still) > 3:
                    still, of_still = _less(still, of_still, second)
                    change, of_change = _less(change, of_change, second)
                limits, error = _closed(still, of_still, change, of_change, p)
                rigid = np.abs(still[1] / still[0])
            position, reaction = limits
            stiffness = reaction / position
            off_position, off_reaction = error / np.abs(limits)
            nothing = KNOWN_AT_REST * rigid * np.abs(position)
            is_nothing = (off_reaction >= 1) & (error[1] <= nothing)
            stiffness = np.where(is_nothing, 0.0, stiffness)
            known = (off_position <= KNOWN_AT_REST) & (
                (off_reaction <= KNOWN_AT_REST) | (stiffness == 0)
            )
            return np.where(known, stiffness, np.nan)


def _closed(still, of_still, change, of_change, p):
    """Position and reaction with the number p in place, times `p - F_1`, which their ratio does
    not have, and their errors."""
    left = p - change[2]
    of_left = of_change[2] + SHORT_SUM_ROUNDING * (np.abs(p) + np.abs(change[2]))
    direct = still[:2] * left
    through = still[2] * change[:2]
    error = of_still[:2] * np.abs(left) + np.abs(still[:2]) * of_left
    error = error + SHORT_SUM_ROUNDING * (np.abs(direct) + np.abs(through))
    error = error + of_still[2] * np.abs(change[:2]) + np.abs(still[2]) * of_change[:2]
    return direct + through, error


def _less(rows, errors, second):
    """The first three rows with the fourth one times a number taken from the third, and the
    errors."""
    product = second * rows[3]
    third = rows[2] - product
    error = (
        errors[2]
        + np.abs(second) * errors[3]
        + SHORT_SUM_ROUNDING * (np.abs(rows[2]) + np.abs(product))
    )
    return np.stack([*rows[:2], third]), np.stack([*errors[:2], error])


def tick_dcgain(drawn: MultirateLoop, ports: Ports, product: str = "", factor: str = "") -> DcGain:
    """Return the loops at rest.

    product, factor: the number's product is that input of the drawing, and it would multiply the
    signal `factor`; if they are empty, the drawing is the whole loop. Errors: IllPosedLoopError if
    the loop of direct terms through all blocks is singular.

    With the number's product F, `E X + B F + g = 0` and `C X + D F + d = r` hold at rest; r is the
    signal that the number multiplies.
    """
    signals = [ports.position]
    if ports.reaction:
        signals.append(ports.reaction)
    if factor:
        signals.append(factor)
    drawn = drawn.living(tuple(signals))
    blocks = [placed.block for placed in drawn.placed]
    sums = all_sums(blocks, drawn.sums)
    block = connect("rest", blocks, sums, drawn.inputs, tuple(signals), terms=True)
    hand = drawn.inputs.index(ports.force)
    free = drawn.inputs.index(product) if factor else None
    structure = block.batch, hand, bool(ports.reaction), free
    at_rest = _at_rest((block.E, block.B, block.C, block.D), *structure)
    sizes = _at_rest(block.terms, *structure)
    with np.errstate(all="ignore"):
        of_A = ENTRY_ROUNDING * sizes.A
        of_right = ENTRY_ROUNDING * np.abs(sizes.right)
        X, dX = solved(at_rest.A, of_A, at_rest.right, of_right)
        shown = ordered_products(at_rest.rows, X) + at_rest.direct
        size = ordered_products(sizes.rows, np.abs(X)) + sizes.direct
        error = ordered_products(np.abs(at_rest.rows), dX)
        error = error + (ENTRY_ROUNDING + X.shape[-2] * SHORT_SUM_ROUNDING) * size
    return DcGain(shown.reshape(-1, 3, 2), error.reshape(-1, 3, 2), bool(factor))


class DcEquations(NamedTuple):
    """The equations at rest, `A X = right`; `rows X + direct` is shown by `DcGain`."""

    A: np.ndarray
    right: np.ndarray
    rows: np.ndarray
    direct: np.ndarray


def _at_rest(matrices, batch, hand, reacts, free):
    """Return the equations at rest of a block with the matrices E, B, C and D.

    hand, free: inputs that are the hand's force and the number's product, None without a number.
    reacts: whether the second signal is the force against the hand. They may be made of sizes as
    well; only `right` has the other sign then.
    """
    E, B, C, D = matrices
    n = E.shape[-1]
    order = n + (free is not None)
    A = np.zeros((*batch, order, order))
    right = np.zeros((*batch, order, 2))
    rows = np.zeros((*batch, 3, order))
    direct = np.zeros((*batch, 3, 2))
    A[..., :n, :n] = E
    right[..., :n, 0] = -B[..., hand]
    for row in range(1 + reacts):
        rows[..., row, :n] = C[..., row, :]
        direct[..., row, 0] = D[..., row, hand]
    if not reacts:
        direct[..., 1, 0] = 1
    if free is not None:
        A[..., :n, n] = B[..., free]
        A[..., n, :n] = C[..., -1, :]
        A[..., n, n] = D[..., -1, free]
        right[..., n, 0] = -D[..., -1, hand]
        right[..., n, 1] = 1
        rows[..., : 1 + reacts, n] = D[..., :-1, free]
        rows[..., 2, n] = 1
    return DcEquations(A, right, rows, direct)


ZERO_BOUNDS = 2  # a sum below so many bounds on its rounding counts as 0


def shows_at_rest(drawn: MultirateLoop, ports: Ports, read: tuple[str, ...]) -> bool:
    """Whether every tick shows the force against the hand with no more held than the loop needs;
    read: see `open_frame`."""
    if not ports.reaction:
        return False
    held = drawn.held(read)
    placed = {scheduled.block.name: scheduled for scheduled in drawn.placed}
    for source in drawn.sources(ports.reaction):
        name, _, port = source.rpartition(".")
        if not name:  # a force from outside
            continue
        if name not in placed:
            return False
        if placed[name].every > 1 and port not in held[name]:
            return False
    return True


def frame_dcgain(
    drawn: MultirateLoop, ports: Ports, frame: OpenFrame, drift: MarginalModes
) -> DcGain | None:
    """Return the loops at rest, free in the number that the frame is without; None if the frame
    does not determine them.

    frame: with the hand's force; its signals are first the one that the number multiplies, then
    perhaps the one that another number of the same sum multiplies, and last the force against the
    hand. drift: that of the open loop.

    Unknowns X are the states that the two signals depend on, and the number's product F. At rest `E
    X + B F + g = 0` and `C X + D F + d = r`; r is the signal that the number multiplies. A share of
    the position that no state reads changes in a frame by `G X + H F + h`. With `l (E, B; C, D) =
    (G, H)` it changes by the hand's force alone if it is relative to `l X`: not at all in the mean,
    if something holds the device, and then it keeps the first moment of the force over the frame.
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
    row = np.zeros((1, len(states)))
    placed = {scheduled.block.name: scheduled for scheduled in drawn.placed}
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
        columns = [states.index(f"{name}.{state}") for state in block.states]
        term[..., columns] = entries
        row = row + term
    return row


class _Bounded(NamedTuple):
    """A matrix, and bounds on the errors of its entries."""

    value: np.ndarray
    error: np.ndarray

    def times(self, other: "_Bounded") -> "_Bounded":
        """The product; in a batch as for one loop alone."""
        a, da = (np.ascontiguousarray(matrix) for matrix in self)
        b, db = (np.ascontiguousarray(matrix) for matrix in other)
        size = np.abs(a)
        sizes = np.abs(b)
        error = da @ (sizes + db) + size @ (db + a.shape[-1] * SHORT_SUM_ROUNDING * sizes)
        return _Bounded(a @ b, error)


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """The equations at rest, and the sizes of the terms of their entries, times their rounding.

    P `(..., n + 3, n + 3)`: rows of the states, those that leads move being relative to them, of
    the signal that the number multiplies, of the force against the hand and of the position, and
    perhaps a further one of the signal that another number multiplies; columns of the states, of
    the product, and of a hand's force that is constant, and of one that grows with every tick.
    """

    P: np.ndarray
    dP: np.ndarray

    @classmethod
    def of(cls, frame, drift, position):
        n = len(frame.ticks.states)
        remaining = [state for state in range(n) if state not in drift.leads]
        order = remaining + drift.leads
        matrices = frame.E, frame.B, frame.C, frame.D
        dE = frame.dE + SHORT_SUM_ROUNDING * np.abs(frame.E)
        dB = frame.dB + SHORT_SUM_ROUNDING * np.abs(frame.B)
        batch = np.broadcast_shapes(*(matrix.shape[:-2] for matrix in (*matrices, position)))

        def assembled(E, B, C, D, place):
            signals = C.shape[-2]  # two, or three with a second number
            P = np.zeros((*batch, n + 1 + signals, n + 3))
            P[..., :n, : len(remaining)] = E[..., order, :][..., remaining]
            P[..., :n, n:] = B[..., order, :]
            P[..., n : n + 2, :n] = C[..., [0, -1], :][..., order]
            P[..., n : n + 2, n:] = D[..., [0, -1], :]
            P[..., n + 2, :n] = place[..., 0, order]
            if signals > 2:
                P[..., n + 3, :n] = C[..., 1, order]
                P[..., n + 3, n:] = D[..., 1, :]
            return P

        of_terms = assembled(dE, dB, frame.dC, frame.dD, SHORT_SUM_ROUNDING * np.abs(position))
        return cls(assembled(*matrices, position), of_terms)

    def _rows(self, rows, columns) -> _Bounded:
        return _Bounded(self.P[..., rows, :][..., columns], self.dP[..., rows, :][..., columns])

    def resting(self, ticks) -> DcGain:
        """The loops at rest; ticks: of the frame."""
        n = self.P.shape[-1] - 3
        reaction, place = n + 1, n + 2  # rows; the row n is that of the signal
        constant = n + 1  # column of the hand's force
        determined, adding = self._unknowns(n)
        at = [
            *determined,
            n,
        ]  # rows and columns of the unknowns: states, the signal and the product
        A, dA = (np.ascontiguousarray(matrix) for matrix in self._rows(at, at))
        right = np.zeros((*A.shape[:-1], 2))
        of_right = np.zeros((*A.shape[:-1], 2))
        right[..., 0] = -self.P[..., at, constant]
        of_right[..., 0] = self.dP[..., at, constant]
        right[..., -1, 1] = 1
        if adding:
            unit = np.broadcast_to(np.eye(len(at)), A.shape)
            inverse = _Bounded(*solved(A, dA, unit, np.zeros_like(A)))
            X = inverse.times(_Bounded(right, of_right))
        else:
            inverse = _Bounded(0 * A, 0 * A)
            X = _Bounded(*solved(A, dA, right, of_right))
        # Of the share of the position that is read by no state: G and H, its change in a frame, and
        # l, which it is relative to.
        share = self.P[..., [place], :][..., adding]
        change = share @ self.P[..., adding, :]
        of_change = np.abs(share) @ self.dP[..., adding, :]
        law = _Bounded(change[..., at], of_change[..., at]).times(inverse)
        forces = slice(constant, None)
        by_law = law.times(self._rows(at, forces))
        moment = _Bounded(change[..., forces] - by_law.value, of_change[..., forces] + by_law.error)
        still = np.abs(moment.value[..., 0]) <= ZERO_BOUNDS * moment.error[..., 0]
        alone = np.abs(law.value[..., -1]) <= ZERO_BOUNDS * law.error[..., -1]
        product = np.zeros_like(A[..., :1, :])
        product[..., -1] = 1
        others = slice(n + 3, None)
        position = self._rows([place], at)
        for matrix, of_law in zip(position, law, strict=True):
            matrix[..., :-1] += of_law[..., :-1]
        rows = [
            position,
            self._rows([reaction], at),
            _Bounded(product, 0 * product),
            self._rows(others, at),
        ]
        stacked = _Bounded(
            *(np.concatenate(matrices, axis=-2) for matrices in zip(*rows, strict=True))
        )
        shown = stacked.times(X)
        for matrix, of_moment, P in zip(shown, moment, (self.P, self.dP), strict=True):
            matrix[..., 0, 0] += of_moment[..., 0, 1] / ticks
            matrix[..., 1, 0] += P[..., reaction, constant]
            matrix[..., 3:, 0] += P[..., others, constant]
        shown.error[..., 0, :] = np.where(still & alone, shown.error[..., 0, :], np.inf)
        value, error = (matrix.reshape(-1, *matrix.shape[-2:]) for matrix in shown)
        return DcGain(value, error, True)

    def _unknowns(self, n):
        """Indices of the states that the signals depend on, and of those that the position alone
        reads."""
        reads = (self.P != 0).any(tuple(range(self.P.ndim - 2)))[:, :n]
        in_position = np.flatnonzero(reads[n + 2]).tolist()
        of_second = range(n + 3, self.P.shape[-2])
        rows = [n, n + 1, *of_second, *in_position]
        determined = set()
        for row in rows:  # which grows by the states that are found
            new = set(np.flatnonzero(reads[row]).tolist()) - determined
            determined |= new
            rows += sorted(new)
        adding = [state for state in in_position if state not in determined]
        return sorted(determined), adding
