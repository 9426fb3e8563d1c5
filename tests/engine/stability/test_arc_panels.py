"""Roots of trigonometric polynomials on panels, also of those that samples do not show."""

from itertools import pairwise

import numpy as np
import pytest

from wavesweep.engine._stability.arc_panels import NODE, OVERLAP, Leaves, PanelLimits, _Tiles, panel_roots

EDGES = np.linspace(0, np.pi, 5)
LIMITS = PanelLimits(1e-9, 256, 1e-7)


def nodes_of(low, high):
    half = (0.5 + OVERLAP) * (high - low)
    return (low + high) / 2, half, (low + high) / 2 + half * NODE


def roots_of(function, degree):
    """What is found of a function of the angle, beside one that is negative everywhere."""

    def sample(_, theta):
        values = np.stack([function(theta), np.full(theta.shape, -1.0)])
        return np.sign(values), np.log(np.abs(values)), np.full(values.shape, 1e4)

    found = panel_roots(sample, EDGES, 1, LIMITS, settling=1, degree=degree)
    assert found.complete.all()
    return np.sort(found.roots.x)


def test_a_function_that_is_1_at_all_nodes_of_a_panel_has_its_roots_found():
    """Also at points of an ellipse about it, where it would be sampled: nothing shows there that it is not 1."""
    middle, half, nodes = nodes_of(*EDGES[1:3])
    rim = 2.5 * np.exp(1j * np.pi * (np.arange(8) + 0.5) / 8)
    zeros = np.cos(np.concatenate([nodes, middle + half * (rim + 1 / rim) / 2]))

    def bump(theta):
        apart = np.cos(theta)[..., None] - zeros
        return np.prod(np.where(zeros.imag != 0, np.abs(apart) ** 2, apart.real), axis=-1)

    inside = np.linspace(*EDGES[1:3], 100_001)[1:-1]
    scale = 2 / np.abs(bump(inside)).max()
    values = 1 - scale * bump(inside)
    crossed = inside[:-1][values[:-1] * values[1:] < 0]
    assert crossed.size >= 2
    assert np.abs(1 - scale * bump(nodes) - 1).max() < 1e-12
    found = roots_of(lambda theta: 1 - scale * bump(theta), 36)
    assert np.abs(found - crossed[:, None]).min(-1).max() < 1e-3


@pytest.mark.parametrize("seed", range(3))
def test_the_bound_on_an_ellipse_holds_and_is_not_far_from_what_is_there(seed):
    """Of polynomials whose zeros crowd next to the circle at several scales, so that their sizes differ by decades."""
    r = np.random.default_rng(seed)
    degree = 12
    zeros = r.uniform(0, np.pi, degree) * 10 ** r.uniform(-3, 0, degree) + 1j * 10 ** r.uniform(-3, 0, degree)

    def log_size(theta):
        both = np.log(np.abs(np.sin((theta[..., None] - zeros) / 2))) + np.log(np.abs(np.sin((theta[..., None] + zeros) / 2)))
        return both.sum(-1)

    edges = np.concatenate([[0.0], np.geomspace(1e-5, np.pi, 90)])
    dense = np.array([log_size(np.linspace(low, high, 200)).max() for low, high in pairwise(edges)])
    column = np.zeros(dense.size, int)
    tiles = _Tiles(column, edges[:-1], edges[1:], np.stack([dense, dense], -1), np.zeros(dense.size))
    middle = (edges[10:80:7] + edges[11:81:7]) / 2
    half = 0.6 * np.diff(edges)[10:80:7]  # of a panel and its overlaps, and a little more
    # One function, twice: leaves have two.
    bound, _ = Leaves.of(1, tiles, degree).bound(column[: middle.size], middle, half, 2.5)
    rim = 2.5 * np.exp(1j * np.linspace(0, 2 * np.pi, 800))  # all of it: the zeros lie above the axis
    true = log_size(middle[:, None] + half[:, None] * (rim + 1 / rim) / 2).max(-1)
    assert (true <= bound + 1e-9).all()
    assert (bound - true < np.log(1e4)).all()
