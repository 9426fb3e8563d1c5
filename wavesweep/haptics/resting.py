"""The stiffness that the hand feels of a drawn loop at rest: from a single tick, or from its frame.

If nothing changes, every block holds the outputs that it would have if it ran: a state at rest is
the same in all ticks, whichever blocks run in them. So the schedule does not matter, and a tick in
which every block runs is enough. A loop that drifts, or that conserves a combination of its states,
has no unique state at rest; then that result is not known.

A position that only adds up the states of a loop, and is read by none, depends on how it got there:
a tick does not determine it, a frame does. Loops that neither of the two determines have a
`static_response`.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine.blocks import MultirateLoop, Ports, all_sums, connect
from wavesweep.engine.doubles import ENTRY_ROUNDING
from wavesweep.engine.frames import Bounded, MarginalModes, OpenFrame, relative_row

# relative error up to which a stiffness is known; as a share of a rigid wall's, what counts as
# nothing felt
KNOWN_AT_REST = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class DcGain:
    """Loops at rest under a unit force of the hand, and a number p of them that is one scalar gain.

    shown: `(loops, 3, 2)`; the rows are position (m), force against the hand (N) and the number's
    product. The first column is for the case that the signal which the number multiplies is 0; the
    second is the change for a 1 of that signal. free: whether there is such
    a number. A fourth row is the signal that another number multiplies, whose product is added to
    that of the first one.
    """

    shown: Bounded
    free: bool

    def stiffness(self, loops, p, second=0.0) -> np.ndarray:
        """Return the stiffness (N/m) that the hand feels of the loops `loops` if the number is p,
        `(n,)` all.

        second: the number of the fourth row. NaN: not known to KNOWN_AT_REST. If nothing is swept,
        one loop represents all.

        The product of the number is p times the signal that it multiplies, and that signal is
        `F_0/(p - F_1)` (Sherman and Morrison 1950); of F the product of the other number is a part.
        """
        if len(self.shown.value) == 1:
            loops = 0 * loops
        # Of each row F_0, for a signal of 0, and F_1, the change for a 1 of the signal.
        still, change = (self.shown.part(loops, ..., case).mT for case in (0, 1))
        with np.errstate(all="ignore"):
            limits = still.part(slice(2))
            rigid = 0.0
            if self.free:
                if len(still.value) > 3:
                    still, change = (_less(rows, second) for rows in (still, change))
                # Position and reaction times `p - F_1`, which their ratio does not have.
                difference = Bounded.exact(p) - change.part(2)
                limits = limits * difference + change.part(slice(2)) * still.part(2)
                rigid = np.abs(still.value[1] / still.value[0])
            limits, error = limits
            position, reaction = limits
            stiffness = reaction / position
            off_position, off_reaction = error / np.abs(limits)
            nothing = KNOWN_AT_REST * rigid * np.abs(position)
            is_nothing = (off_reaction >= 1) & (error[1] <= nothing)
            stiffness = np.where(is_nothing, 0.0, stiffness)
            resolved = (off_position <= KNOWN_AT_REST) & (
                (off_reaction <= KNOWN_AT_REST) | (stiffness == 0)
            )
            return np.where(resolved, stiffness, np.nan)


def _less(rows, second):
    """The first three rows with the fourth one times a number taken from the third."""
    third = rows.part([2]) - rows.part([3]) * second
    return Bounded.joined([rows.part(slice(2)), third], 0)


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
        of_terms = (ENTRY_ROUNDING * np.abs(size) for size in sizes)
        A, right, rows, direct = map(Bounded, at_rest, of_terms)
        shown = rows @ A.solved(right) + direct
    return DcGain(_listed(shown), bool(factor))


def _listed(shown):
    """What is shown of all loops of a batch, one after the other."""
    return shown.each(lambda matrix: matrix.reshape(-1, *matrix.shape[-2:]))


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
    held_ports = drawn.held(read)
    placed = {scheduled.block.name: scheduled for scheduled in drawn.placed}
    for source in drawn.sources(ports.reaction):
        name, _, port = source.rpartition(".")
        if not name:  # a force from outside
            continue
        if name not in placed:
            return False
        if placed[name].every > 1 and port not in held_ports[name]:
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


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """The equations at rest, and the sizes of the terms of their entries, times their rounding.

    P `(..., n + 3, n + 3)`: rows of the states, those that leads move being relative to them, of
    the signal that the number multiplies, of the force against the hand and of the position, and
    perhaps a further one of the signal that another number multiplies; columns of the states, of
    the product, and of a hand's force that is constant, and of one that grows with every tick.
    """

    P: Bounded

    @classmethod
    def of(cls, frame, drift, position):
        n = len(frame.ticks.states)
        remaining = [state for state in range(n) if state not in drift.leads]
        order = remaining + drift.leads
        matrices = frame.E, frame.B, frame.C, frame.D
        errors = frame.dE, frame.dB, frame.dC, frame.dD
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

        of_position = ENTRY_ROUNDING * np.abs(position)
        return cls(Bounded(assembled(*matrices, position), assembled(*errors, of_position)))

    def _rows(self, rows, columns) -> Bounded:
        return self.P.part(..., rows, slice(None)).part(..., columns)

    def resting(self, ticks) -> DcGain:
        """The loops at rest; ticks: of the frame."""
        n = self.P.value.shape[-1] - 3
        reaction, place = n + 1, n + 2  # rows; the row n is that of the signal
        constant = n + 1  # column of the hand's force
        forces = slice(constant, None)
        determined, adding = self._unknowns(n)
        # Rows and columns of the unknowns: states, the signal and the product.
        unknowns = [*determined, n]
        unit = np.eye(len(unknowns))
        product = Bounded.exact(unit[-1:])
        right = Bounded.block(
            [[-self._rows(unknowns, [constant]), product.mT, Bounded.exact(unit)]]
        )
        solution = self._rows(unknowns, unknowns).solved(right)
        X = solution.part(..., slice(2))
        inverse = solution.part(..., slice(2, None))
        # Of the share of the position that is read by no state: G and H, its change in a frame, and
        # l, which it is relative to.
        share = Bounded.exact(self._rows([place], adding).value)
        change = share @ self.P.part(..., adding, slice(None))
        law = change.part(..., unknowns) @ inverse
        moment = change.part(..., forces) - law @ self._rows(unknowns, forces)
        still = np.abs(moment.value[..., 0]) <= ZERO_BOUNDS * moment.error[..., 0]
        alone = np.abs(law.value[..., -1]) <= ZERO_BOUNDS * law.error[..., -1]
        remaining = slice(n + 3, None)
        rows = [
            self._rows([place], unknowns) + law * (1 - unit[-1]),
            self._rows([reaction], unknowns),
            product,
            self._rows(remaining, unknowns),
        ]
        direct = [
            moment.part(..., [1]).over(Bounded.exact(float(ticks))),
            self._rows([reaction], [constant]),
            Bounded.exact(np.zeros((1, 1))),
            self._rows(remaining, [constant]),
        ]
        shown = Bounded.joined(rows, -2) @ X + Bounded.joined(direct, -2) @ np.array([[1.0, 0.0]])
        shown.error[..., 0, :] = np.where(still & alone, shown.error[..., 0, :], np.inf)
        return DcGain(_listed(shown), True)

    def _unknowns(self, n):
        """Indices of the states that the signals depend on, and of those that the position alone
        reads."""
        P = self.P.value
        reads = (P != 0).any(tuple(range(P.ndim - 2)))[:, :n]
        in_position = np.flatnonzero(reads[n + 2]).tolist()
        of_second = range(n + 3, P.shape[-2])
        rows = [n, n + 1, *of_second, *in_position]
        determined = set()
        for row in rows:  # which grows by the states that are found
            new = set(np.flatnonzero(reads[row]).tolist()) - determined
            determined |= new
            rows += sorted(new)
        adding = [state for state in in_position if state not in determined]
        return sorted(determined), adding
