"""Functions that are positive on a box but for a small hole: found, or left open; those without are proved."""

from dataclasses import dataclass

import numpy as np
import pytest

from wavesweep.engine.intervals import FunctionValues, positive

BOX = [[0.0, 0.0], [3.0, np.pi]]
UNLIMITED = (-np.inf, np.inf)


everywhere = np.less  # of all that is wider than nothing


@dataclass
class Given:
    """A function by its values and its pivots."""

    function: object
    pivot: object = staticmethod(lambda p, _: np.ones_like(p))

    def units(self, _):
        return None

    def values(self, x, _):
        value = self.function(*x.T)
        return FunctionValues(
            value[None] / abs(value), np.log(abs(value))[None], np.ones((1, len(x))), self.pivot(*x.T)[:, None]
        )


def bowl(p0, theta0, depth):
    """Least `depth`, at one point."""
    return lambda p, theta: depth + (np.expm1(p - p0)) ** 2 + (2 - 2 * np.cos(theta - theta0))


@pytest.mark.parametrize("seed", range(3))
def test_a_hole_is_found_or_left_open_and_a_bowl_above_zero_is_proved(seed):
    rng = np.random.default_rng(seed)
    p0, theta0 = rng.uniform(0.1, 2.9), rng.uniform(0.1, 3.0)
    depth = 10 ** rng.uniform(-6, -3)
    cover = positive(Given(bowl(p0, theta0, depth)), BOX, UNLIMITED, everywhere, 100_000)
    assert not cover.open.size
    assert not cover.negative.size
    cover = positive(Given(bowl(p0, theta0, -depth)), BOX, UNLIMITED, everywhere, 100_000)
    held = (cover.open[:, 0] <= [p0, theta0]) & ([p0, theta0] <= cover.open[:, 1])
    assert cover.negative.size or held.all(-1).any()
    for p, theta in cover.negative:
        assert bowl(p0, theta0, -depth)(p, theta) < 0


@pytest.mark.parametrize("degree", [8, 16, 24])
def test_terms_beyond_the_degree_of_a_series_are_not_overlooked(degree):
    """At the ends of the box a function is negative by one of them alone."""
    cover = positive(Given(lambda p, _: 1 - 1.5 * (p / 1.5 - 1) ** degree), BOX, UNLIMITED, everywhere, 5000)
    assert cover.negative.size or {0.0, 3.0} <= set(cover.open[..., 0].ravel())


def test_nothing_is_proved_across_a_pole_of_small_weight():
    """`1 - 1e-12/(p - a)` is below 0 next to a, where no sample comes near; its pivot tells of it."""
    a = 1.2345
    function = Given(lambda p, _: 1 - 1e-12 / (p - a), lambda p, _: p - a)
    cover = positive(function, BOX, UNLIMITED, everywhere, 20_000)
    assert ((cover.open[:, 0, 0] <= a) & (a <= cover.open[:, 1, 0])).any()
    assert np.ptp(cover.open[..., 0]) < 0.1


def test_a_box_is_halved_until_it_is_within_the_limits_and_resolved():
    asked = []

    def resolved(low, high):
        asked.append(high - low)
        return high - low < 0.5

    function = Given(lambda p, theta: 2 + np.cos(theta) + 0 * p)
    for limits in ((-0.2, np.inf), (-np.inf, 3.2)):
        cover = positive(function, BOX, limits, resolved, 100_000)
        assert not cover.open.size
        assert max(asked) <= 1.5  # the whole would be looked at beyond the limits
    cover = positive(function, BOX, (0.0, np.inf), resolved, 5000)
    assert cover.open.min() == 0  # next to a limit nothing is known
