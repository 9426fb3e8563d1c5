"""Critical functions of a frame, from coefficients or eigenvalues: they vanish if eigenvalues are on the unit circle.

With eigenvalues z_i of the frame, `prod_{i<j} (1 - z_i z_j)`, `prod (1 - z_i)` and `prod (1 + z_i)` are positive if it is
stable, and one of them vanishes where an eigenvalue reaches the unit circle (L. Saydy, A. L. Tits, E. H. Abed, Math. Control
Signals Systems 3, 1990). So if they do not vanish on a connected set of loops, and one of these loops is stable, all are. On a
box the maps are analytic in all of its numbers.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np

from wavesweep.engine.monodromy.rounding import balance
from wavesweep.engine.monodromy.unit_circle import inverse
from wavesweep.engine.stability.positive import Box, Cover, FunctionValues, Resolved, positive
from wavesweep.engine.stability.sampled_frames import Frames

PAIR, ONE, MINUS_ONE = 0, 1, 2  # the functions: a complex pair, z = 1, z = -1
LARGEST_ENTRY = 1e150  # of an entry; products of two eigenvalues overflow beyond
MOST_ERROR = 1e20  # of a value, in roundings of itself
MOST_OF_EIGENVALUES = 1e12  # the same where nothing is better: an eigenvalue is seldom as far off as its bound
CAUTION = 20  # roundings of the largest entry that an eigenvalue is believed to
BLOCK = 512  # matrices at a time, which the cache holds
EPS = np.finfo(float).eps
SWEEPS = 12  # of balancing
MOST_ORDER = 14  # with more states the coefficients of characteristic polynomials have lost too much as a rule


def from_coefficients(E, units=1.0):
    """Return phase and logarithm of the size of three functions, `(3, matrices)` each, and their errors, in roundings.

    E: `(matrices, n, n)`, real or complex, frames less identity, whose eigenvalues are `w_i = z_i - 1`; units: `(matrices, n)`,
    of the states, see `balance`. PAIR is `prod_{i<j} (1 - z_i z_j)`, ONE `prod (-w_i)`, MINUS_ONE `prod (2 + w_i)`.
    No eigenvalue is needed: all are symmetric functions, so they follow from the characteristic polynomial, which
    elimination to Hessenberg form gives (J. H. Wilkinson, The Algebraic Eigenvalue Problem, 1965, chapters 6 and 7). With
    `s = w/(2 + w)`, which maps the circle to the imaginary axis, PAIR is the last Hurwitz determinant but one of the polynomial
    in s (L. Orlando, Math. Ann. 71, 1911), the resultant of its even and its odd part, which is the determinant of their Bezout
    matrix. Its error is the effect of errors of the coefficients on that determinant, to first order.
    """
    E, finite = _finite(E, units)
    with np.errstate(all="ignore"):
        starts = range(0, len(E), BLOCK)
        blocks = [_functions(*characteristic(E[at : at + BLOCK])) for at in starts]
        found = [np.concatenate(part, axis=-1) for part in zip(*blocks, strict=True)]
    return _given(found, finite)


def from_eigenvalues(E, units=1.0):
    """`from_coefficients` by way of the eigenvalues.

    This is slower, but accurate for more states, since coefficients of crowded poles lose digits.
    """
    E, finite = _finite(E, units)
    w, n = np.linalg.eigvals(E).astype(complex), E.shape[-1]
    i, j = np.triu_indices(n, 1)
    size = np.maximum(1, np.abs(E).max((-1, -2), initial=0))
    found = [_product(factors, size) for factors in (-(w[:, i] + w[:, j] + w[:, i] * w[:, j]), -w, 2 + w)]
    return _given([np.stack(part) for part in zip(*found, strict=True)], finite, MOST_OF_EIGENVALUES)


def of_complex_frames(E, conjugate, units=1.0):
    """Return phase, logarithm and error, see above, of `prod_{i,j} (1 - z_i conj(z_j))`, which is real and vanishes if an
    eigenvalue of a complex frame is on the unit circle.

    E, conjugate: `(matrices, n, n)`, a frame less identity and its conjugate, as analytic functions of what they depend on.
    """
    (E, finite), (conjugate, _) = _finite(E, units), _finite(conjugate, units)
    w, v = np.linalg.eigvals(E)[:, :, None], np.linalg.eigvals(conjugate)[:, None]
    size = np.maximum(1, np.maximum(np.abs(E), np.abs(conjugate)).max((-1, -2), initial=0))
    return _given([part[None] for part in _product(-(w + v + w * v), size)], finite, MOST_OF_EIGENVALUES)


def _product(factors, size):
    """Return phase, logarithm and error of the product of factors of eigenvalues of matrices of that size."""
    # An eigenvalue is good to eps times the size of the matrix, and a small factor has nothing else to stand on.
    factors = factors.reshape(len(factors), -1)
    magnitude = np.maximum(np.abs(factors), 1e-300)
    with np.errstate(over="ignore"):
        error = CAUTION * size / np.maximum(magnitude.min(-1, initial=1.0), 1e-30)
    return (factors / magnitude).prod(-1), np.log(magnitude).sum(-1), error


def _finite(E, units):
    """Return E in these units, with zeros in place of matrices that overflow, and which matrices do not overflow.

    A single matrix is doubled: numpy adds up one row in another order than several, and a result must not depend on the batch.
    """
    finite, units = (np.abs(E) < LARGEST_ENTRY).all((-1, -2)), np.broadcast_to(units, E.shape[:-1])
    E = np.where(finite[:, None, None], E, 0.0) * (units[:, None, :] / units[:, :, None])
    return np.repeat(E, 2, axis=0) if len(E) == 1 else E, finite


def characteristic(E):
    """Return the coefficients of `det(w I - E)` in powers of `w/size`, their errors, in roundings, and size.

    E: `(matrices, n, n)`. The coefficients are `(n + 1, matrices)`, that of the lowest power first; size is a power of two for
    every matrix.
    """
    A = np.moveaxis(E, 0, -1).copy()
    n, size = len(A), np.exp2(np.ceil(np.log2(np.maximum(1, np.abs(A).max((0, 1), initial=0)))))
    c = _characteristic(_hessenberg(A / size))
    # Of each coefficient: its own rounding, and what one of the largest entry (1 here) may do to it.
    reach = np.abs(c)
    reach[:-1] += np.arange(1, n + 1)[:, None] * np.abs(c[1:])
    return c, reach, size


def _functions(c, reach, size):
    """Return phases, logarithms and errors, `(3, matrices)` each; the matrices are in the last axis from here on."""
    n = len(c) - 1
    q, errors = _mapped(c, reach, size)
    largest = np.abs(q).max(0)
    phase, log, error = _last_but_one(q / largest, errors / largest)
    values = (
        (phase, log + (n - 1) * (n * np.log(size) + np.log(largest) - n / 2 * np.log(2)), error),
        _split(c[0], reach[0], n * np.log(size)),
        _split(q[-1], errors[-1], n * np.log(size)),
    )
    return tuple(np.stack(part) for part in zip(*values, strict=True))


def _given(parts, finite, most=MOST_ERROR):
    """Return phases, logarithms and errors of the given number of matrices.

    They are NaN, inf and the largest error if E is not finite.
    """
    phase, log, error = (part[:, : finite.size] for part in parts)
    known = finite & np.isfinite(log) & np.isfinite(error)
    log = np.where(finite & ~known, -np.inf, log)
    phase = np.where(finite, phase, np.nan).astype(complex)
    return phase, np.where(finite, log, np.inf), np.where(known, np.minimum(error, most), most)


def _split(value, reach, factor):
    """Return phase, logarithm of the size and relative error of a number times exp(factor)."""
    size = np.abs(value)
    magnitude = np.maximum(size, 1e-300)
    return value / magnitude, np.log(magnitude) + factor, np.where(size > 1e-290, reach / magnitude, 1e300)


def _hessenberg(A):
    """Reduce A, `(n, n, matrices)`, in place to Hessenberg form by elimination with row exchanges."""
    for k in range(1, len(A) - 1):
        pivot = np.argmax(np.abs(A[k:, k - 1]), axis=0) + k
        moved = np.flatnonzero(pivot != k)
        if moved.size:
            row = pivot[moved]
            for side in (A, np.swapaxes(A, 0, 1)):
                above = side[k][:, moved]
                side[k][:, moved] = side[row, :, moved].T
                side[row, :, moved] = above.T
        lead = A[k, k - 1]
        factor = A[k + 1 :, k - 1] / np.where(lead == 0, 1, lead)
        A[k + 1 :, k - 1 :] -= factor[:, None] * A[k, k - 1 :]
        for i, each in enumerate(factor, start=k + 1):
            A[:, k] += A[:, i] * each
    return A


def _characteristic(H):
    """Return the coefficients of `det(w I - H)`, that of the lowest power first, `(n + 1, matrices)`; H in Hessenberg form."""
    leading = [np.ones((1, H.shape[-1]), H.dtype)]  # those of the leading parts of H
    for j in range(len(H)):
        now, product = np.zeros((j + 2, H.shape[-1]), H.dtype), np.ones(H.shape[-1], H.dtype)
        now[1:] = leading[-1]
        now[:-1] -= H[j, j] * leading[-1]
        for i in range(j - 1, -1, -1):
            product = product * H[i + 1, i]
            now[: i + 1] -= H[i, j] * product * leading[i]
        leading.append(now)
    return leading[-1]


@cache
def _powers(order):
    """Return the coefficients of `(2 s)^k (1 - s)^(order - k)`, by columns."""
    out = np.zeros((order + 1, order + 1))
    for k in range(order + 1):
        for i in range(order - k + 1):
            out[k + i, k] = 2.0**k * comb(order - k, i) * (-1) ** i
    out.flags.writeable = False
    return out


def _mapped(c, rounding, size):
    """Return coefficients in s, over `size^order`, and their errors, of the polynomial whose coefficients in `w/size` are c."""
    change = _powers(len(c) - 1)
    q, reach = np.zeros_like(c), np.zeros_like(rounding)
    weight = np.ones_like(size)
    for k, (each, error) in enumerate(zip(c, rounding, strict=True)):
        for i in range(k, len(c)):
            q[i] += change[i, k] * (each * weight)
            reach[i] += abs(change[i, k]) * (error * weight)
        weight = weight / size
    return q, reach


def _last_but_one(q, reach):
    """Return phase, logarithm and relative error of the last Hurwitz determinant but one; reach: errors of coefficients q."""
    half = (len(q) - 1) // 2
    if not half:
        return np.ones_like(q[0]), np.zeros(q.shape[-1]), np.zeros(q.shape[-1])
    even, odd = (np.concatenate([part, 0 * part[:1]])[: half + 1] for part in (q[0::2], q[1::2]))
    sizes = [np.concatenate([part, 0 * part[:1]])[: half + 1] for part in (reach[0::2], reach[1::2])]
    matrix, error = np.zeros((half, half, q.shape[-1]), q.dtype), np.zeros((half, half, q.shape[-1]))
    a, b = np.abs(even), np.abs(odd)
    for i in range(half):
        for j in range(half - 1, i - 1, -1):
            before = (matrix[i - 1, j + 1], error[i - 1, j + 1]) if i and j + 1 < half else (0.0, 0.0)
            matrix[i, j] = even[j + 1] * odd[i] - even[i] * odd[j + 1] + before[0]
            terms = a[j + 1] * sizes[1][i] + sizes[0][j + 1] * b[i] + a[i] * sizes[1][j + 1] + sizes[0][i] * b[j + 1]
            error[i, j] = terms + before[1]
            matrix[j, i], error[j, i] = matrix[i, j], error[i, j]
    if len(q) % 2:  # of an even order the leading coefficient is a factor of the last column, and not one of the function
        matrix[:, -1], error[:, -1] = odd[:half], sizes[1][:half]
    lost = ~np.isfinite(matrix).all((0, 1))
    matrix = np.moveaxis(np.where(lost, np.eye(half)[:, :, None], matrix), -1, 0)
    phase, log = np.linalg.slogdet(matrix)
    back = np.moveaxis(inverse(matrix), 0, -1)
    total = np.zeros(lost.size)
    for i in range(half):
        for j in range(half):
            total += np.abs(back[j, i]) * error[i, j]
    # A matrix that is exactly singular has no inverse to say what errors do to it.
    return phase, np.where(phase == 0, -690.0, log), np.where(lost | (phase == 0), np.inf, total)


def cover(
    frames: Callable[[np.ndarray], Frames], box: Box, bounds: Box, most: int, resolution: Resolved | None = None
) -> Cover:
    """Prove that all loops of a box are stable, except in the parts that are left open; stop at the first unstable loops.

    frames: from points `(n, numbers)`, real or complex, to their `Frames`. box: a number whose two ends are equal is no
    dimension of it. bounds: the range of each number in which the loops are analytic. most: frames to compute at most.
    resolution: see `positive`.
    """
    return positive(GuardianMaps(frames), box, bounds, most, resolution)


@dataclass(frozen=True, slots=True, eq=False)
class GuardianMaps:
    """The guardian maps of frames as `Functions` of the numbers of a box."""

    frames: Callable[[np.ndarray], Frames]

    def units(self, middle) -> np.ndarray:
        """See `Functions`."""
        E = np.nan_to_num(np.abs(self.frames(middle[None]).E), posinf=0.0)
        return balance(E, SWEEPS)[1][0]

    def values(self, x, units):
        """See `Functions`."""
        found = self.frames(x)
        n = found.E.shape[-1]
        of = from_coefficients if n <= MOST_ORDER else from_eigenvalues
        return FunctionValues(*of(found.E, np.broadcast_to(units, (len(x), n))), found.pivots)
