"""Ways through the algebraic loop that cancel exactly leave nothing."""

import numpy as np
import pytest
from support.intervals import intervals_of, pairs
from support.specs import INTEGRATIONS, nested, random_values, values_of

from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.haptics.controller_page import wall_cut
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import loops_of


@pytest.mark.parametrize("integration", INTEGRATIONS)
def test_a_line_without_filter_and_delay_moves_the_avatar_by_the_hand_alone(integration):
    """The wall's force reaches the avatar by +1/b and -1/b: its velocity is the hand's."""
    b = np.array([1e-6, 2.273804480282737e-06, 0.3, 1e6])
    cut = wall_cut(values_of("pmw", lp1_order=0, integration=integration) | {"controller.b": b})
    assert not np.any(cut.D)


def test_an_end_keeps_its_digits_at_a_tiny_wave_impedance():
    """Truth from 512-bit ball arithmetic; eps/b left behind cost seven digits."""
    values = values_of(
        "pmw", ratio=5, mass=0.09899054365901827, damping=0.0, velocity="difference", b=2.273804480282737e-06, lp1_order=0
    )
    found = intervals_of(values, fixed=6.741149374749543)
    np.testing.assert_allclose(pairs(found), [(0.0, 9968.451663783808)], rtol=1e-11)


def test_bounds_hold_what_rounding_leaves_of_a_shift_that_depends_on_numbers():
    """A shift that is found in the frame is off by more than the frame's entries where these differ by orders of magnitude."""
    found, eps = 0, np.finfo(float).eps
    for seed in range(12):
        spec = load(nested(random_values(seed, "pmw-lm") | {"controller.Kp": 0.0}))
        loops, b = loops_of(spec, spec.values), spec.values["controller.b"]
        drift = loops.changed({"controller.b": np.array([0.5, 2.0]) * b}).drift()
        near = loops.changed({"controller.b": b * (1 + eps * np.arange(32))})
        E, dE = drift.frames_with_errors(Ticks.of(near.drawn(), alone=True, terms=True))
        found += bool(drift.varying)
        assert (np.ptp(E, axis=0) <= 2 * dE.max(0) + 64 * eps * np.abs(E).max(0)).all()
    assert found
