"""The crossings of a column as the real roots of one polynomial, and the polynomial from samples on the circle."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals.curve import Terms, read
from wavesweep.lifted.circle import solve
from wavesweep.lifted.cut import ADVANCE, OFFSET, Cut, V

SPARE = 5  # sine coefficients beyond the polynomial's degree: they are zero, so what they show is the error of all
NEAREST, FARTHEST = 1e-3, 0.6  # scales r of the warp; r = 1 would leave roots at infinity when the loop has pure delays


@dataclass(frozen=True, slots=True)
class Polynomial:
    """`sum_k (base_k + y slope_k) U_{k-1}(cos phi)`, y the wall parameter that is fixed; roots in (-1, 1) are crossings.

    base, slope: `(..., n)`. noise: `(..., 2)`, bounds on the error of each coefficient of either.
    scale: r of the warp `tan(theta/2) = r tan(phi/2)`, `(...)`.
    """

    base: np.ndarray
    slope: np.ndarray
    noise: np.ndarray
    scale: np.ndarray


def warp_scale(cut: Cut):
    """Geometric mean distance of the poles from z = 1: seen from there, through the warp, they crowd least."""
    n = cut.E.shape[-1]
    _, log_size = np.linalg.slogdet(cut.E)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = np.exp(np.nan_to_num(log_size, neginf=-0.5 * n) / max(n, 1))
    return np.clip(mean, NEAREST, FARTHEST)


def sampled_polynomial(cut: Cut, along: str, scale) -> Polynomial:
    """Sample the boundary equation on the warped circle and return its polynomial.

    The warp is the Moebius map `zeta = (z - a)/(1 - a z)`, `a = (1 - r)/(1 + r)`, which maps the circle to itself.
    `f(phi) = Im[(one - y fixed) conj(solved)] |d|^2`, d the pole polynomial, is a sine polynomial of degree n (the order
    of the closed loop): n + SPARE samples give its coefficients through an orthogonal transform.
    """
    count = cut.order + SPARE
    phi = np.pi * np.arange(1, count + 1) / (count + 1)
    solved, fixed, one = _scaled(cut, np.exp(1j * phi), scale, along)
    base, slope = (one * solved.conj()).imag, -(fixed * solved.conj()).imag
    size = [np.abs(part * solved).max(-1) for part in (one, fixed)]
    transform = np.sin(np.outer(phi, np.arange(1, count + 1))) * (2 / (count + 1))
    # Sums and not a matrix product: BLAS may round a row differently in another batch, and a sweep's bytes must not change.
    base, slope = ((part[..., None] * transform).sum(-2) for part in (base, slope))
    spare = [np.abs(part[..., cut.order :]).max(-1) for part in (base, slope)]
    floor = 4 * count * np.finfo(float).eps
    noise = np.stack([8 * s + floor * m for s, m in zip(spare, size, strict=True)], axis=-1)
    return Polynomial(base[..., : cut.order], slope[..., : cut.order], noise, scale)


def _scaled(cut, zeta, scale, along):
    """Characteristic terms times the warped pole polynomial: polynomials in zeta, `(..., count)` each."""
    r = np.asarray(scale)[..., None]
    a = (1 - r) / (1 + r)
    top, bottom = (1 - a) * (zeta - 1), 1 + a * zeta  # w = top/bottom
    A = top[..., None, None] * np.eye(cut.E.shape[-1]) - bottom[..., None, None] * cut.E[..., None, :, :]
    B, C, D = (part[..., None, :, :] for part in (cut.B, cut.C, cut.D))
    phase, log_size = np.linalg.slogdet(A)
    pole = phase * np.exp(log_size - log_size.max(-1, keepdims=True))
    G = bottom[..., None] * read(C, solve(A, B + 0j * A[..., :1])) + D[..., 0]
    if cut.integrates:
        terms = Terms(pole * top, pole * (bottom * G[..., ADVANCE] + top * G[..., OFFSET]), pole * top * G[..., V])
    else:
        terms = Terms(pole, pole * G[..., OFFSET], pole * G[..., V])
    return *terms.along(along), terms.one


def angle(cosine, scale):
    """theta in (0, pi) from cos(phi)."""
    return 2 * np.arctan2(scale * np.sqrt(1 - cosine), np.sqrt(1 + cosine))
