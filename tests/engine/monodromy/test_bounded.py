"""Every rule of matrices with bounds on their errors, against exact fractions."""

from fractions import Fraction

import numpy as np
import pytest

from wavesweep.engine._monodromy import bounded
from wavesweep.engine._monodromy.bounded import Bounded, sum_rounding
from wavesweep.engine.doubles import EPS

TERMS = (1, 2, 3, 7, 24, 120, 1000)


def exact(matrix):
    """A matrix as fractions; a complex one as a real one of twice the size, with the same sums, products and inverses."""
    matrix = np.asarray(matrix)
    if np.iscomplexobj(matrix):
        matrix = np.block([[matrix.real, -matrix.imag], [matrix.imag, matrix.real]])
    return np.vectorize(Fraction, otypes=[object])(matrix)


def inverse(matrix):
    """By elimination, in fractions."""
    n = len(matrix)
    rows = np.concatenate([matrix, exact(np.eye(n))], 1)
    for column in range(n):
        pivot = column + np.flatnonzero(rows[column:, column])[0]
        rows[[column, pivot]] = rows[[pivot, column]]
        rows[column] = rows[column] / rows[column, column]
        for row in set(range(n)) - {column}:
            rows[row] = rows[row] - rows[row, column] * rows[column]
    return rows[:, n:]


def shares(found, truth):
    """The errors of a matrix over their bounds, all of which are positive."""
    off = exact(found.value) - truth
    n, m = found.value.shape
    square = off[:n, :m] ** 2
    if np.iscomplexobj(found.value):
        square = square + off[n:, :m] ** 2
    return np.sqrt((square / exact(found.error) ** 2).astype(float))


def matrix(r, rows, columns, of_complex):
    """Entries of many sizes."""
    found = r.normal(size=(rows, columns)) * 10.0 ** r.integers(-3, 4, (rows, columns))
    return found * np.exp(2j * np.pi * r.random(found.shape)) if of_complex else found


@pytest.mark.slow
@pytest.mark.parametrize("of_complex", [False, True])
@pytest.mark.parametrize("terms", TERMS)
def test_a_sum_of_products_is_within_its_bound_in_any_order(terms, of_complex):
    r = np.random.default_rng(terms)
    left = matrix(r, 2, terms, of_complex)
    right = matrix(r, terms, 2, of_complex)
    truth = exact(left) @ exact(right)
    found = Bounded.exact(left) @ right
    one_by_one = sum(left[:, [k]] * right[[k]] for k in range(terms))
    in_pairs = (left[:, None] * right.T).sum(-1)
    for value in (found.value, one_by_one, in_pairs):
        assert shares(found._replace(value=value), truth).max() <= 1


@pytest.mark.parametrize("terms", TERMS)
def test_a_sum_of_terms_within_bounds_is_within_one_that_is_little_more_than_theirs(terms):
    value = np.random.default_rng(terms).normal(size=terms)
    own = 1e-12 * np.abs(value)
    found = Bounded(value, own).sum(0)
    off = abs(Fraction(float(found.value)) - sum(map(Fraction, [*value.tolist(), *own.tolist()])))
    assert off <= Fraction(float(found.error))
    assert found.error <= 1.01 * own.sum() + 1.1 * terms * EPS * np.abs(value).sum()


@pytest.mark.parametrize("terms", TERMS[2:])
def test_the_worst_sum_of_equal_products_is_within_its_bound_and_needs_one_rounding_for_each_sixth_term(terms):
    """Equal terms round to the same side for long; of a few numbers the worst."""
    worst = 0.0
    for a, b in ((0.81, 0.63), (0.74, 0.82), *np.random.default_rng(0).uniform(0.5, 1, (12, 2))):
        found = Bounded.exact(np.full((1, terms), a)) @ np.full((terms, 1), b)
        one_by_one = float(np.add.accumulate(np.full(terms, a * b))[-1])
        truth = terms * Fraction(a) * Fraction(b)
        assert found.error[0, 0] <= 1.1 * (terms + 4) * EPS * float(truth)
        for value in (found.value[0, 0], one_by_one):
            off = abs(Fraction(value) - truth)
            assert off <= Fraction(found.error[0, 0])
            worst = max(worst, float(off / truth))
    assert worst > terms / 6 * EPS / 2


@pytest.mark.slow
@pytest.mark.parametrize("of_complex", [False, True])
@pytest.mark.parametrize("share", [0.0, 1e-13, 1e-3])
def test_what_operations_give_of_matrices_within_bounds_is_within_theirs(share, of_complex):
    """share: the bounds, of the entries. Members are at the ends of bounds, real or imaginary."""
    n = 3
    for seed in range(5):
        r = np.random.default_rng(seed)
        pairs = []
        members = []
        for rows, columns in ((n, n), (n, n), (n, 2), (1, 1), (1, 1)):
            value = r.normal(size=(rows, columns)) + 2 * (rows == columns) * np.eye(rows, columns)
            if of_complex:
                value = value + 1j * r.normal(size=value.shape)
            error = share * np.abs(value)
            ends = r.choice([-1, 1, 1j] if of_complex else [-1, 1], value.shape) * error
            pairs.append(Bounded(value, error))
            members.append(exact(value) + exact(ends))
        a, b, c, p, q = pairs
        A, B, C, P, Q = members
        eye = exact(np.eye(len(A)))
        results = [
            (a + b, A + B),
            (a - b, A - B),
            (a @ b, A @ B),
            (p * q, P @ Q),
            (p.over(q), P @ inverse(Q)),
            (a.inverse(), inverse(A)),
            (a.solved(c), inverse(A) @ C),
            (a.then(b), (eye + B) @ (eye + A) - eye),
        ]
        for found, truth in results:
            known = np.isfinite(found.error)
            assert known.all() or share == 1e-3
            assert shares(found._replace(error=np.where(known, found.error, 1e300)), truth).max() <= 1


def test_a_change_that_comes_to_rest_in_a_tick_carries_no_errors_on():
    rest = Bounded.exact(-np.eye(2))
    assert (Bounded(np.ones((2, 2)), np.ones((2, 2))).then(rest).error < 1e-14).all()
    assert rest.then(Bounded(np.ones((2, 2)), np.ones((2, 2)))).error.max() < 1e-14


def test_nothing_is_known_of_what_may_be_divided_by_zero():
    one = Bounded.exact(np.ones((1, 1)))
    assert one.over(Bounded(np.ones((1, 1)), 2 * np.ones((1, 1)))).error == np.inf
    assert (Bounded(np.eye(2), 0.6 * np.eye(2)).inverse().error == np.inf).all()
    singular = Bounded.exact(np.array([[0.1, 0.3], [0.2, 0.6]]))
    assert (singular.inverse().error == np.inf).all()
    assert (singular.solved(Bounded.exact(np.ones((2, 1)))).error == np.inf).all()


@pytest.mark.parametrize("noise", [0.0, 1e-38])
def test_an_unknown_that_may_be_anything_leaves_those_that_do_not_depend_on_it_their_bounds(noise, monkeypatch):
    """noise: where the inverse has a 0, of the factors that a processor's LAPACK makes it from."""
    inverse_of = bounded.inverse
    monkeypatch.setattr(bounded, "inverse", lambda A: inverse_of(A) + noise * np.array([[0, 1], [0, 0]]))
    A = Bounded((2 + 0.6j) * np.array([[1, 0], [1, 1e-20]]), np.array([[1e-3, 0.0], [0.0, 1e-10]]))
    found = A.solved(Bounded.exact(np.array([[1.0], [3.0]])))
    assert np.abs(found.value[0] - 1 / (1.9991 + 0.6j)) <= found.error[0] < 1e-3
    assert found.error[1] == np.inf


def test_an_inverse_has_all_orders_of_the_errors():
    """That of [[0.8, -0.2], [-0.2, 0.8]], within 0.2 of the identity, is off by 1/3, of which 0.2 is of first order."""
    error = Bounded(np.eye(2), np.full((2, 2), 0.2)).inverse().error
    assert ((error > 1 / 3) & (error < 0.4)).all()


def test_a_product_that_underflows_is_not_known_as_zero():
    found = Bounded.exact(np.full((1, 3), 1e-200)) @ np.full((3, 1), 1e-170)
    assert found.value == 0
    assert Fraction(found.error[0, 0]) >= 3 * Fraction(1e-200) * Fraction(1e-170)


def test_blocks_are_as_high_and_wide_as_their_neighbours():
    a = Bounded(np.full((5, 2, 2), 3.0), np.ones((5, 2, 2)))
    b = Bounded.exact(np.ones((1, 2, 1)))
    found = Bounded.block([[a, b], [b.mT, -1]])
    assert found.value[4].tolist() == [[3, 3, 1], [3, 3, 1], [1, 1, -1]]
    assert found.error[4].tolist() == [[1, 1, 0], [1, 1, 0], [0, 0, 0]]


def test_a_rounding_for_each_term():
    assert sum_rounding(1) >= EPS / 2
    assert sum_rounding(1000) >= 500 * EPS


def test_an_infinite_bound_is_that_of_whatever_it_is_multiplied_with():
    """Times zero it leaves the others as they are; some BLAS multiply it by zeros of their own."""
    unknown = Bounded(np.ones((3, 3)), np.full((3, 3), np.inf))
    assert ((unknown @ np.ones((3, 3))).error == np.inf).all()
    assert (Bounded.exact(np.zeros((3, 3))).then(unknown).error == np.inf).all()
    assert (unknown.then(Bounded.exact(np.ones((3, 3)))).error == np.inf).all()
    assert (unknown.then(Bounded.exact(-np.eye(3))).error < 1e-14).all()
    column = Bounded(np.ones((3, 3)), np.array([[np.inf, 0, 0]] * 3))
    found = column @ np.diag([0.0, 1, 1])
    assert (found.error < 1e-14).all()
    assert ((Bounded.exact(np.diag([0.0, 1, 1])) @ column.mT).error[0] < 1e-14).all()
    found = column @ np.ones((3, 3))
    assert (found.error == np.inf).all()
