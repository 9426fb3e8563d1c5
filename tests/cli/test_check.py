"""`check` begins with the verdict on the spec's own design, in a few lines that a newcomer can read."""

import json
import re

import pytest

import wavesweep as library
from wavesweep.cli import messages
from wavesweep.spec import SYMBOLS

DESIGN = """
[controller]
kind = "pmw"
b = 10.0
[environment]
integration = "explicit"
delay = 1
[device]
velocity = "difference"
"""


@pytest.fixture
def check(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(DESIGN)

    def run(*settings, flags=()):
        code, out, err = wavesweep("check", "mine.toml", *(word for each in settings for word in ("--set", each)), *flags)
        assert (code, err) == (0, "")
        return out

    return run


def test_a_stable_design_is_told_its_room_and_its_feel(check):
    lines = check().splitlines()
    end = next(number for number, line in enumerate(lines) if line.startswith("mine.toml: valid"))
    assert lines[:end] == [
        "mine, pmw: stable (spectral radius 0.937103 per frame of 20 ms)",
        "  K_VE = 500 N/m, the default: stable from 0 to 798.521 N/m (it may rise to 160 %)",
        "  b = 10 N*s/m: stable from 7.36189 to 47.7852 N*s/m (it may fall to 73.6 % and rise to 478 %)",
        "  stable at every value searched: B_VE 0 to 10 N*s/m, Kp 0 to 200 N^(1/2)*m^(-1/2)*s^(-1/2)",
        "  delay = 1 of 20 ticks: stable up to 8 ticks",
        (
            "  felt at rest: 293.093 N/m (295.2 at 1 Hz, 312.1 at 3 Hz, 534.6 at 10 Hz; within a tenth of it up to 3.72 Hz; "
            "free motion outweighs it from 10.3 Hz on)"
        ),
        (
            "  slowest mode: falls to 1/e in 0.3079 s, damping ratio 0.0785, 6.565 Hz; "
            "most in avatar position, filter lp1, device velocity"
        ),
        "  wave channel: norm 1.053277 (passive up to 1)",
        "  assumes: explicit integration of the wall, delay of 1 of 20 ticks, velocity from differences of position",
    ]


def test_the_states_have_words_at_rates_that_do_not_divide_too(check):
    line = next(line for line in check("rates.slow_hz=60", "Kp=20").splitlines() if "states: " in line)
    assert "states: device velocity, device position, velocity input of the last run, filter lp1, avatar position, " in line
    assert ", v_1_shown held" in line


def test_numbers_that_a_preset_gives_otherwise_are_named_where_a_design_is_judged(check):
    settings = "device.preset=touch", "device.mass=0.1"
    said = "the spec takes precedence over the preset touch: device.mass = 0.1 and not 0.045"
    assert f"\n  {said}\n" in check(*settings)
    assert json.loads(check(*settings, flags=["--json"]))["notices"] == [said]


def test_the_ends_in_the_lines_are_those_of_stability(check):
    """The spectral radius, computed by another way, crosses 1 at each end that a line names."""
    loop = library.compile("mine.toml")
    ends = re.findall(r"^  (K_VE|b) = .*?: stable from ([\d.]+) to ([\d.]+) ", check(), re.MULTILINE)
    assert [name for name, _, _ in ends] == ["K_VE", "b"]
    for name, low, high in ends:
        inside, outside = loop.spectral_radius(**{name: [float(high) * (1 - 1e-4), float(high) * (1 + 1e-4)]})
        assert inside < 1 < outside
        if float(low):
            outside, inside = loop.spectral_radius(**{name: [float(low) * (1 - 1e-4), float(low) * (1 + 1e-4)]})
            assert inside < 1 < outside


def test_an_unstable_design_is_called_so_and_shown_the_way_back(check):
    out = check("K_VE=900")
    assert out.startswith("mine, pmw: UNSTABLE (spectral radius 1.")
    assert "\n  K_VE = 900 N/m: stable in 0 to 798.521 N/m\n" in out
    assert "\n  delay = 1 of 20 ticks: unstable at this delay\n" in out
    assert "slowest mode" not in out
    assert "felt" not in out


def test_a_loop_without_waves_and_slow_environment_has_fewer_lines(check):
    out = check("controller.kind=dc")
    assert "  wave channel:" not in out
    assert "delay =" not in out
    assert "  felt at rest: 500 N/m (" in out


@pytest.mark.slow
def test_json_holds_the_verdict_and_the_plan(check):
    found = json.loads(check(flags=["--json"]))
    assert (found["command"], found["specs"]) == ("check", ["mine"])
    assert found["verdict"] == library.verdict("mine.toml")
    assert found["plan"][0].startswith("mine.toml: valid, controller pmw")
    assert {limit["name"] for limit in found["verdict"]["limits"]} <= set(SYMBOLS)


def test_a_check_that_takes_long_says_that_it_is_at_work(wavesweep, tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text(DESIGN)
    monkeypatch.setattr(messages, "FIRST_WORD", 0.0)
    for quiet in ((), ("--quiet",)):
        code, _, err = wavesweep("check", str(tmp_path / "mine.toml"), *quiet)
        assert (code, "still at work" in err) == (0, not quiet)


def test_the_verdict_is_printed_before_ranges_are_searched(wavesweep, tmp_path, monkeypatch):
    def limits(*_):
        raise library.UsageError("no range")

    (tmp_path / "mine.toml").write_text(DESIGN)
    monkeypatch.setattr("wavesweep.sweep.verdict.limits", limits)
    code, out, err = wavesweep("check", str(tmp_path / "mine.toml"))
    assert (code, out) == (2, "mine, pmw: stable (spectral radius 0.937103 per frame of 20 ms)\n")
    assert "no range" in err


def test_the_plan_says_how_long_passivity_of_several_chunks_takes(check):
    """A short table, which is one chunk, has no such line."""
    lines = check("sweep.b=[5,10]").splitlines()
    assert not any(line.startswith("    work") for line in _after(lines, "  passivity"))
    lines = check("sweep.b={start=5,stop=50,num=100}").splitlines()
    assert re.fullmatch(
        r"    work: \d+ chunks, about [\d.]+ s; disk: about [\d.]+ MB until .*", _after(lines, "  passivity")[0]
    )


def _after(lines, start):
    """The line after the one that begins so, in a list."""
    return lines[next(number for number, line in enumerate(lines) if line.startswith(start)) + 1 :][:1]


def test_a_frame_that_is_too_long_for_passivity_is_said(check):
    lines = check("rates.fast_hz=1001", "rates.slow_hz=60").splitlines()
    assert [line for line in lines if "passivity" in line and "1001" in line] == [
        "  passivity: not possible with this spec: expected a frame of at most 1000 ticks for passivity, found 1001"
    ]
    assert "pmw" in lines[0]


def test_the_value_that_makes_a_frame_too_long_is_named(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(DESIGN)
    code, _, err = wavesweep("passivity", "mine.toml", "--set", 'sweep={"rates.slow_hz"=[50,60,60.1]}')
    assert code == 2
    assert err.startswith("Error: ")
    assert "found 10000 for rates.slow_hz = 60.1; leave out these values" in err


def test_a_block_that_nothing_reads_is_named(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mass = '[block.m]\ntype = "mass"\nmass = 1.0\n[block.g]\ntype = "hold"\nevery = 5\n[wire]\n'
    drawn = "[rates]\ntick_hz = 1000\n[numbers]\nk = 1.0\n" + mass
    for gain, said in (("-k*m.x - 0.1*m.v", True), ("-k*m.x - 0.1*m.v - g.y", False)):
        (tmp_path / "mine.toml").write_text(drawn + f'"m.f" = "{gain}"\n"g.u" = "m.v"\n')
        code, out, _ = wavesweep("check", "mine.toml")
        assert code == 0
        assert ("nothing reads g, which counts for stability all the same" in out) == said


@pytest.mark.thorough
def test_a_motion_that_nothing_brakes_leaves_a_design_unknown(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    masses = '[block.a]\ntype = "mass"\nmass = 0.3\n[block.b]\ntype = "mass"\nmass = 0.5\n'
    wires = '"a.f" = "kp*b.x - kp*a.x + 2*b.v - 2*a.v"\n"b.f" = "kp*a.x - kp*b.x + 2*a.v - 2*b.v"\n'
    spec = f"[rates]\ntick_hz = 1000\n[numbers]\nkp = 50\n{masses}[wire]\n{wires}[sweep]\nkp = {{ start = 0, stop = 5000 }}\n"
    for text, said in ((spec, True), (spec.replace("mass = 0.5", "mass = 0.5\ndamping = 0.1"), False)):
        (tmp_path / "free.toml").write_text(text)
        out = wavesweep("check", "free.toml")[1]
        assert ("not known whether it is stable" in out) == said
