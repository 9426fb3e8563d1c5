"""What is said of units of frames in which forms are looked for."""

import numpy as np
import pytest

from wavesweep.contact.stored_search import WallSamples


@pytest.mark.parametrize("drifts", [False, True])
def test_units_change_no_product(drifts):
    """Frames keep their eigenvalues, and what is read its product with what is moved."""
    random = np.random.default_rng(2)
    spread = 10.0 ** random.uniform(-4, 4, 3)
    moved = random.normal(size=(2, 3, 4)) * 0.1 * np.append(spread, 1.0) / spread[:, None]
    read = random.normal(size=(2, 2, 4)) * np.append(spread, 1.0)
    slide = random.normal(size=(2, 4)) * np.append(spread, 1.0) * drifts
    frames = WallSamples(moved, read, slide, drifts, np.ones((2, 2), bool))
    scaled, units, unit = frames.in_units()
    for ours, theirs in zip(scaled.moved[:, :, :3], moved[:, :, :3], strict=True):
        np.testing.assert_allclose(np.poly(ours), np.poly(theirs), rtol=1e-9, atol=1e-12)
    products = [each.read[:, :, :3] @ each.moved[:, :, 3:] for each in (scaled, frames)]
    np.testing.assert_allclose(products[0] * unit, products[1], rtol=1e-12)
    np.testing.assert_allclose(scaled.moved[:, :, 3] * units, moved[:, :, 3], rtol=1e-12)
    assert abs(scaled.moved[:, :3, 3]).max() < 10
