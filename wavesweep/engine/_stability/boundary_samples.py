"""The characteristic equation at points of the warped circle, each term times the pole polynomial,
with bounds on what rounding and the errors of a frame's entries make of it together.

The bordered matrix [[w I - E, -B], [C, D]] has the pole polynomial p as its first minor, and p times
the loop's response G as its determinant. What is computed is exact for matrices that differ from it
by bounds that are known, and how far a determinant moves with its matrix is bounded in two ways.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.batches import NUMBERS_AT_ONCE
from wavesweep.engine._monodromy.cut import LinearFractional
from wavesweep.engine._monodromy.hessenberg import even_units, in_units, polynomials, reduced
from wavesweep.engine._monodromy.unit_circle import inverse
from wavesweep.engine._stability.boundary import terms_of
from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.doubles import UNIT_ROUNDING as U

RESOLVENT_CHANGE = 0.1  # of a resolvent, what errors of entries may change it by


class BoundarySamples(NamedTuple):
    """The products `unit solved^*`, `fixed solved^*` and `|solved|^2` of the terms of the equation,
    `(3, loops, points)`, complex, and bounds on their errors."""

    products: np.ndarray
    errors: np.ndarray


class _Minors(NamedTuple):
    """The pole polynomial, `(loops, points)`, and the outputs times it, `(loops, points, 3)`, with
    bounds on their errors; shared: bound on a factor that all products of two have in common."""

    pole: np.ndarray
    outputs: np.ndarray
    pole_off: np.ndarray
    outputs_off: np.ndarray
    shared: np.ndarray | float


@np.errstate(all="ignore")  # bounds that are not finite prove nothing
def boundary_samples(
    cut: LinearFractional,
    parameter: str,
    phi: np.ndarray,
    scale: np.ndarray,
    *,
    alone: bool,
    closely: bool,
) -> BoundarySamples:
    """Return the samples at angles phi of the warped circle, `(points,)`; scale: of the warp, `(loops,)`.

    The warp is `z = (zeta + a)/(1 + a zeta)` with `a = (1 - r)/(1 + r)`, r the scale. alone: whether the
    fixed number is 0. closely: by close bounds, which take longer.
    """
    r = np.asarray(scale)[:, None]
    a = (1 - r) / (1 + r)
    zeta = np.exp(1j * phi)
    bottom = 1 + a * zeta
    near = np.abs(bottom)
    w = (1 - a) * (zeta - 1) / bottom
    # phi is known to 8 U, and so is zeta.
    off = U * (10 * (1 - a**2) / near**2 + np.abs(w) * (3 / near + 12))
    minors = _minors(cut, w, off, closely)
    degree = cut.E.shape[-1] + cut.integrates
    size = near**degree
    size = size / (size * np.abs(minors.pole)).max(-1, keepdims=True)
    pole, outputs = size * minors.pole, size[..., None] * minors.outputs
    terms = terms_of(cut, w, outputs, pole)
    sizes = terms_of(cut, np.abs(w), np.abs(outputs), np.abs(pole))
    moved = terms_of(cut, np.abs(w), size[..., None] * minors.outputs_off, size * minors.pole_off)
    of_w = off / np.abs(w) + 8 * U
    solved, fixed = terms.along(parameter)
    solved_size, fixed_size = sizes.along(parameter)
    solved_moved, fixed_moved = moved.along(parameter)
    solved_off = solved_moved + of_w * solved_size
    rounding = U * (2 * degree * (12 / near + 3) + 6 * degree + 32)
    products = []
    errors = []
    for term, error in (
        (terms.unit, moved.unit + of_w * sizes.unit),
        (fixed * (not alone), (fixed_moved + of_w * fixed_size) * (not alone)),
        (solved, solved_off),
    ):
        products.append(term * solved.conj())
        change = np.abs(term) * solved_off + error * (np.abs(solved) + solved_off)
        both = np.abs(term) * np.abs(solved)
        errors.append(minors.shared * change + (minors.shared - 1 + rounding) * both)
    return BoundarySamples(np.stack(products), np.stack(errors))


def _minors(cut: LinearFractional, w: np.ndarray, off: np.ndarray, closely: bool) -> _Minors:
    """The minors of the bordered matrices of loops, in even units; off: bounds on the errors of w."""
    matrices = [_of_batch(cut, matrix) for matrix in (cut.E, cut.B, cut.C)]
    units = even_units(matrices[0])
    system = in_units(units, *matrices)
    errors = in_units(units, *(_of_batch(cut, matrix) for matrix in (cut.dE, cut.dB, cut.dC)))
    n = len(units)
    system[n:, 0] = _of_batch(cut, cut.D)[..., 0].T
    errors[n:, 0] = _of_batch(cut, cut.dD)[..., 0].T
    if not closely:
        return _by_reduction(system, errors, w, off)
    step = max(1, NUMBERS_AT_ONCE // (w.shape[-1] * n**2))
    parts = []
    for first in range(0, len(w), step):
        loops = slice(first, first + step)
        parts.append(_by_elimination(system[..., loops], errors[..., loops], w[loops], off[loops]))
    return _Minors(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _of_batch(cut: LinearFractional, matrix: np.ndarray) -> np.ndarray:
    return np.broadcast_to(matrix, (*cut.batch, *matrix.shape[-2:]))


def _by_reduction(
    system: np.ndarray, errors: np.ndarray, w: np.ndarray, off: np.ndarray
) -> _Minors:
    """Minors from one orthogonal reduction of each loop.

    system: [[B, E], [D, C]], `(n + outputs, n + 1, loops)`; errors: of its entries. A reflection of m
    rows moves a column by at most `(4 m + 15) U` of its norm: its vector is of length sqrt(2) but for
    `(m + 6) U`, and a product with it is summed up in m terms. n - 1 of them from both sides, what they
    leave below the diagonal and Hyman's recurrence move E by `(4 n^2 + 40 n + 16) U` of Frobenius' norm
    at most, and B and C by half as much, besides `5 U |w|` on the diagonal.

    A determinant is linear in each row, so by Hadamard's inequality errors of e_k in rows of norms m_k
    move it by at most `prod m_k (exp(sum e_k/m_k) - 1)`. Of the bordered matrix the last column is
    divided by b, `b^2 = sum (B_k/m_k)^2`, by which the norms of the other rows multiply to no more than
    sqrt(e) times those without it.
    """
    n = system.shape[1] - 1
    pole, over = polynomials(reduced(system), w)
    B, E = system[:n, 0], system[:n, 1:]
    C, D = system[n:, 1:], np.abs(system[n:, 0])[..., None]
    every = range(n)
    beside = E**2
    beside[every, every] = 0.0
    rows = np.sqrt(beside.sum(1)[..., None] + np.abs(w - E[every, every][..., None]) ** 2)
    rows = np.maximum(rows, NEXT_TO_ZERO)
    evenly = np.linalg.norm(1 / rows, axis=0)
    roundings = (4 * n * (n + 10) + 16) * U

    def norm(matrix: np.ndarray, *axes: int) -> np.ndarray:
        return np.sqrt((matrix**2).sum(axes))[..., None]

    of_E = (roundings * norm(E, 0, 1) + n**0.5 * (5 * U * np.abs(w) + off)) * evenly
    of_E = of_E + (norm(errors[:n, 1:], 1) / rows).sum(0)
    through = np.sqrt(((B[..., None] / rows) ** 2).sum(0)) + NEXT_TO_ZERO
    of_B = roundings / 2 * norm(B, 0) * evenly + (errors[:n, 0, :, None] / rows).sum(0)
    read = np.hypot(through * norm(C, 1), D) + NEXT_TO_ZERO
    of_C = through * (roundings / 2 * norm(C, 1) + norm(errors[n:, 1:], 1)) + errors[n:, 0, :, None]
    size = np.exp(np.log(rows).sum(0))
    outputs_off = np.exp(0.5) * size * read * np.expm1(of_E + of_B / through + of_C / read)
    of_D = D * np.abs(pole)
    over = np.moveaxis(over, 1, 0)
    outputs_off = outputs_off + 8 * U * (np.abs(over) + 2 * of_D)
    outputs = over + system[n:, 0, :, None] * pole
    return _Minors(
        pole,
        np.moveaxis(outputs, 0, -1),
        size * np.expm1(of_E),
        np.moveaxis(outputs_off, 0, -1),
        1.0,
    )


def _by_elimination(
    system: np.ndarray, errors: np.ndarray, w: np.ndarray, off: np.ndarray
) -> _Minors:
    """Minors by elimination at each point, with bounds entry by entry; see `_by_reduction`.

    What is computed is exact for matrices [[M, -B], [C, D]] that are off by `(4 n + 12) U |L| |U|`
    at most (N. J. Higham, Accuracy and Stability of Numerical Algorithms, 2002, theorem 9.3). Beside
    these let X, Y, W, V be errors of E, B, C, D with bounds dE, dB, dC, dD, and Z near to R = M^-1. As
    `R = (1 - T)^-1 Z` with `T = 1 - Z M`, |R| is at most `A = (1 - t)^-1 |Z|` with a bound t on |T|, and
    R is off from Z by A - |Z|. With `N = (1 - A dE)^-1`, which is not negative and bounds
    `(1 - R X)^-1` if no row of `A dE` adds up to 1, `|C R'| <= c = |C R| + |C R| dE N A` for the
    resolvent R' of E + X, and G is off by at most

        dG = c (dE |R B| + dB) + dC (|R B| + N A (dE |R B| + dB)) + dD.

    The pole polynomial X multiplies by `det(1 - R X)`. Its logarithm is minus the sum of
    `tr((R X)^k)/k`, so its square is between 1/q and q, `q = det(1 - A dE)^-2`.
    """
    n = system.shape[1] - 1
    points = w.shape[-1]
    bordered = np.repeat(np.roll(system, -1, axis=1), points, axis=-1).astype(complex)
    bordered[:n] *= -1
    every = range(n)
    bordered[every, every] += w.ravel()
    pole, G, of_elimination = _eliminated(bordered)
    off_entries = np.repeat(np.roll(errors, -1, axis=1), points, axis=-1)
    off_entries = off_entries + (4 * n + 12) * U * of_elimination
    off_entries[every, every] += off.ravel() + U * np.abs(bordered[every, every])
    M, B, C, _ = _parts(np.moveaxis(bordered, -1, 0))
    dE, dB, dC, dD = _parts(np.moveaxis(off_entries, -1, 0))
    identity = np.eye(n)
    Z = inverse(M)
    A = np.abs(Z)
    t = np.abs(identity - Z @ M) + (4 * n + 8) * U * (A @ np.abs(M) + identity) + A @ dE
    bounded = t.sum(-1).max(-1) < RESOLVENT_CHANGE
    A = inverse(identity - np.where(bounded[:, None, None], t, 0.0)) @ A
    reach = A @ dE
    bounded &= reach.sum(-1).max(-1) < RESOLVENT_CHANGE
    reach = np.where(bounded[:, None, None], reach, 0.0)
    spread = A - (1 - (4 * n + 8) * U) * np.abs(Z)
    RB = np.abs(Z @ B) + spread @ np.abs(B)
    CR = np.abs(C @ Z) + np.abs(C) @ spread
    NA = inverse(identity - reach) @ A
    entering = dE @ RB + dB
    dG = (CR + CR @ dE @ NA) @ entering + dC @ (RB + NA @ entering) + dD
    shared = np.where(bounded, np.linalg.det(identity - reach) ** -2.0, np.inf)
    shape = w.shape
    size = np.abs(pole).reshape(shape)
    outputs = G.T.reshape(*shape, -1) * size[..., None]
    outputs_off = dG[..., 0].reshape(*shape, -1) * size[..., None]
    return _Minors(size, outputs, 0 * size, outputs_off, shared.reshape(shape))


def _parts(bordered: np.ndarray) -> tuple[np.ndarray, ...]:
    """The four parts of bordered matrices, `(..., n + outputs, n + 1)`."""
    n = bordered.shape[-1] - 1
    upper, lower = bordered[..., :n, :], bordered[..., n:, :]
    return upper[..., :n], upper[..., n:], lower[..., :n], lower[..., n:]


def _eliminated(bordered: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the determinants of the upper parts of `(n + outputs, n + 1, batch)`, up to their signs,
    what elimination leaves of the last column, and |L| |U| with the rows in their places."""
    A = bordered.copy()
    n = A.shape[1] - 1
    batch = np.arange(A.shape[-1])
    place = np.repeat(np.arange(len(A))[:, None], batch.size, axis=-1)
    size = np.zeros(A.shape)
    pole = np.ones(batch.size, complex)
    for k in range(n):
        pivot = k + np.abs(A[k:n, k]).argmax(0)
        for rows in (A, size, place):
            chosen = rows[pivot, ..., batch]
            rows[pivot, ..., batch] = np.moveaxis(rows[k], -1, 0)
            rows[k] = np.moveaxis(chosen, 0, -1)
        pole *= A[k, k]
        ratio = A[k + 1 :, k] / A[k, k]
        size[k, k:] += np.abs(A[k, k:])
        size[k + 1 :, k:] += np.abs(ratio)[:, None] * np.abs(A[k, k:])
        A[k + 1 :, k + 1 :] -= ratio[:, None] * A[k, k + 1 :]
    size[n:, n] += np.abs(A[n:, n])
    back = np.argsort(place, axis=0)
    return pole, A[n:, n], np.take_along_axis(size, back[:, None], axis=0)
