"""Random specs and sets: what the package certifies along their number, the checker proves; and changed ones it refuses."""

import pytest
from meaning.specs import spec_text
from proofs.law import fate
from proofs.mutations import run


def proved_whole(text, folder):
    proved, certified, why = fate(text, folder)
    assert proved == certified, why
    assert certified
    assert not why


@pytest.mark.parametrize("number", [0, 13, 32])
def test_what_is_certified_is_proved(number, tmp_path):
    proved_whole(spec_text(number, quick=True), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 3, 6, 9, 12, 23])
def test_what_is_certified_of_larger_loops_is_proved(number, tmp_path):
    """With drifts that depend on the number (1, 9, 12, 23), dead times and several rates."""
    proved_whole(spec_text(number, quick=True), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", [2, 5])
def test_a_changed_spec_or_proof_is_refused(number, tmp_path):
    wrong = []
    counts = run(spec_text(number, quick=True), number, tmp_path, wrong.append)
    assert not wrong
    assert counts["refused"] > counts["say the same"]
