"""Parts of a fit against closed forms: noise, intervals, windows, rounds of a smoother, and what is said to be missing."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identify_coverage import RATE, marched, read, two_masses
from scipy.stats import t as student

from wavesweep.identification import explained
from wavesweep.identification.curves import forceless, with_curve
from wavesweep.identification.explained import Effect, judged
from wavesweep.identification.figure import _spectrum
from wavesweep.identification.fit import LogRows, _inliers, by_prediction, fitted
from wavesweep.identification.model import Model
from wavesweep.identification.model import two_masses as two_masses_of_model
from wavesweep.identification.prediction.innovations import errors_of, projected, theta_of
from wavesweep.identification.prediction.intervals import _half_widths, _of_large, _static, _step, estimated_at
from wavesweep.identification.prediction.scaled_log import scaled, spikes
from wavesweep.identification.prediction.search import Place, Search, least_of
from wavesweep.identification.prediction.smoother import Rounds, force_beside, smoothed, with_falling_friction

CHIRP = np.sin(0.0015 * np.arange(220) ** 1.8)


def test_an_outlier_is_alone_and_far_from_neighbours_that_are_near():
    reading = np.sin(0.1 * np.arange(400)) + 0.5 * np.abs(np.arange(400) - 150) / 400
    wild = reading.copy()
    wild[[40, 200]] += 3.0, -2.0
    wild[300:302] += 3.0, 3.0  # two of them are a motion
    assert np.flatnonzero(spikes(wild, 0.0)).tolist() == [40, 200]
    assert not spikes(wild, 1.0)[200]  # two steps of an encoder
    wild[50:350:20] += 5.0  # more than 2 % of the rows are none
    assert not spikes(wild, 0.0).any()


def test_rounding_of_a_ramp_is_uniform_and_its_neighbours_are_as_alike_as_those_of_a_saw():
    """Whose errors a share s of a step apart have the correlation 1 - 6 s + 6 s^2."""
    rows = SimpleNamespace(skip=3, resolution=2e-5)
    fit = SimpleNamespace(rows=rows, readings=2e-6 * np.arange(4003))
    assert explained._of_encoder(fit) == pytest.approx((2e-5 / np.sqrt(12), 1 - 0.6 + 0.06), rel=0.02)


def test_half_the_width_of_a_mean_is_that_of_white_noise_or_of_the_means_of_blocks():
    """Each in proportion to what a number of SI is of the gain; the tails beyond five deviations are cut."""
    source = np.random.default_rng(0)
    white = source.standard_normal(2000)
    white -= white.mean()
    walked = np.convolve(source.standard_normal(2000), 0.97 ** np.arange(200))[:2000]
    ones, unit = np.full((2000, 1), 4.0), np.array([[3.0]])
    widths = []
    for blocks in (10, 20):
        means = walked.reshape(blocks, -1).mean(axis=1)
        widths.append(student.ppf(0.975, blocks - 1) * means.std(ddof=1) / np.sqrt(blocks))
    assert _half_widths(walked, ones, unit) == pytest.approx([3 / 4 * max(widths)])
    alternating = np.tile([1.0, -1.0], 1000)  # whose blocks have a mean of 0
    assert _half_widths(alternating, ones, unit) == pytest.approx([3 / 4 * 1.96 / np.sqrt(2000)])
    large = white.copy()
    large[7] = 60.0
    bound = np.median(np.abs(large)) / 0.6745
    assert _of_large(large, ones, unit) == pytest.approx([3 / 4 * np.mean(large - np.clip(large, -3 * bound, 3 * bound))])
    cut = np.clip(large, -5 * bound, 5 * bound)
    assert _half_widths(large, ones, unit) == pytest.approx(_half_widths(cut, ones, unit), rel=1e-3)


@pytest.fixture(scope="module")
def place():
    """A log of a mass of 0.1 kg whose speed is read with noise, beside a sway of 0.6 N; where its least squares are."""
    source = np.random.default_rng(2)
    force = 3 * source.standard_normal(300)
    sway = 0.6 * np.sqrt(2) * np.sin(0.05 * np.arange(300))
    speed = marched(0.1, 1.0, force + sway, measured="velocity") + 4e-4 * source.standard_normal(300)
    log = scaled(Model(delay=0.0, measured="velocity"), force, speed, 1 / RATE, 4e-4)
    search = Search(log, {"rate": 10.0, "square": 0.0, "delay": 0.0, "white": 1e-2, "drift": 1.0})
    return Place(log, search, least_of(log, search, search.begun, 4, 20), 4)


def test_intervals_contain_a_device_beside_which_a_hand_sways_and_its_force_is_found(place):
    found = estimated_at(*place, None, 0.0)
    assert found.model.names == ("log_mass", "damping")
    assert (np.abs(found.theta - [np.log(0.1), 1.0]) <= found.half).all()
    assert (found.half < [0.01, 0.6]).all()
    assert force_beside(*place) == pytest.approx(0.6, rel=0.15)
    assert found.noise == pytest.approx(4e-4, rel=0.25)
    assert forceless(place) > 5 * found.left.std() / place.log.unit


def test_a_step_of_gauss_and_newton_leads_to_the_least_squares(place):
    log, search, point, skip = place
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, _ = projected(errors, effects)
    off = point.copy()
    rate = search.names.index("rate")
    off[rate] *= 1.2
    step = _step(log, search, off, skip, [0, 1 + rate])
    (numbers,) = errors_of(log, search.found(off), skip)[1:2]
    assert step[0] == pytest.approx(gains[0], rel=1e-3)
    assert off[rate] + step[1] == pytest.approx(point[rate], abs=0.05 * abs(off[rate] - point[rate]))
    assert len(numbers) == len(log.reading) - skip


def test_numbers_of_a_search_are_in_si_units():
    """Of two masses whose speeds are read every 2 ms, and of friction that falls."""
    log = scaled(Model(load=True, delay=0.0, measured="velocity"), np.array([3.0, -3.0]), np.array([0.0, 0.5]), 2e-3, 0.1)
    shape = {"rate": 5.0, "square": 3e4, "share": 0.7, "load_rate": 3.0, "coupling_rate": 8.0, "delay": 0.0}
    gain = 3.0 * 2e-3 / (0.4 * log.unit)  # of a mass of 0.4 kg
    expected = {"log_mass": np.log(0.4), "damping": 2.0, "log_load": np.log(0.28), "load_damping": 0.84}
    expected |= {"log_coupling": np.log(1.2e4), "coupling_damping": 3.2}
    names = [name for name in log.model.names if name in expected]
    assert theta_of(log, shape, np.array([gain])) == pytest.approx([expected[name] for name in names])
    rubbing = replace(log, model=Model(friction=True, measured="position"), unit=0.1)
    static = _static(rubbing, {"fading": 7.0}, np.array([2.0, 0.4, 0.2]))
    assert static == pytest.approx((3.0 * 0.6 / 2.0, 7.0 * 0.1 / 2e-3))


def test_friction_that_falls_is_that_of_a_fine_march_over_each_tick():
    """The mean of tanh(v/0.1) exp(-(v/0.8)^2), and of (1/2 - t) times it, on straight lines."""
    speeds = np.random.default_rng(1).standard_normal(40)
    log = scaled(Model(friction=True, measured="velocity"), np.ones(40) + speeds, speeds, 1e-3, 0.0)
    log = replace(log, speeds=speeds)
    times = (np.arange(4000) + 0.5) / 4000
    along = speeds[:-1, None] + np.diff(speeds)[:, None] * times
    force = np.tanh(along / 0.1) * np.exp(-((np.abs(along) / 0.8) ** 2))
    mean, moment = log.side(0.1, 0.8)
    assert mean[:-1] == pytest.approx(force.mean(axis=1), abs=0.09)
    assert np.mean(np.abs(mean[:-1] - force.mean(axis=1))) < 0.02
    assert np.corrcoef(moment[:-1], (force * (0.5 - times)).mean(axis=1))[0, 1] > 0.97
    few = log.part(5, 30)
    assert (few.reading[0], len(few.speeds)) == (0.0, 25)
    assert few.side(0.1)[0, :-1] == pytest.approx(log.side(0.1)[0, 5:29])


def found_near(truth, force, reading, step, noise=0.0):
    """The fit that begins near the numbers of a device, and what it says is missing."""
    model = Model(delay=0.0)
    prediction = SimpleNamespace(numbers=model.numbers(np.zeros(len(model.names))) | truth, skip=4, noise=max(step, noise))
    fit = fitted(model, force, reading, 1 / RATE, step, prediction)
    return fit, judged(fit)


DEVICE = {"mass": 0.1, "log_mass": np.log(0.1), "damping": 1.0, "delay": 0.0}
MISSING = {  # a motion, the step of its encoder, and what explains two fifths of what is left, or more
    "friction": (marched(0.1, 1.0, CHIRP, friction=0.05), 1e-4, "friction"),
    "a resonance": (two_masses(0.1, 1.0, CHIRP, 25.0), 5e-5, "resonance"),
    "one way": (marched(0.1, 1.0, CHIRP + 1.5, friction=0.1), 1e-6, "one-way"),
}


@pytest.mark.parametrize("kind", MISSING)
def test_what_a_fit_lacks_is_named(kind):
    places, step, missing = MISSING[kind]
    force = CHIRP + 1.5 * (kind == "one way")
    _, verdict = found_near(DEVICE, force, read(places, step, np.random.default_rng(0)), step)
    assert (verdict.missing, verdict.explained) == (missing, False)
    assert (0.4 < verdict.share < 1) is (kind != "one way")
    assert verdict.expected == pytest.approx(step / np.sqrt(12), rel=0.1)


def test_intervals_of_white_noise_are_those_of_linear_regression():
    """Slopes are those of a march, by differences."""
    noise = 2e-4 * np.random.default_rng(6).standard_normal(220)
    fit, verdict = found_near(DEVICE, CHIRP, marched(0.1, 1.0, CHIRP) + noise, 1e-5, 2e-4)
    skip = fit.rows.skip
    moved = [marched(0.1, 1.0, CHIRP, velocity=1e-3) / 1e-3, marched(0.1, 1.0, CHIRP + 1e-3) / 1e-3]
    base = marched(0.1, 1.0, CHIRP)
    J = [(marched(0.1 * np.exp(1e-4), 1.0, CHIRP) - base) / 1e-4, (marched(0.1, 1.0001, CHIRP) - base) / 1e-4]
    J += [np.ones(220), moved[0] - base / 1e-3, moved[1] - base / 1e-3]
    J = np.stack(J, axis=1)[skip:]
    deviation = 2e-4 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[:2]
    assert (np.abs(fit.theta[:2] - [np.log(0.1), 1.0]) < fit.half[:2]).all()
    assert fit.half[:2] == pytest.approx(1.96 * deviation, rel=0.2)
    assert fit.noise == pytest.approx(2e-4, rel=0.1)
    assert verdict.explained


def test_the_likeliest_effect_is_one_that_an_option_fits_if_nearly_as_likely():
    def best(*effects):
        return explained._best([Effect(name, likelier, 0.0) for name, likelier in effects]).name

    assert best(("drag", 90.0), ("spring", 80.0), ("delay", 60.0)) == "spring"
    assert best(("drag", 90.0), ("spring", 70.0)) == "drag"
    assert best(("sided friction", 90.0), ("friction", 20.0)) == "friction"
    assert explained._best([]) is None
    names = [
        [name for name, _ in explained._larger(model)] for model in (Model(), Model(friction=True, delay=1.0), Model(load=True))
    ]
    assert names == [["resonance", "friction", "spring"], ["delay", "spring"], []]


def test_a_lag_is_that_of_a_step():
    lags = explained._lagging(np.ones(50))
    for lag, ticks in zip(lags, (1, 4, 16), strict=True):
        assert lag == pytest.approx(1 - np.exp(-(1 + np.arange(50)) / ticks))


def test_a_curve_beside_a_fit_has_its_force(place):
    """A drag of half of the damping at the usual speed, where the innovations of a line are three times as large."""
    source = np.random.default_rng(3)
    force, parts, speed, speeds = np.repeat(source.standard_normal(60), 5), 20, 0.0, []
    for push in force:
        speeds.append(speed)
        for _ in range(parts):
            speed += (push - 1.0 * speed - 4.0 * speed * abs(speed)) / 0.1 / RATE / parts
    log = scaled(place.log.model, force, np.array(speeds) + 1e-6 * source.standard_normal(300), 1 / RATE, 1e-6)
    search = Search(log, {"rate": 10.0, "square": 0.0, "delay": 0.0, "white": 1e-2, "drift": 1.0})
    line = Place(log, search, least_of(log, search, search.begun, 4, 20), 4)
    beside = with_curve("drag", line)
    assert beside.force < 0.2 * force_beside(*line)
    assert beside.theta == pytest.approx([np.log(0.1), 1.0], abs=0.1)


def test_the_spectrum_of_white_errors_is_flat_and_that_of_the_encoder_and_noise():
    residual = 3e-5 * np.random.default_rng(0).standard_normal(20_000)
    columns = {"residual": residual, "weight": np.ones(20_000)}
    facts = {"period_s": 1e-3, "resolution": 0.0, "residual": {"white_noise": 3e-5}}
    hertz, density, white = _spectrum(columns, facts)
    assert (hertz[0], hertz[-1]) == (pytest.approx(0.05), pytest.approx(470, rel=0.05))
    assert white == pytest.approx(np.full(len(hertz), 3e-5 * np.sqrt(2e-3)))
    assert density[-20:] == pytest.approx(white[-20:], rel=0.1)


FOUND = {  # force that a fit leaves over that of the log, effects that explain it, whether it is seen; name, share, intervals
    "nothing is seen": (0.1, [], False, ("noise", 0.0, False)),
    "no effect is likely": (0.1, [Effect("spring", 14.9, 0.0)], True, ("force", 0.0, False)),
    "half of the log's own": (0.51, [], True, ("force", 0.0, True)),
    "a resonance": (0.1, [Effect("resonance", 40.0, 0.01, 30.0), Effect("drag", 45.0, 0.05)], True, ("resonance", 0.9, True)),
    "a lag before a likelier curve": (
        0.1,
        [Effect("lag", 20.0, 0.009), Effect("drag", 99.0, 0.001)],
        True,
        ("lag", 0.91, True),
    ),
    "a lag that leaves more": (
        0.1,
        [Effect("lag", 20.0, 0.011), Effect("friction", 99.0, 0.05)],
        True,
        ("friction", 0.5, True),
    ),
    "little of it": (0.1, [Effect("spring", 40.0, 0.071)], True, ("force", 0.29, False)),
    "less than amplifiers know": (9e-6, [Effect("spring", 40.0, 0.0)], True, ("force", 1.0, False)),
}


@pytest.mark.parametrize("kind", FOUND)
def test_a_missing_force_has_a_name_and_takes_intervals_away_or_widens_them(kind, place, monkeypatch):
    over, effects, seen, (name, share, withheld) = FOUND[kind]
    prediction = estimated_at(*place, None, 0.0)
    fit = by_prediction(prediction, place.log.force, place.log.reading, 1 / RATE, 4e-4)
    pushed = float(np.std(fit.rows.force))
    found = [effect._replace(left=effect.left * pushed, moved=np.array([0.3, 0.1])) for effect in effects]
    monkeypatch.setattr(explained, "_lacking_effects", lambda *_: (over * pushed, found, seen))
    lacking, verdict = explained.lacking(fit, prediction, ())
    assert (verdict.explained, verdict.missing, verdict.withheld) == (False, name, withheld)
    assert verdict.share == pytest.approx(share, abs=1e-9)
    assert verdict.frequency_hz == pytest.approx(30.0 if name == "resonance" else np.nan, nan_ok=True)
    widened = not withheld and any(effect.likelier > 15 for effect in effects)
    assert np.broadcast_to(lacking.extra, 2) == pytest.approx([0.3 * widened, 0.1 * widened])
    assert verdict.rms == pytest.approx(np.sqrt(np.mean(prediction.left**2)))


def test_rounds_of_a_smoother_find_friction_that_does_not_fall_beside_damping():
    """Of a mass of 0.1 kg under noise; begun with half of the damping, and friction that turns round at a usual speed."""
    source = np.random.default_rng(8)
    force = source.standard_normal(240)
    speed = marched(0.1, 1.0, force, friction=0.3, measured="velocity") + 1e-6 * source.standard_normal(240)
    log = scaled(Model(friction=True, delay=0.0, measured="velocity"), force, speed, 1 / RATE, 1e-6)
    search = Search(log, {"rate": 5.0, "square": 0.0, "delay": 0.0, "white": 1e-3, "drift": 1e-9, "turning": log.slowest})
    rounds = smoothed(Rounds(log, search.begun), search, 4)
    _, errors, effects = errors_of(rounds.log, search.found(rounds.point), 4)
    theta = theta_of(rounds.log, search.found(rounds.point), projected(errors, effects)[0])
    assert theta == pytest.approx([np.log(0.1), 1.0, 0.3], abs=1e-3)
    assert with_falling_friction(rounds.log, search, rounds.point, 4) is None


def test_readings_far_from_a_fit_near_the_best_one_are_outliers():
    """Of numbers that are off by more than the noise: what they leave is no outlier."""
    noise = 1e-6 * np.random.default_rng(4).standard_normal(220)
    noise[[60, 150]] += 2e-5, -1e-4
    rows = LogRows(CHIRP, marched(0.1, 1.0, CHIRP) + noise, 1 / RATE, 1e-6, 4, np.ones(216, bool))
    model = Model(delay=0.0)
    theta = np.array([{"log_mass": np.log(0.1001), "damping": 1.001}.get(name, 0.0) for name in model.names])
    assert np.abs(rows.residual(model, theta)).std() > 1e-5
    assert np.flatnonzero(~_inliers(model, theta, rows)).tolist() == [56, 146]


def test_numbers_that_no_double_holds_have_no_readings():
    numbers = dict.fromkeys(
        ("damping", "load_damping", "coupling_damping", "delay", "offset", "start", "velocity", "twist", "slip"), 0.0
    )
    numbers |= {"mass": 1e-3, "load_mass": 1e-3, "coupling_stiffness": 1e300}
    found = two_masses_of_model(numbers, CHIRP, 1e-3, 5)
    assert found.shape == (3, 215)
    assert np.isnan(found).all()
