"""How answers are scored."""

import numpy as np
import pytest

from wavesweep.bench.scoring import Answer, score

SPAN = (0.0, 100.0)
HOLE = [[[0.0, 10.0], [20.0, 40.0]]]


def answer(*intervals, column=0):
    low, high = np.array(intervals, float).reshape(-1, 2).T
    return Answer(np.full(low.size, column), low, high)


def test_the_truth_has_no_error():
    perfect = score(answer((0, 10), (20, 40)), HOLE, SPAN)
    assert (perfect.error_max, perfect.found, perfect.there, perfect.wrong) == (0, 2, 2, 0)


def test_ends_of_the_range_are_no_critical_stiffness():
    seen = score(answer((1, 100)), [[[0.0, 100.0]]], SPAN)
    assert (seen.found, seen.wrong) == (1, 0)
    assert np.isnan(seen.error_max)


def test_errors_are_relative():
    seen = score(answer((0, 11), (20, 42)), HOLE, SPAN)
    assert seen.error_max == pytest.approx(0.1)
    assert seen.error_median == pytest.approx(0.05)


def test_an_interval_over_a_hole_finds_none_of_its_sides():
    seen = score(answer((0, 40)), HOLE, SPAN)
    assert (seen.found, seen.there, seen.wrong) == (0, 2, 1)


def test_an_interval_that_is_missed_does_not_spoil_the_error_of_others():
    seen = score(answer((20, 40)), HOLE, SPAN)
    assert (seen.error_max, seen.found, seen.wrong) == (0, 1, 1)


def test_columns_are_kept_apart():
    seen = score(answer((0, 10), (20, 40), column=1), [*HOLE, *HOLE], SPAN)
    assert (seen.found, seen.there, seen.wrong) == (2, 4, 1)
