"""The table of choices: around the specs' own values, complete, and answered the same in a batch as alone."""

import numpy as np
import pytest

from reproduce.felt_responses import respond
from reproduce.paper_loops import PaperLoops
from reproduce.readings import CHOICES, DIRECT, FILTERS, PMW, PMW_LM, Reading, readings, under
from reproduce.specs import load_paper
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.haptics.controllers import WALL
from wavesweep.program.tables.interval_table import intervals

PAPERS = {  # what the paper gives for its statements: a local model with a stiffness only, a device without delay
    *(
        "rates.fast_hz",
        "rates.ratio",
        "device.mass",
        "device.damping",
        "device.delay",
        "device.dead_time",
        "controller.kind",
        "controller.b",
        "controller.Kp",
    ),
    *("local_model.K_LM", "local_model.B_LM", "operator.mass", "operator.damping", "operator.stiffness"),
    *WALL,
}


@pytest.mark.parametrize(("name", "tried"), [("fig6", PMW_LM), ("pmw", PMW), ("dc", DIRECT)], ids=["PMW+LM", "PMW", "DC"])
def test_every_key_that_the_paper_leaves_open_and_the_loop_reads_has_choices(name, tried):
    varied = {path for reading in tried for path in reading.changes}
    assert varied == keys_of_page(load_paper(name).values) - PAPERS


def test_no_choice_is_the_specs_own_and_every_one_makes_a_spec():
    own = load_paper("fig6")
    for choice in CHOICES:
        assert own.values[choice.path] != choice.value
        assert load_paper("fig6", Reading((choice,)).overrides).values[choice.path] == choice.value
    assert len({choice.words for choice in CHOICES}) == len(CHOICES)


def test_readings_are_the_base_the_singles_and_the_pairs_of_different_keys():
    assert [reading.size for reading in PMW_LM] == sorted(reading.size for reading in PMW_LM)
    assert PMW_LM[0] == Reading()
    assert set(PMW_LM[1 : 1 + len(CHOICES)]) == {Reading((choice,)) for choice in CHOICES}
    pairs = {(a.words, b.words) for a in CHOICES for b in CHOICES if a.path < b.path}
    assert len(PMW_LM) == 1 + len(CHOICES) + len(pairs)
    assert set(FILTERS) <= set(PMW_LM)
    assert len(readings(under("environment."), 6)) == 3 * 3


SOME = [PMW_LM[number] for number in np.random.default_rng(1).choice(len(PMW_LM), 12, replace=False)]


@pytest.mark.thorough
@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("reading", SOME, ids=lambda reading: reading.label)
def test_an_answer_in_a_batch_is_that_of_the_spec_alone(reading, paper):
    found = paper.responses("fig6", PMW_LM, {"Kp": 0})[PMW_LM.index(reading)]
    spec = load_paper("fig6", (*reading.overrides, "Kp=0"))
    alone = respond(spec)
    assert found.stable == alone.stable
    # Where the loop is unstable the response means nothing, and may be far from rounding.
    assert not found.stable or found.admittance == pytest.approx(alone.admittance, rel=1e-9)
    limits = paper.limits("fig6", PMW_LM)[PMW_LM.index(reading)]
    columns = intervals(load_paper("fig6", (*reading.overrides, "sweep.Kp=[20]", "sweep.K_LM=[500]"))).columns
    expected = columns["high"][0] if columns["intervals"][0] and columns["low"][0] == 0 else 0.0
    assert limits == pytest.approx(np.inf if np.isnan(columns["high_omega"][0]) and expected else expected, rel=1e-9)


def test_a_change_goes_before_a_reading_and_what_a_loop_ignores_is_not_computed():
    paper = PaperLoops()
    few = [reading for reading in PMW_LM if reading.size < 2]
    felt = paper.responses("dc", few)
    assert len({id(response) for response in felt}) == 2  # by the velocity alone
    limits = paper.limits("fig6", few, {"filters.lp2.order": 4})
    at = [reading.label for reading in few].index("LP2 of order 1")
    assert limits[at] == limits[0]
