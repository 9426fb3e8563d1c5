"""The spans of columns covered by proofs of dominance, and by windows about the crossings that
these leave open."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from wavesweep.engine._stability.dominance import DominanceTests, ExactFrames
from wavesweep.engine._stability.entries import FramesOf, Panels, nodes, sizes_of
from wavesweep.engine._stability.leaving_one import proved_from_one
from wavesweep.engine._stability.tiles import OVERLAID, WINDOW, Tiles
from wavesweep.engine.doubles import EPS, FEW_ROUNDINGS
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows, of_each

# Tests next to crossings. Lengths on a panel are in halves of it.
NEXT_TO = 1e-4  # from a place to a crossing so near to it that both sides are proved from there
MOST_STEPS = 5  # of a place towards a crossing on the panel's polynomials
WITH_TIGHT_ERRORS = 2  # windows that were tried, from which on frames have tight bounds
MOST_WINDOWS = 6  # that are tried about a crossing

# Half of a window about a crossing. It is a part of what an end may be off, so small that an end
# anywhere in the window is as exact as promised. The low end of the span stands for each crossing so
# near to it: there the part is nearly all. It is also so many times what errors of entries move the
# crossing by, beyond which the sides have to be proved.
HALF_WINDOW = 0.1
AT_LOW_END = 0.9
WINDOW_OF_ERRORS = 2.5
# A window whose sides are not proved even with tight errors gets wider with every try, up to so much.
WINDOW_WIDENED = 2.0
WIDEST_WINDOW = 1e-3
# Crossings that are nearer to each other than so many halves of a window share one: less than half a
# window would be left between two.
MERGED = 3
# About a window that is not proved at last, a stretch of more than so many widths of the window is
# tried again from elsewhere; else so many widths to each side are given up.
RETRIED = 1e3
GIVEN_UP = 32
# Of the way to the edge of a stretch, tried in turn.
SHARES_OF_WAY = 1, 0.8, 0.64, 0.45, 0.27, 0.13, 0.05, 0.02, 0.004, 5e-4, 3e-5
SHORTEST_STRETCH = 1e-3  # of what an end may be off: a stretch so short is given up

# What is spent.
MOST_TESTS = 1000  # of a column
TESTS_OF_PANEL = 40  # and as many more for each of its panels
MOST_ROUNDS = 150  # of all columns together
FULL, LEAST = 24, 100  # states, beyond which fewer tests are spent; so many at least
CELLS = 32  # of a panel, in each of which traces may prove that the loop is unstable

Slack = Callable[..., Any]  # how far an end may be off at values of the parameter, of their shape


@dataclass(frozen=True, slots=True)
class _OpenStretches(Rows):
    """Stretches of panels to be proved, each from low to high, and the test that is next, at a place.

    steps: of the place towards where an eigenvalue seems to cross: 0 of any place, 1 of one that is
    put there at first; with more than MOST_STEPS no other step is made. windows: that were tried
    about the crossing next to the place. beyond: whether the crossing of a short stretch turned out
    to be outside of it, so that no window reaches into it.

    A place makes steps until it is next to the crossing. Then a window about the crossing is tried.
    If its sides are not proved, or it is wider than ends may be off, it is tried again: with the
    frame at the place itself, with tight bounds on the errors of that, and wider each time.
    """

    panel: np.ndarray
    low: np.ndarray
    high: np.ndarray
    place: np.ndarray
    steps: np.ndarray
    windows: np.ndarray
    beyond: np.ndarray

    @property
    def is_exact(self) -> np.ndarray:
        """Whether the frame at the place itself is taken."""
        return self.beyond | (self.windows > 0)

    @property
    def is_tight(self) -> np.ndarray:
        """Whether that has tight bounds on its errors."""
        return self.beyond | (self.windows >= WITH_TIGHT_ERRORS)


def tiles_of(
    panels: Panels,
    errors: tuple[FramesOf, FramesOf],
    span: tuple[float, float],
    columns: int,
    slack: Slack,
    *,
    from_one: bool = False,
) -> Tiles:
    """Return the tiles that could be proved; errors: with tight ones; these, slack, from_one:
    see `regions_along_any`."""
    unstable, open_ = _unstable_by_traces(panels)
    done = [unstable]
    if from_one:
        beside, open_ = _beside_one(panels, errors[1], span[0], open_)
        done.append(beside)
    share = min(
        1.0, (FULL / panels.error.shape[-1]) ** 3
    )  # a test takes as long as a few products of matrices
    panels_of_column = np.bincount(panels.column, minlength=columns)
    tests_left = np.maximum(LEAST, share * (MOST_TESTS + TESTS_OF_PANEL * panels_of_column))
    for _ in range(MOST_ROUNDS):
        column = panels.column[open_.panel]
        np.subtract.at(tests_left, column, 1)
        open_ = open_.take(tests_left[column] >= 0)
        if not open_.panel.size:
            break
        with np.errstate(all="ignore"):
            proved, open_ = _Round.of(panels, errors, span, slack, open_).results()
        done += proved
    return _with_ends_in_gaps(Tiles.join(done), errors[0], slack)


def _beside_one(
    panels: Panels, errors: FramesOf, low: float, open_: _OpenStretches
) -> tuple[Tiles, _OpenStretches]:
    """The tiles next to the low end of the span, where an eigenvalue is 1, and what is left
    open."""
    first = np.flatnonzero(open_.low == low)
    if not first.size:
        return Tiles.of(first, np.zeros(0), np.zeros(0), 0), open_
    panel = open_.panel[first]
    reached, outside = proved_from_one(panels, panel, errors, low)
    proved = reached > low
    begin = open_.low.copy()
    begin[first] = np.minimum(reached, open_.high[first])
    tiles = Tiles.of(panels.column[panel], np.full(panel.size, low), begin[first], outside)
    beyond = replace(open_, low=begin, place=(begin + open_.high) / 2)
    return tiles.take(proved), beyond.take(begin < open_.high)


def _with_ends_in_gaps(tiles: Tiles, errors: FramesOf, slack: Slack) -> Tiles:
    """Add windows where a gap between a stable and an unstable tile is as narrow as ends are exact:
    the end is in it.

    So it is where two eigenvalues meet on the circle, which are known to the root of rounding only.
    """
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    before = tiles.outside[:-1]
    after = tiles.outside[1:]
    gap = tiles.low[1:] - tiles.high[:-1]
    same_column = np.diff(tiles.column) == 0
    ending = (np.minimum(before, after) == 0) & (np.maximum(before, after) > 0)
    narrow = (gap > 0) & (gap <= slack(tiles.high[:-1]))
    gaps = np.flatnonzero(same_column & ending & narrow)
    if not gaps.size:
        return tiles
    column = tiles.column[gaps]
    low = tiles.high[gaps]
    high = tiles.low[gaps + 1]
    value = (low + high) / 2
    E, _ = errors(column, value)
    z = 1 + np.linalg.eigvals(np.nan_to_num(E))
    nearest = np.take_along_axis(z, np.abs(np.abs(z) - 1).argmin(1)[:, None], 1)[:, 0]
    theta = np.abs(np.angle(nearest))
    ends = Tiles(
        column, low, high, WINDOW + 0 * column, value, theta, high - low, Doubt.NONE + 0 * column
    )
    return Tiles.join([tiles, ends])


def _large_traces(panels: Panels) -> np.ndarray:
    """Whether `|tr A| > n` or `|tr A A| > n` for all values in each cell of panels, `(panels, CELLS)`."""
    n = panels.error.shape[-1]
    degree = panels.coefficients.shape[1] - 1
    number = np.arange(panels.low.size)
    proved = np.zeros((number.size, CELLS), bool)
    with np.errstate(all="ignore"):
        large = (np.abs(_traces(panels.coefficients, np.linspace(-1, 1, 5))) > n).any((0, 2))
        candidates = np.flatnonzero(large)
        coefficients = panels.coefficients
        if candidates.size < number.size:  # else a copy is spared
            coefficients = coefficients[candidates]
        points, transform = nodes(2 * degree)
        size = np.eye(n) + sizes_of(coefficients)
        error = panels.error[candidates] + 8 * degree * EPS * size
        of_trace = np.trace(error, axis1=1, axis2=2)
        of_square = np.einsum("pij,pji->p", 2 * size + error, error)
        for trace, off in zip(_traces(coefficients, points), (of_trace, of_square), strict=True):
            # Its Chebyshev series on each cell: the first coefficient less the sizes of all others
            # is the least there.
            on_cells = np.einsum("ckl,pl->pck", _restrictions(2 * degree), trace @ transform.T)
            least = np.abs(on_cells[..., 0]) - np.abs(on_cells[..., 1:]).sum(-1)
            proved[candidates] |= least > n + off[:, None]
    return proved


def _unstable_by_traces(panels: Panels) -> tuple[Tiles, _OpenStretches]:
    """Tiles in which some eigenvalue is outside, as its trace, or that of its square, is above n in
    size for all values there, and what is left open.

    Far beyond the stable values entries are large and turn fast with the number, which would take
    thousands of tests.
    """
    proved = _large_traces(panels)
    edges = panels.middle[:, None] + panels.half[:, None] * np.linspace(-1, 1, CELLS + 1)
    edges = np.clip(edges, panels.low[:, None], panels.high[:, None])
    edges[:, [0, -1]] = np.stack([panels.low, panels.high], 1)
    # Neighbouring cells that are alike are one stretch.
    first = np.diff(proved, axis=1, prepend=~proved[:, :1])
    last = np.append(first[:, 1:], np.full((len(proved), 1), True), axis=1)
    panel = np.nonzero(first)[0]
    low = edges[:, :-1][first]
    high = edges[:, 1:][last]
    done = proved[first] & (high > low)
    undecided = ~proved[first] & (high > low)
    tiles = Tiles.of(panels.column[panel[done]], low[done], high[done], 1)
    none = 0 * panel
    open_ = _OpenStretches(panel, low, high, (low + high) / 2, none, none, none > 0)
    return tiles, open_.take(undecided)


def _traces(coefficients: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return `tr A` and `tr A A` at places x of panels, `(2, panels, places)`."""
    m, k, n, _ = coefficients.shape
    T = chebyshev.chebvander(x, k - 1)
    traces = np.zeros((2, m, x.size))
    # Entries of matrices at a time, of which traces are taken.
    portion = max(1, 2**20 // (x.size * n * n))
    for first in range(0, m, portion):
        index = slice(first, first + portion)
        E = (T @ coefficients[index].reshape(-1, k, n * n)).reshape(-1, x.size, n, n)
        A = np.eye(n) + E
        traces[0, index] = np.trace(A, axis1=2, axis2=3)
        traces[1, index] = np.einsum("pxij,pxji->px", A, A)
    return traces


@cache
def _restrictions(degree: int) -> np.ndarray:
    """Chebyshev coefficients on each cell of [-1, 1] of the Chebyshev polynomials, `(CELLS,
    degree + 1, degree + 1)`."""
    x, transform = nodes(degree)
    middles = (np.arange(CELLS) + 0.5) * 2 / CELLS - 1
    return transform @ chebyshev.chebvander(middles[:, None] + x / CELLS, degree)


@dataclass(frozen=True, slots=True)
class _Nearest:
    """Of each test the eigenvalue that crosses nearest to its place, as it seems.

    h: of the crossing, in halves of a panel from the place; value: of the parameter there. unsure:
    bound on the eigenvalue's error; slope: of its distance from the circle; theta: its angle at the
    crossing. miss: see `Tiles`.
    """

    h: np.ndarray
    value: np.ndarray
    unsure: np.ndarray
    slope: np.ndarray
    theta: np.ndarray
    miss: np.ndarray

    @classmethod
    def of(
        cls, models: DominanceTests, roots: np.ndarray, place: np.ndarray, half: np.ndarray
    ) -> _Nearest:
        index = np.argmin(np.abs(roots), 1)

        h = of_each(roots, index)
        unsure = of_each(models.unsure, index)
        slope = of_each(models.slope, index)
        miss = unsure / np.maximum(1, np.abs(slope * place) / half)
        return cls(h, place + half * h, unsure, slope, models.angle(index, h), miss)


def _windows(
    crossing: _Nearest,
    span: tuple[float, float],
    slack: Slack,
    half: np.ndarray,
    open_: _OpenStretches,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Windows about crossings: whether the crossing counts as an end of the span, -1 or 1; half of
    the window, in halves of a panel; and whether it is wider than an end may be off.

    About a crossing at h of an eigenvalue that is known to u, and whose distance from the circle
    changes by s a half panel, the window is from `h - e` to `h + e` with `e = max(c d, 2.5 u/|s|)
    2^t`: d is what an end may be off, c HALF_WINDOW or AT_LOW_END, and t the number of windows that
    were tried with tight errors.
    """
    low, high = (np.maximum(slack(end), FEW_ROUNDINGS * np.abs(end)) for end in span)
    at_end = np.where(crossing.value - span[0] <= low, -1, 0)
    at_end[span[1] - crossing.value <= high] = 1
    d = slack(open_.place)
    d = np.where(at_end < 0, np.maximum(d, low), d) / half
    moved = crossing.unsure / np.abs(crossing.slope)
    c = np.where(at_end < 0, AT_LOW_END, HALF_WINDOW)
    narrowest = np.maximum(c * d, WINDOW_OF_ERRORS * moved)
    tries = np.where(open_.beyond, 0, np.maximum(open_.windows - WITH_TIGHT_ERRORS, 0))
    e = np.fmin(narrowest * WINDOW_WIDENED**tries, WIDEST_WINDOW)
    return at_end, e, (moved > d) | (e > WINDOW_OF_ERRORS * d)


@dataclass(frozen=True, slots=True)
class _Sides:
    """The places from which on both sides of tests are proved, and how far they are.

    inner: the two ends next to the place, or those of the window about a crossing; reached: how far
    it is proved from these; proved: whether that is any way at all; outside: number of eigenvalues
    outside there. Each is a pair, below and above.
    """

    inner: list[np.ndarray]
    reached: list[np.ndarray]
    proved: list[np.ndarray]
    outside: list[np.ndarray]


@dataclass(frozen=True, slots=True)
class _Round:
    """One test of each open stretch: what it proves, and what is left open.

    A test whose place is next to a crossing proves both sides of it, from a window about it on; one
    that is on its way there proves nothing; any other proves what it can on both sides of its
    place.

    models: the eigenvalues about the places (see `DominanceTests`), as functions of h, the distance
    in halves of a panel; radius: of the circle that they are held against; pad: to what a place is
    known. crossing: the nearest one; at_end: -1 or 1 if that counts as an end of the span. closing,
    toward: whether a test is next to a crossing, or on its way there. begin: the h from which on
    both sides are proved, so the window is between; roots: the h of all other crossings. rough:
    whether the window is wider than ends may be off; overlaid: whether another eigenvalue is
    outside in it. short: lengths that are given up.
    """

    open: _OpenStretches
    span: tuple[float, float]
    column: np.ndarray
    half: np.ndarray
    pad: np.ndarray
    short: np.ndarray
    models: DominanceTests
    radius: np.ndarray
    crossing: _Nearest
    at_end: np.ndarray
    closing: np.ndarray
    toward: np.ndarray
    begin: tuple[np.ndarray, np.ndarray]
    roots: np.ndarray
    rough: np.ndarray
    overlaid: np.ndarray

    @classmethod
    def of(
        cls,
        panels: Panels,
        errors: tuple[FramesOf, FramesOf],
        span: tuple[float, float],
        slack: Slack,
        open_: _OpenStretches,
    ) -> _Round:
        """The tests at the places of stretches; crossings within MERGED e of another share its
        window, see `_windows`."""
        place = open_.place
        column = panels.column[open_.panel]
        half = panels.half[open_.panel]
        pad = FEW_ROUNDINGS * np.abs(span).max() / half
        length = (open_.high - open_.low) / half
        x = (place - panels.middle[open_.panel]) / half
        exact = _exact_frames(errors, column, open_, panels.error.shape[-1])
        models = DominanceTests.of(panels, open_.panel, x, pad, length / 2, exact)
        radius = models.radius()
        roots = models.crossings()
        crossing = _Nearest.of(models, roots, place, half)
        h = crossing.h

        at_end, eps, rough = _windows(crossing, span, slack, half, open_)
        # 0.51, NEXT_TO and 0.3 only choose what is tried and where; what is proved does not rest on
        # them.
        middle = (open_.low + open_.high - 2 * place) / half / 2
        inside = (np.abs(h - middle) <= 0.51 * length) & (radius == 1)
        closing = inside & (np.abs(h) <= NEXT_TO)
        closing &= (h + eps > (open_.low - place) / half) & (h - eps < (open_.high - place) / half)
        within = (crossing.value > open_.low) & (crossing.value < open_.high)
        closing &= within | ~open_.beyond
        under_way = (open_.steps > 0) & (open_.steps <= MOST_STEPS)
        toward = inside & ~closing & under_way & (np.abs(h) < 0.3 * length)

        closed = closing[:, None] & (np.abs(roots - h[:, None]) < MERGED * eps[:, None])
        below = np.where(closed, roots, np.inf).min(1) - eps
        above = np.where(closed, roots, -np.inf).max(1) + eps
        return cls(
            open_,
            span,
            column,
            half,
            pad,
            short=SHORTEST_STRETCH * slack(place),
            models=models,
            radius=radius,
            crossing=crossing,
            at_end=at_end,
            closing=closing,
            toward=toward,
            begin=(np.where(closing, below, 0.0), np.where(closing, above, 0.0)),
            roots=np.where(closed, np.inf, roots),
            rough=rough,
            overlaid=((models.excess > 0) & ~closed).any(1),
        )

    def results(self) -> tuple[list[Tiles], _OpenStretches]:
        """Return the new tiles, and the stretches that are open."""
        open_ = self.open
        sides = self._sides()
        below, above = sides.inner
        both_proved = (sides.proved[0] | (below <= open_.low)) & (
            sides.proved[1] | (above >= open_.high)
        )
        failed = self.closing & ~both_proved
        sharper = self.rough & ~open_.is_tight
        another = ~open_.beyond & (open_.windows < MOST_WINDOWS)
        again = self.closing & (failed | sharper) & another
        tiles = []
        for low, high, proved, outside in (
            (sides.reached[0], below, sides.proved[0], sides.outside[0]),
            (above, sides.reached[1], sides.proved[1], sides.outside[1]),
        ):
            new = proved & ~again
            tiles.append(Tiles.of(self.column[new], low[new], high[new], outside[new]))
        end_of_span = np.where(self.at_end < 0, *self.span)
        value = np.where(self.at_end != 0, end_of_span, np.clip(self.crossing.value, below, above))
        kind = np.where(self.overlaid, OVERLAID, WINDOW)
        doubt = np.where(self.rough, Doubt.ROUNDING, Doubt.NONE)
        windows = Tiles(
            self.column, below, above, kind, value, self.crossing.theta, self.crossing.miss, doubt
        )
        # else the crossing is beyond the stretch
        new = self.closing & ~failed & ~again & (below < above)
        return [*tiles, windows.take(new)], self._left_open(sides, failed, again)

    def _sides(self) -> _Sides:
        """What is proved on both sides."""
        open_ = self.open
        inner = []
        for h in self.begin:
            of_window = np.clip(open_.place + self.half * h, open_.low, open_.high)
            inner.append(np.where(self.closing, of_window, open_.place))
        reached, outside = self._reached(inner)
        return _Sides(inner, reached, [reached[0] < inner[0], reached[1] > inner[1]], outside)

    def _left_open(self, sides: _Sides, failed: np.ndarray, again: np.ndarray) -> _OpenStretches:
        """The stretches that are open after a test: the same with a place next to the crossing, or
        what is left on both sides.

        failed: windows that are not proved; again: tests to be repeated.
        """
        open_ = self.open
        a = open_.low
        b = open_.high
        place = open_.place
        below, above = sides.inner
        moving = self.toward | again
        moved = replace(
            open_,
            place=np.clip(self.crossing.value, a, b),
            steps=np.where(again, MOST_STEPS + 1, open_.steps + 1),
            windows=open_.windows + again,
        )
        stretches = [moved.take(moving)]
        width = above - below
        halved = failed & (b - a > RETRIED * width)  # from elsewhere it may succeed
        given_up = np.where(failed & ~halved, GIVEN_UP * width, 0.0)
        low = np.where(sides.proved[0], sides.reached[0], sides.reached[0] - given_up)
        high = np.where(sides.proved[1], sides.reached[1], sides.reached[1] + given_up)
        undecided = (
            (a, low, -1),
            (high, b, 1),
            (below, np.where(halved, place, below), 0),
            (place, np.where(halved, above, place), 0),
        )
        for begin, end, sign in undecided:
            long = np.flatnonzero((end - begin > self.short) & ~moving)
            proved_end = end if sign < 0 else begin
            gone = np.abs(proved_end - place)[long]
            stretches.append(self._rest(long, begin[long], end[long], sign, gone))
        return _OpenStretches.join(stretches)

    def _rest(
        self, index: np.ndarray, low: np.ndarray, high: np.ndarray, sign: int, gone: np.ndarray
    ) -> _OpenStretches:
        """What is left to one side, to be tested where an eigenvalue seems to cross, if that is
        near to what is proved."""
        before = self.open.take(index)
        length = high - low
        roots = self.roots[index]
        ahead = np.where(sign * roots > 0, np.abs(roots), np.inf).min(1) * self.half[index]
        # These numbers only choose the place; what is proved from there does not rest on them.
        place = before.place + sign * ahead
        trusted = (place > low - 0.05 * length) & (place < high + 0.05 * length)
        trusted &= ahead < np.maximum(3 * gone, 0.5 * length)
        trusted &= (self.radius[index] == 1) & (before.steps <= MOST_STEPS) & ~before.beyond
        place = np.where(trusted, np.clip(place, low, high), (low + high) / 2)
        crossing = self.crossing.value[index]
        missed = (crossing < before.low) | (crossing > before.high)
        short = length <= 2.5 * NEXT_TO * self.half[index]
        beyond = before.is_exact & missed & short
        steps = np.where(trusted, 1, 0)
        return _OpenStretches(before.panel, low, high, place, steps, 0 * steps, beyond)

    def _reached(self, inner: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """How far it is proved from the inner places on to both sides, and how many eigenvalues are
        outside there.

        Ever smaller shares of the way to the edge, or to the next crossing, are tried in turn.
        """
        of = np.tile(np.arange(self.half.size), 2)  # the tests of sides below, and of those above
        sign = np.repeat([-1.0, 1.0], self.half.size)
        edge = np.concatenate([self.open.low, self.open.high])
        begin = np.concatenate(self.begin)
        ends = np.concatenate(inner)
        outside = np.zeros(of.size, int)
        place = self.open.place[of]
        half = self.half[of]
        pad = sign * self.pad[of]
        whole = (edge - place) / half
        extent = np.clip(whole, -1, 1) - begin
        away = sign[:, None] * (self.roots[of] - begin[:, None])
        # The first try ends short of the next crossing, as nothing is proved across it.
        to_next = 0.9 * np.where(away > 0, away, np.inf).min(1) / np.abs(extent)
        first = np.where(self.radius[of] == 1, np.fmin(1, to_next), 1.0)
        todo = np.flatnonzero((sign * (edge - ends) > 0) & ~self.toward[of])
        for factor in SHARES_OF_WAY:
            if not todo.size:
                break
            test = of[todo]
            share = factor * first[todo]
            advance = share * extent[todo]
            start = np.where(begin[todo] == 0, 0.0, begin[todo] - pad[todo])
            stop = begin[todo] + advance + pad[todo]
            proved, count = self.models.prove(test, start, stop, self.radius[test])
            reached = place[todo] + half[todo] * (begin[todo] + advance)
            reached = np.clip(reached, self.open.low[test], self.open.high[test])
            short = (np.abs(whole[todo]) > 1) | (share < 1)  # of the edge
            reached = np.where(short, reached, edge[todo])
            ends[todo[proved]] = reached[proved]
            outside[todo[proved]] = count[proved]
            todo = todo[~proved]
        return np.split(ends, 2), np.split(outside, 2)


def _exact_frames(
    errors: tuple[FramesOf, FramesOf],
    column: np.ndarray,
    open_: _OpenStretches,
    n: int,
) -> ExactFrames:
    """The frames at places next to crossings."""
    tests = np.flatnonzero(open_.is_exact)
    tight = open_.is_tight[tests]
    E = np.empty((tests.size, n, n))
    off = np.empty((tests.size, n, n))
    for function, chosen in zip(errors, (~tight, tight), strict=True):
        if chosen.any():
            tested = tests[chosen]
            E[chosen], off[chosen] = function(column[tested], open_.place[tested])
    return ExactFrames(tests, E, off)
