"""Logs of devices that no line explains: the truth is in the intervals, or there are none."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_logs import of_curves

import wavesweep
from wavesweep.identification.curves import CURVES, means_over_ticks, with_curve
from wavesweep.identification.device_spec import spec_text
from wavesweep.identification.explained import identified
from wavesweep.identification.model import Model
from wavesweep.identification.prediction.fitting import predicted
from wavesweep.identification.prediction.scaled_log import scaled
from wavesweep.identification.predictor import tick_of
from wavesweep.identification.table import identify


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "measured", "at", "missing"),
    [
        ("saturating", "velocity", 0, "saturating mass"),
        ("sided damping", "position", 0, "sided damping"),
        ("hardening", "velocity", 3, "hardening"),
    ],
)
def test_a_curve_of_the_motion_is_named_and_the_numbers_beside_it_are_those_of_the_device(kind, measured, at, missing):
    log = of_curves(kind, at + 1, 0, 0.4, measured)[at]
    model = Model(measured=measured)
    fit, verdict = identified(model, log.force, log.reading - log.reading[0], log.period, log.step)
    assert (verdict.explained, verdict.missing, verdict.withheld) == (False, missing, False)
    assert verdict.share > 0.95
    truth = log.truth | {"log_mass": np.log(log.truth["mass"])}
    for name, value, half in zip(fit.model.names, fit.theta, fit.half, strict=True):
        assert abs(value - truth[name]) <= 1.2 * half, name


@pytest.mark.slow
def test_noise_tells_the_delay_beside_friction_that_depends_on_direction():
    """Where the device moves from tick to tick on straight lines, the delay is 0.009 of a tick too small here."""
    log = of_curves("sided friction", 8, 0, 1.0)[7]
    found = predicted(Model(measured="velocity"), log.force, log.reading, log.period, log.step)
    fit = with_curve("sided friction", found.place)
    delay = fit.theta[found.model.names.index("delay")]
    assert delay == pytest.approx(log.truth["delay"], abs=0.002)
    assert fit.theta[0] == pytest.approx(np.log(log.truth["mass"]), abs=0.002)


@pytest.mark.slow
def test_friction_that_depends_on_direction_gives_no_intervals_to_a_line():
    log = of_curves("sided friction", 1, 0, 0.4, "position")[0]
    _, verdict = identified(Model(), log.force, log.reading - log.reading[0], log.period, log.step)
    assert (verdict.missing, verdict.withheld) == ("friction", True)
    assert verdict.lacking > 0.1 * log.force.std()


@pytest.mark.slow
def test_numbers_of_a_model_that_lacks_a_resonance_have_no_intervals(tmp_path):
    """The words, the table and the spec say so, and how large the force is that it lacks."""
    log = of_curves("resonance", 2, 0, 0.4)[1]
    rows = np.stack([log.period * np.arange(len(log.force)), log.force, log.reading], axis=1)
    np.savetxt(tmp_path / "arm.csv", rows, "%.12g", ",", header="time,force,velocity", comments="")
    facts = identify(str(tmp_path / "arm.csv"), resolution=log.step).facts
    assert (facts["missing"], facts["residual"]["withheld"]) == ("resonance", True)
    assert {each["low"] for each in facts["parameters"].values()} == {None}
    spec = tmp_path / "device.toml"
    spec.write_text(spec_text(facts))
    assert "# The model does NOT explain the log; no number has an interval." in spec.read_text()
    assert wavesweep.load(spec).for_all is None


def test_a_drag_moves_velocity_and_position_within_a_tick_as_a_fine_march_does():
    """By Runge and Kutta. With velocities on straight lines the difference is 6e-6, with a drag held over a tick 1e-4."""
    ticks, parts, part, rate, drag = 80, 64, 0.375, 20.0, 0.02
    force = 0.1 * np.random.default_rng(2).standard_normal(ticks)

    def slope(state, push):
        return np.array([state[1], push - rate / 1000 * state[1] - drag * state[1] * abs(state[1])])

    state = np.array([0.0, 0.8])
    states = np.empty((2, ticks))
    for tick in range(ticks):
        states[:, tick] = state
        for begun in range(parts):
            push = force[tick - (begun < part * parts)]
            one = slope(state, push)
            two = slope(state + one / (2 * parts), push)
            three = slope(state + two / (2 * parts), push)
            four = slope(state + three / parts, push)
            state = state + (one + 2 * two + 2 * three + four) / (6 * parts)
    place, speed = states
    model = Model()
    log = scaled(model, force, place, 1e-3, 0.0)
    found = {"rate": rate, "square": 0.0, "delay": part}
    gains = np.array([log.pushed, -drag * np.mean(speed**2)])
    (means,) = means_over_ticks(CURVES["drag"], replace(log, beside=(force,)), found, gains, speed, place)
    tick = tick_of(model, found, 1e-3)
    begun = tick.begun(part)
    pushed = np.outer(begun, force[1:]) + np.outer(tick.held - begun, force[:-1])
    pushed += gains[1] * (np.outer(tick.held, means[0]) + np.outer(tick.lever, means[1]))[:, 1:]
    after = tick.A[:2, :2] @ states[:, 1:-1] + pushed[:2, :-1]
    assert after == pytest.approx(states[:, 2:], rel=0, abs=8e-7)
