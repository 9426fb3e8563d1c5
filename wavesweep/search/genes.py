"""Designs as numbers from 0 to 1, in which a search moves, and the conversion in both directions."""

from collections.abc import Mapping, Sequence

import numpy as np

from wavesweep.spec import Axis


def designs_of(vary: Sequence[Axis], genes: np.ndarray) -> dict[str, np.ndarray]:
    """Return path -> value of each design from its genes, `(designs, axes)` in [0, 1].

    Choices divide the unit interval into equal parts.
    """
    found = {}
    for axis, gene in zip(vary, genes.T, strict=True):
        if axis.values:
            at = np.minimum((gene * len(axis.values)).astype(int), len(axis.values) - 1)
            found[axis.path] = np.asarray(axis.values)[at]
        elif axis.scale == "log":
            value = np.exp(np.log(axis.start) + gene * (np.log(axis.stop) - np.log(axis.start)))
            found[axis.path] = np.clip(value, axis.start, axis.stop)
        else:
            found[axis.path] = np.clip(axis.start + gene * (axis.stop - axis.start), axis.start, axis.stop)
    return found


def genes_of(vary: Sequence[Axis], values: Mapping[str, object]) -> np.ndarray:
    """Return the genes of one design, `(axes,)`; a value beyond its range is moved to the end of the range."""
    genes = []
    for axis in vary:
        value = values[axis.path]
        if axis.values:
            at = int(np.argmin(np.abs(np.asarray(axis.values, float) - value)))
            genes.append((at + 0.5) / len(axis.values))
        elif axis.scale == "log":
            low, high = np.log(axis.start), np.log(axis.stop)
            genes.append((np.log(max(value, axis.start)) - low) / (high - low))
        else:
            genes.append((value - axis.start) / (axis.stop - axis.start))
    return np.clip(genes, 0.0, 1.0)


def differing(vary: Sequence[Axis], genes: np.ndarray, found: np.ndarray, apart: float, most: int) -> np.ndarray:
    """Return the indices of the first designs that differ from those found, and from each other.

    They differ if a number is another choice, or another by a share `apart` of its range. genes: `(designs, axes)`, the best
    first; found: the same of others. most: of them.
    """
    few = np.array([len(axis.values or ()) for axis in vary])
    part = np.where(few > 0, np.minimum(np.floor(genes * few), few - 1), genes)
    seen = [*np.where(few > 0, np.minimum(np.floor(found * few), few - 1), found)]
    chosen = []
    for at, each in enumerate(part):
        if len(chosen) < most and all((np.abs(each - other) >= apart).any() for other in seen):
            chosen.append(at)
            seen.append(each)
    return np.array(chosen, dtype=int)
