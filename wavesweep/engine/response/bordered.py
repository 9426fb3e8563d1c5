"""The response from one linear system of fast states and frame, where modes cancel."""

from dataclasses import replace

import numpy as np

from wavesweep.engine.monodromy.rounding import ENTRIES
from wavesweep.engine.response.circle import Circle
from wavesweep.engine.response.linear_systems import solved


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
        fast = (E != 0).any((*range(E.ndim - 2), E.ndim - 1))
        self.fast, self.slow = np.flatnonzero(fast), np.flatnonzero(~fast)
        self.C, self.E = C[..., self.fast], E[..., self.fast[:, None], self.fast]
        self.dC, self.dE = ENTRIES * of_C[..., self.fast], ENTRIES * of_E[..., self.fast[:, None], self.fast]
        maps, sizes = [], []
        for parts, of_parts in zip(port.maps, port.sizes, strict=True):
            maps.append(self._outputs(parts, port.maps[common], -1.0))
            sizes.append(self._outputs(of_parts, port.sizes[common], 0.0 if parts is port.maps[common] else 1.0))
        for one, size in zip(maps, sizes, strict=True):
            size[2][...] = np.where(one[2] == 0, 0.0, size[2])
        self.stretch = over_frame(replace(port, maps=tuple(maps), sizes=tuple(sizes)))
        where = np.flatnonzero(port.position[..., 0, :].reshape(-1, E.shape[-1]).any(0)) if port.position is not None else []
        self.place = np.flatnonzero(self.fast == where[0])[0] if len(where) == 1 and fast[where[0]] else None

    def _outputs(self, parts, common, sign):
        """Return the map of a tick from the force to what it adds to the outputs and the fast states, and to these states."""
        E, B, C, D = parts
        shown = [
            (part + 0 * rest[..., :1], column)
            for part, column, rest in (
                (C, D, common[2]),
                (E[..., self.fast, :], B[..., self.fast, :], common[0][..., self.fast, :]),
            )
        ]
        for (part, _), rest in zip(shown, (common[2], common[0][..., self.fast, :]), strict=True):
            part[..., self.fast] += sign * rest[..., self.fast]
        states = np.eye(E.shape[-1])[self.fast]
        shown.append((np.broadcast_to(states, (*E.shape[:-2], *states.shape)), np.zeros((self.fast.size, 1))))
        rows = [np.broadcast_shapes(*(part.shape[:-2] for part in column)) for column in zip(*shown, strict=True)]
        C, D = (
            np.concatenate([np.broadcast_to(part, (*batch, *part.shape[-2:])) for part in column], axis=-2)
            for column, batch in zip(zip(*shown, strict=True), rows, strict=True)
        )
        return E, B, C, D

    def outputs(self, points: Circle):
        """Return the outputs of the port at the hand's frequency, `(..., p, points)`, and bounds on their errors."""
        A, dA, b, db = self._system(points)
        found, error = (part[..., : self.outputs_of_port, 0] for part in solved(A, dA, b[..., None], db[..., None]))
        return np.swapaxes(found, -1, -2), np.swapaxes(error, -1, -2)

    def _system(self, points):
        """Return matrix, errors, right side and errors of the system, at every point."""
        sums, M = self.sums_of(self.stretch, points), self.stretch.ticks
        p, f, n = self.outputs_of_port, self.fast.size, self.slow.size + self.fast.size
        size, batch = p + f + n, sums.left.shape[:-2]
        A, dA = (
            np.zeros((*batch, points.frequency.size, size, size), complex),
            np.zeros((*batch, points.frequency.size, size, size)),
        )
        out, own, states, slow, X = (
            slice(0, p),
            slice(p, p + f),
            slice(p + f, p + 2 * f),
            slice(p + 2 * f, None),
            slice(p + f, None),
        )
        A[..., : p + f, X], dA[..., : p + f, X] = (
            _at_points(-sums.rows[..., : p + f, :, :] / M),
            sums.drows[..., None, : p + f, :] / M,
        )
        A[..., states, X], dA[..., states, X] = _at_points(-sums.rows[..., p + f :, :, :]), sums.drows[..., None, p + f :, :]
        A[..., out, out], A[..., states, own] = np.eye(p), M * np.eye(f)
        A[..., out, own], dA[..., out, own] = -self.C[..., None, :, :], self.dC[..., None, :, :]
        A[..., own, own] = points.tick[:, None, None] * np.eye(f) - self.E[..., None, :, :]
        dA[..., own, own] = self.dE[..., None, :, :]
        frame, unsure = (part[..., None, self.slow, :] for part in self.stretch.E)
        A[..., slow, X], dA[..., slow, X] = points.frame[:, None, None] * np.eye(n)[self.slow] - frame, unsure
        scale = np.repeat([1 / M, 1.0], [p + f, f])[:, None]
        b, db = (
            np.concatenate(
                [scale * (part + 0 * sums.own.real), more[..., self.slow, :] + 0 * sums.left[..., self.slow, :].real], -2
            )
            for part, more in ((sums.own, sums.left), (sums.down, sums.dleft))
        )
        b, db = (np.swapaxes(part, -1, -2).copy() for part in (b, db))
        if self.place is not None:  # w times the position is the displacement
            for array in (A, dA, b[..., None], db[..., None]):
                array[..., p + self.place, :] = 0
            A[..., p + self.place, p + self.place], A[..., p + self.place, 0] = points.tick, -1
        return A, dA, b, db


def _at_points(rows):
    return np.moveaxis(rows, -2, -3)
