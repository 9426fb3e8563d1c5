"""Loops of direct terms that have no solution at some value of a number, or next to it: nothing is certified over them."""

from fractions import Fraction

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.program.sweep.grid import own_loop


def pair_of_poles(beside):
    """A spring that is read late, and two gains in a loop of direct terms, whose poles are c = 1 +- i beside."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"c": 0.1, "d": beside, "e": 3 * beside},
        "block": {
            "m": {"type": "mass", "mass": 0.1, "damping": 1.5},
            "g": {"type": "gain", "k": 1.0},
            "h": {"type": "gain", "k": 1.0},
            "s": {"type": "hold", "every": 2},
        },
        "wire": {"g.u": "c*g.y - d*h.y + e*m.v", "h.u": "d*g.y + c*h.y", "s.u": "m.x", "m.f": "h.y - 200*s.y"},
    }


@pytest.mark.slow
@pytest.mark.parametrize("beside", [1e-2, 1e-7])
def test_a_narrow_band_between_two_poles_beside_the_axis_is_found_or_doubted(beside):
    """Over some 2 times `beside` about c = 1 the loop is unstable; what is left of the poles elsewhere shows nothing of it."""
    loop = wavesweep.compile(pair_of_poles(beside))
    rows = loop.stable_intervals("c", (0, 3))
    radius = loop.spectral_radius(c=[1 - 3 * beside, 1, 1 + 3 * beside])
    assert list(radius > 1) == [False, True, False]
    if beside >= 1e-5:
        assert rows.certified.all()
    if rows.certified.all():
        assert len(rows) == 2
        assert rows.high[0] == pytest.approx(1 - 1.15 * beside, abs=0.1 * beside)
        for end, way in ((rows.high[0], -1), (rows.low[1], 1)):
            inside, outside = loop.spectral_radius(c=[end + way * 1e-3 * beside, end - way * 1e-3 * beside])
            assert inside < 1 < outside


@pytest.mark.parametrize("through", [1e-2, 1e-4, 1e-7, 1e-9])
def test_a_pole_of_small_weight_is_not_certified_over(through):
    """`u = c u + through v`: no solution at c = 1, and next to it a gain of any size."""
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"c": 0.1, "e": through},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.5}, "g": {"type": "gain", "k": 1.0}},
        "wire": {"g.u": "c*g.y + e*m.v", "m.f": "g.y"},
    }
    rows = wavesweep.compile(spec).stable_intervals("c", (0, 3))
    inside = (rows.low <= 1) & (rows.high >= 1) & rows.certified
    assert not inside.any()


@pytest.mark.parametrize("seed", [0, 4, 7, 11])
def test_an_end_is_not_certified_beyond_what_an_ill_conditioned_loop_keeps(seed):
    """`x+ = x - T (1 + B^2) e/(1 - ab) x`, whose end is known as a fraction, and 1 - ab = 1e-3 to 1e-11."""
    random = np.random.default_rng(seed)
    gap, a = 10.0 ** random.uniform(-11, -3), random.uniform(0.3, 3)
    b, e = (1 - gap) / a, gap * random.uniform(50, 500)
    exact = float(2 * (1 - Fraction(a) * Fraction(b)) * 1000 / Fraction(e) - 1) ** 0.5
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"a": a, "b": b, "e": e, "B": 0.5},
        "block": {
            "m": {"type": "integrator", "method": "explicit"},
            "g": {"type": "gain", "k": 1.0},
            "h": {"type": "gain", "k": 1.0},
        },
        "wire": {"g.u": "a*h.y + e*m.y", "h.u": "b*g.y", "m.u": "-(1+B*B)*g.y"},
    }
    rows = wavesweep.compile(spec).stable_intervals("B", (0.1, 2 * exact))
    assert rows.high.max() == pytest.approx(exact, rel=1e-9 if rows.certified.all() else 1e-3)
    if gap > 1e-5:
        assert rows.certified.all()


def gain_on_velocity(gain):
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"c": 0.1},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.5}},
        "wire": {"m.f": f"({gain})*m.v - 200*m.x"},
    }
    return wavesweep.compile(spec)


@pytest.mark.parametrize("gain", ["1e-10/(c-1)**2", "1e-8/((c-1)*(c-1.001))", "1e-9/(c-1)"])
def test_poles_of_expressions_are_refused(gain):
    with pytest.raises(
        UsageError, match=r"between 0 and 3 there is a value without a loop, .* since wire\.m\.f divides by zero"
    ):
        gain_on_velocity(gain).stable_intervals("c", (0, 3))


@pytest.mark.slow
def test_poles_of_expressions_beside_the_range_are_not_certified_over():
    """The gain is large at c = 1 alone, where the loop is unstable."""
    loop = gain_on_velocity("3e-10/((c-1)**2+1e-10)")
    rows = loop.stable_intervals("c", (0, 3))
    assert loop.spectral_radius(c=[1.0])[0] > 1
    assert not ((rows.low <= 1) & (rows.high >= 1) & rows.certified).any()


@pytest.mark.slow
def test_a_filter_goes_on_to_a_cutoff_of_0():
    """A frame has no pole there: the lower end of the range leaves no digits for it."""
    loop, name = wavesweep.compile({"controller": {"kind": "pmw-lm", "b": 25.0, "Kp": 20.0}}), "filters.lp1.cutoff_hz"
    assert own_loop(loop.spec, name).domain(name, (2.0, 60.0))[0] < 0.2
    found = [loop.stable_intervals(name, (low, 60.0), b=[30.0, 50.0]) for low in (2.0, 1e-3)]
    assert all(table.certified.all() for table in found)
    assert [table.low.tolist() for table in found] == [[2.0, 2.0], [1e-3, 1e-3]]
    assert found[0].high.to_numpy() == pytest.approx(found[1].high.to_numpy(), rel=1e-11)
    radius = loop.spectral_radius(b=50.0, **{name: found[0].high[1] * np.array([1 - 1e-6, 1 + 1e-6])})
    assert radius[0] < 1 < radius[1]


@pytest.mark.slow
def test_a_pivot_whose_zeros_cancel_poles_is_seen_through():
    """`g = (1 - (x^2 + d^2)/(x^2 + 100 d^2)) g + v`, x = c - 1: as many zeros as poles."""
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"c": 0.1},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.5}, "g": {"type": "gain", "k": 1.0}},
        "wire": {"g.u": "(1-((c-1)**2+1e-14)/((c-1)**2+1e-12))*g.y + m.v", "m.f": "g.y-200*m.x"},
    }
    loop = wavesweep.compile(spec)
    rows = loop.stable_intervals("c", (0, 3))
    assert loop.spectral_radius(c=[1.0])[0] > 1
    assert not ((rows.low <= 1) & (rows.high >= 1) & rows.certified).any()
