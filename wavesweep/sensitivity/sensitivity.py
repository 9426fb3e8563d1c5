"""Derivatives of the ends of stable intervals by the numbers of the loop, and the mode that crosses
the unit circle there.

At an end p of an interval an eigenvalue z of the frame is on the unit circle: `F(p, q) = |z|^2 - 1
= 0`. By the implicit function theorem `dp/dq = -F_q/F_p`. With eigenvectors y, x from the left and
the right, `dz = y^H dE x/(y^H x)`, and `F_q = 2 Re(conj(z) dz/dq)` (P. Lancaster, On eigenvalues of
matrices dependent on a parameter, Numer. Math. 6, 1964).
"""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.doubles import EPS, LEAST_NORMAL
from wavesweep.engine.frames import balance
from wavesweep.engine.poles import eigenvalues, excess
from wavesweep.engine.rows import Rows

# relative, of a complex step: its square is below all rounding, and nothing is subtracted
COMPLEX_STEP = 1e-30
CORNER = 1e-6  # of an end; a further crossing so near makes it a corner
SLOPPY = 1e-8  # error of an elasticity, of itself or of 1, beyond which it is not given


@dataclass(frozen=True, slots=True)
class EndCrossings(Rows):
    """Eigenvalues on the unit circle at ends of intervals; at each end the one that sets the end
    comes first.

    end: index of the end, `(rows,)`. number: of the crossing at its end, from 0. delta: the
    eigenvalue less 1. slope `(rows, q)`: derivative of the end by each of the numbers, in the units
    of the derivatives given. error `(rows, q)`: bound on its rounding. share `(rows, n)`:
    participation of each state; the shares add up to 1. defective: whether another eigenvalue meets
    this one.
    """

    end: np.ndarray
    number: np.ndarray
    delta: np.ndarray
    slope: np.ndarray
    error: np.ndarray
    share: np.ndarray
    defective: np.ndarray


def crossings_of(E, dE_end, dE, theta, size, rising) -> EndCrossings:
    """Return the crossings at ends of intervals, with the derivatives of the end by each number.

    E `(ends, n, n)`: frames less identity at the ends. dE_end `(ends, n, n)`: their derivatives by
    the parameter that the interval lies along. dE `(ends, q, n, n)`: those by the numbers. theta:
    angle of the eigenvalue that sets the end, rad. size: of the end; a further crossing nearer than
    1e-6 times this size makes a corner. rising: whether the loop is unstable above the end, and not
    below. Only such further crossings are given, by their first order, and one eigenvalue of each
    complex pair. Accuracy: `error` bounds the first order of a backward error of E of a few
    roundings, in units in which E is balanced.
    """
    delta, finite = eigenvalues(E)
    E = np.where(finite[:, None, None], E, 0.0)
    upper = delta.imag >= 0
    certain, theta = np.isfinite(theta) & finite, np.nan_to_num(theta)
    away = np.where(upper, np.abs(1 + delta - np.exp(1j * theta)[:, None]), np.inf)
    first = np.argmin(away, -1)
    far = np.where(upper, np.abs(excess(delta)), np.inf)
    far[np.arange(first.size), first] = -1.0  # before all others
    order = np.argsort(far, -1, kind="stable")[:, :4]  # crossings of an end
    balanced, units = balance(E)
    ends = _Ends(balanced, units, dE_end, dE, size, rising)
    batches = []
    for number in range(order.shape[1]):
        present = np.flatnonzero(
            np.isfinite(np.take_along_axis(far, order[:, number : number + 1], -1)[:, 0])
        )
        chosen = delta[present, order[present, number]]
        crossing, near = _crossing(ends.take(present), chosen)
        batches.append(
            EndCrossings(present, np.full(present.size, number), *crossing).take(
                near & certain[present] if number else slice(None)
            )
        )
    joined = EndCrossings.join(batches)
    joined = joined.take(np.lexsort((joined.number, joined.end)))
    starts = np.searchsorted(joined.end, joined.end)
    error = np.where(certain[joined.end][:, None], joined.error, np.inf)
    return replace(joined, number=np.arange(joined.end.size) - starts, error=error)


@dataclass(frozen=True, slots=True, eq=False)
class _Ends(Rows):
    """Ends of intervals with their frames, see `crossings_of`; E in even units of the states."""

    E: np.ndarray
    units: np.ndarray
    dE_end: np.ndarray
    dE: np.ndarray
    size: np.ndarray
    rising: np.ndarray


def _crossing(ends: _Ends, delta):
    """The fields for one eigenvalue of each end, and whether it is on the circle within the
    distance of a corner."""
    mode = _mode(ends.E, delta)
    scale = (ends.units[:, None, :] / ends.units[:, :, None])[:, None]
    with np.errstate(all="ignore"):
        F_end, off_end = _growth(ends.dE_end[:, None] * scale, mode)
        F, off = _growth(ends.dE * scale, mode)
        slope = -F / F_end
        error = (off + np.abs(slope) * off_end) / np.maximum(np.abs(F_end) - off_end, 0.0)
        near = np.abs(excess(delta)) <= CORNER * np.abs(F_end[:, 0]) * ends.size
    share = np.abs(mode.left * mode.right)
    share /= np.maximum(share.sum(-1, keepdims=True), LEAST_NORMAL)
    # not the crossing that sets the end, as far as doubles tell
    wrong = ~near | ((F_end[:, 0] > 0) != ends.rising)
    error = np.where(wrong[:, None] | ~np.isfinite(error), np.inf, error)
    # |y^H x| of eigenvectors of length 1, below which two eigenvalues meet: the root of
    # a double's rounding
    return (delta, slope, error, share, np.abs(mode.overlap) < 1e-7), near & ~wrong


@dataclass(frozen=True, slots=True)
class _Mode:
    """Eigenvalues less 1 with their left eigenvectors (as rows, conjugate) and right eigenvectors,
    of length 1, `(rows, n)`.

    overlap: their product. off_left, off_right: bounds on the errors of their entries.
    """

    delta: np.ndarray
    left: np.ndarray
    right: np.ndarray
    overlap: np.ndarray
    off_left: np.ndarray
    off_right: np.ndarray


def _mode(E, delta) -> _Mode:
    """Return the modes of eigenvalues less 1 `delta` of E.

    The eigenvectors are the last singular vectors of `M = delta I - E`, refined by the
    pseudo-inverse N of M without them. If E changes by `e |E|`, the vector x changes by at most `e
    |N| (|E| + |delta|) |x|` to the first order. The refinement leaves an error no larger than that.
    The singular vectors alone do not: they are accurate to `e |M| |N|` as a whole.
    """
    n = E.shape[-1]
    M = delta[:, None, None] * np.eye(n) - E
    U, values, V = np.linalg.svd(M)
    U, V = np.conj(U.mT), np.conj(V.mT)
    with np.errstate(divide="ignore", invalid="ignore"):
        N = V[:, :, :-1] @ (U[:, :-1] / values[:, :-1, None])
    left, right = U[:, -1:], V[:, :, -1:]
    left, right = left - (left @ M) @ N, right - N @ (M @ right)
    # By so many roundings of its entries a frame of this order may be off.
    noise = 8 * n * EPS
    size = np.abs(E) + np.abs(delta)[:, None, None] * np.eye(n)
    off_right = noise * (np.abs(N) @ (size @ np.abs(right)))
    off_left = noise * ((np.abs(left) @ size) @ np.abs(N))
    return _Mode(
        delta, left[:, 0], right[..., 0], (left @ right)[:, 0, 0], off_left[:, 0], off_right[..., 0]
    )


def _growth(dE, mode):
    """Return `2 Re(conj(z) dz)` for each derivative `(rows, q, n, n)`, and a bound on its
    rounding, both `(rows, q)`."""
    left, right = mode.left[:, None, None, :], mode.right[:, None, :, None]
    off_left, off_right = mode.off_left[:, None, None, :], mode.off_right[:, None, :, None]
    on_left, on_right = left @ dE, dE @ right
    dz = (left @ on_right)[..., 0, 0] / mode.overlap[:, None]
    terms = np.abs(on_left) @ off_right + off_left @ np.abs(on_right)
    terms = terms + EPS * (np.abs(left) @ np.abs(dE) @ np.abs(right))
    both = np.abs(left) @ off_right + off_left @ np.abs(right)
    off = (terms[..., 0, 0] + np.abs(dz) * both[..., 0, 0]) / np.abs(mode.overlap)[:, None]
    z = 1 + mode.delta[:, None]
    return 2 * (np.conj(z) * dz).real, 2 * np.abs(z) * off


def tracked_eigenvalue(path, delta) -> np.ndarray:
    """Follow an eigenvalue less 1 from its value `delta` at the beginning of a path to the end of
    the path.

    path: eigenvalues less 1 at equal steps, `(rows, steps, n)`; delta: `(rows,)`. The next value is
    the one nearest to the linear prediction. This is done with all of the steps and with every
    second one. Returns NaN if the two do not end at the same eigenvalue, since other eigenvalues
    cannot be excluded then.
    """
    ends = []
    for stride in (1, 2):
        before, now = delta, delta
        for step in range(stride - 1, path.shape[1], stride):
            values = path[:, step]
            nearest = np.argmin(np.abs(values - (2 * now - before)[:, None]), -1)
            before, now = now, values[np.arange(nearest.size), nearest]
        ends.append(now)
    return np.where(ends[0] == ends[1], ends[0], np.nan)
