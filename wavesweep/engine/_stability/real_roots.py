"""All real roots in (-1, 1) of a polynomial known to within an error bound, with the proof that
there are no others."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.rows import Rows

ROOT_AT_END = 1e-7  # so near to +-1 a root is not distinguished from one at the end itself
GROWTH = 2.0  # from [-1, 1] to a disc that holds a root, of what a polynomial may be off


@dataclass(frozen=True, slots=True)
class Roots(Rows):
    """Roots per row of coefficients.

    value: `(rows, n-1)`, real. radius: distance from the value within which the true root is, and
    no other. inside: which of them are real roots in (-1, 1). slope_sign: sign of the polynomial's
    derivative there. at_one, at_minus_one: sign of the polynomial at 1 and -1. proved: `(rows,)`,
    whether the list is complete and right for every polynomial within the error bound, except at
    the ends: open_at_one, open_at_minus_one are true if a root may be there, within ROOT_AT_END of
    the end on either side.
    """

    value: np.ndarray
    radius: np.ndarray
    inside: np.ndarray
    slope_sign: np.ndarray
    at_one: np.ndarray
    at_minus_one: np.ndarray
    proved: np.ndarray
    open_at_one: np.ndarray
    open_at_minus_one: np.ndarray

    @property
    def complete(self) -> np.ndarray:
        """`(rows,)`, whether the list is proved and no root is at an end."""
        return self.proved & ~self.open_at_one & ~self.open_at_minus_one


def isolate(coefficients: np.ndarray, noise: np.ndarray, degree: int | None = None) -> Roots:
    """Return the real roots in (-1, 1) of `q(x) = sum_{k=1..n} c_k U_{k-1}(x)`, known on [-1, 1] to
    within `noise`.

    coefficients: `(rows, n)`; noise: `(rows,)`. degree: of what q may be off by, which on the ellipse
    with foci -1, 1 and half axes of sum s is at most `s^degree noise`; that of q by default. The roots
    are among the n-1 complex ones, the eigenvalues of the colleague matrix (Specht 1957; Good 1961).
    Proof (B. T. Smith, J. ACM 17, 1970): with n-1 approximations x_i, `m_i = lead prod (x_i - x_j)`
    and an error d(x), which is at most `GROWTH noise` in question, partial fractions give

        (q(x) + d(x)) / (lead prod (x - x_i)) = 1 + sum (q(x_i) + d(x)) / (m_i (x - x_i)),

    which is not 0 outside of all discs about x_i of radius `(|q(x_i)| + GROWTH noise) / |m_i| / weight_i`,
    weights of sum 1. So no root is on [-1, 1] outside of discs. By Rouche's theorem an isolated disc in
    which d is so small holds exactly one, which is real if its centre is.
    """
    coefficients, noise = _of_size_one(coefficients, noise)
    none = _none(coefficients)
    if coefficients.shape[1] < 2:
        return replace(none, proved=np.abs(coefficients).sum(-1) > 2 * noise)
    roots = _eigenvalues(coefficients)
    degree = degree or coefficients.shape[1] - 1
    proved, radius, edge = _proof(coefficients, noise, roots, degree)
    again = np.flatnonzero(~proved)
    if again.size:
        proved[again], radius[again], edge[again] = _proof(
            coefficients[again], noise[again], _spread(roots[again]), degree
        )
    some = (np.abs(coefficients).max(-1) > 0)[:, None]
    inside = (roots.imag == 0) & (np.abs(roots.real) < 1) & ~edge & some
    at_one, at_minus_one = at_ends(coefficients)
    open_at_one = (edge & (roots.real > 0)).any(-1) | (np.abs(at_one) <= 2 * noise)
    open_at_minus_one = (edge & (roots.real < 0)).any(-1) | (np.abs(at_minus_one) <= 2 * noise)
    return replace(
        none,
        value=roots.real,
        radius=radius,
        inside=inside,
        slope_sign=_slope_signs(coefficients[:, -1], roots, inside),
        proved=proved,
        open_at_one=open_at_one,
        open_at_minus_one=open_at_minus_one,
    )


def _slope_signs(lead: np.ndarray, roots: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return the signs of the polynomial's derivative at the real roots inside, `(rows, n-1)`,
    also if other roots are not proved: of `lead prod (x_i - x_j)`; 0 for other roots."""
    row, index = np.nonzero(inside)
    apart = roots[row, index][:, None] - roots[row]
    apart[np.arange(row.size), index] = 1.0
    size = np.abs(apart)
    turns = apart / np.where(size > 0, size, 1)
    signs = np.zeros(roots.shape)
    signs[row, index] = np.sign(lead[row] * turns.prod(-1).real)
    return signs


def _of_size_one(coefficients: np.ndarray, noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return both divided by the largest coefficient of the row; of one that overflowed nothing
    is left but noise."""
    size = np.abs(coefficients).max(-1, initial=0)
    finite = np.isfinite(size)
    size = np.where(size > 0, size, 1)
    with np.errstate(all="ignore"):
        coefficients = np.where(finite[:, None], coefficients / size[:, None], 0)
        return coefficients, np.where(finite, noise / size, 1)


def _none(coefficients: np.ndarray) -> Roots:
    """Return the value for no roots, with nothing proved."""
    rows, n = coefficients.shape
    empty = np.zeros((rows, max(n - 1, 0)))
    closed = np.zeros(rows, bool)
    at_one, at_minus_one = map(np.sign, at_ends(coefficients))
    return Roots(
        empty,
        empty.copy(),
        empty > 0,
        empty.copy(),
        at_one,
        at_minus_one,
        closed,
        closed.copy(),
        closed.copy(),
    )


def at_ends(coefficients: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polynomial at 1 and at -1."""
    weight = np.arange(1, coefficients.shape[1] + 1)
    return (coefficients * weight).sum(-1), (coefficients * (weight * (-1.0) ** (weight - 1))).sum(
        -1
    )


def _eigenvalues(coefficients: np.ndarray) -> np.ndarray:
    """Return the complex roots `(rows, n-1)`: eigenvalues of the colleague matrix of the U
    basis."""
    rows, n = coefficients.shape
    lead = coefficients[:, -1]
    tiny = EPS**2  # a vanishing leading coefficient only sends roots far away
    lead = np.where(np.abs(lead) < tiny, tiny, lead)
    A = np.zeros((rows, n - 1, n - 1))
    index = np.arange(n - 2)
    A[:, index, index + 1] = A[:, index + 1, index] = 0.5
    A[:, -1, :] -= 0.5 * coefficients[:, :-1] / lead[:, None]
    return np.linalg.eigvals(A).astype(complex)


def _evaluate(coefficients: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the polynomial at x by the three-term recurrence, and a bound on the rounding error
    of that."""
    before = np.zeros_like(x)
    now = np.ones_like(x)
    value = coefficients[:, :1] * now
    size = np.abs(coefficients[:, :1]) * np.ones(x.shape)
    twice = 2 * x
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # at roots sent far away by leading zeros, which prove nothing
        for k in range(1, coefficients.shape[1]):
            following = twice * now - before
            before = now
            now = following
            term = coefficients[:, k : k + 1] * now
            value = value + term
            size = size + np.abs(term)
    return value, 4 * coefficients.shape[1] * EPS * size


def _proof(
    coefficients: np.ndarray, noise: np.ndarray, roots: np.ndarray, degree: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return whether the discs about `roots` prove every real root in (-1, 1) except at the ends,
    their radii, and edge discs.

    The first result is row by row; the last tells which discs are confined to an end. A disc of
    radius r about x is in the ellipse whose half axes add up to `exp(r/sqrt(1 - (|x| + r)^2))` at
    most.
    """
    value, rounding = _evaluate(coefficients, roots)
    bound = np.abs(value) + rounding + GROWTH * noise[:, None]
    radius, apart = _discs(coefficients, roots, bound)
    distance = _from_segment(roots)
    touching = ~(distance > radius)
    with np.errstate(over="ignore"):
        lonely = ~np.any(apart <= radius[:, :, None] + radius[:, None, :], axis=-1)
        within = 1 - (np.abs(roots.real) + radius) ** 2
        grown = (degree * radius / np.log(GROWTH)) ** 2
    settled = lonely & (roots.imag == 0) & (grown < within)
    edge = (
        touching
        & ~settled
        & (np.abs(np.abs(roots.real) - 1) + np.abs(roots.imag) + radius < ROOT_AT_END)
    )
    proved = np.all(~touching | settled | edge, axis=-1) & np.all(np.isfinite(radius), axis=-1)
    return proved, radius, edge


def _from_segment(x: np.ndarray) -> np.ndarray:
    """Return the distance of x from [-1, 1]."""
    return np.hypot(np.maximum(np.abs(x.real) - 1, 0), x.imag)


def _spread(roots: np.ndarray) -> np.ndarray:
    """Move crowded roots apart that lie away from the segment.

    The theorem holds for any n-1 points. Pure delays put a multiple root at one point outside [-1,
    1]; the computed roots crowd there and their discs grow. Points on a small circle about it have
    discs of that circle's size.
    """
    distance = _from_segment(roots)
    apart = np.abs(roots[:, :, None] - roots[:, None, :])
    index = np.arange(roots.shape[1])
    apart[:, index, index] = np.inf
    crowded = apart.min(-1, initial=np.inf) < 0.1 * distance
    return roots + np.where(crowded, 0.04 * distance, 0) * np.exp(2.4j * index)


def _discs(
    coefficients: np.ndarray, roots: np.ndarray, bound: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return radii `(rows, n-1)` and the mutual distances `(rows, n-1, n-1)` (infinite on the
    diagonal)."""
    n = coefficients.shape[1]
    apart = np.abs(roots[:, :, None] - roots[:, None, :])
    index = np.arange(n - 1)
    apart[:, index, index] = 1.0
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        log_product = (
            np.log(apart).sum(-1) + np.log(np.abs(coefficients[:, -1:])) + (n - 1) * np.log(2.0)
        )
        share = np.exp(np.log(bound) - log_product)
        # Half of the weight is dealt out evenly, for the small discs, and half in proportion, for
        # the large ones.
        radius = share / (0.5 / (n - 1) + 0.5 * share / share.sum(-1, keepdims=True))
    apart[:, index, index] = np.inf
    return radius, apart
