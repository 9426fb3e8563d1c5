"""Devices found from logs of the simulation, and of marches in numpy, whose numbers are known."""

import numpy as np
import pytest
from identify_coverage import ENCODERS, FORCES, MODELS, RATE, log_of, moved, read, study, two_masses

import wavesweep
from wavesweep.errors import UsageError
from wavesweep.identification.fit import fitted
from wavesweep.identification.log import read_log, step_of
from wavesweep.identification.model import Model, positions
from wavesweep.identification.response import admittance
from wavesweep.identification.verdict import judged


def written(path, force, position, names="time,force,position", period=1 / RATE):
    times = period * np.arange(len(force))
    np.savetxt(path, np.c_[times, force, position], delimiter=",", header=names, comments="", fmt="%.12g")
    return path


@pytest.mark.parametrize("friction", [0.0, 0.2])
@pytest.mark.parametrize("spring", [0.0, 40.0])
def test_the_model_is_that_of_the_simulation(friction, spring):
    """Which divides a tick in which the device stops by a closed form, and shares no code with the fit."""
    force = 1.5 * np.sin(0.05 * np.arange(400)) + 0.3
    expected = moved(0.08, 0.7, force, friction, spring)
    model = Model(spring=True, friction=True, delay=0.0)
    theta = np.array([np.log(0.08), 0.7, spring, friction, 0.0, 0.0, 0.0])
    assert positions(model, theta, force, 1 / RATE) == pytest.approx(expected, abs=1e-8 * np.ptp(expected))
    if not friction:
        linear = positions(Model(True, False, 0.0), np.delete(theta, 3), force, 1 / RATE)
        assert linear == pytest.approx(expected, abs=1e-11 * np.ptp(expected))


def test_a_force_may_be_late_by_a_part_of_a_tick():
    """The same as a force at ten times the rate that is seven of its ticks late."""
    force = np.random.default_rng(0).standard_normal(60)
    fine = Model(delay=7.0)
    expected = positions(fine, np.array([0.0, 2.0, 0, 0, 0]), np.repeat(force, 10), 1e-3)[::10]
    found = positions(Model(delay=0.7), np.array([0.0, 2.0, 0, 0, 0]), force, 1e-2)
    assert found[1:] == pytest.approx(expected[1:], rel=1e-9)


@pytest.mark.parametrize("friction", [False, True])
def test_a_delay_can_be_held(friction):
    """And the numbers are those of the fit that finds it, if it is the true one."""
    force = 1.5 * np.sin(0.05 * np.arange(300) ** 1.2)
    position = read(moved(0.08, 0.7, force, 0.1 * friction), 1e-5, np.random.default_rng(0))
    held = fitted(Model(friction=friction, delay=0.0), force, position, 1 / RATE, 1e-5)
    assert "delay" not in held.model.names
    assert held.numbers["mass"] == pytest.approx(0.08, rel=1e-3)


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("kind", FORCES)
def test_intervals_contain_the_truth(kind):
    """Of four logs of mass, damping and delay nearly all; the script benchmarks/identify_coverage.py counts 200 of each."""
    inside, missing, _ = study("none", kind, 1e-5, 4)
    assert inside.min() >= 0.75
    assert missing == [""] * 4


@pytest.mark.thorough
@pytest.mark.parametrize("resolution", ENCODERS)
@pytest.mark.parametrize("kind", FORCES)
def test_intervals_of_95_per_cent_contain_the_truth_in_92_to_98(kind, resolution):
    """All three numbers together; of one of them 200 logs tell the share to within 3 per cent."""
    inside, missing, _ = study("none", kind, resolution, 200)
    assert 0.92 <= inside.mean() <= 0.98
    assert inside.min() >= 0.9
    assert missing.count("") >= 198


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize("effect", ["resonance", "friction", "late"])
def test_a_model_that_lacks_an_effect_is_not_called_enough(effect):
    _, missing, _ = study(effect, "chirp", 1e-5, 1)
    assert missing == [{"late": "delay"}.get(effect, effect)]


@pytest.mark.thorough
@pytest.mark.parametrize("kind", FORCES)
@pytest.mark.parametrize("effect", ["friction", "late", "resonance"])
def test_a_model_that_lacks_an_effect_is_never_called_enough(effect, kind):
    """But if a resonance moves the device by less than a step of the encoder, as after a pulse with the coarsest."""
    for resolution in ENCODERS[:2] if (effect, kind) == ("resonance", "pulse") else ENCODERS:
        _, missing, _ = study(effect, kind, resolution, 20)
        assert "" not in missing


@pytest.mark.thorough
def test_friction_and_a_spring_are_found_if_they_are_asked_for():
    source = np.random.default_rng(2)
    force = 1.5 * np.sin(2 * np.pi * np.cumsum(np.linspace(1, 12, 1500)) / RATE)
    position = read(moved(0.1, 0.8, force, friction=0.1, spring=60.0), 1e-5, source)
    fit = fitted(Model(spring=True, friction=True), force, position, 1 / RATE, 1e-5)
    half = dict(zip(fit.model.names, fit.half, strict=True))
    for name, truth in {"log_mass": np.log(0.1), "damping": 0.8, "stiffness": 60.0, "friction": 0.1, "delay": 0.0}.items():
        assert abs(fit.numbers[name] - truth) <= 1.6 * half[name]
    assert judged(fit, force, position, 1 / RATE).explained


def test_a_constant_force_against_a_motion_one_way_is_not_told_from_friction():
    force = 0.6 + 0.5 * np.sin(0.05 * np.arange(600))
    position = read(moved(0.1, 1.0, force, friction=0.05), 1e-5, np.random.default_rng(0))
    fit = fitted(MODELS["none"], force, position, 1 / RATE, 1e-5)
    assert fit.numbers["offset"] == pytest.approx(-0.05, abs=1e-3)
    assert judged(fit, force, position, 1 / RATE).missing == "one-way"
    rubbing = fitted(Model(friction=True), force, position, 1 / RATE, 1e-5)
    assert rubbing.numbers["friction"] == pytest.approx(0.05, abs=1e-3)
    assert judged(rubbing, force, position, 1 / RATE).explained


def test_a_log_in_which_no_resonance_would_show_cannot_tell():
    """A good one shows one in some band, in which that of a quarter of the mass is."""
    force, source = np.where((np.arange(800) >= 50) & (np.arange(800) < 250), 0.3, 0.0), np.random.default_rng(0)
    places = moved(0.1, 2.0, force)
    for noise, missing in ((np.ptp(places), "unseen"), (0.0, "")):
        position = read(places + noise * source.standard_normal(800), 1e-7, source)
        fit = fitted(MODELS["none"], force, position, 1 / RATE, 1e-7)
        verdict = judged(fit, force, position, 1 / RATE)
        assert (verdict.missing, verdict.explained) == (missing, not missing)
    low, high = verdict.resonance_hz
    assert low < 30.0 < high
    swinging = read(two_masses(0.1, 2.0, force), 1e-7, source)
    fit = fitted(MODELS["none"], force, swinging, 1 / RATE, 1e-7)
    assert not judged(fit, force, swinging, 1 / RATE).explained


@pytest.mark.slow
def test_white_noise_beside_the_encoder_is_told_and_widens_the_intervals():
    source = np.random.default_rng(4)
    (mass, _, _), force, _ = log_of("chirp", 1e-5, source)
    places = moved(mass, 1.0, force) + 1e-4 * source.standard_normal(len(force))
    fit = fitted(MODELS["none"], force, read(places, 1e-5, source), 1 / RATE, 1e-5)
    assert fit.noise == pytest.approx(1e-4, rel=0.1)
    assert abs(fit.theta[0] - np.log(mass)) < 1.6 * fit.half[0]
    assert judged(fit, force, fit.positions + fit.residual, 1 / RATE).explained


def test_the_step_of_an_encoder_shows_in_its_readings():
    source = np.random.default_rng(0)
    places = np.cumsum(source.standard_normal(500)) * 1e-4
    assert step_of(read(places, 2e-5, source)) == pytest.approx(2e-5)
    assert step_of(places) == 0.0


GOOD = ["time,force,position", *(f"{k / 1000},{np.sin(k / 9):.5f},{1e-3 * np.sin(k / 9):.6f}" for k in range(60))]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda lines: [line.replace(",", ";") for line in lines], ":1: expected commas between columns .* found semicolons"),
        (lambda lines: [lines[0], *(line.replace(".", ",") for line in lines[1:])], ":2: .*are these decimal commas"),
        (lambda lines: lines[:20], "expected at least 50 rows of numbers below the header, found 19"),
        (
            lambda lines: [*lines[:30], lines[10], *lines[31:]],
            ":31: time: expected times that increase, found 0.009 after 0.028",
        ),
        (lambda lines: [*lines[:30], *lines[33:]], ":31: time: expected equal steps, found 0.004 s between two rows"),
        (lambda lines: [*lines[:30], "0.029,nan,0", *lines[31:]], ":31: force: expected a finite number, found nan"),
        (lambda lines: [*lines[:30], "0.029,,0", *lines[31:]], ":31: force: expected a number, found nothing"),
        (lambda lines: [lines[0], *(f"{k / 1000},1,{k}" for k in range(60))], "force: expected a column that changes, found 1"),
        (lambda lines: [lines[0], *(f"{k / 1000},{k},0" for k in range(60))], "position: expected a column that changes"),
        (lambda lines: [lines[0].replace("position", "positon"), *lines[1:]], "did you mean --column position=positon"),
        (lambda lines: [*lines[:30], "0.029,1", *lines[31:]], ":31: expected 3 values as in the header, found 2"),
        (lambda lines: [lines[0], *(f"{k},{k},1,0,5" for k in range(60))], ":2: .*are these decimal commas"),
        (lambda lines: [line.replace(",", " ") for line in lines], ":1: expected commas between columns .* found spaces"),
        (lambda lines: [line.rpartition(",")[0] for line in lines], "expected a column position, found time, force"),
        (lambda lines: lines[1:], ":1: expected a header with the names of the columns, found 0.0,"),
        (lambda lines: lines[:1], "expected at least 50 rows of numbers below the header, found 0"),
        (lambda _: [], "expected a header and rows of numbers below it, found an empty file"),
        (lambda _: ["\0\1\2\3" * 100], "found bytes that are no text; export it as CSV"),
        (
            lambda lines: [lines[0], *(f"{(k / 1000) ** 1.3},{k},{k * k}" for k in range(200))],
            ": time: expected equal steps, found a time 14.6 steps from where equal ones of .* s have it; resample",
        ),
    ],
)
def test_a_bad_log_is_one_message(change, said, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(change(GOOD)))
    with pytest.raises(UsageError, match=said):
        wavesweep.identify(path)


def test_other_columns_may_hold_anything(tmp_path):
    """Words, nothing, or a comma too many at the ends of the rows."""
    path = tmp_path / "log.csv"
    words = [f"{line},{'note' if not row else 'on' if row % 2 else ''}," for row, line in enumerate(GOOD)]
    path.write_text("\n".join(words))
    plain = tmp_path / "plain.csv"
    plain.write_text("\n".join(GOOD))
    assert (read_log(path, {}, {}).position == read_log(plain, {}, {}).position).all()


def test_jitter_of_the_times_is_said(tmp_path):
    source = np.random.default_rng(0)
    force = np.sin(0.05 * np.arange(300))
    path = written(tmp_path / "log.csv", force, read(moved(0.1, 1.0, force), 1e-5, source))
    lines = path.read_text().splitlines()
    for row in range(2, len(lines) - 1):
        time, _, rest = lines[row].partition(",")
        lines[row] = f"{float(time) + 1e-4 * source.uniform(-1, 1):.7f},{rest}"
    path.write_text("\n".join(lines))
    notices = wavesweep.identify(path).attrs["facts"]["notices"]
    assert any("times jitter by up to" in each and "equal steps of 1 ms" in each for each in notices)


def test_a_force_that_does_not_excite_the_mass_is_told(tmp_path):
    """A slow push of a device in syrup."""
    force = np.sin(2 * np.pi * 0.2 * np.arange(1500) / RATE)
    path = written(tmp_path / "slow.csv", force, read(moved(0.01, 40.0, force), 1e-4, np.random.default_rng(0)))
    with pytest.raises(UsageError, match="the force does not excite the mass: it could be anything from"):
        wavesweep.identify(path)


@pytest.mark.slow
def test_units_and_names_of_columns_can_be_told(tmp_path):
    force = 0.5 * np.sin(2 * np.pi * np.cumsum(np.linspace(1, 12, 600)) / RATE)
    places = read(moved(0.06, 0.8, force), 1e-5, np.random.default_rng(1))
    wrong = written(tmp_path / "millinewton.csv", 1000 * force, places)
    with pytest.raises(
        UsageError, match=r"found a mass of 60 kg \(usual: 0.001 to 20\); are time, force and position in s, N and m"
    ):
        wavesweep.identify(wrong)
    named = written(tmp_path / "counts.csv", force, np.round(places / 1e-5), "t,force_N,enc")
    found = wavesweep.identify(named, columns={"position": "enc", "time": "t"}, scales={"position": 1e-5})
    mass = found.attrs["summary"]["parameters"]["mass"]
    assert mass["low"] < 0.06 < mass["high"]
    assert (found.attrs["units"]["fitted"], found.attrs["summary"]["resolution"]) == ("m", pytest.approx(1e-5))
    turned = written(tmp_path / "wheel.csv", force, places, "time,torque,angle")
    found = wavesweep.identify(turned)
    assert {name: each["unit"] for name, each in found.attrs["summary"]["parameters"].items()} == {
        "mass": "kg*m^2",
        "damping": "N*m*s/rad",
        "delay": "tick",
        "offset": "N*m",
    }
    assert found.attrs["units"]["fitted"] == "rad"


HERTZ = np.geomspace(0.5, 100, 60)


def discrete_admittance(mass, damping, stiffness, delay):
    """Of a force held over ticks of 1 ms, from scipy's discretisation."""
    from scipy.signal import cont2discrete, freqz

    num, den, _ = cont2discrete(([1.0], [mass, damping, stiffness]), 1 / RATE)
    turn = 2 * np.pi * HERTZ / RATE
    return freqz(num.ravel(), den, turn)[1] * np.exp(-1j * turn * delay)


def test_a_frequency_response_has_the_same_numbers(tmp_path):
    """The model is scipy's, and intervals contain the truth; what a model lacks is named."""
    source, path = np.random.default_rng(3), tmp_path / "frf.csv"
    H = discrete_admittance(0.1, 1.0, 30.0, 1.5)
    assert admittance({"mass": 0.1, "damping": 1.0, "stiffness": 30.0, "delay": 1.5}, HERTZ, 1 / RATE) == pytest.approx(H)
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


def written_response(path, H):
    table = np.c_[HERTZ, np.abs(H), np.degrees(np.angle(H))]
    np.savetxt(path, table, delimiter=",", header="frequency_hz,admittance_abs,admittance_deg", comments="")


@pytest.mark.parametrize(
    ("header", "rows", "options", "said"),
    [
        ("frequency_hz,admittance_abs,admittance_deg", 60, {}, "needs the rate at which its force was held: --rate HZ"),
        (
            "frequency_hz,admittance_abs,admittance_deg",
            60,
            {"rate_hz": 1e3, "friction": True},
            "takes --rate, --spring and --del",
        ),
        (
            "frequency_hz,admittance_abs,admittance_deg",
            5,
            {"rate_hz": 1e3},
            "expected at least 8 rows of numbers below the header, found 5",
        ),
        ("frequency_hz,abs,deg", 60, {"rate_hz": 1e3}, "expected columns admittance_abs and admittance_deg, or admittance_re"),
        ("time,force,position", 60, {"rate_hz": 1e3}, "a log has its rate in its times; leave --rate out"),
    ],
)
def test_a_bad_response_is_one_message(header, rows, options, said, tmp_path):
    path = tmp_path / "frf.csv"
    np.savetxt(path, np.c_[HERTZ, HERTZ, HERTZ][:rows], delimiter=",", header=header, comments="")
    with pytest.raises(UsageError, match=said):
        wavesweep.identify(path, **options)
