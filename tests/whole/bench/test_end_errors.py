"""The document's table of errors of ends, held against a small sample of the loops that made it."""

import re
from pathlib import Path

import end_errors
import numpy as np
import pytest
from support.specs import values_of

ENDS, MOST = 1, 30  # ends of each condition, and loops to find them in: some have none


def stated():
    """Condition -> (99 % quantile, worst), as the document has them."""
    lines = (Path(__file__).parents[3] / "docs" / "accuracy.md").read_text(encoding="utf-8").splitlines()
    found = (re.fullmatch(r"\| (.+) \| [\d,]+ of [\d,]+ \| [\d,]+ \| \S+ \| (\S+) \| (\S+) \|", line) for line in lines)
    return {match[1]: (float(match[2]), float(match[3])) for match in found if match}


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("condition", end_errors.CONDITIONS, ids=lambda condition: condition.name)
def test_a_sample_is_as_good_as_the_document_says(condition):
    quantile, worst = stated()[condition.name]
    outcomes, errors = [], []
    while len(errors) < ENDS and len(outcomes) < MOST:
        outcomes.append(condition.examine(len(outcomes)))
        errors += outcomes[-1].errors
    assert sum(one.wrong for one in outcomes) == 0
    assert max(errors) <= worst
    assert np.median(errors) <= quantile


def test_both_ways_to_the_truth_agree():
    """Newton's method on the determinant ends where ball arithmetic isolates the crossing."""
    values = values_of("pmw-lm", integration="explicit", Kp=20.0)
    crossing = end_errors.SharpWitness(values).regions("K_VE", (0.0, 20000.0), 1.0)[0]
    exact = float(crossing.high.mid())
    found = end_errors.true_end(values, "environment.K_VE", exact * (1 + 1e-9), crossing.high_theta * (1 + 1e-9))
    assert found == pytest.approx(exact, rel=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("loop", [13, 81])
def test_a_window_at_the_end_of_a_range_is_no_proof_that_nothing_is_stable_in_it(loop):
    """Two crossings merge next to the high end, with a stable interval of a millionth of the range between them."""
    (merging,) = (each for each in end_errors.CONDITIONS if each.name == "two crossings that merge, along both")
    assert merging.examine(loop).wrong == 0
