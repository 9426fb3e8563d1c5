"""Stable intervals along any number of a loop, from its eigenvalues."""

from dataclasses import replace
from functools import partial

import numpy as np

from wavesweep.stability.covering import ATTACHED, Tiles, regions_of, tiles_of
from wavesweep.stability.entries import DEGREES, EPS, panels_of
from wavesweep.stability.frames import Frames
from wavesweep.stability.regions import NEAR_ZERO
from wavesweep.stability.stable import Intervals, intervals_of

TURN = 10.0  # of a span, where a bent variable turns from one that is even to its logarithm
WIDE = 3.0  # ratio of the span's ends above which its logarithm is the variable
EXACT = 1e-9  # of an end, what rounding may move it by; and of a NEAR_ZERO-th of the span
BENT, FROM_ZERO = "bent", "from zero"  # variables that are not chosen by the span
ENTRIES = 2**21  # of the polynomials of columns at a time, as far as their panels are two


def stable_along(frames, span, columns: int, period, bounds=(-np.inf, np.inf), variable="", errors=None) -> Intervals:
    """All stable intervals of every column within span = (low, high) of a parameter p that may enter in any smooth way.

    frames(column, p): `Frames` of these columns at these values, real or complex, one after the other; or matrices `(...,
    order, order)` without poles, analytic in p. p: `(n,)` as column, or `(m, k)` if column is `(m, 1)`. columns: number of
    columns. period: of the frame, in s, `(columns,)`. bounds: p beyond them has no loop, a number or `(columns,)` each.
    errors(column, p): frames less identity in the same states, and bounds on the errors of their entries; by default these are
    a few roundings.
    variable: BENT, the logarithm of the distance from the low end and a TURN-th of the span, as stiffnesses and dampings have
    poles below zero; FROM_ZERO, the logarithm of p from ATTACHED of the span on, for a span from 0, at which the loop need not
    be analytic and eigenvalues may leave z = 1 as any power of p; otherwise it is the logarithm of p if high > WIDE low > 0, as
    masses, impedances and cutoffs act by their ratios, or else p.

    The entries of the frame are followed on panels as polynomials with a bound on their error (`entries`). From places on
    these it is proved how far to both sides no eigenvalue is on the unit circle, and how many are outside (`dominance`). What
    that leaves are windows about crossings, as narrow as ends are exact (`covering`). A part of the span that is neither is
    not known: its column is in doubt, and the rest of it is given.
    Accuracy: ends to 1e-9 relative, usually 1e-12; those within 1e-9 of the span of its low end are given as that end, and as
    its high end those that are as near to it as ends are exact.
    """
    low, high = span
    if variable == FROM_ZERO:
        low = ATTACHED * high
    if variable == BENT:
        unit, slope = (high - low) / TURN, lambda t: unit * np.exp(t)
        into, out = lambda p: np.log1p((p - low) / unit), lambda t: low + unit * np.expm1(t)
    elif low > 0 and high > WIDE * low:
        unit, into, out, slope = low, np.log, np.exp, None
    else:
        unit, into, out, slope = np.inf, _same, _same, np.ones_like
    ends = into(low), into(high)
    with np.errstate(all="ignore"):  # of the logarithm of what has none
        bounds = np.stack([np.zeros(columns) + end for end in bounds])
        bounds = np.where(bounds > low - unit, into(bounds), -np.inf)

    def slack(t):
        return EXACT + 0 * t if slope is None else EXACT * (np.abs(out(t)) + NEAR_ZERO * (high - low)) / slope(t)

    errors = partial(_rounded, frames) if errors is None else errors
    at_once = partial(_of_columns, partial(_through, frames, out), partial(_through, errors, out), ends, slack)
    order = Frames.of(frames(np.zeros(1, int), np.array([(low + high) / 2]))).E.shape[-1]
    few = max(1, ENTRIES // (2 * (DEGREES[-1] + 1) * order**2))
    parts = [np.arange(first, min(first + few, columns)) for first in range(0, columns, few)]
    found = Intervals.join([at_once(names, period[names], bounds[:, names]) for names in parts])
    # The range's own ends are given back as they were, not as they come out, and 0 within it as what it is but for rounding.
    nothing = EPS * (high - low) if low < 0 < high else 0.0
    lows, highs = (
        np.where(part == end, own, np.where(np.abs(out(part)) <= nothing, 0.0, out(part)))
        for part, end, own in zip((found.low, found.high), ends, span, strict=True)
    )
    return replace(found, low=lows, high=highs)


def _same(p):
    return p


def _through(function, out, column, t):
    with np.errstate(over="ignore"):  # beside the largest doubles
        p = out(t)
    return function(column, p)


def _rounded(frames, column, p):
    E = Frames.of(frames(column, p)).E
    return E, 4 * EPS * (np.abs(E) + np.eye(E.shape[-1]))


def _of_columns(frames, errors, span, slack, names, period, bounds) -> Intervals:
    """The intervals of some columns in the variable; the others: see `stable_along`."""

    def of_errors(column, t):
        column, t = np.broadcast_arrays(column, t)
        return errors(names[column.ravel()], t.ravel())

    panels, lost = panels_of(lambda column, t: frames(names[column], t), of_errors, span, names.size, bounds)
    tiles = Tiles.of(np.zeros(0, int), *np.zeros((2, 0)), 0)
    if panels is not None:
        panels, kept = panels.without_forgotten()
        tiles = tiles_of(panels, lambda *at: (part[:, kept[:, None], kept] for part in of_errors(*at)), span, names.size, slack)
    attached = ATTACHED * (span[1] - span[0]), slack(span[1])
    found = intervals_of(*regions_of(tiles, lost, span, names.size, attached), period)
    return replace(found, column=names[found.column])
