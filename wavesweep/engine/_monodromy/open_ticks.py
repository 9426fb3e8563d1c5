"""Drawn loops without a number that several ticks of a frame may read: closed in the frame, or in each of its ticks."""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np

from wavesweep.engine._loops.algebraic import WORST_CONDITION
from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.batches import in_parts
from wavesweep.engine._monodromy.periodic import Ticks, frame_of, in_a_row, size_of, then

MOST_READINGS = 8  # of the number in a frame, up to which it is closed there
CANCELS = 16.0  # times the frame: size of the terms of its closure, from which on it is closed in the ticks instead


@dataclass(frozen=True, slots=True, eq=False)
class OpenTicks:
    """The ticks of loops cut at a number that may be read several times in a frame.

    ticks: with no inputs, except in those that the number reaches: these go from its product to the signal that it multiplies.
    frame: all of them in a row, if the number is read only a few times.
    """

    ticks: Ticks
    frame: "_OpenFrame | None"

    @staticmethod
    def of(drawn: MultirateLoop, closed: MultirateLoop, product: str, factor: str) -> "OpenTicks":
        """Connect the ticks.

        drawn: with the number's product as an input; closed: with the number in its place, which determines the signals that
        are held.
        Errors: IllPosedLoopError for an algebraic loop without a solution.
        """
        ticks = Ticks.of(drawn, (factor,), alone=True, through=product, held=closed.held(), terms=True)
        readings = sum(len(ticks.maps[kind].inputs) for kind in ticks.kind)
        with np.errstate(all="ignore"):
            return OpenTicks(ticks, _OpenFrame.of(ticks) if readings <= MOST_READINGS else None)

    def closed(self, at: np.ndarray | int, p: np.ndarray, *, terms: bool = False) -> Ticks:
        """Return the ticks of the loops `at` of the batch at values p of the number; at and p broadcast together.

        terms: whether they have the sizes of their terms; the number's loop is as uncertain as its direct term lets it be.
        """
        with np.errstate(all="ignore"):
            return replace(self.ticks, maps=tuple(_closed(block, at, p, terms) for block in self.ticks.maps))

    def frames(self, at: np.ndarray | int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return frames less identity `(..., n, n)`, and their pivots and conditions; see `closed` and `Block`."""
        with np.errstate(all="ignore"):
            if self.frame is None:
                ticks = self.closed(at, p)
                return frame_of(ticks), *ticks.facts
            at, p = np.broadcast_arrays(at, p)
            closures = [_closure(block, at, p) for block in self.ticks.maps]
            read = [closures[kind][0] for kind in self.ticks.kind if self.ticks.maps[kind].inputs]
            n = self.frame.E.shape[-1]
            E = in_parts(lambda index: self._frames(at[index], p[index], [gain[index] for gain in read]), p.shape, n, p.dtype)
            _, pivots, conditions = zip(*closures, strict=True)
            return E, reduce(np.multiply, pivots), reduce(np.multiply, conditions)

    def _frames(self, at, p, gains):
        """Return frames closed at their readings; those that would lose digits by it are closed in their ticks."""
        E, lost = self.frame.closed(at, gains)
        if lost.any():
            E[lost] = frame_of(self.closed(at[lost], p[lost]))
        return E


def _closure(block, at, p):
    """Return the gain from the signal that the number multiplies to its product, and the tick's pivot and condition."""
    pivot, condition = (np.asarray(fact)[at] if np.ndim(fact) else fact for fact in (block.pivot, block.condition))
    if not block.inputs:
        return p, pivot, condition
    through = p * (block.D[at] if block.D.ndim > 2 else block.D)[..., 0, 0]
    condition, pivot = condition * (1 + np.abs(through)) / np.abs(1 - through), pivot * (1 - through)
    return np.where(condition <= WORST_CONDITION, p / (1 - through), np.nan), pivot, condition


def _closed(block, at, p, terms):
    gain, pivot, condition = _closure(block, at, p)
    E = _with_gain((block.E, block.B, block.C), at, gain)
    sizes = (_sizes_closed(block, at, p, gain), E[..., :0], E[..., :0, :], E[..., :0, :0]) if terms else None
    nothing = {"inputs": (), "outputs": (), "B": E[..., :0], "C": E[..., :0, :], "D": E[..., :0, :0]}
    return replace(block, E=E, condition=condition, pivot=pivot, terms=sizes, **nothing)


def _sizes_closed(block, at, p, gain):
    E, B, C, direct = block.terms
    if not block.inputs:
        return _with_gain((E, B, C), at, gain)
    direct = np.where(block.D == 0, 0.0, direct)  # what cancels to nothing is nothing
    size, through = np.abs(gain), np.abs(p) * (direct[at] if direct.ndim > 2 else direct)[..., 0, 0]
    return _with_gain((E, B, C), at, size * (size / np.abs(p) * (1 + through)))


def _with_gain(matrices, at, gain):
    E, B, C = (matrix[at] if matrix.ndim > 2 else matrix for matrix in matrices)
    return E + B * gain[..., None, None] * C if B.shape[-1] else E


@dataclass(frozen=True, slots=True, eq=False)
class _OpenFrame:
    """Ticks in a row, from what the number's product is at each of its readings to what it multiplies there.

    E `(..., n, n)` less identity; B `(..., n, readings)`; C `(..., readings, n)`; D `(..., readings, readings)`, how a
    reading depends on earlier ones (its own direct term is in `_closure`).
    """

    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    @staticmethod
    def of(ticks: Ticks) -> "_OpenFrame":
        return in_a_row(ticks.kind.tolist(), [_OpenFrame(tick.E, tick.B, tick.C, 0 * tick.D) for tick in ticks.maps], _joined)

    def closed(self, at, gains) -> tuple[np.ndarray, np.ndarray]:
        """Return the frames with these gains at the readings, `(readings, ...)`, and which have lost digits as terms cancel.

        A reading is known from the state and from those before it, so this is forward substitution.
        """
        E, B, C, D = (matrix[at] if matrix.ndim > 2 else matrix for matrix in (self.E, self.B, self.C, self.D))
        eye, rows, row_sizes = np.eye(E.shape[-1]), [], []
        for i, gain in enumerate(gains):
            row, size = C[..., i, :], np.abs(C[..., i, :])
            for j in range(i):
                row, size = row + D[..., i, j, None] * rows[j], size + np.abs(D[..., i, j, None]) * row_sizes[j]
            rows.append(gain[..., None] * row)
            row_sizes.append(np.abs(gain)[..., None] * size)
        if not rows:
            return np.broadcast_to(E, (*at.shape, *eye.shape)), np.zeros(at.shape, bool)
        sizes = np.abs(eye + E) + np.abs(B) @ np.stack(row_sizes, axis=-2)
        E = E + B @ np.stack(rows, axis=-2)
        return E, size_of(sizes) > CANCELS * np.maximum(1.0, size_of(eye + E))


def _joined(first, second):
    across, nothing = second.C @ first.B, np.zeros((first.C.shape[-2], second.B.shape[-1]))
    E = then(first.E, second.E)
    B = concatenated((first.B + second.E @ first.B, second.B), -1)
    C = concatenated((first.C, second.C + second.C @ first.E), -2)
    return _OpenFrame(E, B, C, concatenated((concatenated((first.D, nothing), -1), concatenated((across, second.D), -1)), -2))
