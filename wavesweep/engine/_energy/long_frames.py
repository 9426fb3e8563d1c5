"""The H-infinity norm of a loop over a frame of many ticks: found at a few angles, and proved by
stored energy.

No matrix of all inputs and outputs of a frame is decomposed. A lower bound is the gain of one input
(`largest_gains`); an upper one is a level g for which the ticks k = 0 .. M - 1 have matrices X_k,
`X_M = X_0`, with

    [X_k - A'X_{k+1}A - C'C   -A'X_{k+1}B - C'D; .   g^2 - D'D - B'X_{k+1}B]   positive definite,

A, B, C, D those of the tick: then `x'X_k x` never grows by more than `g^2 |u|^2 - |y|^2`, so the
output of a stable loop has no more than g^2 times the energy of its input (the bounded real lemma;
for periodic loops S. Bittanti, P. Colaneri, Periodic Systems, 2009). No frequency is looked at.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._energy.hinf import RAISES, START, Element
from wavesweep.engine._energy.lifted_map import LiftedMap, TickMaps
from wavesweep.engine._monodromy.periodic import in_a_row
from wavesweep.engine._monodromy.unit_circle import on_circle, solve
from wavesweep.engine._response.gain import by_lanczos
from wavesweep.engine.doubles import BY_TWO, EPS, LEAST_NORMAL

LOOSER = 100.0  # times the tolerance: a level above that is proved where a near one is not
LEAST_ENERGY = 1e-12  # of the largest: that of a state in which nothing is stored, for its unit


class Norm(NamedTuple):
    """Square of the largest gain, its angle (rad per frame), and whether no larger one can
    exist."""

    square: float
    theta: float
    certified: bool


def squared_norm_of_one(ticks: TickMaps, tolerance: float) -> Norm:
    """The norm of a single stable loop of many ticks; tolerance: relative, of the square.

    A level just above the largest gain so far is met at the unit-circle eigenvalues of its pencil,
    and the largest gain is between two of them (see `hinf_norm`); once none is larger, the level is
    proved.

    Accuracy: of the square, the tolerance, or LOOSER times as much next to a limit of stability:
    what rounding costs in each tick is paid for as long as the loop remembers.
    """
    ticks = ticks.in_even_units()
    lifted = ticks.lifted(measured=False)
    if not all(np.isfinite(matrix).all() for matrix in (lifted.E, lifted.T, lifted.O, lifted.G)):
        return Norm(np.nan, 0.0, certified=False)
    square = 0.0
    theta = 0.0
    candidates = START
    for _ in range(RAISES):
        gains = largest_gains(lifted, candidates) ** 2
        best = int(np.argmax(np.nan_to_num(gains)))
        if not gains[best] > square * (1 + tolerance):
            break
        square = float(gains[best])
        theta = float(candidates[best])
        edges = ticks.loss_pencil([0], np.array([square * (1 + tolerance)])).angles()[0]
        edges = np.unique(np.append(edges[np.isfinite(edges)], [0.0, np.pi]))
        candidates = np.concatenate([[0.0, np.pi], (edges[1:] + edges[:-1]) / 2])
    certified = is_above(ticks, square * (1 + tolerance))
    if not certified:
        certified = is_above(ticks, square * (1 + tolerance * LOOSER))
    return Norm(square, theta, certified)


def largest_gains(lifted: LiftedMap, theta: np.ndarray) -> np.ndarray:
    """Return the largest singular value of the map of one loop at each angle, `(points,)`, or a
    little less.

    The map is `T + O (w - E)^-1 G` at `w = exp(j theta) - 1`. Lanczos' method asks for what it makes
    of rows v, `v L^T`, and back, `v conj(L)`, without the map itself.
    """
    T = lifted.T[0]
    O = lifted.O[0]
    G = lifted.G[0]
    # Numbers of the points that are computed together.
    most_points = max(1, 2_000_000 // (2 * len(T) + len(O[0]) * G.shape[-1]))
    if theta.size > most_points:
        parts = np.array_split(theta, -(-theta.size // most_points))
        return np.concatenate([largest_gains(lifted, part) for part in parts])
    w = on_circle(theta)[:, None, None] * np.eye(lifted.E.shape[-1]) - lifted.E[0]
    inner = solve(w, np.broadcast_to(G, (theta.size, *G.shape)) + 0j)  # (points, n, inputs)
    inner_conj = inner.conj()

    def apply(v: np.ndarray, back: bool) -> np.ndarray:
        if back:
            return _times(v, T) + (_times(v, O)[:, None] @ inner_conj)[:, 0]
        return _times(v, T.T) + _times((inner @ v[..., None])[..., 0], O.T)

    with np.errstate(all="ignore"):
        return by_lanczos(apply, theta.size, len(T))


def _times(vectors: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """Return complex vectors `(points, k)` times a real matrix, without a complex copy of it."""
    product = np.concatenate([vectors.real, vectors.imag]) @ matrix
    return product[: len(vectors)] + 1j * product[len(vectors) :]


@np.errstate(all="ignore")
def is_above(ticks: TickMaps, square: float) -> bool:
    """Whether a level is proved to be above the norm of one stable loop; square: that of the level.

    The energies X_k are those that Riccati's equation gives if a little more is asked for in each
    tick than the lemma does: by what rounding may cost in each of its matrices. Only the check of
    these matrices has to be right.
    """
    maps = [tuple(matrix[0] for matrix in tick_map) for tick_map in ticks.maps]
    kinds = ticks.kind.tolist()
    # The last tick is a kind by itself, which leads back to the beginning.
    maps.append(maps[kinds[-1]])
    kinds[-1] = len(maps) - 1
    ticks_of = [np.flatnonzero(np.array(kinds) == kind) for kind in range(len(maps))]
    n = len(maps[0][0])
    nothing = [np.zeros(n)] * len(maps)
    stored = _energies(maps, kinds, square, nothing)
    if not np.isfinite(stored.high).all():
        return False
    largest = _largest(stored)
    units = [np.sqrt(np.append(largest, np.full(B.shape[-1], square))) for _, B, _, _ in maps]
    weights = []
    for kind, tick_map in enumerate(maps):
        matrix, error = _of_lemma(tick_map, square, stored, ticks_of[kind])
        lost = _lost(matrix, error, units[kind])
        # What is taken off the inputs' part costs the states as much as the inputs they would
        # choose.
        chosen = np.abs(solve(matrix[:, n:, n:], matrix[:, n:, :n]))
        of_inputs = np.swapaxes(chosen, -1, -2) @ (lost[:, n:, None] * chosen)
        of_states = lost[:, :n] + _row_sums(of_inputs, units[kind][:n])
        weights.append(1.25 * of_states.max(0, initial=0.0))  # an energy loses less than it may
    # Since rounding is not the same again.
    weights[-1] += n * 4.0 * max(_unreturned(stored), EPS) * largest
    stored = _energies(maps, kinds, square, weights)
    for part in stored:
        part[-1] = part[0]
    return all(
        _all_positive(*_of_lemma(tick_map, square, stored, ticks_of[kind]), units[kind])
        for kind, tick_map in enumerate(maps)
    )


class Energies(NamedTuple):
    """Energies before each tick and after the last one, `high + low`, each `(ticks + 1, n, n)`.

    A tick changes them by little: their difference needs more digits than one number has.
    """

    high: np.ndarray
    low: np.ndarray


def _energies(
    maps: list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]],
    kinds: list[int],
    square: float,
    weights: list[np.ndarray],
) -> Energies:
    """The energies of Riccati's equation; weights: in each kind of tick, of each state squared."""
    balances = []
    elements = []
    for (E, B, C, D), more in zip(maps, weights, strict=True):
        costs = -C.T @ C - np.diag(more), -C.T @ D, square * np.eye(D.shape[-1]) - D.T @ D
        balances.append((E, B, *costs))
        elements.append(Element.of(np.eye(len(E)) + E, B, *costs))
    frame = in_a_row(kinds, elements, Element.then)
    for _ in range(BY_TWO):
        Q = frame.Q
        frame = frame.then(frame)
        if not np.isfinite(frame.Q).all() or (np.abs(frame.Q - Q) <= EPS * np.abs(Q).max()).all():
            break
    high = -frame.Q
    low = np.zeros_like(frame.Q)
    missed = np.inf
    for _ in range(4):  # steps to energies that return after a frame; it takes one or two
        stored, closed = _over_frame(balances, kinds, high, low)
        missed_before = missed
        missed = _unreturned(stored)
        if not EPS < missed < missed_before / 2:
            break
        once = stored.high[0] - high + (stored.low[0] - low)
        high, low = _sum_and_rest(high, low + _of_all_frames(once, closed))
    return stored


def _unreturned(stored: Energies) -> float:
    """By how much the energy after the last tick misses the first, of the largest of each state."""
    size = np.sqrt(_largest(stored))
    return float(
        np.abs((stored.high[0] - stored.high[-1]) / (size[:, None] * size)).max(initial=0.0)
    )


def _largest(stored: Energies) -> np.ndarray:
    """Return the largest energy of each state by itself, `(n,)`."""
    largest = np.abs(np.diagonal(stored.high, axis1=-2, axis2=-1)).max(0)
    return np.maximum(largest, LEAST_ENERGY * largest.max(initial=LEAST_NORMAL))


def _over_frame(
    balances: list[tuple[Any, ...]], kinds: list[int], high: np.ndarray, low: np.ndarray
) -> tuple[Energies, np.ndarray]:
    """The energies back from those after the last tick, and the frame with the inputs they choose.

    balances: of each kind of tick E and B, and the costs of its states, of both and of its inputs.
    """
    stored = [(high, low)]
    closed = np.eye(len(high))
    for kind in reversed(kinds):
        E, B, of_states, of_both, of_inputs = balances[kind]
        of_E = high @ E
        of_B = high @ B
        cross = of_B + E.T @ of_B - of_both
        chosen = solve(of_inputs - B.T @ of_B, cross.T)
        change = of_E + of_E.T + E.T @ of_E - of_states + cross @ chosen
        high, low = _sum_and_rest(high, low + (change + change.T) / 2)
        stored.append((high, low))
        closed = closed + closed @ (E + B @ chosen)
    return Energies(*(np.array(part[::-1]) for part in zip(*stored, strict=True))), closed


def _of_all_frames(once: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return `sum over k of (frame')^k once frame^k`, twice as many terms in each step."""
    total = once
    for _ in range(BY_TWO):
        added = frame.T @ total @ frame
        total = total + added
        frame = frame @ frame
        if not np.isfinite(total).all() or (np.abs(added) <= EPS * np.abs(total).max()).all():
            break
    return (total + total.T) / 2


def _sum_and_rest(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rounded sum of two arrays, and what rounding left of it (D. Knuth's exact sum)."""
    total = a + b
    of_b = total - a
    return total, (a - (total - of_b)) + (b - of_b)


def _of_lemma(
    tick_map: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    square: float,
    stored: Energies,
    ticks: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The matrices of the lemma in ticks of one kind, and bounds on their errors.

    A product of n terms is known to n half roundings of its sizes, and two products and their sum
    to `2 n + 5`; that the low parts are left out of the products costs one more. The last two are
    for what rounding may do to this bound.
    """
    E, B, C, D = tick_map
    n, m = B.shape
    shown = np.concatenate([C, D], -1)
    after = stored.high[ticks + 1]
    high = after - stored.high[ticks]
    low = stored.low[ticks + 1] - stored.low[ticks]
    given = square * np.eye(m)
    gained = np.abs(high) + np.abs(low)
    sizes = _gain_of_energy(np.abs(E), np.abs(B), np.abs(after), gained, given, np.abs(shown))
    error = (2 * n + len(C) + 8) * EPS / 2 * sizes
    return -_gain_of_energy(E, B, after, high + low, -given, shown), error


def _gain_of_energy(
    E: np.ndarray,
    B: np.ndarray,
    P: np.ndarray,
    change: np.ndarray,
    given: np.ndarray,
    shown: np.ndarray,
) -> np.ndarray:
    """`[I + E, B]' P [I + E, B] - diag(P_0, 0) + diag(0, given) + shown' shown` of ticks, with `P -
    P_0 = change`; of sizes of all it is the size of its terms."""
    n, m = B.shape
    of_E = P @ E
    of_B = P @ B
    sums = np.zeros((len(P), n + m, n + m))
    sums[:, :n, :n] = change + of_E + np.swapaxes(of_E, -1, -2) + E.T @ of_E
    sums[:, :n, n:] = of_B + E.T @ of_B
    sums[:, n:, :n] = np.swapaxes(sums[:, :n, n:], -1, -2)
    sums[:, n:, n:] = given + B.T @ of_B
    return sums + shown.T @ shown


def _row_sums(matrix: np.ndarray, units: np.ndarray) -> np.ndarray:
    """Sums of rows in these units, which are on the diagonal of a diagonal matrix that bounds a
    symmetric one."""
    return (matrix / units).sum(-1) * units


def _lost(matrix: np.ndarray, error: np.ndarray, units: np.ndarray) -> np.ndarray:
    """What is taken off the diagonals of symmetric matrices before they are decomposed, `(ticks,
    N)`.

    By Gershgorin's theorem, in these units, the sums of their rows of errors are enough for all
    errors. In units in which their diagonal is 1, Cholesky's decomposition shows that they are
    positive definite if N (N + 2) roundings less than that still has one (S. M. Rump, BIT 46,
    2006, Theorem 2.3); as many again are left for the units and the subtraction.
    """
    N = matrix.shape[-1]
    return _row_sums(error, units) + N * (N + 8) * EPS * np.diagonal(matrix, axis1=-2, axis2=-1)


@np.errstate(all="ignore")
def _all_positive(matrix: np.ndarray, error: np.ndarray, units: np.ndarray) -> bool:
    """Whether symmetric matrices are positive definite for all errors of their entries."""
    index = np.arange(matrix.shape[-1])
    lost = _lost(matrix, error, units)
    matrix = matrix.copy()
    matrix[:, index, index] -= lost
    scale = 1 / np.sqrt(matrix[:, index, index])
    if not np.isfinite(scale).all():
        return False
    matrix *= scale[:, :, None] * scale[:, None, :]
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
