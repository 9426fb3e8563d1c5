"""What comes out for the paper's statements, and why it has to."""

import numpy as np
import pytest

from reproduce.verdicts import CONTRADICTED, INFERRED, REPRODUCED, UNTESTABLE

# A part of a statement that no other has -> its verdict, and the reason that it has to be this one.
EXPECTED = {
    "The delay of computationally": (REPRODUCED, "a sampled wall tolerates less stiffness the longer its force is held"),
    "the simulation loop is stable": (INFERRED, "a soft coupling; behind a stiff one a soft local model is dc-slow, unstable"),
    "increase the gain of the force": (CONTRADICTED, "a stiffer local model is the stabler one"),
    "increase the range of contact": (INFERRED, "without one every implicit wall is stable; behind an explicit one none"),
    "wave aliasing": (REPRODUCED, "without a filter all 20 aliases fold onto one sample"),
    "To eliminate aliasing": (CONTRADICTED, "a Butterworth filter lets something alias, whatever its order and cutoff"),
    "low-pass antialiasing filter": (CONTRADICTED, "as before, with HP's part on top"),
    "The filter bank divides": (REPRODUCED, "a low-pass and a high-pass cross once"),
    "this filter bank structure": (CONTRADICTED, "the two returned waves are added: two equal ones give the root of 2"),
    "reduces the wave reflections": (REPRODUCED, "a low-pass lets less than all of a lossless reflection through"),
    "the DC transmitted": (REPRODUCED, "direct coupling is a spring at rest"),
    "increasing the wave impedance improves": (INFERRED, "the filter's spring grows with b, if the loop is stable"),
    "lowpass anti-aliasing filter": (INFERRED, "the hold adds 9.5 ms; a wall at the fast rate has none"),
    "(the first half, by the device": (REPRODUCED, "the peak of a damped spring and mass"),
    "at the expense of stability": (INFERRED, "implicit and trapezoidal walls behind waves have no limit"),
    "have little effect": (INFERRED, "a high-pass of second order keeps the local model out of what is felt at rest"),
    "(towards 0 Hz)": (INFERRED, "at rest Kp makes the avatar's position the hand's"),
    "(over the frequencies of Figure 2a)": (INFERRED, "Kp acts below its own bandwidth only, fast filters widen it"),
    "In the low frequency range": (INFERRED, "wherever the loops are stable and HP lets the local model in"),
    "In the high frequency range": (INFERRED, "wherever the loops are stable"),
    "(at high frequencies: much better)": (
        INFERRED,
        "above LP2's cutoff b loads the device in both: it holds with LP2 at 160 Hz",
    ),
    "can render stiffer contact": (INFERRED, "wherever the loops are stable"),
    "can stably render a maximum": (INFERRED, "an implicit wall has no limit, an explicit one the right b or cutoff"),
    "The axes of Figure 4": (CONTRADICTED, "a line from 800 N/m rises by 100 N/m or more for each N s/m"),
    "An axis of Figure 5": (INFERRED, "a region without limit, as an implicit wall has, ends nowhere"),
    "the parameters of the local model have": (INFERRED, "no limit with an implicit wall and HP of first order"),
    "the gain of the term": (INFERRED, "no limit with an implicit wall"),
    "unlike the parameters": (REPRODUCED, "the limit of the power-domain model grows with K_LM"),
    "position feedback improves": (INFERRED, "with an implicit wall there is nothing to improve"),
    "has been introduced to reduce": (INFERRED, "a lossless reflection rings if it comes back a tick late; not without delay"),
    "The improvement is largely": (INFERRED, "only where there is an improvement"),
    "Experiments with a Phantom Omni": (UNTESTABLE, "a simulation says nothing of a device"),
    "increases the first natural": (INFERRED, "unstable with an explicit wall"),
    "regardless of the low update": (INFERRED, "unstable with an explicit wall"),
    "(at low frequencies)": (INFERRED, "wherever the loops are stable"),
    "The human touch": (UNTESTABLE, "no human here"),
    "Robust control": (UNTESTABLE, "no such controller here"),
}

# A part of a statement -> one smallest change that turns it, each found by another program.
TURNED_BY = {
    "have little effect": "HP of order 2",
    "(at high frequencies: much better)": "LP2 at 160 Hz",
    "has been introduced to reduce": "explicit wall + local model without delay",
    "the parameters of the local model have": "HP of order 2",
    "can stably render a maximum": "explicit wall + LP1 at 8.57 Hz",
    "increases the first natural": "unstable: explicit wall",
    "regardless of the low update": "unstable: explicit wall",
}


def row_of(judged, part):
    found = [row for row, says in enumerate(judged["statement"]) if part in says]
    assert len(found) == 1
    return found[0]


@pytest.mark.parametrize(("part", "expected"), EXPECTED.items(), ids=list(EXPECTED))
def test_the_verdict_of_a_statement(part, expected, judged):
    (verdict, reason), row = expected, row_of(judged, part)
    assert judged["verdict"][row] == verdict, f"{reason}; found {judged['numbers'][row]}"


@pytest.mark.parametrize(("part", "change"), TURNED_BY.items(), ids=list(TURNED_BY))
def test_the_smallest_change_that_turns_a_statement(part, change, judged):
    assert change in judged["turned_by"][row_of(judged, part)].split("; ")


def test_a_verdict_that_hangs_on_a_reading_names_it(judged):
    hanging = judged["verdict"] == INFERRED
    assert all(judged["holds_under"][hanging])
    assert all(judged["fails_under"][hanging])
    assert all(judged["turned_by"][hanging])
    assert not any(judged["turned_by"][~hanging])
    assert np.all((judged["held"] > 0) & (judged["held"] < judged["readings"]) == hanging)
    assert not any(judged["fails_under"][judged["verdict"] == REPRODUCED])
    assert not any(judged["holds_under"][judged["verdict"] == CONTRADICTED])


def test_every_limit_that_the_statements_ask_for_is_proved(judged, paper):
    assert len(judged["verdict"]) > 50
    assert paper.uncertified == 0
