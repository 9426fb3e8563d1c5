"""The questions, and that their references are what 50 digits say today."""

import numpy as np
import pytest
from benchmarks import references as made

from wavesweep.bench import hard
from wavesweep.bench.problems import COLUMNS, PROBLEMS, bundles, coarse, digest
from wavesweep.bench.references import checked, references
from wavesweep.bench.responses import problem as response_problem
from wavesweep.errors import WavesweepError

NAMES = [problem.name for problem in PROBLEMS]


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


@pytest.mark.parametrize(("problem", "column"), [(PROBLEMS[1], 20), (PROBLEMS[3], 103)], ids=["hole", "five-axes"])
def test_references_can_be_made_again(problem, column):
    assert made.columns_of(problem, {column})[column] == references()["intervals"][problem.name]["columns"][column]


def test_the_reference_of_a_hard_case_can_be_made_again():
    light = next(case for case in hard.ENDS if "1 mg" in case.condition)
    assert made.ends_of(light) == references()["hard_ends"][hard.ENDS.index(light)]


def test_the_reference_of_a_response_can_be_made_again():
    asked = response_problem()
    values = references()["responses"]["values"]["500"]
    assert made.respond(asked.spec.values, asked.checked(500)[3:4]) == values[3:4]
    assert len(references()["hard_responses"]) == len(hard.RESPONSES)


def test_sturm_counts_and_schur_cohn_agree_with_known_roots():
    mp = made.mp
    cubic = [mp.mpf(1), mp.mpf("-0.9"), mp.mpf("0.08"), mp.mpf("0.06")]  # 0.5, 0.6, -0.2
    found = made.real_roots(cubic)
    assert [float(x) for x in found] == pytest.approx([-0.2, 0.5, 0.6], abs=1e-15)
    assert made.unstable(cubic) == 0
    outside = [mp.mpf(1), mp.mpf("-3.3"), mp.mpf("2.9"), mp.mpf("-0.6")]  # 2, 0.3, and the drift at 1
    assert made.unstable(outside) == 1
