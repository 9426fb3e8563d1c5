"""Random specs: what the package certifies along their number, the checker proves, or says why it cannot."""

import pytest
from meaning.specs import spec_text
from proofs.law import SAME, fate


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 6, 10, 13])
def test_what_is_certified_is_proved(number, tmp_path):
    assert fate(spec_text(number, quick=True), tmp_path) == SAME


@pytest.mark.slow
def test_a_drift_that_is_no_simple_ratio_is_told(tmp_path):
    assert fate(spec_text(1, quick=True), tmp_path).startswith("no form: a mode stays")
