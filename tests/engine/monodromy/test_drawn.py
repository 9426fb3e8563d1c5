"""Loops of several rates against limits that are known in closed form, the built-in loops, and products tick by tick."""

from fractions import Fraction
from functools import partial

import numpy as np
import pytest
from support.drawings import random_drawing

from wavesweep.engine._monodromy.periodic import Ticks, frame_of, products_of_rows, then
from wavesweep.engine._monodromy.product import product_with_errors, product_with_tight_errors
from wavesweep.engine._monodromy.rounding import both
from wavesweep.engine.doubles import ENTRY_ROUNDING


@pytest.mark.parametrize("seed", range(8))
def test_a_frame_is_the_product_of_its_ticks(seed):
    drawn = random_drawing(seed)
    ticks = Ticks.of(drawn)
    whole = np.eye(len(ticks.states))
    for kind in ticks.kind:
        whole = (np.eye(len(whole)) + ticks.maps[kind].E) @ whole
    assert np.abs(frame_of(ticks) + np.eye(len(whole)) - whole).max() < 1e-12 * max(1, np.abs(whole).max())


@pytest.mark.slow
@pytest.mark.parametrize("length", [1, 2, 60, 300])
def test_the_bound_on_the_rounding_of_a_frame_is_none_too_large(length):
    """Damped turns in other units, in an order that repeats little; exact by fractions. Sizes alone grow by 3 % in a tick."""
    r = np.random.default_rng(length)
    kinds, angles, units = r.integers(0, 3, length), (0.02, 0.03, 0.04), np.array([[1.0, 0.1], [10.0, 1.0]])
    turns = [np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) for angle in angles]
    changes = [0.999 * turn * units - np.eye(2) for turn in turns]
    exact = [[Fraction(i == j) for j in range(2)] for i in range(2)]
    ticks = [[[Fraction(each[i, j]) + (i == j) for j in range(2)] for i in range(2)] for each in changes]
    for kind in kinds.tolist():
        exact = [[sum(row[k] * exact[k][j] for k in range(2)) for j in range(2)] for row in ticks[kind]]
    for bounded, most in ((partial(product_with_errors, per_loop=False), 100), (product_with_tight_errors, 20)):
        E, dE = bounded(kinds, changes, [np.abs(each) for each in changes])
        off = np.array([[float(abs(Fraction(E[i, j]) + (i == j) - exact[i][j])) for j in range(2)] for i in range(2)])
        assert np.all(off <= dE)
        assert np.all(dE <= most * length * np.finfo(float).eps * units)
    errors = ENTRY_ROUNDING * np.abs(changes)
    rows = [kinds.tolist(), kinds[: length // 2 + 1].tolist(), kinds[::-1].tolist()]
    together = products_of_rows(rows, (np.array(changes), errors), both)
    for at, row in enumerate(rows):
        E, dE = product_with_errors(np.array(row), changes, [np.abs(each) for each in changes], per_loop=True)
        assert (np.abs(together[0][at] - E) <= dE + together[1][at]).all()
        assert (together[1][at] <= 3 * dE).all()
        assert (together[1][at] >= dE / 3).all()
    off = np.array([[float(abs(Fraction(together[0][0, i, j]) + (i == j) - exact[i][j])) for j in range(2)] for i in range(2)])
    assert (off <= together[1][0]).all()


def test_a_state_that_a_tick_forgets_is_forgotten_exactly():
    """A sum of the two would leave the rounding of -1 - 0.3 + 0.3, which a later tick passes on."""
    random = np.random.default_rng(1)
    first, second = random.normal(size=(2, 6, 4, 4))
    first[:, :, 1], second[:, 2, :] = -np.eye(4)[1], -np.eye(4)[2]
    found = np.eye(4) + then(first, second)
    assert (found[:, :, 1] == 0).all()
    assert (found[:, 2, :] == 0).all()
    np.testing.assert_allclose(found, (np.eye(4) + second) @ (np.eye(4) + first), atol=1e-14)
    second[3, 2, 0] = 0.1  # which one of the matrices does not forget
    assert (np.eye(4) + then(first, second))[3, 2].any()
