"""Drawn loops without a number that several ticks of a frame may read: closed in the frame, or
in each of its ticks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.engine._loops.algebraic import WORST_CONDITION
from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._loops.multirate import MultirateLoop
from wavesweep.engine._monodromy.batches import in_parts
from wavesweep.engine._monodromy.periodic import Ticks, frame_of, in_a_row, size_of, then

if TYPE_CHECKING:
    from wavesweep.engine._loops.block import Block

# times the frame: size of the terms of its closure, from which on it is closed in the ticks instead
CANCELS = 16.0


@dataclass(frozen=True, slots=True, eq=False)
class OpenTicks:
    """The ticks of loops cut at a number that may be read several times in a frame.

    ticks: with no inputs, except in those that the number reaches: these go from its product to the
    signal that it multiplies. frame: all of them in a row, if the number is read only a few times.
    """

    ticks: Ticks
    frame: _OpenFrame | None

    @staticmethod
    def of(drawn: MultirateLoop, closed: MultirateLoop, product: str, factor: str) -> OpenTicks:
        """Connect the ticks.

        drawn: with the number's product as an input; closed: with the number in its place, which
        determines the signals that are held. Errors: IllPosedLoopError for an algebraic loop
        without a solution.
        """
        ticks = Ticks.of(
            drawn, (factor,), alone=True, through=product, held_ports=closed.held(), terms=True
        )
        readings = sum(len(ticks.maps[kind].inputs) for kind in ticks.kind)
        with np.errstate(all="ignore"):
            # Readings of the number in a frame, up to which it is closed there.
            frame = _OpenFrame.of(ticks) if readings <= 8 else None
        return OpenTicks(ticks, frame)

    def closed(self, loops: np.ndarray | int, p: np.ndarray, *, terms: bool = False) -> Ticks:
        """Return the ticks of the loops `loops` of the batch at values p of the number; at and p
        broadcast together.

        terms: whether they have the sizes of their terms; the number's loop is as uncertain as its
        direct term lets it be.
        """
        with np.errstate(all="ignore"):
            maps = tuple(_closed(block, loops, p, terms) for block in self.ticks.maps)
        return replace(self.ticks, maps=maps)

    def frames(
        self, loops: np.ndarray | int, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | complex, np.ndarray | float]:
        """Return frames less identity `(..., n, n)`, and their pivots and conditions; see
        `closed` and `Block`."""
        with np.errstate(all="ignore"):
            frame = self.frame
            if frame is None:
                ticks = self.closed(loops, p)
                return frame_of(ticks), *ticks.facts
            loops, p = np.broadcast_arrays(loops, p)
            closures = [_closure(block, loops, p) for block in self.ticks.maps]
            pivot = reduce(np.multiply, [closure.pivot for closure in closures])
            condition = reduce(np.multiply, [closure.condition for closure in closures])
            read = [closures[kind].gain for kind in self.ticks.kind if self.ticks.maps[kind].inputs]

            def frames(index: Any) -> np.ndarray:
                gains = [gain[index] for gain in read]
                E, lost = frame.closed(loops[index], gains)
                if (
                    lost.any()
                ):  # those that would lose digits at their readings are closed in their ticks
                    E[lost] = frame_of(self.closed(loops[index][lost], p[index][lost]))
                return E

            n = frame.E.shape[-1]
            return in_parts(frames, p.shape, n, p.dtype), pivot, condition


class _Closure(NamedTuple):
    """The gain from the signal that the number multiplies to its product, and the tick's pivot
    and condition."""

    gain: np.ndarray
    pivot: np.ndarray | complex
    condition: np.ndarray | float


def _closure(block: Block, loops: np.ndarray | int, p: np.ndarray) -> _Closure:
    """Close a tick at values of the number."""
    pivot = np.asarray(block.pivot)[loops] if np.ndim(block.pivot) else block.pivot
    condition = np.asarray(block.condition)[loops] if np.ndim(block.condition) else block.condition
    if not block.inputs:
        return _Closure(p, pivot, condition)
    through = p * _of_loops(block.D, loops)[..., 0, 0]
    return_difference = 1 - through
    pivot = pivot * return_difference
    condition = condition * (1 + np.abs(through)) / np.abs(return_difference)
    gain = np.where(condition <= WORST_CONDITION, p / return_difference, np.nan)
    return _Closure(gain, pivot, condition)


def _closed(block: Block, loops: np.ndarray | int, p: np.ndarray, terms: bool) -> Block:
    """A tick with the number in place, without inputs and outputs."""
    closure = _closure(block, loops, p)
    E = _with_gain(block.E, block.B, block.C, loops, closure.gain)
    B = E[..., :0]
    C = E[..., :0, :]
    D = E[..., :0, :0]
    sizes = (_sizes_closed(block, loops, p, closure.gain), B, C, D) if terms else ()
    return replace(
        block,
        inputs=(),
        outputs=(),
        E=E,
        B=B,
        C=C,
        D=D,
        condition=closure.condition,
        pivot=closure.pivot,
        terms=sizes,
    )


def _sizes_closed(
    block: Block, loops: np.ndarray | int, p: np.ndarray, gain: np.ndarray
) -> np.ndarray:
    """The sizes of the terms of a tick with the number in place."""
    E, B, C, direct = block.terms
    if not block.inputs:
        return _with_gain(E, B, C, loops, gain)
    direct = np.where(block.D == 0, 0.0, direct)  # what cancels to nothing is nothing
    through = np.abs(p) * _of_loops(direct, loops)[..., 0, 0]
    return_difference = np.abs(1 - p * _of_loops(block.D, loops)[..., 0, 0])
    unsure = np.abs(gain) * ((1 + through) / return_difference)
    return _with_gain(E, B, C, loops, unsure)


def _with_gain(
    E: np.ndarray, B: np.ndarray, C: np.ndarray, loops: np.ndarray | int, gain: np.ndarray
) -> np.ndarray:
    """`E + B gain C` of the loops `loops`."""
    E = _of_loops(E, loops)
    if not B.shape[-1]:
        return E
    return E + _of_loops(B, loops) * gain[..., None, None] * _of_loops(C, loops)


def _of_loops(matrix: np.ndarray, loops: np.ndarray | int) -> np.ndarray:
    """A matrix of the loops `loops` of the batch; one that all loops have alike has no axis for
    them."""
    return matrix[loops] if matrix.ndim > 2 else matrix


@dataclass(frozen=True, slots=True, eq=False)
class _OpenFrame:
    """Ticks in a row, from what the number's product is at each of its readings to what it
    multiplies there.

    E `(..., n, n)` less identity; B `(..., n, readings)`; C `(..., readings, n)`; D `(...,
    readings, readings)`, how a reading depends on earlier ones (its own direct term is in
    `_closure`).
    """

    E: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    @staticmethod
    def of(ticks: Ticks) -> _OpenFrame:
        maps = [_OpenFrame(tick.E, tick.B, tick.C, 0 * tick.D) for tick in ticks.maps]
        return in_a_row(ticks.kind.tolist(), maps, _joined)

    def closed(self, loops: np.ndarray, gains: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Return the frames with these gains at the readings, `(readings, ...)`, and which have
        lost digits as terms cancel.

        A reading is known from the state and from those before it, so this is forward substitution.
        """
        E = _of_loops(self.E, loops)
        B = _of_loops(self.B, loops)
        C = _of_loops(self.C, loops)
        D = _of_loops(self.D, loops)
        eye = np.eye(E.shape[-1])
        rows: list[np.ndarray] = []
        row_sizes: list[np.ndarray] = []
        for i, gain in enumerate(gains):
            row = C[..., i, :]
            size = np.abs(row)
            for j in range(i):
                earlier = D[..., i, j, None]
                row = row + earlier * rows[j]
                size = size + np.abs(earlier) * row_sizes[j]
            rows.append(gain[..., None] * row)
            row_sizes.append(np.abs(gain)[..., None] * size)
        if not rows:
            return np.broadcast_to(E, (*loops.shape, *eye.shape)), np.zeros(loops.shape, bool)
        sizes = np.abs(eye + E) + np.abs(B) @ np.stack(row_sizes, axis=-2)
        E = E + B @ np.stack(rows, axis=-2)
        largest = np.maximum(1.0, size_of(eye + E))
        return E, size_of(sizes) > CANCELS * largest


def _joined(first: _OpenFrame, second: _OpenFrame) -> _OpenFrame:
    """One run of ticks after the other; the readings of the first come first."""
    E = then(first.E, second.E)
    B = concatenated((first.B + second.E @ first.B, second.B), -1)
    C = concatenated((first.C, second.C + second.C @ first.E), -2)
    not_yet = np.zeros((first.C.shape[-2], second.B.shape[-1]))
    across = second.C @ first.B
    earlier = concatenated((first.D, not_yet), -1)
    later = concatenated((across, second.D), -1)
    return _OpenFrame(E, B, C, concatenated((earlier, later), -2))
