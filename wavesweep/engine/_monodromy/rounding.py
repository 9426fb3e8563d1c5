"""The rounding of the terms of every tick, and the digits of a frame that it takes.

If terms cancel within a tick, as the impedance of a wave line does that passes all on at once, the
entries that are left have lost digits, and show no sign of it.
"""

from typing import Any

import numpy as np

from wavesweep.engine._monodromy.batches import in_parts
from wavesweep.engine._monodromy.bounded import Bounded
from wavesweep.engine._monodromy.periodic import GROWING, Change, growth_of, in_a_row, size_of
from wavesweep.engine._monodromy.unit_circle import inverse

TELLING = 1e-3  # of a spectral radius, or of 1, how far it may be off
THOROUGH_SWEEPS = 12  # where sizes are far apart, or units are what the answer hangs on
UNEVEN = 1e6  # size of an entry, from which on the states get other units
HELPFUL = 1e-3  # of the largest entry, below which it has to be in these
EIGENVALUES_EXAMINED = 4  # number of eigenvalues that are examined


def both(
    first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Return `E` of one run of ticks after the other.

    Each is a pair of `(I + E)^ticks - I` and a bound on the error of its entries.
    """
    return Bounded(*first).then(Bounded(*second))


def measured_frame(kind: np.ndarray, changes: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return the frame less identity and its growth, `(...)` (see `growth_of`).

    kind: of each tick. changes: per kind, the matrix less identity, `(..., n, n)`. Accuracy: growth
    is a measure of the digits that are lost, and not a bound. It is given as 1 where the products
    of the largest entries in many loops of a batch are no larger than GROWING, which is quick to
    see.
    """
    kinds = kind.tolist()
    batch = np.broadcast_shapes(*(change.shape[:-2] for change in changes))
    n = changes[0].shape[-1]
    growth = np.ones(batch)
    of_batch = []
    for change in changes:
        alike = change.ndim == 2
        of_batch.append(change if alike else np.broadcast_to(change, (*batch, n, n)))

    def frame(index: Any) -> np.ndarray:
        ticks = [change if change.ndim == 2 else change[index] for change in of_batch]
        measured = [(Change.of(tick), _largest(tick), 1.0) for tick in ticks]
        E, _, largest = in_a_row(kinds, measured, joined)
        if not largest <= GROWING:
            growth[index] = growth_of(kind, ticks)
        return E.E

    def joined(
        first: tuple[Change, np.ndarray, float], second: tuple[Change, np.ndarray, float]
    ) -> tuple[Change, np.ndarray, float]:
        P, size_P, largest_P = first
        Q, size_Q, largest_Q = second
        both = P.then(Q)
        terms = np.nan_to_num(size_of(size_Q @ size_P), nan=np.inf)
        return both, _largest(both.E), max(largest_P, largest_Q, terms)

    with np.errstate(all="ignore"):  # of a frame that overflows
        E = in_parts(frame, batch, n, float)
    return E, growth


def _largest(E: np.ndarray) -> np.ndarray:
    """The largest sizes of the entries of I + E in a batch."""
    return np.abs(E + np.eye(E.shape[-1])).max(tuple(range(E.ndim - 2)))


@np.errstate(all="ignore")
def balance(E: np.ndarray, thorough: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Return E in units of the states that give its rows and columns similar sizes, and these units
    (Osborne 1960).

    The units are powers of two. E: `(matrices, n, n)`. In units u `(matrices, n)` the entry (i, j)
    of any matrix is multiplied by u_j/u_i. thorough: with THOROUGH_SWEEPS over all states.
    """
    size = np.abs(E)
    units = np.ones(E.shape[:-1])
    index = np.arange(E.shape[-1])
    size[:, index, index] = 0
    for _ in range(THOROUGH_SWEEPS if thorough else 3):  # sweeps over the states
        changed = False
        for k in index:
            row = np.add.reduce(size[:, k, :], -1)
            column = np.add.reduce(size[:, :, k], -1)
            factor = np.exp2(np.round(np.log2(row / column) / 2))
            factor = np.where(np.isfinite(factor) & (factor > 0), factor, 1.0)[:, None]
            if (factor == 1).all():
                continue
            size[:, :, k] *= factor
            size[:, k, :] /= factor
            units[:, k] *= factor[:, 0]
            changed = True
        if not changed:
            break
    return E * (units[:, None, :] / units[:, :, None]), units


def uneven_units(sizes: np.ndarray) -> np.ndarray:
    """Return units of the states, `(matrices, n)`, in which no entry is large; 1 if they are not
    UNEVEN, or no units help.

    sizes: of the entries, `(matrices, n, n)`. States of a transfer function are derivatives of each
    other, whose sizes differ by powers of its poles; entries of a frame that grows are large in any
    units.
    """
    units = np.ones(sizes.shape[:-1])
    largest = np.abs(sizes).max((1, 2), initial=0.0)
    uneven = np.flatnonzero(largest > UNEVEN)
    if uneven.size:
        better, balanced = balance(sizes[uneven], thorough=True)
        helps = np.abs(better).max((1, 2)) < HELPFUL * largest[uneven]
        units[uneven[helps]] = balanced[helps]
    return units


def may_have(E: np.ndarray, dE: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return whether a matrix within dE of `I + E` may have one of these eigenvalues,
    `(matrices,)`.

    E, dE: `(matrices, n, n)`; points: eigenvalues less 1, `(matrices, points)`. None has z if the
    spectral radius of `|(z - 1 - E)^-1| dE` is less than 1 (S. M. Rump, Linear Algebra Appl. 278,
    1998), which no units of the states change. It is at most the largest growth of a component of a
    positive vector (L. Collatz, Math. Z. 48, 1942), which settles most.
    """
    with np.errstate(all="ignore"):
        resolvent = inverse(points[..., None, None] * np.eye(E.shape[-1]) - E[:, None])
        reach = np.abs(resolvent) @ dE[:, None]
        finite = np.isfinite(reach).all((-1, -2))
        vector = reach.sum(-1, keepdims=True)
        grows = (reach @ vector >= vector) & (vector > 0)  # a row of zeros has no part in it
        clear = finite & ~grows.any((-1, -2))
        open_ = np.nonzero(finite & ~clear)
        spectral_radius = np.abs(np.linalg.eigvals(reach[open_])).max(-1, initial=0.0)
        clear[open_] = spectral_radius < 1
    return ~clear.all(-1)


def at_angles_of(delta: np.ndarray, radius: np.ndarray | float, rank: np.ndarray) -> np.ndarray:
    """Return points less 1 on circles of a radius, `(matrices, EIGENVALUES_EXAMINED)`, at the
    angles of some eigenvalues `1 + delta`.

    rank: of each eigenvalue, the least of which are chosen, one of a conjugate pair; radius:
    `(matrices,)` or a number.
    """
    one_of_a_pair = np.where(delta.imag < 0, np.inf, rank)
    order = np.argsort(one_of_a_pair, axis=-1)
    chosen = np.take_along_axis(delta, order[:, :EIGENVALUES_EXAMINED], axis=-1)
    z = 1 + chosen
    size = np.where(z == 0, 1.0, np.abs(z))
    ray = np.where(z == 0, 1.0, z / size)
    # Along the ray from 0: a point next to 1 keeps the digits of its distance from the eigenvalue.
    return chosen + ray * (np.reshape(radius, (-1, 1)) - np.abs(z))


def radius_hidden(E: np.ndarray, dE: np.ndarray) -> np.ndarray:
    """Return whether the spectral radius of `I + E` may be larger by TELLING, or on the other
    side of 1, within dE of E."""
    shape = E.shape[:-2]
    n = E.shape[-1]
    dE = np.broadcast_to(dE, E.shape).reshape(-1, n, n)
    E = E.reshape(-1, n, n)
    finite = np.isfinite(E).all((-1, -2)) & np.isfinite(dE).all((-1, -2))
    E = np.where(finite[:, None, None], E, 0.0)
    dE = np.where(finite[:, None, None], dE, 0.0)
    delta = np.linalg.eigvals(E).astype(complex)
    size = np.abs(1 + delta)
    radius = size.max(-1, initial=0.0)
    larger = radius + TELLING * np.maximum(radius, 1)
    further = at_angles_of(delta, larger, -size)
    on_unit_circle = at_angles_of(delta, 1.0, -size)
    points = np.concatenate([further, on_unit_circle], axis=-1)
    hidden = finite & may_have(E, dE, points)
    return hidden.reshape(shape)
