"""`check` begins with the verdict on the spec's own design, in a few lines that a newcomer can read."""

import json
import re

import pytest

import wavesweep as library
from wavesweep.check.command import _places
from wavesweep.check.room_of_numbers import limits
from wavesweep.program.spec import SYMBOLS, load

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


@pytest.mark.parametrize(
    ("out", "settings", "place"),
    [
        (None, ("b=10.5",), "results/mine,b=10.5/check.proof"),
        ("run.1", (), "run.1/check.proof"),
        ("there/loop.svg", (), "there/check.proof"),
        ("folder.svg", (), "folder.svg/check.proof"),
    ],
    ids=["a number with a point", "a folder's name with a point", "beside pictures", "a folder named as a picture"],
)
def test_a_proof_goes_to_the_folder_of_the_pictures(out, settings, place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(DESIGN)
    (tmp_path / "folder.svg").mkdir()
    places = _places(["diagram", "timing"], out, load("mine.toml", settings), settings, proof=True)
    assert places["proof"].as_posix() == place
    assert {path.parent.as_posix() for path in places.values()} == {place.removesuffix("/check.proof")}


def test_a_slow_rate_that_is_taken_as_a_fraction_is_said_so(wavesweep, tmp_path):
    (tmp_path / "mine.toml").write_text('[controller]\nkind = "dc-slow"\n')
    said = "rates.slow_hz = 285.7142857142857 is taken as 2000/7 Hz, a frame of 7/2 ticks"
    for rate, is_said in (("285.7142857142857", True), ("400", False), ("100", False)):
        _, out, _ = wavesweep("check", str(tmp_path / "mine.toml"), "--set", f"rates.slow_hz={rate}")
        assert (said in out) == is_said
        assert ("is taken as" in out) == is_said


@pytest.mark.parametrize(("first", "late"), [("0.0013", "3.4 ms late, not 2.7"), ("0.002", "")])
def test_a_dead_time_that_another_one_reads_is_named(first, late, wavesweep, tmp_path):
    """What is held waits for a tick between them, if the first ends between two: the age says the same."""
    loop = """
        rates.tick_hz = 1000
        numbers.K = 100.0
        block.m = { type = "mass", mass = 1.0, damping = 20.0 }
        block.h = { type = "hold" }
        block.a = { type = "delay", seconds = FIRST }
        block.b = { type = "delay", seconds = 0.0014 }
        wire = { h.u = "-K*m.x", a.u = "h.y", b.u = "a.y", m.f = "b.y" }
    """
    (tmp_path / "mine.toml").write_text(loop.replace("FIRST", first))
    _, out, _ = wavesweep("check", str(tmp_path / "mine.toml"))
    said = " ".join(out.split())
    assert ("a and b are dead times in series" in said) == bool(late)
    assert late in said
    assert "in place 3.4 ms after" in said


@pytest.mark.slow
def test_the_range_of_a_cutoff_ends_in_numbers_of_json():
    loop = {
        "rates": {"tick_hz": 4000},
        "numbers": {"f": 400.0},
        "block": {
            "m": {"type": "mass", "mass": 1, "damping": 1},
            "lp": {"type": "butterworth", "order": 2, "cutoff_hz": "f"},
        },
        "wire": {"lp.u": "m.v", "m.f": "-10*lp.y"},
    }
    (found,) = limits(library.load(loop))
    assert json.loads(json.dumps(found)) == found
