"""Pencils `N - z L` whose eigenvalues are shown to be off the unit circle, or off an arc of it, for all numbers of a disc.

The map `(z - a)/(1 - conj(a) z)` takes the circle to itself, and what is infinite to a finite place: less its value c at z = 1,
over c, the eigenvalues d of the circle have |1 + d| = 1, and solve

    rate (N - L) v = d (L - conj(a) N) v,   rate = (1 - |a|^2)/(1 - a).

An arc is that from one angle of z to another in [0, pi], and its mirror image.
"""

import numpy as np

from wavesweep.engine.frames import ROUNDING, balance, inverse, solve
from wavesweep.require.disc_panels import SAFE
from wavesweep.require.discs import SMALL

TURN = 0.35 + 0.4j  # a
RATE = (1 - abs(TURN) ** 2) / (1 - TURN)
ONE = (1 - TURN) / (1 - np.conj(TURN))  # where the map takes z = 1
SURELY = 1e-9  # relative, by which dominance has to hold beyond its own rounding
SWEEPS = 12  # of balancing
WIDER = 1e-12  # rad, by which an arc is taken wider, since its ends are rounded


def off_circle(d):
    """Distance of 1 + d from the circle."""
    return np.abs(2 * d.real + np.abs(d) ** 2) / (np.abs(1 + d) + 1)


def off_arc(d, arc):
    """Distance of 1 + d from what the map makes of an arc; d: `(n, any)`; arc: its ends (rad), `(n, 2)`."""
    low, high = np.clip(arc + WIDER * np.array([-1, 1]), 0, np.pi)[:, None, :].transpose(2, 0, 1)
    distance, circle = np.inf, off_circle(d)
    for ends in ((low, high), (-high, -low)):
        z = np.exp(1j * np.array(ends))
        first, last = (z - TURN) / (1 - np.conj(TURN) * z) / ONE
        beyond = np.angle((1 + d) / first) % (2 * np.pi) > np.angle(last / first) % (2 * np.pi)
        distance = np.minimum(distance, np.where(beyond, np.minimum(np.abs(1 + d - first), np.abs(1 + d - last)), circle))
    return distance


def angles_of(d):
    """The angles (rad) of z next to which the eigenvalues are."""
    zeta = ONE * (1 + d)
    return np.abs(np.angle((zeta + TURN) / (1 + np.conj(TURN) * zeta)))


def clear(K, dK, L, dL, rims, inputs, arc):
    """Whether no eigenvalue of pencils is on an arc of the circle, for all numbers of discs; the eigenvalues in the middle.

    K, L: N - L and L in the middle, `(n, r, r)`, with bounds on their errors; rims: both on circles of twice the size about the
    discs, `(n, points, r, r)`. inputs: the last columns, in which L is 0 and the pencil is N times a number that is not 0 for
    any d of the circle. arc: its ends (rad), `(n, 2)`. Without this number, and in vectors V of the eigenvalues and a basis W,
    it is diagonal in the middle, `d_i - d`, or 1 for the inputs, and what is left is dominated by that.
    """
    N, n = K.shape[-1], K.shape[-1] - inputs
    states, last = np.arange(N) < n, np.arange(N) >= n

    def parts(K, L, sizes=False):
        """P and Q of `P - d Q`, or their sizes."""
        rate, back, unit = RATE, -np.conj(TURN), 1 - np.conj(TURN)
        if sizes:
            rate, back, unit = abs(rate), abs(back), abs(unit)
        return np.where(last, K, rate * K), states * (unit * L + back * K)

    (P, Q), rounding = parts(K, L), N * ROUNDING  # of complex products of three, one after the other
    sizes = parts(dK + rounding * np.abs(K), dL + rounding * np.abs(L), sizes=True)
    with np.errstate(all="ignore"):
        from_u = inverse(P[:, n:, n:])
        S, T = (pencil[:, :n, :n] - P[:, :n, n:] @ from_u @ pencil[:, n:, :n] for pencil in (P, Q))
        S = inverse(T) @ S
        fine = np.isfinite(S).all((-1, -2))
        S, units = balance(np.where(fine[:, None, None], S, 0.0), SWEEPS)
        delta, V = _vectors(S)
        V = units[:, :, None] * V
        U = -from_u @ (P[:, n:, :n] @ V - Q[:, n:, :n] @ V * delta[:, None, :])
        V = np.concatenate([np.concatenate([V, 0 * _t(U)], -1), np.concatenate([U, 0 * from_u + np.eye(inputs)], -1)], -2)
        W = inverse(np.where(last, P, Q @ V))
        moved = [rim - middle_matrix[:, None] for rim, middle_matrix in zip(rims, (K, L), strict=True)]
        moved = [
            np.concatenate(pair, 1) for pair in zip(parts(*moved), parts(*(matrix.conj() for matrix in moved)), strict=True)
        ]
        d = np.concatenate([delta, np.zeros((len(delta), inputs))], -1)
        off = W @ P @ V - W @ Q @ V * d[:, None, :] - np.eye(N) * last, W @ Q @ V - np.eye(N) * states
        F, loss = (
            SAFE / 2 * np.abs(_between(W, change, V, inputs)).max(1) + np.abs(rounding) + np.abs(W) @ size @ np.abs(V)
            for change, rounding, size in zip(moved, off, sizes, strict=True)
        )
        room = np.where(last, 1.0, off_arc(d, arc))
        size = np.where(last, 2.0, np.abs(d) + room)  # of d where it is nearest
        H = (F + size[:, :, None] * loss) / room[:, :, None]
        fine &= np.isfinite(H).all((-1, -2))
        H, _ = balance(np.where(fine[:, None, None], H, 0.0), SWEEPS)
        u = solve(np.eye(N) * (1 + SURELY) - H, np.ones((len(H), N, 1)))
        fine &= (u > 0).all((1, 2)) & (H @ u < u * (1 - SURELY / 2)).all((1, 2))
    return fine, delta


def _between(W, parts, V, inputs):
    """`W part V` of parts `(n, points, r, r)`, of whose three rows of blocks most numbers change few rows or columns."""
    N = V.shape[-1]
    n, total = (N - inputs) // 2, 0.0
    for block in (slice(n), slice(n, 2 * n), slice(2 * n, N)):
        nonzero = np.any(parts[..., block, :] != 0, (0, 1))
        rows, columns = np.arange(N)[block][nonzero.any(1)], np.flatnonzero(nonzero.any(0))
        factors = W[:, None][..., rows], parts[..., rows[:, None], columns], V[:, None, columns]
        left, middle, right = map(np.ascontiguousarray, factors)
        total = total + (left @ (middle @ right) if rows.size <= columns.size else (left @ middle) @ right)
    return total


def _vectors(S):
    """Eigenvalues and eigenvectors of matrices; of several next to z = 0 or infinity, which may have too few, a Schur basis."""
    from scipy.linalg import schur

    delta, V = (array.astype(complex) for array in np.linalg.eig(S))
    for middle in (-TURN, -1 / np.conj(TURN)):
        place = middle * (1 - np.conj(TURN)) / (1 - TURN) - 1
        near = np.abs(delta - place) <= SMALL
        for at in np.flatnonzero(near.sum(-1) > 1):
            T, basis, count = schur(S[at], output="complex", sort=lambda d, place=place: abs(d - place) <= SMALL)
            if count == near[at].sum():
                delta[at, near[at]], V[at][:, near[at]] = np.diagonal(T)[:count], basis[:, :count]
    return delta, V


def _t(part):
    return np.swapaxes(part, -1, -2)
