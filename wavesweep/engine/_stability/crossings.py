"""Every crossing of every column: the values of a number at which eigenvalues meet the unit circle.

The crossings of a column are the real roots of one polynomial, which is computed from samples on
the circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.cut import FIRST, CutColumns, LinearFractional
from wavesweep.engine._monodromy.resolvent import ManyStates
from wavesweep.engine._stability.boundary import Terms, polish, real_terms, terms_and_inverse
from wavesweep.engine._stability.boundary_samples import boundary_samples
from wavesweep.engine._stability.real_roots import Roots, isolate
from wavesweep.engine.doubles import UNIT_ROUNDING
from wavesweep.engine.rows import Rows

# times the span's largest value; beyond, a value may as well be at the other infinity
OTHER_INFINITY = 1e8
# Of an angle's distance from the nearer end of the circle, how far a polished one may be from its
# seed. A seed, which is a root of the polynomial, has eight digits or more, as a rule twelve; one
# that moves by so much has gone to another root.
NEAR_SEED = 1e-4
# of an angle: two roots that polish to angles so near to each other may have become one
ONE_ROOT = 1e-13


@dataclass(frozen=True, slots=True)
class Polynomial(Rows):
    """The polynomials `sum_k (base_k + y slope_k) U_{k-1}(cos phi)` of loops, y the fixed number; roots
    in (-1, 1) are crossings.

    base, slope: `(loops, n)`. noise: `(loops, 2)`, bounds on what either may be off by on [-1, 1]. value:
    `(loops, 3, m)`, in the same basis; the number at a root is the first less y times the second, over
    the third. value_noise: `(loops, 3)`, bounds on what each of these may be off by. scale: r of the
    warp `tan(theta/2) = r tan(phi/2)`, `(loops,)`.
    """

    base: np.ndarray
    slope: np.ndarray
    noise: np.ndarray
    value: np.ndarray
    value_noise: np.ndarray
    scale: np.ndarray


def warp_scale(cut: LinearFractional, *, alone: bool) -> np.ndarray:
    """Return the geometric mean distance of the poles from z = 1, the scale of the warp with which
    they crowd least.

    alone: without those that are divided out, see `sampled_polynomial`.
    """
    n = cut.E.shape[-1]
    with np.errstate(all="ignore"):  # of a frame that overflows
        if alone:
            n -= cut.poles_at_one
            size = np.sort(np.abs(np.linalg.eigvals(cut.E)), axis=-1)
            log_size = np.log(size[..., cut.poles_at_one :]).sum(-1)
        else:
            _, log_size = np.linalg.slogdet(cut.E)
        mean = np.exp(np.nan_to_num(log_size, neginf=-0.5 * n) / max(n, 1))
    # A scale of 1 would leave roots at infinity when the loop has pure delays.
    return np.clip(mean, 1e-3, 0.6)


def sampled_polynomial(
    cut: LinearFractional,
    parameter: str,
    scale: np.ndarray,
    *,
    alone: bool = False,
    closely: bool = False,
) -> Polynomial:
    """Sample the boundary equation on the warped circle and return its polynomial.

    alone: whether the other number is 0, and its half of the polynomial is left out. closely: see
    `boundary_samples`.

    The warp is the Moebius map `zeta = (z - a)/(1 - a z)`, `a = (1 - r)/(1 + r)`, which maps the
    circle to itself. `f(phi) = Im[(unit - y fixed) conj(solved)] |d|^2`, d the pole polynomial, is
    a sine polynomial of degree n (the order of the closed loop): n + 1 samples give its coefficients
    through an orthogonal transform.

    If m poles are exactly 1, as those of a mass under an integrator, d has the factor (z - 1)^m,
    and f, if there is only one parameter, `(1 - cos phi)^(m // 2)`. It is divided out, since a root
    at z = 1 itself would hide others next to it.
    """
    count = cut.order + 1
    phi = np.pi * np.arange(1, count + 1) / (count + 1)
    samples = boundary_samples(cut, parameter, phi, scale, alone=alone, closely=closely)
    of_unit, of_fixed, of_solved = samples.products
    factors = 0
    if not np.any(of_fixed):
        factors = (max(poles_at_one(cut.E), cut.poles_at_one) + cut.integrates) // 2
    weight = (2 * np.sin(phi / 2) ** 2) ** -float(factors)
    curve, noise = _sines(
        np.stack([of_unit.imag, -of_fixed.imag]) * weight,
        samples.errors[:2] * weight,
        cut.order - factors,
    )
    value_parts = np.stack([of_unit.real, of_fixed.real, of_solved.real])
    value_off = samples.errors * np.sin(phi) + 16 * UNIT_ROUNDING * np.abs(value_parts)
    value, value_noise = _sines(value_parts * np.sin(phi), value_off, cut.order + 1)
    return Polynomial(curve[:, 0], curve[:, 1], noise, value, value_noise, scale)


def poles_at_one(E: np.ndarray) -> int:
    """Return how many eigenvalues of `E` are exactly 0 in every loop because of where its entries
    are not zero.

    E: `(..., n, n)`. States that depend on each other, directly or through others, are a block of a
    triangular matrix. One that depends on itself in no way is a block of its own, whose eigenvalue
    is its diagonal entry, 0.
    """
    n = E.shape[-1]
    reach = (E != 0).reshape(-1, n, n).any(0)
    for _ in range(n.bit_length()):
        reach = reach | ((reach.astype(int) @ reach) > 0)
    return int((~np.diagonal(reach)).sum())


def _sines(samples: np.ndarray, errors: np.ndarray, degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the coefficients of sine polynomials from their samples, `(loops, kinds, degree)`, and
    bounds on what their sums over the sine may be off by, `(loops, kinds)`.

    samples, errors: `(kinds, loops, points)`. The transform is orthogonal but for a factor, so by
    Parseval's identity errors e of N samples move the coefficients by a vector of the norm of e times
    `sqrt(2/(N + 1))`, and the sum by as much as `U_{k-1} <= k` allows. Rounding moves each coefficient
    by (N + 24) roundings of the mean of the sizes of samples, twice: in the transform, and where
    coefficients of two are added and divided.
    """
    count = samples.shape[-1]
    turn = np.outer(np.arange(1, count + 1), np.arange(1, degree + 1)) % (2 * count + 2)
    transform = np.sin(turn * (np.pi / (count + 1))) * (2 / (count + 1))
    # BLAS rounds what is contiguous alike in every batch.
    series = np.ascontiguousarray(np.moveaxis(samples, 0, 1)) @ transform
    largest = np.arange(1, degree + 1)
    of_samples = np.linalg.norm(errors, axis=-1) * (2 / (count + 1)) ** 0.5
    off = of_samples * np.linalg.norm(largest)
    off = off + 2 * (count + 24) * UNIT_ROUNDING * np.abs(samples).mean(-1) * largest.sum()
    return series, off.T


def angle(cosine: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Return theta in (0, pi) from cos(phi)."""
    return 2 * np.arctan2(scale * np.sqrt(1 - cosine), np.sqrt(1 + cosine))


# A crossing counts as at an end of the span within this part of the span, as ends are promised, or
# within so many doubles of the end.
SLIVER = 1e-14
DOUBLES_AT_END = 4


@dataclass(frozen=True, slots=True)
class Crossings:
    """A flat list of crossings that may be inside the span.

    column: index of the column. value: of the number. theta: angle of the eigenvalue that crosses
    (rad per frame, 0 and pi included). jump: growth of the count of unstable eigenvalues as the
    number grows past the value. inverse: index of the inverse of `w I - E` at the crossing or next
    to it, `inverses[inverse]`. complete: `(columns,)`, whether the list of that column is proved
    complete. growth_to_infinity: `(columns,)`, growth of the number of unstable eigenvalues from
    the low end of the span to an infinite value, less the part that belongs to the loop alone; NaN
    if that is not known. For K to infinity the eigenvalues tend to the zeros of G_x, or to infinity
    if there are more of them, whatever B is, so how many are outside then is one number per loop.
    many: the resolvent of a single loop of many states, of which there are no inverses.
    """

    column: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    jump: np.ndarray
    inverse: np.ndarray
    inverses: np.ndarray
    complete: np.ndarray
    growth_to_infinity: np.ndarray
    many: ManyStates | None = None


def roots_of(polynomial: Polynomial, owner: np.ndarray, fixed: np.ndarray) -> Roots:
    """Return the roots of the polynomials of columns with the loops `owner` and the other number
    `fixed`."""
    coefficients = polynomial.base.take(owner, axis=0) + fixed[:, None] * polynomial.slope.take(
        owner, axis=0
    )
    noise = polynomial.noise[owner, 0] + np.abs(fixed) * polynomial.noise[owner, 1]
    roots = isolate(coefficients, noise)
    roots.proved[~np.isfinite(coefficients).all(-1)] = False
    return roots


def _merged(column: np.ndarray, seed: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the columns in which two roots have polished to one angle: their jumps are not
    those of two crossings."""
    order = np.lexsort((seed, column))
    column = column[order]
    theta = theta[order]
    neighbours = column[1:] == column[:-1]
    apart = np.diff(theta) > ONE_ROOT * np.minimum(theta[1:], np.pi - theta[1:])
    return column[1:][neighbours & ~apart]


def crossings(
    columns: CutColumns, span: tuple[float, float], polynomial: Polynomial, roots: Roots
) -> Crossings:
    """Return the crossings of columns.

    polynomial: of each loop, `(loops, ...)`; roots: of each column, see `roots_of`. The eigenvalue
    moves outward with the sign of d Im K/d theta at an interior crossing (K analytic in z), which
    is the sign of the polynomial's derivative reversed; at z = 1 and -1 it moves with the sign of
    the polynomial. A column in which a root may be at such an end itself (an undamped device
    crosses twice at z = 1, at K = 0) is not complete. Crossings surely outside the span are counted.
    """
    fixed = columns.fixed
    column, index = np.nonzero(roots.inside)
    cosine = roots.value[column, index]
    jump = -2.0 * roots.slope_sign[column, index]
    side = _side(polynomial, columns.owner[column], fixed[column], cosine, span)
    growth = np.bincount(column, jump * (side > 0), minlength=fixed.size)  # to infinity
    near = side == 0
    column, cosine, jump = (fact[near] for fact in (column, cosine, jump))
    seed = angle(cosine, polynomial.scale[columns.owner[column]])
    start = columns.along, fixed[column], seed, max(map(abs, span))
    polished, inverses = polish(columns.loops(column), *start)
    complete = roots.proved.copy()
    # A polished angle far from its seed has left the root that the proof is about.
    astray = ~(np.abs(polished.theta - seed) <= NEAR_SEED * np.minimum(seed, np.pi - seed))
    complete[column[astray | ~polished.converged]] = False
    complete[_merged(column, seed, polished.theta)] = False
    ends, at_ends = at_both_ends(columns, roots.at_one, roots.at_minus_one)
    complete &= ~(roots.open_at_one | roots.open_at_minus_one)
    order = np.concatenate([np.arange(column.size), len(inverses) + ends.inverse])
    column = np.concatenate([column, ends.column])
    value = np.concatenate([polished.value, ends.value])
    theta = np.concatenate([polished.theta, ends.theta])
    jump = np.concatenate([jump, ends.jump])
    beyond = _growth_beyond(value, jump, span)
    growth = growth + np.bincount(column, beyond, minlength=fixed.size)
    growth[~complete] = np.nan
    inverses = np.concatenate([inverses, at_ends])
    return Crossings(column, value, theta, jump, order, inverses, complete, growth)


def _growth_beyond(value: np.ndarray, jump: np.ndarray, span: tuple[float, float]) -> np.ndarray:
    """Return by how much each crossing changes the number of eigenvalues outside between the low end
    of the span and infinite values; NaN if it is not known.

    At an infinite value an eigenvalue is on the circle itself, and is not counted as outside. If it
    moves outward there (jump > 0), it has come from inside, and the number stays; if inward, it has
    come from outside, and the number falls. Of a very large value rounding decides whether it is
    reached before infinity or beyond.
    """
    low = span[0]
    size = np.abs(value)
    doubles = np.spacing(np.maximum(abs(low), size))
    told = np.maximum(SLIVER * (span[1] - low), DOUBLES_AT_END * doubles)
    growth = np.where((value > low) & ~(np.abs(value - low) <= told), jump, 0.0)
    growth = np.where(size > OTHER_INFINITY * max(map(abs, span)), np.nan, growth)
    growth = np.where(size == np.inf, np.minimum(jump, 0), growth)
    return np.where(np.isnan(value), np.nan, growth)


def _side(
    polynomial: Polynomial,
    owner: np.ndarray,
    fixed: np.ndarray,
    cosine: np.ndarray,
    span: tuple[float, float],
) -> np.ndarray:
    """Return 1 or -1 for a root whose value is surely above or below the span, 0 for others.

    The value is a quotient of two polynomials, the lower one not negative, so the side is the sign
    of a sum.
    """
    over = polynomial.value.take(owner, axis=0)
    noise = polynomial.value_noise.take(owner, axis=0)
    before = np.zeros_like(cosine)
    now = np.ones_like(cosine)  # U_k, at most k + 1
    twice = 2 * cosine
    total = np.zeros(())
    for k in range(over.shape[-1]):
        total = total + over[..., k] * now[:, None]
        following = twice * now - before
        before = now
        now = following
    first, second, lower = total.T
    upper = first - fixed * second
    unsure = noise[:, 0] + np.abs(fixed) * noise[:, 1]
    low, high = span
    above = upper - high * lower > unsure + abs(high) * noise[:, 2]
    below = upper - low * lower < -(unsure + abs(low) * noise[:, 2])
    return above.astype(int) - below


class CrossingsAtEnds(NamedTuple):
    """The crossings at z = 1 of every column, and then those at z = -1; see `Crossings`. Without
    one the value is infinite."""

    column: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    jump: np.ndarray
    inverse: np.ndarray


def _terms_on_axis(
    cut: LinearFractional, w: float, many: ManyStates | None
) -> tuple[Terms, np.ndarray]:
    """Return the terms of the equation of every loop at a real w, and the inverses of `w I - E`, none
    of many states."""
    if many is None:
        return cut.remembered(w, partial(terms_and_inverse, cut, np.full(cut.batch, w)))
    return real_terms(cut.at(0), w, many), np.zeros((0, *cut.E.shape[-2:]))


def at_both_ends(
    columns: CutColumns,
    sign_at_one: np.ndarray,
    sign_at_minus_one: np.ndarray,
    many: ManyStates | None = None,
) -> tuple[CrossingsAtEnds, np.ndarray]:
    """Return the crossings at z = 1 and z = -1 of every column, and the inverses of `w I - E` there.

    sign_at_one, sign_at_minus_one: of the polynomial, which are directions of the eigenvalue. many:
    see `Crossings`.
    """
    cut = columns.cut
    owner = columns.owner
    fixed = columns.fixed
    values = []
    inverses = []
    for w in (0.0, -2.0):
        t, inverse = _terms_on_axis(cut, w, many)
        inverses.append(inverse)
        if w == 0.0 and cut.integrates:
            values.append(np.full(fixed.shape, 0.0 if columns.along == FIRST else np.inf))
            continue
        solved, fixed_term = t.along(columns.along)
        with np.errstate(divide="ignore", invalid="ignore"):
            values.append((t.unit[owner] - fixed * fixed_term[owner]) / solved[owner])
        if w == 0.0 and cut.poles_at_one:
            # a mass that nothing brakes, but for this wall
            values[-1] = np.where(fixed == 0, 0.0, values[-1])
    ends = CrossingsAtEnds(
        column=np.tile(np.arange(fixed.size), 2),
        value=np.concatenate(values),
        theta=np.repeat([0.0, np.pi], fixed.size),
        jump=np.concatenate([sign_at_one, -sign_at_minus_one]),
        inverse=np.concatenate([owner, owner + len(inverses[0])]),
    )
    return ends, np.concatenate(inverses)
