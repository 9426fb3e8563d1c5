"""Whether a number is 0 for all values of its sides: by algebra, as no enclosure shows it.

A number becomes a fraction of polynomials, {monomial: share}, in its sides and in values of functions. These stand for
themselves, but that root(x)^2 = x and sin(x)^2 = 1 - cos(x)^2. A monomial is a set of (symbol, power); a symbol is the name of a
side, or the number of a function's value. Denominators are kept as factors, {polynomial as a set: power}.
"""

from fractions import Fraction
from typing import NamedTuple

from .balls import Number, Refused, Ring, sum_of

Polynomial = dict[frozenset, Fraction]
ONE: Polynomial = {frozenset(): Fraction(1)}
TERMS = 4000  # of a polynomial


class Ratio(NamedTuple):
    top: Polynomial
    bottom: dict[frozenset, int]


class Identities:
    """Numbers as ratios, and the values of functions that were met in them."""

    def __init__(self):
        self.known: dict[Number, Ratio] = {}
        self.symbols: dict[tuple, int] = {}
        self.squares: dict[int, Polynomial] = {}

    def vanishes(self, number: Number) -> bool:
        """Whether it is 0 wherever no divisor is 0."""
        waiting = [number]
        while waiting:  # those first that others are made of
            now = waiting[-1]
            missing = [part for part in now.parts if part not in self.known]
            if missing:
                waiting += missing
                continue
            waiting.pop()
            if now not in self.known:
                self.known[now] = self._ratio(now)
        return not self.known[number].top

    def _ratio(self, now: Number) -> Ratio:
        if now.exact is not None:
            return Ratio({frozenset(m): share for m, share in now.exact.items()}, {})
        parts = [self.known[part] for part in now.parts]
        if now.make is sum_of:
            return self._sum(*parts)
        if now.make is Ring.multiply:
            (a, b), (c, d) = parts
            return _shortened(self._times(a, c), _powers(b, d, sum))
        if now.make is Ring.reciprocal:
            return self._reciprocal(*parts)
        return Ratio({frozenset([(self._symbol(now.make, parts), 1)]): Fraction(1)}, {})

    def _sum(self, first: Ratio, second: Ratio) -> Ratio:
        bottom = _powers(first.bottom, second.bottom, max)
        total: Polynomial = {}
        for top, powers in (first, second):
            missing = {factor: power - powers.get(factor, 0) for factor, power in bottom.items()}
            total = _added(total, self._times(top, self._product(missing)))
        return _shortened(total, bottom)

    def _reciprocal(self, ratio: Ratio) -> Ratio:
        if not ratio.top:
            raise Refused("a divisor is 0")
        common = frozenset(each for each in _common(ratio.top) if isinstance(each[0], str))
        share = next(iter(ratio.top.values()))
        factor = {_together(m, _inverse(common)): x / share for m, x in ratio.top.items()}
        bottom = {} if factor == ONE else {frozenset(factor.items()): 1}
        top = self._times(self._product(ratio.bottom), {_inverse(common): 1 / share})
        return _shortened(top, bottom)

    def _product(self, factors: dict[frozenset, int]) -> Polynomial:
        total = ONE
        for factor, power in factors.items():
            for _ in range(power):
                total = self._times(total, dict(factor))
        return total

    def _symbol(self, function, arguments) -> int:
        key = (
            function,
            *((frozenset(top.items()), frozenset(bottom.items())) for top, bottom in arguments),
        )
        if key in self.symbols:
            return self.symbols[key]
        symbol = self.symbols[key] = len(self.symbols)
        if function is Ring.root and not arguments[0].bottom:
            self.squares[symbol] = arguments[0].top
        if function is Ring.sine:
            cosine = self._symbol(Ring.cosine, arguments)
            self.squares[symbol] = {**ONE, frozenset([(cosine, 2)]): Fraction(-1)}
        return symbol

    def _times(self, a: Polynomial, b: Polynomial) -> Polynomial:
        total: Polynomial = {}
        for m, x in a.items():
            for k, y in b.items():
                both = _together(m, k)
                total[both] = total.get(both, 0) + x * y
        if len(total) > TERMS:
            raise Refused("numbers that are too long to be compared")
        product: Polynomial = {}
        for m, x in total.items():
            product = _added(product, self._reduced(m, x))
        return product

    def _reduced(self, monomial, share) -> Polynomial:
        for symbol, power in monomial:
            if power > 1 and symbol in self.squares:
                rest = _together(monomial, {(symbol, -2)})
                return self._times({rest: share}, self.squares[symbol])
        return {monomial: share}


def _shortened(top: Polynomial, bottom: dict[frozenset, int]) -> Ratio:
    """Without factors that divide the numerator."""
    remaining = {}
    for factor, power in bottom.items():
        count = power
        while count and (shorter := _quotient(top, dict(factor))) is not None:
            top = shorter
            count -= 1
        if count:
            remaining[factor] = count
    return Ratio(top, remaining)


def _powers(first: dict, second: dict, together) -> dict:
    return {
        symbol: together((first.get(symbol, 0), second.get(symbol, 0))) for symbol in first | second
    }


def _together(monomial, further) -> frozenset:
    return frozenset(
        item for item in _powers(dict(monomial), dict(further), sum).items() if item[1]
    )


def _inverse(monomial) -> frozenset:
    return frozenset((symbol, -power) for symbol, power in monomial)


def _common(polynomial: Polynomial) -> frozenset:
    """The largest monomial that divides all; powers of sides, and of no other symbol, may be negative."""
    powers = [dict(m) for m in polynomial]
    symbols = {symbol for monomial in powers for symbol in monomial}
    least = ((symbol, min(monomial.get(symbol, 0) for monomial in powers)) for symbol in symbols)
    return frozenset(monomial for monomial in least if monomial[1])


def _added(a: Polynomial, b: Polynomial) -> Polynomial:
    total = dict(a)
    for m, x in b.items():
        total[m] = total.get(m, 0) + x
    return {m: x for m, x in total.items() if x}


def _quotient(top: Polynomial, factor: Polynomial) -> Polynomial | None:
    """The quotient of two polynomials, None if a rest is left."""
    common = _inverse(_common(top))
    rest = {_together(m, common): x for m, x in top.items()}
    symbols = sorted({symbol for m in (*rest, *factor) for symbol, _ in m}, key=str)

    def order(monomial):
        powers = dict(monomial)
        return [powers.get(symbol, 0) for symbol in symbols]

    lead = max(factor, key=order)
    quotient = {}
    while rest:
        leading = max(rest, key=order)
        place = _together(leading, _inverse(lead))
        if any(power < 0 for _, power in place):
            return None
        share = rest[leading] / factor[lead]
        quotient[_together(place, _inverse(common))] = share
        rest = _added(rest, {_together(place, m): -share * x for m, x in factor.items()})
    return quotient
