"""Random specs: what the package certifies along their number, the checker proves, or says why it cannot."""

import pytest
from meaning.specs import spec_text
from proofs.law import PROVED, fate


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 6, 10, 13])
def test_what_is_certified_is_proved(number, tmp_path):
    assert fate(spec_text(number, quick=True), tmp_path) == PROVED
