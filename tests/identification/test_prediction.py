"""Fits by the errors of predictions, of simulated logs on which more acts than they say, and their filter."""

from dataclasses import replace

import numpy as np
import pytest
from identify_coverage import LOGARITHMS, coupled, marched, read
from scipy.linalg import solve_discrete_are
from simulated_logs import of_curves, of_one_mass, of_two_masses

from wavesweep.engine.errors import UsageError
from wavesweep.identification.explained import identified
from wavesweep.identification.model import Model
from wavesweep.identification.prediction.fitting import predicted
from wavesweep.identification.prediction.innovations import errors_of, projected, theta_of
from wavesweep.identification.prediction.scaled_log import scaled
from wavesweep.identification.prediction.search import Search, least_of
from wavesweep.identification.prediction.smoother import path_within_ticks
from wavesweep.identification.predictor import Predictor, tick_of

SHAPE = {"rate": 5.0, "square": 3e4, "share": 0.7, "load_rate": 3.0, "coupling_rate": 8.0}
WHITE, DRIFT = 1e-3, 1e-6


@pytest.mark.parametrize("load", [False, True])
@pytest.mark.parametrize("measured", ["position", "velocity"])
def test_innovations_are_those_of_a_kalman_filter_that_runs_row_by_row(load, measured):
    """Whose gain is that of scipy's Riccati solver, and whose state at the first row that counts is fitted."""
    source = np.random.default_rng(0)
    reading, force = source.standard_normal((2, 200))
    tick = tick_of(Model(load=load, measured=measured), SHAPE, 1e-3)
    begun = tick.begun(0.3)
    noise = WHITE * np.outer(tick.held, tick.held)
    noise[-1, -1] += DRIFT
    covariance = solve_discrete_are(tick.A.T, tick.C[:, None], noise, np.eye(1))
    gain = tick.A @ covariance @ tick.C / (tick.C @ covariance @ tick.C + 1)
    state = np.zeros(len(gain))
    errors = []
    for row in range(200):
        errors.append(reading[row] - tick.C @ state)
        state = tick.A @ state + gain * errors[-1] + begun * force[row]
    M = tick.A - np.outer(gain, tick.C)
    free = np.stack([tick.C @ np.linalg.matrix_power(M, row) for row in range(197)])
    left = np.array(errors[3:])
    expected = left - free @ np.linalg.lstsq(free, left, rcond=1e-12)[0]
    predictor = Predictor(tick, WHITE, DRIFT, 197)
    found = predictor.innovations(reading, 3) - predictor.effect([(begun, force)], 3)
    assert found == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_a_spring_of_no_stiffness_leaves_the_position_out_of_a_log_of_speeds():
    """Nothing that is read depends on it then: the innovations are those without a spring."""
    reading = np.random.default_rng(0).standard_normal(60)
    loose = SHAPE | {"square": 0.0}
    ticks = [tick_of(Model(spring=spring, measured="velocity"), loose, 1e-3) for spring in (True, False)]
    with_spring, without = (Predictor(tick, WHITE, DRIFT, 57).innovations(reading, 3) for tick in ticks)
    assert with_spring == pytest.approx(without, abs=1e-12)


def covered(log):
    """Which intervals contain the truth: of mass, damping, friction if there is any, delay."""
    rubs = log.truth["friction"] > 0
    found = predicted(Model(friction=rubs), log.force, log.reading, log.period, log.step)
    truth = log.truth | {"log_mass": np.log(log.truth["mass"])}
    names = [name for name in found.model.names if name in truth]
    return [abs(found.numbers.get(name, found.theta[0]) - truth[name]) for name in names] <= found.half


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "logs"), [("drift, Coulomb", 3), ("hand, Coulomb", 6)])
def test_intervals_contain_the_truth_though_more_acts_than_the_log_says(kind, logs):
    """In nearly all logs; the script benchmarks/identify_coverage.py counts more."""
    inside = [covered(log) for log in of_one_mass(kind, logs, 3, 2.0)]
    assert np.mean(inside, axis=0).min() >= 0.6


def test_friction_within_a_tick_is_that_of_a_fine_march():
    """Of ticks in which the device turns round once or twice and the force changes: the means of sgn v and (1/2 - t) sgn v.

    And those of tanh(v/0.1). The march has 1000 steps a tick. On straight lines from tick to tick it turns round elsewhere.
    Where friction holds the device for a part of a tick, the march turns round at every step.
    """
    ticks, steps, part, friction = 150, 1000, 0.375, 0.25
    force = np.random.default_rng(20).standard_normal(ticks)
    begun = (np.arange(steps) + 0.5) / steps
    v = 0.3
    speeds, sides, soft, turns = np.empty(ticks), np.empty((ticks, 2)), np.empty((ticks, 2)), np.zeros(ticks, int)
    for tick in range(ticks):
        speeds[tick] = v
        passed = np.empty(steps)
        for step, time in enumerate(begun):
            passed[step] = v
            v += (force[tick - (time < part)] - friction * np.sign(v)) / steps
        way = np.sign(passed)
        sides[tick] = way.mean(), ((0.5 - begun) * way).mean()
        soft[tick] = np.tanh(passed / 0.1).mean(), ((0.5 - begun) * np.tanh(passed / 0.1)).mean()
        turns[tick] = np.sum(way[1:] != way[:-1])
    log = scaled(Model(friction=True, measured="velocity"), force, speeds, 1e-3, 0.0)
    found = {"rate": 0.0, "delay": part, "turning": 1e-6}
    path = path_within_ticks(log, found, np.array([log.pushed, friction]), speeds)
    once = np.flatnonzero(turns[:-1] == 1)
    assert once.size > 8
    known = replace(log, speeds=speeds, path=path).side(1e-6)
    assert known[:, once] == pytest.approx(sides[once].T, abs=4e-3)
    twice = np.flatnonzero(turns[:-1] == 2)
    assert twice.size > 3
    assert known[:, twice] == pytest.approx(sides[twice].T, abs=2 * 4e-3)
    slowly = replace(log, speeds=speeds, path=path).side(0.1)
    assert slowly[:, once] == pytest.approx(soft[once].T, abs=4e-3)
    rests = np.isfinite(path.held).any(axis=0)
    assert rests.sum() >= 3
    assert (turns[rests] > 20).all()
    assert known[:, rests] == pytest.approx(sides[rests].T, abs=4e-3)
    assert np.abs(replace(log, speeds=speeds).side(1e-6)[0, once] - sides[once, 0]).max() > 0.2
    _, errors, effects = errors_of(
        replace(log, speeds=speeds, path=path), found | {"square": 0.0, "white": WHITE, "drift": DRIFT}, 4
    )
    force_gain, friction_gain = projected(errors, effects)[0]
    assert friction_gain / force_gain * log.pushed == pytest.approx(friction, rel=0.02)


@pytest.mark.parametrize("measured", ["position", "velocity", "acceleration"])
def test_the_mass_of_a_gain_is_in_kg(measured):
    """A force on a mass of 0.4 kg alone, held over ticks of 2 ms."""
    mass, period = 0.4, 2e-3
    force = np.random.default_rng(3).standard_normal(300)
    v = np.concatenate([[0.0], np.cumsum(force[:-1])]) * period / mass
    x = np.concatenate([[0.0], np.cumsum(v[:-1] * period + force[:-1] * period**2 / (2 * mass))])
    reading = {"position": x, "velocity": v, "acceleration": np.diff(v, prepend=0.0) / period}[measured]
    log = scaled(Model(measured=measured), force, reading, period, 0.0)
    forces = (measured != "acceleration") * np.array([WHITE, DRIFT])  # which an accelerometer does not tell from its noise
    found = {"rate": 0.0, "square": 0.0, "delay": 0.0, "white": forces[0], "drift": forces[1]}
    _, errors, effects = errors_of(log, found, 4)
    assert np.exp(theta_of(log, found, projected(errors, effects)[0])[0]) == pytest.approx(mass, rel=1e-6)


def test_a_delay_is_found_across_a_whole_number_of_ticks():
    """At which the errors have a kink: a search from there stays."""
    source = np.random.default_rng(3)
    force = source.standard_normal(210)
    speeds = read(marched(0.1, 1.0, force, 1.875, 0.0, 0.1, "velocity"), 1e-3, source)[10:]
    log = scaled(Model(friction=True, measured="velocity"), force[10:], speeds, 1e-3, 1e-3)
    search = Search(log, {"rate": 5.0, "square": 0.0, "delay": 2.0, "white": 1e2, "drift": 1e-9, "turning": log.slowest})
    found = search.found(least_of(log, search, search.begun, 8, 20))
    assert found["delay"] == pytest.approx(1.875, abs=0.01)


def test_a_point_at_which_effects_are_no_numbers_is_passed_over(monkeypatch):
    """Where a filter overflows, also if the errors of the readings do not."""
    source = np.random.default_rng(3)
    force = source.standard_normal(100)
    speeds = read(marched(0.1, 1.0, force, measured="velocity"), 1e-3, source)
    log = scaled(Model(delay=0.0, measured="velocity"), force, speeds, 1e-3, 1e-3)
    search = Search(log, {"rate": 5.0, "square": 0.0, "delay": 0.0, "white": 1e2, "drift": 1e-9})
    points = []

    def overflown(*point):
        points.append(point)
        predictor, errors, effects = errors_of(*point)
        return predictor, errors, effects if len(points) != 2 else np.full_like(effects, np.nan)

    monkeypatch.setattr("wavesweep.identification.prediction.search.errors_of", overflown)
    assert np.isfinite(least_of(log, search, search.begun, 8, 3)).all()
    assert len(points) > 2


@pytest.mark.slow
def test_a_drag_is_not_friction_below_zero():
    (log,) = of_curves("drag", 1, 0, 0.3)
    with pytest.raises(UsageError, match=r"a friction of at least 0.*leave --friction out"):
        identified(Model(friction=True, measured="velocity"), log.force, log.reading, log.period, log.step)


@pytest.mark.slow
@pytest.mark.parametrize(("hand", "seconds"), [(0.0, 0.5), (0.1, 2.0)])
def test_two_masses_are_found_from_noise_with_a_drift_too(hand, seconds):
    """All of mass, load and coupling, and nearly all of the others."""
    (log,) = of_two_masses(hand, 1, 0, seconds)
    fit, _ = identified(Model(load=True), log.force, log.reading, log.period, log.step)
    truth = log.truth | {name: np.log(log.truth[size]) for size, name in LOGARITHMS.items()}
    inside = {
        name: abs(value - truth[name]) <= half
        for name, value, half in zip(fit.model.names, fit.theta, fit.half, strict=True)
        if name in truth
    }
    assert all(inside[name] for name in LOGARITHMS.values()), inside
    assert np.mean(list(inside.values())) >= 0.8


@pytest.mark.slow
def test_two_masses_are_found_from_steps_that_hardly_excite_their_resonance():
    """At 48 Hz, where steps of 20 ms have next to nothing: a rate far from that of the damping would hide it."""
    source = np.random.default_rng(0)
    force = 3.5 * np.sign(source.standard_normal(30)).repeat(20)
    speeds = read(coupled(0.132, 2.75, 0.044, 0.0, 2980.0, 0.6, force, 2.625, 0.0, "velocity"), 1e-4, source)
    found = predicted(Model(load=True, measured="velocity"), force, speeds, 1e-3, 1e-4)
    truth = [np.log(0.132), 2.75, np.log(0.044), 0.0, np.log(2980.0), 0.6, 2.625]
    assert (abs(found.theta - truth) <= 1.5 * found.half).all()
    assert found.half[0] < 1e-3


@pytest.mark.slow
def test_a_drifting_force_is_said_and_not_called_friction():
    log = of_one_mass("drift", 2, 1, 2.0)[0]
    fit, verdict = identified(Model(), log.force, log.reading, log.period, log.step)
    assert (verdict.explained, verdict.missing) == (False, "force")
    assert fit.walked == pytest.approx(0.1 * np.abs(log.force).max(), rel=0.3)


@pytest.mark.slow
def test_friction_that_does_not_fall_is_no_curve_and_a_device_does_not_rest_under_a_force_above_it(caplog):
    """While it turns its encoder stands still for two ticks. What the fit is at is said on the way, for lines of progress."""
    caplog.set_level("INFO", "wavesweep.proof")
    source = np.random.default_rng(34)
    force = 2 * np.sign(source.standard_normal(25)).repeat(20)
    position = read(marched(0.1, 0.5, force, 0.3, 0.0, 0.24), 8e-5, source)
    model = Model(friction=True)
    assert np.sum(scaled(model, force, position, 1e-3, 8e-5).moving == 0) == 2
    found = predicted(model, force, position, 1e-3, 8e-5)
    assert found.static is None
    assert found.place.log.moving.all()
    assert (abs(found.theta - [np.log(0.1), 0.5, 0.24, 0.3]) <= found.half).all()
    assert found.half[1] < 0.01
    said = [record.getMessage() for record in caplog.records]
    assert said[0].startswith("a first look at 1 of ")
    assert any("round 2 of at most 6" in line for line in said)
