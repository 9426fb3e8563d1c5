import math

import numpy as np
import pytest
from support.exact import SLOW, march
from support.specs import KINDS, values_of

from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.simulation.hardware import Effects
from wavesweep.simulation.march import FARTHEST_POSITION, STRONGEST, simulate


@pytest.fixture
def push():
    """A hand that trembles against the wall and pulls away from it: 1500 ticks."""
    k = np.arange(1500)
    return np.sin(k / 90.0) + 0.3 * np.random.default_rng(8).standard_normal(1500)


def agree(plain, experiment, every):
    """Whether a march of the laws written out has the signals of a simulation, to rounding."""
    assert plain.keys() <= experiment.signals.keys()
    assert ("u_m" in plain, "v_2" in plain) == ("u_m" in experiment.signals, "v_2" in experiment.signals)
    for name, own in plain.items():
        found = experiment.signals[name][:: every if name in SLOW else 1]
        np.testing.assert_allclose(found, own, rtol=0, atol=1e-9 * np.abs(own).max(), err_msg=name)


@pytest.mark.sample(4)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("velocity", ["exact", "difference"])
def test_with_everything_off_a_page_is_the_law_of_its_controller(values, push, kind, velocity):
    loop = values(kind, K_VE=150.0, Kp=10.0, velocity=velocity, **{"environment.delay": 3})
    experiment = simulate(loop, push)
    agree(march(loop, push), experiment, 1 if kind == "dc" else 20)
    assert experiment.stopped == ""
    assert len(experiment.signals["x"]) == len(push)


@pytest.mark.parametrize(("K_VE", "answer"), [(5e4, "no single value"), (1.0, "")])
def test_a_contact_without_one_answer_is_refused(push, K_VE, answer):
    """One plus the part of a wave that comes back is -0.42 pressed and 1.57 off the wall: at some waves neither holds, at
    some both."""
    loop = values_of("pmw-lm", b=4.0, K_LM=1e4, K_VE=K_VE, B_VE=0.0, lp1_order=0, lp2_order=0, local_model__delay=0)
    if answer:
        with pytest.raises(IllPosedLoopError, match=answer):
            simulate(loop, push, Effects(wall=0.0))
        loop["local_model.delay"] = 1
    assert len(simulate(loop, push, Effects(wall=0.0)).signals["x"]) > 1


@pytest.mark.parametrize("kind", ["dc", "dc-slow", "dc-lm"])
def test_a_direct_wall_is_felt_inside_only(values, push, kind):
    seen = simulate(values(kind, K_VE=150.0), push, Effects(wall=0.001)).signals
    sampled = slice(None, None, 1 if kind == "dc" else 20)
    inside = seen["x"][sampled] > 0.001
    assert 0.05 < inside.mean() < 0.95
    assert np.array_equal(seen["F_s"][sampled] != 0.0, inside)
    assert np.all(seen["f_m"][~seen["touching"]] == 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("local_delay", "delay", "integration"),
    [
        (0, 0, "explicit"),
        (0, 1, "explicit"),
        (0, 20, "implicit"),
        (1, 0, "implicit"),
        (1, 1, "trapezoidal"),
        (1, 20, "trapezoidal"),
    ],
)
def test_waves_and_contact_agree_within_every_tick(values, push, integration, delay, local_delay):
    """What goes round within a tick is solved: the waves that came back are those that the outgoing wave made."""
    changes = {"environment.integration": integration, "environment.delay": delay, "local_model.delay": local_delay}
    seen = simulate(values("pmw-lm", K_VE=150.0, Kp=10.0, **changes), push, Effects(wall=0.001)).signals
    held = {name: np.concatenate([np.zeros(delay), seen[name]])[: len(push)] for name in ("v_s", "x_s")}
    returned = held["v_s"] + seen["v_2"] + 10.0 * (held["x_s"] - seen["x"])
    np.testing.assert_allclose(seen["v_m"], returned, atol=1e-12)
    np.testing.assert_allclose(seen["u_m"], math.sqrt(50.0) * seen["v_hat"] - seen["v_m"], atol=1e-12)
    off = seen["F_s"][::20] == 0.0
    assert 0.05 < off.mean() < 0.95
    if integration != "explicit":  # whose spring is at the position of the update before
        assert np.all(seen["x_s"][::20][off] <= 0.001)
        assert np.all(seen["x_s"][::20][~off] >= 0.001 - 1e-12)


def test_an_encoder_sees_the_nearest_step(values, push):
    seen = simulate(values("pmw", velocity="difference"), push, Effects(resolution=5e-5)).signals
    steps = seen["x_hat"] / 5e-5
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.abs(seen["x_hat"] - seen["x"]).max() <= 2.5e-5 * (1 + 1e-9)
    np.testing.assert_allclose(seen["v_hat"][1:], np.diff(seen["x_hat"]) * 1000.0, atol=1e-12)


def test_motors_have_a_limit(values, push):
    seen = simulate(values("pmw"), 3 * push, Effects(max_force=1.5)).signals
    assert np.abs(seen["f_m"]).max() > 1.5
    assert np.array_equal(seen["f_device"], np.clip(seen["f_m"], -1.5, 1.5))


def test_the_device_moves_for_the_real_length_of_a_jittering_tick(values):
    """In free motion under a constant force the velocity tells the time that has passed."""
    free = values("dc", K_VE=0.0, B_VE=0.0)
    seen = simulate(free, np.ones(500), Effects(jitter=0.3, seed=2)).signals
    lengths = np.diff(seen["time_s"])
    assert 0.7e-3 <= lengths.min() < 0.75e-3
    assert 1.25e-3 < lengths.max() <= 1.3e-3
    np.testing.assert_allclose(seen["v"], -np.expm1(-15.0 * seen["time_s"]) / 1.5, rtol=1e-12)


def test_a_late_result_is_held_from_the_tick_when_it_comes(values):
    late = simulate(values("dc-slow"), np.zeros(400), Effects(late=15, seed=1), x=1e-3)
    f_m, F_s = late.signals["f_m"], late.signals["F_s"][::20]
    assert len(set(late.late.tolist())) > 5
    for frame, (ticks, force) in enumerate(zip(late.late, F_s, strict=True)):
        assert f_m[20 * frame + ticks] == force
        assert ticks == 0 or f_m[20 * frame + ticks - 1] != force


def test_of_two_results_the_newer_one_stays(values):
    """More than a frame late a result may be overtaken, and is then not held any more."""
    seen = simulate(values("dc-slow"), np.zeros(4000), Effects(late=70, seed=1), x=1e-3)
    frames = {force: frame for frame, force in enumerate(seen.signals["F_s"][::20].tolist())}
    held = [frames[force] for force in seen.signals["f_m"].tolist() if force in frames]
    assert held == sorted(held)
    assert len(set(held)) < len(frames)


def test_a_lost_result_leaves_the_old_one(values):
    some = simulate(values("dc-slow"), np.zeros(400), Effects(dropped=0.5, seed=3), x=1e-3)
    assert {-1, 0} == set(some.late.tolist())
    for frame in np.flatnonzero(some.late == -1):
        assert frame == 0 or some.signals["f_m"][20 * frame] == some.signals["f_m"][20 * frame - 1]
    every = simulate(values("pmw"), np.ones(400), Effects(dropped=1.0))
    assert np.all(every.signals["v_m"] == 0.0)


def test_a_seed_gives_one_experiment_and_features_keep_their_numbers(values, push):
    loop = values("pmw")
    both, again = (simulate(loop, push, Effects(jitter=0.2, late=9, seed=4)) for _ in range(2))
    assert np.array_equal(both.signals["x"], again.signals["x"])
    assert np.array_equal(both.late, simulate(loop, push, Effects(late=9, seed=4)).late)
    assert not np.array_equal(both.late, simulate(loop, push, Effects(late=9, seed=0)).late)


def test_friction_holds_the_device(values, push):
    """Below Coulomb's force nothing moves at all; above it the device rests in between, and does not chatter."""
    loop = values("dc", K_VE=150.0)
    assert np.all(simulate(loop, 0.1 * push / np.abs(push).max(), Effects(friction=0.11)).signals["x"] == 0.0)
    v = simulate(loop, push, Effects(friction=0.3)).signals["v"]
    assert 0.05 < (v == 0.0).mean() < 0.95


@pytest.mark.parametrize("kind", KINDS)
def test_energy_is_accounted_for(values, push, kind):
    """Without damping what the hand gave and the motors did not take is the device's motion."""
    experiment = simulate(values(kind, K_VE=150.0, **{"device.damping": 0.0}), push, Effects(max_force=2.0))
    left = experiment.energy.hand - experiment.energy.device
    np.testing.assert_allclose(left[:-1], 0.05 * experiment.signals["v"][1:] ** 2, atol=1e-10 * left.max())


@pytest.mark.sample(5)
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("effects", [{}, {"resolution": 1e-5, "friction": 0.1}, {"max_force": 3.0}])
def test_an_unstable_loop_stops_before_its_numbers_mean_nothing(values, kind, effects):
    """Not every kind diverges with every effect; those that do stop at the limits."""
    experiment = simulate(values(kind, K_VE=1e8), np.ones(4000), Effects(**effects))
    signals, rows = experiment.signals, len(experiment.signals["x"])
    assert {len(column) for column in signals.values()} == {rows}
    assert np.abs(signals["x"]).max() <= FARTHEST_POSITION
    assert max(np.abs(signals[name]).max() for name in ("f_h", "f_m", "f_device")) <= STRONGEST
    assert bool(experiment.stopped) == (rows < 4000)
    assert len(experiment.energy.hand) == rows
    assert np.abs(experiment.energy.device).max() < FARTHEST_POSITION * STRONGEST


def test_a_stopped_run_is_the_beginning_of_a_longer_one(values):
    """With forces a thousandth as large the linear loop goes on a little longer, through the same numbers."""
    small, large = (simulate(values("dc", K_VE=1e6), np.full(2000, force)) for force in (1e-3, 1.0))
    rows = len(large.signals["x"])
    assert "force exceeds 1e+06 N" in large.stopped
    assert 10 < rows < len(small.signals["x"]) < 2000
    np.testing.assert_allclose(1e3 * small.signals["x"][:rows], large.signals["x"], rtol=1e-9)


@pytest.mark.parametrize(
    ("option", "text"),
    [
        ({"jitter": 1.0}, "option jitter: expected a number <= 0.9, found 1.0"),
        ({"dropped": 1.5}, "option dropped: expected a number <= 1, found 1.5"),
        ({"late": 1.5}, "option late: expected a whole number >= 0, found 1.5"),
        ({"friction": -0.1}, "option friction: expected a number >= 0, found -0.1"),
        ({"wall": math.nan}, "option wall: expected a finite number, found nan"),
    ],
)
def test_an_option_without_meaning_is_refused(option, text):
    with pytest.raises(UsageError, match=text):
        Effects(**option)
