"""A verdict follows from outcomes, and from nothing else."""

import pytest

from wavesweep.paper.bench import Bench
from wavesweep.paper.readings import OWN, READINGS, set_to, summary
from wavesweep.paper.statements.stability import bank_improves_stability, local_stiffness_matters_little
from wavesweep.paper.verdicts import (
    CONTRADICTED,
    INFERRED,
    REPRODUCED,
    UNSTABLE,
    UNTESTABLE,
    Answer,
    Finding,
    Outcome,
    Statement,
    once,
    over,
    untestable,
)


def finding(*held):
    return Finding(tuple(Outcome(f"reading {n}", holds, f"{n} N/m") for n, holds in enumerate(held)))


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


def test_the_numbers_of_the_first_reading_and_of_the_first_that_decides_otherwise():
    assert finding(True, True, False, False).numbers == "reading 0: 0 N/m; reading 2: 2 N/m"
    assert once(Answer(True, "5 N/m")).numbers == "5 N/m"


def test_unstable_readings_are_named_apart():
    found = Finding((Outcome(OWN, True, "1 N/m"), Outcome("a", *UNSTABLE), Outcome("b", False, "2 N/m")))
    assert found.readings(holds=False) == "b; unstable: a"
    assert found.numbers == "1 N/m; b: 2 N/m"


def test_an_integration_is_named_once_where_all_its_delays_are_there():
    labels = [reading.label for reading in READINGS]
    assert summary(label for label in labels if label.startswith("explicit")) == "explicit wall"
    assert summary(["explicit, delay 0", "explicit, delay 20"]) == "explicit, delay 0; explicit, delay 20"


def test_a_statement_shows_how_it_is_judged():
    statement = Statement("1", "so", untestable("no means"))
    assert statement.test == "Not tested."
    assert statement.judge(Bench()).numbers == "no means"


def test_each_reading_is_tried():
    seen = []

    def check(*overrides):
        seen.append(overrides)
        return Answer(True, "")

    assert over(check, [set_to("a", "b=1"), set_to("c")]).verdict == REPRODUCED
    assert seen == [("b=1",), ()]


class Told(Bench):
    """A bench that is told the limits: the verdict has to follow them."""

    def __init__(self, limits):
        super().__init__()
        self.told = limits

    def limits(self, name, *overrides):
        del overrides
        return self.told[name]


def test_other_numbers_give_another_verdict():
    assert bank_improves_stability(Told({"fig6": [900.0], "pmw": [500.0]})).verdict == REPRODUCED
    assert bank_improves_stability(Told({"fig6": [400.0], "pmw": [500.0]})).verdict == CONTRADICTED
    assert local_stiffness_matters_little(Told({"fig6": [400.0, 420.0]})).verdict == REPRODUCED
    assert local_stiffness_matters_little(Told({"fig6": [400.0, 450.0]})).verdict == CONTRADICTED
