"""Every crossing of every column: where eigenvalues meet the unit circle as the wall changes.

The crossings of a column are the real roots of one polynomial, which is had from samples on the circle.
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals.boundary import K_VE, Terms, polish, read, terms
from wavesweep.analysis.intervals.isolate import EDGE, isolate
from wavesweep.lifted.circle import on_circle, solve
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
        scaled = Terms(pole * top, pole * (bottom * G[..., ADVANCE] + top * G[..., OFFSET]), pole * top * G[..., V])
    else:
        scaled = Terms(pole, pole * G[..., OFFSET], pole * G[..., V])
    return *scaled.along(along), scaled.one


def angle(cosine, scale):
    """theta in (0, pi) from cos(phi)."""
    return 2 * np.arctan2(scale * np.sqrt(1 - cosine), np.sqrt(1 + cosine))


OCTAVES = 2.0 ** -np.arange(48)  # of an angle, at which the wall parameter is looked at
SLIVER = 1e-12  # of the span, at either end of it, in which a crossing next to z = +-1 does not matter


@dataclass(frozen=True, slots=True)
class Crossings:
    """A flat list of crossings.

    column: which column it belongs to. value: the wall parameter. theta: angle of the eigenvalue that crosses (rad per
    frame, 0 and pi included). jump: by how much the number of unstable eigenvalues grows as the value grows past it.
    complete: `(columns,)`, whether the list of that column is proved complete.
    """

    column: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    jump: np.ndarray
    complete: np.ndarray


def crossings(cut: Cut, owner, along: str, fixed, span, polynomial: Polynomial) -> Crossings:
    """Crossings of the columns with the loops `cut.at(owner)` and the other wall parameter `fixed`.

    polynomial: of each loop, `(loops, ...)`.
    The eigenvalue moves outward with the sign of d Im K/d theta at an interior crossing (K analytic in z), which is the
    sign of the polynomial's derivative turned round; at z = 1 and -1 with the sign of the polynomial. Where a root may be
    at such an end itself (an undamped device crosses twice at z = 1, at K_VE = 0), the column is complete only if no wall
    parameter of that bit of the circle is inside the span.
    """
    coefficients = polynomial.base[owner] + fixed[:, None] * polynomial.slope[owner]
    n = coefficients.shape[-1]
    noise = polynomial.noise[owner, 0] + np.abs(fixed) * polynomial.noise[owner, 1]  # per coefficient; |U_k| <= k + 1
    roots = isolate(coefficients, noise * (n * (n + 1) / 2))
    column, which = np.nonzero(roots.inside)
    seed = angle(roots.value[column, which], polynomial.scale[owner[column]])
    theta, value, converged = polish(cut.at(owner[column]), along, fixed[column], seed, max(map(abs, span)))
    complete = roots.proved & np.isfinite(coefficients).all(-1)
    # A polished angle far from its seed has left the root that the proof is about.
    astray = ~(np.abs(theta - seed) <= 1e-4 * np.minimum(seed, np.pi - seed)) | ~converged
    complete[column[astray]] = False
    jump = -2.0 * roots.slope_sign[column, which]
    ends = at_both_ends(cut, owner, along, fixed, roots.at_one, roots.at_minus_one)
    bits = [abs(place - angle(edge, polynomial.scale[owner])) for place, edge in ((0.0, 1 - EDGE), (np.pi, EDGE - 1))]
    hiding = zip((roots.open_at_one, roots.open_at_minus_one), bits, strict=True)
    complete &= ~open_inside(cut, owner, along, fixed, span, hiding)
    return Crossings(*(np.concatenate(pair) for pair in zip((column, value, theta, jump), ends, strict=True)), complete)


def open_inside(cut: Cut, owner, along: str, fixed, span, ends):
    """Columns of which a crossing that may hide next to an end of the circle would be inside the span.

    ends: for z = 1 and z = -1, whether one may (`(columns,)`), and within which angle of it (rad, `(columns,)`).
    """
    inside, slack = np.zeros(fixed.size, bool), SLIVER * (span[1] - span[0])
    for (may, bit), place in zip(ends, (0.0, np.pi), strict=True):
        at = np.flatnonzero(may)
        theta = np.abs(place - bit[at, None] * OCTAVES)
        t = terms(cut.at(np.repeat(owner[at], OCTAVES.size)), on_circle(theta.reshape(-1)))
        solved, other = (part.reshape(theta.shape) for part in t.along(along))
        with np.errstate(divide="ignore", invalid="ignore"):
            value = ((t.one.reshape(theta.shape) - fixed[at, None] * other) / solved).real
        inside[at] |= ~((value.max(-1) <= span[0] + slack) | (value.min(-1) >= span[1] - slack))
    return inside


def at_both_ends(cut: Cut, owner, along: str, fixed, sign_at_one, sign_at_minus_one):
    """Crossings at z = 1 and z = -1 of every column: (column, value, theta, jump); the value is infinite where there is none.

    sign_at_one, sign_at_minus_one: sign of the polynomial there, which says which way the eigenvalue goes.
    """
    values = []
    for w in (0.0, -2.0):
        if w == 0.0 and cut.integrates:
            values.append(np.full(fixed.shape, 0.0 if along == K_VE else np.inf))
            continue
        t = terms(cut, np.full(cut.batch, w))
        solved, other = t.along(along)
        with np.errstate(divide="ignore", invalid="ignore"):
            values.append((t.one[owner] - fixed * other[owner]) / solved[owner])
    return (
        np.tile(np.arange(fixed.size), 2),
        np.concatenate(values),
        np.repeat([0.0, np.pi], fixed.size),
        np.concatenate([sign_at_one, -sign_at_minus_one]),
    )
