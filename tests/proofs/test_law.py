"""Random specs and sets: what the package certifies along their number, the checker proves; and changed ones it refuses."""

import pytest
from meaning.specs import spec_text
from proofs.law import fate
from proofs.mutations import run

from wavesweep.checker.file import spec_of
from wavesweep.proofs.claims import claim_at


def proved_whole(text, folder):
    proved, certified, why = fate(text, folder)
    assert proved == certified, why
    assert certified
    assert not why


@pytest.mark.parametrize("number", [0, 13, 32])
def test_what_is_certified_is_proved(number, tmp_path):
    proved_whole(spec_text(number, quick=True), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3, 6, 9, 12, 23, 485])
def test_what_is_certified_of_larger_loops_is_proved(number, tmp_path):
    """With drifts that depend on the number (1, 9, 12, 23), dead times, several rates, entries of 1e-106 in a form (485)."""
    proved_whole(spec_text(number, quick=True), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 5])
def test_a_changed_spec_or_proof_is_refused(number, tmp_path):
    wrong = []
    counts = run(spec_text(number, quick=True), number, tmp_path, wrong.append)
    assert not wrong
    assert counts["refused"] > counts["say the same"]


@pytest.mark.slow
@pytest.mark.parametrize("value", ["4.0815", "4.0816"])
def test_next_to_an_end_a_loop_with_a_long_memory_has_a_form(value):
    """Of 15 states: a mode passes the circle at K = 4.0815888 by 6e-4 for each unit of K, beside an integral
    that no output reads as its gain is 0 by default, and a drift that this integral counts."""
    lines = claim_at(spec_of(spec_text(71, quick=True).encode()), "modes", {"K": value})
    assert lines[0]["outside"] == (0 if value == "4.0815" else 2)
    first, second = lines[0]["drifts"]
    assert (first, second[0] in first) == (["@c0 integral", "c0 i"], False)


@pytest.mark.slow
@pytest.mark.parametrize(("number", "K", "outside"), [(141, "100", 2), (201, "150", 0)])
def test_a_drift_may_pass_what_has_another_equation_at_other_instants(number, K, outside):
    """An impulse is 0 between its runs, also where what is made of it is read by nothing, beside the sum that it keeps."""
    lines = claim_at(spec_of(spec_text(number, quick=True).encode()), "modes", {"K": K})
    assert lines[0]["outside"] == outside
    assert len(lines[0]["drifts"]) == 2
