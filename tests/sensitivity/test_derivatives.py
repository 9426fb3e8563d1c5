"""Derivatives of crossings of the unit circle, against matrices whose eigenvalues are known."""

import numpy as np
import pytest

from wavesweep.engine._stability.spectrum import damping_ratio, least_damping
from wavesweep.sensitivity.sensitivity import crossings_of, tracked_eigenvalue


def matrices(r, blocks):
    """Block-diagonal matrices in random coordinates of unlike units, the same for all."""
    n = sum(len(block) for block in blocks[0])
    T = r.normal(size=(n, n)) * 10.0 ** r.uniform(-4, 4, (n, 1))
    for some in blocks:
        whole, at = np.zeros((n, n)), 0
        for block in some:
            whole[at : at + len(block), at : at + len(block)] = block
            at += len(block)
        yield T @ whole @ np.linalg.inv(T)


def turn(angle, radius=1.0):
    return radius * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def found(E, dE_end, dE, theta, size=1.0):
    one = [np.asarray(part)[None] for part in (E - np.eye(len(E)), dE_end, dE, theta, size, True)]
    return crossings_of(*one)


@pytest.mark.parametrize("seed", range(5))
def test_the_end_moves_by_minus_the_ratio_of_the_growths(seed):
    """z = (1 + 3 p + 5 q) exp(j angle) leaves the circle at p = -5 q / 3."""
    r = np.random.default_rng(seed)
    slow, zero = np.diag([0.4, -0.2]), np.zeros((2, 2))
    E, by_p, by_q = matrices(r, [(turn(0.7), slow), (turn(0.7, 3.0), zero), (turn(0.7, 5.0), zero)])
    crossing = found(E, by_p, np.stack([by_q, 0 * by_q]), 0.7)
    np.testing.assert_allclose(crossing.slope, [[-5 / 3, 0]], atol=1e-9)
    assert (np.abs(crossing.slope - [[-5 / 3, 0]]) <= crossing.error).all()
    assert (crossing.error < 1e-6).all()
    assert not crossing.defective.any()


def test_two_crossings_at_an_end_are_both_there_and_the_one_that_sets_it_is_the_first():
    r = np.random.default_rng(1)
    E, by_p, by_q = matrices(
        r,
        [
            (turn(0.7), turn(2.0, 1 - 1e-8), turn(1.5, 0.9)),
            (turn(0.7), turn(2.0), turn(1.5)),
            (turn(0.7), 2 * turn(2.0), turn(1.5)),
        ],
    )
    crossing = found(E, by_p, by_q[None], 0.7)
    assert crossing.number.tolist() == [0, 1]
    np.testing.assert_allclose(np.angle(1 + crossing.delta), [0.7, 2.0], atol=1e-6)
    np.testing.assert_allclose(crossing.slope, [[-1], [-2]], rtol=1e-6)


def test_two_eigenvalues_that_meet_have_no_derivative():
    E = np.array([[-1.0, 1.0], [0.0, -1.0]])
    crossing = found(E, -np.eye(2), np.eye(2)[None], np.pi)
    assert crossing.defective.all() or np.isinf(crossing.error).all()
    assert not (crossing.error <= 1e-6).any()


def test_a_crossing_in_the_wrong_direction_or_of_no_known_frequency_is_not_trusted():
    E = np.diag([1.0, 0.5])
    assert found(E, np.eye(2), E[None], 0.0).error[0] < 1e-12
    assert np.isinf(found(E, -np.eye(2), E[None], 0.0).error).all()
    assert np.isinf(found(E, np.eye(2), E[None], np.nan).error).all()


def test_a_mode_is_followed_through_others_that_come_near():
    """The eigenvalues s and 1 - s meet at 0.5, where the nearest value alone would not tell them apart."""
    s = np.linspace(0, 1, 97)[1:]
    path = np.stack([s, 1.0 - s], -1)[None].astype(complex)
    assert tracked_eigenvalue(path, np.array([0j])) == 1
    path = np.stack([s, 1 - s + 0.3j], -1)[None]
    assert tracked_eigenvalue(path, np.array([0j])) == 1


def test_damping_ratios():
    s = np.array([-0.3 + 0.4j, -0.5, 0.2j, 0.3 + 0.4j])
    np.testing.assert_allclose(damping_ratio(np.expm1(s)), [0.6, 1, 0, -0.6], atol=1e-12)
    assert np.isnan(damping_ratio(np.array([0j]))).all()


def test_a_least_damping_ratio_that_rounding_decides_is_not_sure():
    """Of a Jordan block of 10 states at -0.5 in a dense basis, eigenvalues are computed to a few per cent."""
    Q = np.linalg.qr(np.random.default_rng(1).standard_normal((10, 10)))[0]
    apart, meeting = (
        Q @ (each - np.eye(10)) @ Q.T for each in (np.diag(np.linspace(0.1, 0.9, 10)), np.eye(10, k=1) - 0.5 * np.eye(10))
    )
    pair = Q @ (np.kron(np.eye(5), 0.9 * np.array([[0.6, -0.8], [0.8, 0.6]])) * np.linspace(0.5, 1, 10) - np.eye(10)) @ Q.T
    least, sure = least_damping(np.array([apart, meeting, pair]))
    assert sure.tolist() == [True, False, True]
    s = np.log(np.linalg.eigvals(np.eye(10) + pair))
    assert least[[0, 2]] == pytest.approx([1.0, (-s.real / np.abs(s)).min()], abs=1e-9)
