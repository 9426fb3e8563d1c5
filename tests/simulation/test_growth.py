import numpy as np
import pytest
from support.growth import disagreements, growth, growth_rate
from support.specs import random_values

EXPLICIT = {"environment.integration": "explicit", "lp1.cutoff_hz": 8.57}

# Ends of stable intervals along K_VE (N/m), from 40-digit arithmetic on the model's equations; True where growing
# stiffness makes the loop stable.
ENDS = [
    ("dc-slow", {}, 263.1371651658711, False),
    ("dc-slow", {"environment.delay": 20}, 82.5790189960284, False),
    ("dc-slow", {"B_VE": 0.0}, 157.8822990995227, False),
    ("dc-slow", {"ratio": 1, "velocity": "difference"}, 4963.026327346007, False),
    ("dc-lm", {"K_LM": 400.0}, 646.3989263891893, False),
    ("pmw", EXPLICIT, 799.7134000606709, False),
    ("pmw", EXPLICIT, 2523.335126265325, True),
    ("pmw", EXPLICIT, 4448.818804163079, False),
    ("pmw", {**EXPLICIT, "environment.delay": 20, "lp1.cutoff_hz": 8.856}, 632.2594742458579, False),
    ("pmw-lm", {"environment.integration": "explicit", "K_LM": 2000.0, "Kp": 20.0}, 1046.064782614818, False),
]


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "changes", "end", "gains"), ENDS)
def test_decay_turns_into_growth_at_a_stability_limit(values, kind, changes, end, gains):
    """A part in a hundred thousand to either side of the limit is enough to tell."""
    below = growth_rate(values(kind, K_VE=end * (1 - 1e-5), **changes)) < 1
    above = growth_rate(values(kind, K_VE=end * (1 + 1e-5), **changes)) < 1
    assert (below, above) == (not gains, gains)


# Spectral radii per frame, drift set aside, from the same arithmetic.
RADII = [
    ("dc-slow", {}, 1.1784894254453746),
    ("dc-slow", {"environment.delay": 20}, 1.5398463180625486),
    ("pmw", EXPLICIT, 0.9849221787557123),
    ("pmw", {"lp1.order": 6, "lp1.cutoff_hz": 3.0}, 0.9871066800216373),
    ("pmw-lm", {"Kp": 20.0}, 0.9454574876141936),
]


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize(("kind", "changes", "radius"), RADII)
def test_the_rate_is_the_spectral_radius(values, kind, changes, radius):
    found = growth(values(kind, **changes))
    assert found.per_frame == pytest.approx(radius, abs=1e-7)
    assert found.residual < 1e-9


def test_dc_grows_per_tick(values):
    """The ideal has no frame: 20 of its ticks are a frame of the others."""
    assert growth_rate(values("dc")) ** 20 == pytest.approx(0.7977853313905533, abs=1e-9)


def test_a_passive_loop_never_grows(values):
    """6th order at 3 Hz with a wall of 20 kN/m: in transfer-function form this one would show 1.06."""
    assert growth_rate(values("pmw", K_VE=20_000.0, **{"lp1.order": 6, "lp1.cutoff_hz": 3.0})) < 1


def test_the_seed_decides_nothing_but_the_start(values):
    first, second = (growth_rate(values("pmw-lm"), seed=seed) for seed in (0, 1))
    assert first == pytest.approx(second, rel=1e-9)


def test_a_loop_that_overflows_within_a_frame_grows_without_bound(values):
    """A tick of the local wall multiplies by thousands; 400 of them leave the range of doubles."""
    assert growth_rate(values("dc-lm", K_LM=1e9, ratio=400)) == np.inf


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(0, 200, 20))
def test_growth_and_decay_in_time_agree_with_every_reported_end(seed):
    """A thousandth to either side of each end along K_VE, for a sample of random specs; support/growth.py takes any number."""
    wrong, _ = disagreements(random_values(seed))
    assert wrong == []


@pytest.mark.slow
def test_the_sample_has_ends_to_look_at():
    assert sum(disagreements(random_values(seed))[1] for seed in range(0, 40, 20)) > 0
