"""Matrices that depend on several numbers: polynomials with a bound on what they leave out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

UNIT = np.finfo(float).eps / 2


@dataclass(frozen=True, slots=True, eq=False)
class Polynomials:
    """Matrices within `rest` of `sum_k terms[k] s^exponents[k]`, entry by entry, for all s in [-1, 1]^numbers.

    terms: `(monomials, ..., n, n)`, those of total degree up to `order`, the constant one first, then those of degree one in
    the order of the numbers; rest: `(..., n, n)`. Sums and products enclose the sums and products of any two matrices at the
    same s: Taylor models (M. Berz, K. Makino, Verified integration of ODEs and flows using differential algebraic methods on
    high-order Taylor models, Reliable Computing 4, 361-369, 1998).
    Accuracy: rounding of the terms is in the rest; that of the rest itself is not, and a check has to leave room for it.
    """

    terms: np.ndarray
    rest: np.ndarray
    numbers: int
    order: int

    @property
    def exponents(self) -> np.ndarray:
        """The exponents of each monomial, `(monomials, numbers)`."""
        return monomials(self.numbers, self.order)[0]

    def __matmul__(self, other: Polynomials) -> Polynomials:
        first, second, starts = monomials(self.numbers, self.order)[1:]
        terms = np.add.reduceat(self.terms[first] @ other.terms[second], starts, axis=0)
        one, two = self._by_degree(self.terms), self._by_degree(other.terms)
        all_one, all_two = one.sum(0), two.sum(0)
        above = all_two - np.cumsum(two, 0)  # of degrees above the index
        rest = self.rest @ (all_two + other.rest) + all_one @ other.rest
        rest = rest + sum(one[k] @ np.maximum(above[self.order - k], 0.0) for k in range(1, self.order + 1))
        roundings = 2 * (terms.shape[-1] + len(terms)) * UNIT
        return Polynomials(terms, rest + roundings * (all_one @ all_two), self.numbers, self.order)

    def _by_degree(self, terms):
        """The sums of the sizes of the terms of each degree."""
        degree = self.exponents.sum(1)
        starts = np.searchsorted(degree, np.arange(self.order + 1))
        return np.add.reduceat(np.abs(terms), starts, axis=0)

    def of(self, which) -> Polynomials:
        """The matrices at some places of a leading axis."""
        return Polynomials(self.terms[:, which], self.rest[which], self.numbers, self.order)

    def within(self, middle: np.ndarray, half: np.ndarray) -> Polynomials:
        """The same matrices for s = middle + half t, as polynomials in t, `(numbers,)` each."""
        e = self.exponents
        powers = np.arange(self.order + 1)
        less = np.maximum(powers - powers[:, None], 0)
        factor = np.ones((len(e), len(e)))  # [new, old]
        for number, (at, wide) in enumerate(zip(middle, half, strict=True)):
            table = _binomials(self.order).T * wide ** powers[:, None] * at**less
            factor *= table[e[:, number, None], e[:, number]]
        terms = np.tensordot(factor, self.terms, (1, 0))
        rounding = 4 * (len(e) + self.order) * UNIT * np.abs(self.terms).sum(0)
        return Polynomials(terms, self.rest + rounding, self.numbers, self.order)

    def similar(self, basis: np.ndarray, inverse: np.ndarray) -> Polynomials:
        """Matrices similar to these: `B^-1 A B` for the exact inverse of the basis B; `inverse` is nearly that.

        With `inverse B = I + D` they are `(I + D)^-1 inverse A B`.
        """
        size, n = np.abs(inverse), len(basis)
        terms = inverse @ self.terms @ basis
        rest = size @ self.rest @ np.abs(basis) + 4 * n * UNIT * (size @ np.abs(self.terms).sum(0) @ np.abs(basis))
        D = np.abs(inverse @ basis - np.eye(n)) + 2 * n * UNIT * (size @ np.abs(basis))
        share = D.sum(1).max()
        off = D + share * D.max() / (1 - share) if share < 0.5 else np.full_like(D, np.inf)
        return Polynomials(terms, rest + 2 * off @ (np.abs(terms).sum(0) + rest), self.numbers, self.order)


@lru_cache(maxsize=32)
def monomials(numbers: int, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the exponents of all monomials up to a total degree, sorted by degree, and the plan of a product.

    The plan: indices of pairs of monomials whose product is kept, sorted by that product, and where each product begins.
    """
    exponents = [each for each in product(range(order + 1), repeat=numbers) if sum(each) <= order]
    exponents.sort(key=lambda each: (sum(each), tuple(-part for part in each)))
    at = {each: i for i, each in enumerate(exponents)}
    table = np.array(exponents, int).reshape(len(exponents), numbers)
    total = table.sum(1)
    first, second = np.nonzero(total[:, None] + total <= order)
    target = np.array([at[tuple(each)] for each in (table[first] + table[second]).tolist()])
    by_target = np.argsort(target, kind="stable")
    return table, first[by_target], second[by_target], np.searchsorted(target[by_target], np.arange(len(table)))


@lru_cache(maxsize=32)
def _binomials(order):
    table = np.zeros((order + 1, order + 1))
    table[:, 0] = 1
    for i in range(1, order + 1):
        table[i, 1:] = table[i - 1, 1:] + table[i - 1, :-1]
    return table


@lru_cache(maxsize=32)
def to_powers(count: int) -> np.ndarray:
    """Return the matrix from coefficients of Chebyshev polynomials to those of powers."""
    return np.array([np.append(np.polynomial.chebyshev.cheb2poly(row), np.zeros(count))[:count] for row in np.eye(count)]).T
