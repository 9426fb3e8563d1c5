"""States that live on from frame to frame along a parameter: the others are left out, and noticed if they return."""

from dataclasses import replace

import numpy as np

from wavesweep.stability.frames import Frames
from wavesweep.stability.guardian_maps import EPS

TYPICAL = (0.53, 0.37, 0.71)  # of the span, where the units of the states are found; not the middle, which may be 0
FORGOTTEN = 64 * EPS  # size of an eigenvalue of its own up to which a state is left out: what rounding may make of 0


class MoreStatesError(Exception):
    """Frames of more states (`order`) than those seen before; some values of a number leave states out of the loop."""

    def __init__(self, order: int):
        super().__init__(f"frames of {order} states")
        self.order = order


class RecalledError(Exception):
    """States that were assumed to be forgotten are used again at some values of these columns."""

    def __init__(self, columns: np.ndarray):
        super().__init__(f"states of {len(columns)} columns are recalled")
        self.columns = columns


def typical(evaluate, span, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest sizes of the entries of each column's frames at a few points, `(columns, n, n)`.

    The first array is with the identity, the second without it; both are 0 if the frames overflow. Each column is treated by
    itself, so that its results do not depend on the others.
    """
    points = span[0] + (span[1] - span[0]) * np.array(TYPICAL)
    E = Frames.of(evaluate(np.arange(columns)[:, None], np.tile(points, (columns, 1)))).E
    E = np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0)
    return tuple(np.abs(part).reshape(columns, points.size, *E.shape[1:]).max(1) for part in (E + np.eye(E.shape[-1]), E))


def living(sizes):
    """Return which states keep a part of their value in a frame, or both affect and depend on others, `(columns, n)`.

    sizes: of the entries of I + E, `(columns, n, n)`. The others, held values and delays, have z = 0, a point at which
    eigenvalues would crowd, and cross nothing. One state is always kept.
    """
    n = sizes.shape[-1]
    kept, diagonal = np.ones(sizes.shape[:-1], bool), np.diagonal(sizes, axis1=-2, axis2=-1)
    others = np.where(np.eye(n, dtype=bool), 0.0, sizes)
    while True:
        some = np.where(kept[:, None, :] & kept[:, :, None], others, 0.0)
        dead = kept & (diagonal <= FORGOTTEN) & ((some.max(1) == 0) | (some.max(2) == 0))
        if not dead.any():
            kept[~kept.any(1), 0] = True
            return kept
        kept &= ~dead


def of_order(evaluate, order: int, kept, column, p) -> Frames:
    """Return the frames of these columns at `p` with `order` states, of which `kept` are not forgotten.

    States that are left out for all these values are added with z = 0. Errors: MoreStatesError, RecalledError.
    """
    found = Frames.of(evaluate(column, p))
    E = found.E
    if not kept.all():
        if E.shape[-1] != kept.size:
            raise RecalledError(np.unique(column))
        with np.errstate(all="ignore"):
            A = np.abs(E + np.eye(kept.size))
        column = np.repeat(column.ravel(), len(E) // column.size)
        if (living(A.max(0)[None])[0] & ~kept).any():  # of all columns at once, which says little of each
            numbers = np.unique(column)
            recalled = (living(np.stack([A[column == number].max(0) for number in numbers])) & ~kept).any(1)
            if recalled.any():
                raise RecalledError(numbers[recalled])
        E = E[:, kept][:, :, kept]
    more = order - E.shape[-1]
    if more < 0:
        raise MoreStatesError(E.shape[-1])
    if not more:
        return replace(found, E=E)
    out = np.zeros((len(E), order, order), E.dtype)
    out[:, : E.shape[-1], : E.shape[-1]] = E
    out[:, range(-more, 0), range(-more, 0)] = -1
    return replace(found, E=out)
