"""Real roots of a polynomial in (-1, 1): what is called proved must be so, exactly."""

from itertools import pairwise
from math import comb

import numpy as np
import pytest
from support import sturm

from wavesweep.engine._stability import bernstein
from wavesweep.engine._stability.bernstein import change_of_basis, largest_bernstein, roots_by_sign
from wavesweep.engine._stability.real_roots import ROOT_AT_END, by_discs, isolate

METHODS = [isolate, by_discs]


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


def check(coefficients, noise, method=isolate):
    """Compare one row with Sturm's count, for the polynomial itself and some within its noise; whether it was proved.

    Where an end is left open, a root within EDGE of it is not asked about.
    """
    found = method(coefficients[None], np.array([noise]))
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


@pytest.mark.sample(2)
@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("hard", HARD)
def test_what_is_proved_is_so(hard, method):
    """Gaps from 1e-12 to 0.1, exact coefficients and noisy ones: the count of roots is exact, each in its place."""
    r, proved = np.random.default_rng(HARD.index(hard)), 0
    for _ in range(20):
        roots = random_roots(r, int(r.integers(2, 9))) + hard(r, 10 ** r.uniform(-12, -1))
        c = np.array([float(a) for a in sturm.from_roots(roots)])
        proved += check(c, 0.0, method) + check(c, np.abs(c).max() * 10 ** r.uniform(-16, -6), method)
    assert proved >= (36 if hard in (nothing, multiple) else 8)


@pytest.mark.parametrize("gap", [1e-1, 1e-2, 1e-3, 1e-4])
def test_a_pair_of_roots_is_found_down_to_small_gaps(gap):
    """Two roots 1e-4 apart beside six others: still told apart, and proved."""
    roots = [0.3, 0.3 + gap, -0.7, 1.4, complex(0.1, 0.4), complex(-0.5, 0.9)]
    c = np.array([float(a) for a in sturm.from_roots(roots)])
    assert check(c, 0.0)


@pytest.mark.parametrize("gap", [1e-9, 1e-12, 0.0])
@pytest.mark.parametrize("method", METHODS)
def test_a_pair_within_the_noise_is_not_proved(gap, method):
    """Two roots or none: coefficients known to 1e-13 cannot say, and neither does the proof."""
    for pair in ([0.3, 0.3 + gap], [complex(0.3, gap)]):
        c = np.array([float(a) for a in sturm.from_roots([*pair, -0.7, complex(0.1, 0.4)])])
        assert not method(c[None], np.array([1e-13])).proved[0]


def test_signs_decide_ordinary_rows_and_find_what_discs_find():
    """Random rows: nearly all decided without an eigenvalue, with the same roots and slopes."""
    c = np.random.default_rng(0).standard_normal((300, 9)) / np.arange(1, 10)
    (row, value, within, slope), complete = roots_by_sign(c / np.abs(c).max(-1, keepdims=True), np.full(300, 1e-13))
    found = by_discs(c, np.full(300, 1e-13))
    assert complete.mean() > 0.98
    together = np.abs(value[:, None] - value) + 3.0 * ((row[:, None] != row) | np.eye(row.size, dtype=bool))
    assert np.all((within > 0) & (within < together.min(-1)) & (within <= 1 - np.abs(value)))
    for index in np.flatnonzero(complete & found.proved):
        inside = found.inside[index]
        order = np.argsort(found.value[index][inside])
        np.testing.assert_allclose(value[row == index], found.value[index][inside][order], atol=1e-9)
        assert slope[row == index].tolist() == found.slope_sign[index][inside][order].tolist()


@pytest.mark.parametrize("noise", [1e-15, 1e-10, 1e-5])
def test_a_stretch_that_noise_alone_may_be_is_given_up_at_once(monkeypatch, noise):
    """`x^9` is below the noise over a wide stretch: halving every piece of it 24 times would make millions."""
    seen, halves = [], bernstein._halves

    def counting(b):
        seen.append(b.shape[-1])
        return halves(b)

    monkeypatch.setattr(bernstein, "_halves", counting)
    c = np.array([float(a) for a in sturm.from_roots([0.0] * 9)])
    _, complete = roots_by_sign(np.tile(c / np.abs(c).max(), (20, 1)), np.full(20, noise))
    assert not complete.any()
    assert sum(seen) < 20 * 24


@pytest.mark.parametrize("n", [2, 5, 9, 16])
def test_bernstein_coefficients_are_those_of_the_polynomial(n):
    """Every U_k summed up in both bases; and a Chebyshev polynomial has the largest coefficients that noise may have."""
    x = np.linspace(-0.9, 0.8, 7)
    t, angle = (x + 1) / 2, np.arccos(x)
    bernstein = np.array([comb(n - 1, i) * t**i * (1 - t) ** (n - 1 - i) for i in range(n)])
    second_kind = np.array([np.sin((k + 1) * angle) / np.sin(angle) for k in range(n)])
    np.testing.assert_allclose(change_of_basis(n).T @ bernstein, second_kind, atol=1e-10)
    first_kind = np.zeros(n)
    first_kind[n - 1] = 0.5
    first_kind[max(n - 3, 0)] -= 0.5 * (n > 2)
    assert np.abs(change_of_basis(n) @ first_kind).max() == pytest.approx(largest_bernstein(n - 1))


@pytest.mark.parametrize("tail", [[1e-14], [1e-12, 1e-17], [-1e-10, 3e-14, 1e-20]])
def test_tiny_leading_coefficients_send_roots_far_away_and_do_no_harm(tail):
    """The roots are seeds for polishing: a root at 1e14 costs the others digits (here all but 4), not their proof."""
    c = np.array([float(a) for a in sturm.from_roots([0.3, -0.2, complex(0.5, 0.5)])] + tail)
    assert check(c, 0.0)
    found = isolate(c[None], np.zeros(1))
    np.testing.assert_allclose(np.sort(found.value[found.inside]), [-0.2, 0.3], atol=1e-4)


@pytest.mark.parametrize("tail", [[0.0], [0.0, 0.0], [0.0] * 4, [1e-18], [1e-300, 0.0]])
def test_leading_zeros_may_cost_the_proof_but_never_make_it_wrong(tail):
    """Roots at infinity overflow what is evaluated there, without a warning."""
    c = np.array([float(a) for a in sturm.from_roots([0.3, -0.2, complex(0.5, 0.5)])] + tail)
    check(c, 0.0)


@pytest.mark.parametrize("row", [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0], [0.0], []])
def test_degenerate_rows_are_answered_without_a_warning(row):
    """Nothing, a constant, all zero: all zero is never proved, a constant has no root."""
    found = isolate(np.array([row]).reshape(1, -1), np.zeros(1))
    assert bool(found.proved[0]) == any(row)
    if any(row):
        assert found.inside.sum() == (2 if len(row) == 3 else 0)  # U_2 = 4 x^2 - 1


def test_the_signs_at_the_ends_and_the_slopes_are_those_of_the_polynomial():
    c = np.array([float(a) for a in sturm.from_roots([-0.9, -0.1, 0.4])])[None]
    found = isolate(c, np.zeros(1))
    order = np.argsort(found.value[0])
    assert found.at_one[0] > 0 > found.at_minus_one[0]
    assert found.slope_sign[0][order].tolist() == [1, -1, 1]


def test_rows_do_not_see_their_neighbours():
    """A hopeless row beside a good one changes nothing about the good one."""
    good = np.array([float(a) for a in sturm.from_roots([0.3, -0.2, 1.5])])
    alone = isolate(good[None], np.zeros(1))
    beside = isolate(np.stack([good, np.zeros(4), 1e200 * good]), np.zeros(3))
    assert beside.proved.tolist() == [True, False, True]
    assert np.array_equal(beside.value[0], alone.value[0])
