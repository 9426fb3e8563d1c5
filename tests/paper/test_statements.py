"""What comes out for the paper's statements, and why it has to."""

import numpy as np
import pytest

from wavesweep.paper.statements import STATEMENTS
from wavesweep.paper.verdicts import CONTRADICTED, INFERRED, REPRODUCED, UNTESTABLE

# The beginning of a statement -> its verdict, and the reason that it has to be this one.
EXPECTED = {
    "The delay of the virtual": (REPRODUCED, "a sampled wall tolerates less stiffness the longer its force is held"),
    "A power-domain local model is": (CONTRADICTED, "a wall of 500 N/m is unstable alone, and stays so with little K_LM"),
    "... where that environment": (REPRODUCED, "K_LM up to K_VE only adds fast stiffness to it"),
    "A fixed-stiffness local model cannot increase the gain": (CONTRADICTED, "stable K_LM go far beyond K_VE"),
    "A fixed-stiffness local model cannot increase the range": (CONTRADICTED, "fast stiffness supports the slow wall"),
    "Wave aliasing": (REPRODUCED, "without a filter all 20 aliases fold onto one sample"),
    "A low-pass filter": (INFERRED, "a Butterworth filter lets something alias, at high orders less than 1e-10"),
    "The filter bank divides": (REPRODUCED, "Butterworth filters of one order and cutoff are power-complementary"),
    "The filter bank structure": (CONTRADICTED, "the two returned waves are added: two equal ones give sqrt(2)"),
    "LP2 reduces": (REPRODUCED, "a low-pass lets less than all of a lossless reflection through"),
    "The DC admittance": (REPRODUCED, "direct coupling is a spring at rest"),
    "Increasing the wave impedance improves": (INFERRED, "the filter's spring grows with b"),
    "At low frequencies the anti": (INFERRED, "the hold adds 9.5 ms; a wall at the fast rate has none"),
    "Added damping": (REPRODUCED, "the peak of a damped spring and mass"),
    "... at the expense of stability": (INFERRED, "implicit and trapezoidal walls behind waves have no limit"),
    "... but have little effect": (CONTRADICTED, "the local model shortens the delay that is felt as a spring"),
    "It makes the low-frequency": (INFERRED, "at rest Kp makes the avatar's position the hand's"),
    "... and over the low": (CONTRADICTED, "Kp acts below its own bandwidth only"),
    "At low frequencies the amplitude": (INFERRED, "wherever the loops are stable"),
    "The natural frequency approaches": (INFERRED, "wherever the loops are stable"),
    "... and much": (CONTRADICTED, "above LP2's cutoff b loads the device in both"),
    "PMW+LM renders stiffer": (INFERRED, "wherever the loops are stable"),
    "Passive multirate wave control renders": (INFERRED, "an implicit wall has no limit, an explicit one the right b"),
    "The stiffness of the local": (INFERRED, "an implicit wall has no limit, that of an explicit one grows"),
    "The gain Kp": (INFERRED, "no limit with an implicit wall"),
    "... unlike the parameters": (REPRODUCED, "the limit of the power-domain model grows with K_LM"),
    "Filter bank, local model and": (INFERRED, "with an implicit wall there is nothing to improve"),
    "LP2 injects": (REPRODUCED, "a lossless reflection fed back undiminished rings"),
    "The improvement is largely": (INFERRED, "only where there is an improvement"),
    "The experiments validate": (REPRODUCED, "a settled linear loop answers as its analysis says"),
    "PMW+LM increases": (REPRODUCED, "as in Figure 6"),
    "At low frequency PMW+LM": (REPRODUCED, "as in Figure 6"),
    "PMW+LM transmits": (INFERRED, "wherever the loops are stable"),
    "The human touch": (UNTESTABLE, "no human here"),
    "Robust control": (UNTESTABLE, "no such controller here"),
}


@pytest.mark.parametrize(("beginning", "expected"), EXPECTED.items(), ids=list(EXPECTED))
def test_the_verdict_of_a_statement(beginning, expected, judged):
    verdict, reason = expected
    found = [row for row, says in enumerate(judged["statement"]) if says.startswith(beginning)]
    assert len(found) == 1
    assert judged["verdict"][found[0]] == verdict, f"{reason}; found {judged['numbers'][found[0]]}"


def test_every_statement_says_where_it_is_made_and_how_it_is_judged(judged):
    for name in ("where", "statement", "numbers", "test"):
        assert all(judged[name]), name
    assert judged["number"].tolist() == list(range(1, len(STATEMENTS) + 1))
    assert len(set(judged["statement"])) == len(STATEMENTS)


def test_a_verdict_that_hangs_on_a_reading_names_it(judged):
    hanging = judged["verdict"] == INFERRED
    assert all(judged["holds_under"][hanging])
    assert all(judged["fails_under"][hanging])
    assert not any(judged["fails_under"][judged["verdict"] == REPRODUCED])
    assert not any(judged["holds_under"][judged["verdict"] == CONTRADICTED])


def test_every_section_and_figure_of_the_paper_has_statements(judged):
    where = "; ".join(judged["where"])
    wanted = ("Abstract", "1", "2", "3", "3.1", "3.2", "4", "5", *(f"Fig. {n}" for n in "245678"), "eq. (2)", "eq. (3)")
    assert [name for name in wanted if name not in where] == []


def test_no_number_is_missing_where_a_statement_was_tested(judged):
    tested = judged["verdict"] != UNTESTABLE
    assert all(any(letter.isdigit() for letter in numbers) for numbers in judged["numbers"][tested])
    assert np.count_nonzero(tested) > 40
