"""The noise of the polynomial is a bound: on rounding, and on what errors of a frame's entries make of it."""

import mpmath
import numpy as np
import pytest
from panel_speed import chain
from support.intervals import cut_of, intervals_of
from support.specs import nested, random_values, values_of

import wavesweep
from wavesweep.engine._monodromy.cut import FIRST, SECOND, LinearFractional
from wavesweep.engine._stability.crossings import sampled_polynomial, warp_scale
from wavesweep.engine._stability.intervals import Intervals
from wavesweep.engine._stability.stable import stable_intervals


def random_cut(seed, *, integrates, spread):
    """A loop of two numbers whose entries are known to a spread, and another one within that of it."""
    random, n = np.random.default_rng(seed), 5
    E = np.diag(random.uniform(-0.5, -0.01, n)) + 0.1 * random.normal(size=(n, n))
    B, C, D = random.normal(size=(n, 1)), random.normal(size=(3, n)), random.normal(size=(3, 1))
    if not integrates:
        C[1], D[1] = 0, 0
    errors = [spread * np.abs(matrix) * random.random(matrix.shape) for matrix in (E, B, C, D)]
    cut = LinearFractional(
        *(matrix[None] for matrix in (E, B, C, D, *errors)), integrates, np.ones(1), tuple(f"x{i}" for i in range(n))
    )
    signs = [random.choice([-1.0, 1.0], matrix.shape) for matrix in (E, B, C, D)]
    other = [matrix + sign * error for matrix, sign, error in zip((E, B, C, D), signs, errors, strict=True)]
    return cut, other


def terms(matrices, integrates, theta):
    """Unit, x and v of `unit = K x + B v` times the pole polynomial, in 40 digits."""
    E, B, C, D = (mpmath.matrix(matrix.tolist()) for matrix in matrices)
    w = mpmath.expj(theta) - 1
    A = w * mpmath.eye(E.rows) - E
    velocity, advance, offset = C * mpmath.lu_solve(A, B) + D
    pole = mpmath.det(A)
    if integrates:
        return pole * w, pole * (advance + w * offset), pole * w * velocity
    return pole, pole * offset, pole * velocity


def polynomials(matrices, integrates, along, scale, normal=None):
    """Coefficients from samples in 40 digits: base, slope and the three of the value; and what all are divided by."""
    count = matrices[0].shape[-1] + integrates + 1
    with mpmath.workdps(40):
        a = mpmath.mpf((1 - scale) / (1 + scale))
        phi = [mpmath.pi * j / (count + 1) for j in range(1, count + 1)]
        zeta = [mpmath.expj(p) for p in phi]
        theta = [mpmath.arg((z + a) / (1 + a * z)) for z in zeta]
        size = [(1 + a * z) ** (count - 1) for z in zeta]
        every = [[s * term for term in terms(matrices, integrates, t)] for s, t in zip(size, theta, strict=True)]
        poles = [abs(unit) / (abs(mpmath.expj(t) - 1) if integrates else 1) for (unit, *_), t in zip(every, theta, strict=True)]
        normal = normal or max(poles)
        samples = []
        for (unit, *numbers), p in zip(every, phi, strict=True):
            solved, fixed = numbers if along == FIRST else reversed(numbers)
            back = mpmath.conj(solved) / normal**2
            of_value = (mpmath.sin(p) * mpmath.re(term * back) for term in (unit, fixed, solved))
            samples.append((mpmath.im(unit * back), -mpmath.im(fixed * back), *of_value))
        series = [
            [
                2 * mpmath.fsum(f[kind] * mpmath.sin(k * p) for f, p in zip(samples, phi, strict=True)) / (count + 1)
                for k in range(1, count + (kind > 1))
            ]
            for kind in range(5)
        ]
    return [np.array(coefficients, float) for coefficients in series], normal


def farthest(coefficients):
    """The largest value on [-1, 1] of a sum in the basis U."""
    theta = np.linspace(1e-3, np.pi - 1e-3, 300)
    return np.abs(coefficients @ np.sin(np.outer(np.arange(1, coefficients.size + 1), theta)) / np.sin(theta)).max()


def in_order(found):
    """What is found of the same five, and the bounds on the errors of each."""
    return (found.base, found.slope, *np.moveaxis(found.value, 1, 0)), (*found.noise[0], *found.value_noise[0])


@pytest.mark.parametrize("spread", [1e-6, 1e-9])
@pytest.mark.parametrize("integrates", [False, True])
@pytest.mark.parametrize("along", [FIRST, SECOND])
def test_the_polynomial_of_every_loop_within_the_errors_is_within_the_noise(along, integrates, spread):
    """By both bounds, and the close one is no more than a thousand times what the entries make of it."""
    cut, other = random_cut(3, integrates=integrates, spread=spread)
    exact, normal = polynomials([cut.E[0], cut.B[0], cut.C[0], cut.D[0]], integrates, along, 0.3)
    moved, _ = polynomials(other, integrates, along, 0.3, normal)
    for closely in (False, True):
        found, noise = in_order(sampled_polynomial(cut, along, np.array([0.3]), closely=closely))
        for of_found, of_exact, of_moved, off in zip(found, exact, moved, noise, strict=True):
            assert farthest(of_found[0] - of_exact) <= 1e-3 * off
            assert farthest(of_found[0] - of_moved) <= off
            assert not closely or off <= 1e3 * farthest(of_exact - of_moved)


@pytest.mark.parametrize("closely", [False, True])
def test_rounding_of_the_polynomial_is_within_the_noise(closely):
    """Of this loop both of two computations are off by more than eight times what they differ by."""
    cut = cut_of(random_values(222))
    scale = warp_scale(cut, alone=False)
    found, noise = in_order(sampled_polynomial(cut, SECOND, scale, closely=closely))
    exact, _ = polynomials([cut.E[0], cut.B[0], cut.C[0], cut.D[0]], cut.integrates, SECOND, scale[0])
    for of_found, of_exact, off in zip(found, exact, noise, strict=True):
        assert farthest(of_found[0] - of_exact) <= off


@pytest.mark.parametrize("ticks", [600, 2000])
def test_frames_of_many_ticks_are_certified_in_doubles(ticks):
    tables = chain(2, ticks)
    table = wavesweep.compile(tables).stable_intervals("K", (0, 1000), m=np.linspace(0.1, 0.3, 5))
    assert table.certified.all()


def test_a_row_says_by_what_bounds_it_is_certified():
    """By one polynomial, on arcs of the circle, and on panels of a number that is no gain."""
    by_polynomial = intervals_of(values_of("dc"))
    assert set(by_polynomial.argument) == {Intervals.ENCLOSED}
    on_arcs = stable_intervals(cut_of(random_values(365)), FIRST, (0, 20000.0), np.zeros((1, 1)))
    assert set(on_arcs.argument) == {Intervals.FIRST_ORDER}
    on_panels = wavesweep.compile(nested(values_of("dc"))).stable_intervals("device.mass", span=(0.02, 0.2))
    assert set(on_panels["argument"]) == {"sampled"}
