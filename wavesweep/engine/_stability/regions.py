"""Between the crossings: the count of unstable eigenvalues of each region, and whether it fits
the crossings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavesweep.engine._monodromy.cut import FIRST, SECOND, CutColumns, LinearFractional
from wavesweep.engine._monodromy.resolvent import Inverse, ManyStates
from wavesweep.engine._monodromy.unit_circle import on_circle
from wavesweep.engine._stability.boundary import end_errors
from wavesweep.engine._stability.crossings import DOUBLES_AT_END, SLIVER, Crossings
from wavesweep.engine._stability.spectrum import count_outside
from wavesweep.engine.doubles import EPS
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import Rows

# of a number that is fixed, within which a crossing along it leaves open what is outside there
NEAR_CROSSING = 1e-9
SMALL_RESIDUAL = 1e-9  # of what crosses inside an unstable part, where only the count matters
USUAL = 64.0  # times rounding: what a polished end may leave of its equation
FIRM = 1e-9  # of an end, what the errors of the loop's entries may move it by
# of the span, which an end is given in addition: one next to zero has few digits of itself
SHARE_OF_SPAN = 1e-5
ALWAYS_COUNTED = 1e-6  # of the span; eigenvalues of so small a region are always counted
# of a region's width: the count is the same at all, and clearer at some
CLEAR_SHARES = (0.5, 0.1, 0.9, 1e-3, 0.999, 1e-6)
MANY_SHARES = (*np.linspace(0, 1, 18)[1:-1], 1e-2, 1e-3, 1e-4, 1e-6)  # where it may not be the same


@dataclass(frozen=True, slots=True)
class Regions(Rows):
    """Consecutive parts of the swept range, sorted by column and value; no eigenvalue crosses the
    circle inside one.

    column, low, high; low_theta, high_theta: angle of the crossing at that end, NaN if only the
    range ends there. unstable: number of eigenvalues outside the unit circle; -1 if that is not
    known. doubt: reason why the region is in doubt (see `doubts`); NONE if rounding cannot change
    the label, both ends satisfy the characteristic equation, and the counts change in agreement
    with the crossings. residual: the larger of the ends' relative residuals (0 at an end of the
    range).
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_theta: np.ndarray
    high_theta: np.ndarray
    unstable: np.ndarray
    doubt: np.ndarray
    residual: np.ndarray

    @classmethod
    def none(cls) -> Regions:
        """Return no regions."""
        nothing = np.zeros(0)
        no_number = np.zeros(0, int)
        return cls(no_number, nothing, nothing, nothing, nothing, no_number, no_number, nothing)


@dataclass(frozen=True, slots=True)
class CutSpan:
    """A span cut at its crossings: regions sorted by column and value, before they are labelled.

    column, low, high, low_theta, high_theta: as in `Regions`. gain: growth of the number of
    unstable eigenvalues from the region before, as the crossings predict it. has_previous,
    has_next: whether a region has a neighbour below, or above, it in the same column. order: the
    crossings in the order of the regions' inner ends.
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_theta: np.ndarray
    high_theta: np.ndarray
    gain: np.ndarray
    has_previous: np.ndarray
    has_next: np.ndarray
    order: np.ndarray

    def at(self, share: float) -> np.ndarray:
        """Return a point of each region, a share of its width from its low end."""
        return self.low + share * (self.high - self.low)

    def labelled(
        self, unstable: np.ndarray, doubt: np.ndarray, end_doubt: np.ndarray, error: np.ndarray
    ) -> Regions:
        """Return regions from the counts and the doubt of each, and the doubt and the residual
        of each inner end."""
        doubt = doubt.copy()
        residual = np.zeros(self.column.size)
        end_doubt = np.where(
            error <= SMALL_RESIDUAL, end_doubt, np.maximum(end_doubt, Doubt.ROUNDING)
        )
        doubt[self.has_previous] = np.maximum(doubt[self.has_previous], end_doubt)
        doubt[self.has_next] = np.maximum(doubt[self.has_next], end_doubt)
        residual[self.has_previous] = error
        residual[self.has_next] = np.maximum(residual[self.has_next], error)
        ends = self.low, self.high, self.low_theta, self.high_theta
        return Regions(self.column, *ends, unstable, doubt, residual)


def cut_span(
    span: tuple[float, float], columns: int, crossings: Crossings, slack: tuple[float, float]
) -> CutSpan:
    """Cut the span of every column at its crossings.

    slack: distance from each end of the span within which a crossing counts as at that end.
    """
    low, high = span
    column = crossings.column
    value = crossings.value
    theta = crossings.theta
    doubles = np.spacing(np.maximum(abs(low), np.abs(value)))
    near_low = np.maximum(slack[0], DOUBLES_AT_END * doubles)
    at_low = np.abs(value - low) <= near_low
    at_high = np.abs(value - high) <= slack[1]
    inside = np.flatnonzero((value > low) & (value < high) & ~at_low & ~at_high)
    order = inside[np.lexsort((value[inside], column[inside]))]

    every = np.arange(columns)
    region = np.repeat(every, np.bincount(column[order], minlength=columns) + 1)
    start = np.searchsorted(column[order], every) + every  # where each column's first region stands
    later = np.ones(region.size, bool)
    later[start] = False
    earlier = np.append(later[1:], False)

    def filled(index: np.ndarray, values: np.ndarray, nothing: float) -> np.ndarray:
        """Values at regions of an index, and `nothing` in all others."""
        of_regions = np.full(region.size, nothing)
        of_regions[index] = values
        return of_regions

    lows = filled(later, value[order], float(low))
    highs = filled(earlier, value[order], float(high))
    low_theta = filled(later, theta[order], np.nan)
    low_theta[start[column[at_low]]] = theta[at_low]
    high_theta = filled(earlier, theta[order], np.nan)
    high_theta[np.flatnonzero(~earlier)[column[at_high]]] = theta[at_high]
    gain = filled(later, crossings.jump[order], 0.0)
    return CutSpan(region, lows, highs, low_theta, high_theta, gain, later, earlier, order)


def regions(columns: CutColumns, span: tuple[float, float], crossings: Crossings) -> Regions:
    """Cut the span of columns at the crossings and label the regions between them.

    The count of the first region of each column follows from that of infinite values, which is one
    number of the loop, and from the directions of all crossings between (`_first_counts`); the
    counts of the other regions follow from the directions of the crossings before them. If
    eigenvalues were counted in a column's first region, they are also counted in every region whose
    count comes to 0, which makes an interval stable; in narrow regions they are counted in all
    columns. Of a loop of many states, or one whose numbers are late, it follows from the count at 0
    (`_counts_from_zero`), where delays do not act on themselves. If the crossings of a column are
    not all proved, or one of its counts is not clear, every region of it is counted at many points,
    and a region has no label if these disagree.
    """
    slack = SLIVER * (span[1] - span[0])
    spans = cut_span(span, columns.size, crossings, (slack, slack))
    first = np.flatnonzero(~spans.has_previous)
    rise = np.cumsum(spans.gain)
    rise -= rise[first][spans.column]

    def matrices(index: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        column = spans.column[index]
        numbers = columns.numbers(column, value)
        loops = columns.loops(column)
        return loops.closed(*numbers), loops.errors_of_closed(*numbers)

    least = np.minimum.reduceat(rise, first)
    narrow = spans.high - spans.low < ALWAYS_COUNTED * (span[1] - span[0])
    follows = np.isfinite(crossings.growth_to_infinity) & ~narrow[first]

    def count_first(columns: np.ndarray) -> np.ndarray:
        return count_where_clear(spans, first[columns], matrices)

    if crossings.many is not None or columns.cut.late:
        low = np.full(columns.size, float(span[0]))
        begins = _counts_from_zero(columns, low, slack, crossings)
        counted = begins < 0
        unknown = np.flatnonzero(counted)
        begins[unknown] = count_first(unknown)
    else:
        begins, counted = _first_counts(
            columns.owner, crossings.growth_to_infinity, follows, least, count_first
        )
    unstable = (rise + begins[spans.column]).astype(int)
    doubt = np.zeros(spans.column.size, int)
    unknown = (begins < 0)[spans.column]  # nothing follows from a count that is not known
    unstable[unknown] = -1
    doubt[unknown] = Doubt.COUNTS
    stable = ~unknown & (unstable <= 0) & crossings.complete[spans.column]
    claimed = np.flatnonzero(spans.has_previous & stable & (narrow | counted[spans.column]))
    judged = count_where_clear(spans, claimed, matrices)
    doubt[claimed] = np.maximum(
        doubt[claimed], np.where(judged == unstable[claimed], Doubt.NONE, Doubt.COUNTS)
    )
    error, end_doubt = _judged_ends(columns, span, crossings, spans, unstable)
    labelled = spans.labelled(unstable, doubt, end_doubt, error)
    worst = np.where(crossings.complete, Doubt.NONE, Doubt.COUNTS)
    np.maximum.at(worst, labelled.column, labelled.doubt)
    again = np.flatnonzero(worst[spans.column] >= Doubt.COUNTS)
    if not again.size:
        return labelled
    unstable[again] = count_where_all_agree(spans, again, matrices)
    return replace(labelled, unstable=unstable)


def _first_counts(
    owner: np.ndarray,
    growth_to_infinity: np.ndarray,
    follows: np.ndarray,
    least: np.ndarray,
    count: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the number u of unstable eigenvalues in the first region of each column, -1 if not
    known, and whether it was counted there, `(columns,)`.

    At infinite values of the number z eigenvalues are outside, the zeros that the loop has there
    from the number's product to the signal that it multiplies: `z = u + g`, g the growth at all
    crossings, is one number of a loop, for any value of the other one. So the first and the last
    column of a loop are counted, and if both give the same z, `u = z - g` holds for those between,
    unless a later count `u + least` would be negative: then they are counted too.

    owner: the loop of each column. growth_to_infinity: g, see `Crossings`. follows: whether u may
    follow from it. least: the lowest count of a column's regions relative to u. count(columns):
    eigenvalues outside in the first regions, -1 if not known.
    """
    following = np.flatnonzero(follows)
    is_first = np.diff(owner[following], prepend=-1) != 0
    is_last = np.append(is_first[1:], True)[: following.size]
    counted = ~follows
    counted[following[is_first | is_last]] = True
    u = np.full(owner.size, -1)
    u[counted] = count(np.flatnonzero(counted))

    z = np.where(u < 0, np.nan, u + growth_to_infinity)
    z_first = z[following[is_first]]
    z_of_loop = np.where(z_first == z[following[is_last]], z_first, np.nan)
    inner = ~is_first & ~is_last
    between = following[inner]
    loop = np.cumsum(is_first)[inner] - 1
    u_between = z_of_loop[loop] - growth_to_infinity[between]
    agrees = u_between + least[between] >= 0
    u[between[agrees]] = u_between[agrees]
    again = between[~agrees]
    u[again] = count(again)
    counted[again] = True
    return u, counted


def _counts_from_zero(
    columns: CutColumns, to: np.ndarray, slack: float, crossings: Crossings
) -> np.ndarray:
    """Return the unstable eigenvalues of each column next to the value `to`, above it, by Nyquist's
    criterion; -1 if they do not follow.

    Without the number as many are outside as `_counts_at_zero` says. From there to the value all
    crossings are known with their directions: what is beyond the span on arcs is so on both sides.
    An integrator is on the circle at 0, and next to it outside on the side to which it leaves.
    """
    outside = _counts_at_zero(columns)
    column = crossings.column
    value = crossings.value
    end = to[column] + slack
    side = np.where(end >= 0, 1.0, -1.0)
    leaves_zero = columns.cut.integrates & (columns.along == FIRST) & (crossings.theta == 0.0)
    next_to_zero = ~leaves_zero & (np.abs(value) <= slack)
    above = (value > slack) & (value <= end)
    below = (value < -slack) & (value > end)
    between = (above | below) & ~leaves_zero
    change = np.where(between, side * crossings.jump, 0.0)
    change += np.where(leaves_zero, np.maximum(side * crossings.jump, 0.0), 0.0)
    counts = outside + np.bincount(column, change, minlength=columns.size)
    unclear = np.bincount(column[next_to_zero], minlength=columns.size) > 0
    return np.where((outside >= 0) & ~unclear & crossings.complete, counts, -1).astype(int)


def _counts_at_zero(columns: CutColumns) -> np.ndarray:
    """Return the unstable eigenvalues of each column at the value 0, -1 if they are not known.

    What is late is 0 without both numbers. With the fixed one alone they follow along that one from
    its value 0, where an integrator is set aside that nothing reads.
    """
    from wavesweep.engine._stability.arcs import arc_crossings

    every = np.arange(columns.size)
    fixed = columns.fixed
    if not columns.cut.late or not fixed.any():
        alone = replace(columns.loops(every), late=0)
        numbers = columns.numbers(every, np.zeros(columns.size))
        outside, sure = count_outside(alone.closed(*numbers), alone.errors_of_closed(*numbers))
        return np.where(sure, outside, -1)
    cut = columns.cut
    other_number = SECOND if columns.along == FIRST else FIRST
    cut = replace(cut, integrates=cut.integrates and other_number == FIRST)
    beside = CutColumns(cut, columns.owner, other_number, 0 * fixed).apart(every)
    span = min(0.0, fixed.min()), max(0.0, fixed.max())
    crossings = arc_crossings(beside, span)
    counts = _counts_from_zero(beside, fixed, SLIVER * (span[1] - span[0]), crossings)
    distance = np.abs(crossings.value - fixed[crossings.column])
    near = distance <= NEAR_CROSSING * np.abs(fixed[crossings.column])
    return np.where(np.bincount(crossings.column[near], minlength=fixed.size) > 0, -1, counts)


def _judged_ends(
    columns: CutColumns,
    span: tuple[float, float],
    crossings: Crossings,
    spans: CutSpan,
    unstable: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return residual and doubt of each inner end; ends of stable regions are in doubt if
    rounding could matter."""
    error = np.zeros(spans.order.size)
    doubt = np.zeros(spans.order.size, int)
    of_stable = np.flatnonzero(
        (unstable[spans.has_previous] == 0) | (unstable[spans.has_next] == 0)
    )
    ends = spans.order[of_stable]
    column = crossings.column[ends]
    value = crossings.value[ends]
    theta = crossings.theta[ends]
    places = columns.fixed[column], value, _place(theta), (theta == 0.0) | (theta == np.pi)
    least = SHARE_OF_SPAN * (span[1] - span[0])
    if crossings.many is None:
        resolvent = Inverse(crossings.inverses.take(crossings.inverse[ends], axis=0))
        residual, moved, usual = end_errors(
            columns.loops(column), columns.along, *places, resolvent, least
        )
    else:
        residual, moved, usual = _errors_of_many_states(
            columns.loops(0), columns.along, places, crossings.many, least
        )
    # At z = 1 an integrating loop meets the equation 0 = 0 at K = 0, by structure.
    error[of_stable] = np.where(columns.cut.integrates & (theta == 0.0), 0.0, residual)
    clear = error[of_stable] <= USUAL * (usual + EPS)
    firm = moved <= FIRM * (np.abs(value) + least)
    doubt[of_stable] = np.where(clear & firm, Doubt.NONE, Doubt.ROUNDING)
    return error, doubt


def _errors_of_many_states(
    loop: LinearFractional,
    parameter: str,
    places: tuple[np.ndarray, ...],
    many: ManyStates,
    least: float,
) -> np.ndarray:
    """`end_errors` of a single loop of many states, in portions."""
    errors = np.zeros((3, places[0].size))
    for first in range(0, places[0].size, many.most):
        portion = slice(first, first + many.most)
        fixed, value, w, on_axis = (array[portion] for array in places)
        errors[:, portion] = end_errors(
            loop, parameter, fixed, value, w, on_axis, many.at(w), least
        )
    return errors


def count_where_clear(
    spans: CutSpan, index: np.ndarray, matrices: Callable[..., Any]
) -> np.ndarray:
    """Count the regions `index` at the first of CLEAR_SHARES at which no eigenvalue is within
    rounding of the circle.

    The count is -1 if no share is clear. matrices(regions, value): the frame-to-frame matrices less
    identity of these regions at these values, and bounds on the errors of their entries.
    """
    unstable = np.full(index.size, -1)
    for share in CLEAR_SHARES:
        open_ = np.flatnonzero(unstable < 0)
        if not open_.size:
            break
        again = index[open_]
        count, sure = count_outside(*matrices(again, spans.at(share)[again]))
        unstable[open_[sure]] = count[sure]
    return unstable


def count_where_all_agree(
    spans: CutSpan, index: np.ndarray, matrices: Callable[..., Any]
) -> np.ndarray:
    """Count the regions `index` at all of MANY_SHARES at which the count is clear; -1 if it is
    clear at none, or differs."""
    unstable = np.full(index.size, -1)
    agreed = np.ones(index.size, bool)
    for share in MANY_SHARES:
        count, sure = count_outside(*matrices(index, spans.at(share)[index]))
        agreed &= ~sure | (unstable < 0) | (count == unstable)
        unstable = np.where(sure & (unstable < 0), count, unstable)
    return np.where(agreed, unstable, -1)


def _place(theta: np.ndarray) -> np.ndarray:
    """Return `w = exp(j theta) - 1`, exactly at both ends of the circle."""
    return np.where(theta == np.pi, -2.0, np.where(theta == 0.0, 0.0, on_circle(theta)))
