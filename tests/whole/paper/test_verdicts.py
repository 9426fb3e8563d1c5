"""A verdict follows from outcomes, and from nothing else."""

import pytest

from reproduce.paper_loops import PaperLoops
from reproduce.readings import PMW_LM, Choice, Reading
from reproduce.statements.stability import WITH_STIFFER_MODELS, bank_improves_stability, local_stiffness_matters_little
from reproduce.verdicts import (
    CONTRADICTED,
    INFERRED,
    REPRODUCED,
    UNSTABLE,
    UNTESTABLE,
    Finding,
    Outcome,
)


def reading(*words):
    return Reading(tuple(Choice(f"key.{word}", word, word) for word in words))


def finding(*held):
    return Finding(tuple(Outcome(reading(f"reading {n}"), holds, f"{n} N/m") for n, holds in enumerate(held)))


@pytest.mark.parametrize(
    ("held", "verdict"),
    [
        ((True, True), REPRODUCED),
        ((False, True), INFERRED),
        ((True, False), INFERRED),
        ((False, False), CONTRADICTED),
        ((), UNTESTABLE),
    ],
)
def test_the_verdict_of_outcomes(held, verdict):
    assert finding(*held).verdict == verdict


TURNED = Finding(
    (
        Outcome(reading(), True, "1 N/m"),
        Outcome(reading("a"), *UNSTABLE),
        Outcome(reading("b"), True, "2 N/m"),
        Outcome(reading("a", "b"), *UNSTABLE),
        Outcome(reading("b", "c"), False, "3 N/m"),
        Outcome(reading("b", "c", "d"), False, "4 N/m"),
        Outcome(reading("e", "f"), False, "5 N/m"),
    )
)


def test_the_smallest_changes_turn_a_verdict_and_unstable_ones_are_named_apart():
    assert TURNED.verdict == INFERRED
    assert TURNED.turned_by == "b + c; e + f; unstable: a"
    assert TURNED.numbers == "1 N/m; b + c: 3 N/m"
    assert finding(True, True).turned_by == finding(False).turned_by == ""


def test_readings_that_contain_another_one_are_not_named():
    assert TURNED.readings(holds=True) == "the spec's own values"
    assert TURNED.readings(holds=False) == "a; b + c; e + f"
    assert TURNED.held == 2


class Told(PaperLoops):
    """Loops whose limits are told: the verdict has to follow them."""

    def __init__(self, limits):
        super().__init__()
        self.told = limits

    def limit_families(self, name, readings, changes):
        del changes
        return [self.told[name]] * len(readings)


def test_other_numbers_give_another_verdict():
    assert bank_improves_stability(Told({"fig6": [900.0], "pmw": [500.0]})).verdict == REPRODUCED
    assert bank_improves_stability(Told({"fig6": [400.0], "pmw": [500.0]})).verdict == CONTRADICTED
    assert local_stiffness_matters_little(Told({"fig6": [400.0, 420.0]})).verdict == REPRODUCED
    assert local_stiffness_matters_little(Told({"fig6": [400.0, 450.0]})).verdict == CONTRADICTED
    assert len(bank_improves_stability(Told({"fig6": [1.0], "pmw": [2.0]})).outcomes) == len(WITH_STIFFER_MODELS) > len(PMW_LM)
