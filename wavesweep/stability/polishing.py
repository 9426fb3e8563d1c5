"""Roots of critical functions to rounding: ends of stable intervals along any number, from the eigenvalues themselves."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.columns import Rows
from wavesweep.monodromy.circle import inverse
from wavesweep.monodromy.rounding import balance
from wavesweep.stability.double_eigenvalues import ROUNDED, function_of_two
from wavesweep.stability.frames import Frames
from wavesweep.stability.guardian_maps import CAUTION, MINUS_ONE, ONE, PAIR, from_eigenvalues
from wavesweep.stability.panels import bracketed_roots
from wavesweep.stability.spectrum import eigenvalues, excess

ORDINARY = 16.0  # condition of algebraic loops up to which entries are good to a few roundings
ATTACHED = 1e-9  # of the span; a crossing so near to its low end, where a gain of zero leaves a drift, is given as there
STEP = 1e3  # times what rounding may move an end by: how far a correction may go, and where its slope is taken from
FAR = 1e5  # the same for a slope alone, where rounding at that distance moves an end by more than it may
SHORT, LEAST = 0.05, 10.0  # of a disc, if that is nearer; and times that again at least
LAST = 4.0  # times the last correction: what an end may be off by
BESIDE = 1e-10  # of an eigenvalue, how far from it its vectors are looked for
FARTHER = (1.0, 1e2, 1e4)  # times that, tried in turn
TWIN = 1e-8  # of an eigenvalue, a distance of another one at which its vectors are those of both
SECANT, SECANTS = 1e-3, 3  # of a disc, the first step from its middle; how many follow
TRIES = 4  # steps of Newton from where a root was found
CLEAR = 1e-10  # | |z|^2 - 1 | at an end, up to which the end is believed
SAME = 1e-10  # of the span, how near two ends of overlapping panels are one
MEETING = 1e-3  # angle from z = 1 or z = -1, up to which a pair may be the two that meet there
BOTH = 1e-4  # distance from there, up to which a second eigenvalue makes vectors of the first one too uncertain
STEADY = 0.5  # of a pivot at a further step, at least: what it is at a root of which that step tells the rounding
FEW = 0.1  # of itself, the error of an interpolated function whose sign is believed


@dataclass(frozen=True, slots=True)
class Ends(Rows):
    """Roots to rounding.

    column, function, value: of the parameter. theta: angle of the eigenvalue there. miss: its distance from its place on the
    circle. good: whether the root is accurate enough. first, last: the ends of the disc in which it is, and no other root.
    """

    column: np.ndarray
    function: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    miss: np.ndarray
    good: np.ndarray
    first: np.ndarray
    last: np.ndarray


def polished(evaluate, loop, found, span, slack) -> Ends:
    """Return every root that was found, to rounding, without duplicates from overlapping panels."""
    column, kind, width = found.column, found.function, span[1] - span[0]
    reach = np.minimum(found.within, 0.1 * width) + 1e-9 * width  # the disc, which no other root is in
    x, met = _followed(loop, found, reach), np.zeros(found.x.size, bool)

    def end(at):
        return _end(evaluate, column[at], kind[at], x[at], slack, reach[at])

    ends, rest = np.zeros((5, x.size)), np.arange(x.size)
    for _ in range(TRIES):
        if rest.size:
            x[rest], *ends[:, rest] = end(rest)
            # A root of this eigenvalue in the disc, which has one root only, from which the last correction was small
            # beside what an end may be off by: what is left is a share of it.
            met = (
                (np.abs(ends[0]) <= CLEAR)
                & (np.abs(x - found.x) <= reach)
                & np.isfinite(ends[2])
                & (LAST * ends[3] <= slack(x))
            )
            rest = np.flatnonzero(~met)
    if rest.size:  # Newton's method does not get there

        def value(at, x):
            at = rest[at]
            return _sign(from_eigenvalues(Frames.of(evaluate(column[at], x)).E), kind[at], CAUTION)

        low, high, least = found.x - reach, found.x + reach, span[0] + ATTACHED / 4 * width
        x[rest], met[rest] = bracketed_roots(value, low[rest], high[rest], found.x[rest], least)
        x[rest], *ends[:, rest] = end(rest)
    far = np.flatnonzero(met & np.isfinite(ends[2]) & (ends[2] > slack(x)) & (LAST * ends[3] <= slack(x)))
    if far.size:  # entries that vanish with the root have lost fewer digits farther away
        _, _, _, moved, *_ = _end(evaluate, column[far], kind[far], x[far], slack, reach[far], FAR)
        ends[2, far] = np.minimum(ends[2, far], moved)
    miss, theta, moved, by, other = ends
    # A reciprocal pair of real eigenvalues crosses nothing, wherever it is.
    firm = (
        (np.maximum(moved, LAST * by) <= slack(x)) | ((kind == PAIR) & (theta == 0)) | (np.abs(x - span[0]) <= ATTACHED * width)
    )
    good = met & (np.abs(miss) <= CLEAR) & firm & (other > BOTH)
    ends = Ends(column, kind, x, theta, miss, good, found.x - reach, found.x + reach)
    return _distinct(_where_two_meet(evaluate, ends, slack, reach), SAME * width)


def _followed(loop, found, reach):
    """Return the roots on the interpolants of the loop, which have most of their digits for next to nothing."""
    x = found.x.copy()
    piece = loop.piece(found.column, x[:, None])
    known = np.flatnonzero(loop.pieces.degree[piece] > 0)

    def value(x):
        parts = [part[..., 0] for part in loop.functions(piece[known], x[:, None])]
        return _sign(parts, found.function[known], FEW)

    if known.size:
        x[known] = _by_secants(value, x[known], reach[known])
    return x


def _sign(parts, kind, most):
    """Return sign and logarithm of the function of each root; the sign is 0 if the relative error is not below `most`.

    parts: phase, logarithm and error of all functions at each root; kind: the function of each.
    """
    phase, log, error = (part[kind, np.arange(kind.size)] for part in parts)
    return np.sign(phase.real) * (error * np.finfo(float).eps < most), log


def _distinct(ends, apart):
    """Return the ends in order, without those that are no farther than `apart` from one before them."""
    ends = ends.take(np.lexsort((ends.value, ends.function, ends.column)))
    new = np.ones(ends.value.size, bool)
    new[1:] = (np.diff(ends.column) != 0) | (np.diff(ends.function) != 0) | (np.diff(ends.value) > apart)
    return ends.take(new)


def _where_two_meet(evaluate, ends, slack, reach):
    """Return the ends, those at which two eigenvalues meet at z = 1 or z = -1 from what is known of both.

    One of them crosses there. The root of PAIR at the same place is that of a reciprocal pair, whatever their angle is. A pair
    that seems to cross next to it is taken for two: beyond the place its eigenvalues are real, and one has another slope.
    """
    low = (ends.function == PAIR) & (ends.theta > 0) & (np.minimum(ends.theta, np.pi - ends.theta) <= MEETING)
    known, some = ends.good.copy(), np.flatnonzero(~ends.good | low)
    value, theta, miss, good = (part.copy() for part in (ends.value, ends.theta, ends.miss, ends.good))
    if some.size:
        column, kind = ends.column[some], ends.function[some]
        x, *_ = _of_two(evaluate, column, kind, value[some], slack, reach[some])
        x, left, moved, by = _of_two(evaluate, column, kind, x, slack, reach[some])
        moved = np.minimum(moved, _of_two(evaluate, column, kind, x, slack, reach[some], FAR)[2])
        met = (left <= CLEAR) & (np.maximum(moved, LAST * by) <= slack(x)) & (np.abs(x - value[some]) <= reach[some])
        some, kind = some[met], kind[met]
        turning = ends.good[some] & low[some]
        value[some], miss[some], known[some], good[some] = x[met], left[met], True, (kind != PAIR) | turning
        theta[some] = np.where(turning, theta[some], np.where(kind == MINUS_ONE, np.pi, 0.0))
    order = np.lexsort((value, ends.column))
    single, place = (good & (ends.function != PAIR))[order], np.arange(order.size)
    before = np.maximum.accumulate(np.where(single, place, -1))
    after = np.minimum.accumulate(np.where(single, place, order.size)[::-1])[::-1]
    beside = known & (ends.function == PAIR) & (np.minimum(theta, np.pi - theta) <= MEETING)
    for other in (before, after):
        there = np.flatnonzero((other >= 0) & (other < order.size) & beside[order])
        one, two = order[there], order[other[there]]
        apart = np.where(ends.column[one] == ends.column[two], np.abs(value[one] - value[two]), np.inf)
        same = one[apart <= slack(value[one])]
        theta[same], miss[same], good[same] = 0.0, 0.0, True
    return replace(ends, value=value, theta=theta, miss=miss, good=good)


def _of_two(evaluate, column, kind, x, slack, reach, most=STEP):
    """Return what `_end` does, but for the angle, of roots at which two eigenvalues may meet at z = 1 or z = -1."""
    step = np.clip(SHORT * reach, LEAST * slack(x), most * slack(x))
    found = Frames.of(evaluate(np.tile(column, 2), np.concatenate([x, x + step])))
    w, _ = eigenvalues(found.E[: x.size])
    at_one, at_minus_one = (np.partition(np.abs(w - place), 1, axis=-1)[:, 1] for place in (0.0, -2.0))
    place = np.where(kind == PAIR, np.where(at_one <= at_minus_one, 0.0, -2.0), np.where(kind == ONE, 0.0, -2.0))
    value, unsure = (part.reshape(2, -1) for part in function_of_two(found.E, np.tile(kind, 2), np.tile(place, 2)))
    with np.errstate(all="ignore"):
        slope = (value[1] - value[0]) / step
        by, moved = -value[0] / slope, _by_condition(unsure / np.abs(slope), found)
    near = np.abs(by) <= np.maximum(step, reach)
    return np.where(near, x + by, x), np.abs(value[0]), np.where(np.isfinite(moved), moved, np.inf), np.abs(by)


def _by_secants(value, x, reach):
    """Return roots from approximations by the secant method, each within `reach` of its start.

    value(x): sign and logarithm.
    """
    before, (sign, scale) = x, value(x)
    scale = np.where(np.isfinite(scale), scale, 0.0)
    f, step = sign, SECANT * reach
    for _ in range(SECANTS):
        now = np.clip(before + step, x - reach, x + reach)
        sign, log = value(now)
        with np.errstate(all="ignore"):
            g = sign * np.exp(log - scale)
            step = np.where(g == 0, 0.0, -g * (now - before) / (g - f))
        before, f, step = now, g, np.where(np.isfinite(step), step, 0.0)
    return np.clip(before + step, x - reach, x + reach)


def _end(evaluate, column, kind, x, slack, reach, most=STEP):
    """Return better values of the roots x, no farther than `reach`, and measures of their quality.

    These are the distance of the eigenvalue from its place at x itself, its angle there, the movement of the root by rounding,
    which is infinite if x is not next to the root, the size of the correction that was needed, and the distance of a second
    eigenvalue from z = 1 or z = -1, infinite for PAIR.

    The slope is taken over a step that is short compared to the distance to the next root, since two roots may nearly merge;
    most: of it, in slacks.
    """
    step = np.clip(SHORT * reach, LEAST * slack(x), most * slack(x))
    found = Frames.of(evaluate(np.tile(column, 2), np.concatenate([x, x + step])))
    E = found.E
    w, miss, theta, other = _nearest(E[: x.size], kind)
    by, moved = _correction(E, w, step)
    moved = _by_condition(moved, found)
    pairs = np.flatnonzero((kind == PAIR) & (theta == 0))
    if pairs.size:  # of reciprocal eigenvalues, which cross nothing: the slope of their product will do
        _, later, *_ = _nearest(E[x.size + pairs], kind[pairs])
        with np.errstate(all="ignore"):
            by[pairs], moved[pairs] = -miss[pairs] * step[pairs] / (later - miss[pairs]), 0.0
    moved = np.where(np.abs(by) <= STEP * slack(x), moved, np.inf)
    return np.where(np.abs(by) <= np.maximum(step, reach), x + by, x), miss, theta, moved, np.abs(by), other


def _by_condition(moved, found):
    """Return the movement of roots by rounding of as many digits as the frames have lost.

    moved: that of ordinary frames, from those at the root and at a further step, `(2, roots)`; found: these frames. An entry
    may vanish with the root, as the change of a mode does that turns over. It has lost all of its digits there; but its error
    is that at the step, where they are left. So the smaller one of both bounds holds, unless a loop of direct terms comes
    nearer to having no solution.
    """
    condition = np.broadcast_to(found.condition, found.E.shape[:1]).reshape(2, -1)
    with np.errstate(all="ignore"):
        # Nothing is left of an entry that is smaller than its own error.
        moved = np.where(condition * np.finfo(float).eps < 1, moved * np.maximum(1, condition / ORDINARY), np.inf)
        here, later = np.abs(found.pivots).reshape(2, moved.shape[1], -1)
        steady = (here >= STEADY * later).all(-1)
    return np.where(steady, np.fmin(moved[0], moved[1] / STEADY), moved[0])


def _nearest(E, kind):
    """Return the eigenvalue w = z - 1 of that kind that is nearest to its place on the circle, its distance, and its angle.

    The distance is 1 - |z|^2, or 1/z_i - z_j of a reciprocal pair whose larger one is z_i, which makes z_j rough;
    |z|^2 - 1 at z = +-1, infinite if that eigenvalue is not real. The angle is 0 for a reciprocal pair. A fourth array has the
    distance of the second nearest from z = 1 or z = -1, for PAIR infinite, or 0 if another one is next to it.
    """
    w, known = eigenvalues(E)
    w = np.concatenate([w, np.full((len(w), 1), -1.0)], axis=-1)  # z = 0, which makes a pair for a single eigenvalue
    i, j = np.triu_indices(w.shape[-1], 1)
    pair = -(w[:, i] + w[:, j] + w[:, i] * w[:, j])
    best = np.argmin(np.abs(pair), axis=-1)[:, None]
    first, second = (np.take_along_axis(w[:, part], best, -1)[:, 0] for part in (i, j))
    apart = np.where(kind[:, None] == ONE, np.abs(w), np.abs(w + 2))
    single = np.take_along_axis(w, np.argmin(apart, -1)[:, None], -1)[:, 0]
    other = np.where(kind == PAIR, np.inf, np.partition(apart, 1, axis=-1)[:, 1])
    larger = np.where(first.imag == 0, np.maximum(1.0, np.maximum(np.abs(1 + first), np.abs(1 + second))), 1.0)
    miss = np.where(kind == PAIR, np.take_along_axis(pair, best, -1)[:, 0].real / larger, excess(single))
    apart = np.abs(w - first[:, None])
    for index in (i, j):
        np.put_along_axis(apart, index[best], np.inf, -1)
    other = np.where((kind == PAIR) & (first.imag != 0) & (apart.min(-1) < TWIN * np.abs(1 + first)), 0.0, other)
    known &= (kind == PAIR) | (single.imag == 0)  # a complex pair that crosses beside z = +-1 is a root of PAIR
    theta = np.where(kind == PAIR, np.abs(np.angle(1 + first)) * (first.imag != 0), np.where(kind == ONE, 0.0, np.pi))
    return np.where(kind == PAIR, first, single), np.where(known, miss, np.inf), theta, other


def _correction(E, w, step):
    """Return the step that puts the eigenvalue next to w on the circle, and its changes by rounding of the entries, `(2, n)`.

    Eigenvalues are accurate to a rounding of the largest entry, which is large compared to those of a slow loop. A quotient of
    vectors is accurate to a rounding of each entry. E: frames, followed by those at a further step.
    """
    with np.errstate(all="ignore"):
        E, _ = balance(np.where(np.isfinite(E).all((-1, -2))[:, None, None], E, 0.0))
        now, unsure = _rayleigh(E, np.tile(w, 2))
        value = excess(now).reshape(2, -1)
        slope = (value[1] - value[0]) / step
        return -value[0] / slope, (2 * np.abs(1 + now) * unsure).reshape(2, -1) / np.abs(slope)


def _rayleigh(E, w):
    """Return the eigenvalue of each matrix next to w, and its change by ROUNDED roundings of every entry, to first order.

    The eigenvalue is the quotient of its vectors, so its error is the square of theirs.
    """
    left, right = vectors_of(E, w)
    value = (left @ (E @ right))[:, 0, 0]
    return value, ROUNDED * np.finfo(float).eps * (np.abs(left) @ (np.abs(E) @ np.abs(right)))[:, 0, 0]


def vectors_of(E, w):
    """Return the left and the right eigenvector next to w of each matrix, `(..., 1, n)` and `(..., n, 1)`, of product 1.

    They follow from this eigenvalue alone: the states of a delay make others that have too few vectors.
    """
    # A little beside w: at an eigenvalue itself there is no inverse, and next to two of them none that is known.
    beside, back = BESIDE * np.abs(w) + ROUNDED * np.finfo(float).eps * np.abs(E).max((-1, -2)), np.full(E.shape, np.nan + 0j)
    for farther in FARTHER:
        some = np.flatnonzero(~np.isfinite(back).all((-1, -2)))
        if some.size:
            back[some] = inverse(E[some] - (w + farther * beside)[some, None, None] * np.eye(E.shape[-1]))
    start = np.cos(np.arange(1, E.shape[-1] + 1))
    right, left = back @ start[:, None], start @ back
    right, left = (part / np.abs(part).max((-1, -2) if part.ndim > 2 else -1, keepdims=True) for part in (right, left))
    right, left = back @ right, left[:, None] @ back
    right, left = (part / np.abs(part).max((-1, -2), keepdims=True) for part in (right, left))
    return left / (left @ right), right
