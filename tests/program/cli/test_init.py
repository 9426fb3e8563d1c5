"""`init` writes a spec that loads, in which every key that the loop reads is explained, and never over another file."""

import re
from pathlib import Path

import pytest

import wavesweep as package
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.cli.init import STARTING_RECIPES, starter
from wavesweep.program.reading.keys import DEVICES
from wavesweep.program.reading.tables import study_keys
from wavesweep.program.spec import KEYS, load, sweep_axes

SWEEPS = Path(__file__).parents[3] / "sweeps"
KINDS = list(CONTROLLERS)
KEY_LINE = re.compile(r"^(#?)(\w+) = (.+)$")


@pytest.fixture
def written(tmp_path):
    """Write a starter spec and give its path and text."""

    def write(kind, device=None):
        path = tmp_path / f"{kind}-{device}.toml"
        path.write_text(starter(kind, device, path.name))
        return path, path.read_text()

    return write


def key_lines(text):
    """(number of the line, path, whether it is a comment) of every key in a text."""
    table = ""
    for number, line in enumerate(text.splitlines()):
        if heading := re.fullmatch(r"\[([\w.]+)\]", line):
            table = heading[1]
        elif found := KEY_LINE.fullmatch(line):
            yield number, f"{table}.{found[2]}", bool(found[1])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("device", [None, *DEVICES])
def test_the_spec_loads_and_has_a_sweep(kind, device, written):
    path, _ = written(kind, device)
    spec = load(path)
    assert (spec.values["controller.kind"], spec.preset) == (kind, device)
    along, others = sweep_axes(spec, "K_VE")
    assert (along.stop, [axis.name for axis in others]) == (5000, ["B_VE", *(["b"] if kind.startswith("pmw") else [])])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("device", [None, "desktop"])
def test_every_key_is_explained_with_its_unit(kind, device, written):
    _, text = written(kind, device)
    lines = text.splitlines()
    for number, path, _ in key_lines(text):
        study, _, axis = path.partition(".")
        key = KEYS.get(path) or study_keys().get(path) or next(key for p, key in KEYS.items() if p.endswith(f".{axis}"))
        prose = []
        while lines[number := number - 1].startswith("# "):
            prose.insert(0, lines[number][2:])
        assert key.description in " ".join(prose), (path, study)
        assert key.unit in ("", "1") or f"{key.unit}: " in " ".join(prose)


@pytest.mark.parametrize("kind", KINDS)
def test_the_keys_are_those_that_the_loop_reads(kind, written):
    path, text = written(kind)
    read = keys_of_page({**load(path).values, "controller.Kp": 1.0})
    shown = {path for _, path, _ in key_lines(text) if path in KEYS}
    assert shown == {path.replace("rates.ratio", "rates.slow_hz") for path in read}


@pytest.mark.slow
@pytest.mark.whole
def test_an_example_is_written_as_it_is(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert wavesweep("init", "--example", "first-hour") == (0, "", "first-hour.toml\n")
    assert Path("first-hour.toml").read_text() == (SWEEPS / "examples" / "first-hour.toml").read_text()
    code, _, said = wavesweep("init", "first-our")
    assert code == 2
    assert "did you mean first-hour?" in said
    assert wavesweep("check", "first-hour.toml", "--strict", "-q")[0] == 0
    assert wavesweep("check", "first-hour.toml", "--strict", "-q", "--set", "K_VE=1000")[0] == 1


TO_BEGIN_WITH = sorted(path.stem for path in (SWEEPS / "templates").glob("*.toml")) + list(STARTING_RECIPES)


@pytest.mark.whole
@pytest.mark.slow
@pytest.mark.parametrize("name", TO_BEGIN_WITH)
def test_a_drawn_loop_to_begin_with_is_stable_and_proved(name, wavesweep, tmp_path, monkeypatch):
    """It needs no change for the questions that its comment asks, and is not at its limit; each number has a meaning."""
    monkeypatch.chdir(tmp_path)
    assert wavesweep("init", name) == (0, "", f"{name}.toml\n")
    text = Path(f"{name}.toml").read_text()
    assert "sweeps/" not in text
    code, said, _ = wavesweep("check", f"{name}.toml", "--strict")
    assert (code, "not certified" in said) == (0, False)
    for words in re.findall(r"^#     wavesweep (.*)$", text, re.MULTILINE):
        assert wavesweep(*words.split(), "-q")[0] == 0
    assert wavesweep("simulate", f"{name}.toml", "-q")[0] == 0
    spec = load(f"{name}.toml")
    assert all(description for _, _, description in spec.drawing.numbers)
    along, _ = sweep_axes(spec, spec.along)
    rows = package.compile(spec).stable_intervals(along.name, (along.start, along.stop))
    assert rows.low.max(skipna=False) <= spec.values[along.path] / 1.04  # the recipe of an arm is at 1.045 times its limit
    assert spec.values[along.path] * 1.04 <= rows.high.min(skipna=False)


@pytest.mark.whole
def test_numbers_are_put_into_a_drawn_loop(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert wavesweep("init", "drive", "--set", "J=0.01", "--set", "numbers.kp=2e1")[0] == 0
    mine, shipped = load("drive.toml"), load(SWEEPS / "templates" / "drive.toml")
    assert dict(mine.values) == {**shipped.values, "numbers.J": 0.01, "numbers.kp": 20.0}
    for setting, said in (("j=1", "did you mean J?"), ("J=-1", "expected a number > 0"), ("J", "found no `=`")):
        code, _, err = wavesweep("init", "drive", "--set", setting, "--out", "other.toml")
        assert (code, said in err, Path("other.toml").exists()) == (2, True, False)
    assert wavesweep("init", "drive", "--device", "touch", "--out", "-")[0] == 2
    assert wavesweep("init", "physics-joint", "--set", "block.velocity.method=implicit")[0] == 0
    words = [(each.name, dict(each.keys)["method"]) for each in load("physics-joint.toml").drawing.blocks]
    assert dict(words)["velocity"] == "implicit"
    assert wavesweep("init", "first-hour", "--set", "b=60", "--set", "rates.ratio=40")[0] == 0
    assert [load("first-hour.toml").values[path] for path in ("controller.b", "rates.ratio")] == [60, 40]


def test_an_existing_file_is_replaced_by_force_only(wavesweep, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pmw.toml").write_text("mine")
    code, out, err = wavesweep("init")
    assert (code, out) == (2, "")
    assert err == "Error: pmw.toml: the file exists; expected another --out FILE, or --overwrite to replace it\n"
    assert Path("pmw.toml").read_text() == "mine"
    assert wavesweep("init", "--overwrite") == (0, "", "pmw.toml\n")
    assert load("pmw.toml").name == "pmw"
    assert [path.name for path in tmp_path.iterdir()] == ["pmw.toml"]
