"""The response from one linear system of fast states and frame, where modes cancel."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._response.circle import Circle
from wavesweep.engine._state_space import StateSpace
from wavesweep.engine.doubles import ENTRY_ROUNDING

if TYPE_CHECKING:
    from collections.abc import Callable

    from wavesweep.engine._response.port import Port

# entries of what the outputs and fast states show in a frame: a tenth of a gigabyte while they are
# computed
FRAME_ENTRIES_AT_ONCE = 2**20


class Bordered:
    """The response from one system that holds both the fast states at the hand's frequency and the
    frame's states.

    Unknowns: the outputs o and the fast states Y at the hand's frequency, z = e^(j w T) and
    w = z - 1 in what follows, and the frame's state X at its start. The fast states are those that
    change in the most frequent kind of tick, the common one, with the matrices E and C. The
    equations are `w Y = E Y + q` and `o = C Y + r`, `M Y = s X + t` and, of the other states, those
    of the frame. M is the number of its ticks; `s X + t` is the sum over its ticks i of z^-i x_i, x_i
    being the fast states in tick i, and q and r are the means of z^-i times what tick i adds to their
    change and to the outputs beyond E x_i and C x_i. Together they are equivalent to
    `(z^M - 1 - E) X = g` with E and g of the frame. If a mode of the fast side has an alias at z, it
    costs no digit of Y, even if it has little or no damping; neither does a mode at z itself.
    """

    def __init__(
        self,
        port: Port,
        over_frame: Callable[[Port], Any],
        sums_of: Callable[[Any, Circle], Any],
    ) -> None:
        """over_frame, sums_of: `Stretch.of` and `Sums.of` of `lifted`, which imports this module."""
        common = int(np.bincount(port.kind).argmax())
        E, _, C, _ = port.maps[common]
        of_E, _, of_C, _ = port.sizes[common]
        self.sums_of = sums_of
        self.outputs_of_port = C.shape[-2]
        fast = _changing(E)
        self.fast = np.flatnonzero(fast)
        self.slow = np.flatnonzero(~fast)
        among_fast = self.fast[:, None], self.fast
        self.C = C[..., self.fast]
        self.E = E[..., *among_fast]
        self.dC = ENTRY_ROUNDING * of_C[..., self.fast]
        self.dE = ENTRY_ROUNDING * of_E[..., *among_fast]
        # Sums over the frame of these outputs of its ticks are r, q and s X + t.
        maps = []
        sizes = []
        # The common tick adds nothing by fast states, exactly; of others the sizes of both add up.
        for tick, terms in zip(port.maps, port.sizes, strict=True):
            rows = self._outputs(tick, port.maps[common], -1.0)
            of_rows = self._outputs(
                terms, port.sizes[common], 0.0 if tick is port.maps[common] else 1.0
            )
            of_rows.C[...] = np.where(rows.C == 0, 0.0, of_rows.C)
            maps.append(rows)
            sizes.append(of_rows)
        self.stretch = over_frame(replace(port, maps=tuple(maps), sizes=tuple(sizes)))
        self.place = None  # which fast state the position is, times `reads`, if it is one alone
        if port.position is not None:
            read = port.position[..., 0, :].reshape(-1, E.shape[-1]).any(0)
            where = np.flatnonzero(read)
            if len(where) == 1 and fast[where[0]]:
                self.place = np.flatnonzero(self.fast == where[0])[0]
                self.reads = port.position[..., 0, where]

    def _outputs(self, tick: StateSpace, common: StateSpace, sign: float) -> StateSpace:
        """Return the map of a tick from the force to C and E_fast of the tick plus `sign` times those
        of the common one among fast states, and to the fast states themselves."""
        E, B, C, D = tick
        outputs = C + 0 * common.C[..., :1]
        outputs[..., self.fast] += sign * common.C[..., self.fast]
        of_fast = common.E[..., self.fast, :]
        changes = E[..., self.fast, :] + 0 * of_fast[..., :1]
        changes[..., self.fast] += sign * of_fast[..., self.fast]
        states = np.eye(E.shape[-1])[self.fast]
        states = np.broadcast_to(states, (*E.shape[:-2], *states.shape))
        no_force = np.zeros((self.fast.size, 1))
        rows = concatenated((outputs, changes, states), -2)
        columns = concatenated((D, B[..., self.fast, :], no_force), -2)
        return StateSpace(E, B, rows, columns)

    def outputs(self, points: Circle) -> Bounded:
        """Return the outputs of the port at the hand's frequency, `(..., p, points)`, and bounds
        on their errors."""
        A, b = self._system(points)
        return A.solved(b).part(..., slice(self.outputs_of_port), 0).mT

    def _system(self, points: Circle) -> tuple[Bounded, Bounded]:
        """Return matrix and right side of the system, at every point."""
        sums = self.sums_of(self.stretch, points)
        M = self.stretch.ticks
        p = self.outputs_of_port
        f = self.fast.size
        n = self.slow.size + f
        size = p + f + n
        shape = (*sums.driven.shape[:-2], points.frequency.size, size, size)
        A = np.zeros(shape, complex)
        dA = np.zeros(shape)
        # Columns of the outputs o, of the component Y of the fast states at w, and of the state X
        # of the frame. Rows of o, of Y, of what makes that component, and of the slow states of the
        # frame.
        o = slice(0, p)
        Y = slice(p, p + f)
        X = slice(p + f, None)
        component = slice(p + f, p + 2 * f)
        slow = slice(p + 2 * f, None)
        A[..., : p + f, X] = _at_points(-sums.rows[..., : p + f, :, :] / M)
        dA[..., : p + f, X] = sums.drows[..., None, : p + f, :] / M
        A[..., component, X] = _at_points(-sums.rows[..., p + f :, :, :])
        dA[..., component, X] = sums.drows[..., None, p + f :, :]
        A[..., o, o] = np.eye(p)
        A[..., component, Y] = M * np.eye(f)
        A[..., o, Y] = -self.C[..., None, :, :]
        dA[..., o, Y] = self.dC[..., None, :, :]
        A[..., Y, Y] = points.tick[:, None, None] * np.eye(f) - self.E[..., None, :, :]
        dA[..., Y, Y] = self.dE[..., None, :, :]
        E, dE = (change[..., None, self.slow, :] for change in self.stretch.E)
        A[..., slow, X] = points.frame[:, None, None] * np.eye(n)[self.slow] - E
        dA[..., slow, X] = dE
        # On the right is what the force adds: to o and Y as means over the ticks, r = forced/M and
        # q = forced/M, to the component t = forced, and to the slow states g = driven.
        forced = Bounded(*np.broadcast_arrays(sums.forced, sums.dforced))
        driven = Bounded(*np.broadcast_arrays(sums.driven, sums.ddriven))
        added = [
            forced.part(..., slice(p + f), slice(None)) * (1 / M),
            forced.part(..., slice(p + f, None), slice(None)),
            driven.part(..., self.slow, slice(None)),
        ]
        b, db = Bounded.joined(added, -2).each(lambda side: side.mT[..., None].copy())
        if self.place is not None:  # w times the position is the displacement
            row = p + self.place
            for array in (A, dA, b, db):
                array[..., row, :] = 0
            A[..., row, row] = self.reads * points.tick
            dA[..., row, row] = ENTRY_ROUNDING * np.abs(A[..., row, row])
            A[..., row, 0] = -1
        return Bounded(A, dA), Bounded(b, db)


def fits(port: Port) -> bool:
    """Whether what the system needs to know of a frame has at most FRAME_ENTRIES_AT_ONCE entries
    for a loop."""
    E, _, C, _ = port.maps[int(np.bincount(port.kind).argmax())]
    return (C.shape[-2] + 2 * np.count_nonzero(_changing(E))) * port.kind.size * E.shape[
        -1
    ] <= FRAME_ENTRIES_AT_ONCE


def _changing(E: np.ndarray) -> np.ndarray:
    """Which states change in a tick."""
    return (E != 0).any((*range(E.ndim - 2), E.ndim - 1))


def _at_points(rows: np.ndarray) -> np.ndarray:
    return np.moveaxis(rows, -2, -3)
