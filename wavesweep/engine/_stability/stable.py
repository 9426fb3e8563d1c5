"""Stable intervals along one of the two numbers of a cut, for a whole batch of loops at once."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._monodromy.cut import (
    ERRORS,
    FIRST,
    MATRICES,
    SECOND,
    CutColumns,
    LinearFractional,
)
from wavesweep.engine._monodromy.periodic import size_of
from wavesweep.engine._monodromy.radius import cut_within
from wavesweep.engine._monodromy.rounding import UNEVEN, uneven_units
from wavesweep.engine._stability.crossings import (
    crossings,
    roots_of,
    sampled_polynomial,
    warp_scale,
)
from wavesweep.engine._stability.intervals import (
    Intervals,
    by_slice,
    doubts_of,
    intervals_of,
    without_any,
)
from wavesweep.engine._stability.regions import Regions, regions
from wavesweep.engine._stability.spectrum import count_outside
from wavesweep.engine.doubles import EPS
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.rows import different

if TYPE_CHECKING:
    from collections.abc import Callable

    from wavesweep.engine._stability.crossings import Polynomial

    # Regions and doubts of columns within a span; which of them another method follows on.
    _Method = Callable[[CutColumns, tuple[float, float], np.ndarray], tuple[Regions, np.ndarray]]

# states; the coefficients of a polynomial of a higher degree have lost the digits that a proof
# needs
MOST_POLYNOMIAL_STATES = 64
STATES_CLOSELY = 16  # beyond which arcs take less time than close bounds: a chain of 12 masses
ROUGH_FRAME = 1e-6  # of the entries of a frame, errors that may hide a crossing


@np.errstate(
    divide="ignore", invalid="ignore", over="ignore"
)  # results that are not finite show what overflowed
def stable_intervals(
    cut: LinearFractional,
    parameter: str,
    span: tuple[float, float],
    fixed: np.ndarray,
    radius: np.ndarray | None = None,
) -> Intervals:
    """Return all stable intervals of `parameter` (FIRST or SECOND) within `span`, for every loop and
    every value of the other one.

    cut: loops, batch shape `(slices,)`. span: (low, high). fixed: `(slices, columns)`, values of
    the other number. radius: `(slices,)`, of a circle in place of the unit circle, up to 1.

    Crossings are the roots of one real polynomial per column (`crossings`), polished in state space
    (`boundary`). A column is certified if three conditions hold. Smith's
    discs prove that the polynomial has no further real root for any
    coefficients within their measured error (`isolate`), so that no pair of crossings can hide.
    Both ends satisfy the characteristic equation to rounding, and rounding of the loop's own
    entries cannot move them by more (`boundary.end_errors`). The counts of unstable eigenvalues
    follow by the crossings' directions, from region to region and from one number per loop, on
    which the eigenvalues counted in its first and last column agree (`regions`). Loops with more
    than MOST_POLYNOMIAL_STATES states are followed on arcs of the circle instead (`arcs`). Columns
    that fail are in doubt, and the regions whose label is not known are left out: they may be
    computed again as along any number (`along_any`). If the frame of a loop overflows, nothing is
    known of it. Accuracy: ends to about 1e-12 relative, measured against arithmetic of 50 digits or
    more; at the least 1e-9 of the end and a hundred-thousandth of the span together.
    """
    fixed = np.asarray(fixed, float)
    if parameter != FIRST and cut.integrates and np.any(fixed == 0):
        return _along_second(cut, span, fixed, radius)
    cut = cut if radius is None else cut_within(cut, radius)
    flat = fixed.reshape(-1)
    owner = np.repeat(np.arange(fixed.shape[0]), fixed.shape[-1])
    columns = CutColumns(_in_even_units(cut), owner, parameter, flat)
    intervals = _by_each_method(columns, span)
    return _with_zero(_with_uncontrolled(intervals, cut, owner, span), span)


def _with_zero(intervals: Intervals, span: tuple[float, float]) -> Intervals:
    """The intervals, whose ends at 0 within the span are 0, and not what rounding leaves."""
    if not span[0] < 0 < span[1]:
        return intervals
    nothing = EPS * (span[1] - span[0])
    low = np.where(np.abs(intervals.low) <= nothing, 0.0, intervals.low)
    high = np.where(np.abs(intervals.high) <= nothing, 0.0, intervals.high)
    return replace(intervals, low=low, high=high)


def _with_uncontrolled(
    intervals: Intervals, cut: LinearFractional, owner: np.ndarray, span: tuple[float, float]
) -> Intervals:
    """The intervals, without any in columns of which a block that the numbers do not act on is
    unstable, or may be."""
    if not cut.uncontrolled:
        return intervals
    outside = np.zeros(cut.batch, int)
    for block in cut.uncontrolled:
        E = np.broadcast_to(block, (*cut.batch, *block.shape[-2:]))
        count, clear = count_outside(E)
        outside = np.where((outside < 0) | ~clear, -1, outside + count)
    outside = outside[owner]
    return without_any(without_any(intervals, outside > 0), outside < 0, span, Doubt.COUNTS)


def _in_even_units(cut: LinearFractional) -> LinearFractional:
    """Return the loops in states of such units that none of their entries is large, see
    `uneven_units`."""

    def of_each(matrix: np.ndarray) -> np.ndarray:
        return np.broadcast_to(matrix, (*cut.batch, *matrix.shape[-2:]))

    def largest(matrix: np.ndarray) -> np.ndarray:
        return np.abs(of_each(matrix)).max((-1, -2), initial=0.0)

    with np.errstate(over="ignore", invalid="ignore"):
        of_E = largest(cut.E)
        through = largest(cut.B) * largest(cut.C)
        uneven = np.flatnonzero((np.maximum(of_E, through) > UNEVEN) & np.isfinite(of_E + through))
    if not uneven.size:
        return cut
    n = cut.E.shape[-1]
    sizes = np.zeros((uneven.size, n + 1, n + 1))
    sizes[:, :n, :n] = of_each(cut.E)[uneven]
    sizes[:, :n, n] = of_each(cut.B)[uneven, :, 0]
    sizes[:, n, :n] = np.abs(of_each(cut.C)[uneven]).max(-2)
    units = uneven_units(sizes)
    units = (units[:, :n] / units[:, n:])[:, None, :]
    back = units.mT
    changed: dict[str, Any] = {}
    for name in ("E", "dE"):
        changed[name] = of_each(getattr(cut, name)).copy()
        changed[name][uneven] *= units / back
    for name in ("B", "dB"):
        changed[name] = of_each(getattr(cut, name)).copy()
        changed[name][uneven] /= back
    for name in ("C", "dC"):
        changed[name] = of_each(getattr(cut, name)).copy()
        changed[name][uneven] *= units
    return replace(cut, **changed)


def _by_each_method(columns: CutColumns, span: tuple[float, float]) -> Intervals:
    """Return the intervals of the columns, each by the first method that proves it, or else by the last.
    What a method does not prove of columns that are `followed` by another one is left to that."""
    pending = np.arange(columns.size)
    answered = np.zeros(columns.size, bool)
    done = []
    cut, overflown = _finite(columns.cut)
    columns = replace(columns, cut=cut)
    owner = columns.owner
    # whose poles at z = 1 may be divided out
    divided = (columns.fixed == 0) & (cut.poles_at_one > 0)
    methods = [_by_arcs] if cut.late else _methods(cut.order)
    for method in methods:
        rows = pending[divided[pending]] if method is _by_polynomial_alone else pending
        if not rows.size:
            continue
        lost = overflown[owner[rows]]
        followed = np.zeros(rows.size, bool)
        if method is not methods[-1]:
            followed = ~lost & (_by_arcs in methods or divided[rows])
        labelled, doubt = method(columns.some(rows), span, followed)
        labelled = replace(
            labelled, unstable=np.where(lost[labelled.column], -1, labelled.unstable)
        )
        doubt = np.where(lost, Doubt.OVERFLOW, doubt)
        answered_now = (doubt == Doubt.NONE) | ~followed
        answers = labelled.take(answered_now[labelled.column])
        kind = Intervals.FIRST_ORDER if method is _by_arcs else Intervals.ENCLOSED
        answers = replace(answers, column=rows[answers.column])
        arguments = np.full(rows.size, kind)[answered_now]
        done.append((answers, rows[answered_now], doubt[answered_now], arguments))
        answered[rows[answered_now]] = True
        pending = np.flatnonzero(~answered)
    pieces, answered_rows, doubts, kinds = zip(*done, strict=True)
    order = np.argsort(np.concatenate(answered_rows))
    doubt = np.concatenate(doubts)[order]
    argument = np.concatenate(kinds)[order]
    joined = Regions.join(pieces)
    if len(pieces) > 1:
        joined = joined.take(np.argsort(joined.column, kind="stable"))
    period = np.broadcast_to(cut.period, cut.batch)[owner]
    return intervals_of(joined, doubt, period, argument)


def _methods(order: int) -> list[_Method]:
    """The methods for loops of so many states, in their order."""
    if order > MOST_POLYNOMIAL_STATES:
        return [_by_arcs]
    if order > 8:  # up to 8 states coefficients have the digits for all that arcs prove
        return [_by_polynomial, _by_polynomial_alone, _by_arcs]
    return [_by_polynomial, _by_polynomial_alone]


def _finite(cut: LinearFractional) -> tuple[LinearFractional, np.ndarray]:
    """Return the loops with those that overflowed replaced by zeros, and which these are."""
    finite = [np.isfinite(matrix).all((-1, -2)) for matrix in (cut.E, cut.B, cut.C, cut.D)]
    bad = ~np.broadcast_to(np.logical_and.reduce(finite), cut.batch)
    if bad.any():
        zeros: dict[str, Any] = {}
        for name in (*MATRICES, *ERRORS):
            zeros[name] = np.where(bad[..., None, None], 0.0, getattr(cut, name))
        cut = replace(cut, **zeros)
    return cut, bad


def _by_polynomial(
    columns: CutColumns, span: tuple[float, float], followed: np.ndarray, *, alone: bool = False
) -> tuple[Regions, np.ndarray]:
    """Return regions and doubts from one polynomial per loop, shared by all its columns.

    followed: `(columns,)`, whether another method is there for a column: it is left to that one if
    its roots are not proved.
    """
    cut = columns.cut

    def sampled() -> Polynomial:
        scale = np.broadcast_to(warp_scale(cut, alone=alone), cut.batch)
        return sampled_polynomial(cut, columns.along, scale, alone=alone)

    polynomial = cut.remembered((columns.along, alone), sampled)
    roots = roots_of(polynomial, columns.owner, columns.fixed)
    divided = (columns.fixed == 0) & (cut.poles_at_one > 0) & (not alone)
    dear = cut.E.shape[-1] > STATES_CLOSELY
    open_ = np.flatnonzero(~roots.complete & ~divided & ~(followed & dear))
    if open_.size:  # by bounds that take longer
        loops = different(columns.owner[open_])
        closely = sampled_polynomial(
            cut.at(loops), columns.along, polynomial.scale[loops], alone=alone, closely=True
        )
        polynomial = polynomial.with_others(loops, closely)
        again = roots_of(polynomial, columns.owner[open_], columns.fixed[open_])
        roots = roots.with_others(open_, again)
    rows = np.flatnonzero(roots.complete | ~followed)
    doubt = np.full(columns.size, Doubt.CROWDED)
    if not rows.size:
        return Regions.none(), doubt
    answered = columns.some(rows)
    crossed = crossings(answered, span, polynomial, roots.take(rows))
    labelled = regions(answered, span, crossed)
    doubt[rows] = doubts_of(labelled, np.where(crossed.complete, Doubt.NONE, Doubt.CROWDED))
    return replace(labelled, column=rows[labelled.column]), doubt


def _by_polynomial_alone(
    columns: CutColumns, span: tuple[float, float], followed: np.ndarray
) -> tuple[Regions, np.ndarray]:
    """The same for columns whose other number is 0, of loops that have poles at z = 1, which are
    divided out."""
    return _by_polynomial(columns, span, followed, alone=True)


def _by_arcs(
    columns: CutColumns, span: tuple[float, float], _: np.ndarray
) -> tuple[Regions, np.ndarray]:
    """The same from interpolants on arcs of the circle, for loops of more states than a
    polynomial has digits for."""
    from wavesweep.engine._stability.arcs import arc_crossings, columns_together

    cut = columns.cut
    # an arc counts no errors of entries
    rough = cut.remembered("rough", lambda: _is_rough(cut))[columns.owner]
    step = columns_together(cut)
    parts = []
    doubts = []
    for first in range(0, columns.size, step):
        some = slice(first, first + step)
        crossed = arc_crossings(columns.apart(some), span)
        labelled = regions(columns.some(some), span, crossed)
        doubt = doubts_of(labelled, np.where(crossed.complete, Doubt.NONE, Doubt.CROWDED))
        parts.append(replace(labelled, column=first + labelled.column))
        doubts.append(np.where(rough[some], np.maximum(doubt, Doubt.ROUNDING), doubt))
    return Regions.join(parts), np.concatenate(doubts)


def _is_rough(cut: LinearFractional) -> np.ndarray:
    """Whether errors of the entries of a frame, in no units of the states small, may hide a
    crossing that none points to."""
    E = np.broadcast_to(np.abs(cut.E), (*cut.batch, *cut.E.shape[-2:]))
    dE = np.broadcast_to(cut.dE, (*cut.batch, *cut.dE.shape[-2:]))
    with np.errstate(all="ignore"):
        error = np.sqrt((dE * (E + dE).mT).max((-1, -2), initial=0.0))
        return error > ROUGH_FRAME * np.maximum(1.0, size_of(E))


def _along_second(
    cut: LinearFractional, span: tuple[float, float], fixed: np.ndarray, radius: np.ndarray | None
) -> Intervals:
    """Return `stable_intervals` along the second number if the first, K, is 0 in some columns.

    Where K = 0 nothing reads the integrator, so its eigenvalue z = 1 is none of the loop's: these
    columns are those of loops without it.
    """
    K = fixed.reshape(-1)
    loop_of = np.repeat(np.arange(fixed.shape[0]), fixed.shape[-1])
    without_integrator = replace(cut, integrates=False)
    intervals = []
    for loops, mask in ((cut, K != 0), (without_integrator, K == 0)):
        columns = np.flatnonzero(mask)
        if not columns.size:
            continue
        index = loop_of[columns]
        radii = None if radius is None else radius[index]
        intervals_of_group = stable_intervals(
            loops.at(index), SECOND, span, K[columns, None], radii
        )
        intervals.append(replace(intervals_of_group, column=columns[intervals_of_group.column]))
    return by_slice(intervals)
