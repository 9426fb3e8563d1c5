"""Ends that rounding of the loop can move: how far is told before they are certified."""

from dataclasses import replace

import numpy as np
import pytest
from support.intervals import NUMBER, cut_of, intervals_of
from support.specs import values_of

from wavesweep.engine._monodromy.unit_circle import on_circle
from wavesweep.engine._stability.boundary import end_errors
from wavesweep.engine._stability.stable import stable_intervals

# Two crossings that nearly merge in front of z = 1; the truth is from 512-bit ball arithmetic.
GRAZING = {
    "fast_hz": 5000.0, "ratio": 1, "mass": 1.609710866115498, "damping": 0.0, "velocity": "difference",
    "b": 0.5461774323578017, "Kp": 10.248050227974543, "lp1_cutoff_hz": 255.725222378373,
}  # fmt: skip
# A device that next to nothing damps: its velocity term cancels the 1 of the equation at z = -1, where x is not seen.
CANCELLING = {"mass": 0.5541900779754981, "damping": 1.6096963227382755e-08, "stiffness": 918.8466255643115}


@pytest.mark.parametrize(
    ("kind", "changes", "fixed", "high"),
    [("pmw", GRAZING, 198.13918713960777, 1e7), ("dc", CANCELLING, 1108.2270106112346, 2.2e6)],
)
def test_an_end_that_rounding_moves_too_far_is_not_certified(kind, changes, fixed, high):
    """Both are off by more than 1e-9, the second by 3e-5, at residuals of 1e-13 and 0."""
    assert not intervals_of(values_of(kind, **changes), span=(0, high), fixed=fixed).certified.any()


@pytest.mark.parametrize(("kind", "along"), [("pmw", "K_VE"), ("dc-lm", "B_VE")])
def test_the_bound_is_that_of_perturbed_entries(kind, along):
    """The end of a loop whose entries move by 1e-7 of themselves, at random: within the bound, and not far below it."""
    values = values_of(kind, integration="explicit", lp1_cutoff_hz=8.57)
    cut, r, found = cut_of(values), np.random.default_rng(0), []
    cut = replace(cut, **{f"d{part}": 1e-7 * np.abs(getattr(cut, part)) for part in "EBCD"})
    fixed = np.array([1.0 if along == "K_VE" else 200.0])

    def end(loop):
        found = stable_intervals(loop, NUMBER[along], (0.0, 2e3), fixed[None])
        return found.high[0], found.high_omega[:1] * loop.period

    value, theta = end(cut)
    bound = end_errors(cut, NUMBER[along], fixed, value, on_circle(theta), np.zeros(1, bool))[1]
    for _ in range(20):
        moved = {part: getattr(cut, part) * (1 + 1e-7 * r.choice([-1, 1], getattr(cut, part).shape)) for part in "EBCD"}
        found.append(end(replace(cut, **moved))[0])
    assert 0.05 * bound < np.abs(np.array(found) - value).max() <= bound * (1 + 1e-6)  # it is of first order in 1e-7


def test_states_of_very_different_size_cost_no_digits():
    """A heavy device, a feeble wave line and a short frame: states span ten decades. The truth is from ball arithmetic."""
    values = values_of(
        "pmw", b=0.01380555495004686, Kp=10.993939173860973, fast_hz=10005.93260726145, ratio=2, integration="trapezoidal",
        mass=60.39947498385882, damping=0.2181860780442409, operator__mass=99.62369697976477,
        operator__damping=0.793333696708733, stiffness=0.11597251492688877, lp1_order=3, lp1_cutoff_hz=1177.7019556395662,
    )  # fmt: skip
    found = intervals_of(values, "B_VE", (0.0, 500.0), 81.27937391758607)
    assert found.low[0] == pytest.approx(0.0802738091099253, rel=1e-11)
