"""Responses at the extremes: what the stress found and was mended, and a sample of the rest."""

import numpy as np
import pytest
from stress import responses
from support.responses import loop_of

from wavesweep.engine._response.gain import gain_of

pytestmark = pytest.mark.slow


def test_modes_that_overflow_or_are_too_few_are_no_warning():
    """Defective frames that grow by tens of decades: NaN among the modes leads to a solve, not to a crash."""
    assert all(judged.excess <= 1 for judged in responses.judge(7, "wild"))


@pytest.mark.parametrize("seed", [0, 4, 7, 11])
def test_responses_of_usual_loops_hold_in_ball_arithmetic(seed):
    """Any delay, from 1 mHz to half the fast rate, multiples of the slow rate among them; all of them are known."""
    for judged in responses.judge(seed, "usual"):
        assert judged.excess <= 1, judged
        assert max(judged.bound) < 1e-6, judged
        assert max(judged.error) < 1e-8, judged


@pytest.mark.sample(2)
@pytest.mark.parametrize("family", responses.RESPONSES)
def test_no_response_is_further_off_than_its_bound(family):
    """Some loops are refused, and some responses are beyond the witness, but not most of them."""
    asked = sum(len(responses.question(seed, family)[1]) for seed in range(5))
    found = [judged for seed in range(5) for judged in responses.judge(seed, family) or []]
    assert len(found) >= 0.5 * asked
    for judged in found:
        assert judged.excess <= 1, judged


@pytest.mark.parametrize("seed", [100, 104, 107, 110, 114])
def test_resonances_and_drifts_take_no_digits(seed):
    """No wall, no damping, multiples of the slow rate and their neighbours: hardly an admittance is missing."""
    found = responses.judge(seed, "resonant")
    assert max(judged.excess for judged in found) <= 1
    known = [judged.bound[0] for judged in found if not np.isnan(judged.bound[0])]
    assert len(known) >= len(found) / 2  # of some a momentum stays for ever
    assert np.median(known) < 1e-8


@pytest.mark.parametrize("seed", [3, 12, 60])
def test_the_worst_case_gain_is_within_its_bound(seed):
    values, frequency = responses.question(seed, "resonant")
    values |= {"rates.ratio": 1 if values["controller.kind"] == "dc" else min(values["rates.ratio"], 40)}
    values |= {"environment.delay": min(values["environment.delay"], values["rates.ratio"])}
    for f, gain, bound in zip(frequency, *gain_of(loop_of(values))(frequency), strict=True):
        multiple = f * values["rates.ratio"] / values["rates.fast_hz"]
        if multiple != round(multiple):
            truth = responses.exact_gain(values, f)
            assert abs(gain / truth - 1) <= bound, (f, gain, truth)
