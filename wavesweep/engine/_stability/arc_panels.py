"""Roots of analytic functions on an interval: Chebyshev panels, split until their roots are
proved."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from wavesweep.engine._stability.real_roots import at_ends, isolate
from wavesweep.engine.doubles import EPS
from wavesweep.engine.rows import Rows

if TYPE_CHECKING:
    from wavesweep.engine._stability.real_roots import Roots

    # Phase, logarithm of the size and rounding error of functions, see `panel_roots`.
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
TRANSFORM = np.cos(np.outer(np.arccos(NODE), np.arange(NODES))) * (2 / NODES)
PANEL_ELLIPSE = 2.5  # sum of the semi-axes of the ellipse about a panel, in half widths of it
RIM_POINTS = 8  # on its upper half
RIM = PANEL_ELLIPSE * np.exp(1j * np.pi * (np.arange(RIM_POINTS) + 0.5) / RIM_POINTS)
RIM = (RIM + 1 / RIM) / 2
# over the largest value on the ellipse
INTERPOLANT_ERROR = 4 * PANEL_ELLIPSE ** (1 - NODES) / (PANEL_ELLIPSE - 1)
# of itself, up to which the error of a value on the rim counts; what is beyond is no better known
ROUGH_VALUE = 10.0
# of its width, where a panel is cut as a rule; not in the middle, where symmetric loops have roots
CUT_AT = 0.48
# of half a panel, from its middle: how far out its smallest sample says where to cut
CUT_FROM_MIDDLE = 0.7
# more than the constant of the nodes: how much an interpolant may exceed the largest of its samples
LEBESGUE = 4
for _array in (NODE, TRANSFORM, RIM):
    _array.flags.writeable = False


@dataclass(frozen=True, slots=True)
class PanelRoots:
    """Roots and the state of the panels.

    column, function, x, within, slope_sign: a root each: its column, its function, its place and
    the distance to which that is known, and the sign of the slope. lost, overflown, settled: panels
    as (column, low, high): given up, given up since samples overflow there, and settled by the
    function that settles. open_low, open_high: `(columns,)`, whether roots may be left in the first
    or the last bit of the interval.
    """

    column: np.ndarray
    function: np.ndarray
    x: np.ndarray
    within: np.ndarray
    slope_sign: np.ndarray
    lost: tuple[np.ndarray, np.ndarray, np.ndarray]
    overflown: tuple[np.ndarray, np.ndarray, np.ndarray]
    settled: tuple[np.ndarray, np.ndarray, np.ndarray]
    open_low: np.ndarray
    open_high: np.ndarray


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
    sample: _Sample, edges: np.ndarray, columns: int, limits: PanelLimits, settling: int
) -> PanelRoots:
    """Find all roots of several functions of each column, real analytic in x.

    sample(column, x): for panels (their columns, `(panels,)`, and points, `(panels, points)`, real
    or complex) the functions' values as phase, logarithm of the size, and rounding error relative
    to the size, each `(functions, panels, points)`. edges: of the first panels of each column.
    columns: number of columns. settling: number of a function that settles a panel on which it is
    proved to be positive, whatever the other functions do; its roots do not count.

    On each panel the interpolant at NODES points must have decayed, and `isolate` must prove its
    roots for every function within the error bound; otherwise the panel is split. The bound
    consists of rounding, of the coefficients that are cut away, and of features that the nodes may
    miss: the interpolant of a function that is analytic and at most G inside an ellipse about the
    panel with semi-axes of sum r is off by at most `4 G r^-n/(r - 1)`, n its degree (L. N.
    Trefethen, Approximation Theory and Approximation Practice, Theorem 8.2). By the maximum
    principle G is that on the ellipse's rim; the functions are sampled there at complex x. A mode
    of the tick may have no visible effect at the nodes, since it enters a frame as a high power; it
    is large on the rim if it is large anywhere on the panel.
    """
    column = np.repeat(np.arange(columns), edges.size - 1)
    low = np.tile(edges[:-1], columns)
    high = np.tile(edges[1:], columns)
    nothing = np.zeros(0)
    no_index = np.zeros(0, int)
    no_panels = no_index, nothing, nothing
    roots = [_Roots(no_index, no_index, nothing, nothing, nothing)]
    given_up = {"lost": [no_panels], "overflown": [no_panels], "settled": [no_panels]}
    open_low = np.zeros(columns, bool)
    open_high = np.zeros(columns, bool)

    def give(kind: str, index: np.ndarray) -> None:
        given_up[kind].append((column[index], low[index], high[index]))

    while column.size:
        reach = OVERLAP * (high - low)
        left = low - reach
        right = high + reach
        panels = _Panels(column, (left + right) / 2, (right - left) / 2)
        judged = _judged(sample, panels, settling)
        roots += judged.roots
        short = ~judged.proved & (high - low < limits.end_bit)
        at_low = short & (low == edges[0])
        at_high = short & (high == edges[-1])
        open_low[column[at_low]] = True
        open_high[column[at_high]] = True
        give("settled", judged.settled)
        give("overflown", judged.overflown)
        open_ = ~(judged.proved | judged.settled | judged.overflown | at_low | at_high)
        crowded = np.bincount(column[open_], minlength=columns)[column] > limits.many // 2
        hopeless = open_ & ((high - low <= limits.smallest) | crowded)
        give("lost", hopeless & judged.finite)
        give("overflown", hopeless & ~judged.finite)
        column, low, high = _cut(column, low, high, judged.cut_at, open_ & ~hopeless)
    found = _Roots.join(roots)
    return PanelRoots(
        found.column,
        found.function,
        found.x,
        found.within,
        found.slope_sign,
        _joined(given_up["lost"]),
        _joined(given_up["overflown"]),
        _joined(given_up["settled"]),
        open_low,
        open_high,
    )


def _joined(
    pieces: list[tuple[np.ndarray, np.ndarray, np.ndarray]],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Column, low and high of panels from those of several pieces."""
    column, low, high = map(np.concatenate, zip(*pieces, strict=True))
    return column, low, high


@dataclass(frozen=True, slots=True)
class _Roots(Rows):
    """Roots, as `PanelRoots` has them."""

    column: np.ndarray
    function: np.ndarray
    x: np.ndarray
    within: np.ndarray
    slope_sign: np.ndarray


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


class _Judged(NamedTuple):
    """What is known of panels, `(panels,)`: whether their roots are proved, they are settled,
    all samples are finite, and none is; the roots on proved panels; and the places to cut, as
    shares of a width."""

    proved: np.ndarray
    settled: np.ndarray
    finite: np.ndarray
    overflown: np.ndarray
    roots: list[_Roots]
    cut_at: np.ndarray


def _judged(sample: Callable[..., Any], panels: _Panels, settling: int) -> _Judged:
    """What the samples of panels prove."""
    phase, log, error = sample(panels.column, panels.at(NODE))
    functions = log.shape[0]
    reached = np.isfinite(log).all(0).any(-1)
    finite = np.isfinite(log).all((0, -1))
    sign = np.where(finite[:, None], phase.real, 0.0)
    trend = _trend(log, finite)
    trend = np.where(_tail(sign, log, trend) < _tail(sign, log, 0 * trend), trend, 0.0)
    value, peak = _scaled(sign, log, trend)
    size = np.where(finite[:, None], np.abs(value) * error, np.inf)
    interpolants = [_interpolate(*samples) for samples in zip(value, size, strict=True)]
    series, noise, ready = (np.stack(facts) for facts in zip(*interpolants, strict=True))
    counted = [function for function in range(functions) if function != settling]
    decayed = ready[counted].all(0)
    worth = decayed | ready[settling]
    hidden = _hidden(sample, panels, np.flatnonzero(worth & finite), trend, peak)
    proved = decayed & finite
    ready[counted] = proved
    function_of, panel = np.nonzero(ready & np.isfinite(hidden))
    coefficients = series[function_of, panel]
    noise = noise[function_of, panel] + hidden[function_of, panel]
    sure = np.zeros((functions, panels.column.size), bool)
    settled = np.zeros(panels.column.size, bool)
    by_batch = []
    for rows, discs in _proved_roots(coefficients, noise):
        function = function_of[rows]
        at = panel[rows]
        sure[function, at] = True
        settles = function == settling
        settled[at[settles]] = ~discs.inside[settles].any(-1) & (
            value[settling, at[settles]] > 0
        ).all(-1)
        row, root = np.nonzero(discs.inside & (function != settling)[:, None])
        of_root = at[row]
        half = panels.half[of_root]
        x = panels.middle[of_root] + half * discs.value[row, root]
        within = half * discs.radius[row, root]
        slopes = discs.slope_sign[row, root]
        by_batch.append((of_root, _Roots(panels.column[of_root], function[row], x, within, slopes)))
    proved &= sure[counted].all(0)
    settled &= ~proved
    roots = [of_batch.take(proved[of_root]) for of_root, of_batch in by_batch]
    # Roots may crowd next to the smallest sample, so it is put into a small half if it is near an
    # end.
    place = NODE[np.argmin(np.abs(value[counted]).min(0), axis=-1)]
    cut_at = np.where(np.abs(place) < CUT_FROM_MIDDLE, CUT_AT, np.where(place > 0, 0.76, 0.24))
    return _Judged(proved, settled, finite, ~reached, roots, cut_at)


def _trend(log: np.ndarray, finite: np.ndarray) -> np.ndarray:
    """Return the exponential growth of each function over a panel, per half of its width.

    To divide by it removes no roots, and may leave a function that a polynomial follows more
    easily: functions of a frame are powers of those of a tick.
    """
    right = log[..., NODE > 0.5].max(-1)
    left = log[..., NODE < -0.5].max(-1)
    with np.errstate(invalid="ignore"):
        return np.where(finite, (right - left) / 1.5, 0.0)


def _scaled(sign: np.ndarray, log: np.ndarray, trend: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return samples without their trend, the largest of a panel of size 1, and the logarithm of
    their divisor."""
    log = np.where(np.isfinite(log), log - trend[..., None] * NODE, -np.inf)
    peak = log.max(-1)
    peak = np.where(np.isfinite(peak), peak, 0.0)
    return sign * np.exp(log - peak[..., None]), peak


def _tail(sign: np.ndarray, log: np.ndarray, trend: np.ndarray) -> np.ndarray:
    """Return the largest of the last Chebyshev coefficients of the samples without their trend."""
    value, _ = _scaled(sign, log, trend)
    return np.abs(_transformed(value, TRANSFORM[:, KEPT_COEFFICIENTS:])).max(-1)


def _transformed(value: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """Return the Chebyshev coefficients of the samples.

    They are sums and not a matrix product: BLAS may round a row differently in another batch, and
    bytes must not change.
    """
    total = value[..., :1] * transform[0]
    for node in range(1, NODES):
        total += value[..., node : node + 1] * transform[node]
    return total


def _hidden(
    sample: Callable[..., Any],
    panels: _Panels,
    index: np.ndarray,
    trend: np.ndarray,
    peak: np.ndarray,
) -> np.ndarray:
    """Return a bound on features between the nodes of the panels `index`, in units of each
    function's largest sample.

    It is infinite for other panels.
    """
    hidden = np.full(peak.shape, np.inf)
    if not index.size:
        return hidden
    chosen = panels.take(index)
    _, log, error = sample(chosen.column, chosen.at(RIM))
    of_error = np.log1p(np.minimum(EPS * error, ROUGH_VALUE))
    log = log + of_error - trend[:, index, None] * RIM.real
    with np.errstate(over="ignore", invalid="ignore"):
        # Between two points of the rim it may be larger than at both, by no more than they differ,
        # and twice for good measure.
        steepest = np.abs(np.diff(log, axis=-1)).max(-1)
        most = 2 * INTERPOLANT_ERROR * np.exp(log.max(-1) + steepest / 2 - peak[:, index])
    hidden[:, index] = np.where(np.isfinite(most), most, np.inf)
    return hidden


def _interpolate(value: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return second-kind Chebyshev coefficients `(panels, KEPT_COEFFICIENTS)`, their error bound on
    the panel, and whether they decayed."""
    first = _transformed(value, TRANSFORM)
    first[:, 0] /= 2
    largest = np.abs(first).max(-1)
    tail = np.abs(first[:, KEPT_COEFFICIENTS:]).max(-1)
    floor = LEBESGUE * EPS * size.max(-1)
    second = first[:, :KEPT_COEFFICIENTS] / 2
    second[:, 0] *= 2
    second[:, :-2] -= first[:, 2:KEPT_COEFFICIENTS] / 2
    decayed = np.isfinite(floor) & (tail <= np.maximum(DECAYED * largest, floor))
    return second, NODES * (8 * tail + floor), decayed


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
        roots = isolate(coefficients[rows, :degree], noise[rows] + weight[rows, degree:].sum(-1))
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
