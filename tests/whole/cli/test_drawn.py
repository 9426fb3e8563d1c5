"""The commands on a spec that draws its loop: tables with the units of its numbers, and refusals in a sentence."""

import json
import re

import pytest
from support.drawn import ARM, WALL

from wavesweep.program.cli import main
from wavesweep.program.results import read


@pytest.fixture
def run(tmp_path, monkeypatch, capfd):
    """Run a command on the spec in a new folder; give the exit code, what was printed, and the folder."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.toml").write_text(ARM, encoding="utf-8")
    (tmp_path / "wall.toml").write_text(WALL, encoding="utf-8")

    def run(*arguments):
        plot = [] if arguments[0] == "check" or "--plot" in arguments else ["--no-plot"]
        out = (
            []
            if arguments[0] == "check" or "--out" in arguments
            else ["--out", f"results/{arguments[1].removesuffix('.toml')}"]
        )
        code = main([*arguments, *plot, *out])
        return code, "".join(capfd.readouterr()), tmp_path / "results"

    return run


def described(path):
    package = json.loads(path.read_text(encoding="utf-8"))
    return {field["name"]: field for field in package["resources"][0]["schema"]["fields"]}, package["wavesweep"]


def test_intervals_along_a_number_have_its_unit(run):
    code, text, results = run("stability-region", "arm.toml", "--set", "sweep.kp=[60, 240]", "--set", "kd=2.5")
    assert (code, "2 slices: 2 stable intervals" in text) == (0, True)
    fields, facts = described(results / "arm" / "stability-region.datapackage.json")
    assert (fields["low"]["unit"], fields["kp"]["description"]) == ("N*s/m", "number kp of the drawing")
    assert facts["spec"]["numbers"]["c"]["description"] == "gain of the friction compensation"
    assert facts["spec"]["numbers"]["kd"]["value"] == 2.5
    columns = read(results / "arm" / "stability-region.csv")
    assert columns["kp"].tolist() == [60.0, 240.0]
    assert columns["certified"].all()


def test_the_plane_of_a_drawn_wall(run):
    code, text, results = run("zwidth", "wall.toml")
    assert (code, "all 5 rows certified" in text) == (0, True)
    assert read(results / "wall" / "zwidth.csv")["along"].tolist() == ["K"] * 5
    number = "numbers.K={ value=100, unit='N*m/rad', description='wall' }"
    rotational = ("--set", number, "--set", "ports.hand.turns=true")
    code, text, results = run("zwidth", "wall.toml", *rotational)
    assert (code, bool(re.search(r"as the hand feels it at rest: \S+ N\*m/rad with K = ", text))) == (0, True)
    fields, _ = described(results / "wall" / "zwidth.datapackage.json")
    assert {fields[name]["unit"] for name in ("low", "high", "felt_low", "felt_high")} == {"N*m/rad"}
    code, text, results = run("why", "wall.toml", *rotational)
    assert (code, "felt there: 0 N*m/rad" in text, " N/m" in text) == (0, True, False)
    rows = read(results / "wall" / "why.csv")
    assert set(rows["unit"]) == {"N*m/rad"}
    code, text, _ = run("zwidth", "wall.toml", "--set", "ports.wall={ stiffness='K', damping='K' }")
    assert (code, 'ports.wall.damping: expected another number than the stiffness, found "K"' in text) == (2, True)
    code, text, _ = run("zwidth", "arm.toml")
    assert (code, "arm.toml:24:2: ports: expected wall = {" in text) == (2, True)


DIVIDED = """
rates.tick_hz = 1000
numbers = { p = 1.0, q = 0.5, k = 10.0 }
wire = { "filter.u" = "m.x", "m.f" = "-k*filter.y + push" }
ports.hand = { force = "push", displacement = "m.x" }
block.m = { type = "mass", mass = 0.1, damping = 1.0 }
block.filter = { type = "tf", num = [1], den = ["p - q", 1] }
sweep = { k = { start = 0, stop = 100 }, p = [1.99, 3], q = { start = 1.2, stop = 3, num = 61 } }
bode = { frequency_hz = { start = 0.1, stop = 50, num = 1000 }, p = [1.99, 3], q = { start = 1.2, stop = 3, num = 61 } }
"""


@pytest.mark.slow
@pytest.mark.parametrize("command", ["stability-region", "bode", "passivity"])
def test_two_numbers_that_make_no_loop_together_are_found_before_the_work(run, tmp_path, command):
    """Each value makes one with the other's own; the combination without one is in the last of several chunks."""
    (tmp_path / "divided.toml").write_text(DIVIDED)
    said = "p = 3, q = 3 makes no loop: block.filter.den: expected a first coefficient other than 0, found 0\n"
    code, text, results = run(command, "divided.toml")
    assert (code, text, results.exists()) == (2, f"Error: {said}", False)
    code, text, _ = run("check", "divided.toml", "--all")
    assert (code, f"  {command}: not possible with this spec: {said}" in text) == (0, True)
