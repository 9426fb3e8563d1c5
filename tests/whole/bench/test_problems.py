"""The questions, their references at 50 digits made again, and how answers are scored."""

import numpy as np
import pytest
import references as made

from bench.accuracy import ENDS, RESPONSES
from bench.frequency_responses import problem as response_problem
from bench.problems import COLUMNS, PROBLEMS, Intervals, checked, digest, references, score
from wavesweep.engine.errors import WavesweepError

NAMES = [problem.name for problem in PROBLEMS]
SPAN = (0.0, 100.0)
HOLE = [[[0.0, 10.0], [20.0, 40.0]]]


@pytest.mark.parametrize("problem", PROBLEMS, ids=NAMES)
@pytest.mark.parametrize("columns", COLUMNS)
def test_coarser_questions_are_part_of_the_finest(problem, columns):
    few, whole = problem.ask(columns), problem.ask(max(COLUMNS))
    numbers = problem.numbers(columns)
    assert len(numbers) == columns

    def combinations(spec):
        axes = [axis.values for axis in spec.sweep if axis.name != "K_VE"]
        return np.stack([part.ravel() for part in np.meshgrid(*axes, indexing="ij")], axis=-1)

    assert np.array_equal(combinations(few), combinations(whole)[numbers])


@pytest.mark.parametrize("problem", PROBLEMS, ids=NAMES)
def test_references_are_of_the_question_that_is_asked(problem):
    known = references()["intervals"][problem.name]
    assert len(checked(known, digest(problem.ask(max(COLUMNS))), "it")["columns"]) == max(COLUMNS)


def test_references_of_another_question_are_refused():
    with pytest.raises(WavesweepError, match="another question"):
        checked({"digest": "old"}, "new", "it")


@pytest.mark.slow
def test_references_can_be_made_again():
    hole = PROBLEMS[1]
    assert made.columns_of(hole, {20})[20] == references()["intervals"][hole.name]["columns"][20]


def test_the_reference_of_a_hard_case_can_be_made_again():
    light = next(case for case in ENDS if "1 mg" in case.condition)
    assert made.ends_of(light) == references()["hard_ends"][ENDS.index(light)]


def test_the_reference_of_a_response_can_be_made_again():
    asked = response_problem()
    values = references()["responses"]["values"]["500"]
    assert made.respond(asked.spec.values, asked.checked(500)[3:4]) == values[3:4]
    assert len(references()["hard_responses"]) == len(RESPONSES)


def test_sturm_counts_and_schur_cohn_agree_with_known_roots():
    mp = made.mp
    cubic = [mp.mpf(1), mp.mpf("-0.9"), mp.mpf("0.08"), mp.mpf("0.06")]  # 0.5, 0.6, -0.2
    found = made.real_roots(cubic)
    assert [float(x) for x in found] == pytest.approx([-0.2, 0.5, 0.6], abs=1e-15)
    assert made.unstable(cubic) == 0
    outside = [mp.mpf(1), mp.mpf("-3.3"), mp.mpf("2.9"), mp.mpf("-0.6")]  # 2, 0.3, and the drift at 1
    assert made.unstable(outside) == 1


def answer(*intervals, column=0):
    low, high = np.array(intervals, float).reshape(-1, 2).T
    return Intervals(np.full(low.size, column), low, high)


@pytest.mark.parametrize(
    ("intervals", "column", "truth", "error", "found", "there", "wrong"),
    [
        ([(0, 10), (20, 40)], 0, HOLE, 0.0, 2, 2, 0),
        ([(0, 11), (20, 42)], 0, HOLE, 0.1, 2, 2, 0),  # errors are relative
        ([(0, 40)], 0, HOLE, None, 0, 2, 1),  # over a hole it finds none of its sides
        ([(20, 40)], 0, HOLE, 0.0, 1, 2, 1),  # what is missed does not spoil the error of others
        ([(0, 10), (20, 40)], 1, [*HOLE, *HOLE], 0.0, 2, 4, 1),
        ([(1, 100)], 0, [[[0.0, 100.0]]], np.nan, 1, 1, 0),  # an end of the range is not critical
    ],
)
def test_how_answers_are_scored(intervals, column, truth, error, found, there, wrong):
    seen = score(answer(*intervals, column=column), truth, SPAN)
    assert (seen.found, seen.there, seen.wrong) == (found, there, wrong)
    assert error is None or seen.error_max == pytest.approx(error, nan_ok=True)
