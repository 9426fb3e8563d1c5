"""The spans of columns covered by proofs of dominance, and by windows about the crossings that these leave open."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows, different
from wavesweep.engine.stability.dominance import DominanceTests, ExactFrames
from wavesweep.engine.stability.entries import EPS, Panels, nodes, sizes_of
from wavesweep.engine.stability.leaving_one import proved_from_one
from wavesweep.engine.stability.regions import Regions

NEAR = 1e-4  # of half a panel, from a place to a crossing: how near the place is once both sides of it are proved from there
CROSSING = 6  # steps towards a crossing on the panel's polynomials; from then on the frame at the place itself is taken
BEYOND = 2 * CROSSING + 1  # steps of a short stretch whose crossing turned out to be beyond it: no window reaches into it
FIRM = 2.5  # times what the errors of entries move a crossing by: half of a window about it, at least
WIDENED, WIDEST = 2.0, 1e-3  # a window that is not proved even so gets wider with every try, up to this part of half a panel
RETRIED = 1e3  # widths of such a window, beyond which the stretch about it is tried again from elsewhere
GIVEN_UP = 32  # widths of a window that is not proved, which are given up to each side of it
MOST_TESTS, FOR_EACH, ROUNDS = 1000, 40, 150  # of a column, and for each of its panels; of all together
FULL, LEAST = 24, 100  # states, beyond which fewer tests are spent; so many at least
SHARES = (1, 0.8, 0.64, 0.45, 0.27, 0.13, 0.05, 0.02, 0.004, 5e-4, 3e-5)  # of the way that is wanted, tried in turn
FEW = 8  # stretches in doubt of a column, up to which each is proved by itself
TRACED = 2**20  # entries of matrices at a time, of which traces are taken
CELLS = 32  # of a panel, in each of which traces may prove that the loop is unstable
SHORT = 1e-3  # of what an end may be off: a stretch so short is given up
UNKNOWN, WINDOW, OVERLAID = -1, -2, -3  # in place of the number of eigenvalues outside


@dataclass(frozen=True, slots=True)
class Tiles(Rows):
    """Parts of the spans of columns.

    outside: number of eigenvalues outside the unit circle, or at least so many; UNKNOWN; WINDOW if some cross there, or
    OVERLAID if another one is outside meanwhile. value,
    theta, miss, doubt: of a window: the crossing; the eigenvalue's angle there; to what its distance from the circle is known,
    relative to what that changes by with the parameter if this is more; ROUNDING if the window is wider than ends may be off.
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    outside: np.ndarray
    value: np.ndarray
    theta: np.ndarray
    miss: np.ndarray
    doubt: np.ndarray

    @classmethod
    def of(cls, column, low, high, outside, doubt=Doubt.NONE) -> "Tiles":
        nothing = np.full(column.size, np.nan)
        return cls(column, low, high, outside + 0 * column, nothing, nothing, 0 * low, doubt + 0 * column)


@dataclass(frozen=True, slots=True)
class _OpenStretches(Rows):
    """Stretches of panels to be proved; place: where the next test is; steps: that were made towards a crossing."""

    panel: np.ndarray
    low: np.ndarray
    high: np.ndarray
    place: np.ndarray
    steps: np.ndarray


def tiles_of(panels: Panels, errors, span, columns: int, slack, *, from_one: bool = False) -> Tiles:
    """Return the tiles that could be proved; errors: with tight ones; these, slack, from_one: see `regions_along_any`."""
    unstable, open_ = _unstable_by_traces(panels)
    done = [unstable]
    if from_one:
        beside, open_ = _beside_one(panels, errors[1], span[0], open_)
        done.append(beside)
    share = min(1.0, (FULL / panels.error.shape[-1]) ** 3)  # a test takes as long as a few products of matrices
    left = np.maximum(LEAST, share * (MOST_TESTS + FOR_EACH * np.bincount(panels.column, minlength=columns)))
    for _ in range(ROUNDS):
        column = panels.column[open_.panel]
        np.subtract.at(left, column, 1)
        open_ = open_.take(left[column] >= 0)
        if not open_.panel.size:
            break
        with np.errstate(all="ignore"):
            proved, open_ = _Test(panels, errors, span, slack, open_).results()
        done += proved
    return _with_ends_in_gaps(Tiles.join(done), errors[0], slack)


def _beside_one(panels, errors, low, open_):
    """The tiles next to the low end of the span, where an eigenvalue is 1, and what is left open."""
    first = np.flatnonzero(open_.low == low)
    if not first.size:
        return Tiles.of(first, *np.zeros((2, 0)), 0), open_
    at = open_.panel[first]
    reached, outside = proved_from_one(panels, at, errors, low)
    begin, proved = open_.low.copy(), reached > low
    begin[first] = np.minimum(reached, open_.high[first])
    tiles = Tiles.of(panels.column[at], np.full(at.size, low), begin[first], outside).take(proved)
    left = replace(open_, low=begin, place=(begin + open_.high) / 2)
    return tiles, left.take(begin < open_.high)


def _with_ends_in_gaps(tiles, errors, slack):
    """Add windows where a gap between a stable and an unstable tile is as narrow as ends are exact: the end is in it.

    So it is where two eigenvalues meet on the circle, which are known to the root of rounding only.
    """
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    outside, gap = tiles.outside, tiles.low[1:] - tiles.high[:-1]
    ending = (np.minimum(outside[:-1], outside[1:]) == 0) & (np.maximum(outside[:-1], outside[1:]) > 0)
    at = np.flatnonzero((np.diff(tiles.column) == 0) & ending & (gap > 0) & (gap <= slack(tiles.high[:-1])))
    if not at.size:
        return tiles
    column, low, high = tiles.column[at], tiles.high[at], tiles.low[at + 1]
    value = (low + high) / 2
    z = 1 + np.linalg.eigvals(np.nan_to_num(next(iter(errors(column, value)))))
    nearest = np.take_along_axis(z, np.abs(np.abs(z) - 1).argmin(1)[:, None], 1)[:, 0]
    ends = Tiles(column, low, high, WINDOW + 0 * column, value, np.abs(np.angle(nearest)), high - low, Doubt.NONE + 0 * column)
    return Tiles.join([tiles, ends])


def _unstable_by_traces(panels):
    """Tiles in which some eigenvalue is outside, as `|tr A| > n` or `|tr A A| > n` for all values there, and what is left open.

    Far beyond the stable values entries are large and turn fast with the number, which would take thousands of tests.
    """
    n, degree, number = panels.error.shape[-1], panels.coefficients.shape[1] - 1, np.arange(panels.low.size)
    proved, x = np.zeros((number.size, CELLS), bool), np.linspace(-1, 1, 5)
    with np.errstate(all="ignore"):
        candidates = np.flatnonzero((np.abs(_traces(panels.coefficients, x)) > n).any((0, 2)))
        c = panels.coefficients if candidates.size == number.size else panels.coefficients[candidates]
        points, transform = nodes(2 * degree)
        size, traces = np.eye(n) + sizes_of(c), _traces(c, points)
        error = panels.error[candidates] + 8 * degree * EPS * size
        errors = np.trace(error, axis1=1, axis2=2), np.einsum("pij,pji->p", 2 * size + error, error)
        for trace, error in zip(traces, errors, strict=True):
            on_cells = np.einsum("ckl,pl->pck", _restrictions(2 * degree), trace @ transform.T)
            least = np.abs(on_cells[..., 0]) - np.abs(on_cells[..., 1:]).sum(-1)
            proved[candidates] |= least > n + error[:, None]
    edges = panels.middle[:, None] + panels.half[:, None] * np.linspace(-1, 1, CELLS + 1)
    edges = np.clip(edges, panels.low[:, None], panels.high[:, None])
    edges[:, [0, -1]] = np.stack([panels.low, panels.high], 1)
    # Neighbouring cells that are alike are one stretch.
    first = np.diff(proved, axis=1, prepend=~proved[:, :1])
    last = np.append(first[:, 1:], np.full((number.size, 1), True), axis=1)
    panel, low, high = np.nonzero(first)[0], edges[:, :-1][first], edges[:, 1:][last]
    done, left = ((proved[first] == kind) & (high > low) for kind in (True, False))
    open_ = _OpenStretches(panel, low, high, (low + high) / 2, 0 * panel).take(left)
    return Tiles.of(panels.column[panel[done]], low[done], high[done], 1), open_


def _traces(coefficients, x):
    """Return `tr A` and `tr A A` at places x of panels, `(2, panels, places)`."""
    (m, k, n, _), T = coefficients.shape, chebyshev.chebvander(x, coefficients.shape[1] - 1)
    traces, portion = np.zeros((2, m, x.size)), max(1, TRACED // (x.size * n * n))
    for index in (slice(first, first + portion) for first in range(0, m, portion)):
        A = np.eye(n) + (T @ coefficients[index].reshape(-1, k, n * n)).reshape(-1, x.size, n, n)
        traces[:, index] = np.trace(A, axis1=2, axis2=3), np.einsum("pxij,pxji->px", A, A)
    return traces


@cache
def _restrictions(degree):
    """Chebyshev coefficients on each cell of [-1, 1] of the Chebyshev polynomials, `(CELLS, degree + 1, degree + 1)`."""
    x, transform = nodes(degree)
    cells = (np.arange(CELLS) + 0.5) * 2 / CELLS - 1
    return transform @ chebyshev.chebvander(cells[:, None] + x / CELLS, degree)


class _Test:
    """One test of each open stretch: what it proves, and what is left open.

    A test whose place is next to a crossing proves both sides of it, from a window about it on; one that is on its way there
    proves nothing; any other proves what it can on both sides of its place.

    models: the eigenvalues about the places (see `DominanceTests`), as functions of h, the distance in halves of a panel;
    radius: of the circle that they are held against. crossing, theta: where the nearest one seems to cross, and its angle
    there; at_end: -1 or 1 if that counts as an end of the span. closing, toward: whether a test is next to a crossing, or on
    its way there. begin: the h from which on both sides are proved, so the window is between; roots: the h of all other
    crossings. rough: whether the window is wider than ends may be off; overlaid: whether another eigenvalue is outside in it.
    """

    def __init__(self, panels, errors, span, slack, open_):
        self.open, self.span, self.column = open_, span, panels.column[open_.panel]
        self.half, self.n = panels.half[open_.panel], panels.error.shape[-1]
        half = self.half
        exact = self._exact(errors)
        self.short = SHORT * slack(open_.place)
        self.pad = 4 * EPS * np.abs(span).max() / half
        length = (open_.high - open_.low) / half
        x = (open_.place - panels.middle[open_.panel]) / half
        self.models = DominanceTests.of(panels, open_.panel, x, self.pad, length / 2, exact)
        self.radius, roots = self.models.radius(), self.models.crossings()
        nearest = np.argmin(np.abs(roots), 1)[:, None]
        h, unsure, slope = (np.take_along_axis(a, nearest, 1)[:, 0] for a in (roots, self.models.unsure, self.models.slope))
        self.theta = self.models.angle(nearest[:, 0], h)
        self.miss = unsure / np.maximum(1, np.abs(slope * open_.place) / half)
        self.crossing = open_.place + half * h
        low, high = (np.maximum(slack(end), 4 * EPS * np.abs(end)) for end in span)
        self.at_end = np.where(self.crossing - span[0] <= low, -1, 0)
        self.at_end[span[1] - self.crossing <= high] = 1
        # The window: eps to both sides of the crossing, and of those that are within three of these.
        off = np.where(self.at_end < 0, np.maximum(slack(open_.place), low), slack(open_.place)) / half
        eps = np.maximum(np.where(self.at_end < 0, 0.9, 0.1) * off, FIRM * unsure / np.abs(slope))
        tries = np.where(open_.steps < BEYOND, np.maximum(open_.steps - CROSSING - 2, 0), 0)
        eps = np.fmin(eps * WIDENED**tries, WIDEST)
        inside = (np.abs(h - (open_.low + open_.high - 2 * open_.place) / half / 2) <= 0.51 * length) & (self.radius == 1)
        self.closing = inside & (np.abs(h) <= NEAR) & (h + eps > (open_.low - open_.place) / half)
        self.closing &= h - eps < (open_.high - open_.place) / half
        self.closing &= (open_.steps < BEYOND) | ((self.crossing > open_.low) & (self.crossing < open_.high))
        self.toward = inside & ~self.closing & (open_.steps > 0) & (open_.steps < CROSSING) & (np.abs(h) < 0.3 * length)
        closed = self.closing[:, None] & (np.abs(roots - h[:, None]) < 3 * eps[:, None])
        self.roots = np.where(closed, np.inf, roots)
        ends = np.where(closed, roots, np.inf).min(1) - eps, np.where(closed, roots, -np.inf).max(1) + eps
        self.begin = [np.where(self.closing, end, 0.0) for end in ends]
        self.rough = (unsure / np.abs(slope) > off) | (eps > FIRM * off)
        self.overlaid = ((self.models.excess > 0) & ~closed).any(1)

    def _exact(self, errors):
        """The frames at the places next to crossings; from the second time on with tight bounds."""
        tests = np.flatnonzero(self.open.steps > CROSSING)
        n, again = self.n, self.open.steps[tests] > CROSSING + 1
        E, off = np.empty((2, tests.size, n, n))
        for function, chosen in zip(errors, (~again, again), strict=True):
            if chosen.any():
                at = tests[chosen]
                E[chosen], off[chosen] = function(self.column[at], self.open.place[at])
        return ExactFrames(tests, E, off)

    def results(self):
        """Return the new tiles, and the stretches that are open."""
        open_, a, b = self.open, self.open.low, self.open.high
        inner = [np.where(self.closing, np.clip(open_.place + self.half * h, a, b), open_.place) for h in self.begin]
        (left, right), outside = self._reached(inner)
        proved = left < inner[0], right > inner[1]
        failed = self.closing & ~((proved[0] | (inner[0] <= a)) & (proved[1] | (inner[1] >= b)))
        again = self.closing & (failed | (self.rough & (open_.steps <= CROSSING + 1))) & (open_.steps < 2 * CROSSING)
        tiles = []
        for side, (low, high) in enumerate(((left, inner[0]), (inner[1], right))):
            new = proved[side] & ~again
            tiles.append(Tiles.of(self.column[new], low[new], high[new], outside[side][new]))
        value = np.where(self.at_end != 0, np.where(self.at_end < 0, *self.span), np.clip(self.crossing, *inner))
        kind, doubt = np.where(self.overlaid, OVERLAID, WINDOW), np.where(self.rough, Doubt.ROUNDING, Doubt.NONE)
        windows = Tiles(self.column, *inner, kind, value, self.theta, self.miss, doubt)
        new = self.closing & ~failed & ~again & (inner[0] < inner[1])  # else the crossing is beyond the stretch
        return [*tiles, windows.take(new)], self._left_open(inner, (left, right), proved, failed, again)

    def _left_open(self, inner, reached, proved, failed, again):
        """The stretches that are open after a test: the same with a place next to the crossing, or what is left on both sides.

        inner, reached: ends of what is proved on each side; failed: windows that are not proved; again: tests to be repeated.
        """
        open_, a, b, place = self.open, self.open.low, self.open.high, self.open.place
        moving = self.toward | again
        steps = np.where(again, np.maximum(open_.steps, CROSSING), open_.steps) + 1
        stretches = [_OpenStretches(open_.panel, a, b, np.clip(self.crossing, a, b), steps).take(moving)]
        halved = failed & (b - a > RETRIED * (inner[1] - inner[0]))  # from elsewhere it may succeed
        beyond = np.where(failed & ~halved, GIVEN_UP * (inner[1] - inner[0]), 0.0)
        low = np.where(proved[0], reached[0], reached[0] - beyond)
        high = np.where(proved[1], reached[1], reached[1] + beyond)
        sides = (
            (a, low, -1),
            (high, b, 1),
            (inner[0], np.where(halved, place, inner[0]), 0),
            (place, np.where(halved, inner[1], place), 0),
        )
        for low, high, sign in sides:
            long = np.flatnonzero((high - low > self.short) & ~moving)
            gone = np.abs((high if sign < 0 else low) - place)[long]
            stretches.append(self._rest(long, low[long], high[long], sign, gone))
        return _OpenStretches.join(stretches)

    def _rest(self, index, low, high, sign, gone):
        """What is left to one side, to be tested where an eigenvalue seems to cross, if that is near to what is proved."""
        roots, length = self.roots[index], high - low
        ahead = np.where(sign * roots > 0, np.abs(roots), np.inf).min(1) * self.half[index]
        place = self.open.place[index] + sign * ahead
        trusted = (place > low - 0.05 * length) & (place < high + 0.05 * length) & (ahead < np.maximum(3 * gone, 0.5 * length))
        trusted &= (self.radius[index] == 1) & (self.open.steps[index] < CROSSING)
        place = np.where(trusted, np.clip(place, low, high), (low + high) / 2)
        crossing, before = self.crossing[index], self.open.take(index)
        missed = (before.steps > CROSSING) & ((crossing < before.low) | (crossing > before.high))
        steps = np.where(missed & (length <= 2.5 * NEAR * self.half[index]), BEYOND, trusted)
        return _OpenStretches(self.open.panel[index], low, high, place, steps)

    def _reached(self, inner):
        """How far it is proved from the inner places on to both sides, and how many eigenvalues are outside there.

        Shares of the way to the edge of the stretch, or to the next crossing, are tried until one is proved.
        """
        m, edge = self.half.size, np.concatenate([self.open.low, self.open.high])
        begin, ends = np.concatenate(self.begin), np.concatenate(inner)
        of, sign, outside = np.tile(np.arange(m), 2), np.repeat([-1.0, 1.0], m), np.zeros(2 * m, int)
        place, half, pad = self.open.place[of], self.half[of], sign * self.pad[of]
        extent = (edge - place) / half
        far, extent = np.abs(extent) > 1, np.clip(extent, -1, 1) - begin
        away = sign[:, None] * (self.roots[of] - begin[:, None])
        first = 0.9 * np.where(away > 0, away, np.inf).min(1) / np.abs(extent)
        first = np.where(self.radius[of] == 1, np.fmin(1, first), 1.0)
        todo = np.flatnonzero((sign * (edge - ends) > 0) & ~self.toward[of])
        for factor in SHARES:
            if not todo.size:
                break
            share = factor * first[todo]
            start, advance = begin[todo], share * extent[todo]
            start = np.where(start == 0, 0.0, start - pad[todo])
            ok, count = self.models.prove(of[todo], start, begin[todo] + advance + pad[todo], self.radius[of[todo]])
            reached = place[todo] + half[todo] * (begin[todo] + advance)
            reached = np.clip(reached, self.open.low[of[todo]], self.open.high[of[todo]])
            reached = np.where(far[todo] | (share < 1), reached, edge[todo])
            ends[todo[ok]], outside[todo[ok]] = reached[ok], count[ok]
            todo = todo[~ok]
        return np.split(ends, 2), np.split(outside, 2)


def proved_by_balls(tiles: Tiles, lost, span, columns: int, attached, balls) -> tuple[Tiles, tuple[np.ndarray, ...]]:
    """Return the tiles, and the parts without panels, with stretches in doubt replaced by what is proved of these.

    balls(column, low, high): the stable intervals from low to high as (low, high, low_theta, high_theta), None if they stay in
    doubt; see `Tiles` for theta. lost, attached: see `regions_of`.
    """
    ends = [Tiles.of(np.arange(columns), *np.full((2, columns), float(end)), 1) for end in span]
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    joined = Tiles.join([ends[0], tiles, ends[1]])
    joined = joined.take(np.argsort(joined.column, kind="stable"))
    outer, sure = np.isin(joined.low, span) & (joined.low == joined.high), np.flatnonzero(joined.outside >= 0)
    first, last = sure[:-1], sure[1:]
    before_label, after_label = np.minimum(joined.outside[first], 1), np.minimum(joined.outside[last], 1)
    window, plain, rough = joined.outside <= WINDOW, joined.outside == WINDOW, joined.doubt != Doubt.NONE

    def between(size):
        """The sum over the windows between each two neighbours of `sure`."""
        total = np.append(0.0, np.cumsum(np.where(window, size, 0.0)))
        return total[last] - total[first + 1]

    low, high, at_end = joined.high[first], joined.low[last], outer[first] | outer[last]
    slack = 4 * EPS * np.abs(high) + np.where(outer[first], *attached) * at_end
    doubtful = (high - low - between(joined.high - joined.low) > slack) | (between(plain & rough) > 0)
    doubtful |= (before_label * after_label == 0) & (between(rough) > 0)
    alike = (before_label == after_label) & (last - first > 1) & ((before_label == 0) | (between(plain) > 0))
    doubtful |= ~at_end & (alike | ((last - first == 1) & (before_label != after_label)))
    doubtful &= joined.column[first] == joined.column[last]
    remains, new = np.ones(joined.column.size, bool), []
    pairs = np.stack([first, last], 1)[doubtful]
    for column in different(joined.column[pairs[:, 0]]).tolist():
        of_column = pairs[joined.column[pairs[:, 0]] == column]
        for before, after in of_column.tolist() if len(of_column) <= FEW else [(of_column[0, 0], of_column[-1, 1])]:
            a, b = float(joined.high[before]), float(joined.low[after])
            intervals = balls(column, a, b)
            if intervals is None:
                continue
            begins, stops = bool(intervals) and intervals[0][0] == a, bool(intervals) and intervals[-1][1] == b
            if any(not outer[at] and (joined.outside[at] == 0) != stable for at, stable in ((before, begins), (after, stops))):
                continue  # what contradicts its neighbours is not taken for proved
            remains[before + 1 : after] = False
            new.append(_tiles_of_intervals(column, a, b, intervals))
            elsewhere = (lost[0] != column) | (lost[2] <= a) | (lost[1] >= b)
            lost = tuple(fact[elsewhere] for fact in lost)
    return Tiles.join([joined.take(remains & ~outer), *new]), lost


def _tiles_of_intervals(column, a, b, intervals):
    """Tiles from a to b: stable intervals, with unstable ones between, and windows without width where one begins or ends."""
    rows, place = [], a
    for low, high, *theta in intervals:
        if low > a:
            rows += [(place, low, 1, np.nan, np.nan), (low, low, WINDOW, low, theta[0])]
        rows.append((low, high, 0, np.nan, np.nan))
        if high < b:
            rows.append((high, high, WINDOW, high, theta[1]))
        place = high
    if place < b:
        rows.append((place, b, 1, np.nan, np.nan))
    low, high, outside, value, theta = map(np.array, zip(*rows, strict=True))
    return Tiles(np.full(low.size, column), low, high, outside, value, theta, 0 * low, np.full(low.size, Doubt.NONE))


def regions_of(tiles: Tiles, lost, span, columns: int, attached) -> Regions:
    """Return the parts of the spans in which the loops are stable, unstable or not known; all of a column have its doubt.

    lost: parts without panels, see `panels_of`. attached: from each end of the span, how far what is not known may reach
    without a doubt, since a crossing there is given as at the end itself.
    """
    tiles = Tiles.join([tiles, _gaps(tiles, span, columns, attached)])
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    doubt = np.full(columns, Doubt.NONE)
    owner, low, high, overflown = lost
    searched = (high > span[0] + attached[0]) & (low < span[1] - attached[1])
    np.maximum.at(doubt, owner[searched].astype(int), np.where(overflown[searched] > 0, Doubt.OVERFLOW, Doubt.SEARCH))
    np.maximum.at(doubt, tiles.column, np.where(tiles.outside == UNKNOWN, Doubt.CROWDED, Doubt.NONE))
    # Inside a plain window all may be stable, also at an end of the span.
    np.maximum.at(doubt, tiles.column, np.where(tiles.outside == WINDOW, tiles.doubt, Doubt.NONE))
    at = np.flatnonzero(tiles.outside > WINDOW)
    regions, column, label = tiles.take(at), tiles.column[at], np.sign(tiles.outside[at])
    neighbours = np.concatenate([at - 1, at[-1:] + 1])  # before each part, and after the last one
    window = tiles.take(np.clip(neighbours, 0, tiles.column.size - 1))
    first = np.append(True, np.diff(column) != 0)
    last, is_window = np.append(first[1:], True), (window.outside <= WINDOW)
    crossed, ending = is_window[:-1] & (window.column[:-1] == column), is_window[1:] & (window.column[1:] == column)
    low = np.where(first, span[0], np.where(crossed, window.value[:-1], regions.low))
    high = np.where(last, span[1], np.append(low[1:], span[1]))
    # What lies at the low and the high end of each part: a crossing, or nothing.
    theta, miss, rough = (
        [np.where(crossed, fact[:-1], none), np.where(ending, fact[1:], none)] for fact, none in _facts(window)
    )
    before = np.where(first, UNKNOWN, np.append(UNKNOWN, label[:-1]))
    same = ~first & (before == label)
    np.maximum.at(doubt, column, np.where(label == 0, np.maximum(*rough), Doubt.NONE))
    # Between parts alike eigenvalues may touch the circle, or cross and return; without a crossing the counts agree.
    unsure = crossed & same & ((label == 0) | (window.outside[:-1] == WINDOW))
    wrong = ~first & (unsure | ~crossed & ~same & (np.minimum(label, before) >= 0))
    np.maximum.at(doubt, column[wrong], Doubt.COUNTS)
    begin, end = np.flatnonzero(~same), np.flatnonzero(np.append(~same[1:], True))
    ends = (low[begin], high[end], theta[0][begin], theta[1][end])
    return Regions(column[begin], *ends, label[begin], doubt[column[begin]], np.maximum(miss[0][begin], miss[1][end]))


def _facts(window):
    return (window.theta, np.nan), (window.miss, 0.0), (window.doubt, Doubt.NONE)


def _gaps(tiles, span, columns, attached):
    """What is between the tiles of each column, and before and behind them."""
    tiles = tiles.take(np.lexsort((tiles.low, tiles.column)))
    every, (low, high) = np.arange(columns), (np.full(columns, float(end)) for end in span)
    column = np.concatenate([every, tiles.column, every])
    left, right = np.concatenate([low, tiles.low, high]), np.concatenate([low, tiles.high, high])
    order = np.lexsort((right, left, column))
    column, left, right = column[order], left[order], right[order]
    gap = np.flatnonzero((np.diff(column) == 0) & (left[1:] > right[:-1]))
    gaps = Tiles.of(column[gap], right[gap], left[gap + 1], UNKNOWN)
    everything = (gaps.low == span[0]) & (gaps.high == span[1])
    return gaps.take(everything | (gaps.high > span[0] + attached[0]) & (gaps.low < span[1] - attached[1]))
