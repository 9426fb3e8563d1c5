"""Sums over a frame's ticks under a force that turns, and their errors, against marches of members within them."""

import numpy as np
import pytest

from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._monodromy.periodic import in_a_row
from wavesweep.engine._response.circle import Circle
from wavesweep.engine._response.lifted import Stretch, Sums, _joined

TICKS, UNSURE = 150, 1e-9  # ticks: a stretch of halves, of which one has halves itself


def marched(E, B, C, D, z):
    """Sums over the ticks of `z^-i y`, for each state at first and for the force `z^i`, and what it adds to the state."""
    n = len(E)
    states, driven = np.eye(n, dtype=complex), np.zeros((n, 1), complex)
    rows, forced = 0, 0
    for tick in range(TICKS):
        rows = rows + z**-tick * C @ states
        forced = forced + z**-tick * (C @ driven + D * z**tick)
        states, driven = states + E @ states, driven + E @ driven + B * z**tick
    return rows, forced, driven


def test_sums_and_their_errors_are_those_of_members():
    """With positive entries and a force that is constant the largest members are off by all of the bound."""
    r = np.random.default_rng(5)
    shapes = [(3, 3), (3, 1), (2, 3), (2, 1)]
    E, B, C, D = (r.uniform(0.2, 1.0, shape) * size for shape, size in zip(shapes, [1e-3, 1, 1, 1], strict=True))
    unsure = [Bounded(each, UNSURE * each) for each in (E, B, C, D)]
    tick = Stretch(
        unsure[0], unsure[2].part(..., None, slice(None)), unsure[1], unsure[3], unsure[3].part(..., [-1], slice(None))
    )
    stretch = in_a_row([0] * TICKS, [tick], _joined)
    assert stretch.first.first or stretch.second.first
    circle = Circle(np.array([0.0, 7.0, 31.0]), 100.0, TICKS)
    found = Sums.of(stretch, circle)
    for point, z in enumerate(np.exp(2j * np.pi * circle.frequency / 100)):
        exact = marched(E, B, C, D, z)
        sums = found.rows[:, point], found.forced[:, [point]], found.driven[:, [point]]
        bounds = found.drows, np.broadcast_to(found.dforced, (2, 3))[:, [point]], found.ddriven
        largest = marched(*(each * (1 + UNSURE) for each in (E, B, C, D)), z)
        for value, bound, middle, end in zip(sums, bounds, exact, largest, strict=True):
            assert value == pytest.approx(middle, rel=1e-12)
            assert (np.abs(end - value) <= bound * (1 + 1e-6)).all()
            if z == 1:
                assert (np.abs(end - value) >= bound * 0.99).all()
