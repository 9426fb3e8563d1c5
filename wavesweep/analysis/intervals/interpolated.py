"""Frames of a loop over a range of a parameter: a few are computed, and those between are interpolated, with an error bound."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from wavesweep.analysis.intervals.panels import EXTENT, OVERLAP, RIM
from wavesweep.analysis.spectrum import balance

SAMPLES = 28  # of a piece
TYPICAL = (0.5, 0.37, 0.71)  # of the span, where the units of the states are found
PIECES = 4  # a piece narrower than this part of the span that is not followed is computed at every point
HOPELESS = 0.05  # of the largest entry, in the last coefficients: halves of such a piece would not be followed either
ROUNDED = 16  # roundings of the largest entry that the samples and the sums of an interpolant cost
LOOSE = 64.0  # roundings of the largest entry that an interpolant may be off by
NODE = np.cos(np.pi * (np.arange(SAMPLES) + 0.5) / SAMPLES)
TRANSFORM = np.cos(np.outer(np.arange(SAMPLES), np.arccos(NODE))) * (2 / SAMPLES)
TRANSFORM[0] /= 2


def chebyshev(x):
    """The Chebyshev polynomials of degree 0 to SAMPLES - 1 at x, in a last axis."""
    parts = [np.ones_like(x), x]
    for _ in range(SAMPLES - 2):
        parts.append(2 * x * parts[-1] - parts[-2])
    return np.stack(parts, axis=-1)


ON_RIM = chebyshev(RIM)
AT_RIM = np.abs(ON_RIM[:, -1] * RIM * 2 - ON_RIM[:, -2]).min()  # of the polynomial that vanishes at the nodes
for _array in (NODE, TRANSFORM, ON_RIM):
    _array.flags.writeable = False


@dataclass(frozen=True, slots=True)
class Frames:
    """Interpolants of frames, piece by piece.

    column, low, high: of each piece, sorted. middle, half: of what was sampled. coefficients: `(pieces, SAMPLES, n n)`.
    error: what each entry may be off by, in balanced units. followed: which pieces are; the others are computed. units:
    `(columns, n)`, of the states, see `balance`.
    """

    evaluate: object
    span: tuple[float, float]
    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    coefficients: np.ndarray
    error: np.ndarray
    followed: np.ndarray
    units: np.ndarray

    def at(self, column, p):
        """Frames less identity at `p`, `(panels, points)`, of these columns, `(panels, points, n, n)`; and the bound of their
        error, `(panels,)`, as an entry in the units of the states."""
        order = self.units.shape[-1]
        place = (p.mean(-1).real - self.span[0]) / (self.span[1] - self.span[0])
        start = self.column + (self.low - self.span[0]) / (self.span[1] - self.span[0])
        piece = np.searchsorted(start, column + np.clip(place, 0, 1 - 1e-9), side="right") - 1
        out = np.empty((*p.shape, order, order), p.dtype)
        near = self.followed[piece]
        some = piece[near]
        if some.size:
            basis = chebyshev((p[near] - self.middle[some, None]) / self.half[some, None])
            out[near] = (basis @ self.coefficients[some]).reshape(-1, p.shape[-1], order, order)
        if not near.all():
            out[~near] = self.computed(column[~near], p[~near])
        return out, np.where(near, self.error[piece], 0.0)

    def computed(self, column, p):
        """The same, none interpolated."""
        if not column.size:
            return np.empty((0, p.shape[-1], *2 * self.units.shape[-1:]), p.dtype)
        E = self.evaluate(np.repeat(column, p.shape[-1]), p.ravel())
        return E.reshape(*p.shape, *E.shape[1:])


class MoreStatesError(Exception):
    """Frames of more states (`order`) than those seen before; some values of a number leave states out of the loop."""

    def __init__(self, order: int):
        super().__init__(f"frames of {order} states")
        self.order = order


def followed_frames(evaluate, span, columns: int, bounds, order: int = 0) -> Frames:
    """Follow the frames of every column over the span.

    evaluate, bounds: see `stable_along_any`. order: of the largest frames, if it is known. Errors: MoreStatesError.

    Each entry is interpolated at SAMPLES Chebyshev points of a piece. What is left of it, divided by the Chebyshev polynomial
    that vanishes at these, is analytic, so on the piece it is at most what it is on the rim of an ellipse about it, where the
    frames are computed at complex values (see `panel_roots`): that polynomial, 1 at most on the piece, is 10^11 there. A piece
    that is not followed to LOOSE roundings is cut in two.
    """
    width, smallest = span[1] - span[0], 1.01 * (span[1] - span[0]) / PIECES
    column, low, high = np.arange(columns), *(np.full(columns, float(end)) for end in span)
    # Several values at once: a single one may happen to leave a state out of the loop.
    E = evaluate(np.repeat(column[:1], len(TYPICAL)), span[0] + width * np.array(TYPICAL))
    evaluate = partial(_of_order, evaluate, max(order, E.shape[-1]))
    E = evaluate(column, (low + high) / 2)
    units = balance(np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0))[1]
    ratio, done = (units[:, None, :] / units[:, :, None]).reshape(columns, -1), []
    while column.size:
        reach = OVERLAP * (high - low)
        left, right = np.maximum(low - reach, bounds[0]), np.minimum(high + reach, bounds[1])
        middle, half = (left + right) / 2, (right - left) / 2
        coefficients, error = np.zeros((column.size, SAMPLES, ratio.shape[-1])), np.full(column.size, np.inf)
        hopeless = np.zeros(column.size, bool)
        inside = np.flatnonzero((middle - EXTENT * half >= bounds[0]) & (middle + EXTENT * half <= bounds[1]))
        if inside.size:
            some = (part[inside] for part in (column, middle, half))
            coefficients[inside], error[inside], hopeless[inside] = _interpolants(evaluate, *some, ratio[column[inside]])
        followed = np.isfinite(error)
        kept = followed | hopeless | (high - low <= smallest)
        done.append([part[kept] for part in (column, low, high, middle, half, coefficients, error, followed)])
        column, low, high = (part[~kept] for part in (column, low, high))
        cut_at = (low + high) / 2
        column, low, high = np.tile(column, 2), np.append(low, cut_at), np.append(cut_at, high)
    parts = [np.concatenate(part) for part in zip(*done, strict=True)]
    order = np.lexsort((parts[1], parts[0]))
    return Frames(evaluate, span, *(part[order] for part in parts), units)


def _of_order(evaluate, order, column, p):
    """The frames with this number of states: one that is left out for all these values stands there with z = 0."""
    E = evaluate(column, p)
    more = order - E.shape[-1]
    if more < 0:
        raise MoreStatesError(E.shape[-1])
    if not more:
        return E
    out = np.zeros((len(E), order, order), E.dtype)
    out[:, : E.shape[-1], : E.shape[-1]] = E
    out[:, range(-more, 0), range(-more, 0)] = -1
    return out


def _interpolants(evaluate, column, middle, half, ratio):
    """Chebyshev coefficients of the entries on each piece; what an entry may be off by (balanced units; infinite where that is
    more than LOOSE roundings of the largest); and whether halves of the piece would be no better."""
    size, error, eps = column.size, np.full(column.size, np.inf), np.finfo(float).eps
    E = evaluate(np.repeat(column, SAMPLES), (middle[:, None] + half[:, None] * NODE).ravel()).reshape(size, SAMPLES, -1)
    with np.errstate(all="ignore"):
        coefficients = TRANSFORM @ E
        largest = (np.abs(E) * ratio[:, None]).max((1, 2), initial=1)
        tail = (np.abs(coefficients[:, -2:]) * ratio[:, None]).max((1, 2))
        some = np.flatnonzero(tail <= LOOSE * eps * largest)
        if some.size:
            rim = evaluate(np.repeat(column[some], RIM.size), (middle[some, None] + half[some, None] * RIM).ravel())
            left = np.abs(rim.reshape(some.size, RIM.size, -1) - ON_RIM @ coefficients[some]) * ratio[some, None]
            # Twice, since between two points of the rim it may be larger than at both.
            error[some] = 2 * left.max((1, 2)) / AT_RIM + ROUNDED * eps * largest[some]
        return coefficients, np.where(error <= LOOSE * eps * largest, error, np.inf), tail > HOPELESS * largest
