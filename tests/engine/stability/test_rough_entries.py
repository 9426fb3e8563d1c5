"""Errors of a frame's entries that are no roundings, as in frames of many ticks: they count in the noise of the polynomial."""

import mpmath
import numpy as np
import pytest
from panel_speed import chain

import wavesweep
from wavesweep.engine._monodromy.cut import FIRST, SECOND, LinearFractional
from wavesweep.engine._stability.crossings import sampled_polynomial

SPREAD = 1e-6  # of entries


def random_cut(seed, *, integrates):
    """A loop of two numbers whose entries are known to SPREAD, and another one within that of it."""
    random, n = np.random.default_rng(seed), 5
    E = np.diag(random.uniform(-0.5, -0.01, n)) + 0.1 * random.normal(size=(n, n))
    B, C, D = random.normal(size=(n, 1)), random.normal(size=(3, n)), random.normal(size=(3, 1))
    if not integrates:
        C[1], D[1] = 0, 0
    errors = [SPREAD * np.abs(matrix) * random.random(matrix.shape) for matrix in (E, B, C, D)]
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


@pytest.mark.parametrize("integrates", [False, True])
@pytest.mark.parametrize("along", [FIRST, SECOND])
@pytest.mark.parametrize("seed", range(2))
def test_the_polynomial_of_every_loop_within_the_errors_is_within_the_noise(seed, along, integrates):
    """Coefficients from samples in 40 digits, in the scale of the loop in the middle."""
    cut, other = random_cut(seed, integrates=integrates)
    scale = np.array([0.3])
    found = sampled_polynomial(cut, along, scale, np.ones(1, bool))
    quiet = sampled_polynomial(cut, along, scale, np.zeros(1, bool))
    n, middle = cut.order, (cut.E[0], cut.B[0], cut.C[0], cut.D[0])
    count = n + 5
    with mpmath.workdps(40):
        a = (1 - mpmath.mpf(0.3)) / (1 + mpmath.mpf(0.3))
        phi = [mpmath.pi * j / (count + 1) for j in range(1, count + 1)]
        size = [(1 + a * mpmath.expj(p)) ** n for p in phi]
        theta = [2 * mpmath.atan(mpmath.mpf(0.3) * mpmath.tan(p / 2)) for p in phi]
        poles = [abs(s * terms(middle, integrates, t)[0]) for s, t in zip(size, theta, strict=True)]
        if integrates:
            poles = [pole / abs(mpmath.expj(t) - 1) for pole, t in zip(poles, theta, strict=True)]
        series = []
        for matrices in (middle, other):
            samples = []
            for s, t in zip(size, theta, strict=True):
                unit, x, v = (s / max(poles) * term for term in terms(matrices, integrates, t))
                solved, fixed = (x, v) if along == FIRST else (v, x)
                of_unit, of_fixed = unit * mpmath.conj(solved), fixed * mpmath.conj(solved)
                samples.append((of_unit.imag, -of_fixed.imag, of_unit.real, of_fixed.real, abs(solved) ** 2))
            series.append(
                [
                    [
                        2 * mpmath.fsum(sample[kind] * weight * mpmath.sin(k * p) for sample, weight, p in rows) / (count + 1)
                        for k in range(1, n + 1 + (kind > 1))
                    ]
                    for kind in range(5)
                    for rows in [list(zip(samples, [1] * count if kind < 2 else map(mpmath.sin, phi), phi, strict=True))]
                ]
            )
    noise = [found.noise[0, 0], found.noise[0, 1], *found.value_noise[0]]
    least = [quiet.noise[0, 0], quiet.noise[0, 1], *quiet.value_noise[0]]
    for kind, of_middle in enumerate((found.base, found.slope, *np.moveaxis(found.value, 1, 0))):
        exact, moved = (np.array(each[kind], float) for each in series)
        np.testing.assert_allclose(of_middle[0], exact, atol=least[kind], rtol=0)
        assert least[kind] < np.abs(moved - exact).max() <= noise[kind]
        assert noise[kind] <= 1e4 * np.abs(moved - exact).max()


@pytest.mark.parametrize("ticks", [600, 2000])
def test_frames_of_many_ticks_are_certified_in_doubles(ticks):
    tables = chain(2, ticks)
    table = wavesweep.compile(tables).stable_intervals("K", (0, 1000), m=np.linspace(0.1, 0.3, 5))
    assert table.certified.all()
