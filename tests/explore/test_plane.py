"""The boundary's explicit curve in the wall's plane, against eigenvalues, known numbers and the proved intervals."""

import numpy as np
import pytest

from wavesweep.engine._monodromy.cut import FIRST, SECOND
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.explore.plane import plane_curve, quick_columns, refined_curve
from wavesweep.haptics.controller_page import wall_cut
from wavesweep.program.spec import load

LOOPS = {
    "direct": {"controller": {"kind": "dc"}},
    "slow": {"controller": {"kind": "dc-slow"}, "environment": {"delay": 7}},
    "hole": {
        "controller": {"kind": "pmw", "b": 25.0},
        "environment": {"integration": "explicit"},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    },
    "bank": {"controller": {"kind": "pmw-lm", "Kp": 20.0}, "environment": {"integration": "explicit", "delay": 3}},
    "held": {
        "controller": {"kind": "pmw", "Kp": 5.0},
        "environment": {"integration": "explicit", "delay": 20},
        "operator": {"stiffness": 300.0, "mass": 0.2, "damping": 3.0},
    },
}


def cut_of(tables):
    return wall_cut(load(tables).values)


@pytest.mark.parametrize("name", LOOPS)
def test_a_wall_on_the_curve_has_an_eigenvalue_at_its_angle(name):
    cut, theta = cut_of(LOOPS[name]), np.linspace(0.01, 3.1, 200)
    walls = plane_curve(cut, theta)
    moderate = np.isfinite(walls).all(0) & (np.abs(walls[0]) < 1e5) & (np.abs(walls[1]) < 1e3)
    assert moderate.sum() > 50
    z = 1 + np.linalg.eigvals(cut.closed(*walls[:, moderate]))
    # A wall of a large number moves its eigenvalue by more than a rounding.
    assert np.abs(z - np.exp(1j * theta[moderate])[:, None]).min(-1).max() < 1e-8


@pytest.mark.parametrize("solved", [0, 1])
@pytest.mark.parametrize("name", LOOPS)
def test_the_quick_columns_are_the_proved_ones(name, solved):
    cut, window = cut_of(LOOPS[name]), ((0.0, 6000.0), (0.0, 6.0))
    fixed = np.linspace(*window[1 - solved], 30)[1:]
    quick = quick_columns(cut, refined_curve(cut, window), solved, fixed, window[solved], 6)
    proved = stable_intervals(cut.at(np.newaxis), (FIRST, SECOND)[solved], window[solved], fixed[None])
    assert proved.certified.all()
    expected = [[] for _ in fixed]
    for column, index, low, high in zip(proved.column, proved.index, proved.low, proved.high, strict=True):
        if index >= 0:
            expected[column].append((low, high))
    assert [len(each) for each in quick] == [len(each) for each in expected]
    ends = [np.array([end for column in each for pair in column for end in pair]) for each in (quick, expected)]
    assert ends[0].size
    assert np.abs(ends[0] - ends[1]).max() < 1e-6 * window[solved][1]


@pytest.mark.parametrize("name", LOOPS)
def test_the_curve_passes_through_the_proved_ends(name):
    """At the oscillation of an end the curve gives its wall: found on another way, by a polynomial and a polish."""
    cut, fixed = cut_of(LOOPS[name]), np.linspace(0.2, 6.0, 25)
    proved = stable_intervals(cut.at(np.newaxis), FIRST, (0.0, 6000.0), fixed[None])
    column, end, omega = (
        np.concatenate(pair)
        for pair in ((proved.column, proved.column), (proved.low, proved.high), (proved.low_omega, proved.high_omega))
    )
    theta = omega * float(cut.period)
    inner = (theta > 1e-3) & (theta < np.pi - 1e-3)
    K, B = plane_curve(cut, theta[inner])
    assert np.abs(K - end[inner]).max(initial=0) < 1e-9 * 6000
    assert np.abs(B - fixed[column[inner]]).max(initial=0) < 1e-9 * 6
    assert inner.any()
