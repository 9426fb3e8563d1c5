"""Faults that the stress found along other numbers than the wall's."""

import numpy as np
import pytest
from stress.numbers import judge, question, unstable
from support.specs import nested, values_of

import wavesweep

pytestmark = pytest.mark.slow


def test_cutoffs_may_be_searched_up_to_just_below_half_the_rate():
    """What is sampled beyond the span to find its last crossings stays below half the rate, where filters end."""
    loop = wavesweep.compile(nested(values_of("pmw-lm", integration="explicit", lp1_order=1)))
    found = loop.stable_intervals("filters.lp1.cutoff_hz", span=(1.0, 499.9))
    assert np.isfinite(found["low"]).all()


def test_samples_that_overflow_are_no_warning():
    """Beside some that do not, beyond all sizes in the error bound, and a damping just below zero at a milligram."""
    (verdict,) = judge(1015)
    assert verdict.kind == "right" or not verdict.certified


def test_a_crossing_at_1e_10_of_the_range_is_told_from_its_low_end():
    """It was taken for rounding of the end at a gain of zero. The witness counts an unstable eigenvalue up to there."""
    values, path, _ = question(70093)
    (verdict,) = judge(70093)
    assert (verdict.kind, verdict.certified, verdict.rows) == ("right", True, 1)
    low = verdict.answered[0][0]
    assert [unstable(values | {path: p}) for p in (0.0, low * (1 - 1e-6), low * (1 + 1e-6))] == [1, 1, 0]
