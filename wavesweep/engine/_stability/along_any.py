"""Stable intervals along any number of a loop, from its eigenvalues."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._monodromy.resolvent import DelayLines
from wavesweep.engine._monodromy.rounding import uneven_units
from wavesweep.engine._stability.covering import tiles_of
from wavesweep.engine._stability.entries import DEGREES, panels_of
from wavesweep.engine._stability.intervals import Intervals, doubts_of, intervals_of
from wavesweep.engine._stability.reduced_equation import LONG_LINES, tiles_by_lines
from wavesweep.engine._stability.regions import SHARE_OF_SPAN, Regions
from wavesweep.engine._stability.sampled_frames import Frames, ParametricFrames
from wavesweep.engine._stability.tiles import Tiles, proved_by_balls, regions_of
from wavesweep.engine.doubles import EPS
from wavesweep.engine.doubts import Doubt

BENT_AT = 10.0  # of a span, where a bent variable turns from one that is even to its logarithm
LOGARITHMIC_RATIO = 3.0  # ratio of the span's ends above which its logarithm is the variable
END_ROUNDING = 1e-9  # of an end, what rounding may move it by; and of a NEAR_ZERO-th of the span
BENT, FROM_ZERO = "bent", "from zero"  # variables that are not chosen by the span


def stable_along_any(
    family: ParametricFrames,
    span: tuple[float, float],
    *,
    variable: str = "",
    balls: Callable[..., Any] | None = None,
    from_one: bool = False,
) -> Intervals:
    """All stable intervals of every column within span = (low, high) of the number of a family.

    The others, and the accuracy: see `regions_along_any`.
    """
    regions = regions_along_any(family, span, variable=variable, balls=balls, from_one=from_one)
    doubts = doubts_of(regions, np.full(family.columns, Doubt.NONE))
    sampled = np.full(family.columns, Intervals.SAMPLED)
    return intervals_of(regions, doubts, family.period, sampled)


def regions_along_any(
    family: ParametricFrames,
    span: tuple[float, float],
    *,
    variable: str = "",
    balls: Callable[..., Any] | None = None,
    from_one: bool = False,
) -> Regions:
    """The parts of the span = (low, high) of the number p of a family in which each column is
    stable, unstable, or not known.

    variable: BENT, the logarithm of the distance from the low end and a BENT_AT-th of the span, as
    stiffnesses and dampings have poles below zero; FROM_ZERO, the logarithm of p from where ends
    are told from 0, for a span from 0, at which the loop need not be analytic and eigenvalues may
    leave z = 1 as any power of p; otherwise it is that of p if high > LOGARITHMIC_RATIO low > 0, as
    masses, impedances and cutoffs act by their ratios, or else p. balls(column, low, high): stable
    intervals of what is left in doubt, see `tiles.proved_by_balls`; by default it stays so.
    from_one: whether an eigenvalue is exactly 1 at the low end of the span, see `leaving_one`; not
    for FROM_ZERO.

    The entries of the frame are followed on panels as polynomials with a bound on their error
    (`entries`). From places on these it is proved how far to both sides no eigenvalue is on the
    unit circle, and how many are outside (`dominance`). What that leaves are windows about
    crossings, as narrow as ends are exact (`covering`). A part of the span that is neither is not
    known: its column is in doubt, and the rest of it is given. Accuracy: ends to 1e-9 relative,
    usually 1e-12; those that are as near to an end of the span as ends are exact are given as that
    end.
    """
    low, high = span
    if variable == FROM_ZERO:
        low = END_ROUNDING * SHARE_OF_SPAN * high
    chosen = _variable_of(low, high, variable)
    with np.errstate(all="ignore"):  # of the logarithm of what has none
        bounds = np.stack([np.zeros(family.columns) + end for end in family.bounds])
        bounds = np.where(bounds > low - chosen.unit, chosen.into(bounds), -np.inf)

    search = _Search(
        family=family,
        variable=chosen,
        span=(chosen.into(low), chosen.into(high)),
        slack=partial(chosen.slack, SHARE_OF_SPAN * (high - low)),
        balls=balls and _in_variable(balls, chosen.into, chosen.out),
        from_one=from_one,
    )
    in_middle = family.frames(np.zeros(1, int), np.array([(low + high) / 2]))
    regions = search.all_regions(bounds, order=Frames.of(in_middle).E.shape[-1])
    # 0 within the range is what it is but for rounding.
    nothing = EPS * (high - low) if low < 0 < high else 0.0

    def back(t: np.ndarray, end: float, end_of_range: float) -> np.ndarray:
        """The values of p at ends t of regions; the range's end is given back as it was, and not
        as it comes out."""
        p = chosen.out(t)
        return np.where(t == end, end_of_range, np.where(np.abs(p) <= nothing, 0.0, p))

    lows = back(regions.low, search.span[0], span[0])
    highs = back(regions.high, search.span[1], span[1])
    return replace(regions, low=lows, high=highs)


class _Variable(NamedTuple):
    """The variable t in which panels are taken: t = into(p), p = out(t) = offset + scale exp(t), or
    t itself if scale is 0.

    slope: dp/dt as a function of t, None of a logarithm, whose ends are relative. unit: how far p
    may lie below the span.
    """

    into: Callable[..., Any]
    out: Callable[..., Any]
    slope: Callable[..., Any] | None
    unit: float
    offset: float
    scale: float

    def slack(self, near_zero: float, t: np.ndarray | float) -> np.ndarray | float:
        """How far an end at t may be off; near_zero: added to the size of p."""
        if self.slope is None:
            return END_ROUNDING + 0 * t
        return END_ROUNDING * (np.abs(self.out(t)) + near_zero) / self.slope(t)


def _variable_of(low: float, high: float, variable: str) -> _Variable:
    """The variable for a span, see `regions_along_any`."""
    if variable == BENT:
        unit = (high - low) / BENT_AT

        def into(p: np.ndarray | float) -> np.ndarray | float:
            return np.log1p((p - low) / unit)

        def out(t: np.ndarray | float) -> np.ndarray | float:
            return low + unit * np.expm1(t)

        def slope(t: np.ndarray | float) -> np.ndarray | float:
            return unit * np.exp(t)

        return _Variable(into, out, slope, unit, low - unit, unit)
    if low > 0 and high > LOGARITHMIC_RATIO * low:
        return _Variable(np.log, np.exp, None, low, 0.0, 1.0)
    return _Variable(_same, _same, np.ones_like, np.inf, 0.0, 0.0)


def _same(p: np.ndarray | float) -> np.ndarray | float:
    return p


def _in_variable(
    balls: Callable[..., Any], into: Callable[..., Any], out: Callable[..., Any]
) -> Callable[..., Any] | None:
    """`balls` for ends in the variable."""

    def proved_there(
        column: int, low: float, high: float
    ) -> list[tuple[float, float, float, float]] | None:
        a = float(out(low))
        b = float(out(high))
        intervals = balls(column, a, b)
        if intervals is None:
            return None
        exact = {a: low, b: high}
        in_variable = []
        for first, last, *rest in intervals:
            ends = [exact.get(end, float(into(end))) for end in (first, last)]
            in_variable.append((*ends, *rest))
        return in_variable

    return proved_there


@dataclass(frozen=True, slots=True)
class _Search:
    """What is asked of columns of a family in the variable t: see `regions_along_any`. span: of t.
    slack(t): how far an end may be off."""

    family: ParametricFrames
    variable: _Variable
    span: tuple[float, float]
    slack: Callable[..., Any]
    balls: Callable[..., Any] | None
    from_one: bool

    def at(self, function: Callable[..., Any], column: np.ndarray, t: np.ndarray) -> Any:
        """The value of a function of columns and of the number, at values of the variable."""
        with np.errstate(over="ignore"):  # beside the largest doubles
            p = self.variable.out(t)
        return function(column, p)

    def all_regions(self, bounds: np.ndarray, order: int) -> Regions:
        """The regions of all columns, some at a time; bounds: `(2, columns)`; order: of the frames."""
        # Of the polynomials of columns at a time, as far as their panels are two.
        few = max(1, 2**21 // (2 * (DEGREES[-1] + 1) * order**2))
        portions = []
        for first in range(0, self.family.columns, few):
            names = np.arange(first, min(first + few, self.family.columns))
            portions.append(self.regions(names, bounds[:, names]))
        return Regions.join(portions)

    def regions(self, names: np.ndarray, bounds: np.ndarray) -> Regions:
        """The regions of some columns."""
        of_columns = _InEvenUnits.of(self, names)
        points = of_columns.points
        columns = names.size
        resolved = None
        if self.family.resolved is not None:
            resolved = partial(self._resolved, self.family.resolved, names)
        order = of_columns.ratio.shape[-1]
        panels, lost = panels_of(
            of_columns.frames, of_columns.errors, self.span, columns, bounds, resolved, order
        )
        parts = [Tiles.of(np.zeros(0, int), np.zeros(0), np.zeros(0), 0)]
        for reduced, states in [] if panels is None else panels.without_forgotten():
            errors = partial(_of_states, of_columns.errors, states)
            tight = partial(_of_states, of_columns.tight, states)
            tiles = tiles_by_lines(reduced, errors, points, self.span, self.slack)
            if tiles is None:
                functions = errors, tight
                tiles = tiles_of(
                    reduced, functions, self.span, columns, self.slack, from_one=self.from_one
                )
            parts.append(tiles)
        tiles = Tiles.join(parts)
        attached = self.slack(self.span[0]), self.slack(self.span[1])
        prove = self.balls
        if prove is not None:

            def balls(
                column: int, low: float, high: float
            ) -> list[tuple[float, float, float, float]]:
                return prove(int(names[column]), low, high)

            tiles, lost = proved_by_balls(tiles, lost, self.span, columns, attached, balls)
        regions = regions_of(tiles, lost, self.span, columns, attached)
        return replace(regions, column=names[regions.column])

    def _resolved(
        self,
        resolved: Callable[..., np.ndarray],
        names: np.ndarray,
        column: np.ndarray,
        low: np.ndarray,
        high: np.ndarray,
    ) -> np.ndarray:
        """Whether frames have no narrow features for the variable from low to high."""
        offset = self.variable.offset
        scale = self.variable.scale
        return resolved(names[column], low, high, offset, scale)


@dataclass(frozen=True, slots=True)
class _InEvenUnits:
    """The frames of some columns of a search in units of the states in which no entry is large, see
    `uneven_units`.

    points: of the span, at which the units were found. ratio: what an entry (i, j) is multiplied
    by, `(columns, n, n)`; plain: whether it is 1.
    """

    search: _Search
    names: np.ndarray
    points: np.ndarray
    ratio: np.ndarray
    plain: bool

    @classmethod
    def of(cls, search: _Search, names: np.ndarray) -> _InEvenUnits:
        low, high = search.span
        # Of the span, where the units of the states are found; not the middle, which may be 0.
        points = low + (high - low) * np.array((0.53, 0.37, 0.71, 0.013, 0.987))
        columns = names.size
        column = np.arange(columns)[:, None]
        sampled = search.at(search.family.frames, names[column], np.tile(points, (columns, 1)))
        E = Frames.of(sampled).E
        E = np.where(np.isfinite(E).all((1, 2), keepdims=True), E, 0.0)
        sizes = np.abs(E).reshape(columns, points.size, *E.shape[1:])
        # Frames that grow are large in any units.
        calmest = np.where(sizes.any((2, 3)), sizes.max((2, 3)), np.inf).argmin(1)
        units = uneven_units(sizes[range(columns), calmest])
        if E.shape[-1] >= LONG_LINES:
            for line in DelayLines.of(E).lines:  # which then take over values as they are
                units[:, line] = units[:, line[:1]]
        ratio = units[:, None, :] / units[:, :, None]
        return cls(search, names, points, ratio, not (units != 1).any())

    def _scaled(self, E: np.ndarray, column: np.ndarray, t: np.ndarray) -> np.ndarray:
        if self.plain:
            return E
        factors = self.ratio[np.broadcast_to(column, t.shape).ravel()]
        return E * factors if E.shape[-1] == factors.shape[-1] else np.full_like(E, np.nan)

    def frames(self, column: np.ndarray, t: np.ndarray) -> Frames:
        """The frames of columns, counted from 0, at values of the variable."""
        sampled = self.search.at(self.search.family.frames, self.names[column], t)
        sampled = Frames.of(sampled)
        return replace(sampled, E=self._scaled(sampled.E, column, t))

    def errors(self, column: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same, each by itself, with bounds on the errors of entries."""
        return self._with_bounds(self.search.family.with_errors, column, t)

    def tight(self, column: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same with tight bounds."""
        return self._with_bounds(self.search.family.with_tight_errors, column, t)

    def _with_bounds(
        self, function: Callable[..., Any], column: np.ndarray, t: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        column, t = np.broadcast_arrays(column, t)
        E, bounds = self.search.at(function, self.names[column.ravel()], t.ravel())
        return self._scaled(E, column, t), self._scaled(bounds, column, t)


def _of_states(
    errors: Callable[..., Any], states: np.ndarray, column: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Frames and bounds on their errors, of some of the states alone."""
    E, bounds = errors(column, t)
    return E[:, states[:, None], states], bounds[:, states[:, None], states]
