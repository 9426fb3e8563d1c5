"""What is asked, and how much of it claims cover: the last line, and the exit code."""

from fractions import Fraction

import pytest
from checker.test_hand_made import ABOVE, BELOW, OUTSIDE, SPEC, STATES, WITHIN
from support.proofs import checked

from wavesweep.checker import coverage
from wavesweep.checker.file import Claim, spec_of

ASKED = {"claim": "modes", "sides": {"k": ["0", "2"]}, "open": [["0.86602", "0.86603"]]}
OPEN = "open between (0.0005 %)"
BOTH = [BELOW, WITHIN, ABOVE, OUTSIDE]
HALF = BELOW | {"sides": {"k": ["0", "0.5"]}}
SWEPT = SPEC + '[sweep]\nalong = "k"\nk = { start = 0, stop = 2 }\n'
LESS = "LESS than the spec asks: "

COVERAGE = {
    "all": (BOTH, ASKED, 0, f"proved stable to 0.86602, unstable from 0.86603, {OPEN}"),
    "a claim dropped": (BOTH[:2], ASKED, 3, "stable to 0.86602, NOT COVERED from 0.86602 (56.7 %)"),
    "an opening that is not stated": (BOTH, ASKED | {"open": []}, 3, "NOT COVERED from 0.86602 to 0.86603 (0.0005 %)"),
    "an opening of its lower end": (BOTH, ASKED | {"open": [["0.8", "0.866025"]]}, 3, "NOT COVERED from 0.86602 to 0.86603"),
    "an opening of its upper end": (BOTH, ASKED | {"open": [["0.866025", "2"]]}, 3, "NOT COVERED from 0.86602 to 0.86603"),
    "a claim twice": ([*BOTH[:2], *BOTH], ASKED, 0, f"{OPEN}, claimed more than once"),
    "claims that overlap": ([HALF, WITHIN, *BOTH], ASKED, 0, f"{OPEN}, claimed more than once"),
    "a point": ([*BOTH, BELOW | {"sides": {}, "numbers": {"k": "0.5"}}, WITHIN], ASKED, 0, "claimed more than once"),
    "other numbers": (BOTH, ASKED | {"numbers": {"rates.tick_hz": "500"}}, 3, "at tick_hz = 500: NOT COVERED all over"),
    "a large opening": (BOTH[:2], ASKED | {"open": [["0.8", "2"]]}, 0, "open from 0.86602 (56.7 %)"),
    "what has no claims": (BOTH, ASKED | {"claim": "every passive hand"}, 3, "for every passive hand: NOT COVERED"),
    "another radius": (BOTH, ASKED | {"radius": "0.9"}, 3, "within a circle of radius 0.9 in each period of its rates"),
}


@pytest.mark.parametrize("case", COVERAGE)
def test_the_last_line_says_what_of_the_question_is_covered(case, tmp_path):
    lines, asked, code, words = COVERAGE[case]
    found, printed = checked(tmp_path, SPEC, lines, {"of": "sweep", "question": [asked]})
    last = printed.splitlines()[-1]
    assert (found, last.startswith("k from 0 to 2")) == (code, True), last
    assert words in last


SMALLER = {
    "a range": (SWEPT, {}, "[sweep] has k from 0 to 2"),
    "values": (SWEPT + "rates.tick_hz = [500, 1000]\n", {}, "[sweep] has rates.tick_hz from 500 to 1000"),
    "a set": (SWEPT + "[for_all]\n'rates.tick_hz' = [500, 1000]\n", {}, "nothing of [for_all] and channels"),
    "walls": (SWEPT + "[for_all]\ncontact = true\n", {}, "nothing of walls that let go"),
    "a requirement": (SWEPT + "require.radius = 0.9\n", {}, "nothing of [sweep] require"),
}


@pytest.mark.parametrize("case", SMALLER)
def test_a_question_that_is_smaller_than_that_of_the_spec_is_told(case, tmp_path):
    spec, _, words = SMALLER[case]
    asked = ASKED | ({"sides": {"k": ["0", "0.86602"]}} if case == "a range" else {})
    code, printed = checked(tmp_path, spec, BOTH, {"of": "sweep", "question": [asked]})
    assert (code, f"{LESS}{words}" in printed.splitlines()[-1]) == (3, True), printed


@pytest.mark.parametrize(("rates", "covers"), [("234", True), ("34", False), ("23", False), ("24", False), ("", False)])
def test_values_of_an_axis_are_all_asked_for(rates, covers, tmp_path):
    spec = SWEPT + "rates.tick_hz = [200, 300, 400]\n"
    asked = [ASKED | {"numbers": {"rates.tick_hz": f"{rate}00"}} for rate in rates]
    claims = [line | {"numbers": part["numbers"]} if "claim" in line else line for part in asked for line in BOTH]
    code, printed = checked(tmp_path, spec, claims or BOTH, {"of": "sweep", "question": asked or [ASKED]})
    assert (code, f"{LESS}[sweep] has rates.tick_hz from 200 to 400" in printed) == (3 * (not covers), not covers), printed
    wider = [part | {"sides": {"k": ["0", "1.9"]}} for part in asked]
    assert checked(tmp_path, spec, claims or BOTH, {"of": "sweep", "question": wider})[0] == 3


def test_rows_that_are_alike_are_told_together(tmp_path):
    asked = [ASKED | {"numbers": {"rates.tick_hz": str(hz)}} for hz in range(1, 7)]
    claims = [line | {"numbers": {"rates.tick_hz": "3"}} if "claim" in line else line for line in BOTH]
    code, printed = checked(tmp_path, SPEC, claims, {"of": "sweep", "question": asked})
    last = printed.splitlines()[-1]
    assert code == 3
    assert "1 of 6 combinations all is covered up to openings" in last
    assert last.count("NOT COVERED") == 4


def test_a_map_has_shares_that_are_all_only_where_they_are(tmp_path):
    asked = {"claim": "modes", "sides": {"k": ["0", "2"]}}
    claim = {"claim": "modes", "open": True, "sides": {"k": ["0", "2"]}, "states": STATES}
    cut = {"split": "k", "at": "0.000000001"}
    header = {"of": "map", "question": [asked]}
    code, printed = checked(
        tmp_path, SPEC.replace('"k"', '"k/4"').replace("-k", "-k/4"), [claim, cut, {"open": True}, WITHIN], header
    )
    assert code == 0, printed
    assert printed.splitlines()[-1] == "k from 0 to 2: more than 99.9999 % stable, 5e-08 % open"
    code, printed = checked(tmp_path, SPEC, BOTH, header)
    assert (code, printed.splitlines()[-1]) == (3, "k from 0 to 2: NOT COVERED")


def test_a_question_of_another_kind_is_no_file(tmp_path):
    for header in ({"of": "all"}, {"question": {}}, {"question": [{"claim": 1}]}, {"question": [ASKED | {"more": 1}]}):
        assert checked(tmp_path, SPEC, BOTH, header)[0] == 2


def test_twice_as_many_rows_and_claims_take_twice_the_work(monkeypatch):
    names = []
    path_of = coverage.path_of
    monkeypatch.setattr(coverage, "path_of", lambda tables, name: names.append(name) or path_of(tables, name))
    tables = spec_of(SPEC.encode())
    work = []
    for count in (20, 40):
        numbers = [{"rates.tick_hz": Fraction(place)} for place in range(1, count + 1)]
        sides = {"k": (Fraction(0), Fraction(1))}
        words, whole = coverage.in_words(
            tables,
            "sweep",
            [coverage.Ask("modes", own, sides) for own in numbers],
            [Claim("modes", own, sides, 0) for own in numbers],
        )
        assert whole, words
        work.append(len(names))
        names.clear()
    assert work[1] <= 2 * work[0]
