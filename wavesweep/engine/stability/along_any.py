"""Stable intervals along any number of a loop, from its eigenvalues."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.monodromy.resolvent import DelayLines
from wavesweep.engine.monodromy.rounding import uneven_units
from wavesweep.engine.stability.covering import Tiles, proved_by_balls, regions_of, tiles_of
from wavesweep.engine.stability.entries import DEGREES, EPS, panels_of
from wavesweep.engine.stability.intervals import Intervals, doubts_of, intervals_of
from wavesweep.engine.stability.reduced_equation import LONG, tiles_by_lines
from wavesweep.engine.stability.regions import NEAR_ZERO, Regions
from wavesweep.engine.stability.sampled_frames import Frames

TURN = 10.0  # of a span, where a bent variable turns from one that is even to its logarithm
WIDE = 3.0  # ratio of the span's ends above which its logarithm is the variable
EXACT = 1e-9  # of an end, what rounding may move it by; and of a NEAR_ZERO-th of the span
BENT, FROM_ZERO = "bent", "from zero"  # variables that are not chosen by the span
TYPICAL = (
    0.53,
    0.37,
    0.71,
    0.013,
    0.987,
)  # of the span, where the units of the states are found; not the middle, which may be 0
ENTRIES = 2**21  # of the polynomials of columns at a time, as far as their panels are two


def stable_along_any(
    frames: Callable[..., Any],
    span: tuple[float, float],
    columns: int,
    period: np.ndarray,
    bounds: tuple[Any, Any] = (-np.inf, np.inf),
    variable: str = "",
    errors: Callable[..., Any] | None = None,
    balls: Callable[..., Any] | None = None,
    resolved: Any = None,
    *,
    tight: Callable[..., Any] | None = None,
    from_one: bool = False,
) -> Intervals:
    """All stable intervals of every column within span = (low, high) of a parameter p that may enter in any smooth way.

    period: of the frame, in s, `(columns,)`. The others, and the accuracy: see `regions_along_any`.
    """
    regions = regions_along_any(
        frames, span, columns, bounds, variable, errors, balls, resolved, tight=tight, from_one=from_one
    )
    return intervals_of(regions, doubts_of(regions, np.full(columns, Doubt.NONE)), period)


def regions_along_any(
    frames,
    span,
    columns: int,
    bounds=(-np.inf, np.inf),
    variable="",
    errors=None,
    balls=None,
    resolved=None,
    *,
    tight=None,
    from_one: bool = False,
) -> Regions:
    """The parts of the span = (low, high) of a parameter p in which each column is stable, unstable, or not known.

    frames(column, p): `Frames` of these columns at these values, real or complex, in this order; or matrices `(...,
    order, order)` without poles, analytic in p. p: `(n,)` as column, or `(m, k)` if column is `(m, 1)`. columns: number of
    columns. bounds: p beyond them has no loop, a number or `(columns,)` each.
    errors(column, p): frames less identity in the same states, and bounds on the errors of their entries; by default these are
    a few roundings.
    variable: BENT, the logarithm of the distance from the low end and a TURN-th of the span, as stiffnesses and dampings have
    poles below zero; FROM_ZERO, the logarithm of p from where ends are told from 0, for a span from 0, at which the loop need
    not be analytic and eigenvalues may leave z = 1 as any power of p; otherwise it is that of p if high > WIDE low > 0,
    as masses, impedances and cutoffs act by their ratios, or else p.
    balls(column, low, high): stable intervals of what is left in doubt, see `covering.proved_by_balls`; by default it stays so.
    resolved(column, low, high, offset, scale): whether frames have no narrow features for p = offset + scale exp(t), or p = t
    if scale is 0, with t from low to high, `(n,)` all; see `loops.resolution`. By default they have none anywhere.
    tight(column, p): what errors does, with bounds that are tighter and take longer, for windows that are too wide otherwise.
    from_one: whether an eigenvalue is exactly 1 at the low end of the span, see `leaving_one`; not for FROM_ZERO.

    The entries of the frame are followed on panels as polynomials with a bound on their error (`entries`). From places on
    these it is proved how far to both sides no eigenvalue is on the unit circle, and how many are outside (`dominance`). What
    that leaves are windows about crossings, as narrow as ends are exact (`covering`). A part of the span that is neither is
    not known: its column is in doubt, and the rest of it is given.
    Accuracy: ends to 1e-9 relative, usually 1e-12; those that are as near to an end of the span as ends are exact are given as
    that end.
    """
    low, high = span
    if variable == FROM_ZERO:
        low = EXACT * NEAR_ZERO * high
    v = _variable_of(low, high, variable)
    ends = v.into(low), v.into(high)
    with np.errstate(all="ignore"):  # of the logarithm of what has none
        bounds = np.stack([np.zeros(columns) + end for end in bounds])
        bounds = np.where(bounds > low - v.unit, v.into(bounds), -np.inf)

    def slack(t):
        if v.slope is None:
            return EXACT + 0 * t
        return EXACT * (np.abs(v.out(t)) + NEAR_ZERO * (high - low)) / v.slope(t)

    def through(function, column, t):
        with np.errstate(over="ignore"):  # beside the largest doubles
            p = v.out(t)
        return function(column, p)

    errors = partial(_rounded, frames) if errors is None else errors
    functions = partial(through, frames), partial(through, errors), partial(through, errors if tight is None else tight)
    order = Frames.of(frames(np.zeros(1, int), np.array([(low + high) / 2]))).E.shape[-1]
    few = max(1, ENTRIES // (2 * (DEGREES[-1] + 1) * order**2))
    portions = [np.arange(first, min(first + few, columns)) for first in range(0, columns, few)]
    balls = balls and _in_variable(balls, v.into, v.out)
    narrow = resolved and (lambda column, low, high: resolved(column, low, high, v.offset, v.scale))
    given = slack, balls, narrow, from_one
    regions = Regions.join([_regions(*functions, ends, names, bounds[:, names], *given) for names in portions])
    # The range's ends are given back as they were, not as they come out, and 0 within it as what it is but for rounding.
    nothing = EPS * (high - low) if low < 0 < high else 0.0
    lows, highs = (
        np.where(t == end, p, np.where(np.abs(v.out(t)) <= nothing, 0.0, v.out(t)))
        for t, end, p in zip((regions.low, regions.high), ends, span, strict=True)
    )
    return replace(regions, low=lows, high=highs)


class _Variable(NamedTuple):
    """The variable t in which panels are taken: t = into(p), p = out(t) = offset + scale exp(t), or t itself if scale is 0.

    slope: dp/dt as a function of t, None of a logarithm, whose ends are relative. unit: how far p may lie below the span.
    """

    into: Callable
    out: Callable
    slope: Callable | None
    unit: float
    offset: float
    scale: float


def _variable_of(low, high, variable):
    if variable == BENT:
        unit = (high - low) / TURN
        into, out = lambda p: np.log1p((p - low) / unit), lambda t: low + unit * np.expm1(t)
        return _Variable(into, out, lambda t: unit * np.exp(t), unit, low - unit, unit)
    if low > 0 and high > WIDE * low:
        return _Variable(np.log, np.exp, None, low, 0.0, 1.0)
    return _Variable(_same, _same, np.ones_like, np.inf, 0.0, 0.0)


def _same(p):
    return p


def _in_variable(balls, into, out):
    """`balls` for ends in the variable."""

    def proved_there(column, low, high):
        a, b = float(out(low)), float(out(high))
        intervals = balls(column, a, b)
        if intervals is None:
            return None
        exact = {a: low, b: high}
        return [(*(exact.get(end, float(into(end))) for end in row[:2]), *row[2:]) for row in intervals]

    return proved_there


def _rounded(frames, column, p):
    E = Frames.of(frames(column, p)).E
    return E, 4 * EPS * np.abs(E)


def _regions(frames, errors, tight, span, names, bounds, slack, balls, resolved, from_one) -> Regions:
    """The regions of some columns in the variable; slack: how far an end may be off; see `regions_along_any` for the rest."""

    def of_errors(column, t, function=errors):
        column, t = np.broadcast_arrays(column, t)
        return function(names[column.ravel()], t.ravel())

    def of_frames(column, t):
        return Frames.of(frames(names[column], t))

    points = span[0] + (span[1] - span[0]) * np.array(TYPICAL)
    E = of_frames(np.arange(names.size)[:, None], np.tile(points, (names.size, 1))).E
    E = np.where(np.isfinite(E).all((1, 2), keepdims=True), E, 0.0)
    sizes = np.abs(E).reshape(names.size, points.size, *E.shape[1:])
    calmest = np.where(sizes.any((2, 3)), sizes.max((2, 3)), np.inf).argmin(1)  # frames that grow are large in any units
    units = uneven_units(sizes[range(names.size), calmest])
    if E.shape[-1] >= LONG:
        for line in DelayLines.of(E).lines:  # which then take over values as they are
            units[:, line] = units[:, line[:1]]
    if (units != 1).any():
        ratio, plain, in_states = units[:, None, :] / units[:, :, None], of_frames, of_errors

        def scaled(E, column, t):
            factors = ratio[np.broadcast_to(column, t.shape).ravel()]
            return E * factors if E.shape[-1] == factors.shape[-1] else np.full_like(E, np.nan)

        of_frames = lambda column, t: replace(sampled := plain(column, t), E=scaled(sampled.E, column, t))  # noqa: E731

        def of_errors(column, t, function=errors):
            return tuple(scaled(M, *np.broadcast_arrays(column, t)) for M in in_states(column, t, function))

    narrow = resolved and (lambda column, low, high: resolved(names[column], low, high))
    panels, lost = panels_of(of_frames, of_errors, span, names.size, bounds, narrow, E.shape[-1])
    tiles_of_kinds, panels = (
        [Tiles.of(np.zeros(0, int), *np.zeros((2, 0)), 0)],
        [] if panels is None else panels.without_forgotten(),
    )
    for reduced, states in panels:
        off, near = (
            lambda *at, states=states, function=function: (M[:, states[:, None], states] for M in of_errors(*at, function))
            for function in (errors, tight)
        )
        tiles = tiles_by_lines(reduced, off, points, span, slack)
        if tiles is None:
            tiles = tiles_of(reduced, (off, near), span, names.size, slack, from_one=from_one)
        tiles_of_kinds.append(tiles)
    tiles = Tiles.join(tiles_of_kinds)
    attached = slack(span[0]), slack(span[1])
    if balls is not None:
        tiles, lost = proved_by_balls(tiles, lost, span, names.size, attached, lambda at, *ends: balls(int(names[at]), *ends))
    regions = regions_of(tiles, lost, span, names.size, attached)
    return replace(regions, column=names[regions.column])
