"""The nearest rival is as good as it can be made, and proves nothing."""

import pytest

from bench.accuracy import ENDS
from bench.problems import COLUMNS, PROBLEMS, references, score
from bench.rivals import decomposed
from wavesweep.program.spec import load


@pytest.mark.sample(2)
@pytest.mark.parametrize("problem", PROBLEMS, ids=[problem.name for problem in PROBLEMS])
def test_it_finds_every_interval_of_the_problems(problem):
    truth = references()["intervals"][problem.name]["columns"]
    found = score(decomposed(problem.ask(max(COLUMNS)), 180), truth, (0.0, problem.stop))
    assert (found.found, found.wrong) == (found.there, 0)
    assert found.error_max < 1e-12


def two_crossings_about_to_merge():
    """As a question of the benchmark's, and its truth."""
    case = ENDS[-1]
    spec = load({**case.tables, "controller": {"kind": case.kind}, "sweep": {"K_VE": {"start": 0, "stop": case.span[1]}}})
    return spec, [references()["hard_ends"][-1]], case.span


def test_it_misses_what_lies_between_two_angles_without_a_word():
    spec, truth, span = two_crossings_about_to_merge()
    assert score(decomposed(spec, 180), truth, span).wrong == 1
    assert score(decomposed(spec, 100_000), truth, span).wrong == 0


@pytest.mark.whole
def test_random_loops_that_it_misses_are_certified_here():
    """A loop with filters of first order, and an angle for every degree."""
    from decomposition_misses import ANGLES, first_order, tally

    columns, certified, wrong, *missed = tally(first_order, 9)
    assert (columns, certified, wrong) == (3, 3, 0)
    assert dict(zip(ANGLES, missed, strict=True)) == {45: 3, 180: 3, 450: 0, 2000: 0}
