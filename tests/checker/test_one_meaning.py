"""Specs and claims that could be taken in two ways are refused: what is proved has to be what stands there."""

import pytest
from checker.test_hand_made import BELOW, SPEC, STATES, WITHIN
from support.proofs import checked

CLASSES = """
rates.tick_hz = 10
numbers = { k = 0.5 }
[block]
left = { type = "amp", kp = 0.3 }
h = { type = "hold" }
[signals]
s = "h.y"
[wire]
"left.u" = "prev(h.y)"
"h.u" = "k*left.out + 0.1*prev(s)"
[ports]
[type.amp]
numbers = { kp = 0.2, k = "kp" }
block.g = { type = "gain", k = "k" }
block.lag = { type = "lowpass", a = 0.5 }
wire."g.u" = "u"
wire."lag.u" = "g.y"
ports.inputs = ["u"]
ports.outputs.out = "lag.y"
"""
CLAIM = {"claim": "modes", "outside": 0, "states": ["@before h.y", "@left.lag y"]}
ROUND = {"L": [["1", "0"], ["0", "1"]], "signs": "++"}


def test_names_of_a_class_are_read(tmp_path):
    code, words = checked(tmp_path, CLASSES, [CLAIM, ROUND])
    assert code == 0, words


TWO_MEANINGS = {  # what is written in place of what
    "a number of a class": ("k = 0.5", "k = 0.5, left_kp = 9"),
    "a block of a class": ("h = {", '"left.g" = { type = "gain", k = 3 }\nh = {'),
    "a signal of a class": ("[wire]", '"left.out" = "3*h.y"\n[wire]'),
    "a wire within a class": ("[ports]", '"left.g.u" = "h.y"\n[ports]'),
    "a signal that is an output": ("[wire]", '"h.y" = "2*left.out"\n[wire]'),
    "an input that is an output": ("[ports]", '[ports]\ninputs.x = "h.y"'),
    "an input that is a signal": ("[ports]", '[ports]\ninputs.x = "s"'),
    "a number that is a signal": ("k = 0.5", "k = 0.5, s = 3"),
    "a number that is pi": ("k = 0.5", "k = 0.5, pi = 3"),
    "a number that is a function": ("k = 0.5", "k = 0.5, prev = 3"),
    "two keys of which another block reads one": (
        "[ports]",
        '"d.u" = "h.y"\n"e.u" = "h.y"\n[block.d]\ntype = "delay"\n[block.e]\ntype = "delay"\nsteps = 1\ntaps = [2]\n[ports]',
    ),
    "a plant that runs every so many ticks": ("h = {", 'm = { type = "mass", mass = 1, every = 2 }\nh = {'),
    "a sign that is none": ('"k*left', '"~k*left'),
    "a word that is none": ('"k*left.out', '"(not k)*left.out'),
    "a text for a number": ('"k*left', "\"'3'*left"),
    "a comment": ('0.1*prev(s)"', '0.1*prev(s) # more"'),
}


@pytest.mark.parametrize("case", TWO_MEANINGS)
def test_a_spec_with_two_meanings_is_refused(case, tmp_path):
    text, other = TWO_MEANINGS[case]
    assert text in CLASSES
    code, words = checked(tmp_path, CLASSES.replace(text, other), [CLAIM, ROUND])
    assert (code, words.count("\n")) == (2, 1), words


@pytest.mark.parametrize("where", ["numbers", "sides"])
def test_a_number_has_one_name_in_a_claim(where, tmp_path):
    values = {"numbers": ("5", "0.5"), "sides": (["0", "5"], ["0", "0.5"])}[where]
    claim = CLAIM | {where: dict(zip(("numbers.left_kp", "left_kp"), values, strict=True))}
    code, words = checked(tmp_path, CLASSES, [claim, ROUND])
    assert (code, words) == (2, "not checked: numbers.left_kp and left_kp are one number\n")


def test_a_claim_is_printed_with_all_its_digits(tmp_path):
    """The end is at 0.86602540378443864676372...: rounded to fewer digits, both numbers would be beyond it."""
    for value in ("0.8660254037844386467", "0.866025403784438646"):
        claim = {"claim": "modes", "outside": 0, "numbers": {"k": value}, "states": STATES}
        code, words = checked(tmp_path, SPEC, [claim, WITHIN])
        assert code == 0
        assert words.startswith(f"proved: the spec's own loop, k = {value}: ")


@pytest.mark.parametrize("end", ["0.8__0", "0._8", "0.\u0668", "\uff10.8"])
def test_a_number_is_written_as_numbers_are(end, tmp_path):
    code, words = checked(tmp_path, SPEC, [BELOW | {"sides": {"k": ["0", end]}}, WITHIN])
    assert (code, words.count("\n")) == (2, 1), words


def test_frames_refute_nothing_where_frames_do_not_differ(tmp_path):
    claim = {"claim": "refuted", "outside": 2, "numbers": {"k": "0.9"}, "states": STATES}
    outside = WITHIN | {"signs": "--"}
    assert checked(tmp_path, SPEC, [claim, outside])[0] == 0
    code, words = checked(tmp_path, SPEC, [claim | {"word": ["n=3"]}, outside])
    assert (code, "no frames that differ" in words) == (1, True), words


def test_a_loop_without_memory_has_no_mode(tmp_path):
    spec = 'rates.tick_hz = 10\nblock.a = { type = "gain", k = 2 }\nwire."a.u" = "0*a.y"\n'
    code, words = checked(tmp_path, spec, [{"claim": "modes", "outside": 0, "states": []}, {"L": [], "signs": ""}])
    assert (code, words.splitlines()[0]) == (0, "proved: the spec's own loop, its own numbers: there is no mode")
    code, words = checked(tmp_path, spec, [{"claim": "for all", "states": []}, {"nodes": [{"L": []}], "edges": []}])
    assert (code, "a loop without states has no form" in words) == (1, True), words


UNKNOWN = [
    '[operator]\ninertia = 1\n[controller]\nkind = "dc"\n',
    '[controller]\nkind = "dc"\nslip = 2\n',
    '[hand]\nmass = 1\n[controller]\nkind = "dc"\n',
    CLASSES.replace("[ports]", "[extra]\na = 1\n[ports]"),
    CLASSES.replace('type = "hold"', 'type = "hold", slip = 1'),
    CLASSES.replace('"h.u"', '"h.v" = "s"\n"h.u"'),
    CLASSES.replace('h = { type = "hold" }', 'h = { type = "integrator", method = "euler" }'),
]


@pytest.mark.parametrize("spec", UNKNOWN)
def test_a_key_that_is_not_known_is_an_error(spec, tmp_path):
    code, words = checked(tmp_path, spec, [CLAIM, ROUND])
    assert (code, "is not known" in words) == (2, True), words
