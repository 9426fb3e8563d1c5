"""Two crossings that almost merge: both are found or none, and certified only where that is right."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support import exact
from support.intervals import cut_of, intervals_of, mislabelled
from support.specs import nested, random_values, values_of

import wavesweep
from wavesweep.engine._stability import stable

pytestmark = pytest.mark.slow

mp = exact.mp


def merging_point(values, low, high):
    """Bracket the B_VE at which a hole in the stable K_VE closes, by bisection on the count: (B_VE, angle)."""
    before = intervals_of(values, fixed=low).count[0]
    assert intervals_of(values, fixed=high).count[0] != before
    low_and_high = [low, high]
    for _ in range(24):
        middle = sum(low_and_high) / 2
        low_and_high[int(intervals_of(values, fixed=middle).count[0] != before)] = middle
    two = low_and_high[0] if before == 2 else low_and_high[1]
    found = intervals_of(values, fixed=two)
    return two, found.high_omega[0] * values["rates.ratio"] / values["rates.fast_hz"]


def exact_merging_point(values, B_VE, theta):
    """The same at 50 digits: `Im K(theta) = 0` and its derivative, by Newton in (theta, B_VE)."""
    loop = exact.frame(values)

    def equations(angle, B):
        z = mp.mpc(mp.cos(angle), mp.sin(angle))  # not expj: findroot traps complex results of real arguments
        G_x, G_v = loop.transfer(z)
        return mp.im((1 - B * G_v) / G_x)

    h = mp.mpf(10) ** -15

    def both(angle, B):
        left, middle, right = (equations(angle + k * h, B) for k in (-1, 0, 1))
        return middle, (right - left) / (2 * h)

    angle, B = mp.findroot(both, (mp.mpf(float(theta)), mp.mpf(float(B_VE))), tol=1e-25)
    return B, angle


# Seeds of random loops with a hole that closes as B_VE grows, and where (roughly).
MERGING = [(8, 1.0, 1.15), (142, 0.2, 0.35)]


@pytest.mark.parametrize(("seed", "low", "high"), MERGING)
def test_a_closing_hole_is_certified_only_where_the_count_is_right(seed, low, high):
    """At relative distances from 1e-2 to 1e-15 of the double root, on both sides of it, known to 25 digits.

    The hole is as wide as the root of the distance, so at 1e-15 its two ends are one to rounding.
    """
    values = random_values(seed)
    start, theta = merging_point(values, low, high)
    B, _ = exact_merging_point(values, start, theta)
    assert low < B < high
    distance = 10.0 ** -np.arange(2.0, 16.0)
    column = np.concatenate([float(B) * (1 - distance), float(B) * (1 + distance)])
    found = intervals_of(values, fixed=column)
    certified = np.array([found.certified[found.column == i].all() for i in range(column.size)])
    count = np.array([found.count[found.column == i][0] for i in range(column.size)])
    sides = [intervals_of(values, fixed=edge).count[0] for edge in (low, high)]
    truth = np.where([mp.mpf(float(b)) < B for b in column], *sides)
    assert np.array_equal(count[certified], truth[certified])
    assert certified[np.abs(column / float(B) - 1) > 1e-5].all()
    assert not certified.all()


# Two crossings that almost merge at the end of the circle, where next to nothing damps the hand.
FEEBLE = {
    "mass": 0.5, "velocity": "difference", "damping": 9.16e-5, "b": 1.7e-4, "K_LM": 42.0, "K_VE": 8.17e-8,
    "integration": "trapezoidal", "lp1_cutoff_hz": 29.0, "hp_order": 0, "lp2_order": 0, "ratio": 5,
    "fast_hz": 2000.0,
}  # fmt: skip


def test_a_crossing_next_to_the_end_of_the_circle_does_not_turn_the_others_round():
    """Stable about 1e-4 N*s/m, by eigenvalues; a certified answer may not say otherwise."""
    values = values_of("pmw-lm", **FEEBLE)
    found, span = intervals_of(values, "B_VE", (0, 0.01)), (0, 0.01)
    assert found.count[0] == 1
    assert mislabelled(cut_of(values), "B_VE", span, [8.17e-8], found) == []


def test_a_crossing_that_polynomials_miss_is_found(monkeypatch):
    """The limit above the hole of the paper: counts do not fit the others, so the column is searched in another way."""

    def one_less(search, *given):
        found = search(*given)
        kept = np.abs(found.value - 4449) > 100
        return replace(found, **{name: getattr(found, name)[kept] for name in ("column", "value", "theta", "jump", "inverse")})

    loop = wavesweep.compile(nested(values_of("pmw", integration="explicit", lp1_cutoff_hz=8.57)))
    expected = loop.stable_intervals()
    monkeypatch.setattr(stable, "crossings", partial(one_less, stable.crossings))
    found = loop.stable_intervals()
    assert (found.intervals.tolist(), found.certified.tolist()) == ([2, 2], [True, True])
    np.testing.assert_allclose(found[["low", "high"]], expected[["low", "high"]], rtol=1e-9)
