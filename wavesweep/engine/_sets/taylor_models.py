"""Numbers and matrices that depend on several numbers: polynomials with a bound on what they leave
out.

Taylor models: M. Berz, K. Makino, Verified integration of ODEs and flows using differential
algebraic methods on high-order Taylor models, Reliable Computing 4, 361-369, 1998. Nothing is
sampled: the remainder of a function follows from all of its derivatives, and that of a sum or a
product from the sizes of the terms that are left out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import product
from math import factorial, log2
from typing import Any, NamedTuple

import numpy as np
from flint import arb

from wavesweep.engine.doubles import LARGEST_DOUBLE, NEXT_TO_ZERO, UNIT_ROUNDING

BALL_BITS = 128  # of the balls that constants and derivatives are computed in
OUTWARD = 1 + 2**-40  # times what is rounded to a double, which is then above it
SERIES_TERMS = 12  # of the series of an exponential
# times half of the interval of all values: what a polynomial leaves out that is of no use beside
# that
WORSE = 2.0
# of that interval: what the terms of an argument may leave out, so that they say on what it depends
KNOWN_REST = 0.1
TIGHTER = 0.9  # of the interval of its polynomial: that of what it is made of, which then counts
GONE_EXPONENTIAL = 1e-15  # an exponential that is smaller need not be known
MARKED = 1e-3  # of that interval: the terms that say on what it depends
SERIES_BLOCK = 4  # of that series: powers above this one are products of its own
OF_SUMS = 1e-9  # relative: more than the rounding of some products of matrices without signs
SHRINKS_BY = 0.9  # norm up to which what an inverse leaves out has a geometric series
# entries of an array, and pairs of a piece: a single `reduceat` takes less for fewer entries, and
# where a piece has more pairs, as these are of few entries
SMALL_ARRAY = 1 << 13
MANY_PAIRS = 128
PIECE = 1 << 17  # bytes of products that are computed at once: larger arrays are slow for being new


class UnresolvedError(Exception):
    """Cells are too wide: something has no bound in them.

    cells: which of them, booleans in the shape of the batch. number: of each the one that
    contributes most, -1 if it is none.
    """

    def __init__(self, cells: Any, number: Any = -1) -> None:
        super().__init__(cells, number)
        self.cells = np.asarray(cells)
        self.number = np.broadcast_to(number, self.cells.shape)


@lru_cache(maxsize=32)
def monomials(numbers: int, order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the exponents of all monomials up to a total degree, sorted by degree, and the plan of
    a product.

    The plan: indices of pairs of monomials whose product is kept, sorted by that product, and the
    product of each pair.
    """
    exponents = [
        exponent for exponent in product(range(order + 1), repeat=numbers) if sum(exponent) <= order
    ]
    exponents.sort(key=lambda exponent: (sum(exponent), tuple(-part for part in exponent)))
    index_of = {exponent: i for i, exponent in enumerate(exponents)}
    table = np.array(exponents, int).reshape(len(exponents), numbers)
    total = table.sum(1)
    first, second = np.nonzero(total[:, None] + total <= order)
    target = np.array(
        [index_of[tuple(exponent)] for exponent in (table[first] + table[second]).tolist()]
    )
    by_target = np.argsort(target, kind="stable")
    return table, first[by_target], second[by_target], target[by_target]


@lru_cache(maxsize=32)
def _degrees(numbers: int, order: int) -> list[int]:
    """At which index the monomials of each degree begin, and where the last ones end."""
    degree = monomials(numbers, order)[0].sum(1)
    return np.searchsorted(degree, np.arange(order + 2)).tolist()


class _Piece(NamedTuple):
    """Pairs of monomials whose products are computed at once.

    first, second: the pairs. targets: the monomials that they add up to. starts: where the pairs of
    each target begin, or None of pairs in rounds: each round has a pair of each of the first so many
    targets, and the first round one of all. rounds: how many pairs each further round has, and where
    it begins.
    """

    first: np.ndarray
    second: np.ndarray
    targets: np.ndarray
    starts: np.ndarray | None
    rounds: list[tuple[int, int]]

    @staticmethod
    def in_rounds(
        first: np.ndarray, second: np.ndarray, targets: np.ndarray, counts: np.ndarray
    ) -> _Piece:
        """Return pairs of some targets, sorted by these, of each of which there are so many."""
        begins = np.cumsum(counts) - counts
        by_count = np.argsort(-counts, kind="stable")
        rounds = []
        places = []
        begun = 0
        for round_number in range(counts.max()):
            index = begins[by_count[counts[by_count] > round_number]] + round_number
            if round_number:
                rounds.append((index.size, begun))
            places.append(index)
            begun += index.size
        place = np.concatenate(places)
        return _Piece(first[place], second[place], targets[by_count], None, rounds)


@lru_cache(maxsize=512)
def _pairs(
    numbers: int, order: int, one: bytes, two: bytes, at_once: int, degree: int | None = None
) -> list[_Piece]:
    """The plan of a product in pieces of about so many pairs, of the monomials that are present in
    both factors.

    one, two: which are, as bytes of booleans. degree: that of the product if only its terms of that
    degree are wanted.
    """
    table, first, second, target = monomials(numbers, order)
    used = np.frombuffer(one, bool)[first] & np.frombuffer(two, bool)[second]
    if degree is not None:
        used &= table.sum(1)[target] == degree
    first = first[used]
    second = second[used]
    target = target[used]
    starts = np.flatnonzero(np.diff(target, prepend=-1))
    ends = np.append(starts[1:], target.size)
    pieces = []
    begun = 0
    for end_of_piece in range(len(starts)):
        if end_of_piece + 1 == len(starts) or ends[end_of_piece + 1] - starts[begun] > at_once:
            pairs = slice(starts[begun], ends[end_of_piece])
            of_piece = slice(begun, end_of_piece + 1)
            targets = target[starts[of_piece]]
            counts = ends[of_piece] - starts[of_piece]
            if at_once < MANY_PAIRS:
                piece = _Piece.in_rounds(first[pairs], second[pairs], targets, counts)
            else:
                piece = _Piece(
                    first[pairs], second[pairs], targets, starts[of_piece] - starts[begun], []
                )
            pieces.append(piece)
            begun = end_of_piece + 1
    return pieces


def _multiply_into(
    terms: np.ndarray,
    one: np.ndarray,
    two: np.ndarray,
    plan: list[_Piece],
    multiply: Callable[..., Any],
) -> None:
    """Put the sums of the products of two series of terms where a plan says."""
    one = np.ascontiguousarray(one)  # `take` would copy all of them for every piece
    two = np.ascontiguousarray(two)
    for piece in plan:
        products = multiply(one.take(piece.first, 0), two.take(piece.second, 0))
        if piece.starts is not None:
            terms[piece.targets] = np.add.reduceat(products, piece.starts, axis=0)
            continue
        if len(piece.targets) == 1:
            terms[piece.targets[0]] = products.sum(0)
            continue
        total = products[: len(piece.targets)]
        for count, begin in piece.rounds:
            total[:count] += products[begin : begin + count]
        terms[piece.targets] = total


def _at_once(entries: int) -> int:
    """How many products of so many entries are computed at once: a power of 2."""
    return 1 << max(0, int(log2(PIECE / 8 / max(entries, 1))))


def midpoint(value: Any) -> tuple[float, float]:
    """Return a double and a bound on how far a number or an arb is from it."""
    if not isinstance(value, arb):
        return float(value), 0.0
    middle = float(value.mid())
    radius = float((value - arb(middle)).abs_upper())
    return middle, radius * OUTWARD + NEXT_TO_ZERO if radius or (
        middle == 0 and not value.is_zero()
    ) else 0.0


class TaylorModel:
    """A number within `rest` of the polynomial `sum_k terms[k] s^exponents[k]` for all s in [-1,
    1]^numbers, in each of some cells.

    terms: `(monomials, *cells)`, those of total degree up to `order`, see `monomials`; rest:
    `(*cells)`. low, high: `(*cells)`, bounds on the number that follow from those of what it is
    made of, such as 0 below a square: those of the polynomial are wider where a cell is. Sums and
    products with numbers, arbs and other models enclose those of any two values at the same s.
    Rounding is in the rest, and that of the rest itself.
    """

    __slots__ = ("high", "inverted", "low", "numbers", "order", "rest", "terms")
    __array_priority__ = 1000  # numpy's numbers leave arithmetic to it

    def __init__(
        self,
        terms: np.ndarray,
        rest: Any,
        numbers: int,
        order: int,
        bounds: tuple[Any, Any] = (-np.inf, np.inf),
    ) -> None:
        self.terms = terms
        self.rest = rest
        self.numbers = numbers
        self.order = order
        self.low, self.high = bounds
        self.inverted: TaylorModel | None = None  # once it is known

    @staticmethod
    def side(index: int, low: Any, high: Any, numbers: int, order: int) -> TaylorModel:
        """Return the number with this index, from low to high as s goes from -1 to 1; low, high:
        of all cells."""
        terms = np.zeros((len(monomials(numbers, order)[0]), *np.shape(low)))
        terms[0] = (low + high) / 2
        terms[1 + index] = np.maximum(high - terms[0], terms[0] - low) * (1 + 4 * UNIT_ROUNDING)
        return TaylorModel(terms, np.zeros(np.shape(low)), numbers, order, (low, high))

    def _like(
        self,
        terms: np.ndarray,
        rest: np.ndarray | float,
        bounds: tuple[np.ndarray | float, np.ndarray | float] = (-np.inf, np.inf),
    ) -> TaylorModel:
        return TaylorModel(terms, rest * OUTWARD, self.numbers, self.order, bounds)

    def _constant(self, middle: float, radius: float = 0.0) -> TaylorModel:
        """The same number in all cells, or one for each; as far as this radius from it."""
        ones = np.ones((1,) * np.ndim(self.rest))
        terms = np.zeros((len(self.terms), *np.shape(middle * ones)))
        terms[0] = middle
        return self._like(terms, radius * ones, _outward(middle - radius, middle + radius))

    def size(self) -> Any:
        """Return a bound on its size."""
        return np.abs(self.terms).sum(0) * OUTWARD + self.rest

    def ends(self) -> tuple[Any, Any]:
        """Return bounds on its values, by its polynomial and by what it is made of."""
        away = (np.abs(self.terms[1:]).sum(0) + self.rest) * OUTWARD
        low, high = _outward(self.terms[0] - away, self.terms[0] + away)
        return np.maximum(low, self.low), np.minimum(high, self.high)

    def __neg__(self) -> TaylorModel:
        return self._like(-self.terms, self.rest, (-self.high, -self.low))

    def __add__(self, other: Any) -> TaylorModel:
        if not isinstance(other, TaylorModel):
            other = self._constant(*midpoint(other))
        return self.plus(other, _outward(self.low + other.low, self.high + other.high))

    def plus(self, other: TaylorModel, bounds: tuple[Any, Any] = (-np.inf, np.inf)) -> TaylorModel:
        """Return the sum by its polynomial; bounds: what else is known of it."""
        terms = self.terms + other.terms
        return self._like(
            terms, self.rest + other.rest + UNIT_ROUNDING * np.abs(terms).sum(0), bounds
        )

    def __sub__(self, other: Any) -> TaylorModel:
        return self + (-other)

    def __rsub__(self, other: arb | int) -> TaylorModel:
        return (-self) + other

    def __mul__(self, other: Any) -> TaylorModel:
        if isinstance(other, TaylorModel):
            bounds = _squares(self.low, self.high) if other is self else _products_of(self, other)
            return self.times(other, bounds)
        middle, radius = midpoint(other)
        bounds = _products_of(self, self._constant(middle, radius))
        terms = self.terms * middle
        rounding = UNIT_ROUNDING * np.abs(terms).sum(0) + NEXT_TO_ZERO * (middle != 0)
        rest = abs(middle) * self.rest + radius * self.size() + rounding
        return self._like(terms, rest, bounds)

    def times(self, other: TaylorModel, bounds: tuple[Any, Any] = (-np.inf, np.inf)) -> TaylorModel:
        """Return the product by its polynomial; bounds: what else is known of it."""
        shape = np.broadcast_shapes(np.shape(self.rest), np.shape(other.rest))
        first = np.abs(self.terms)
        second = np.abs(other.terms)
        present = [terms_of.reshape(len(terms_of), -1).any(1) for terms_of in (first, second)]
        at_once = max(1, PIECE // max(1, int(np.prod(shape))))
        terms = np.zeros((len(self.terms), *shape))
        plan = _pairs(
            self.numbers, self.order, *(terms_of.tobytes() for terms_of in present), at_once
        )
        _multiply_into(terms, self.terms, other.terms, plan, np.multiply)
        first, second = (
            _by_degree(terms_of, self.numbers, self.order) for terms_of in (first, second)
        )
        all_one = first.sum(0)
        all_two = second.sum(0)
        # of degrees above the index
        above = (
            np.maximum(all_two - np.cumsum(second, 0), 0.0)
            + 4 * len(second) * UNIT_ROUNDING * all_two
        )
        beyond = (first[1:] * above[::-1][1:]).sum(0)
        rest = self.rest * (all_two + other.rest) + all_one * other.rest + beyond
        added = min(present[0].sum(), present[1].sum())
        rounding = 2 * (added + 2) * UNIT_ROUNDING * all_one * all_two + NEXT_TO_ZERO
        return self._like(terms, rest + rounding, bounds)

    __radd__, __rmul__ = __add__, __mul__

    def __truediv__(self, other: TaylorModel | arb) -> TaylorModel:
        if isinstance(other, TaylorModel):
            return self * other.inverse()
        return self * (1 / (other if isinstance(other, arb) else arb(other)))

    def __rtruediv__(self, other: arb | int) -> TaylorModel:
        return self.inverse() * other

    def __pow__(self, exponent: arb | float) -> TaylorModel:
        exponent = arb(exponent)
        if exponent.is_integer():
            power = self._constant(1.0)
            base = self
            exponent_left = abs(int(float(exponent)))
            while exponent_left:
                power = power * base if exponent_left % 2 else power
                base = base * base if exponent_left > 1 else base
                exponent_left //= 2
            return power if exponent >= 0 else power.inverse()
        return (self.log() * exponent).exp()

    def __rpow__(self, base: Any) -> TaylorModel:
        return (self * (base if isinstance(base, arb) else arb(base)).log()).exp()

    def _composed(self, coefficients: list[list[arb]], left_out: np.ndarray | float) -> TaylorModel:
        """Return the polynomial of `self - c` with these coefficients, of each cell, the
        constant one first; left_out: bounds on the rest."""
        terms = self.terms.copy()
        terms[0] = 0.0
        difference = self._like(terms, self.rest)
        balls = np.array(
            [
                [midpoint(coefficient) for coefficient in series_of_cell]
                for series_of_cell in coefficients
            ]
        )
        balls = np.moveaxis(balls, 0, -1).reshape(balls.shape[1], 2, *np.shape(self.rest))
        total = self._constant(*balls[-1])
        for middle, radius in balls[-2::-1]:
            total = total.times(difference).plus(self._constant(middle, radius))
        return self._like(total.terms, total.rest + left_out + NEXT_TO_ZERO)

    def _informed(self) -> Any:
        """Where what it is made of bounds it better than its terms do, of which it has nearly
        all: elsewhere a smaller cell helps more."""
        away = np.abs(self.terms[1:]).sum(0) + self.rest
        with np.errstate(invalid="ignore"):
            wide = self.high - self.low
            return (wide < 2 * TIGHTER * away) & (self.rest <= KNOWN_REST * wide)

    def _bounded(
        self, series: TaylorModel, low: np.ndarray | float, high: np.ndarray, informed: bool
    ) -> TaylorModel:
        """The model of a function f of it, in each cell one of two: the series `series`, or, where
        this leaves out more than WORSE times `radius = max(high - c, c - low)`, a constant c of the
        interval of all values of f, with this radius as its rest.

        low, high: ends of that interval, which hold for all arguments in the cell. informed: the
        cells in which the interval may stand for f. c is the series' value in the middle of the
        cell, clipped to between 0 and (low + high)/2 and then to the interval, so that
        |c| <= |low + high|/2. Errors: UnresolvedError for cells in which there is neither.
        """
        with np.errstate(invalid="ignore"):
            half = (low + high) / 2
            nearer = np.clip(
                np.nan_to_num(series.terms[0]), np.minimum(half, 0), np.maximum(half, 0)
            )
            middle = np.clip(nearer, low, high)
            radius = np.maximum(high - middle, middle - low) * OUTWARD + NEXT_TO_ZERO
        bounded = informed & np.isfinite(radius)
        worse = ~(series.rest <= np.where(bounded, WORSE * radius, LARGEST_DOUBLE))
        # Where the interval may not stand for f only the polynomial bounds it: a cell in which f
        # just spans decades is divided.
        bounds = np.where(informed, low, -np.inf), np.where(informed, high, np.inf)
        if not np.any(worse):
            return self._like(series.terms, series.rest, bounds)
        if np.any(worse & ~bounded):
            raise UnresolvedError(worse & ~bounded, self.widest())
        # The constant has terms that are too small to matter and say on which numbers f depends;
        # they move it by at most their sum.
        moves = np.moveaxis(self._moves(), -1, 0)
        share = MARKED * radius / np.maximum(moves.sum(0), NEXT_TO_ZERO) * moves
        terms = np.zeros_like(series.terms)
        terms[0] = middle
        terms[1 : 1 + self.numbers] = share
        rest = radius + share.sum(0) * OUTWARD
        return self._like(
            np.where(worse, terms, series.terms), np.where(worse, rest, series.rest), bounds
        )

    def _about(self) -> tuple[Any, Any]:
        """Return c, the constant term, and a bound on how far the model is from it. Errors:
        UnresolvedError for overflow."""
        centre = self.terms[0]
        radius = (np.abs(self.terms[1:]).sum(0) + self.rest) * OUTWARD
        finite = np.isfinite(centre) & np.isfinite(radius)
        if not np.all(finite):
            raise UnresolvedError(~finite, self.widest())
        return centre, radius

    def _shares(self) -> tuple[Any, Any]:
        """Return c, and a bound on `q^(order + 1)/(1 - q)` for `q = r/|c|` and the bound r on the
        distance from it.

        The bound is infinite if the model may be 0.
        """
        centre, radius = self._about()
        with np.errstate(all="ignore"):
            share = radius / np.abs(centre) * OUTWARD
            tail = share ** (self.order + 1) / (1 - share) * OUTWARD
        return centre, np.where(share * OUTWARD**2 < 1, tail, np.inf)

    def inverse(self) -> TaylorModel:
        """Return 1 over it: `1/(c + d) = sum_k (-d)^k/c^(k+1)`, a geometric series to the order of
        the model, with a bound on the terms beyond it (`_shares`), within `1/high` to `1/low` of its
        ends.

        Errors: UnresolvedError if it may be 0.
        """
        if self.inverted is None:
            centre, tail = self._shares()
            coefficients = []
            for c in _each(centre):
                series = [1 / arb(c)]
                for _ in range(self.order):
                    series.append(-series[-1] / c)
                coefficients.append(series)
            low, high = self.ends()
            sure = (low > 0) | (high < 0)
            with np.errstate(all="ignore"):
                reciprocal = self._composed(coefficients, tail / np.abs(centre) * OUTWARD)
                ends = _outward(1 / high, 1 / low)
            low = np.where(sure, ends[0], -np.inf)
            high = np.where(sure, ends[1], np.inf)
            self.inverted = self._bounded(reciprocal, low, high, self._informed())
        return self.inverted

    def sqrt(self) -> TaylorModel:
        """Return the root: `sqrt(c) sum_k binomial(1/2, k) (d/c)^k`, whose coefficients get
        smaller."""
        centre, tail = self._shares()
        coefficients = []
        sizes = []
        for c in _each(centre):
            series = [arb(c).sqrt()]
            for k in range(self.order + 1):
                series.append(series[-1] * (0.5 - k) / (k + 1) / c)
            sizes.append(float((abs(series.pop()) * arb(c) ** (self.order + 1)).abs_upper()))
            coefficients.append(series)
        size = np.reshape(sizes, np.shape(centre))
        with np.errstate(all="ignore"):
            root = self._composed(coefficients, size * tail * OUTWARD)
        low, high = self._monotonic(lambda x: x.sqrt(), 0.0)
        return self._bounded(root, low, high, self._informed() | np.isinf(tail))

    def log(self) -> TaylorModel:
        """Return the logarithm: `log(c) - sum_k (-d/c)^k/k`."""
        centre, tail = self._shares()
        coefficients = []
        for c in _each(centre):
            series = [arb(c).log()]
            series += [(-1) ** (k + 1) / (k * arb(c) ** k) for k in range(1, self.order + 1)]
            coefficients.append(series)
        with np.errstate(all="ignore"):
            logarithm = self._composed(coefficients, tail / (self.order + 1) * OUTWARD)
        return self._bounded(
            logarithm, *self._monotonic(lambda x: x.log(), NEXT_TO_ZERO), self._informed()
        )

    def exp(self) -> TaylorModel:
        """Return the exponential: `exp(c) sum_k d^k/k!`; the rest is at most `exp(c + r)
        r^(order + 1)/(order + 1)!`."""
        centre, radius = self._about()
        coefficients = []
        sizes = []
        for c, r in zip(_each(centre), _each(radius), strict=True):
            series_of_cell = [arb(c).exp()]
            for k in range(1, self.order + 1):
                series_of_cell.append(series_of_cell[-1] / k)
            coefficients.append(series_of_cell)
            sizes.append(float((arb(c) + arb(r)).exp().abs_upper()) * OUTWARD)
        largest = np.reshape(sizes, np.shape(centre))
        rest = self._taylor_rest(radius)
        with np.errstate(all="ignore"):
            series = self._composed(coefficients, np.where(rest > 1, np.inf, largest * rest))
        low, high = self._monotonic(lambda x: x.exp(), -np.inf)
        far = (rest > 1) & (largest < GONE_EXPONENTIAL)  # from the peak of a Gaussian
        return self._bounded(series, low, high, self._informed() | far)

    def _monotonic(
        self, function: Callable[..., Any], least: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bounds on an increasing function of it; infinite where an argument may be below the
        least one."""
        low, high = np.broadcast_arrays(*self.ends(), self.rest)[:2]
        bounds = []
        for a, b in zip(_each(low), _each(high), strict=True):
            if a >= least:
                bounds.append((float(function(arb(a)).lower()), float(function(arb(b)).upper())))
            else:
                bounds.append((-np.inf, np.inf))
        lower, upper = np.reshape(bounds, (-1, 2)).T
        return _outward(lower.reshape(low.shape), upper.reshape(low.shape))

    def sin(self) -> TaylorModel:
        """Return the sine, of which no derivative exceeds 1."""
        return self._sine_of_sum(arb(0))

    def cos(self) -> TaylorModel:
        """Return the cosine, of which no derivative exceeds 1."""
        return self._sine_of_sum(arb.pi() / 2)

    def _sine_of_sum(self, angle: arb) -> TaylorModel:
        """Return `sin(x + angle)` of the model `x = c + d`, `|d| <= r`.

        It is `sum_k f_k d^k/k!` for k up to the order, f_k being the derivatives of the sine at `c +
        angle`: sin, cos, -sin, -cos, and these again. None exceeds 1, so the rest is at most
        `r^(order + 1)/(order + 1)!`. In cells where that is more than 1, [-1, 1] says more.
        """
        centre, radius = self._about()
        coefficients = []
        for c in _each(centre):
            sine = (arb(c) + angle).sin()
            cosine = (arb(c) + angle).cos()
            cycle = (sine, cosine, -sine, -cosine)
            series_of_cell = [cycle[k % len(cycle)] / factorial(k) for k in range(self.order + 1)]
            coefficients.append(series_of_cell)
        rest = self._taylor_rest(radius)
        series = self._composed(coefficients, rest)
        highest = np.ones(np.shape(self.rest))
        return self._bounded(series, -highest, highest, rest > 1)

    def tan(self) -> TaylorModel:
        """Return the tangent. Errors: UnresolvedError if the cosine may be 0."""
        return self.sin() / self.cos()

    def _taylor_rest(self, radius: float) -> float:
        """A bound on `r^(order + 1)/(order + 1)!`, the rest of a Taylor series at a distance r per
        unit of the next derivative."""
        with np.errstate(over="ignore"):
            return np.float64(radius) ** (self.order + 1) / factorial(self.order + 1) * OUTWARD

    def _moves(self) -> np.ndarray:
        """How much each number moves it, `(*cells, numbers)`."""
        sizes = np.moveaxis(np.nan_to_num(np.abs(self.terms), posinf=1e300), 0, -1)
        return sizes @ (monomials(self.numbers, self.order)[0] > 0)

    def widest(self) -> Any:
        """Return the number on which it depends most, of each cell; -1 if it is on none."""
        return _most(self._moves())


def _most(moves: np.ndarray) -> np.ndarray:
    """The index of the largest of the last axis; -1 where all are 0."""
    if not moves.shape[-1]:
        return np.full(moves.shape[:-1], -1)
    return np.where(moves.any(-1), moves.argmax(-1), -1)


def _each(array: np.ndarray | float) -> list[float]:
    """The values of all cells."""
    return np.ravel(array).tolist()


def _outward(low: np.ndarray | float, high: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """The ends of an interval after a rounded operation; a sum or a product of 0 is exact."""
    return (
        np.where(low == 0, 0.0, np.nextafter(low, -np.inf)),
        np.where(high == 0, 0.0, np.nextafter(high, np.inf)),
    )


def _squares(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on the squares of the numbers of an interval."""
    with np.errstate(all="ignore"):
        least = np.where((low <= 0) & (high >= 0), 0.0, np.minimum(low * low, high * high))
        return _outward(least, np.maximum(low * low, high * high))


def _products_of(first: TaylorModel, second: TaylorModel) -> tuple[np.ndarray, np.ndarray]:
    """Bounds on the products of two numbers; an end that is not known, 0 times infinity, bounds
    nothing."""
    with np.errstate(all="ignore"):
        products = [a * b for a in (first.low, first.high) for b in (second.low, second.high)]
    ends = np.array(np.broadcast_arrays(*products))
    finite = ~np.isnan(ends)
    return _outward(np.where(finite, ends, -np.inf).min(0), np.where(finite, ends, np.inf).max(0))


def _by_degree(size: np.ndarray, numbers: int, order: int) -> np.ndarray:
    """The sums of sizes over the monomials of each degree."""
    if len(size) == 1:  # without numbers there is no degree but 0
        return np.concatenate([size, np.zeros((order, *size.shape[1:]))])
    begins = _degrees(numbers, order)
    if size.size < SMALL_ARRAY:
        return np.add.reduceat(size, begins[:-1], axis=0)
    sums = np.empty((order + 1, *size.shape[1:]))
    for degree in range(order + 1):
        sums[degree] = size[begins[degree] : begins[degree + 1]].sum(0)
    return sums


class Sizes(NamedTuple):
    """Of the terms of matrices: sums of sizes for each degree and for all degrees above each,
    and which terms are not 0."""

    by_degree: np.ndarray
    above: np.ndarray
    whole: np.ndarray
    present: np.ndarray


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Matrices within `rest` of `sum_k terms[k] s^exponents[k]`, entry by entry, for all s in [-1,
    1]^numbers.

    terms: `(monomials, ..., n, m)`, those of total degree up to `order`, the constant one first,
    then those of degree one in the order of the numbers; rest: `(..., n, m)`. Sums and products
    enclose those of any two matrices at the same s. Accuracy: rounding of the terms is in the rest;
    that of the rest itself is not, and a check has to leave room for it.
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
        rows: Sequence[Sequence[Any]],
        shape: tuple[int, int],
        numbers: int,
        order: int,
        cells: tuple[int, ...] = (),
    ) -> Polynomials:
        """Return the matrices of these entries, models, arbs or numbers: `(*cells, n, m)`, or
        more if the models have more."""
        models = (element for row in rows for element in row if isinstance(element, TaylorModel))
        shapes = [np.shape(model.rest) for model in models]
        cells = np.broadcast_shapes(cells, *shapes)
        terms = np.zeros((len(monomials(numbers, order)[0]), *cells, *shape))
        rest = np.zeros((*cells, *shape))
        for i, row in enumerate(rows):
            for j, entry in enumerate(row):
                if isinstance(entry, TaylorModel):
                    terms[..., i, j] = entry.terms
                    rest[..., i, j] = entry.rest
                elif not (isinstance(entry, int) and entry == 0):
                    terms[0, ..., i, j], rest[..., i, j] = midpoint(entry)
        return Polynomials(terms, rest, numbers, order)

    @staticmethod
    def multiply_degree(
        terms: np.ndarray,
        one: np.ndarray,
        two: np.ndarray,
        numbers: int,
        order: int,
        degree: int,
        present: np.ndarray | None = None,
    ) -> None:
        """Put the terms of a degree of the product of two matrices in their places; all are terms
        `(monomials, ..., n, m)`, of a total degree up to `order`.

        present: which terms of either matrix may differ from 0, all by default.
        """
        which = (np.ones(len(terms), bool) if present is None else present).tobytes()
        plan = _pairs(numbers, order, which, which, _at_once(terms[0].size), degree)
        _multiply_into(terms, one, two, plan, np.matmul)

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
        by_degree = _by_degree(size, self.numbers, self.order)
        up_to = np.cumsum(by_degree, 0)
        return Sizes(by_degree, np.maximum(up_to[-1] - up_to, 0.0), up_to[-1], present)

    def _like(self, terms: np.ndarray, rest: np.ndarray) -> Polynomials:
        return Polynomials(terms, rest, self.numbers, self.order)

    def __add__(self, other: Polynomials) -> Polynomials:
        terms = self.terms + other.terms
        # A sum with 0 is exact: what nothing in a loop moves has no error.
        rounded = np.where((self.terms != 0) & (other.terms != 0), np.abs(terms), 0.0)
        return self._like(terms, self.rest + other.rest + UNIT_ROUNDING * rounded.sum(0))

    def __sub__(self, other: Polynomials) -> Polynomials:
        return self + other.times(-1.0)

    def times(self, factor: float | np.ndarray) -> Polynomials:
        """The matrices times exact factors, entry by entry."""
        terms = self.terms * factor
        return self._like(terms, self.rest * np.abs(factor) + UNIT_ROUNDING * np.abs(terms).sum(0))

    def __matmul__(self, other: Polynomials) -> Polynomials:
        return self._product(other, np.matmul, self.terms.shape[-1])

    def entrywise(self, other: Polynomials) -> Polynomials:
        """The products of entries at the same place."""
        return self._product(other, np.multiply, 1)

    def _product(
        self, other: Polynomials, multiply: Callable[..., Any], summed: int
    ) -> Polynomials:
        first = self.sizes
        second = other.sizes
        # No more terms make one of the product; `above` is a difference of sums over the degrees.
        roundings = (
            2
            * (summed + min(first.present.sum(), second.present.sum()) + self.order)
            * UNIT_ROUNDING
        )
        rest = multiply(self.rest, second.whole + other.rest) + multiply(
            first.whole, other.rest + roundings * second.whole
        )
        if first.present[1:].any() and second.present[1:].any():
            rest = rest + multiply(first.by_degree[1:], second.above[self.order - 1 :: -1]).sum(0)
        at_once = _at_once(max(self.rest.size, other.rest.size, rest.size))
        terms = np.zeros((len(self.terms), *rest.shape))
        if not first.present[1:].any():  # the same for all numbers
            terms[second.present] = multiply(self.terms[0], other.terms[second.present])
        elif not second.present[1:].any():
            terms[first.present] = multiply(self.terms[first.present], other.terms[0])
        else:
            plan = _pairs(
                self.numbers, self.order, first.present.tobytes(), second.present.tobytes(), at_once
            )
            _multiply_into(terms, self.terms, other.terms, plan, multiply)
        return self._like(terms, rest)

    def scaled(self, model: TaylorModel | Any) -> Polynomials:
        """The matrices times a number."""
        cells = (1,) * (self.rest.ndim - 2)
        return self.entrywise(
            Polynomials.of_entries([[model]], (1, 1), self.numbers, self.order, cells)
        )

    def identity(self) -> Polynomials:
        """The identities of the size of square matrices."""
        identities = np.broadcast_to(np.eye(self.rest.shape[-1]), self.rest.shape)
        return Polynomials.constant(identities, self.numbers, self.order)

    def in_cells(self, cells: tuple[int, ...]) -> Polynomials:
        """The same matrices in all cells of a batch of this shape."""
        shape = *cells, *self.rest.shape[-2:]
        return self._like(
            np.broadcast_to(self.terms, (len(self.terms), *shape)),
            np.broadcast_to(self.rest, shape),
        )

    def of(self, which: Any) -> Polynomials:
        """The matrices at some places of a leading axis."""
        return self._like(self.terms[:, which], self.rest[which])

    def at(
        self, rows: np.ndarray | Sequence[int], columns: np.ndarray | Sequence[int]
    ) -> Polynomials:
        """Some rows and columns."""
        place: Any = np.ix_(rows, columns)  # type: ignore[arg-type]  # of either kind
        return self._like(self.terms[..., *place], self.rest[..., *place])

    def put(self, place: tuple[Any, Any], part: Polynomials) -> None:
        """Set the rows and columns of a place to another matrix."""
        self.terms[..., *place] = part.terms
        self.rest[..., *place] = part.rest

    def within(self, middle: np.ndarray, half: np.ndarray) -> Polynomials:
        """The same matrices for s = middle + half t, as polynomials in t, `(numbers,)` each."""
        e = self.exponents
        powers = np.arange(self.order + 1)
        less = np.maximum(powers - powers[:, None], 0)
        factor = np.ones((len(e), len(e)))  # [new, old]
        for number, (centre, wide) in enumerate(zip(middle, half, strict=True)):
            table = _binomials(self.order).T * wide ** powers[:, None] * centre**less
            factor *= table[e[:, number, None], e[:, number]]
        terms = np.tensordot(factor, self.terms, (1, 0))
        rounding = 4 * (len(e) + self.order) * UNIT_ROUNDING * np.abs(self.terms).sum(0)
        return self._like(terms, self.rest + rounding)

    def similar(
        self, basis: np.ndarray, inverse: np.ndarray, after: np.ndarray | None = None
    ) -> Polynomials:
        """Matrices similar to these: `C^-1 A B` for the exact inverse of the basis C, of all or of
        each; `inverse` is nearly that. after: C, by default B.

        With `inverse C = I + D` they are `(I + D)^-1 inverse A B`.
        """
        after = basis if after is None else after
        size = np.abs(inverse)
        n = basis.shape[-1]
        terms = inverse @ self.terms @ basis
        rest = size @ self.rest @ np.abs(basis) + 4 * n * UNIT_ROUNDING * (
            size @ np.abs(self.terms).sum(0) @ np.abs(basis)
        )
        D = np.abs(inverse @ after - np.eye(n)) + 2 * n * UNIT_ROUNDING * (size @ np.abs(after))
        share = D.sum(-1).max(-1)[..., None, None]
        with np.errstate(divide="ignore"):
            off = D + share * D.max((-1, -2), keepdims=True) / (1 - share)
        off = np.where(share < 0.5, off, np.inf)
        return self._like(terms, rest + 2 * off @ (np.abs(terms).sum(0) + rest))

    def widest(self) -> np.ndarray:
        """Return the number that moves the entries of a matrix most, of each; -1 if none does."""
        sizes = np.moveaxis(np.abs(self.terms).sum((-1, -2)), 0, -1)
        return _most(np.nan_to_num(sizes, posinf=1e300) @ (self.exponents > 0))

    def refuse(self, unbounded: np.ndarray) -> None:
        """Raise UnresolvedError for some of the matrices, booleans; with no number where it is not
        the polynomials, but what they leave out, that is large."""
        if np.any(unbounded):
            moved = np.nan_to_num(np.abs(self.terms[1:]).sum((0, -1, -2)), posinf=1e300)
            left_out = np.nan_to_num(self.rest.sum((-1, -2)), nan=np.inf, posinf=1e301)
            raise UnresolvedError(unbounded, np.where(left_out > moved, -1, self.widest()))

    def exponential(self) -> Polynomials:
        """`exp(A)` of square matrices, in units u, powers of 2, in which rows and columns are alike
        in size:

            exp(A) = U (I + X + X^2/2! + ... + X^12/12! + R)^(2^k) U^-1,   X = U^-1 A U/2^k,   U = diag(u)

        with as many squarings k for all. The series is added up by powers of X^4 (Paterson and
        Stockmeyer). What it leaves out is `|R| <= |X|^13 (I - |X|)^-1/13!`, entry by entry, where
        the rows of |X| add up to 1/4 at most. Wherever a size is asked for, it is `whole`: a bound
        on the entry for all values of the numbers, polynomial and rest together.
        """
        self.refuse(~np.isfinite(self.whole).all((-1, -2)))
        units = balanced(self.whole)
        ratio = units[..., None, :] / units[..., :, None]
        scaled = self.times(ratio)
        norm = scaled.whole.sum(-1).max(-1, initial=0.0)
        halvings = np.maximum(0, np.ceil(np.log2(np.maximum(norm, NEXT_TO_ZERO) / 0.25)))
        self.refuse(halvings > BALL_BITS)  # the norm is above 2^BALL_BITS: squares overflow
        squarings = int(halvings.max())
        scaled = scaled.times(0.5**squarings)
        powers = [scaled.identity(), scaled]
        while len(powers) <= SERIES_BLOCK:
            powers.append(powers[-1] @ scaled)
        largest = powers.pop()  # X^4, and I to X^3 are left
        total = largest.times(1 / factorial(SERIES_TERMS))
        for begin in range(SERIES_TERMS - SERIES_BLOCK, -1, -SERIES_BLOCK):
            weights = [1 / factorial(begin + k) for k in range(SERIES_BLOCK)]
            total = total + _combined(powers, weights)
            if begin:
                total = total @ largest
        size = scaled.whole
        tail = np.linalg.matrix_power(size, SERIES_TERMS + 1) @ _series_of(size)
        total = self._like(total.terms, total.rest + tail / factorial(SERIES_TERMS + 1))
        with np.errstate(over="ignore", invalid="ignore"):
            for _ in range(squarings):
                total = total @ total
        self.refuse(~np.isfinite(total.whole).all((-1, -2)))
        return total.times(1 / ratio)

    def inverse(self) -> Polynomials:
        """The inverses of square matrices: with C near to that of its middle, `(I - D)^-1 C` for `D
        = I - C A`.

        The terms X of `(I - D)^-1 = I + D (I - D)^-1` follow degree by degree. For `R = I - (I - D)
        X` the inverse is `X (I - R)^-1`, and the rest of X is at most `|X| |R| (I - |R|)^-1`, entry
        by entry, whatever X is. Errors: UnresolvedError if R does not shrink.
        """
        with np.errstate(all="ignore"):
            C = Polynomials.constant(_inverses(self.terms[0]), self.numbers, self.order)
            identity = self.identity()
            D = identity - C @ self
            units = balanced(D.whole)
            ratio = units[..., None, :] / units[..., :, None]
            D = D.times(ratio)
            X = self._like(identity.terms.copy(), identity.rest)
            read = self.exponents[D.sizes.present].any(0)  # the numbers on which D depends
            reached = ~np.any(self.exponents[:, ~read], 1)
            for degree in range(1, self.order + 1 if read.any() else 1):
                self.multiply_degree(
                    X.terms, D.terms, X.terms, self.numbers, self.order, degree, reached
                )
            R = identity - X + D @ X
            size = R.whole
        D.refuse(~(size.sum(-1).max(-1, initial=0.0) < SHRINKS_BY))
        left_out = X.whole @ size @ np.abs(np.linalg.inv(identity.terms[0] - size)) * (1 + 1e-6)
        return self._like(X.terms, left_out).times(1 / ratio) @ C


def _combined(matrices: list[Polynomials], factors: list[float]) -> Polynomials:
    """The sum of matrices times positive factors, each of which is rounded."""
    roundings = (len(factors) + 2) * UNIT_ROUNDING
    terms = np.zeros_like(matrices[-1].terms)
    rest = np.zeros_like(matrices[-1].rest)
    for matrix, factor in zip(matrices, factors, strict=True):
        terms += factor * matrix.terms
        rest += factor * (matrix.rest + roundings * matrix.whole)
    return Polynomials(terms, rest, matrices[0].numbers, matrices[0].order)


def _series_of(X: np.ndarray) -> np.ndarray:
    """Bounds on the entries of `(I - X)^-1 = I + X + X^2 + ...`, for X >= 0 whose rows add up to
    1/4 at most.

    Entry (i, j) is the weight of all walks from i to j. Those of fewer than N >= n steps are added
    up. A longer one is a walk of N steps and a further one, which is a path of fewer than n steps
    with walks that return to each of its at most n states: the weights of these add up to 4/3 at
    most. So the rest is at most `(4/3)^n X^N (I + ... + X^(N-1))`.
    """
    n = X.shape[-1]
    total = np.eye(n)
    power = X
    for _ in range(max(1, (n - 1).bit_length())):
        total = total + power @ total
        power = power @ power
    rest = (4 / 3) ** n * power @ total
    return (total + rest) * (1 + OF_SUMS)


def _inverses(matrices: np.ndarray) -> np.ndarray:
    """The inverses of matrices, NaN for those that have none."""
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        if matrices.ndim == 2:
            return np.full_like(matrices, np.nan)
        return np.stack([_inverses(matrix) for matrix in matrices])


def balanced(size: np.ndarray) -> np.ndarray:
    """Powers of 2 for the states in which rows and columns of sizes are alike, `(*cells, n)`."""
    units = np.ones(size.shape[:-1])
    diagonal = np.diagonal(size, axis1=-2, axis2=-1)
    with np.errstate(all="ignore"):
        for _ in range(6):  # sweeps of balancing
            before = units.copy()
            for i in range(size.shape[-1]):
                unit = units[..., i]
                column = (size[..., :, i] / units).sum(-1) * unit - diagonal[..., i]
                row = (size[..., i, :] * units).sum(-1) / unit - diagonal[..., i]
                scalable = (column > 0) & (row > 0) & np.isfinite(column) & np.isfinite(row)
                by = np.exp2(np.round(np.log2(row / column) / 2))
                units[..., i] = np.where(scalable, unit * by, unit)
            if (units == before).all():
                break
    return units


@lru_cache(maxsize=32)
def _binomials(order: int) -> np.ndarray:
    table = np.zeros((order + 1, order + 1))
    table[:, 0] = 1
    for i in range(1, order + 1):
        table[i, 1:] = table[i - 1, 1:] + table[i - 1, :-1]
    return table
