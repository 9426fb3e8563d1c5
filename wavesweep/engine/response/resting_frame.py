"""The stiffness that the hand feels at rest of a loop whose number is one scalar gain of its frame, from that frame.

A position that only adds up the states of a loop, and is read by none, depends on how it got there: a tick (see `resting`) does
not determine it, a frame does.
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.loops.multirate import MultirateLoop
from wavesweep.engine.loops.ports import Ports
from wavesweep.engine.monodromy.drift import TickDrift, counted_row
from wavesweep.engine.monodromy.open_frame import OpenFrame
from wavesweep.engine.monodromy.rounding import ROUNDING
from wavesweep.engine.response.linear_systems import solved
from wavesweep.engine.response.resting import Resting

SURELY = 2  # a sum below so many bounds on its rounding counts as 0


def shows_at_rest(drawn: MultirateLoop, ports: Ports, read: tuple[str, ...]) -> bool:
    """Whether the force against the hand can be seen in any tick by what is held for the loop alone; read: see `open_frame`."""
    held, placed = drawn.held(read), {each.block.name: each for each in drawn.placed}
    parts = (source.rpartition(".") for source in drawn.sources(ports.reaction))
    return bool(ports.reaction) and all(
        name in placed and (placed[name].every == 1 or port in held[name]) for name, _, port in parts if name
    )


def resting_frame(drawn: MultirateLoop, ports: Ports, frame: OpenFrame, drift: TickDrift) -> Resting | None:
    """Return the loops at rest, free in the number that the frame is without; None if the frame does not determine them.

    frame: with the hand's force; its signals are first the one that the number multiplies, then perhaps the one that another
    number of the same sum multiplies, and last the force against the hand. drift: that of the open loop.

    Unknowns X are the states that the two signals depend on, and the number's product F. At rest `E X + B F + g = 0` and
    `C X + D F + d = r`; r is the signal that the number multiplies. A share of the position that no state reads changes in a
    frame by `G X + H F + h`. With `l (E, B; C, D) = (G, H)` it changes by the hand's force alone if it is counted from `l X`:
    not at all in the mean, if something holds the device, and then it keeps the first moment of the force over the frame.
    Accuracy: errors follow from the bounds on those of the frame's entries.
    """
    position = _position(drawn, ports.position, frame.ticks.states)
    if drift.folded or position is None:
        return None
    position = counted_row(position, frame.counted)
    with np.errstate(all="ignore"):
        return _Equations.of(frame, drift, position).resting(drawn.ticks)


def _position(drawn, signal, states):
    """The row of a position over the states of a frame; None if it is more than a sum of them."""
    row, blocks = np.zeros((1, len(states))), {each.block.name: each for each in drawn.placed}
    for source, gain in drawn.sums.get(signal, {signal: 1.0}).items():
        name, _, port = source.rpartition(".")
        if name not in blocks or blocks[name].every > 1:
            return None
        block = blocks[name].block
        at = block.outputs.index(port)
        if np.any(block.D[..., at, :]):
            return None
        part = np.asarray(gain)[..., None, None] * block.C[..., at : at + 1, :]
        more = np.zeros((*part.shape[:-1], len(states)))
        more[..., [states.index(f"{name}.{state}") for state in block.states]] = part
        row = row + more
    return row


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """The equations at rest, and the sizes of the terms of their entries, times their rounding.

    P `(..., n + 3, n + 3)`: rows of the states, those that leads move being counted from them, of the signal that the number
    multiplies, of the force against the hand and of the position, and perhaps a further one of the signal that another number
    multiplies; columns of the states, of the product, and of a hand's force that is constant, and of one that grows with every
    tick.
    """

    P: np.ndarray
    dP: np.ndarray

    @classmethod
    def of(cls, frame, drift, position):
        n, shown_sizes = len(frame.ticks.states), (frame.dC, frame.dD)
        sizes = frame.dE + ROUNDING * np.abs(frame.E), frame.dB + ROUNDING * np.abs(frame.B)
        leads = [lead for lead, _ in drift.moved]
        order = [state for state in range(n) if state not in leads] + leads
        parts = (frame.E, frame.B), sizes
        place, still = (position, np.zeros((1, 3))), (ROUNDING * np.abs(position), np.zeros((1, 3)))
        rows = (frame.C, frame.D), shown_sizes
        beside = frame.C.shape[-2] > 2
        rows = [
            [tuple(part[..., some, :] for part in each) if some else own for some in ([0, -1], [], [1])[: 2 + beside]]
            for each, own in zip(rows, (place, still), strict=True)
        ]
        both = []
        for (E, B), signals in zip(parts, rows, strict=True):
            batch = np.broadcast_shapes(*(part.shape[:-2] for part in (E, B, frame.C, frame.D, position)))
            P = np.zeros((*batch, n + 3 + beside, n + 3))
            P[..., :n, : n - len(leads)], P[..., :n, n:] = E[..., order, :][..., order[: n - len(leads)]], B[..., order, :]
            for at, (C, D) in zip((slice(n, n + 2), slice(n + 2, n + 3), slice(n + 3, n + 4)), signals, strict=False):
                P[..., at, :n], P[..., at, n:] = C[..., order], D
            both.append(P)
        return cls(*both)

    def resting(self, ticks) -> Resting:
        """The loops at rest; ticks: of the frame."""
        n, P, dP = self.P.shape[-1] - 3, self.P, self.dP
        known, adding = self._unknowns(n)
        at = np.array([*known, n])
        A, dA = (np.ascontiguousarray(part[..., at[:, None], at]) for part in (P, dP))
        right, unsure = np.zeros((2, *A.shape[:-1], 2))
        right[..., 0], unsure[..., 0], right[..., -1, 1] = -P[..., at, n + 1], dP[..., at, n + 1], 1
        if adding:
            inverse = solved(A, dA, np.broadcast_to(np.eye(at.size), A.shape), np.zeros_like(A))
            X = _product(inverse, (right, unsure))
        else:
            X, inverse = solved(A, dA, right, unsure), (0 * A, 0 * A)
        # Of the share of the position that is read by no state: the change in a frame, and what it is counted from.
        share = P[..., n + 2 : n + 3, :][..., adding]
        change, of_change = share @ P[..., adding, :], np.abs(share) @ dP[..., adding, :]
        law = _product((change[..., at], of_change[..., at]), inverse)
        hand = P[..., at, n + 1 :], dP[..., at, n + 1 :]
        kept = (change[..., n + 1 :], of_change[..., n + 1 :]), _product(law, hand)
        kept = kept[0][0] - kept[1][0], kept[0][1] + kept[1][1]
        held = (np.abs(kept[0][..., 0]) <= SURELY * kept[1][..., 0]) & (np.abs(law[0][..., -1]) <= SURELY * law[1][..., -1])
        own = [part[..., n + 2 : n + 3, :][..., at] for part in (P, dP)]
        for part, more in zip(own, law, strict=True):
            part[..., :-1] += more[..., :-1]
        one = np.zeros_like(A[..., :1, :])
        one[..., -1] = 1
        force, beside = (
            [part[..., rows, :][..., at] for part in (P, dP)] for rows in (slice(n + 1, n + 2), slice(n + 3, None))
        )
        rows = [np.concatenate(parts, axis=-2) for parts in zip(own, force, (one, 0 * one), beside, strict=True)]
        shown, error = _product(rows, X)
        for part, moment, reaction in zip((shown, error), kept, (P, dP), strict=True):
            part[..., 0, 0] += moment[..., 0, 1] / ticks
            part[..., 1, 0] += reaction[..., n + 1, n + 1]
            part[..., 3:, 0] += reaction[..., n + 3 :, n + 1]
        error[..., 0, :] = np.where(held, error[..., 0, :], np.inf)
        return Resting(*(part.reshape(-1, *part.shape[-2:]) for part in (shown, error)), True)

    def _unknowns(self, n):
        """Indices of the states that the signals depend on, and of those that the position alone reads."""
        reads = (self.P != 0).any(tuple(range(self.P.ndim - 2)))[:, :n]
        shown = np.flatnonzero(reads[n + 2]).tolist()
        rows, known = [n, n + 1, *range(n + 3, self.P.shape[-2]), *shown], set()
        for row in rows:
            more = set(np.flatnonzero(reads[row]).tolist()) - known
            known |= more
            rows += sorted(more)
        return sorted(known), [state for state in shown if state not in known]


def _product(one, other):
    """The product of two matrices, each a pair with bounds on the errors of its entries; in a batch as for one loop alone."""
    (a, da), (b, db) = ([np.ascontiguousarray(part) for part in each] for each in (one, other))
    size, sizes = np.abs(a), np.abs(b)
    return a @ b, da @ (sizes + db) + size @ (db + a.shape[-1] * ROUNDING * sizes)
