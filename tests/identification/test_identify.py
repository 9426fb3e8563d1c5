"""Devices found from logs of the simulation, and of marches in numpy, whose numbers are known."""

import numpy as np
import pytest
from identify_coverage import KINDS, RATE, coupled, force_of, log_of, marched, moved, read, study
from simulated_logs import of_curves

import wavesweep
from wavesweep.engine.errors import UsageError
from wavesweep.identification import table as of_identify
from wavesweep.identification.device_spec import spec_text
from wavesweep.identification.explained import identified
from wavesweep.identification.fit import fitted
from wavesweep.identification.model import Model, measured, readings
from wavesweep.identification.response import Hold, admittance


def written(path, force, position, names="time,force,position", period=1 / RATE):
    times = period * np.arange(len(force))
    np.savetxt(path, np.c_[times, force, position], delimiter=",", header=names, comments="", fmt="%.12g")
    return path


@pytest.mark.asks("simulation")
@pytest.mark.parametrize("friction", [0.0, 0.2])
@pytest.mark.parametrize("spring", [0.0, 40.0])
def test_the_model_is_that_of_the_simulation(friction, spring):
    """Which divides a tick in which the device stops by a closed form, and shares no code with the fit."""
    force = 1.5 * np.sin(0.05 * np.arange(400)) + 0.3
    expected = moved(0.08, 0.7, force, friction, spring)
    model = Model(spring=True, friction=True, delay=0.0)
    theta = np.array([np.log(0.08), 0.7, spring, friction, 0.0, 0.0, 0.0])
    assert readings(model, theta, force, 1 / RATE) == pytest.approx(expected, abs=1e-8 * np.ptp(expected))
    if not friction:
        linear = readings(Model(True, False, 0.0), np.delete(theta, 3), force, 1 / RATE)
        assert linear == pytest.approx(expected, abs=1e-11 * np.ptp(expected))


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_velocities_are_those_of_a_march_and_accelerations_their_means(friction):
    """Of a march by the closed solution, which shares no code with the fit, with a part of a tick of delay."""
    force = 1.5 * np.sin(0.05 * np.arange(400) ** 1.1) + 0.3
    expected = marched(0.08, 0.7, force, 1.6, 0.2, friction, "velocity")
    numbers = {"mass": 0.08, "damping": 0.7, "stiffness": 0.0, "friction": friction, "delay": 1.6}
    numbers |= {"start": 0.0, "velocity": 0.2, "offset": 0.0, "bias": 0.03}
    found = measured(numbers, "velocity", force, 1 / RATE)
    assert found == pytest.approx(expected + 0.03, abs=2e-6 * np.ptp(expected))
    later = measured(numbers | {"velocity": expected[2]}, "acceleration", force, 1 / RATE, 3)
    assert later == pytest.approx(np.diff(expected)[2:] * RATE + 0.03, abs=1e-3 if friction else 1e-8)


DRIVE = (1.2e-4, 3e-4, 2.5e-4, 2e-4, 60.0, 0.004)  # motor with its damping, load with its own, stiffness and damping of a shaft
OF_DRIVE = ("mass", "damping", "load_mass", "load_damping", "coupling_stiffness", "coupling_damping")


def log_of_drive(noise, top=300.0):
    """Torque and speed of a motor with a load on a shaft, by a march with matrix exponentials; noise in rad/s."""
    source, octaves = np.random.default_rng(5), np.log(top) / 0.8
    torque = 0.05 + 0.3 * np.sin(2 * np.pi * np.expm1(octaves * np.arange(800) / RATE) / octaves)
    speed = coupled(*DRIVE, torque, 1.3, 0.2, "velocity")
    return torque, speed + noise * source.standard_normal(len(speed))


@pytest.mark.parametrize("sensor", ["position", "velocity"])
def test_two_masses_move_as_in_a_march_with_matrix_exponentials(sensor):
    torque = log_of_drive(0)[0][:300]
    numbers = dict(zip(OF_DRIVE, DRIVE, strict=True)) | {"delay": 1.3, "velocity": 0.2}
    numbers |= dict.fromkeys(("start", "offset", "bias", "twist", "slip"), 0.0)
    expected = coupled(*DRIVE, torque, 1.3, 0.2, sensor)
    assert measured(numbers, sensor, torque, 1 / RATE) == pytest.approx(expected, abs=1e-9 * np.ptp(expected))


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", [kind for kind in list(KINDS)[: list(KINDS).index("euler")] if not kind.startswith(("10^", "coupled"))]
)
def test_intervals_contain_the_truth(kind):
    """Of four logs nearly all; the script benchmarks/identify_coverage.py counts more."""
    inside, _, missing, _ = zip(*study(kind, 4), strict=True)
    assert np.mean(inside, axis=0).min() >= 0.75
    assert "coloured" in kind or missing == ("",) * 4


@pytest.mark.asks("simulation")
def test_the_march_of_the_logs_is_the_simulation():
    """With friction, and a force that changes within a tick: the simulation at four times the rate."""
    force = np.random.default_rng(1).uniform(-1, 1, 100).repeat(3)
    late = np.concatenate([np.full(5, force[0]), force.repeat(4)])[: 4 * len(force)]
    tables = {"controller": {"kind": "dc"}, "rates": {"fast_hz": 4 * RATE}, "device": {"mass": 0.1, "damping": 0.7}}
    tables |= {"environment": {"K_VE": 0.0, "B_VE": 0.0}}
    expected = wavesweep.compile(tables).simulate(late, friction=0.3)["x"].to_numpy()[::4]
    assert marched(0.1, 0.7, force, 1.25, 0.0, 0.3) == pytest.approx(expected, abs=1e-8 * np.ptp(expected))


def test_the_model_stops_and_starts_within_a_tick():
    """Where the force changes within it; against the march by closed forms."""
    force = np.random.default_rng(3).uniform(-1, 1, 600)
    theta = np.array([np.log(0.01), 1.0, 0.4, 2.6, 0.0, 0.0, 0.0])
    expected = marched(0.01, 1.0, force, 2.6, 0.0, 0.4)
    assert readings(Model(friction=True), theta, force, 1 / RATE) == pytest.approx(expected, abs=1e-6 * np.ptp(expected))


@pytest.mark.parametrize("sided", [False, True])
def test_friction_that_turns_round_at_a_speed_is_that_of_a_fine_march(sided):
    """With 400 steps of a tick, of the second order. A device that sticks creeps."""
    device = {"mass": 0.1, "damping": 0.8, "stiffness": 60.0, "friction": 0.2, "delay": 0.25, "offset": 0.05, "bias": 0.0}
    device |= {"start": 0.0, "velocity": 0.02, "turning": 2e-3, "sided": sided}
    force = 0.6 * np.sin(0.3 * np.arange(40))

    def slope(v, x, push):
        side = np.tanh(v / 2e-3)
        offset = 0.05 * (abs(side) if sided else 1.0)
        return (push + offset - 0.2 * side - 0.8 * v - 60.0 * x) / 0.1

    v, x, h = 0.02, 0.0, 1e-3 / 400
    states = []
    for tick in range(40):
        states.append((v, x))
        for part in range(400):
            push = force[max(tick - (part < 100), 0)]
            middle = v + h / 2 * slope(v, x, push)
            v, x = v + h * slope(middle, x + h / 2 * v, push), x + h * middle
    speeds, places = np.transpose(states)
    assert measured(device, "position", force, 1e-3) == pytest.approx(places, abs=2e-7)
    assert measured(device, "velocity", force, 1e-3) == pytest.approx(speeds, abs=3e-5)
    at_once = measured(device | {"turning": 0.0}, "position", force, 1e-3)
    assert np.abs(at_once - places).max() > 4e-6


@pytest.mark.parametrize("damping", [-40.0, 40.0])
def test_with_friction_that_vanishes_a_march_is_that_of_the_damping_alone(damping):
    """Also of one below 0, as a fit may try: v' = 40 v + 10 f by e^(40 t)."""
    device = {
        "mass": 0.1,
        "damping": 0.1 * damping,
        "stiffness": 0.0,
        "friction": 0.0,
        "delay": 0.0,
        "offset": 0.0,
        "bias": 0.0,
    }
    device |= {"start": 0.0, "velocity": 0.02, "turning": 1e-6}
    force = np.sin(0.3 * np.arange(40))
    decay = np.exp(-damping * 1e-3)
    speeds = [0.02]
    for push in force[:-1]:
        speeds.append(decay * speeds[-1] + 10 * push * (1 - decay) / damping)
    assert measured(device, "velocity", force, 1e-3) == pytest.approx(speeds, rel=1e-9, abs=1e-9)


@pytest.mark.slow
def test_friction_that_creeps_does_not_move_the_numbers_out_of_their_intervals():
    """If it turned round at once, damping and friction would be 4 half-widths off."""
    log = of_curves("sided friction", 3, 7, 0.6, "position")[2]
    fit = fitted(Model(friction=True), log.force, log.reading - log.reading[0], log.period, log.step)
    size = np.std(log.force)
    truth = log.truth | {"log_mass": np.log(log.truth["mass"]), "friction": 0.2 * size, "offset": -0.08 * size}
    for name, value, half in zip(fit.model.names, fit.theta, fit.half, strict=True):
        assert name not in truth or abs(value - truth[name]) <= half, name


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.0, 0.27])
def test_a_delay_that_turns_a_fast_force_round_is_found(friction):
    """4.56 ticks are more than a quarter of a period at 60 Hz: without the delay the force has the wrong sign."""
    time = np.arange(-0.01, 0.3, 1e-3)
    force = 2 * np.sin(2 * np.pi * (50 + 50 * time) * time)
    position = 1e-7 * np.round(marched(0.1, 1.0, force, 4.56, 0.0, friction)[10:] / 1e-7)
    fit = fitted(Model(friction=bool(friction)), force[10:], position, 1e-3, 1e-7)
    for name, truth in {"mass": 0.1, "damping": 1.0, "friction": friction, "delay": 4.56}.items():
        assert fit.numbers[name] == pytest.approx(truth, rel=1e-2), name


@pytest.mark.slow
def test_an_outlier_is_left_out_and_named(tmp_path):
    """And not called noise."""
    force = force_of("chirp", np.random.default_rng(0), 400)
    position = read(marched(0.1, 1.0, force), 1e-5, np.random.default_rng(1))
    position[[200, 301]] += 1e-3, -5e-3
    found = wavesweep.identify(written(tmp_path / "wild.csv", force, position), resolution=1e-5)
    assert [*np.flatnonzero(found["weight"].to_numpy()[50:] == 0) + 50] == [200, 301]
    assert any("2 outliers left out of the fit; the first is at 0.2 s" in each for each in found.attrs["facts"]["notices"])
    summary = found.attrs["summary"]
    assert summary["explained"]
    assert summary["residual"]["white_noise"] == 0
    assert summary["parameters"]["mass"]["low"] <= 0.1 <= summary["parameters"]["mass"]["high"]


@pytest.mark.slow
def test_white_noise_beside_the_encoder_is_told_and_widens_the_intervals():
    source = np.random.default_rng(4)
    truth, force, position, q, _ = log_of("white", source, "chirp")
    fit, verdict = identified(Model(), force, position, 1 / RATE, q)
    assert fit.estimate.noise == pytest.approx(q, rel=0.1)
    assert abs(fit.theta[0] - np.log(truth["mass"])) < 1.6 * fit.half[0]
    assert verdict.explained


@pytest.mark.slow
@pytest.mark.asks("for_all")
def test_the_spec_of_a_log_has_its_delay_and_the_velocity_of_its_encoder(tmp_path):
    """Of 1.4 ticks, with which walls are stable up to a fourth of what they would be without, as a spec of the truth says."""
    force = np.sin(0.003 * np.arange(600) ** 1.5)
    path = written(tmp_path / "log.csv", force, read(marched(0.1, 1.0, force, 1.4), 1e-6, np.random.default_rng(0)))
    table = of_identify.identify(str(path), resolution=1e-6)
    (tmp_path / "device.toml").write_text(spec_text(table.facts))
    found = wavesweep.load(tmp_path / "device.toml")
    ranges = {axis.path: (axis.start, axis.stop) for axis in found.for_all.axes}
    low, high = ranges["device.dead_time"]
    assert low < 1.4e-3 < high < 1.41e-3
    truth = {"mass": 0.1, "damping": 1.0, "dead_time": 1.4e-3, "velocity": "difference"}
    others = ({"controller": {"kind": "dc"}, "device": device} for device in (truth, {"mass": 0.1}))
    ends = [wavesweep.compile(each).stable_intervals(span=(0, 20000))["high"].max() for each in (found, *others)]
    assert ends[0] == pytest.approx(ends[1], rel=5e-3)
    assert ends[0] < ends[2] / 2


@pytest.mark.slow
def test_a_log_whose_columns_are_of_other_rows_is_told_by_how_many(tmp_path):
    source = np.random.default_rng(0)
    force = force_of("noise", source, 1000)
    position = read(marched(0.1, 1.0, force), 1e-6, source)
    path = written(tmp_path / "early.csv", force[:-40], position[40:])
    with pytest.raises(UsageError, match=r"early.csv: .*; the reading seems to be 40 rows ahead of its force"):
        wavesweep.identify(path)


HERTZ = np.geomspace(0.5, 100, 60)


def discrete_admittance(mass, damping, stiffness, delay):
    """Of a force held over ticks of 1 ms, from scipy's discretisation over parts of a tick; the delay in tenths of ticks."""
    from scipy.signal import cont2discrete

    parts, turn = 10, 2 * np.pi * HERTZ / RATE
    device = (
        np.array([[0, 1], [-stiffness / mass, -damping / mass]]),
        np.array([[0], [1 / mass]]),
        np.eye(1, 2),
        np.zeros((1, 1)),
    )
    A, B, C, _, _ = cont2discrete(device, 0.1 / RATE)
    whole, part = divmod(round(delay * parts), parts)
    # What a unit force in each part has moved by the tick's end; before `part` it is that of the tick before.
    moved = [np.linalg.matrix_power(A, parts - 1 - at) @ B for at in range(parts)]
    before, now = sum(moved[:part], 0 * B), sum(moved[part:], 0 * B)
    z, A = np.exp(1j * turn), np.linalg.matrix_power(A, parts)
    return np.array([(C @ np.linalg.solve(each * np.eye(2) - A, now + before / each))[0, 0] for each in z]) * z**-whole


def test_a_frequency_response_has_the_same_numbers(tmp_path):
    """The model is scipy's, and intervals contain the truth; what a model lacks is named."""
    source, path = np.random.default_rng(3), tmp_path / "frf.csv"
    H = discrete_admittance(0.1, 1.0, 30.0, 1.5)
    assert admittance({"mass": 0.1, "damping": 1.0, "stiffness": 30.0, "delay": 1.5}, HERTZ, Hold(1 / RATE)) == pytest.approx(H)
    H = H * (1 + 0.01 * (source.standard_normal(60) + 1j * source.standard_normal(60)))
    written_response(path, H)
    found = wavesweep.identify(path, spring=True, rate_hz=RATE).attrs["summary"]
    for name, truth in {"mass": 0.1, "damping": 1.0, "stiffness": 30.0, "delay": 1.5}.items():
        assert found["parameters"][name]["low"] < truth < found["parameters"][name]["high"]
    assert found["explained"]
    for options, missing in (({}, "spring"), ({"spring": True, "delay": 0.0}, "delay")):
        left = wavesweep.identify(path, rate_hz=RATE, **options).attrs["summary"]
        assert (left["explained"], left["missing"]) == (False, missing)
    mode = 0.05 / ((2 * np.pi * 30) ** 2 - (2 * np.pi * HERTZ) ** 2 + 2j * 0.03 * 30 * HERTZ * 4 * np.pi**2)
    written_response(path, discrete_admittance(0.1, 1.0, 0.0, 1.5) + mode)
    left = wavesweep.identify(path, rate_hz=RATE).attrs["summary"]
    assert left["missing"] == "resonance"
    assert left["residual"]["frequency_hz"] == pytest.approx(30, rel=0.1)


@pytest.mark.slow
def test_intervals_from_an_analogue_response_of_the_velocity_contain_the_truth(tmp_path):
    """In 36 of 40 or more, whose mobility is that of a transfer function with a dead time; nothing is held."""
    source, path, inside = np.random.default_rng(5), tmp_path / "frf.csv", []
    s = 2j * np.pi * HERTZ
    for _ in range(40):
        mass, damping, delay = source.uniform(0.03, 0.3), source.uniform(0.2, 2.0), source.uniform(0, 4)
        mobility = np.exp(-s * delay * 1e-3) / (mass * s + damping)
        mobility = mobility * (1 + 0.01 * (source.standard_normal(60) + 1j * source.standard_normal(60)))
        written_response(path, mobility, "mobility")
        found = wavesweep.identify(path).attrs["summary"]["parameters"]
        truth = {"mass": mass, "damping": damping, "delay": delay}
        inside.append([found[name]["low"] < value < found[name]["high"] for name, value in truth.items()])
    assert found["delay"]["unit"] == "ms"
    assert (np.sum(inside, axis=0) >= 36).all()


def written_response(path, H, name="admittance"):
    table = np.c_[HERTZ, np.abs(H), np.degrees(np.angle(H))]
    np.savetxt(path, table, delimiter=",", header=f"frequency_hz,{name}_abs,{name}_deg", comments="")


def _of_whole(step):
    return lambda times, _: np.floor(times / step) * step


STAMPS = {  # the rate of a log, and its stamps of these times
    "600 Hz, whole ms": (600, _of_whole(1e-3)),
    "700 Hz, whole ms": (700, _of_whole(1e-3)),
    "450 Hz, whole ms": (450, _of_whole(1e-3)),
    "334 Hz, whole ms": (334, _of_whole(1e-3)),
    "640 Hz, rounded to ms": (640, lambda times, _: np.round(times, 3)),
    "1200 Hz, half ms": (1200, _of_whole(5e-4)),
    "960 Hz, fifths of a ms": (960, _of_whole(2e-4)),
    "late by up to a fifth": (1000, lambda times, rng: times + 2e-4 * rng.random(len(times))),
    "late by up to two fifths": (1000, lambda times, rng: times + 4e-4 * rng.random(len(times))),
    "slow, late by up to a third": (500, lambda times, rng: times + 6e-4 * rng.random(len(times))),
    "normal": (1000, lambda times, rng: times + 1e-4 * rng.standard_normal(len(times))),
    "late now and then": (1000, lambda times, rng: times + 1e-4 * rng.exponential(size=len(times)).clip(0, 4)),
    "the first one early": (1000, lambda times, _: times - 4e-4 * (times == times[0])),
    "the last one late": (1000, lambda times, _: times + 4e-4 * (times == times[-1])),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", STAMPS)
def test_stamps_that_jitter_leave_the_mass_and_the_damping_in_their_intervals(kind, tmp_path):
    """Rows are equally spaced, and the stamps are not: a mass is in proportion to the square of the period."""
    rate, stamps = STAMPS[kind]
    rng = np.random.default_rng(len(kind))
    force = np.repeat(rng.uniform(-1, 1, 300), 5)
    decay = np.exp(-15.0 / rate)
    x, v = np.zeros((2, len(force)))
    for k, push in enumerate(force[:-1]):
        end = push / 1.5
        x[k + 1] = x[k] + end / rate + (v[k] - end) * (1 - decay) / 15.0
        v[k + 1] = end + (v[k] - end) * decay
    path = tmp_path / "log.csv"
    rows = np.c_[stamps(np.arange(len(force)) / rate, rng), force, np.round(x / 1e-5) * 1e-5]
    np.savetxt(path, rows, delimiter=",", header="time,force,position", comments="", fmt="%.9f")
    found = of_identify.identify(path).facts["parameters"]
    assert found["mass"]["low"] <= 0.1 <= found["mass"]["high"]
    assert found["damping"]["low"] <= 1.5 <= found["damping"]["high"]
    assert found["mass"]["high"] - found["mass"]["low"] < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("ticks", [3.0, 8.0])
def test_a_lag_of_the_actuator_is_named(ticks):
    """Of a rotor whose speed is read: the torque follows what is asked for by a lag of first order."""
    rng = np.random.default_rng(3)
    force = np.repeat(rng.uniform(-0.5, 0.5, 300), 10)
    lagging, v, speed = 0.0, 0.0, []
    for asked in force:
        speed.append(v)
        lagging += (1 - np.exp(-1 / ticks)) * (asked - lagging)
        v = np.exp(-1.5 / RATE) * v + (1 - np.exp(-1.5 / RATE)) / 0.15 * lagging
    reading = np.round(np.array(speed) / 1e-5) * 1e-5
    _, verdict = identified(Model(measured="velocity"), force, reading, 1 / RATE, 1e-5)
    assert verdict.missing == "lag"
    assert verdict.share > 0.5
