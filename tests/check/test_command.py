"""`check` begins with the verdict on the spec's own design, in a few lines that a newcomer can read."""

import json
import re

import pytest

import wavesweep as library
from wavesweep.program.spec import SYMBOLS

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


@pytest.mark.slow
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


@pytest.mark.slow
def test_json_holds_the_verdict_and_the_plan(check):
    found = json.loads(check(flags=["--json"]))
    assert (found["command"], found["specs"]) == ("check", ["mine"])
    assert found["verdict"] == library.verdict("mine.toml")
    assert found["plan"][0].startswith("mine.toml: valid, controller pmw")
    assert {limit["name"] for limit in found["verdict"]["limits"]} <= set(SYMBOLS)


def test_the_verdict_is_printed_before_ranges_are_searched(wavesweep, tmp_path, monkeypatch):
    def limits(*_):
        raise library.UsageError("no range")

    (tmp_path / "mine.toml").write_text(DESIGN)
    monkeypatch.setattr("wavesweep.check.room_of_numbers.limits", limits)
    code, out, err = wavesweep("check", str(tmp_path / "mine.toml"))
    assert (code, out) == (2, "mine, pmw: stable (spectral radius 0.937103 per frame of 20 ms)\n")
    assert "no range" in err


@pytest.mark.asks("passive")
def test_the_value_that_makes_a_frame_too_long_is_named(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(DESIGN)
    code, _, err = wavesweep("passivity", "mine.toml", "--set", 'sweep={"rates.slow_hz"=[50,60,60.1]}')
    assert code == 2
    assert err.startswith("Error: ")
    assert "found 10000 for rates.slow_hz = 60.1; leave out these values" in err


def test_rates_that_do_not_divide_have_neighbours_that_do(wavesweep, tmp_path):
    spec = tmp_path / "mine.toml"
    spec.write_text('controller.kind = "dc-slow"\nrates = { fast_hz = 1000, slow_hz = 60 }\n')
    said = "60 Hz does not divide 1000 Hz, so that computing takes several times as long; 62.5 and 58.8235 Hz do"
    assert said in " ".join(wavesweep("check", str(spec))[1].split())
    assert "does not divide" not in wavesweep("check", str(spec), "--set", "rates.slow_hz=62.5")[1]
