"""Evenly spaced numbers without numpy, to the same bits where its arithmetic is the processor's own."""

from __future__ import annotations

import math


def linear(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Return what `numpy.linspace(start, stop, num)` holds, bit for bit; both ends are exact."""
    if num == 1:
        return (start,)
    span = stop - start
    step = span / (num - 1)
    if step == 0.0:  # a span of a few denormal numbers: the quotient underflows, the products need not
        inner = [i / (num - 1) * span + start for i in range(num - 1)]
    else:
        inner = [i * step + start for i in range(num - 1)]
    return (*inner, stop)


def logarithmic(start: float, stop: float, num: int) -> tuple[float, ...]:
    """Return what `numpy.geomspace(start, stop, num)` holds; both ends are exact, 0 < start <= stop.

    Accuracy: the two differ by the rounding of exponents, a few ulp times `log(10)*|log10(value)|`, because numpy has
    logarithms and powers of its own.
    """
    if num == 1:
        return (start,)
    exponents = linear(math.log10(start), math.log10(stop), num)[1:-1]
    return (start, *(_power_of_ten(exponent, start, stop) for exponent in exponents), stop)


def _power_of_ten(exponent: float, lowest: float, highest: float) -> float:
    try:
        return min(max(10.0**exponent, lowest), highest)
    except OverflowError:  # an exponent that rounding has put above the largest double's
        return highest
