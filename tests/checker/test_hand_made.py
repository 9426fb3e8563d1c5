"""A proof by hand. The loop turns by k and shrinks to a half: its modes 0.5 +- k j leave the circle at k = sqrt(0.75)."""

import gzip
from copy import deepcopy

import pytest
from support.proofs import checked, checked_file

from wavesweep.checker import file, frame
from wavesweep.checker.reader import expressions

SPEC = """
rates.tick_hz = 1000
numbers.k = 0.5
[block.turn]
type = "ss"
discrete = true
inputs = []
A = [["0.5", "k"], ["-k", "0.5"]]
C = [[1, 0]]
"""
STATES = ["@turn x0", "@turn x1"]
UNIT = [["1", "0"], ["0", "1"]]
BELOW = {"claim": "modes", "sides": {"k": ["0", "0.86602"]}, "outside": 0, "states": STATES}
ABOVE = {"claim": "modes", "sides": {"k": ["0.86603", "2"]}, "outside": 2, "states": STATES}
WITHIN = {"L": UNIT, "signs": "++"}
OUTSIDE = {"L": UNIT, "signs": "--"}
HALVES = [{"split": "k", "at": "0.5"}, WITHIN, WITHIN]


def test_both_sides_of_an_end_are_proved(tmp_path):
    code, words = checked(tmp_path, SPEC, [BELOW, WITHIN, ABOVE, OUTSIDE])
    assert code == 0
    assert words == (
        "proved: the spec's own loop, k from 0 to 0.86602: all 2 modes are inside the unit circle, stable\n"
        "proved: the spec's own loop, k from 0.86603 to 2: 2 modes are outside the unit circle, unstable\n"
        "2 of 2 claims proved\n"
        "k from 0 to 0.86602: proved stable all over; k from 0.86603 to 2: proved unstable all over\n"
    )


def test_a_claim_that_is_refused_says_where_and_leaves_the_others(tmp_path):
    code, words = checked(tmp_path, SPEC, [BELOW | {"sides": {"k": ["0", "0.8661"]}}, *HALVES, ABOVE, OUTSIDE])
    assert code == 1
    refused, proved, count, covered = words.splitlines()
    assert refused.startswith("REFUSED: the spec's own loop, k from 0 to 0.8661: ")
    assert refused.endswith("the form for k from 0.5 to 0.8661 does not decrease")
    assert proved.startswith("proved")
    assert count == "1 of 2 claims proved"
    assert covered.startswith("k from 0 to 0.8661: NOT COVERED to 0.86603 (99.99 %), unstable from 0.86603;")


INSIDE = {"claim": "modes", "numbers": {"k": "0.7243"}, "outside": 0, "states": STATES}  # of modes of size 0.880119


def test_modes_are_within_a_circle_of_another_radius(tmp_path):
    for radius, outside in (("0.88012", 0), ("0.88011", 2), ("3", 0)):
        lines = [INSIDE | {"radius": radius, "outside": outside}, {"L": UNIT, "signs": "-+"[not outside] * 2}]
        code, words = checked(tmp_path, SPEC, lines)
        assert code == 0, words
        assert f"side the circle of radius {radius} in each period of its rates\n" in words
        assert f"own numbers within a circle of radius {radius} in each period of its rates at k = 0.7243: proved " in words


REFUSED = {  # lines that do not show what they claim
    "end": [BELOW | {"sides": {"k": ["0", "0.86603"]}}, WITHIN],
    "count": [BELOW | {"outside": 1}, WITHIN],
    "sign": [BELOW, WITHIN | {"signs": "+-"}],
    "signs and count": [BELOW | {"outside": 1}, WITHIN | {"signs": "+-"}],
    "a cell less": [BELOW, HALVES[0], WITHIN],
    "no cell": [BELOW],
    "a cell more": [BELOW, WITHIN, WITHIN],
    "another form": [BELOW, WITHIN | {"L": [["1", "0"], ["0", "9"]]}],
    "a singular form": [BELOW, WITHIN | {"L": [["1", "0"], ["1", "0"]]}],
    "a slope": [BELOW, WITHIN | {"Q": [[[1], [["0.9", "0"], ["0", "0.9"]]]]}],
    "a cut outside": [BELOW, {"split": "k", "at": "1"}, WITHIN, WITHIN],
    "a cut of another number": [BELOW, {"split": "j", "at": "0.5"}, WITHIN, WITHIN],
    "another state": [BELOW | {"states": ["@turn x0", "@turn y"]}, WITHIN],
    "a state less": [BELOW | {"states": ["@turn x0"]}, {"L": [["1"]], "signs": "+"}],
    "a drift that is none": [BELOW | {"drifts": [["@turn x0"]], "states": ["@turn x1"]}, {"L": [["1"]], "signs": "+"}],
    "open": [BELOW, {"open": True}],
    "another number": [BELOW | {"sides": {}, "numbers": {"k": "0.9"}}, WITHIN],
    "a graph of one frame": [BELOW, {"nodes": [{"L": UNIT}], "edges": [[0, "", 0]]}],
    "a circle within the modes": [INSIDE | {"radius": "0.88"}, WITHIN],
    "no mode outside": [{"claim": "refuted", "numbers": {"k": "0.5"}, "outside": 0, "states": STATES}, WITHIN],
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_follow_is_refused(case, tmp_path):
    code, words = checked(tmp_path, SPEC, REFUSED[case])
    assert code == 1, words
    assert words.startswith("REFUSED"), words


@pytest.mark.parametrize("turn", [-1, 0, 1])
def test_a_form_may_be_looked_at_turned(turn, tmp_path):
    near = BELOW | {"sides": {"k": ["0.1", "0.11"]}}
    assert checked(tmp_path, SPEC, [near, WITHIN | {"turn": turn}])[0] == 0
    near = ABOVE | {"sides": {"k": ["1000", "1001"]}}
    assert checked(tmp_path, SPEC, [near, OUTSIDE | {"turn": turn}])[0] == 0


UNREADABLE = {
    "an unknown field": [BELOW | {"trust": True}, WITHIN],
    "an unknown field of a cell": [BELOW, WITHIN | {"proved": True}],
    "an unknown kind": [BELOW | {"claim": "stable"}, WITHIN],
    "a number as a number": [BELOW | {"sides": {"k": [0, 1]}}, WITHIN],
    "a float": [BELOW | {"outside": 0.0}, WITHIN],
    "a number with a large exponent": [BELOW | {"sides": {"k": ["0", "1e999999999"]}}, WITHIN],
    "a long number": [BELOW | {"sides": {"k": ["0", "1" * 100]}}, WITHIN],
    "no number": [BELOW | {"sides": {"k": ["0", "nan"]}}, WITHIN],
    "a matrix of another size": [BELOW, WITHIN | {"L": [["1"]]}],
    "a sign of another kind": [BELOW, WITHIN | {"signs": "+0"}],
    "a number that is not there": [BELOW | {"numbers": {"j": "1"}}, WITHIN],
    "sides that end before they begin": [BELOW | {"sides": {"k": ["1", "0"]}}, WITHIN],
    "an exponent that is none": [BELOW, WITHIN | {"Q": [[[4], UNIT]]}],
    "a turn that is none": [BELOW, WITHIN | {"turn": 2}],
    "a turn that is true": [BELOW, WITHIN | {"turn": True}],
    "an exponent too many": [BELOW, WITHIN | {"Q": [[[1, 0], UNIT]]}],
    "an exponent of no side": [BELOW, WITHIN | {"Q": [[[0], UNIT]]}],
    "a side that is a number too": [BELOW | {"numbers": {"k": "1"}}, WITHIN],
    "a count of a map": [BELOW | {"open": True}, WITHIN],
    "a map of frames": [BELOW | {"claim": "for all", "open": True, "outside": None}, WITHIN],
    "a word of modes": [BELOW | {"word": ["n=3"]}, WITHIN],
    "a circle without a radius": [BELOW | {"radius": "0"}, WITHIN],
    "a circle of what is refuted": [BELOW | {"claim": "refuted", "radius": "1"}, WITHIN],
    "forces of modes": [BELOW | {"forces": ["1"]}, WITHIN],
    "a motion without forces": [{"claim": "goes on", "sides": BELOW["sides"], "states": STATES}],
    "ticks of modes": [BELOW | {"ticks": ["1"]}, WITHIN],
    "a rest of modes": [BELOW | {"rest": ["@turn x0"]}, WITHIN],
    "a name twice in a drift": [BELOW | {"drifts": [["@turn x0", "@turn x0"]]}, WITHIN],
    "a drift of nothing": [BELOW | {"drifts": [[]]}, WITHIN],
    "a cell before its claim": [WITHIN, BELOW],
    "a factor without a cut": [BELOW | {"cut": "turn.y"}, WITHIN],
    "a gain of modes": [BELOW | {"gain": {"from": "a", "to": "b", "at_most": "1"}}, WITHIN],
    "a gain that is none": [{"claim": "gain", "states": STATES}, WITHIN],
    "a number of a form that is too large": [BELOW, WITHIN | {"L": [["1e101", "0"], ["0", "1"]]}],
    "a number of a form that is too small": [BELOW, WITHIN | {"L": [["1e-101", "0"], ["0", "1"]]}],
    "a number of a form that is too long": [BELOW, WITHIN | {"L": [["1" * 61, "0"], ["0", "1"]]}],
    "what is for all with a word": [{"claim": "for all", "word": ["n=3"], "states": STATES}, WITHIN],
    "a member that has more": [BELOW | {"claim": "for all"}, {"member": {}, "more": 1}],
    "seven sides": [BELOW | {"sides": {f"k{number}": ["0", "1"] for number in range(7)}}, WITHIN],
    "nested without an end": [BELOW, {"L": eval("[" * 60 + "]" * 60)}],  # noqa: S307
}


@pytest.mark.parametrize("case", UNREADABLE)
def test_what_is_no_proof_file_is_an_error(case, tmp_path):
    code, words = checked(tmp_path, SPEC, UNREADABLE[case])
    assert code == 2, words
    assert words.startswith("not checked: "), words


def test_a_proof_is_about_one_spec_and_whole(tmp_path):
    lines = [BELOW, WITHIN, ABOVE, OUTSIDE]
    assert checked(tmp_path, SPEC, lines, {"sha256": "0" * 64}) == (
        2,
        "not checked: the proof is about another spec: its SHA-256 differs\n",
    )
    assert checked(tmp_path, SPEC, lines, {"claims": 3})[0] == 2
    assert checked(tmp_path, SPEC, [])[0] == 2
    for header in ({"format": "wavesweep proof 1"}, {"more": 1}):
        assert checked(tmp_path, SPEC, lines, header)[0] == 2
    for text in (gzip.compress(b"[]\n"), gzip.compress(b'{"format": 1, "format": 1}\n'), b"{}\n", gzip.compress(b"{\n")):
        (tmp_path / "other.proof").write_bytes(text)
        code, words = checked_file(tmp_path / "spec.toml", tmp_path / "other.proof")
        assert (code, words.count("\n"), "has no format" in words) == (2, 1, False), words
    (tmp_path / "spec.proof").write_bytes((tmp_path / "spec.proof").read_bytes()[:-30])
    assert checked_file(tmp_path / "spec.toml", tmp_path / "spec.proof")[0] == 2


LIMITS = [
    (file, "CELLS", 3), (file, "LONGEST_SPEC", len(SPEC)), (file, "SIDES", 1), (frame, "LARGEST", 2), (frame, "INSTANTS", 1),
    (expressions, "LONGEST", 3),
]  # fmt: skip


@pytest.mark.parametrize(("module", "name", "least"), LIMITS)
def test_limits_are_those_that_are_told(module, name, least, tmp_path, monkeypatch):
    """Each holds what is just as large, and nothing that is larger."""
    for limit, wrong in ((least, False), (least - 1, True)):
        monkeypatch.setattr(module, name, limit)
        assert (checked(tmp_path, SPEC, [BELOW, *HALVES])[0] != 0) == wrong


def test_a_map_says_shares(tmp_path):
    claim = {"claim": "modes", "open": True, "sides": {"k": ["0", "2"]}, "states": STATES}
    tree = [{"split": "k", "at": "0.8"}, WITHIN, {"split": "k", "at": "0.9"}, {"open": True}, OUTSIDE]
    code, words = checked(tmp_path, SPEC, [claim, *tree])
    assert code == 0
    assert "40 % stable, 55 % 2 modes outside, 5 % open" in words


TWO_NUMBERS = (
    SPEC.replace("0.5, k", "a, k").replace('"0.5"', '"a"').replace("numbers.k = 0.5", "numbers = { k = 0.5, a = 0.5 }")
)


@pytest.mark.parametrize(("most", "code"), [("0.7", 0), ("0.72", 1)])
def test_two_numbers_at_once(most, code, tmp_path):
    """Modes a +- k j are inside while a^2 + k^2 < 1."""
    claim = {"claim": "modes", "outside": 0, "sides": {"a": ["-0.7", "0.7"], "k": ["0", most]}, "states": STATES}
    tree = [{"split": "k", "at": "0.5"}, WITHIN, {"split": "a", "at": "0"}, WITHIN, WITHIN]
    assert checked(tmp_path, TWO_NUMBERS, [claim, *deepcopy(tree)])[0] == code


DRIFTING = """
rates.tick_hz = 1000
numbers.g = 0.5
[block]
free = { type = "integrator", method = "implicit" }
slow = { type = "lowpass", a = "g" }
[wire]
"free.u" = "slow.y"
"slow.u" = "0.5*slow.y"
"""


def test_a_drift_is_set_aside_if_every_equation_keeps_it(tmp_path):
    claim = {"claim": "modes", "outside": 0, "sides": {"g": ["0.1", "1"]}, "states": ["@slow y"]}
    cells = [{"split": "g", "at": "0.4"}, {"L": [["1"]], "signs": "+"}, {"L": [["1"]], "signs": "+"}]
    code, words = checked(tmp_path, DRIFTING, [claim | {"drifts": [["@free integral", "free.y", "@held free.y"]]}, *cells])
    assert code == 0
    assert "the only mode is inside the unit circle, stable (1 drift set aside, which nothing opposes)" in words
    assert checked(tmp_path, DRIFTING, [claim | {"drifts": [["@free integral"]]}, *cells])[0] == 1


TURNED = SPEC.replace('["0.5", "k"], ["-k", "0.5"]', '[1.5, "-k"], ["-k", 1.5]').replace(
    "[[1, 0]]", "[[1, -1]]"
)  # modes 1 and 2


@pytest.mark.parametrize("again", [["@turn x1", "@turn x0"], ["@turn x0", "@turn x1"], ["@turn x1"]])
def test_a_drift_is_set_aside_once(again, tmp_path):
    """Both memories keep each other: with either of them first it is one direction, and the other mode is left."""
    claim = {"claim": "modes", "outside": 1, "drifts": [["@turn x0", "@turn x1"]], "states": ["@turn x1"]}
    assert checked(tmp_path, TURNED, [claim, {"L": [["1"]], "signs": "-"}])[0] == 0
    turned = {"claim": "modes", "outside": 1, "states": STATES}, {"L": UNIT, "signs": "+-", "turn": -1}
    assert "a frame that cannot be turned" in checked(tmp_path, TURNED, turned)[1]
    claim |= {"outside": 0, "drifts": [["@turn x0", "@turn x1"], again], "states": []}
    code, words = checked(tmp_path, TURNED, [claim, {"L": [], "signs": ""}])
    assert (code, "no memory of its own" in words or "not every equation keeps" in words) == (1, True), words


def test_a_sum_that_goes_on_with_a_drift_is_none_where_it_is_read(tmp_path):
    """x0+ = x0 + x1, x1+ = x1 grows for ever; what is only shown may do so."""
    spec = SPEC.replace('["0.5", "k"], ["-k", "0.5"]', '[1, "k"], [0, 1]') + '[block]\nlag = { type = "lowpass", a = 0.5 }\n'
    spec += '[wire]\n"lag.u" = "turn.y"\n'
    claim = {"claim": "modes", "outside": 0, "states": ["@lag y"]}
    for first in (["@turn x0", "turn.y", "lag.y", "@lag y"], ["@turn x0"]):
        code, words = checked(tmp_path, spec, [claim | {"drifts": [first, ["@turn x1"]]}, {"L": [["1"]], "signs": "+"}])
        assert (code, "not every equation keeps the drift of" in words) == (1, True), words


# The integral of one - two: both rest at g times the integral, whatever g is.
BALANCED = """
rates.tick_hz = 1000
numbers = { g = 0.5, h = 0.5 }
[block]
free = { type = "integrator", method = "implicit" }
one = { type = "lowpass", a = "0.5" }
two = { type = "lowpass", a = "sqrt(2*h)/4*sqrt(2*h)/h" }
[wire]
"free.u" = "one.y - two.y"
"one.u" = "g*free.y"
"two.u" = "g*free.y"
"""
OUTPUTS = [f"{at}{name}.y" for name in ("free", "one", "two") for at in ("", "@held ")]
IN_BALANCE = ["@free integral", *OUTPUTS, "@one y", "@two y"]
LEFT = {"claim": "modes", "outside": 0, "sides": {"g": ["0.1", "1"]}, "states": ["@one y", "@two y"]}
CONSTANT = {"L": [["1", "0"], ["0", "1"]], "signs": "++"}


@pytest.mark.parametrize(
    ("wire", "drift", "why"),
    [
        ("g*free.y", IN_BALANCE, ""),
        ("(sin(h)**2 + cos(h)**2)*g*free.y", IN_BALANCE, ""),
        ("g*free.y", IN_BALANCE[:-2], "not every equation keeps the drift of @free integral"),
        ("g*free.y", ["free.y", "@free integral", *IN_BALANCE[2:]], "a drift of free.y, which is no memory of its own"),
        ("1.000000001*g*free.y", IN_BALANCE, "not every equation keeps"),
        ("sqrt(g*h)*sqrt(g/h)*free.y", IN_BALANCE, "not every equation keeps"),
    ],
)
def test_shares_of_a_drift_follow_from_numbers(wire, drift, why, tmp_path):
    spec = BALANCED.replace('"two.u" = "g*free.y"', f'"two.u" = "{wire}"')
    code, words = checked(tmp_path, spec, [LEFT | {"drifts": [drift]}, CONSTANT])
    assert code == bool(why)
    assert why in words
