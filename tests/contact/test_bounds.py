"""What the check of frames that vary takes: frames in units, with their errors, and forms."""

from dataclasses import make_dataclass

import numpy as np
import pytest

from wavesweep.contact.rows_in_frames import _in_units
from wavesweep.contact.stored_check import Stored, _are_positive


@pytest.mark.parametrize("drifts", [False, True])
def test_units_change_entries_and_their_errors_alike(drifts):
    """Frames keep their eigenvalues, what is read keeps its product with what is moved, and errors their shares."""
    random = np.random.default_rng(2)
    spread = 10.0 ** random.uniform(-4, 4, (1, 4))
    changes = random.normal(size=(2, 4, 4)) * 0.1 * spread.mT / spread
    rows = random.normal(size=(2, 2, 4)) / spread
    fields = {"changes": changes, "changes_error": 0.01 * abs(changes), "rows": rows, "rows_error": 0.02 * abs(rows)}
    frames = make_dataclass("Frames", [*fields, "drifts"])(**fields, drifts=drifts)
    scaled, unit = _in_units(frames)
    np.testing.assert_allclose(scaled.changes_error, 0.01 * abs(scaled.changes), rtol=1e-12)
    np.testing.assert_allclose(scaled.rows_error, 0.02 * abs(scaled.rows), rtol=1e-12)
    for ours, theirs in zip(scaled.changes[:, :3, :3], changes[:, :3, :3], strict=True):
        np.testing.assert_allclose(np.poly(ours), np.poly(theirs), rtol=1e-9, atol=1e-12)
    moved = [each.rows[:, :, :3] @ each.changes[:, :3, 3:] for each in (scaled, frames)]
    np.testing.assert_allclose(moved[0] * unit, moved[1], rtol=1e-12)
    assert abs(scaled.changes[:, :3, 3]).max() < 10


def test_forms_are_positive_symmetric_and_finite_with_weights_above_0():
    whole = np.eye(2)[None]
    sign = np.ones((1, 1))
    assert _are_positive(Stored(whole, 1.0, 0.0, 0 * sign))
    turned = whole + np.array([[0, 1e-3], [-1e-3, 0]])
    for P in (turned, -whole, whole * np.nan, whole - 1):
        assert not _are_positive(Stored(P, 1.0, 0.0, 0 * sign))
    for weights in ((0.0, 0.0, sign), (-1.0, 0.0, sign), (1.0, -1e-9, sign), (1.0, 0.0, -sign)):
        assert not _are_positive(Stored(whole, *weights))
