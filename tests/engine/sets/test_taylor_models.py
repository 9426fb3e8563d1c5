"""Numbers and matrices over a cell: what is enclosed, held against mpmath and SciPy at places of the cell."""

from fractions import Fraction
from operator import mul

import mpmath
import numpy as np
import pytest
from flint import arb
from scipy.linalg import expm

from wavesweep.engine._sets import taylor_models
from wavesweep.engine._sets.taylor_models import Polynomials, TaylorModel, UnresolvedError, monomials

FUNCTIONS = {
    "inverse": lambda x: 1 / x,
    "sqrt": mpmath.sqrt,
    "exp": mpmath.exp,
    "log": mpmath.log,
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "tan": mpmath.tan,
}


def value_at(model, s):
    """The polynomial at a place, with all digits."""
    total = mpmath.mpf(0)
    for term, exponents in zip(model.terms.tolist(), monomials(model.numbers, model.order)[0].tolist(), strict=True):
        product = mpmath.mpf(term)
        for place, exponent in zip(s, exponents, strict=True):
            product *= mpmath.mpf(float(place)) ** exponent
        total += product
    return total


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("order", [2, 5, 10])
def test_functions_are_within_their_rest_and_the_rest_is_of_the_size_of_what_is_left_out(name, order):
    rng = np.random.default_rng(order)
    with mpmath.workdps(40):
        for width in (0.0, 1e-9, 1e-3, 0.1, 0.4):
            centre = rng.uniform(0.6, 1.2)
            low, high = centre - width, centre + width
            model = TaylorModel.side(0, low, high, 1, order)
            found = getattr(model, name)()
            off = []
            for s in np.linspace(-1, 1, 41):
                exact = FUNCTIONS[name](
                    mpmath.mpf(float(model.terms[0])) + mpmath.mpf(float(model.terms[1])) * mpmath.mpf(float(s))
                )
                off.append(float(abs(exact - value_at(found, [s]))))
            assert max(off) <= found.rest
            if max(off) > 1e-12:
                assert max(off) > found.rest / 300


def test_arithmetic_of_models_numbers_and_balls_encloses_that_of_their_values():
    rng = np.random.default_rng(3)
    with mpmath.workdps(40):
        for _ in range(60):
            ends = np.sort(rng.uniform(0.5, 2, (2, 2)))
            a, b = (TaylorModel.side(at, *row, 2, 4) for at, row in enumerate(ends))
            third, whole = arb(1) / 3, float(rng.integers(-3, 4))
            found = (a * b - third * a) / (b + 2) + whole * a**3 - (1 / a) ** 2 + b**0.3 * 2**a - third
            for s in rng.uniform(-1, 1, (6, 2)):
                x, y = (value_at(each, s) for each in (a, b))
                one = mpmath.mpf(1) / 3
                power = mpmath.mpf(0.3)
                exact = (x * y - one * x) / (y + 2) + whole * x**3 - 1 / x**2 + y**power * mpmath.mpf(2) ** x - one
                assert abs(exact - value_at(found, s)) <= found.rest


WIDE = {  # of x and y from 0 to 1, and -1 to 1: what a cell that is far too wide for a series is known to be within
    "a Gaussian": (lambda x, y: (-(((x - y) * 40) ** 2)).exp(), 0.0, 1.0),
    "a resonance": (lambda x, y: 1 / (1 + ((x - y) * 40) ** 2), 0.0, 1.0),
    "a root at 0": (lambda x, y: x.sqrt() + 0 * y, 0.0, 1.0),
    "a kink": (lambda x, y: (y * y).sqrt() + 0 * x, 0.0, 1.0),
    "a sine": (lambda x, y: (30 * (x + y)).sin(), -1.0, 1.0),
}


@pytest.mark.parametrize("name", WIDE)
def test_what_holds_for_all_arguments_bounds_a_function_in_a_cell_that_is_too_wide_for_a_series(name):
    function, low, high = WIDE[name]
    x, y = TaylorModel.side(0, 0.0, 1.0, 2, 6), TaylorModel.side(1, -1.0, 1.0, 2, 6)
    matrix = Polynomials.of_entries([[function(x, y)]], (1, 1), 2, 6)
    assert matrix.whole[0, 0] <= max(high, -low) * 1.01
    assert (np.abs(matrix.terms[[1, 2]]).sum() > 0) or name in ("a root at 0", "a kink")  # it says on what it depends
    grid = np.linspace(-1, 1, 21)
    for s in [(a, b) for a in grid for b in grid]:
        own = [arb((1 + s[0]) / 2), arb(s[1])]
        exact = float(function(*own).mid())
        assert abs(exact - float(value_at(x._like(matrix.terms[:, 0, 0], 0.0), s))) <= matrix.rest[0, 0] + 1e-12


def random_matrix(rng, n=3, order=4, size=0.1):
    """A matrix of two numbers."""
    terms = size * rng.normal(size=(len(monomials(2, order)[0]), n, n)) / 2.0 ** monomials(2, order)[0].sum(1)[:, None, None]
    return Polynomials(terms, np.abs(rng.normal(size=(n, n))) * 1e-9, 2, order)


def some_of(matrix, s, rng):
    """A matrix that is enclosed, at a place."""
    return np.tensordot((s**matrix.exponents).prod(1), matrix.terms, 1) + rng.uniform(-1, 1, matrix.rest.shape) * matrix.rest


def exact_product(one, two, s):
    """The product of two polynomials at a place whose powers of 2 are exact, as fractions."""
    values = []
    for matrix in (one, two):
        weights = [Fraction(float(weight)) for weight in (s**matrix.exponents).prod(1)]
        n, m = matrix.rest.shape
        entries = [[[Fraction(float(term)) for term in matrix.terms[:, i, j]] for j in range(m)] for i in range(n)]
        values.append([[sum(map(mul, weights, entry)) for entry in row] for row in entries])
    left, right = values
    columns = list(zip(*right, strict=True))
    return np.array([[float(sum(map(mul, row, column))) for column in columns] for row in left])


@pytest.mark.parametrize("absent", [0.0, 0.6])
@pytest.mark.parametrize("piece", [1, 400, 1 << 17])
def test_products_enclose_those_of_all_members_and_have_no_more_rest_than_that_takes(absent, piece, monkeypatch):
    """Of positive terms all that is left out has one sign, so that the rest is met at a corner, and a tenth is too little."""
    monkeypatch.setattr(taylor_models, "PIECE", piece)
    rng = np.random.default_rng(8)
    size = len(monomials(3, 3)[0])
    shapes = (2, 4), (4, 3)
    one, two = (
        Polynomials(rng.uniform(size=(size, *shape)) * (rng.random((size, 1, 1)) >= absent), np.zeros(shape), 3, 3)
        for shape in shapes
    )
    found = one @ two
    for s in (np.ones(3), np.array([0.5, -1.0, 0.25]), np.array([-1.0, 1.0, -0.5])):
        off = np.abs(exact_product(one, two, s) - np.tensordot((s**found.exponents).prod(1), found.terms, 1))
        assert (off <= found.rest + 1e-13).all()
        if (s == 1).all():
            assert (off >= 0.999 * found.rest).all()


@pytest.mark.parametrize("size", [0.01, 0.3, 2.0])
def test_exponentials_enclose_those_of_all_members(size):
    rng = np.random.default_rng(5)
    A = random_matrix(rng, size=size)
    units = 10.0 ** np.array([-6.0, 0.0, 4.0])
    A = A.times(units[:, None] / units)  # states of other units
    found = A.exponential()
    for s in rng.uniform(-1, 1, (60, 2)):
        exact = expm(some_of(A, s, rng))
        assert (
            np.abs(exact - np.tensordot((s**found.exponents).prod(1), found.terms, 1)) <= found.rest + 1e-13 * np.abs(exact)
        ).all()


def test_exponentials_of_long_chains_enclose_their_smallest_entries():
    """From state to state along a chain of 17 an entry is the term 15 of the series, and no other."""
    chain = 0.2 * np.eye(17, k=1)
    found = Polynomials.constant(chain, 1, 2).exponential()
    with mpmath.workdps(40):
        exact = mpmath.expm(mpmath.matrix(chain.tolist()))
        for at in range(17):
            assert abs(exact[0, at] - found.terms[0, 0, at]) <= found.rest[0, at]
    assert (found.rest[np.tril_indices(17, -1)] == 0).all()  # nothing goes back along the chain


def test_products_count_the_rounding_of_what_they_leave_out():
    """The highest power of one times terms of half a rounding of the other: sums over the degrees lose these."""
    one = Polynomials(np.zeros((11, 1, 1)), np.zeros((1, 1)), 1, 10)
    one.terms[10] = 1.0
    two = Polynomials(np.full((11, 1, 1), 0.9 * taylor_models.UNIT_ROUNDING), np.zeros((1, 1)), 1, 10)
    two.terms[0] = 1.0
    exact = sum(map(Fraction, one.terms.ravel().tolist())) * sum(map(Fraction, two.terms.ravel().tolist()))
    for found in (one @ two, one.entrywise(two)):
        of_terms = sum(map(Fraction, found.terms.ravel().tolist()))
        assert abs(exact - of_terms) <= Fraction(float(found.rest[0, 0]))


def test_inverses_enclose_those_of_all_members_and_are_refused_where_one_may_be_singular():
    rng = np.random.default_rng(6)
    A = random_matrix(rng) + Polynomials.constant(np.diag([1.0, -2.0, 3.0]), 2, 4)
    found = A.inverse()
    for s in rng.uniform(-1, 1, (60, 2)):
        exact = np.linalg.inv(some_of(A, s, rng))
        assert (np.abs(exact - np.tensordot((s**found.exponents).prod(1), found.terms, 1)) <= found.rest + 1e-14).all()
    terms = A.terms.copy()
    terms[1, 0, 0] = 1.5
    with pytest.raises(UnresolvedError):
        Polynomials(terms, A.rest, 2, 4).inverse()
