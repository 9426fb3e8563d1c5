"""Units in which a matrix is balanced, and verdicts on the circle."""

import mpmath
import numpy as np
import pytest
from flint import arb_mat, ctx
from support import certified

import wavesweep
from wavesweep.engine._monodromy.rounding import balance
from wavesweep.engine._stability import spectrum
from wavesweep.engine._stability.spectrum import count_outside, eigenvalues, is_stable, radius_of


def test_balancing_changes_the_units_of_states_and_no_eigenvalue():
    r = np.random.default_rng(1)
    units = 10.0 ** r.uniform(-6, 6, (50, 5))
    E = r.normal(size=(50, 5, 5))
    graded = E * units[:, None, :] / units[:, :, None]
    balanced, found = balance(graded)
    assert np.array_equal(balanced, graded * found[:, None, :] / found[:, :, None])  # powers of two
    assert np.array_equal(np.diagonal(balanced, 0, 1, 2), np.diagonal(graded, 0, 1, 2))
    assert np.abs(balanced).max() < 1e3
    for one, other in zip(np.linalg.eigvals(balanced), np.linalg.eigvals(E), strict=True):
        np.testing.assert_allclose(np.sort_complex(one), np.sort_complex(other), rtol=1e-9)


@pytest.mark.parametrize(("distance", "inside"), [(0.0, False), (1e-16, False), (1e-12, True), (-1e-12, False)])
def test_what_rounding_alone_keeps_within_the_circle_is_not_stable(distance, inside):
    """A rotation by any angle, in units of the states that are far apart."""
    angle, units = np.linspace(0.01, 3.1, 40), np.array([1e8, 1.0])
    turn = np.stack([np.stack([np.cos(angle), -np.sin(angle)], -1), np.stack([np.sin(angle), np.cos(angle)], -1)], -2)
    E = ((1 - distance) * turn - np.eye(2)) * (units[None, :] / units[:, None])
    assert (is_stable(E) == inside).all()
    radius = radius_of(E)
    assert ((radius < 1) == inside).all()
    np.testing.assert_allclose(radius, 1 - distance, rtol=0, atol=1e-14)
    assert [float(radius_of(each)) for each in E] == radius.tolist()  # alone as in a batch


@pytest.mark.slow
@pytest.mark.whole
def test_an_undamped_mode_is_not_stable_at_any_stiffness():
    """The sign of rounding decided: stable at some of them, with a steady response. Doubles cannot tell 1 from less."""
    spec = {"device": {"damping": 0.0}, "controller": {"kind": "dc-slow"}, "environment": {"B_VE": 0.0, "K_VE": 0.0}}
    for stiffness in (10.0, 50.0, 100.0, 200.0, 500.0):
        hand = spec | {"operator": {"stiffness": stiffness}, "bode": {"frequency_hz": [1.0]}}
        assert wavesweep.bode(hand)[["stable", "doubt"]].values.tolist() == [[False, "rounding"]]
        assert not wavesweep.passivity(hand)["stable"].any()


def with_delays(poles, steps):
    """A frame less identity: a Jordan block of that many poles at 0.995, read through a delay by a state of its own."""
    n = poles + steps
    A = np.diag(np.r_[np.full(poles, 0.995), np.zeros(steps)]) + np.diag(np.ones(n - 1), -1)
    A[-1, -1], A[0, -1] = 0.3, 1e-3 if poles == 1 else 0.0
    return A - np.eye(n)


@pytest.mark.parametrize(("poles", "known"), [(1, True), (2, True), (8, False)])
def test_long_delays_do_not_change_whether_a_radius_is_known(monkeypatch, poles, known):
    """Delays alone lose no digit of it, poles that meet do; with delays left out, and with all singular values."""
    E = with_delays(poles, 60)
    found = float(radius_of(E))
    monkeypatch.setattr(spectrum, "STATES_WITHOUT_DELAYS", 1000)
    np.testing.assert_equal(found, float(radius_of(E)))
    assert np.isfinite(found) == known


def test_a_bound_without_delays_is_below_the_smallest_singular_value():
    """And not by more than the number of states: the norm that it is from is no more than their root larger."""
    E, w = with_delays(3, 60), 1.01 * np.exp(1j * np.linspace(0, 3, 7)) - 1
    balanced, units = balance(E[None])
    bound, exact = spectrum._at_least(E, units[0], w), np.linalg.svd(w[:, None, None] * np.eye(63) - balanced)[1][:, -1]
    assert np.all(bound <= exact)
    assert np.all(bound >= exact / 63)


@pytest.mark.parametrize("apart", [1e-1, 1e-4, 1e-7])
def test_a_bound_by_eigenvectors_is_below_the_smallest_singular_value(apart):
    """In 50 digits, also where eigenvectors are nearly dependent, and the bound says little or nothing."""
    random = np.random.default_rng(4)
    values = np.exp(1j * np.linspace(0.2, 2.8, 6)) * 0.9
    values[1] = values[0] + apart
    real = np.zeros((12, 12))
    for k, value in enumerate(values):
        real[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[value.real, value.imag], [-value.imag, value.real]]
    real += np.triu(random.normal(size=(12, 12)), 2)
    turn = np.linalg.qr(random.normal(size=(12, 12)))[0]
    E = turn @ real @ turn.T - np.eye(12)
    w = np.append(1.01 * np.exp(1j * np.linspace(0, 3, 7)), values[0] + apart / 10) - 1
    bound, known = spectrum._by_eigenvectors(E, w), 0
    with mpmath.workdps(50):
        for point, least in zip(w, bound, strict=True):
            A = mpmath.mpc(complex(point)) * mpmath.eye(12) - mpmath.matrix(E.tolist())
            exact = min(mpmath.svd_c(A, compute_uv=False))
            assert least <= exact
            known += least > 0
    assert known >= 7 * (apart > 1e-6)


def in_a_row(radii, coupling=1.0):
    """Less identity, rotations by a radian with these radii, each of which acts on the next one, and their states shuffled."""
    turn, n = np.array([[np.cos(1), -np.sin(1)], [np.sin(1), np.cos(1)]]), 2 * len(radii)
    E = np.zeros((n, n))
    for k, radius in enumerate(radii):
        at = slice(2 * k, 2 * k + 2)
        E[at, at] = radius * turn - np.eye(2)
        if k:
            E[at, 2 * k - 2 : 2 * k] = coupling
    order = np.random.default_rng(n).permutation(n)
    return E[order][:, order]


def test_equal_loops_in_a_row_keep_the_digits_of_one():
    """As one matrix they have a Jordan block, whose computed eigenvalues are off by the eighth root of a rounding."""
    E = in_a_row([0.99] * 8)
    assert np.abs(1 + np.linalg.eigvals(E)).max() > 0.9905
    assert float(radius_of(E)) == pytest.approx(0.99, rel=1e-14)
    assert np.abs(1 + eigenvalues(E)[0]) == pytest.approx(np.full(16, 0.99), rel=1e-14)
    assert np.array(count_outside(E[None])).tolist() == [[0], [True]]


@pytest.mark.parametrize("shape", [(0, 0), (3, 0, 0), (0, 2, 2), (1, 1)])
def test_matrices_without_entries_have_no_eigenvalue_outside(shape):
    E = np.zeros(shape) - 0.5
    assert eigenvalues(E)[0].shape == shape[:-1]
    assert is_stable(E).all()
    assert (radius_of(E) <= 0.5).all()
    assert spectrum.diagonal_blocks(E) == []


def test_loops_in_a_row_are_judged_one_by_one():
    """A matrix without a coupling has other blocks, one that is not finite has no eigenvalue, whatever its blocks are."""
    E = np.stack(
        [in_a_row([0.5, 1.2, 0.9]), in_a_row([0.5, 1.2, 0.9], 0.0), in_a_row([1.1, 1.2, 1.2]), in_a_row([0.9, 1.0, 0.7])]
    )
    E[1, 0, 0] -= 1e-9  # so that no block is like another's
    lost = E[:1].copy()
    lost[0, 5, np.flatnonzero(lost[0, 5])[0]] = np.inf
    E = np.concatenate([E, lost])
    assert radius_of(E)[[0, 2, 3, 4]] == pytest.approx([1.2, 1.2, 1.0, np.inf], rel=1e-14)
    assert np.array_equal(radius_of(E), [radius_of(each) for each in E])
    assert np.array_equal(eigenvalues(E)[0], [eigenvalues(each)[0] for each in E])
    count, clear = count_outside(E)
    assert (count.tolist(), clear.tolist()) == ([2, 2, 6, count[3], -1], [True, True, True, False, False])
    assert np.isnan(radius_of(E[:1], np.array([True]))).all()


def test_eigenvalues_are_counted_in_units_that_are_far_apart():
    """Their largest entry is no measure of the rounding of eigenvalues, whose computation chooses units of its own."""
    r = np.random.default_rng(11)
    E, units = r.normal(size=(40, 4, 4)) / 2 - np.eye(4), np.exp2(np.array([0, 90, -150, 40]))
    count, clear = count_outside(E)
    assert clear.all()
    assert [part.tolist() for part in count_outside(E * units / units[:, None])] == [count.tolist(), clear.tolist()]
    on = 0.6 * E
    on[:, 0], on[:, 0, 0] = 0.0, -2.0  # an eigenvalue -1
    assert not count_outside(on * units / units[:, None])[1].any()


def test_a_bound_on_the_smallest_singular_value_of_many_states_is_none_too_large(monkeypatch):
    r = np.random.default_rng(7)
    E = r.normal(size=(2, 20, 20)) / 5
    E[1, :, 3] = E[1, :, 4] * (1 + 1e-9)  # nearly singular at delta = 0
    delta = np.array([[0.0, 0.3 + 0.4j], [0.0, -2.0]])
    exact = spectrum._smallest(E, delta)
    monkeypatch.setattr(spectrum, "BOUNDED_STATES", 20)
    bound = spectrum._smallest(E, delta)
    assert (bound <= exact * (1 + 1e-6)).all()
    assert (bound >= exact / np.sqrt(20)).all()
    assert spectrum._smallest(np.zeros((1, 20, 20)), np.zeros((1, 1))).max() < 1e-15


@pytest.mark.parametrize("n", [1, 2, 5, 9])
def test_eigenvalues_next_to_the_circle_are_counted_as_ball_arithmetic_counts_them(n):
    """No clear count is wrong."""
    random, known, before = np.random.default_rng(n), 0, ctx.prec
    ctx.prec = 2000
    try:
        for _ in range(60):
            radius = 1 + random.choice([-1, 1], n) * 10.0 ** random.uniform(-16 / n, 0, n)
            own = np.diag(radius * random.choice([-1, 1], n) - 1) + np.triu(random.normal(size=(n, n)), 1)
            change = np.linalg.qr(random.normal(size=(n, n)))[0] * 2.0 ** random.integers(-8, 8, n)
            E = np.linalg.solve(change, own @ change)
            (count,), (clear,) = count_outside(E[None])
            known += clear
            if clear:
                whole = arb_mat(n, n, E.ravel().tolist()) + arb_mat(n, n, np.eye(n).ravel().tolist())
                assert count == certified.count_outside(whole.charpoly())
    finally:
        ctx.prec = before
    assert known > 40
