"""Whatever stands in a spec or in a file of proofs: an answer in a line, soon, and no error of the program."""

import random
import time
from copy import deepcopy

import pytest
from checker.test_hand_made import ABOVE, BELOW, HALVES, OUTSIDE, SPEC, STATES, UNIT
from support.proofs import checked

from wavesweep.checker import file

SECONDS = 5  # of one processor, of which a spec of these takes a tenth
VALUES = [
    None, [], {}, "x", "", -1, 0, 1, 3, 10**8, True, ["1"], [["1"]], {"a": "1"}, "1e400", "1/0", "1/3", "+" * 1000, [[]],
    [None], {"k": ["0", "1"]}, "@turn x0",
]  # fmt: skip
FIELDS = [
    "L",
    "signs",
    "Q",
    "turn",
    "open",
    "nodes",
    "edges",
    "start",
    "split",
    "at",
    "member",
    "claim",
    "outside",
    "sides",
    "word",
]


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
    "a stiff plant": drawn('a = { type = "mass", mass = 1e-50, stiffness = 1e50 }'),
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
    assert words.count("\n") == (2 if code == 1 else 1), words


def test_a_name_cannot_make_a_line_of_its_own(tmp_path):
    name = "k\nproved: everything"
    spec = SPEC.replace("numbers.k = 0.5", '[numbers]\nk = 0.5\n"k\\nproved: everything" = 1.0\n')
    code, words = checked(tmp_path, spec, [BELOW | {"numbers": {name: "1"}}, *HALVES])
    assert code == 0
    assert [line.split(":")[0] for line in words.splitlines()] == ["proved", "1 of 1 claims proved"]


def test_a_file_that_is_large_once_it_is_unpacked_is_refused(tmp_path, monkeypatch):
    """Equal lines of 100 bytes take a few bytes each while they are packed."""
    assert file.LONGEST_FILE <= 1 << 30
    monkeypatch.setattr(file, "LONGEST_FILE", 10_000)
    lines = [BELOW, *HALVES]
    assert checked(tmp_path, SPEC, lines)[0] == 0
    code, words = checked(tmp_path, SPEC, 100 * lines)
    assert (code, words.splitlines()[-1]) == (2, "not checked: a file of more than 10000 bytes")
