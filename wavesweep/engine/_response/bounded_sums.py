"""Products and sums of matrices, with bounds on their rounding."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wavesweep.engine._loops.block import concatenated
from wavesweep.engine._monodromy.batches import sparse
from wavesweep.engine.doubles import SHORT_SUM_ROUNDING


def ordered_product(A, x):
    """Return `A x` of every loop of a batch, or at every frequency; A: `(..., m, n)`, x: `(...,
    n)`.

    No product of matrices is used, and the terms are contiguous, since the order of a sum, and with
    it the last bits of a loop, would depend on the batch that it is in. So it is with a single
    matrix of many rows with few entries.
    """
    if (few := sparse(A)) is not None:
        return (few @ x.reshape(-1, x.shape[-1]).T).T.reshape(*x.shape[:-1], len(A))
    return np.multiply(A, x[..., None, :], order="C").sum(-1)


def ordered_products(A: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Return `A X` as `ordered_product` does it; X: `(..., n, k)`."""
    return np.multiply(A[..., :, None, :], X.mT[..., None, :, :], order="C").sum(-1)


def long_sum(count: int) -> float:
    """Return the relative error of a sum of `count` products; errors of either sign grow as the
    root of their number."""
    return SHORT_SUM_ROUNDING * (4 + count**0.5)


class Bounded(NamedTuple):
    """A matrix, perhaps of each loop of a batch, and bounds on the errors of its entries.

    Sums and products are such pairs as well, with the bounds that follow, rounding included.
    """

    value: np.ndarray
    error: np.ndarray | float

    def __add__(self, other: "Bounded") -> "Bounded":  # type: ignore[override] # of tuples
        rounding = SHORT_SUM_ROUNDING * (np.abs(self.value) + np.abs(other.value))
        return Bounded(self.value + other.value, self.error + other.error + rounding)

    def __neg__(self) -> "Bounded":
        return Bounded(-self.value, self.error)

    def __sub__(self, other: "Bounded") -> "Bounded":
        return self + -other

    def __matmul__(self, other: "Bounded") -> "Bounded":
        size = np.abs(other.value)
        of_other = other.error + SHORT_SUM_ROUNDING * size
        error = self.error @ (size + other.error) + np.abs(self.value) @ of_other
        return Bounded(self.value @ other.value, error)

    def scaled(self, factor: np.ndarray) -> "Bounded":
        """Return the matrix times an exact factor."""
        error = np.abs(factor) * (self.error + SHORT_SUM_ROUNDING * np.abs(self.value))
        return Bounded(factor * self.value, error)

    @property
    def mT(self) -> "Bounded":
        """The transpose."""
        return Bounded(self.value.mT, self.error.mT)

    @staticmethod
    def joined(pairs: Sequence[tuple[np.ndarray, np.ndarray]], axis: int) -> "Bounded":
        """Return matrices joined along an axis."""
        values, errors = zip(*pairs, strict=True)
        return Bounded(concatenated(values, axis), concatenated(errors, axis))
