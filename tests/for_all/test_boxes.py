"""Boxes of loops of which it is known where they are unstable."""

import numpy as np
import pytest

from wavesweep.engine.stability.sampled_frames import Frames
from wavesweep.for_all.guardian_maps import cover

PLACE = np.array([0.137, -0.211, 0.048])


def touching(numbers, depth):
    """Loops of eigenvalues 0.5 and `1 - 0.3 (r^2 - depth)`, r the distance of the numbers from PLACE, in a box about it."""

    def frames(x):
        E = np.zeros((len(x), 2, 2), np.result_type(x, float))
        E[:, 0, 0] = -0.5
        E[:, 1, 1] = -0.3 * (((x - PLACE[:numbers]) ** 2).sum(1) - depth)
        E[:, 0, 1] = 0.1
        return Frames.of(E)

    everywhere = np.array([[-np.inf] * numbers, [np.inf] * numbers])
    return cover(frames, np.array([[-1.0] * numbers, [1.0] * numbers]), everywhere, 100_000)


@pytest.mark.slow
@pytest.mark.sample(2)
@pytest.mark.parametrize("numbers", [1, 2, 3])
@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6])
def test_a_pocket_between_the_nodes_is_not_proved(numbers, depth):
    found = touching(numbers, depth)
    inside = ((found.unstable - PLACE[:numbers]) ** 2).sum(1) < depth
    assert inside.all()
    kept = [(low <= PLACE[:numbers]).all() and (PLACE[:numbers] <= high).all() for low, high in found.open]
    assert inside.any() or any(kept)


@pytest.mark.parametrize("numbers", [1, 2, 3])
@pytest.mark.parametrize("depth", [-1e-2, -1e-4])
def test_a_box_that_is_almost_unstable_within_is_proved(numbers, depth):
    found = touching(numbers, depth)
    assert (len(found.open), len(found.unstable)) == (0, 0)


def test_a_piece_whose_maps_hardly_depend_on_a_number_is_divided_along_the_others():
    """Of the first number one coefficient is left."""

    def frames(x):
        E = np.zeros((len(x), 2, 2), np.result_type(x, float))
        E[:, 0, 0] = -0.5 + 1e-13 * x[:, 0]
        E[:, 1, 1] = -1e-3 - 0.3 * (x[:, 1] - 0.1) ** 2
        E[:, 0, 1] = 0.1
        return Frames.of(E)

    everywhere = np.array([[-np.inf] * 2, [np.inf] * 2])
    found = cover(frames, np.array([[-1.0] * 2, [1.0] * 2]), everywhere, 100_000)
    assert (len(found.open), len(found.unstable)) == (0, 0)
