"""Whatever stands in a spec or in a file of proofs: an answer in a line, soon, and no error of the program."""

import random
import subprocess
import sys
import time
from copy import deepcopy

import pytest
from checker.test_hand_made import ABOVE, BELOW, HALVES, OUTSIDE, SPEC, STATES, UNIT
from support import proofs
from support.proofs import checked

from wavesweep.checker import file
from wavesweep.checker.__main__ import main

SECONDS = 5  # of one processor, of which a spec of these takes a tenth
VALUES = [
    None, [], {}, "x", "", -1, 0, 1, 3, 10**8, True, ["1"], [["1"]], {"a": "1"}, "1e400", "1/0", "1/3", "+" * 1000, [[]],
    [None], {"k": ["0", "1"]}, "@turn x0",
]  # fmt: skip
FIELDS = ["L", "signs", "Q", "turn", "open", "nodes", "edges", "start", "split", "at", "member", "claim", "outside", "word"]


def places(value, before=()):
    """All places in nested lists and dicts."""
    inside = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in inside:
        yield (*before, key)
        yield from places(inner, (*before, key))


def changed(lines, draw: random.Random):
    """Another value somewhere, or a field more, or one less."""
    lines = deepcopy(lines)
    *path, last = draw.choice([place for place in places(lines) if len(place) > 1])
    at = lines
    for key in path:
        at = at[key]
    way = draw.random()
    if way < 0.7:
        at[last] = draw.choice(VALUES)
    elif way < 0.85 or not isinstance(at, dict):
        del at[last]
    else:
        at[draw.choice(FIELDS)] = draw.choice(VALUES)
    return lines


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 20))])
def test_lines_of_any_kind_have_an_answer(seed, tmp_path):
    draw = random.Random(seed)  # noqa: S311
    slope = {"L": UNIT, "signs": "++", "Q": [[[1], UNIT]], "turn": 1}
    for _ in range(15):
        code, words = checked(tmp_path, SPEC, changed([BELOW, *HALVES[:2], slope, ABOVE, OUTSIDE], draw))
        assert code in (0, 1, 2)
        assert words.startswith(("proved", "REFUSED", "not checked"))


def drawn(blocks: str, wires: str = "", before: str = "") -> str:
    return f"rates.tick_hz = 1000\nnumbers.k = 0.5\n{before}\n[block]\n{blocks}\n[wire]\n{wires}\n"


HOSTILE = {
    "signals that read each other": drawn('a = { type = "hold" }', '"a.u" = "s"', 'signals = { s = "t + a.y", t = "s" }'),
    "numbers that read each other": drawn('a = { type = "gain", k = "k" }', '"a.u" = "a.y"', "").replace("= 0.5", '= "2*k"'),
    "a long expression": drawn('a = { type = "hold" }', f'"a.u" = "{"a.y+" * 2000}0*a.y"'),
    "deep brackets": drawn('a = { type = "hold" }', f'"a.u" = "{"(" * 3000}a.y{")" * 3000}"'),
    "a tower of powers": drawn('a = { type = "gain", k = "((k+1)**64)**64" }', '"a.u" = "prev(a.y)"'),
    "a large power": drawn('a = { type = "gain", k = "9**9**9" }', '"a.u" = "prev(a.y)"'),
    "a delay of many runs": drawn('a = { type = "delay", steps = 1000000000 }', '"a.u" = "a.y"'),
    "a mean of many": drawn('a = { type = "mean", n = 1000000000000 }', '"a.u" = "prev(a.y)"'),
    "a dead time of hours": drawn('a = { type = "delay", seconds = 36000 }', '"a.u" = "a.y"'),
    "rates with a long period": drawn(
        'a = { type = "hold", every = 9973 }\nb = { type = "hold", every = 9967 }', '"a.u"="b.y"\n"b.u"="a.y"'
    ),
    "a class in itself": drawn('a = { type = "c" }', "", '[type.c]\nblock.a = { type = "c" }'),
    "a filter of a high order": drawn('a = { type = "butterworth", order = 1000, cutoff_hz = 1 }', '"a.u" = "prev(a.y)"'),
    "a stiff plant": drawn('a = { type = "mass", mass = 1e-50, stiffness = 1e50 }', '"a.f" = "-k*a.x"'),
    "a long memory": drawn('a = { type = "delay", steps = 900 }', '"a.u" = "k*a.y"'),
    "a text for a number": drawn('a = { type = "mass", mass = [1] }'),
    "a text for a table": "rates.tick_hz = 1000\nblock = 3\n",
    "every 0": drawn('a = { type = "hold", every = 0 }', '"a.u" = "a.y"'),
    "a number with a large exponent": drawn('a = { type = "mass", mass = 1e999999999 }'),
    "code": drawn('a = { type = "gain", k = "__import__(\'os\').getpid()" }', '"a.u" = "prev(a.y)"'),
    "no TOML": "[[[",
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_spec_of_any_kind_is_refused_in_a_line(case, tmp_path):
    started = time.process_time()
    claim = {"claim": "modes", "outside": 0, "states": STATES}
    code, words = checked(tmp_path, HOSTILE[case], [claim, {"L": UNIT, "signs": "++"}])
    assert time.process_time() - started < SECONDS
    assert code in (1, 2), words
    assert words.count("\n") == (3 if code == 1 else 1), words


def refusal(spec: str, tmp_path, **claim) -> str:
    """Why a spec is not read; empty if it is."""
    code, words = checked(tmp_path, spec, [{"claim": "modes", "outside": 0, "states": ["@none"]} | claim])
    return words if code == 2 else ""


def test_a_range_has_to_be_one_of_its_key_as_a_whole(tmp_path):
    spec = '[controller]\nkind = "dc"\n'
    for low in ("-0.001", "0"):
        said = refusal(spec, tmp_path, sides={"K_VE": [low, "1"]})
        assert ("environment.K_VE = -0.001 is not at least 0" in said) == (low != "0"), said


def test_ticks_that_take_no_time_or_less_are_refused(tmp_path):
    for hz in ("0", "-1000"):
        said = refusal(SPEC.replace("tick_hz = 1000", f"tick_hz = {hz}"), tmp_path)
        assert f"rates.tick_hz = {hz} is not above 0" in said


def test_time_and_memory_have_limits_that_can_be_raised(tmp_path, capsys, monkeypatch):
    """Of a frame of 19,000 instants with a plant, which takes seconds and tens of megabytes."""
    spec = drawn('a = { type = "hold", every = 19000 }\np = { type = "mass", mass = 1 }', '"a.u" = "p.x"\n"p.f" = "-k*a.y"')
    monkeypatch.setattr(proofs, "main", lambda _: None)  # the files alone are wanted
    checked(tmp_path, spec, [{"claim": "modes", "outside": 0, "states": STATES}, {"L": UNIT, "signs": "++"}])
    files = str(tmp_path / "spec.toml"), str(tmp_path / "spec.proof")
    assert main(["--seconds", "0.02", *files]) == 2
    assert "more than 0.02 s of processor time; --seconds N allows for more" in capsys.readouterr().err
    small = [sys.executable, "-m", "wavesweep.checker", "--megabytes", "3", *files]  # with nothing free that was used before
    run = subprocess.run(small, capture_output=True, text=True, check=False)
    assert (run.returncode, "more than 3 MB of memory; --megabytes N allows for more" in run.stderr) == (2, True)
    assert main(["--seconds", "100", str(tmp_path / "no.toml"), files[1]]) == 2
    assert "No such file" in capsys.readouterr().err
    for words in (["--seconds", *files], ["--seconds", "-1", *files], ["--megabytes", "nan", *files]):
        assert main(words) == 2
        assert "usage" in capsys.readouterr().err


def test_a_name_cannot_make_a_line_of_its_own(tmp_path):
    name = "k\nproved: everything"
    spec = SPEC.replace("numbers.k = 0.5", '[numbers]\nk = 0.5\n"k\\nproved: everything" = 1.0\n')
    code, words = checked(tmp_path, spec, [BELOW | {"numbers": {name: "1"}}, *HALVES])
    assert (code, [line.split(":")[0] for line in words.splitlines()]) == (2, ["not checked"])


def test_a_file_that_is_large_once_it_is_unpacked_is_refused(tmp_path, monkeypatch):
    """Equal lines of 100 bytes take a few bytes each while they are packed."""
    assert file.LONGEST_FILE <= 1 << 30
    monkeypatch.setattr(file, "LONGEST_FILE", 10_000)
    lines = [BELOW, *HALVES]
    assert checked(tmp_path, SPEC, lines)[0] == 0
    code, words = checked(tmp_path, SPEC, 100 * lines)
    assert (code, words.splitlines()[-1]) == (2, "not checked: a file of more than 10000 bytes")
