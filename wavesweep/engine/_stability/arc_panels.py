"""Roots of analytic functions on an interval: Chebyshev panels, split until their roots are
proved."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from wavesweep.engine._stability.real_roots import at_ends, isolate
from wavesweep.engine.doubles import EPS
from wavesweep.engine.rows import Rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from wavesweep.engine._stability.real_roots import Roots

    # Sign, logarithm of the size and rounding error of functions, see `panel_roots`.
    _Sample = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]

NODES = 20  # samples of a panel
# of the Chebyshev coefficients; the others must have decayed, and bound the error
KEPT_COEFFICIENTS = 14
DECAYED = 1e-5  # of the largest, above which a panel is split at once and no proof is tried
# of its width a panel reaches beyond each end, so that no root stays on an edge
OVERLAP = 0.035
# an interpolant is cut to these one by one, and what is cut away is added to its error
CUT_DEGREES = (1, 2, 4, 7, 10, KEPT_COEFFICIENTS)
NODE = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)
_TURNS = np.outer(2 * np.arange(NODES) + 1, np.arange(NODES)) % (4 * NODES)
TRANSFORM = np.cos(_TURNS * (np.pi / (2 * NODES))) * (2 / NODES)
# of the largest sample: what rounding of the transform, and of coefficients, moves an interpolant by
ROUNDING = 2 * NODES**2 * EPS
PANEL_ELLIPSE = 2.5  # sum of the semi-axes of the ellipse about a panel, in half widths of it
RIM_POINTS = 8  # on its upper half
RIM = PANEL_ELLIPSE * np.exp(1j * np.pi * (np.arange(RIM_POINTS) + 0.5) / RIM_POINTS)
RIM = (RIM + 1 / RIM) / 2
# more than the constant of the nodes: how much an interpolant may exceed the largest of its samples
LEBESGUE = 4
PANEL_ELLIPSES = (PANEL_ELLIPSE, 4.0, 8.0)  # the same of those by which interpolants are bounded
# by which bounds may grow while other panels are divided; they are checked again in the end
ALLOWANCE = 8.0
MOST_BEYOND = 2 * LEBESGUE  # how much functions may exceed the largest samples, see `panel_roots`
MOST_SHARE = np.log(0.5)  # of the largest sample, that an interpolant may be off, in the logarithm
# of its width, where a panel is cut as a rule; not in the middle, where symmetric loops have roots
CUT_AT = 0.48
# of half a panel, from its middle: how far out its smallest sample says where to cut
CUT_FROM_MIDDLE = 0.7
for _array in (NODE, TRANSFORM, RIM):
    _array.flags.writeable = False


@dataclass(frozen=True, slots=True)
class RootAngles(Rows):
    """A root a row: its column, its place and the distance to which that is known, and the sign of
    the slope."""

    column: np.ndarray
    x: np.ndarray
    within: np.ndarray
    slope_sign: np.ndarray


class PanelRoots(NamedTuple):
    """The roots of all columns and the state of their panels.

    settled: panels as (column, low, high) that the function that settles has settled. complete:
    `(columns,)`, whether no panel was given up and all bounds hold. open_low, open_high:
    `(columns,)`, whether roots may be left in the first or the last bit of the interval. leaves:
    which functions exceed by a factor of at most MOST_BEYOND.
    """

    roots: RootAngles
    settled: tuple[np.ndarray, np.ndarray, np.ndarray]
    complete: np.ndarray
    open_low: np.ndarray
    open_high: np.ndarray
    leaves: Leaves


class PanelLimits(NamedTuple):
    """When panels are given up.

    smallest: a panel narrower than this that proves nothing is. many: the open panels of a column
    are if there are so many. end_bit: a panel at an end of the interval that is narrower than this
    and proves nothing is left open.
    """

    smallest: float
    many: int
    end_bit: float


def panel_roots(
    sample: _Sample,
    edges: np.ndarray,
    columns: int,
    limits: PanelLimits,
    settling: int,
    degree: int,
) -> PanelRoots:
    """Find all roots of several functions of each column between 0 and pi, real and even
    trigonometric polynomials of at most a degree.

    sample(column, x): for panels (their columns, `(panels,)`, and points, `(panels, points)`) the
    functions' values as sign, logarithm of the size, and rounding error relative to the size, each
    `(functions, panels, points)`. edges: of the first panels of each column. columns: number of
    columns. settling: number of a function that settles a panel on which it is proved to be
    positive, whatever the other functions do; its roots do not count.

    On each panel the interpolant at NODES points must have decayed, and `isolate` must prove its
    roots for every function within the error bound; otherwise the panel is split. The bound
    consists of rounding, of the coefficients that are cut away, and of features that the nodes may
    miss: the interpolant of a function that is analytic and at most G inside an ellipse about the
    panel with semi-axes of sum r is off by at most `4 G r^-n/(r - 1)`, n its degree (L. N.
    Trefethen, Approximation Theory and Approximation Practice, Theorem 8.2), G by `_shares`. A mode
    of the tick may have no visible effect at the nodes, since it enters a frame as a high power.

    Let a function be at most A times the largest sample of each panel there, with the least A. Then
    it is at most LEBESGUE + A/2 times that if no share is beyond 1/2, and so A is at most 2 LEBESGUE.
    """
    column = np.repeat(np.arange(columns), edges.size - 1)
    low = np.tile(edges[:-1], columns)
    high = np.tile(edges[1:], columns)
    roots = [RootAngles(np.zeros(0, int), *np.zeros((3, 0)))]
    settled = []
    closed: list[_Tiles] = []
    complete = np.ones(columns, bool)
    open_low = np.zeros(columns, bool)
    open_high = np.zeros(columns, bool)
    while column.size:
        reach = OVERLAP * (high - low)
        start = low - reach
        end = high + reach
        panels = _Panels(column, (start + end) / 2, (end - start) / 2)
        samples = _Samples(*sample(panels.column, panels.at(NODE)))
        tiles = _Tiles(column, low, high, samples.largest, np.zeros(column.size))
        leaves = Leaves.of(columns, _Tiles.join([*closed, tiles]), degree)
        judged = _judged(samples, panels, settling, _shares(tiles, leaves))
        roots += judged.roots
        short = ~judged.proved & (high - low < limits.end_bit)
        at_low = short & (low == edges[0])
        at_high = short & (high == edges[-1])
        open_low[column[at_low]] = True
        open_high[column[at_high]] = True
        settled.append(tiles.take(judged.settled))
        open_ = ~(judged.proved | judged.settled | judged.overflown | at_low | at_high)
        crowded = np.bincount(column[open_], minlength=columns)[column] > limits.many // 2
        hopeless = open_ & ((high - low <= limits.smallest) | crowded)
        complete[column[judged.overflown | hopeless]] = False
        split = open_ & ~hopeless
        closed.append(replace(tiles, allowed=judged.allowed).take(~split))
        column, low, high = _cut(column, low, high, judged.cut_at, split)
    tiles = _Tiles.join(closed)
    leaves = Leaves.of(columns, tiles, degree)
    beyond = _shares(tiles, leaves).max(0) > tiles.allowed
    complete[tiles.column[beyond]] = False
    of_settled = _Tiles.join(settled)
    settled_panels = of_settled.column, of_settled.low, of_settled.high
    return PanelRoots(RootAngles.join(roots), settled_panels, complete, open_low, open_high, leaves)


@dataclass(frozen=True, slots=True)
class _Panels(Rows):
    """Panels of a generation: column, middle and half-width of each, the overlap with its
    neighbours included."""

    column: np.ndarray
    middle: np.ndarray
    half: np.ndarray

    def at(self, place: np.ndarray) -> np.ndarray:
        """Return points of all panels, `(panels, points)`; place: position on [-1, 1], or beside
        it."""
        return self.middle[:, None] + self.half[:, None] * place

    def roots(self, panel: np.ndarray, discs: Roots, which: tuple[np.ndarray, ...]) -> RootAngles:
        """Roots from their positions on [-1, 1] of the panels; which: of the discs."""
        half = self.half[panel]
        x = self.middle[panel] + half * discs.value[which]
        return RootAngles(
            self.column[panel], x, half * discs.radius[which], discs.slope_sign[which]
        )


class _Samples(NamedTuple):
    """What functions are at the nodes of panels, see `panel_roots`."""

    sign: np.ndarray
    log: np.ndarray
    error: np.ndarray

    @property
    def largest(self) -> np.ndarray:
        """The logarithm of the largest of each, `(panels, functions)`; -inf if one is not finite."""
        sizes = self.log + np.log1p(EPS * self.error)
        return np.where(np.isfinite(sizes).all(-1), sizes.max(-1), -np.inf).T

    def scaled(self, finite: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Samples of which the largest of a function on a panel is 1, their errors, and the
        logarithms of what they are divided by, `(functions, panels)`.

        finite: `(panels,)`; of others the samples are 0 and their errors infinite.
        """
        log = np.where(np.isfinite(self.log), self.log, -np.inf)
        peak = log.max(-1)
        peak = np.where(np.isfinite(peak), peak, 0.0)
        sign = np.where(finite[:, None], self.sign, 0.0)
        value = sign * np.exp(log - peak[..., None])
        return value, np.where(finite[:, None], np.abs(value) * self.error, np.inf), peak


class _Judged(NamedTuple):
    """What is known of panels, `(panels,)`: whether their roots are proved, they are settled,
    none of their samples is finite; the roots on proved panels; the places to cut, as shares of a
    width; and the largest shares that the proofs allow, see `_Tiles`."""

    proved: np.ndarray
    settled: np.ndarray
    overflown: np.ndarray
    roots: list[RootAngles]
    cut_at: np.ndarray
    allowed: np.ndarray


def _judged(samples: _Samples, panels: _Panels, settling: int, shares: np.ndarray) -> _Judged:
    """What the samples of panels prove; shares: see `_shares`."""
    at_nodes = np.isfinite(samples.log).all(0)
    finite = at_nodes.all(-1)
    value, error, peak = samples.scaled(finite)
    interpolants = [_interpolate(*scaled) for scaled in zip(value, error, strict=True)]
    series, noise, ready = (np.stack(facts) for facts in zip(*interpolants, strict=True))
    counted = np.arange(len(value)) != settling
    decayed = ready[counted].all(0)
    share = shares.max(0)
    bounded = finite & (share <= MOST_SHARE)
    with np.errstate(over="ignore"):
        of_rim = np.exp(shares + samples.largest.T - peak)
    hidden = np.where(bounded, MOST_BEYOND * ALLOWANCE * of_rim, np.inf)
    proved = decayed & bounded
    ready[counted] = proved
    function_of, panel = np.nonzero(ready & np.isfinite(hidden))
    coefficients = series[function_of, panel]
    noise = noise[function_of, panel] + hidden[function_of, panel]
    sure = np.zeros(ready.shape, bool)
    positive = (value[settling] > 0).all(-1)
    settled = np.zeros(positive.shape, bool)
    by_batch = []
    for rows, discs in _proved_roots(coefficients, noise):
        function = function_of[rows]
        panel_of_row = panel[rows]
        sure[function, panel_of_row] = True
        settles = function == settling
        settled[panel_of_row[settles]] = ~discs.inside[settles].any(-1)
        row, root = np.nonzero(discs.inside & (function != settling)[:, None])
        by_batch.append((panel_of_row[row], panels.roots(panel_of_row[row], discs, (row, root))))
    proved &= sure[counted].all(0)
    settled &= positive & ~proved
    roots = [of_batch.take(proved[of_root]) for of_root, of_batch in by_batch]
    allowed = np.where(proved | settled, share + np.log(ALLOWANCE), MOST_SHARE)
    allowed = np.minimum(allowed, MOST_SHARE)
    cut_at = _where_to_cut(value[counted])
    return _Judged(proved, settled, ~at_nodes.any(-1), roots, cut_at, allowed)


def _where_to_cut(value: np.ndarray) -> np.ndarray:
    """Where panels are cut, as shares of their widths; value: samples, `(functions, panels, nodes)`.

    Roots may crowd next to the smallest sample, so it is put into a small half if it is near an end.
    """
    place = NODE[np.argmin(np.abs(value).min(0), axis=-1)]
    return np.where(np.abs(place) < CUT_FROM_MIDDLE, CUT_AT, np.where(place > 0, 0.76, 0.24))


def _transformed(value: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """Return the Chebyshev coefficients of the samples.

    They are sums and not a matrix product: BLAS may round a row differently in another batch, and
    bytes must not change.
    """
    total = value[..., :1] * transform[0]
    for node in range(1, NODES):
        total += value[..., node : node + 1] * transform[node]
    return total


class Leaves(NamedTuple):
    """The panels that cover the interval of each column, in rows of one length.

    low, high: `(columns, leaves)`, of width 0 behind the last leaf. largest: the logarithm of the largest sample of each function,
    `(functions, columns, leaves)`, and -inf there. degree: of the functions.
    """

    low: np.ndarray
    high: np.ndarray
    largest: np.ndarray
    degree: int

    @staticmethod
    def of(columns: int, tiles: _Tiles, degree: int) -> Leaves:
        """The leaves of so many columns."""
        order = np.argsort(tiles.column, kind="stable")
        column = tiles.column[order]
        place = np.arange(order.size) - np.searchsorted(column, column)
        shape = columns, place.max(initial=0) + 1
        low, high = np.zeros((2, *shape))
        largest = np.full((2, *shape), -np.inf)
        low[column, place] = tiles.low[order]
        high[column, place] = tiles.high[order]
        largest[:, column, place] = tiles.largest[order].T
        return Leaves(low, high, largest, degree)

    @np.errstate(all="ignore")
    def bound(
        self, column: np.ndarray, middle: np.ndarray, half: np.ndarray, axes: float
    ) -> np.ndarray:
        """Return logarithms of bounds on functions F in ellipses whose half axes a and b add up to
        `axes` half widths, `(functions, n)`, if none exceeds the largest sample of any leaf.

        F is a trigonometric polynomial of a degree N, so `z^N F` is a polynomial of z, and log|F| at
        theta + i s, s > 0, is at most N s and the mean of log|F| over the circle with Poisson's kernel

            sinh(s)/(cosh(s) - cos(t - theta))/(2 pi) <= sinh(s)/(1 - cos(t - theta))/(2 pi),

        whose integral is a cotangent. In an ellipse s is at most b. Leaves nearer to it than half a
        width count with the largest of them, all others, and their images at -t, with the bound on
        their weights.
        """
        low = self.low[column]
        high = self.high[column]
        largest = self.largest[:, column]
        half = half[:, None]
        middle = middle[:, None]
        a = (axes + 1 / axes) / 2 * half
        b = (axes - 1 / axes) / 2 * half
        near = np.zeros(low.shape, bool)
        weight = np.zeros(low.shape)
        for begin, end in (
            (low - middle, high - middle),
            (middle - high, middle - low),
            (middle + low, middle + high),
            (2 * np.pi - middle - high, 2 * np.pi - middle - low),
        ):
            near |= (begin - a < half) & (end > -a)
            first, last = (np.clip(angle - a, half, np.pi) for angle in (begin, end))
            weight += 1 / np.tan(first / 2) - 1 / np.tan(last / 2)
        beside = np.where(near, largest, -np.inf).max(-1)
        beyond = np.where(near, 0.0, np.maximum(largest - beside[..., None], 0.0))
        mean = beside + (np.sinh(b) / (2 * np.pi) * weight * beyond).sum(-1)
        return np.where((a + half < np.pi)[:, 0], mean + self.degree * b[:, 0], np.inf)


@dataclass(frozen=True, slots=True)
class _Tiles(Rows):
    """Panels without their overlaps: column, low and high end, the logarithms of the largest
    sample of each function, `(panels, functions)`, and the largest of `_shares` that their proofs
    allow, `(panels,)`."""

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    largest: np.ndarray
    allowed: np.ndarray


def _shares(tiles: _Tiles, leaves: Leaves) -> np.ndarray:
    """Return logarithms of bounds on how far the interpolants of tiles are off, as shares of the
    largest sample, `(functions, tiles)`, if no function exceeds the largest sample of any leaf."""
    half = (0.5 + OVERLAP) * (tiles.high - tiles.low)
    middle = (tiles.low + tiles.high) / 2
    best = np.full((2, half.size), np.inf)
    for axes in PANEL_ELLIPSES:
        of_rim = np.log(4 / (axes - 1)) - (NODES - 1) * np.log(axes)
        best = np.fmin(best, leaves.bound(tiles.column, middle, half, axes) + of_rim)
    return best - tiles.largest.T


def _interpolate(value: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return second-kind Chebyshev coefficients `(panels, KEPT_COEFFICIENTS)`, their error bound on
    the panel, and whether they decayed."""
    first = _transformed(value, TRANSFORM)
    first[:, 0] /= 2
    largest = np.abs(first).max(-1)
    tail = np.abs(first[:, KEPT_COEFFICIENTS:]).max(-1)
    floor = LEBESGUE * EPS * size.max(-1) + ROUNDING * np.abs(value).max(-1)
    second = first[:, :KEPT_COEFFICIENTS] / 2
    second[:, 0] *= 2
    second[:, :-2] -= first[:, 2:KEPT_COEFFICIENTS] / 2
    decayed = np.isfinite(floor) & (tail <= np.maximum(DECAYED * largest, floor))
    return second, (NODES - KEPT_COEFFICIENTS) * tail + floor, decayed


def _proved_roots(
    coefficients: np.ndarray, noise: np.ndarray
) -> Iterator[tuple[np.ndarray, Roots]]:
    """Yield proved roots of the interpolants, as (rows, Roots) pairs; each row is tried at the
    lowest degree first.

    High coefficients that have decayed to rounding would leave the discs without a significant
    leading coefficient.
    """
    weight = np.arange(1, KEPT_COEFFICIENTS + 1) * np.abs(coefficients)
    # A value at an end that may be zero leaves that end open at every degree.
    rows = np.flatnonzero(np.min(np.abs(at_ends(coefficients)), axis=0) > noise)
    for degree in CUT_DEGREES:
        if not rows.size:
            return
        beyond = weight[rows, degree:].sum(-1)
        # What is analytic in an ellipse misses its interpolant by no more inside a small one.
        roots = isolate(coefficients[rows, :degree], noise[rows] + beyond, degree=NODES + 1)
        proved = roots.complete
        yield rows[proved], roots.take(proved)
        rows = rows[~proved]


def _cut(
    column: np.ndarray, low: np.ndarray, high: np.ndarray, share: np.ndarray, split: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Panels cut in two, those of `split`, each at a share of its width."""
    column = column[split]
    low = low[split]
    high = high[split]
    share = np.broadcast_to(share, split.shape)[split]
    cut_at = low + share * (high - low)
    return np.tile(column, 2), np.concatenate([low, cut_at]), np.concatenate([cut_at, high])
