"""Real roots of a polynomial in (-1, 1): what is called proved must be so, exactly."""

from itertools import pairwise

import numpy as np
import pytest
from support import sturm

from wavesweep.engine._stability.real_roots import ROOT_AT_END, isolate


def random_roots(r, degree):
    """Some real roots in (-2, 2) and complex pairs that keep 0.05 off the real axis."""
    roots = [float(x) for x in r.uniform(-2, 2, degree // 3)]
    while len(roots) + sum(isinstance(z, complex) for z in roots) < degree:
        roots.append(complex(r.uniform(-1.5, 1.5), r.uniform(0.05, 1)))
    return roots


def close_pair(r, gap):
    x = float(r.uniform(-0.95, 0.95))
    return [x, x + gap]


def near_real(r, gap):
    return [complex(r.uniform(-0.95, 0.95), gap)]


def near_one(r, gap):
    return [float(r.choice([1 - gap, 1 + gap, -1 + gap, -1 - gap]))]


def at_both_ends(_, gap):
    return [1 - gap, -1 + gap, 1 + 2 * gap]


def multiple(r, _):
    """A multiple root, or pair, away from the segment: what pure delays bring."""
    return [(1.7, -2.5, complex(0.3, 0.8))[int(r.integers(3))]] * int(r.integers(2, 5))


def nothing(_, __):
    return []


HARD = [nothing, close_pair, near_real, near_one, at_both_ends, multiple]


def check(coefficients, noise):
    """Compare one row with Sturm's count, for the polynomial itself and some within its noise; whether it was proved.

    Where an end is left open, a root within EDGE of it is not asked about.
    """
    found = isolate(coefficients[None], np.array([noise]))
    if not found.proved[0]:
        return False
    order = np.argsort(found.value[0][found.inside[0]])
    roots, slopes = (part[0][found.inside[0]][order] for part in (found.value, found.slope_sign))
    low, high = ROOT_AT_END * found.open_at_minus_one[0] - 1, 1 - ROOT_AT_END * found.open_at_one[0]
    r, n = np.random.default_rng(0), coefficients.size
    steepest = np.eye(n)[n - 1] / 2 - (np.eye(n)[n - 3] / 2 if n > 2 else 0)  # the Chebyshev polynomial of that degree
    changes = [r.standard_normal(n) for _ in range(2)]
    changes = [0 * steepest, *(change / (np.abs(change) @ np.arange(1, n + 1)) for change in changes), steepest, -steepest]
    for change in changes:
        moved = coefficients + 0.999 * noise * change
        links = sturm.chain(sturm.powers(moved.tolist()))
        assert sturm.count(links, low, high) == roots.size
        edges = [low, *((roots[1:] + roots[:-1]) / 2), high]
        if roots.size:
            assert all(sturm.count(links, *pair) == 1 for pair in pairwise(edges))
            assert [sturm.sign(links[0], edge) for edge in edges[1:]] == slopes.tolist()
    return True


@pytest.mark.slow
@pytest.mark.parametrize("hard", HARD)
def test_what_is_proved_is_so(hard):
    """Gaps from 1e-12 to 0.1, exact coefficients and noisy ones: the count of roots is exact, each in its place."""
    r, proved = np.random.default_rng(HARD.index(hard)), 0
    for _ in range(20):
        roots = random_roots(r, int(r.integers(2, 9))) + hard(r, 10 ** r.uniform(-12, -1))
        c = np.array([float(a) for a in sturm.from_roots(roots)])
        proved += check(c, 0.0) + check(c, np.abs(c).max() * 10 ** r.uniform(-16, -6))
    assert proved >= (36 if hard in (nothing, multiple) else 8)


@pytest.mark.parametrize("gap", [1e-1, 1e-4])
def test_a_pair_of_roots_is_found_down_to_small_gaps(gap):
    """Two roots 1e-4 apart beside six others: still told apart, and proved."""
    roots = [0.3, 0.3 + gap, -0.7, 1.4, complex(0.1, 0.4), complex(-0.5, 0.9)]
    c = np.array([float(a) for a in sturm.from_roots(roots)])
    assert check(c, 0.0)


@pytest.mark.parametrize("gap", [1e-9, 1e-12, 0.0])
def test_a_pair_within_the_noise_is_not_proved(gap):
    """Two roots or none: coefficients known to 1e-13 cannot say, and neither does the proof."""
    for pair in ([0.3, 0.3 + gap], [complex(0.3, gap)]):
        c = np.array([float(a) for a in sturm.from_roots([*pair, -0.7, complex(0.1, 0.4)])])
        assert not isolate(c[None], np.array([1e-13])).proved[0]


def test_noise_that_grows_inside_a_disc_hides_no_roots():
    """x with a tenth of the Chebyshev polynomial of degree 21 has three roots about 0, within noise of 0.1 on [-1, 1]."""
    c = np.array([0.0, 1.0, *[0.0] * 19, 1e-6])
    assert not check(c, 0.1)
    assert check(c, 1e-3)
