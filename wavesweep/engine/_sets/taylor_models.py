"""Numbers and matrices that depend on several numbers: polynomials with a bound on what they leave out.

Taylor models: M. Berz, K. Makino, Verified integration of ODEs and flows using differential algebraic methods on high-order
Taylor models, Reliable Computing 4, 361-369, 1998. Nothing is sampled: the remainder of a function follows from all of its
derivatives, and that of a sum or a product from the sizes of the terms that are left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import factorial, isfinite, log2
from typing import Any, NamedTuple

import numpy as np
from flint import arb

UNIT = np.finfo(float).eps / 2
BITS = 128  # of the balls that constants and derivatives are computed in
OUTWARD = 1 + 2**-40  # times what is rounded to a double, which is then above it
LEAST = 1e-300  # added to what is rounded outward: nothing underflows
TERMS = 12  # of the series of an exponential
NOTHING = 1e-15  # an exponential that is smaller need not be known
BLOCK = 4  # of that series: powers above this one are products of its own
OF_SUMS = 1e-9  # relative: more than the rounding of some products of matrices without signs
SMALL = 0.25  # norm of a matrix, up to which that series is summed
SHRINKS = 0.9  # norm up to which a geometric series of matrices is summed
BALANCED = 6  # sweeps of balancing
PIECE = 1 << 17  # bytes of products that are computed at once: larger arrays are slow for being new


class UnresolvedError(Exception):
    """A cell is too wide: something has no bound in it. number: the one that contributes most, None if it is not one."""

    def __init__(self, number: int | None):
        super().__init__(number)
        self.number = number


@lru_cache(maxsize=32)
def monomials(numbers: int, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the exponents of all monomials up to a total degree, sorted by degree, and the plan of a product.

    The plan: indices of pairs of monomials whose product is kept, sorted by that product, and the product of each pair.
    """
    exponents = [each for each in product(range(order + 1), repeat=numbers) if sum(each) <= order]
    exponents.sort(key=lambda each: (sum(each), tuple(-part for part in each)))
    at = {each: i for i, each in enumerate(exponents)}
    table = np.array(exponents, int).reshape(len(exponents), numbers)
    total = table.sum(1)
    first, second = np.nonzero(total[:, None] + total <= order)
    target = np.array([at[tuple(each)] for each in (table[first] + table[second]).tolist()])
    by_target = np.argsort(target, kind="stable")
    return table, first[by_target], second[by_target], target[by_target]


@lru_cache(maxsize=32)
def _degrees(numbers, order):
    """The total degree of each monomial, and at which index each degree begins."""
    degree = monomials(numbers, order)[0].sum(1)
    return degree, np.searchsorted(degree, np.arange(order + 1))


@lru_cache(maxsize=512)
def _pairs(numbers, order, one, two, at_once):
    """The plan of a product in pieces of about so many pairs, of the monomials that are present in both factors.

    one, two: which are, as bytes of booleans. Each piece: the pairs, where the pairs of each product begin, and that product.
    """
    _, first, second, target = monomials(numbers, order)
    kept = np.frombuffer(one, bool)[first] & np.frombuffer(two, bool)[second]
    first, second, target = first[kept], second[kept], target[kept]
    starts = np.flatnonzero(np.diff(target, prepend=-1))
    ends = np.append(starts[1:], target.size)
    pieces = []
    begun = 0
    for at in range(len(starts)):
        if at + 1 == len(starts) or ends[at + 1] - starts[begun] > at_once:
            pairs = slice(starts[begun], ends[at])
            own = starts[begun : at + 1]
            pieces.append((first[pairs], second[pairs], own - own[0], target[own]))
            begun = at + 1
    return pieces


def midpoint(value: Any) -> tuple[float, float]:
    """Return a double and a bound on how far a number or an arb is from it."""
    if not isinstance(value, arb):
        return float(value), 0.0
    middle = float(value.mid())
    radius = float((value - arb(middle)).abs_upper())
    return middle, radius * OUTWARD + LEAST if radius or (
        middle == 0 and not value.is_zero()
    ) else 0.0


class TaylorModel:
    """A number within `rest` of the polynomial `sum_k terms[k] s^exponents[k]` for all s in [-1, 1]^numbers.

    terms: `(monomials,)`, those of total degree up to `order`, see `monomials`. Sums and products with numbers, arbs and other
    models enclose those of any two values at the same s. Rounding is in the rest, and that of the rest itself.
    """

    __slots__ = ("inverted", "numbers", "order", "rest", "terms")
    __array_priority__ = 1000  # numpy's numbers leave arithmetic to it

    def __init__(self, terms: np.ndarray, rest: float, numbers: int, order: int):
        self.terms, self.rest, self.numbers, self.order = terms, rest, numbers, order
        self.inverted: TaylorModel | None = None  # once it is known

    @staticmethod
    def side(at: int, low: float, high: float, numbers: int, order: int) -> TaylorModel:
        """Return the number with this index, from low to high as s goes from -1 to 1."""
        terms = np.zeros(len(monomials(numbers, order)[0]))
        terms[0] = (low + high) / 2
        terms[1 + at] = max(high - terms[0], terms[0] - low) * (1 + 4 * UNIT)
        return TaylorModel(terms, 0.0, numbers, order)

    def _like(self, terms, rest):
        return TaylorModel(terms, rest * OUTWARD, self.numbers, self.order)

    def _constant(self, value):
        middle, radius = midpoint(value)
        terms = np.zeros_like(self.terms)
        terms[0] = middle
        return self._like(terms, radius)

    def size(self) -> float:
        """Return a bound on its size."""
        return float(np.abs(self.terms).sum() * OUTWARD + self.rest)

    def __neg__(self):
        return self._like(-self.terms, self.rest)

    def __add__(self, other):
        if not isinstance(other, TaylorModel):
            other = self._constant(other)
        terms = self.terms + other.terms
        return self._like(terms, self.rest + other.rest + UNIT * np.abs(terms).sum())

    def __sub__(self, other):
        return self + (-other)

    def __rsub__(self, other):
        return (-self) + other

    def __mul__(self, other):
        if not isinstance(other, TaylorModel):
            middle, radius = midpoint(other)
            terms = self.terms * middle
            rounding = UNIT * np.abs(terms).sum() + LEAST * (middle != 0)
            return self._like(terms, abs(middle) * self.rest + radius * self.size() + rounding)
        present = (self.terms != 0).tobytes(), (other.terms != 0).tobytes()
        terms = np.zeros(len(self.terms))
        for first, second, starts, target in _pairs(self.numbers, self.order, *present, PIECE):
            terms[target] = np.add.reduceat(self.terms[first] * other.terms[second], starts)
        degree, _ = _degrees(self.numbers, self.order)
        one = np.bincount(degree, np.abs(self.terms), self.order + 1)
        two = np.bincount(degree, np.abs(other.terms), self.order + 1)
        all_one, all_two = one.sum(), two.sum()
        above = (
            np.maximum(all_two - np.cumsum(two), 0.0) + 4 * len(two) * UNIT * all_two
        )  # of degrees above the index
        rest = self.rest * (all_two + other.rest) + all_one * other.rest + one[1:] @ above[::-1][1:]
        added = min(np.count_nonzero(self.terms), np.count_nonzero(other.terms))
        return self._like(terms, rest + 2 * (added + 2) * UNIT * all_one * all_two + LEAST)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other):
        if isinstance(other, TaylorModel):
            return self * other.inverse()
        return self * (1 / (other if isinstance(other, arb) else arb(other)))

    def __rtruediv__(self, other):
        return self.inverse() * other

    def __pow__(self, exponent):
        if isinstance(exponent, int | float) and exponent == int(exponent):
            power, base, left = self._constant(1.0), self, abs(int(exponent))
            while left:
                power = power * base if left % 2 else power
                base = base * base if left > 1 else base
                left //= 2
            return power if exponent >= 0 else power.inverse()
        return (self.log() * exponent).exp()

    def __rpow__(self, base):
        return (self * (base if isinstance(base, arb) else arb(base)).log()).exp()

    def _composed(self, coefficients, left_out) -> TaylorModel:
        """Return the polynomial of `self - c` with these coefficients, the constant one first; left_out: bound on the rest."""
        terms = self.terms.copy()
        terms[0] = 0.0
        difference = self._like(terms, self.rest)
        total = self._constant(coefficients[-1])
        for coefficient in coefficients[-2::-1]:
            total = total * difference + coefficient
        return self._like(total.terms, total.rest + left_out + LEAST)

    def _about(self) -> tuple[float, float]:
        """Return c, the constant term, and a bound on how far the model is from it. Errors: UnresolvedError for overflow."""
        centre = float(self.terms[0])
        radius = float((np.abs(self.terms[1:]).sum() + self.rest) * OUTWARD)
        if not (isfinite(centre) and isfinite(radius)):
            raise UnresolvedError(self.widest())
        return centre, radius

    def _shares(self, positive=True) -> tuple[float, float, float]:
        """Return c, `q = r/|c|` for the bound r on the distance from it, and a bound on `q^(order + 1)/(1 - q)`.

        Errors: UnresolvedError if the model may be 0, or negative where it has to be positive.
        """
        centre, radius = self._about()
        if not radius * OUTWARD**3 < abs(centre) or (positive and centre < 0):
            raise UnresolvedError(self.widest())
        share = radius / abs(centre) * OUTWARD
        return centre, share, share ** (self.order + 1) / (1 - share) * OUTWARD

    def inverse(self) -> TaylorModel:
        """Return 1 over it: `1/(c + d) = sum_k (-d)^k/c^(k+1)`, a geometric series.

        Errors: UnresolvedError if it may be 0.
        """
        if self.inverted is None:
            centre, _, tail = self._shares(positive=False)
            coefficients = [1 / arb(centre)]
            for _ in range(self.order):
                coefficients.append(-coefficients[-1] / centre)
            self.inverted = self._composed(coefficients, tail / abs(centre) * OUTWARD)
        return self.inverted

    def sqrt(self) -> TaylorModel:
        """Return the root: `sqrt(c) sum_k binomial(1/2, k) (d/c)^k`, whose coefficients get smaller."""
        centre, _, tail = self._shares()
        coefficients = [arb(centre).sqrt()]
        for k in range(self.order + 1):
            coefficients.append(coefficients[-1] * (0.5 - k) / (k + 1) / centre)
        size = float((abs(coefficients.pop()) * arb(centre) ** (self.order + 1)).abs_upper())
        return self._composed(coefficients, size * tail * OUTWARD)

    def log(self) -> TaylorModel:
        """Return the logarithm: `log(c) - sum_k (-d/c)^k/k`."""
        centre, _, tail = self._shares()
        coefficients = [arb(centre).log()]
        coefficients += [(-1) ** (k + 1) / (k * arb(centre) ** k) for k in range(1, self.order + 1)]
        return self._composed(coefficients, tail / (self.order + 1) * OUTWARD)

    def exp(self) -> TaylorModel:
        """Return the exponential: `exp(c) sum_k d^k/k!`; the rest is at most `exp(c + r) r^(order + 1)/(order + 1)!`."""
        centre, radius = self._about()
        coefficients = [arb(centre).exp()]
        for k in range(1, self.order + 1):
            coefficients.append(coefficients[-1] / k)
        largest = float((arb(centre) + arb(radius)).exp().abs_upper()) * OUTWARD
        if not isfinite(largest):
            raise UnresolvedError(self.widest())
        left_out = largest * self._last(radius)
        if left_out > largest:
            if largest > NOTHING:
                raise UnresolvedError(self.widest())
            return self._constant(
                arb(largest / 2, largest / 2)
            )  # as far from the peak of a Gaussian
        return self._composed(coefficients, left_out)

    def sin(self) -> TaylorModel:
        """Return the sine, of which no derivative exceeds 1."""
        centre, radius = self._about()
        return self._turned(centre, radius)

    def cos(self) -> TaylorModel:
        """Return the cosine, of which no derivative exceeds 1."""
        centre, radius = self._about()
        return self._turned(arb(centre) + arb.pi() / 2, radius)

    def _turned(self, angle, radius):
        """The sine of an angle and the distance of the model from its constant term, which is at most the radius."""
        left_out = self._last(radius)
        if left_out > 1:
            return self._constant(arb(0, 1))
        sine, cosine = arb(angle).sin(), arb(angle).cos()
        return self._composed(_derivatives((sine, cosine, -sine, -cosine), self.order), left_out)

    def tan(self) -> TaylorModel:
        """Return the tangent. Errors: UnresolvedError if the cosine may be 0."""
        return self.sin() / self.cos()

    def _last(self, radius):
        """A bound on `r^(order + 1)/(order + 1)!`."""
        with np.errstate(over="ignore"):
            return float(
                np.float64(radius) ** (self.order + 1) / factorial(self.order + 1) * OUTWARD
            )

    def widest(self) -> int | None:
        """Return the number on which it depends most; None if it is on none."""
        moves = np.abs(self.terms) @ (monomials(self.numbers, self.order)[0] > 0)
        return int(np.argmax(moves)) if moves.any() else None


def _derivatives(four, order):
    """The coefficients of a function whose derivatives are these four in turn."""
    return [four[k % 4] / factorial(k) for k in range(order + 1)]


class Sizes(NamedTuple):
    """Of the terms of matrices: sums of sizes for each degree and for all degrees above each, and which terms are not 0."""

    by_degree: np.ndarray
    above: np.ndarray
    whole: np.ndarray
    present: np.ndarray


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Matrices within `rest` of `sum_k terms[k] s^exponents[k]`, entry by entry, for all s in [-1, 1]^numbers.

    terms: `(monomials, ..., n, m)`, those of total degree up to `order`, the constant one first, then those of degree one in
    the order of the numbers; rest: `(..., n, m)`. Sums and products enclose those of any two matrices at the same s.
    Accuracy: rounding of the terms is in the rest; that of the rest itself is not, and a check has to leave room for it.
    """

    terms: np.ndarray
    rest: np.ndarray
    numbers: int
    order: int

    @staticmethod
    def constant(matrix: np.ndarray, numbers: int, order: int) -> Polynomials:
        """Return a matrix that is the same for all numbers."""
        terms = np.zeros((len(monomials(numbers, order)[0]), *np.shape(matrix)))
        terms[0] = matrix
        return Polynomials(terms, np.zeros(np.shape(matrix)), numbers, order)

    @staticmethod
    def of_entries(
        rows: Sequence[Sequence[Any]], shape: tuple[int, int], numbers: int, order: int
    ) -> Polynomials:
        """Return the matrix of these entries: models, arbs or numbers."""
        terms = np.zeros((len(monomials(numbers, order)[0]), *shape))
        rest = np.zeros(shape)
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                if isinstance(entry, TaylorModel):
                    terms[:, i, j], rest[i, j] = entry.terms, entry.rest
                elif not (isinstance(entry, int) and entry == 0):
                    terms[0, i, j], rest[i, j] = midpoint(entry)
        return Polynomials(terms, rest, numbers, order)

    @property
    def exponents(self) -> np.ndarray:
        """The exponents of each monomial, `(monomials, numbers)`."""
        return monomials(self.numbers, self.order)[0]

    @property
    def whole(self) -> np.ndarray:
        """Bounds on the sizes of the entries."""
        return self.sizes.whole + self.rest

    @cached_property
    def sizes(self) -> Sizes:
        """The sizes of the terms, which must not change any more."""
        size = np.abs(self.terms)
        present = size.reshape(len(size), -1).any(1)
        if len(size) == 1:  # without numbers there is no degree but 0
            by_degree = np.concatenate([size, np.zeros((self.order, *self.rest.shape))])
        else:
            by_degree = np.add.reduceat(size, _degrees(self.numbers, self.order)[1], axis=0)
        up_to = np.cumsum(by_degree, 0)
        return Sizes(by_degree, np.maximum(up_to[-1] - up_to, 0.0), up_to[-1], present)

    def _like(self, terms, rest):
        return Polynomials(terms, rest, self.numbers, self.order)

    def __add__(self, other: Polynomials) -> Polynomials:
        terms = self.terms + other.terms
        return self._like(terms, self.rest + other.rest + UNIT * np.abs(terms).sum(0))

    def __sub__(self, other: Polynomials) -> Polynomials:
        return self + other.times(-1.0)

    def times(self, factor: float | np.ndarray) -> Polynomials:
        """The matrices times exact factors, entry by entry."""
        terms = self.terms * factor
        return self._like(terms, self.rest * np.abs(factor) + UNIT * np.abs(terms).sum(0))

    def __matmul__(self, other: Polynomials) -> Polynomials:
        return self._product(other, np.matmul, self.terms.shape[-1])

    def entrywise(self, other: Polynomials) -> Polynomials:
        """The products of entries at the same place."""
        return self._product(other, np.multiply, 1)

    def _product(self, other, multiply, summed):
        one, two = self.sizes, other.sizes
        # No more terms make one of the product; `above` is a difference of sums over the degrees.
        roundings = 2 * (summed + min(one.present.sum(), two.present.sum()) + self.order) * UNIT
        rest = multiply(self.rest, two.whole + other.rest) + multiply(
            one.whole, other.rest + roundings * two.whole
        )
        if one.present[1:].any() and two.present[1:].any():
            rest = rest + multiply(one.by_degree[1:], two.above[self.order - 1 :: -1]).sum(0)
        entries = max(self.rest.size, other.rest.size, rest.size)
        at_once = 1 << max(0, int(log2(PIECE / 8 / max(entries, 1))))
        terms = np.zeros((len(self.terms), *rest.shape))
        plan = _pairs(
            self.numbers, self.order, one.present.tobytes(), two.present.tobytes(), at_once
        )
        for first, second, starts, target in plan:
            terms[target] = np.add.reduceat(
                multiply(self.terms[first], other.terms[second]), starts, axis=0
            )
        return self._like(terms, rest)

    def scaled(self, model: TaylorModel | Any) -> Polynomials:
        """The matrices times a number."""
        shape = self.rest.shape
        one = Polynomials.of_entries([[model]], (1, 1), self.numbers, self.order)
        return self.entrywise(
            self._like(
                np.broadcast_to(one.terms, (len(one.terms), *shape)),
                np.broadcast_to(one.rest, shape),
            )
        )

    def of(self, which: Any) -> Polynomials:
        """The matrices at some places of a leading axis."""
        return self._like(self.terms[:, which], self.rest[which])

    def at(
        self, rows: np.ndarray | Sequence[int], columns: np.ndarray | Sequence[int]
    ) -> Polynomials:
        """Some rows and columns."""
        place = np.ix_(rows, columns)
        return self._like(self.terms[..., *place], self.rest[..., *place])

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
        return self._like(terms, self.rest + rounding)

    def similar(self, basis: np.ndarray, inverse: np.ndarray) -> Polynomials:
        """Matrices similar to these: `B^-1 A B` for the exact inverse of the basis B; `inverse` is nearly that.

        With `inverse B = I + D` they are `(I + D)^-1 inverse A B`.
        """
        size, n = np.abs(inverse), len(basis)
        terms = inverse @ self.terms @ basis
        rest = size @ self.rest @ np.abs(basis) + 4 * n * UNIT * (
            size @ np.abs(self.terms).sum(0) @ np.abs(basis)
        )
        D = np.abs(inverse @ basis - np.eye(n)) + 2 * n * UNIT * (size @ np.abs(basis))
        share = D.sum(1).max()
        off = D + share * D.max() / (1 - share) if share < 0.5 else np.full_like(D, np.inf)
        return self._like(terms, rest + 2 * off @ (np.abs(terms).sum(0) + rest))

    def widest(self) -> int | None:
        """Return the number that moves the entries most; None if none does."""
        sizes = np.abs(self.terms).reshape(len(self.terms), -1).sum(1)
        moves = np.nan_to_num(sizes, posinf=1e300) @ (self.exponents > 0)
        return int(np.argmax(moves)) if moves.any() else None

    def exponential(self) -> Polynomials:
        """`exp(A)` of one square matrix: a series for `A/2^k`, then k squarings.

        In units of powers of 2 in which rows and columns are alike. What the series leaves out is at most
        `X^13 (I - X)^-1/13!`, entry by entry, for the sizes X of the entries, whose norm is at most 1/4.
        """
        n = len(self.rest)
        if not np.isfinite(self.whole).all():
            raise UnresolvedError(self.widest())
        units = _units(self.whole)
        ratio = units[None, :] / units[:, None]
        scaled = self.times(ratio)
        norm = scaled.whole.sum(1).max(initial=0.0)
        halvings = max(0, int(np.ceil(log2(max(norm, LEAST) / SMALL))))
        if halvings > BITS:
            raise UnresolvedError(self.widest())
        scaled = scaled.times(0.5**halvings)
        powers = [Polynomials.constant(np.eye(n), self.numbers, self.order), scaled]
        while len(powers) <= BLOCK:
            powers.append(powers[-1] @ scaled)
        largest = powers.pop()
        total = largest.times(1 / factorial(TERMS))
        for begin in range(TERMS - BLOCK, -1, -BLOCK):
            total = total + _combined(powers, [1 / factorial(begin + k) for k in range(BLOCK)])
            if begin:
                total = total @ largest
        size = scaled.whole
        left_out = np.linalg.matrix_power(size, TERMS + 1) @ _series_of(size) / factorial(TERMS + 1)
        total = self._like(total.terms, total.rest + left_out)
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(halvings):
                total = total @ total
        if not np.isfinite(total.whole).all():
            raise UnresolvedError(self.widest())
        return total.times(1 / ratio)

    def inverse(self) -> Polynomials:
        """The inverse of one square matrix: with C near to that of its middle, `(I - D)^-1 C` for `D = I - C A`.

        The geometric series is `(I + D)(I + D^2)(I + D^4) ...`, up to a degree k - 1 above that of its polynomials; the rest is
        at most `X^k (I - X)^-1`, entry by entry, for the sizes X of D. Errors: UnresolvedError if these do not shrink.
        """
        n = len(self.rest)
        with np.errstate(all="ignore"):
            try:
                near = np.linalg.inv(self.terms[0])
            except np.linalg.LinAlgError:
                raise UnresolvedError(self.widest()) from None
            C = Polynomials.constant(near, self.numbers, self.order)
            one = Polynomials.constant(np.eye(n), self.numbers, self.order)
            D = one - C @ self
            size = D.whole
            units = _units(size)
            scaled = D.times(units[None, :] / units[:, None])
        if not scaled.whole.sum(1).max(initial=0.0) < SHRINKS:
            raise UnresolvedError(scaled.widest())
        total = one
        for _ in range(self.order + 1):
            total = one + D @ total
        left_out = (
            np.linalg.matrix_power(size, self.order + 2)
            @ np.abs(np.linalg.inv(np.eye(n) - size))
            * (1 + 1e-6)
        )
        return self._like(total.terms, total.rest + left_out) @ C


def _combined(matrices, factors):
    """The sum of matrices times positive factors, each of which is rounded."""
    roundings = (len(factors) + 2) * UNIT
    terms = np.zeros_like(matrices[0].terms)
    rest = np.zeros_like(matrices[0].rest)
    for each, factor in zip(matrices, factors, strict=True):
        terms += factor * each.terms
        rest += factor * (each.rest + roundings * each.whole)
    return Polynomials(terms, rest, matrices[0].numbers, matrices[0].order)


def _series_of(X: np.ndarray) -> np.ndarray:
    """Bounds on the entries of `(I - X)^-1 = I + X + X^2 + ...`, for X >= 0 whose rows add up to 1/4 at most.

    Entry (i, j) is the weight of all walks from i to j. Those of fewer than N >= n steps are added up.
    A longer one is a walk of N steps and a further one, which is a path of fewer than n steps with
    walks that return to each of its at most n states: the weights of these add up to 4/3 at most. So
    the rest is at most `(4/3)^n X^N (I + ... + X^(N-1))`.
    """
    n = len(X)
    total = np.eye(n)
    power = X
    for _ in range(max(1, (n - 1).bit_length())):
        total = total + power @ total
        power = power @ power
    rest = (4 / 3) ** n * power @ total
    return (total + rest) * (1 + OF_SUMS)


def _units(size):
    """Powers of 2 for the states in which rows and columns of sizes are alike."""
    units = np.ones(len(size))
    for _ in range(BALANCED):
        for i in range(len(size)):
            column = size[:, i] @ (1 / units) * units[i] - size[i, i]
            row = size[i] @ units / units[i] - size[i, i]
            if column > 0 and row > 0 and isfinite(column) and isfinite(row):
                units[i] *= 2.0 ** round(log2(row / column) / 2)
    return units


@lru_cache(maxsize=32)
def _binomials(order):
    table = np.zeros((order + 1, order + 1))
    table[:, 0] = 1
    for i in range(1, order + 1):
        table[i, 1:] = table[i - 1, 1:] + table[i - 1, :-1]
    return table
