"""Sums and products of matrices that depend on a number."""

import numpy as np

from wavesweep.robust.loop_frames import Enclosure


def test_products_and_sums_are_within_their_enclosure():
    r = np.random.default_rng(1)
    parts = [r.normal(size=(3, 2, 2)) * [[[1.0]], [[0.5]], [[0.2]]] for _ in range(2)]
    X, Y = (Enclosure(*part, rest=np.full((2, 2), 1e-3)) for part in parts)
    found = X @ Y + X @ X @ Y + Y

    def at(parts, s):
        return parts[0] + s * parts[1] + s**2 * parts[2]

    for s in np.linspace(-1, 1, 41):
        x, y = (at(part, s) + 1e-3 * r.uniform(-1, 1, (2, 2)) for part in parts)
        middle = at((found.centre, found.slope, found.curve), s)
        assert (np.abs(x @ y + x @ x @ y + y - middle) <= found.rest + 1e-12).all()
    assert (found.rest < 10).all()
