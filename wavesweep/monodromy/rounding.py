"""The rounding of the terms of every tick, and the digits of a frame that it takes.

If terms cancel within a tick, as the impedance of a wave line does that passes all on at once, the entries that are left
have lost digits, and show no sign of it.
"""

from functools import partial
from math import prod

import numpy as np

from wavesweep.monodromy.batches import in_parts
from wavesweep.monodromy.circle import inverse
from wavesweep.monodromy.periodic import GROWING, Change, Ticks, growth_of, in_a_row, size_of, then

ROUNDING = 2 * np.finfo(float).eps  # of a short sum of products, relative to the sum of their sizes
ENTRIES = 4 * np.finfo(float).eps  # of the terms of the entries of a block, relative
HIDDEN = 16.0  # times an entry: size of its terms, from which on its digits may be missed
TELLING = 1e-3  # of a spectral radius, or of 1, how far it may be off
CANCELLED = 1e3  # times the entries of a row of a stretch: sizes of terms in it, from which on their effect is looked for
SURELY = 64.0  # times the same of several loops, up to which it is not that of each
LITTLE = 1e-3  # of an entry in units that give all ticks similar sizes: its digits do not matter
BALANCING = 3  # sweeps
SWEEPS = 12  # the same, where units have to go round long ways
NEAREST = 4  # number of eigenvalues that are examined


def both(first, second):
    """Return `E` of one run of ticks after the other.

    Each is a pair of `(I + E)^ticks - I` and a bound on the error of its entries.
    """
    (a, _), (b, _) = first, second
    return a + b + b @ a, _error(first, second)


def _error(first, second):
    (a, da), (b, db) = first, second
    eye, one, two = np.eye(a.shape[-1]), np.abs(a), np.abs(b)
    return np.abs(eye + b) @ da + db @ np.abs(eye + a) + ROUNDING * (one + two + two @ one)


def measured_frame(
    kind, changes, links=None, ramp: bool = False, beyond: float = CANCELLED
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the frame less identity, its growth (see `growth_of`), and how far terms of its stretches of ticks cancel.

    kind: of each tick. changes: per kind, the matrix less identity, `(..., n, n)`, or with columns of inputs that are held over
    a frame behind it, `(..., n, n + inputs)`. links: sizes of other entries that close a loop of the states and the first
    input, `(n + 1, n + 1)`, if it is open. ramp: whether the last input becomes one that grows by the one before it with every
    tick, from 0. beyond: from which on the measure of cancellation is that of each loop.

    Of stretches P and Q each entry of `|Q| |P|` is compared to the largest entries of its row and column of `Q P`, in units of
    the states that give the rows and columns of all ticks together similar sizes, and in a closed loop to LITTLE, below which
    no digits matter to an eigenvalue beside the circle. So it shows by way of how ever many states terms cancel.
    Accuracy: both are measures of the digits that are lost, `(...)`, and not bounds. Growth is given as 1 where the products of
    the largest entries in many loops of a batch are no larger than GROWING.
    """
    kinds, batch = kind.tolist(), np.broadcast_shapes(*(each.shape[:-2] for each in changes))
    n, growth, measure = changes[0].shape[-2], np.ones(batch), np.zeros(batch)
    little, links = (LITTLE, np.zeros((n, n))) if links is None else (0.0, links)
    changes, size = [_spread(each, batch) for each in changes], len(links)
    scale = _scale(links + sum(_square(_largest(each), size) for each in changes))

    def frame(part):
        some = [each[part] if each.ndim > 2 else each for each in changes]
        ticks = [(Change.of(each), 1, _extremes(each, scale)[0], 1.0, 0.0) for each in some]
        E, _, _, grown, most = in_a_row(kinds, ticks, within)
        if not grown <= GROWING:
            growth[part] = growth_of(kind, [each[..., :n] for each in some])
        if not most * SURELY <= beyond:
            own = _scale(links + sum(np.abs(_square(each, size)) for each in some))
            stretches = [(each, np.abs(np.eye(size) + each) * own, 0.0) for each in (_square(each, size) for each in some)]
            most = in_a_row(kinds, stretches, partial(_joined_in_units, own, little))[2]
        measure[part] = most
        return E.E

    def within(first, second):
        (P, count, one, *known), (Q, more, other, *others) = first, second
        both = P.then(Q)
        if ramp:
            both.E[..., -1] += count * Q.E[..., -2]
        (high, low), terms = _extremes(both.E, scale), other @ one
        lost = _cancelled(terms, low.max(-1, initial=0.0), low.max(-2, initial=0.0), little)
        # The size of a product is the same in all units.
        found = np.nan_to_num(size_of(terms), nan=np.inf), lost
        return both, count + more, high, *map(max, known, others, found)

    with np.errstate(all="ignore"):  # of a frame that overflows
        return in_parts(frame, batch, n, float), growth, measure


def _joined_in_units(scale, little, first, second):
    (P, one, most), (Q, other, least) = first, second
    both = then(P, Q)
    size = np.abs(np.eye(both.shape[-1]) + both) * scale
    lost = _cancelled(other @ one, size.max(-1, initial=0.0), size.max(-2, initial=0.0), little)
    return both, size, np.maximum(np.maximum(most, least), lost)


def _square(E, size):
    """The changes of the states, and of the first input, which keeps its value, if size is larger by 1."""
    n = E.shape[-2]
    if n == size:
        return E[..., :n]
    return np.concatenate([E[..., :size], np.zeros((*E.shape[:-2], 1, size))], axis=-2)


def _extremes(E, scale):
    """The largest and the smallest sizes of entries in a batch."""
    rows, columns = E.shape[-2], len(scale)
    found = np.zeros((2, columns, columns))
    found[:, rows:, rows:] = 1.0
    size, over = np.abs(E[..., :columns] + np.eye(rows, columns)), tuple(range(E.ndim - 2))
    found[:, :rows] = size.max(over), size.min(over)
    return found * scale


def _scale(whole):
    """The factors of entries in units that give the rows and columns of matrices similar sizes."""
    n = whole.shape[-1]
    units = balance(whole.reshape(prod(whole.shape[:-2]), n, n), SWEEPS)[1].reshape(whole.shape[:-1])
    return units[..., None, :] / units[..., :, None]


def _largest(E):
    return np.abs(E).max(tuple(range(E.ndim - 2)))


def _cancelled(terms, row, column, little):
    """The largest size of terms of an entry beside the largest ones in its row and column, `(...)`; infinite after overflow."""
    left = np.maximum(np.minimum(row[..., :, None], column[..., None, :]), little)
    found = np.where(terms == 0, 0.0, terms / left).max((-1, -2), initial=0.0)
    return np.where(np.isnan(found), np.inf, found)


@np.errstate(all="ignore")
def balance(E, sweeps: int = BALANCING):
    """Return E in units of the states that give its rows and columns similar sizes, and these units (Osborne 1960).

    The units are powers of two. E: `(matrices, n, n)`. In units u `(matrices, n)` the entry (i, j) of any matrix is multiplied
    by u_j/u_i. sweeps: number of passes over all states.
    """
    size, units = np.abs(E), np.ones(E.shape[:-1])
    index = np.arange(E.shape[-1])
    size[:, index, index] = 0
    for _ in range(sweeps):
        changed = False
        for k in index:
            row, column = size[:, k, :].sum(-1), size[:, :, k].sum(-1)
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


def _spread(part, batch):
    """The matrices over the whole batch, unless all loops have the same."""
    return np.broadcast_to(part, (*batch, *part.shape[-2:])) if part.ndim > 2 else part


def hides(changes, sizes) -> np.ndarray:
    """Return in which loops of a batch the terms of some entry of a tick nearly cancel, `(...)`."""
    with np.errstate(all="ignore"):
        found = [(size > HIDDEN * np.abs(E)).any((-1, -2)) for E, size in zip(changes, sizes, strict=True)]
    return np.logical_or.reduce(np.broadcast_arrays(*found))


def hidden_in(ticks: Ticks, growth=1.0) -> np.ndarray:
    """`hides` for all entries of ticks with the sizes of their terms, or if their stretches grow (see `growth_of`)."""
    found = [
        hides(*zip(*((getattr(each, part), each.terms[at]) for each in ticks.maps), strict=True))
        for at, part in enumerate("EBCD")
    ]
    return np.logical_or.reduce(np.broadcast_arrays(*found, np.asarray(growth) > GROWING))


def may_have(E, dE, points) -> np.ndarray:
    """Return whether a matrix within dE of `I + E` may have one of these eigenvalues, `(matrices,)`.

    E, dE: `(matrices, n, n)`; points: eigenvalues less 1, `(matrices, points)`. None has z if the spectral radius of
    `|(z - 1 - E)^-1| dE` is less than 1 (S. M. Rump, Linear Algebra Appl. 278, 1998), which no units of the states change.
    It is at most the largest growth of a component of a positive vector (L. Collatz, Math. Z. 48, 1942), which settles most.
    """
    with np.errstate(all="ignore"):
        reach = np.abs(inverse(points[..., None, None] * np.eye(E.shape[-1]) - E[:, None])) @ dE[:, None]
        known, vector = np.isfinite(reach).all((-1, -2)), reach.sum(-1, keepdims=True)
        clear = known & ~((reach @ vector >= vector) & (vector > 0)).any((-1, -2))  # a row of zeros has no part in it
        open_ = np.nonzero(known & ~clear)
        clear[open_] = np.abs(np.linalg.eigvals(reach[open_])).max(-1, initial=0.0) < 1
    return ~clear.all(-1)


def at_angles_of(delta, radius, rank) -> np.ndarray:
    """Return points less 1 on circles of a radius, `(matrices, NEAREST)`, at the angles of some eigenvalues `1 + delta`.

    rank: of each eigenvalue, the least of which are chosen, one of a conjugate pair; radius: `(matrices,)` or a number.
    """
    chosen = np.take_along_axis(delta, np.argsort(np.where(delta.imag < 0, np.inf, rank), axis=-1)[:, :NEAREST], axis=-1)
    z = 1 + chosen
    size = np.where(z == 0, 1.0, np.abs(z))
    # Along the ray from 0: a point next to 1 keeps the digits of its distance from the eigenvalue.
    return chosen + np.where(z == 0, 1.0, z / size) * (np.reshape(radius, (-1, 1)) - np.abs(z))


def radius_hidden(E, dE) -> np.ndarray:
    """Return whether the spectral radius of `I + E` may be larger by TELLING, or on the other side of 1, within dE of E."""
    shape, n = E.shape[:-2], E.shape[-1]
    E, dE = E.reshape(-1, n, n), np.broadcast_to(dE, E.shape).reshape(-1, n, n)
    finite = np.isfinite(E).all((-1, -2)) & np.isfinite(dE).all((-1, -2))
    E, dE = (np.where(finite[:, None, None], part, 0.0) for part in (E, dE))
    delta = np.linalg.eigvals(E).astype(complex)
    size = np.abs(1 + delta)
    radius = size.max(-1, initial=0.0)
    further = at_angles_of(delta, radius + TELLING * np.maximum(radius, 1), -size)
    found = finite & may_have(E, dE, np.concatenate([further, at_angles_of(delta, 1.0, -size)], axis=-1))
    return found.reshape(shape)
