"""The response from one linear system of fast states and frame, where modes cancel."""

from dataclasses import replace

import numpy as np

from wavesweep.engine.loops.block import concatenated
from wavesweep.engine.monodromy.rounding import ENTRIES
from wavesweep.engine.response.circle import Circle
from wavesweep.engine.response.linear_systems import LinearSystem, solved
from wavesweep.engine.state_space import StateSpace

MOST = 2**20  # entries of what the outputs and fast states show in a frame: a tenth of a gigabyte while they are computed


class Bordered:
    """The response from one system that holds both the fast states at the hand's frequency and the frame's states.

    Unknowns: the outputs o and the fast states Y at the hand's frequency w, and the frame's state X at its start. The fast
    states are those that change in the most frequent kind of tick, with the matrices E and C. The equations are
    `w Y = E Y + q` and `o = C Y + r`, q and r being what other states and other ticks add, `M Y = s X + t` (Y is the component
    of the fast states at w) and, of the other states, those of the frame. Together they are equivalent to `(w - E) X = g` of
    the frame. If a mode of the fast side has an alias at w, it costs no digit of Y, even if it has little or no damping;
    neither does a mode at w itself.
    """

    def __init__(self, port, over_frame, sums_of):
        common = int(np.bincount(port.kind).argmax())
        (E, _, C, _), (of_E, _, of_C, _) = port.maps[common], port.sizes[common]
        self.sums_of, self.outputs_of_port = sums_of, C.shape[-2]
        fast = _changing(E)
        self.fast, self.slow = np.flatnonzero(fast), np.flatnonzero(~fast)
        self.C, self.E = C[..., self.fast], E[..., self.fast[:, None], self.fast]
        self.dC, self.dE = ENTRIES * of_C[..., self.fast], ENTRIES * of_E[..., self.fast[:, None], self.fast]
        maps, sizes = [], []
        for tick, terms in zip(port.maps, port.sizes, strict=True):
            rows = self._outputs(tick, port.maps[common], -1.0)
            of_rows = self._outputs(terms, port.sizes[common], 0.0 if tick is port.maps[common] else 1.0)
            of_rows.C[...] = np.where(rows.C == 0, 0.0, of_rows.C)
            maps.append(rows)
            sizes.append(of_rows)
        self.stretch = over_frame(replace(port, maps=tuple(maps), sizes=tuple(sizes)))
        where = np.flatnonzero(port.position[..., 0, :].reshape(-1, E.shape[-1]).any(0)) if port.position is not None else []
        self.place = np.flatnonzero(self.fast == where[0])[0] if len(where) == 1 and fast[where[0]] else None

    def _outputs(self, tick, common, sign):
        """Return the map of a tick from the force to what it adds to the outputs and the fast states, and to these states."""
        (E, B, C, D), of_fast = tick, common.E[..., self.fast, :]
        rows = [
            (matrix + 0 * reference[..., :1], column)
            for matrix, column, reference in ((C, D, common.C), (E[..., self.fast, :], B[..., self.fast, :], of_fast))
        ]
        for (matrix, _), reference in zip(rows, (common.C, of_fast), strict=True):
            matrix[..., self.fast] += sign * reference[..., self.fast]
        states = np.eye(E.shape[-1])[self.fast]
        rows.append((np.broadcast_to(states, (*E.shape[:-2], *states.shape)), np.zeros((self.fast.size, 1))))
        return StateSpace(E, B, *(concatenated(column, -2) for column in zip(*rows, strict=True)))

    def outputs(self, points: Circle):
        """Return the outputs of the port at the hand's frequency, `(..., p, points)`, and bounds on their errors."""
        value, error = (X[..., : self.outputs_of_port, 0] for X in solved(*self._system(points)))
        return np.swapaxes(value, -1, -2), np.swapaxes(error, -1, -2)

    def _system(self, points):
        """Return matrix, right side and bounds on their errors of the system, at every point."""
        sums, M = self.sums_of(self.stretch, points), self.stretch.ticks
        p, f, n = self.outputs_of_port, self.fast.size, self.slow.size + self.fast.size
        size, batch = p + f + n, sums.driven.shape[:-2]
        A, dA = (
            np.zeros((*batch, points.frequency.size, size, size), complex),
            np.zeros((*batch, points.frequency.size, size, size)),
        )
        out, fast, slow, X = slice(0, p), slice(p, p + f), slice(p + 2 * f, None), slice(p + f, None)
        states = slice(p + f, p + 2 * f)
        A[..., : p + f, X], dA[..., : p + f, X] = (
            _at_points(-sums.rows[..., : p + f, :, :] / M),
            sums.drows[..., None, : p + f, :] / M,
        )
        A[..., states, X], dA[..., states, X] = _at_points(-sums.rows[..., p + f :, :, :]), sums.drows[..., None, p + f :, :]
        A[..., out, out], A[..., states, fast] = np.eye(p), M * np.eye(f)
        A[..., out, fast], dA[..., out, fast] = -self.C[..., None, :, :], self.dC[..., None, :, :]
        A[..., fast, fast] = points.tick[:, None, None] * np.eye(f) - self.E[..., None, :, :]
        dA[..., fast, fast] = self.dE[..., None, :, :]
        frame, unsure = (change[..., None, self.slow, :] for change in self.stretch.E)
        A[..., slow, X], dA[..., slow, X] = points.frame[:, None, None] * np.eye(n)[self.slow] - frame, unsure
        scale = np.repeat([1 / M, 1.0], [p + f, f])[:, None]
        b, db = (
            np.concatenate(
                [scale * (forced + 0 * sums.forced.real), driven[..., self.slow, :] + 0 * sums.driven[..., self.slow, :].real],
                -2,
            )
            for forced, driven in ((sums.forced, sums.driven), (sums.dforced, sums.ddriven))
        )
        b, db = (np.swapaxes(side, -1, -2).copy() for side in (b, db))
        if self.place is not None:  # w times the position is the displacement
            for array in (A, dA, b[..., None], db[..., None]):
                array[..., p + self.place, :] = 0
            A[..., p + self.place, p + self.place], A[..., p + self.place, 0] = points.tick, -1
        return LinearSystem(A, dA, b[..., None], db[..., None])


def fits(port) -> bool:
    """Whether what the system needs to know of a frame has at most MOST entries for a loop."""
    E, _, C, _ = port.maps[int(np.bincount(port.kind).argmax())]
    return (C.shape[-2] + 2 * np.count_nonzero(_changing(E))) * port.kind.size * E.shape[-1] <= MOST


def _changing(E):
    """Which states change in a tick."""
    return (E != 0).any((*range(E.ndim - 2), E.ndim - 1))


def _at_points(rows):
    return np.moveaxis(rows, -2, -3)
