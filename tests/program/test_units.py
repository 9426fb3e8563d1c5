"""Units that texts name: what each is, what is refused, and what they mean in logs, options and answers."""

import json
import math
import re
from fractions import Fraction
from pathlib import Path

import pytest

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.analyses.assumptions import unusual
from wavesweep.program.reading.units import column_named, converted, unit_in, unit_of
from wavesweep.program.spec import load

MINUTE = math.pi / 30
DEGREE = math.pi / 180
SPELLINGS = {  # by the expected unit: what turns numbers in each of these into it, exactly; None of what is refused
    "s": {"ms": "1e-3", "MS": "1e-3", "µs": "1e-6", "μs": "1e-6", "us": "1e-6", "ns": "1e-9", "Sec": 1, "min": 60}
    | dict.fromkeys(("m s", "rad", "degC", "x", "", "s" * 50, "s**999", "(s", "s)", "s/", "'s'", "1/0", "dB", "€"))
    | {"Ms": "1e6"},
    "N": {"mN": "1e-3", "MN": "1e6", "kN": "1e3", "kn": "1e3", "n": 1, "kgf": "9.80665", "kg": None, "g": None},
    "N*m": dict.fromkeys(("Nm", "N·m", "N⋅m", "N•m", "N m", "N-m", "N.m", "N_m", "nm", "NM", "J"), 1)
    | {"mNm": "1e-3", "MNM": "1e-3", "Ncm": "1e-2", "N cm": "1e-2", "oz*in": None, "kgf*cm": "0.0980665", "N": None},
    "m": {"mm": "1e-3", "MM": "1e-3", "µm": "1e-6", "inch": "0.0254", "counts": None, "deg": None, "K": None},
    "rad": {"deg": DEGREE, "°": DEGREE, "Degrees": DEGREE, "rev": 2 * math.pi, "mrad": "1e-3", "1": None, "%": None},
    "rad/s": dict.fromkeys(("rpm", "RPM", "Rpm", "r/min", "rev/min", "1/min", "min-1", "min^-1", "min⁻¹", "/min"), MINUTE)
    | dict.fromkeys(("deg/s", "°/s", "deg_s", "DEG/S", "dps", "deg·s⁻¹"), DEGREE)
    | dict.fromkeys(("U/min", "Hz", "1/s", "erpm", "ERPM", "m/s"))
    | dict.fromkeys(("rad_s", "rad_per_s", "rad s-1"), 1),
    "m/s^2": dict.fromkeys(("m/s²", "m/s2", "m_s2", "m·s⁻²"), 1) | {"mm/s^2": "1e-3", "g": None},
    "kg*m^2": dict.fromkeys(("kg·m²", "kgm^2", "kgm2", "kg m2"), 1)
    | dict.fromkeys(("g*cm^2", "gcm2", "gcm²"), "1e-7")
    | {"kg": None},
    "N*m*s/rad": {"Nms/rad": 1, "mNms/rad": "1e-3", "N*m": None, "Nms": None},
    "Hz": {"kHz": "1e3", "KHZ": "1e3", "1/s": 1, "rad/s": None, "rpm": None},
    "N/m": {"N/mm": "1e3", "kN/m": "1e3", "N*m": None, "pictures": None},
    "pictures": {"pictures": 1, "mm": None},
}


@pytest.mark.parametrize("expected", SPELLINGS)
def test_a_unit_is_what_it_is_however_it_is_written_and_nothing_of_another_dimension(expected):
    for text, size in SPELLINGS[expected].items():
        unit = unit_of(text, expected)
        if size is None:
            assert unit is None, text
        elif isinstance(size, float):
            assert float(unit.factor) == pytest.approx(size, rel=1e-15), text
        else:
            assert unit.factor == Fraction(size), text


def test_decimal_texts_are_rounded_once():
    for number in range(1, 2000):
        spec = number / 1000
        assert float(Fraction(number) * unit_of("g", "kg").factor) == spec
        assert unit_of("ms", "s").of(float(number)) == spec


@pytest.mark.parametrize(
    ("column", "expected", "text"),
    [
        ("Actual speed (rpm)", "rad/s", "rpm"),
        ("RPM", "rad/s", "RPM"),
        ("motor_erpm", "rad/s", "motor_erpm"),
        ("wheel_rad_s", "rad/s", "rad_s"),
        ("degrees", "rad", "degrees"),
        ("motor torque Nm", "N*m", "Nm"),
        ("torque [% of rated]", "N*m", "% of rated"),
        ("enc", "m", ""),
        ("h", "s", ""),
    ],
)
def test_a_column_that_is_named_has_the_unit_in_its_name(column, expected, text):
    assert unit_in(column, expected) == text


def test_columns_are_found_by_name_with_any_unit_that_fits():
    columns = ["position_error", "position_in", "Position (deg)", "Time (µs)", "pos_mm", "Torque (N·m)"]
    assert column_named(columns, ("position", "pos"), "m") == ("pos_mm", "mm")
    assert column_named(columns[:3], ("position", "pos"), "m") == ("Position (deg)", "deg")
    assert column_named(columns[:2], ("position", "pos"), "m") is None
    assert column_named(columns, ("time",), "s") == ("Time (µs)", "µs")
    assert column_named(columns, ("torque",), "N*m") == ("Torque (N·m)", "N·m")


def test_what_cannot_be_converted_is_refused_with_what_is_expected():
    assert converted(3.0, ("v", "erpm"), "log.csv", "speed", {"speed": 2.0}, "rad/s") == (6.0, "")
    with pytest.raises(
        UsageError, match=r"^log.csv: v: expected rad/s, found erpm, electrical turns: .*pole pairs.*--scale speed="
    ):
        converted(3.0, ("v", "erpm"), "log.csv", "speed", {}, "rad/s")
    with pytest.raises(UsageError, match=r"^log.csv: F: expected N or V, found oz\*in$"):
        converted(3.0, ("F", "oz*in"), "log.csv", "force", None, "N", "V")
    assert converted(3.0, ("tq", "nm"), "log.csv", "torque", {}, "N*m") == (3.0, "tq is taken as torque in Nm, times 1")
    assert converted(3.0, ("tq", "N-m"), "log.csv", "torque", {}, "N*m") == (3.0, "")


@pytest.mark.asks("identification")
def test_a_log_in_turns_a_minute_is_the_log_in_radians(tmp_path):
    from wavesweep.identification.log import read_log

    rows = [(at / 1000, math.sin(at), math.cos(at)) for at in range(60)]
    for header, columns in (("time,torque,RPM", {"speed": "RPM"}), ("Time (s),Torque (N-m),Speed (r/min)", {})):
        path = tmp_path / "log.csv"
        path.write_text("\n".join([header, *(f"{t!r},{push!r},{speed!r}" for t, push, speed in rows)]))
        log = read_log(path, columns, {})
        assert log.turns
        assert log.reading == pytest.approx([speed * MINUTE for *_, speed in rows])
        assert log.force.tolist() == [push for _, push, _ in rows]
        assert [said.split(" is taken")[0] for said in log.taken] == [header.split(",")[2]]


MASS_AND_WALL = """
[rates]
tick_hz = 1000
[numbers]
K = { value = 0.2, unit = "N/mm" }
D = 1.0
[block.m]
type = "mass"
mass = 0.1
damping = 1.5
[block.h]
type = "hold"
every = 10
[wire]
"h.u" = "1000*K*m.x + D*m.v"
"m.f" = "push - h.y"
[ports]
hand = { force = "push", displacement = "m.x", reaction = "h.y" }
wall = { stiffness = "K", damping = "D" }
[sweep]
K = { start = 0, stop = 5 }
"""


@pytest.mark.parametrize(
    ("typed", "path", "value"),
    [
        ("device.mass=45g", "device.mass", 0.045),
        ("B_VE=2 mN*s/mm", "environment.B_VE", 2.0),
        ("rates.slow_hz=0.05 kHz", "rates.ratio", 20),
        ("K=300N/m", "numbers.K", 0.3),
        ("numbers.K=300 mN/mm", "numbers.K", 0.3),
        ("rates.tick_hz=2kHz", "rates.tick_hz", 2000.0),
        ("K=2e-1", "numbers.K", 0.2),
    ],
)
def test_a_number_of_an_option_may_have_a_unit(typed, path, value, tmp_path):
    drawn = tmp_path / "drawn.toml"
    drawn.write_text(MASS_AND_WALL)
    source = drawn if path in ("numbers.K", "rates.tick_hz") else {"controller": {"kind": "pmw"}}
    assert load(source, [typed]).values[path] == value


def test_ends_of_axes_and_keys_of_blocks_and_tables_may_have_one(tmp_path):
    spec = load({"controller": {"kind": "pmw"}, "sweep": {"K_VE": {"start": 0, "stop": 1}}}, ["sweep.K_VE.stop=3N/mm"])
    assert spec.sweep[0].stop == 3000.0
    drawn = tmp_path / "drawn.toml"
    drawn.write_text(MASS_AND_WALL)
    spec = load(drawn, ["block.m.mass=45g", "sweep.K.stop=3kN/m"])
    assert (spec.tables()["block"]["m"]["mass"], spec.sweep[0].stop) == (0.045, 3.0)


@pytest.mark.asks("check", "sensitivity", "identification", "designs")
@pytest.mark.slow
def test_the_unit_of_a_number_is_its_own_and_what_is_felt_is_in_newton_a_metre(wavesweep, tmp_path, monkeypatch):
    """`1000*K` N/m of a wall K in N/mm: every answer in K is in N/mm, and what the hand feels is 1000 times as many N/m."""
    monkeypatch.chdir(tmp_path)
    Path("walls.csv").write_text("K_VE,B_VE (mN*s/mm)\n200,1\n400,1\n")
    wish = """
[design]
population = 8
generations = 1
vary = { "block.m.damping" = [1.5] }
wish = { z_width = { at_least = 0.3 }, felt = { at_least = 300 } }
"""
    Path("mine.toml").write_text(f'{MASS_AND_WALL}[measured]\nz_width = "walls.csv"\n{wish}')
    _, out, _ = wavesweep("check", "mine.toml", "--json")
    found = json.loads(out)["verdict"]
    assert found["felt"]["stiffness"] == pytest.approx(200, rel=1e-9)
    points = found["measured"]["limits"]["points"]
    assert [point["K_VE"] for point in points] == [0.2, 0.4]
    end = points[0]["computed"]
    assert 0.3 < end < 1.0
    _, out, _ = wavesweep("check", "mine.toml")
    assert "felt at rest: 200 N/m" in out
    assert f"({end:.3g} for 0.2 N/mm)" in out
    _, out, err = wavesweep("zwidth", "mine.toml", "--no-plot")
    assert f"K = {math.floor(1e6 * end) / 1e6:g} N/mm" in out + err
    assert f"at rest, at an end of an interval: {math.floor(1e3 * 1e3 * end) / 1e3:g} N/m" in out + err
    package = json.loads(Path("results/mine/zwidth.datapackage.json").read_text())
    units = {field["name"]: field.get("unit") for field in package["resources"][0]["schema"]["fields"]}
    assert (units["high"], units["felt_high"]) == ("N/mm", "N/m")
    _, out, err = wavesweep("why", "mine.toml", "--no-plot")
    felt = float(re.findall(r"felt there: ([\d.]+) N/m", out + err)[-1])
    assert felt <= 1e3 * end < felt + 1e-3  # rounded into what is stable
    _, out, err = wavesweep("design", "mine.toml", "--no-plot")
    assert f"z_width {math.floor(1e5 * end) / 1e5:g} N/mm, felt {math.floor(1e5 * end) / 1e2:g} N/m" in out + err


def test_a_spec_to_begin_with_has_the_number_in_its_own_unit():
    from wavesweep.program.cli.init import _filled as filled
    from wavesweep.program.cli.init import drawn_loops, starter

    assert "\nmass = 0.045" in starter("pmw", None, "mine.toml", ["device.mass=45g"])
    assert "J  = { value = 1e-05," in filled(drawn_loops()["drive"], "mine.toml", ["J=100 g*cm^2"])
    with pytest.raises(SpecError, match=r'device.mass: expected a number > 0, found "45N"'):
        starter("pmw", None, "mine.toml", ["device.mass=45N"])


@pytest.mark.parametrize("text", ["kg^9^9^9", "kg**0", "kg0", "kg^2^2", "kg^4", "kg" * 2000, "kg**(1/3)"])
def test_powers_that_no_unit_has_are_no_unit_wherever_they_stand(text):
    """They are told apart before anything is worked out: a tower of powers has more digits than there is memory for."""
    assert unit_of(text, "kg") is None
    assert unit_of("s", text) is None
    with pytest.raises(SpecError, match="expected a number in kg"):
        load({"controller": {"kind": "pmw"}}, [f"device.mass=1 {text}"])


@pytest.mark.parametrize(
    ("column", "expected"),
    [
        ("x_hand", "m"),
        ("pos_hand", "m"),
        ("x_link", "m"),
        ("x_foot", "m"),
        ("theta_r", "rad"),
        ("v_c", "m/s"),
        ("torque_cal", "N*m"),
    ],
)
def test_a_word_behind_a_name_is_a_part_of_it_unless_it_is_a_usual_unit(column, expected):
    name, _, _ = column.partition("_")
    assert unit_in(column, expected) == ""
    assert column_named([column], (name,), expected) is None


def test_a_usual_unit_of_another_dimension_and_a_picture_are_told_and_not_left_out():
    assert unit_in("speed_deg", "rad/s") == "deg"
    assert column_named(["position (px)"], ("position",), "m") == ("position (px)", "px")
    with pytest.raises(UsageError, match="expected m, found px; --scale position=FACTOR"):
        converted(1.0, ("position (px)", "px"), "log.csv", "position", {}, "m")


@pytest.mark.parametrize(
    ("key", "milli", "wall", "damping"), [("turns", "mNm", "N*mm/rad", "N*m*s/rad"), ("volts", "mV", "1/uF", "ohm")]
)
def test_a_hand_that_turns_is_pushed_by_a_torque_and_one_of_volts_by_a_voltage(key, milli, wall, damping, tmp_path):
    pytest.importorskip("wavesweep.simulation")
    text = MASS_AND_WALL.replace('displacement = "m.x"', f'displacement = "m.x", {key} = true').replace('"N/mm"', f'"{wall}"')
    drawn = tmp_path / "drawn.toml"
    drawn.write_text(text + "[simulate]\namplitude = 1.0\n")
    spec = load(drawn, [f"simulate.amplitude=500 {milli}"])
    assert (spec.simulate.written()["amplitude"], spec.at_port("N*s/m")) == (0.5, damping)
    unit = {"turns": r"N\*m", "volts": "V"}[key]
    with pytest.raises(SpecError, match=f"simulate.amplitude: expected a number in {unit}, found 500mN"):
        load(drawn, ["simulate.amplitude=500mN"])
    drawn.write_text(drawn.read_text().replace(f"{key} = true", "turns = true, volts = true"))
    with pytest.raises(SpecError, match="volts: expected turns or volts, found both"):
        load(drawn)


def test_a_unit_of_a_number_with_a_part_that_is_none_is_told():
    units = {"J": "Nm/foo", "n": "frames", "k": "N*m/rad", "e": "pixels/s"}
    numbers = {name: {"value": 1.0, "unit": unit} for name, unit in units.items()}
    loop = {"block": {"m": {"type": "mass", "mass": "J"}}, "wire": {"m.f": "-k*m.x - n*e*m.v"}}
    (said,) = unusual(load({"rates": {"tick_hz": 1000}, "numbers": numbers} | loop))
    assert said.startswith("J has the unit Nm/foo, of which foo is not known: ")
