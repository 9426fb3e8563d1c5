"""The questions, their references at 50 digits made again, and how answers are scored."""

import numpy as np
import pytest
import references as made

from bench.accuracy import ENDS, RESPONSES
from bench.frequency_responses import problem as response_problem
from bench.problems import COLUMNS, PROBLEMS, Intervals, bundles, checked, coarse, digest, references, score
from wavesweep.errors import WavesweepError

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


def test_every_second_value_of_the_first_axis_that_can_be_halved_is_left():
    assert coarse({"a": (1, 2, 3), "b": (1, 2, 3, 4)}, 6) == {"a": (1, 2, 3), "b": (1, 3)}


@pytest.mark.parametrize("problem", PROBLEMS, ids=NAMES)
def test_every_column_is_compiled_once(problem):
    columns = np.concatenate([part.column for part in bundles(problem.ask(100))])
    assert sorted(columns) == list(range(100))


@pytest.mark.parametrize("problem", PROBLEMS, ids=NAMES)
def test_references_are_of_the_question_that_is_asked(problem):
    known = references()["intervals"][problem.name]
    assert len(checked(known, digest(problem.ask(max(COLUMNS))), "it")["columns"]) == max(COLUMNS)


def test_references_of_another_question_are_refused():
    with pytest.raises(WavesweepError, match="another question"):
        checked({"digest": "old"}, "new", "it")


@pytest.mark.sample(1)
@pytest.mark.slow
@pytest.mark.parametrize(("problem", "column"), [(PROBLEMS[1], 20), (PROBLEMS[3], 103)], ids=["hole", "five-axes"])
def test_references_can_be_made_again(problem, column):
    assert made.columns_of(problem, {column})[column] == references()["intervals"][problem.name]["columns"][column]


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


def test_the_truth_has_no_error():
    perfect = score(answer((0, 10), (20, 40)), HOLE, SPAN)
    assert (perfect.error_max, perfect.found, perfect.there, perfect.wrong) == (0, 2, 2, 0)


def test_ends_of_the_range_are_no_critical_stiffness():
    seen = score(answer((1, 100)), [[[0.0, 100.0]]], SPAN)
    assert (seen.found, seen.wrong) == (1, 0)
    assert np.isnan(seen.error_max)


def test_errors_are_relative():
    seen = score(answer((0, 11), (20, 42)), HOLE, SPAN)
    assert seen.error_max == pytest.approx(0.1)
    assert seen.error_median == pytest.approx(0.05)


def test_an_interval_over_a_hole_finds_none_of_its_sides():
    seen = score(answer((0, 40)), HOLE, SPAN)
    assert (seen.found, seen.there, seen.wrong) == (0, 2, 1)


def test_an_interval_that_is_missed_does_not_spoil_the_error_of_others():
    seen = score(answer((20, 40)), HOLE, SPAN)
    assert (seen.error_max, seen.found, seen.wrong) == (0, 1, 1)


def test_columns_are_kept_apart():
    seen = score(answer((0, 10), (20, 40), column=1), [*HOLE, *HOLE], SPAN)
    assert (seen.found, seen.there, seen.wrong) == (2, 4, 1)
