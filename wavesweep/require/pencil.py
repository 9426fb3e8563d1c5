"""Pencils `N - z L` whose eigenvalues are shown to be off the unit circle, or off an arc of it, for
all numbers of a disc.

The map `(z - a)/(1 - conj(a) z)` takes the circle to itself, and what is infinite to a finite
place: less its value c at z = 1, over c, the eigenvalues d of the circle have |1 + d| = 1, and
solve

    rate (N - L) v = d (L - conj(a) N) v,   rate = (1 - |a|^2)/(1 - a).

An arc is that from one angle of z to another in [0, pi], and its mirror image.
"""

import numpy as np

from wavesweep.engine.frames import Bounded, balance, inverse, solve
from wavesweep.require.disc_panels import SAFE

TURN = 0.35 + 0.4j  # a
RATE = (1 - abs(TURN) ** 2) / (1 - TURN)
ONE = (1 - TURN) / (1 - np.conj(TURN))  # where the map takes z = 1
# up to which eigenvalues of delays are taken together, whose vectors are nearly the same: 3 ticks of
# a dead time need it
SMALL_EIGENVALUES = 0.3
DOMINANT_BY = 1e-9  # relative, by which dominance has to hold beyond its own rounding
WIDER_ARC = 1e-12  # rad, by which an arc is taken wider, since its ends are rounded


def off_circle(d: np.ndarray) -> np.ndarray:
    """Distance of 1 + d from the circle."""
    return np.abs(2 * d.real + np.abs(d) ** 2) / (np.abs(1 + d) + 1)


def off_arc(d: np.ndarray, arc: np.ndarray) -> np.ndarray:
    """Distance of 1 + d from what the map makes of an arc; d: `(n, any)`; arc: its ends (rad),
    `(n, 2)`."""
    wider = np.clip(arc + WIDER_ARC * np.array([-1, 1]), 0, np.pi)
    low = wider[:, :1]
    high = wider[:, 1:]
    circle = off_circle(d)
    distance = np.inf
    for start, stop in ((low, high), (-high, -low)):
        first = _mapped(start)
        last = _mapped(stop)
        beyond = np.angle((1 + d) / first) % (2 * np.pi) > np.angle(last / first) % (2 * np.pi)
        of_ends = np.minimum(np.abs(1 + d - first), np.abs(1 + d - last))
        distance = np.minimum(distance, np.where(beyond, of_ends, circle))
    return distance


def _mapped(theta: np.ndarray) -> np.ndarray:
    """Where the map takes angles of the circle, over where it takes z = 1."""
    z = np.exp(1j * theta)
    return (z - TURN) / (1 - np.conj(TURN) * z) / ONE


def angles_of(d: np.ndarray) -> np.ndarray:
    """The angles (rad) of z next to which the eigenvalues are."""
    zeta = ONE * (1 + d)
    return np.abs(np.angle((zeta + TURN) / (1 + np.conj(TURN) * zeta)))


def clear(
    K: Bounded, L: Bounded, rims: tuple[np.ndarray, np.ndarray], inputs: int, arc: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Whether no eigenvalue of pencils is on an arc of the circle, for all numbers of discs; the
    eigenvalues in the middle.

    K, L: N - L and L in the middle, `(n, r, r)`; rims: both on circles of twice the size about the
    discs, `(n, points, r, r)`. inputs: the last columns, in which L is 0 and the pencil is N times a
    number that is not 0 for any d of the circle. arc: its ends (rad), `(n, 2)`. Without this number,
    and in vectors V of the eigenvalues and a basis W, it is diagonal in the middle, `d_i - d`, or 1
    for the inputs, and what is left is dominated by that.
    """
    N = K.value.shape[-1]
    last = np.arange(N) >= N - inputs
    dK, dL = (each.with_rounding(2 * N, of_complex=True) for each in (K, L))  # products of three
    P, Q = _parts(K.value, L.value, last)
    P_error, Q_error = _sizes_of_parts(dK, dL, last)
    with np.errstate(all="ignore"):
        delta, V, fine = _eigenvectors(P, Q, inputs)
        W = inverse(np.where(last, P, Q @ V))

        # What the vectors leave in the middle, and how much both parts change on the discs.
        d = np.concatenate([delta, np.zeros((len(delta), inputs))], -1)
        P_off = W @ P @ V - W @ Q @ V * d[:, None, :] - np.eye(N) * last
        Q_off = W @ Q @ V - np.eye(N) * ~last
        moved = [
            rim - middle[:, None] for rim, middle in zip(rims, (K.value, L.value), strict=True)
        ]
        on_circle = [np.concatenate([upper, upper.conj()], 1) for upper in moved]
        P_moved, Q_moved = _parts(*on_circle, last)

        def bound(moved: np.ndarray, off: np.ndarray, error: np.ndarray) -> np.ndarray:
            change = SAFE / 2 * np.abs(_between(W, moved, V, inputs)).max(1)
            return change + np.abs(off) + np.abs(W) @ error @ np.abs(V)

        room = np.where(last, 1.0, off_arc(d, arc))
        size = np.where(last, 2.0, np.abs(d) + room)  # of d where it is nearest
        H = bound(P_moved, P_off, P_error) + size[:, :, None] * bound(Q_moved, Q_off, Q_error)
    return fine & dominated(H, room), delta


def _parts(K: np.ndarray, L: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P and Q of the pencil `P - d Q`, of K and L `(..., N, N)`; last: which columns are inputs."""
    back = -np.conj(TURN)
    unit = 1 - np.conj(TURN)
    return np.where(last, K, RATE * K), ~last * (unit * L + back * K)


def _sizes_of_parts(
    K: np.ndarray, L: np.ndarray, last: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The most that entries of P and Q are, of K and L with entries of these sizes."""
    back = abs(TURN)
    unit = abs(1 - TURN)
    return np.where(last, K, abs(RATE) * K), ~last * (unit * L + back * K)


def _eigenvectors(
    P: np.ndarray, Q: np.ndarray, inputs: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The eigenvalues `(n, r)` and vectors `(n, N, N)` of pencils `P - d Q`, and whether they are finite:
    the inputs u, of which Q has nothing, follow from the states x by the last rows."""
    n = P.shape[-1] - inputs
    from_u = inverse(P[:, n:, n:])
    S = P[:, :n, :n] - P[:, :n, n:] @ from_u @ P[:, n:, :n]
    T = Q[:, :n, :n] - P[:, :n, n:] @ from_u @ Q[:, n:, :n]
    S = inverse(T) @ S
    fine = np.isfinite(S).all((-1, -2))
    S, units = balance(np.where(fine[:, None, None], S, 0.0), thorough=True)
    delta, V = _vectors(S)
    V = units[:, :, None] * V
    U = -from_u @ (P[:, n:, :n] @ V - Q[:, n:, :n] @ V * delta[:, None, :])
    of_states = np.concatenate([V, 0 * U.mT], -1)
    of_inputs = np.concatenate([U, 0 * from_u + np.eye(inputs)], -1)
    return delta, np.concatenate([of_states, of_inputs], -2), fine


def _between(W: np.ndarray, parts: np.ndarray, V: np.ndarray, inputs: int) -> np.ndarray:
    """`W part V` of parts `(n, points, r, r)`, of whose three rows of blocks most numbers change
    few rows or columns."""
    N = V.shape[-1]
    n = (N - inputs) // 2
    total = 0.0
    for block in (slice(n), slice(n, 2 * n), slice(2 * n, N)):
        nonzero = np.any(parts[..., block, :] != 0, (0, 1))
        rows = np.arange(N)[block][nonzero.any(1)]
        columns = np.flatnonzero(nonzero.any(0))
        left = np.ascontiguousarray(W[:, None][..., rows])
        middle = np.ascontiguousarray(parts[..., rows[:, None], columns])
        right = np.ascontiguousarray(V[:, None, columns])
        if rows.size <= columns.size:
            total = total + left @ (middle @ right)
        else:
            total = total + (left @ middle) @ right
    return total


def dominated(F: np.ndarray, room: np.ndarray) -> np.ndarray:
    """Whether diagonals of these sizes dominate matrices whose entries are at most F."""
    with np.errstate(all="ignore"):
        H = F / room[:, :, None]
        fine = np.isfinite(H).all((-1, -2))
        H, _ = balance(np.where(fine[:, None, None], H, 0.0), thorough=True)
        N = H.shape[-1]
        weights = solve(np.eye(N) * (1 + DOMINANT_BY) - H, np.ones((len(H), N, 1)))
        fine &= (weights > 0).all((1, 2))
        return fine & (H @ weights < weights * (1 - DOMINANT_BY / 2)).all((1, 2))


def _vectors(S: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues and eigenvectors of matrices; of several next to z = 0 or infinity, which may
    have too few, a Schur basis."""
    from scipy.linalg import schur

    delta, V = np.linalg.eig(S)
    delta = delta.astype(complex)
    V = V.astype(complex)
    for middle in (-TURN, -1 / np.conj(TURN)):
        place = middle * (1 - np.conj(TURN)) / (1 - TURN) - 1
        near = np.abs(delta - place) <= SMALL_EIGENVALUES

        def is_near(d: complex, place: complex = place) -> bool:
            return abs(d - place) <= SMALL_EIGENVALUES

        for at in np.flatnonzero(near.sum(-1) > 1):
            T, basis, count = schur(S[at], output="complex", sort=is_near)
            if count == near[at].sum():
                delta[at, near[at]] = np.diagonal(T)[:count]
                V[at][:, near[at]] = basis[:, :count]
    return delta, V
