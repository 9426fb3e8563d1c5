"""Responses at the extremes: what the stress found and was mended, and a sample of the rest."""

import numpy as np
import pytest

pytest.importorskip("flint", reason="python-flint is the witness")
from stress import responses


@pytest.mark.parametrize(("family", "seed"), [("wild", 7), ("unstable_inside", 45), ("unstable_inside", 147)])
def test_modes_that_overflow_or_are_too_few_are_no_warning(family, seed):
    """Defective frames that grow by tens of decades: NaN among the modes leads to a solve, not to a crash."""
    assert responses.judge(seed, family) is not None


@pytest.mark.parametrize("seed", range(12))
def test_responses_of_usual_loops_hold_in_ball_arithmetic(seed):
    """Any delay, from 1 mHz to half the fast rate, multiples of the slow rate among them."""
    worst, _, frequency = responses.judge(seed, "usual")
    assert worst < 1e-8, frequency
    assert np.isfinite(worst)
