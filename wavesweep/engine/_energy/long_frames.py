"""The H-infinity norm of a loop over a frame of many ticks: found at a few angles, and proved by stored energy.

No matrix of all inputs and outputs of a frame is decomposed. A lower bound is the gain of one input (`largest_gains`); an upper
one is a level g for which the ticks k = 0 .. M - 1 have matrices X_k, `X_M = X_0`, with

    [X_k - A'X_{k+1}A - C'C   -A'X_{k+1}B - C'D; .   g^2 - D'D - B'X_{k+1}B]   positive definite,

A, B, C, D those of the tick: then `x'X_k x` never grows by more than `g^2 |u|^2 - |y|^2`, so the output of a stable loop has no
more than g^2 times the energy of its input (the bounded real lemma; for periodic loops S. Bittanti, P. Colaneri, Periodic
Systems, 2009). No frequency is looked at.
"""

from typing import NamedTuple

import numpy as np

from wavesweep.engine._energy.hinf import RAISES, START, angles, then, tick
from wavesweep.engine._energy.lifted_map import LiftedMap, TickMaps
from wavesweep.engine._monodromy.periodic import in_a_row
from wavesweep.engine._monodromy.unit_circle import on_circle, solve

LOOKS = (
    2,
    3,
    4,
    6,
    9,
    13,
    19,
    28,
    40,
    60,
)  # steps of the iteration for a largest gain, after which it is computed
SETTLED = (
    1e-13  # relative, by which the last steps of it change the largest of all gains at the most
)
DOUBLINGS = 60  # of the number of frames; the balance is that of all future ones after some 25
EPS = np.finfo(float).eps
ASKED = 4.0  # times what rounding may cost in each tick, which the stored energy has to make up for
ROUNDED, RETURNED = (
    0.25,
    64.0,
)  # of these, roundings of the stored energies, and what they miss in the end of where they began
TOGETHER = 2_000_000  # numbers of the points that are computed together


class Norm(NamedTuple):
    """Square of the largest gain, its angle (rad per frame), and whether no larger one can exist."""

    square: float
    theta: float
    certified: bool


def squared_norm_of_one(ticks: TickMaps, tolerance: float) -> Norm:
    """The norm of a single stable loop of many ticks; tolerance: relative, of the square.

    A level just above the largest gain so far is met at the unit-circle eigenvalues of its pencil, and the largest gain is
    between two of them (see `hinf_norm`); once none is larger, the level is proved.
    """
    ticks = ticks.in_even_units()
    lifted = ticks.lifted(measured=False)
    if not all(np.isfinite(matrix).all() for matrix in (lifted.E, lifted.T, lifted.O, lifted.G)):
        return Norm(np.nan, 0.0, certified=False)
    square, theta, candidates = 0.0, 0.0, START
    for _ in range(RAISES):
        gains = largest_gains(lifted, candidates) ** 2
        best = int(np.argmax(np.nan_to_num(gains)))
        if not gains[best] > square * (1 + tolerance):
            break
        square, theta = float(gains[best]), float(candidates[best])
        edges = angles(ticks.loss_pencil([0], np.array([square * (1 + tolerance)])))[0]
        edges = np.unique(np.append(edges[np.isfinite(edges)], [0.0, np.pi]))
        candidates = np.concatenate([[0.0, np.pi], (edges[1:] + edges[:-1]) / 2])
    return Norm(square, theta, certified=is_above(ticks, square * (1 + tolerance)))


def largest_gains(lifted: LiftedMap, theta) -> np.ndarray:
    """Return the largest singular value of the map of one loop at each angle, `(points,)`, or a little less.

    By bidiagonalisation (G. Golub, W. Kahan, SIAM J. Numer. Anal. 2, 1965), all angles together: every value on the way is that
    of an input.
    """
    T, O, G = lifted.T[0], lifted.O[0], lifted.G[0]
    most = max(1, TOGETHER // (2 * len(T) + len(O[0]) * G.shape[-1]))
    if theta.size > most:
        parts = np.array_split(theta, -(-theta.size // most))
        return np.concatenate([largest_gains(lifted, part) for part in parts])
    w = on_circle(theta)[:, None, None] * np.eye(lifted.E.shape[-1]) - lifted.E[0]
    inner = solve(w, np.broadcast_to(G, (theta.size, *G.shape)) + 0j)  # (points, n, inputs)
    inner_conj = inner.conj()
    right = np.cos(np.arange(1, G.shape[-1] + 1)) + np.zeros((theta.size, 1), complex)
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    left, beta, found = (
        np.zeros((theta.size, len(T)), complex),
        np.zeros((theta.size, 1)),
        np.zeros(theta.size),
    )
    diagonal, beside, steps = [], [], min(LOOKS[-1], *T.shape)
    with np.errstate(all="ignore"):
        for step in range(1, steps + 1):
            reached = _times(right, T.T) + _times((inner @ right[..., None])[..., 0], O.T)
            left = reached - beta * left
            alpha = np.linalg.norm(left, axis=-1, keepdims=True)
            left = np.where(alpha > 0, left / alpha, 0.0)
            back = _times(left, T) + (_times(left, O)[:, None] @ inner_conj)[:, 0]
            right = back - alpha * right
            diagonal.append(alpha[:, 0])
            if step in LOOKS or step == steps:
                before, found = (
                    found,
                    np.linalg.svd(_bidiagonal(diagonal, beside), compute_uv=False)[:, 0],
                )
                if found.max() - before.max() <= SETTLED * found.max():
                    break
            beta = np.linalg.norm(right, axis=-1, keepdims=True)
            beside.append(beta[:, 0])
            right = np.where(beta > 0, right / beta, 0.0)
    return found


def _times(vectors, matrix):
    """Return complex vectors `(points, k)` times a real matrix, without a complex copy of it."""
    product = np.concatenate([vectors.real, vectors.imag]) @ matrix
    return product[: len(vectors)] + 1j * product[len(vectors) :]


def _bidiagonal(diagonal, beside):
    """Upper bidiagonal matrices, `(points, steps, steps)`."""
    steps = len(diagonal)
    matrices = np.zeros((diagonal[0].size, steps, steps))
    index = np.arange(steps)
    matrices[:, index, index] = np.stack(diagonal, -1)
    if beside:
        matrices[:, index[:-1], index[1:]] = np.stack(beside, -1)
    return matrices


@np.errstate(all="ignore")
def is_above(ticks: TickMaps, square: float) -> bool:
    """Whether a level is proved to be above the norm of one stable loop; square: that of the level.

    The energies X_k are those that Riccati's equation gives if a little more is asked for in each tick than the lemma does: by
    what rounding may cost in each of its matrices.
    """
    maps = [tuple(matrix[0] for matrix in tick_map) for tick_map in ticks.maps]
    kinds = ticks.kind.tolist()
    maps.append(
        maps[kinds[-1]]
    )  # the last tick is a kind by itself, which leads back to the beginning
    kinds[-1] = len(maps) - 1
    nothing = [np.zeros(len(maps[0][0]))] * len(maps)
    stored = _over_frame(maps, kinds, square, nothing, _stored(maps, kinds, square, nothing))
    if not np.isfinite(stored).all():
        return False
    largest = np.abs(np.diagonal(stored, axis1=-2, axis2=-1)).max(0)
    largest[largest == 0] = 1.0
    units = [np.sqrt(np.append(largest, np.full(B.shape[-1], square))) for _, B, _, _ in maps]
    asked = []
    for kind, tick_map in enumerate(maps):
        at, n = np.array(kinds) == kind, len(largest)
        matrix, error = _of_lemma(tick_map, square, stored[:-1][at], stored[1:][at])
        rounded = RETURNED if kind == kinds[-1] else ROUNDED
        error[:, :n, :n] += rounded * EPS * np.abs(stored[:-1][at])
        in_rows = _row_sums(error, units[kind])
        # What is taken off the inputs' part costs the states as much as the inputs that they would choose.
        chosen = np.abs(solve(matrix[:, n:, n:], matrix[:, n:, :n]))
        of_inputs = np.swapaxes(chosen, -1, -2) @ (in_rows[:, n:, None] * chosen)
        asked.append(
            ASKED * (in_rows[:, :n] + _row_sums(of_inputs, units[kind][:n])).max(0, initial=0.0)
        )
    stored = _over_frame(maps, kinds, square, asked, _stored(maps, kinds, square, asked))
    stored[-1] = stored[0]
    for kind, tick_map in enumerate(maps):
        at = np.array(kinds) == kind
        if not _all_positive(
            *_of_lemma(tick_map, square, stored[:-1][at], stored[1:][at]), units[kind]
        ):
            return False
    return True


def _stored(maps, kinds, square, asked):
    """The energy that is stored at the beginning of a frame; asked: in each kind of tick, of each state squared."""
    elements = []
    for (E, B, C, D), more in zip(maps, asked, strict=True):
        costs = -C.T @ C - np.diag(more), -C.T @ D, square * np.eye(D.shape[-1]) - D.T @ D
        elements.append(tick(np.eye(len(E)) + E, B, *costs))
    frame = in_a_row(kinds, elements, then)
    for _ in range(DOUBLINGS):
        Q, frame = frame.Q, then(frame, frame)
        if not np.isfinite(frame.Q).all() or (np.abs(frame.Q - Q) <= EPS * np.abs(Q).max()).all():
            break
    return -frame.Q


def _over_frame(maps, kinds, square, asked, energy):
    """The energies before each tick and after the last one, `(ticks + 1, n, n)`; energy: after the last one."""
    stored = [energy]
    for kind in reversed(kinds):
        E, B, C, D = maps[kind]
        of_E, of_B = energy @ E, energy @ B
        cross = of_B + E.T @ of_B + C.T @ D
        spent = square * np.eye(B.shape[-1]) - D.T @ D - B.T @ of_B
        change = (
            of_E
            + of_E.T
            + E.T @ of_E
            + C.T @ C
            + np.diag(asked[kind])
            + cross @ solve(spent, cross.T)
        )
        energy = energy + (change + change.T) / 2
        stored.append(energy)
    return np.array(stored[::-1])


def _of_lemma(tick_map, square, before, after):
    """The matrices of the lemma in all ticks of a kind, and bounds on their errors; before, after: X_k and X_{k+1}."""
    E, B, C, D = tick_map
    n, m = B.shape
    shown = np.concatenate([C, D], -1)

    def terms(E, B, after, gained, given, shown):
        """Their terms, of which the sizes are those of the sizes of all."""
        of_E, of_B = after @ E, after @ B
        sums = np.zeros((len(after), n + m, n + m))
        sums[:, :n, :n] = gained + of_E + np.swapaxes(of_E, -1, -2) + E.T @ of_E
        sums[:, :n, n:] = of_B + E.T @ of_B
        sums[:, n:, :n] = np.swapaxes(sums[:, :n, n:], -1, -2)
        sums[:, n:, n:] = given + B.T @ of_B
        return sums + shown.T @ shown

    change, given = after - before, -square * np.eye(m)
    sizes = terms(np.abs(E), np.abs(B), np.abs(after), np.abs(change), np.abs(given), np.abs(shown))
    return -terms(E, B, after, change, given, shown), (2 * n + len(C) + 8) * EPS * sizes


def _row_sums(matrix, units):
    """Sums of rows in these units, which are on the diagonal of a diagonal matrix that bounds a symmetric one."""
    return (matrix / units).sum(-1) * units


@np.errstate(all="ignore")
def _all_positive(matrix, error, units) -> bool:
    """Whether symmetric matrices are positive definite for all errors of their entries.

    By Gershgorin's theorem, in these units, it is enough if they are so without the sums of their rows of errors on the
    diagonal. In units in which their diagonal is 1, Cholesky's decomposition shows that if N (N + 2) roundings less than its
    diagonal still has one (S. M. Rump, BIT 46, 2006, Theorem 2.3); as many again are left for the units and the subtraction.
    """
    N, at = matrix.shape[-1], np.arange(matrix.shape[-1])
    matrix = matrix.copy()
    matrix[:, at, at] -= _row_sums(error, units)
    scale = 1 / np.sqrt(matrix[:, at, at])
    if not np.isfinite(scale).all():
        return False
    matrix *= scale[:, :, None] * scale[:, None, :]
    matrix[:, at, at] -= N * (N + 8) * EPS
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
