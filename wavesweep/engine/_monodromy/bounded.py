"""Matrices with bounds on the errors of their entries; for each operation the one rule of its
rounding.

Doubles round the result of an operation by at most u = 2^-53 of it, so a real sum of n products is
off by at most

    gamma_n = n u / (1 - n u)

of the sum of their sizes: in any order, in blocks or with the registers of any BLAS, and with fused
multiplications too, each of which has one rounding where products and sums have two (N. J. Higham,
Accuracy and Stability of Numerical Algorithms, 2002, sections 3.1 and 4.2). Real and imaginary
part of a complex sum are such sums of 2 n products, and by Cauchy's inequality their sizes are at
most those of the complex products: the sum is off by at most sqrt(2) gamma_2n of their sizes. A
product that underflows is off by 2^-1075 in addition; sums lose nothing there.

Bounds are computed in doubles as well, from terms none of which is negative: those of n products,
with their sizes, are right to n + 8 roundings, and are taken larger by as many.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._loops.block import concatenated, numbers
from wavesweep.engine._monodromy.unit_circle import inverse
from wavesweep.engine.doubles import (
    EPS,
    FEW_ROUNDINGS,
    LEAST_NORMAL,
    SMALLEST_DOUBLE,
    UNIT_ROUNDING,
)


def sum_rounding(terms: int, of_complex: bool = False) -> float:
    """Return by how much rounding moves a sum of so many products at most, as a share of the sum of
    their sizes."""
    if of_complex:
        return 2**0.5 * sum_rounding(2 * terms)
    return terms * UNIT_ROUNDING / (1 - terms * UNIT_ROUNDING)


def _sizes(
    times: Callable[[np.ndarray, np.ndarray], np.ndarray], a: np.ndarray, b: np.ndarray
) -> np.ndarray:
    """Return a product of sizes. One that is not known, infinite, leaves what it is multiplied with
    by 0 as it is, which a BLAS does not: some multiply it by zeros of their own."""
    with np.errstate(invalid="ignore"):
        product = times(a, b)
    if np.isfinite(product).all():
        return product
    known_a = np.isfinite(a)
    known_b = np.isfinite(b)
    product = times(np.where(known_a, a, 0.0), np.where(known_b, b, 0.0))
    lost = times((~known_a).astype(float), (b != 0).astype(float))
    lost = lost + times((a != 0).astype(float), (~known_b).astype(float))
    return np.where(lost > 0, np.inf, product)


def _least_positive(sizes: np.ndarray) -> float:
    """The least size that is not 0; infinite if all are. (A reduction with a mask of numpy takes
    twice as long.)"""
    return np.where(sizes > 0, sizes, np.inf).min(initial=np.inf)


class Bounded(NamedTuple):
    """A matrix, perhaps of each loop of a batch, and bounds on the errors of its entries.

    What the operations give is such a pair as well: its bound holds for whatever the operation
    gives, without rounding, of matrices within the bounds of its operands. An infinite bound knows
    nothing.
    """

    value: np.ndarray
    error: np.ndarray

    @classmethod
    def exact(cls, value: np.ndarray | float) -> Bounded:
        """Return a matrix that is known as it is."""
        return cls(numbers(value), np.zeros(np.shape(value)))

    @property
    def size(self) -> np.ndarray:
        """What the entries of the true matrix are at most."""
        return np.abs(self.value) + self.error

    def each(self, change: Callable[[np.ndarray], np.ndarray]) -> Bounded:
        """Return the entries in other places, such as another shape."""
        return Bounded(change(self.value), change(self.error))

    def part(self, *index) -> Bounded:  # type: ignore[no-untyped-def] # whatever arrays take
        """Return the entries at an index, contiguous: the order of a sum in a product depends on
        how its matrices lie, and may not depend on the batch."""
        return self.each(lambda entries: np.asarray(entries[index], order="C"))

    @property
    def mT(self) -> Bounded:
        """The transpose."""
        return Bounded(self.value.mT, self.error.mT)

    @property
    def real(self) -> Bounded:
        """The real part."""
        return Bounded(self.value.real, self.error)

    def __neg__(self) -> Bounded:
        return Bounded(-self.value, self.error)

    def __add__(self, other: Bounded) -> Bounded:  # type: ignore[override] # of tuples
        """The sum, which is off by u of itself."""
        value = self.value + other.value
        error = self.error + other.error + UNIT_ROUNDING * np.abs(value)
        return Bounded(value, error * (1 + FEW_ROUNDINGS))

    def __sub__(self, other: Bounded) -> Bounded:
        return self + -other

    def __matmul__(self, other: Bounded | np.ndarray) -> Bounded:
        """The product with a matrix; an array is exact."""
        return self._times(np.matmul, other, self.value.shape[-1])

    def __mul__(self, other: Bounded | np.ndarray | float) -> Bounded:  # type: ignore[override]
        """The product entry by entry; an array is exact."""
        return self._times(np.multiply, other, 1)

    def _times(self, times: Callable[..., Any], other: Any, terms: int) -> Bounded:
        """With A within dA of a, and B within dB of b, `A B - a b = (A - a) B + a (B - b)` is at
        most

            dA (|b| + dB) + |a| dB,

        and rounding adds its share of `|a| |b|`."""
        if not isinstance(other, Bounded):
            other = Bounded.exact(other)
        value = times(self.value, other.value)
        a = np.abs(self.value)
        b = np.abs(other.value)
        rounding = sum_rounding(terms, np.iscomplexobj(value)) * b
        error = _sizes(times, self.error, b + other.error)
        error = error + _sizes(times, a, other.error + rounding)
        error = error * (1 + (terms + 4) * EPS)
        finite = np.isfinite(value)
        if not finite.all():
            error = np.where(finite, error, np.inf)
        if _least_positive(a) * _least_positive(b) < LEAST_NORMAL / EPS:
            error = error + 2 * terms * SMALLEST_DOUBLE
        return Bounded(value, error)

    def sum(self, axis: int | tuple[int, ...]) -> Bounded:
        """Return sums of entries, `gamma_(n-1)` of whose sizes is rounding."""
        value = self.value.sum(axis)
        terms = self.value.size // max(1, value.size)
        error = (self.error + sum_rounding(terms) * np.abs(self.value)).sum(axis)
        return Bounded(value, error * (1 + (terms + 4) * EPS))

    def with_rounding(self, terms: int, of_complex: bool = False) -> np.ndarray:
        """Return bounds on the errors of entries that count the rounding of sums of so many
        products with them as their own, where these sums are not `Bounded`."""
        of_complex |= np.iscomplexobj(self.value)
        return self.error + sum_rounding(terms, of_complex) * np.abs(self.value)

    @np.errstate(all="ignore")
    def over(self, other: Bounded) -> Bounded:
        """Return the quotient entry by entry, q = a/b, off by `(da + |q| db) / (|b| - db)` and by u
        of itself, or by 12 u if it is complex (Higham, section 3.6, has some 6 for the plain
        formula, and numpy scales before it)."""
        value = self.value / other.value
        least = np.abs(other.value) - other.error
        roundings = 12 if np.iscomplexobj(value) else 1
        rounding = roundings * (UNIT_ROUNDING * np.abs(value) + SMALLEST_DOUBLE)
        error = (self.error + np.abs(value) * other.error) / least + rounding
        return Bounded(value, np.where(least > 0, error * (1 + 8 * EPS), np.inf))

    def inverse(self) -> Bounded:
        """Return the inverse.

        S is about that of the value, and every matrix A within the bounds has `I - S A = D`, where
        |D| is at most `off`. So `A^-1 - S = (D + D^2 + ...) S`: see `_neumann`. The bound is
        infinite where the condition of A times rounding, or times the errors of A, is about 1, in
        the best units of rows and columns.
        """
        S, off = _near_inverse(*self)
        size = np.abs(S)
        return Bounded(S, _neumann(off, size, size))

    @np.errstate(all="ignore")
    def solved(self, right: Bounded) -> Bounded:
        """Return `X` of `A X = right`, `(..., n, k)`.

        Rows and columns are scaled by powers of two to largest entries of about 1. The inverse and
        the solution are refined, which makes the backward error small in every entry (Skeel 1980).
        What the solution misses in the equations is taken times `|A^-1|`, see `inverse`.
        """
        column = _unit(self.value, -2)
        row = _unit(self.value * column, -1)
        column = column * _unit(self.value * row * column, -2)
        A = self.each(lambda entries: entries * row * column)
        b = right.each(lambda entries: entries * row)
        S, off = _near_inverse(*A, EPS**2)
        X = S @ b.value
        for _ in range(2):
            X = X + S @ (b.value - A.value @ X)
        missed = (b - A @ X).size
        size = np.abs(S)
        error = size @ missed * (1 + (X.shape[-2] + 4) * EPS)
        error = (error + _neumann(off, error, size)) * (1 + EPS)
        return Bounded(X * column.mT, error * column.mT)

    def then(self, later: Bounded) -> Bounded:
        """Return `(I + later)(I + self) - I`, the change by two in a row, from both changes.

        Errors are taken times `I + later` and `I + self`, which may be small where the changes are
        not. The value has sums of n products and two terms more.
        """
        P, dP = self
        Q, dQ = later
        n = P.shape[-1]
        eye = np.eye(n)
        value = P + Q + Q @ P
        size = np.abs(P) + np.abs(Q) + np.abs(Q) @ np.abs(P)
        error = _sizes(np.matmul, np.abs(eye + Q), dP)
        error = error + _sizes(np.matmul, dQ, np.abs(eye + P) + dP)
        error = error + sum_rounding(n + 2, np.iscomplexobj(value)) * size
        return Bounded(value, error * (1 + (n + 8) * EPS))

    @staticmethod
    def joined(pairs: Sequence[Bounded], axis: int) -> Bounded:
        """Return matrices joined along an axis."""
        values, errors = zip(*pairs, strict=True)
        return Bounded(concatenated(values, axis), concatenated(errors, axis))

    @staticmethod
    def block(rows: Sequence[Sequence[Bounded | float]]) -> Bounded:
        """Return a matrix made of blocks; a number is so many times the identity."""
        return Bounded.joined([Bounded.joined(row, -1) for row in _filled(rows)], -2)


@np.errstate(all="ignore")
def _near_inverse(
    A: np.ndarray, dA: np.ndarray, least: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """About the inverse of A, and how much it times a matrix within dA of A is off the identity at
    most. least: entries below count as noise and are left out, as they would join what is
    separate."""
    n = A.shape[-1]
    eye = np.eye(n)
    S = inverse(A)
    S = S + S @ (eye - A @ S)  # for the digits of small rows
    S = np.where(np.abs(S) < least, 0.0, S)
    rounding = sum_rounding(n, np.iscomplexobj(A)) * np.abs(A)
    off = np.abs(eye - S @ A) + np.abs(S) @ (dA + rounding)
    return S, off * (1 + (n + 8) * EPS)


@np.errstate(all="ignore")
def _neumann(off: np.ndarray, terms: np.ndarray, size: np.ndarray) -> np.ndarray:
    """A bound on `(D + D^2 + ...) x` with |D| at most `off` and |x| at most `terms`; infinite where
    it is not known.

    In units u, the sums of the rows of `size`, `off u <= alpha u`, and `off terms <= c u` in each
    column: from the second on, all are together at most `alpha/(1 - alpha) c u`. Nothing is said of
    rows in which alpha is 1/2 or more, and of those that these reach by D; to the others they do not
    matter.
    """
    u = size.sum(-1, keepdims=True)
    alpha = off @ u / u
    unknown = ~(alpha < 0.5)
    reached = unknown
    while reached.any():
        reached = ((off > 0) @ unknown > 0) & ~unknown
        unknown = unknown | reached
    first = off @ terms
    largest = np.max(alpha, -2, keepdims=True, initial=0.0, where=~unknown)
    c = np.max(first / u, -2, keepdims=True, initial=0.0, where=~unknown)
    later = 2 * largest * c * u
    error = (first + later) * (1 + (2 * off.shape[-1] + 16) * EPS)
    return np.where(unknown, np.inf, error)


def _filled(rows: Sequence[Sequence[Bounded | float]]) -> list[list[Bounded]]:
    """Blocks with matrices in place of numbers, as high and wide as the others of their row and
    column."""
    columns = zip(*rows, strict=True)
    widths = [_first(column).shape[-1] for column in columns]
    filled = []
    for row in rows:
        height = _first(row).shape[-2]
        blocks = []
        for block, width in zip(row, widths, strict=True):
            if isinstance(block, Bounded):
                blocks.append(block)
            else:
                blocks.append(Bounded.exact(block * np.eye(height, width)))
        filled.append(blocks)
    return filled


def _first(blocks: Sequence[Bounded | float]) -> np.ndarray:
    """The first one that is a matrix."""
    return next(block.value for block in blocks if isinstance(block, Bounded))


def _unit(matrix: np.ndarray, axis: int) -> np.ndarray:
    """Powers of two that give rows or columns a largest entry of about 1; 1 for those of zeros."""
    size = np.abs(matrix).max(axis, keepdims=True, initial=0.0)
    usable = np.isfinite(size) & (size > 0)
    return np.exp2(-np.round(np.log2(np.where(usable, size, 1.0))))
