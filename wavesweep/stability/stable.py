"""Stable intervals along a wall parameter, for a whole batch of loops at once."""

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.columns import Rows
from wavesweep.monodromy.cut import ADVANCE, ERRORS, OFFSET, PARTS, Cut, V
from wavesweep.monodromy.periodic import size_of
from wavesweep.monodromy.radius import cut_within
from wavesweep.monodromy.rounding import balance
from wavesweep.stability.arcs import arc_crossings
from wavesweep.stability.boundary import K_VE
from wavesweep.stability.certificate import COUNTS, CROWDED, NONE, OVERFLOW, ROUNDING
from wavesweep.stability.crossings import crossings, sampled_polynomial, warp_scale
from wavesweep.stability.regions import Regions, cut_span, regions
from wavesweep.stability.spectrum import count_outside

MOST_STATES = 64  # states; the coefficients of a polynomial of a higher degree have lost the digits that a proof needs
UNEVEN, SWEEPS = 1e6, 12  # size of an entry, from which on the states get other units; sweeps of that
HELPFUL = 1e-3  # of the largest entry, below which it has to be in these
BEYOND_ORDER, TRACE_ROUNDING = 1.001, 1e-8  # of the number of eigenvalues, and of its terms, what a trace has to exceed
ROUGH = 1e-6  # of the entries of a frame, errors that may hide a crossing


@dataclass(frozen=True, slots=True)
class Intervals(Rows):
    """One element per stable interval, or one with index -1 for a column that has none; sorted by column, then value.

    column: index into the columns in C order, `slice * fixed.shape[-1] + position`. index: 0, 1, ... within the column. count:
    stable intervals of the column. low, high: ends (N/m or N*s/m), NaN without interval. low_omega, high_omega: rad/s of the
    oscillation that starts there, NaN if the range, or the known part of it, ends the interval. doubt: reason why the column is
    not certified, NONE if it is (codes of `wavesweep.stability.certificate`). residual: the largest relative residual of the
    characteristic equation at crossings of the interval, 0 if there are none.
    """

    column: np.ndarray
    index: np.ndarray
    count: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_omega: np.ndarray
    high_omega: np.ndarray
    doubt: np.ndarray
    residual: np.ndarray

    @property
    def certified(self) -> np.ndarray:
        """Whether each element's column is proved as a whole."""
        return self.doubt == NONE

    def mirrored(self) -> "Intervals":
        """Return the intervals of a parameter of which this one is the negative."""
        ends = {"low": 0.0 - self.high, "high": 0.0 - self.low, "low_omega": self.high_omega, "high_omega": self.low_omega}
        found = replace(self, **ends, index=np.where(self.index < 0, -1, self.count - 1 - self.index))
        return found.take(np.lexsort((found.index, found.column)))


def joined(parts) -> Intervals:
    """Return the intervals of parts, the same columns in neighbouring ranges; the gravest doubt is that of a whole column."""
    whole = Intervals.join(parts)
    whole = whole.take(np.lexsort((whole.low, whole.column)))  # NaN, of a range without an interval, goes last
    stable, size = whole.index >= 0, int(whole.column.max(initial=-1)) + 1
    count, doubt = np.bincount(whole.column[stable], minlength=size), np.zeros(size, int)
    np.maximum.at(doubt, whole.column, whole.doubt)
    first = np.append(True, np.diff(whole.column) != 0)[: whole.column.size]
    whole = whole.take(stable | (first & (count[whole.column] == 0)))
    column = whole.column
    index = np.arange(column.size) - np.searchsorted(column, column)
    return replace(whole, index=np.where(count[column] > 0, index, -1), count=count[column], doubt=doubt[column])


def without_seams(found: Intervals) -> Intervals:
    """Return intervals in which those are one that meet at an end where nothing crosses."""
    seam = (found.high[:-1] == found.low[1:]) & (found.column[:-1] == found.column[1:])
    seam &= np.isnan(found.high_omega[:-1]) & np.isnan(found.low_omega[1:])
    first, last = np.flatnonzero(np.append(True, ~seam)), np.flatnonzero(np.append(~seam, True))
    if first.size == found.column.size or not first.size:
        return found
    ends = {name: getattr(found, name)[last] for name in ("high", "high_omega")}
    column, stable = found.column[first], found.index[first] >= 0
    index = np.where(stable, np.arange(column.size) - np.searchsorted(column, column), -1)
    count, size = np.bincount(column[stable], minlength=column.max() + 1), np.maximum.reduceat(found.residual, first)
    return replace(found.take(first), **ends, index=index, count=count[column], residual=size)


@np.errstate(divide="ignore", invalid="ignore", over="ignore")  # what overflows is told from what it leaves
def stable_intervals(cut: Cut, along: str, span, fixed, radius=None) -> Intervals:
    """Return all stable intervals of `along` ("K_VE" or "B_VE") within `span`, for every loop and every value of the other one.

    cut: loops, batch shape `(slices,)`. span: (low, high). fixed: `(slices, columns)`, values of the other wall parameter.
    radius: `(slices,)`, of a circle in place of the unit circle, up to 1.

    Crossings are the roots of one real polynomial per column (`crossings`), polished in state space (`boundary`). A column is
    certified if three conditions hold. The signs of Bernstein coefficients, or Smith's discs, prove that the polynomial has no
    further real root for any coefficients within their measured error (`isolate`), so that no pair of crossings can hide. Both
    ends satisfy the characteristic equation to rounding, and rounding of the loop's own entries cannot move them by more
    (`boundary.end_errors`). The counts of unstable eigenvalues follow by the crossings' directions, from region to region and
    from one number per loop, on which the eigenvalues counted in its first and last column agree (`regions`). Columns that are
    unstable for every wall are certified so from their trace. Columns that fail are computed again on arcs in state space
    (`arcs`); if they fail again, they are in doubt, and the regions whose label is not known are left out. If the frame of a
    loop overflows, nothing is known of it.
    Accuracy: ends to about 1e-12 relative, measured against arithmetic of 50 digits or more; at the least 1e-9 of the end and a
    hundred-thousandth of the span together.
    """
    fixed = np.asarray(fixed, float)
    if along != K_VE and cut.integrates and np.any(fixed == 0):
        return _joined(cut, along, span, fixed, radius)
    cut = cut if radius is None else cut_within(cut, radius)
    flat, owner = fixed.reshape(-1), np.repeat(np.arange(fixed.shape[0]), fixed.shape[-1])
    found = _with_others(_by_each_method(_in_own_units(cut), owner, along, flat, span), cut, owner)
    if not span[0] < 0 < span[1]:
        return found
    nothing = np.finfo(float).eps * (span[1] - span[0])  # an end at 0 within the span is 0, and not what rounding leaves
    return replace(found, **{end: np.where(np.abs(v := getattr(found, end)) <= nothing, 0.0, v) for end in ("low", "high")})


def _with_others(found, cut, owner) -> Intervals:
    """The intervals, without any in columns of which a part that the wall does not act on is unstable, or may be."""
    if not cut.others:
        return found
    outside = np.zeros(cut.batch, int)
    for block in cut.others:
        E = np.broadcast_to(block, (*cut.batch, *block.shape[-2:]))
        count, clear = count_outside(E)
        outside = np.where((outside < 0) | ~clear, -1, outside + count)
    outside = outside[owner]
    return without_any(without_any(found, outside > 0), outside < 0, COUNTS)


def without_any(found: Intervals, columns, doubt: int = NONE) -> Intervals:
    """Return the intervals with none in some columns, a mask; doubt: the reason why nothing is known of them, if it is not."""
    some = columns[found.column]
    if not some.any():
        return found
    empty = found.take(some)
    empty = empty.take(np.unique(empty.column, return_index=True)[1])
    size = empty.column.size
    nothing = dict.fromkeys(("low", "high", "low_omega", "high_omega"), np.full(size, np.nan))
    none = {"index": np.full(size, -1), "count": np.zeros(size, int), "residual": np.zeros(size)}
    reasons = np.full(size, NONE) if doubt == NONE else np.maximum(empty.doubt, doubt)
    whole = Intervals.join([found.take(~some), replace(empty, **nothing, **none, doubt=reasons)])
    return whole.take(np.argsort(whole.column, kind="stable"))


def uneven_units(sizes):
    """Return units of the states, `(matrices, n)`, in which no entry is large; 1 if they are not UNEVEN, or no units help.

    sizes: of the entries, `(matrices, n, n)`. States of a transfer function are derivatives of each other, whose sizes differ
    by powers of its poles; entries of a frame that grows are large in any units.
    """
    units, largest = np.ones(sizes.shape[:-1]), np.abs(sizes).max((1, 2), initial=0.0)
    some = np.flatnonzero(largest > UNEVEN)
    if some.size:
        better, found = balance(sizes[some], SWEEPS)
        helps = np.abs(better).max((1, 2)) < HELPFUL * largest[some]
        units[some[helps]] = found[helps]
    return units


def _in_own_units(cut: Cut) -> Cut:
    """Return the loops in states of such units that none of their entries is large, see `uneven_units`."""
    E, B, C = (np.broadcast_to(part, (*cut.batch, *part.shape[-2:])) for part in (cut.E, cut.B, cut.C))
    with np.errstate(over="ignore", invalid="ignore"):
        own, into, out = (np.abs(part).max((-1, -2), initial=0.0) for part in (E, B, C))
        some = np.flatnonzero((np.maximum(own, into * out) > UNEVEN) & np.isfinite(own + into * out))
    if not some.size:
        return cut
    dE, dB, dC = (np.broadcast_to(part, (*cut.batch, *part.shape[-2:])).copy() for part in (cut.dE, cut.dB, cut.dC))
    n, (E, B, C) = E.shape[-1], (part.copy() for part in (E, B, C))
    whole = np.zeros((some.size, n + 1, n + 1))
    whole[:, :n, :n], whole[:, :n, n], whole[:, n, :n] = E[some], B[some, :, 0], np.abs(C[some]).max(-2)
    units = uneven_units(whole)
    units = (units[:, :n] / units[:, n:])[:, None, :]
    back = np.swapaxes(units, -1, -2)
    for e, b, c in ((E, B, C), (dE, dB, dC)):
        e[some], b[some], c[some] = e[some] * (units / back), b[some] / back, c[some] * units
    return replace(cut, E=E, B=B, C=C, dE=dE, dB=dB, dC=dC)


def _by_each_method(cut, owner, along, fixed, span) -> Intervals:
    """Return the intervals of the columns with the loops `cut.at(owner)`, each by the first method that proves it."""
    pending, done = np.arange(fixed.size), []
    cut, overflown = _finite(cut)
    for method in (_by_trace, _by_polynomial, _by_polynomial_alone, _by_arcs):
        some = pending[_suit(method, cut, fixed[pending])]
        if not some.size:
            continue
        parts, doubt = method(cut, owner[some], along, fixed[some], span)
        lost = overflown[owner[some]]
        parts = replace(parts, unstable=np.where(lost[parts.column], -1, parts.unstable))
        doubt = np.where(lost, OVERFLOW, doubt)
        kept = (doubt == NONE) | lost | (method is _by_arcs)
        done.append((_select(parts, kept, some), some[kept], doubt[kept]))
        pending = np.setdiff1d(pending, some[kept], assume_unique=True)
    return intervals_of(*_sorted(done), np.broadcast_to(cut.period, cut.batch)[owner])


def _suit(method, cut, fixed):
    """Which columns a method is for."""
    few = cut.order <= MOST_STATES
    if method is _by_polynomial_alone:
        return (fixed == 0) & few & (cut.poles_at_one > 0)
    return np.full(fixed.size, few or method is not _by_polynomial)


def _finite(cut) -> tuple[Cut, np.ndarray]:
    """Return the loops with those that overflowed replaced by zeros, and which these are."""
    bad = ~np.broadcast_to(np.logical_and.reduce([np.isfinite(getattr(cut, p)).all((-1, -2)) for p in "EBCD"]), cut.batch)
    if bad.any():
        cut = replace(cut, **{p: np.where(bad[..., None, None], 0.0, getattr(cut, p)) for p in (*PARTS, *ERRORS)})
    return cut, bad


def _by_trace(cut, owner, along, fixed, span):
    """Return columns with a single region, unstable throughout; proved if that is certain."""
    nowhere = np.zeros(0)
    whole = cut_span(span, fixed.size, nowhere.astype(int), nowhere, nowhere, nowhere)
    everywhere = np.ones(fixed.size, int)
    parts = whole.labelled(everywhere, 0 * everywhere, nowhere.astype(int), nowhere)
    return parts, np.where(trace_excludes_stability(cut, owner, along, fixed, span), NONE, CROWDED)


def _by_polynomial(cut, owner, along, fixed, span, *, alone=False):
    """Return regions and doubts from one polynomial per loop, shared by all its columns."""
    polynomial = sampled_polynomial(cut, along, np.broadcast_to(warp_scale(cut, alone=alone), cut.batch), alone=alone)
    return _judged(cut, owner, along, fixed, span, crossings(cut, owner, along, fixed, span, polynomial))


def _by_polynomial_alone(*columns):
    """The same for columns whose other wall parameter is 0, of loops that have poles at z = 1, which are divided out."""
    return _by_polynomial(*columns, alone=True)


def _by_arcs(cut, owner, along, fixed, span):
    return _judged(cut, owner, along, fixed, span, arc_crossings(cut.at(owner), along, fixed, span))


def _judged(cut, owner, along, fixed, span, found) -> tuple[Regions, np.ndarray]:
    """Return the regions between the crossings, and the doubt of each column."""
    parts = regions(cut, owner, along, fixed, span, found)
    parts_doubt = doubts_of(parts, np.where(found.complete, NONE, CROWDED))
    return parts, np.where(_is_rough(cut)[owner], np.maximum(parts_doubt, ROUNDING), parts_doubt)


def _is_rough(cut):
    """Whether errors of the entries of a frame, in no units of the states small, may hide a crossing that none points to."""
    E, dE = (np.broadcast_to(part, (*cut.batch, *part.shape[-2:])) for part in (np.abs(cut.E), cut.dE))
    with np.errstate(all="ignore"):
        error = np.sqrt((dE * np.swapaxes(E + dE, -1, -2)).max((-1, -2), initial=0.0))
        return error > ROUGH * np.maximum(1.0, size_of(E))


def doubts_of(parts: Regions, doubt) -> np.ndarray:
    """Return the gravest doubt of each column: its own, and those of its regions.

    A region without a label leaves at least COUNTS.
    """
    doubt = np.array(doubt)
    np.maximum.at(doubt, parts.column, np.where(parts.unstable < 0, np.maximum(parts.doubt, COUNTS), parts.doubt))
    return doubt


def _select(parts, kept, names) -> Regions:
    """Return the regions of the columns `kept`, the columns renamed to `names`."""
    taken = parts.take(kept[parts.column])
    return replace(taken, column=names[taken.column])


def _sorted(done) -> tuple[Regions, np.ndarray]:
    """Return all regions in the order of their columns, and the doubt of each column.

    done: (regions, columns, their doubts).
    """
    parts = [part for part, _, _ in done]
    doubt = np.concatenate([some for _, _, some in done])[np.argsort(np.concatenate([names for _, names, _ in done]))]
    if len(parts) == 1:
        return parts[0], doubt
    whole = Regions.join(parts)
    return whole.take(np.argsort(whole.column, kind="stable")), doubt


def intervals_of(r: Regions, doubt, period) -> Intervals:
    """Return runs of regions with no unstable eigenvalue, and an empty row for columns without any.

    doubt: `(columns,)`, codes. period: of each column's frame, s.
    """
    stable = r.unstable == 0
    same = np.append(np.diff(r.column) == 0, False)  # the next region is in the same column
    begins = stable & ~np.append(False, (same & stable)[:-1])
    ends = stable & ~(same & np.append(stable[1:], False))
    first, last = np.flatnonzero(begins), np.flatnonzero(ends)
    count = np.bincount(r.column[first], minlength=period.size)
    none = np.flatnonzero(count == 0)
    column = np.concatenate([r.column[first], none])
    order = np.argsort(column, kind="stable")
    empty = np.full(none.size, np.nan)
    omega = [theta / period[r.column[at]] for theta, at in ((r.low_theta[first], first), (r.high_theta[last], last))]
    start = np.concatenate([[0], np.cumsum(np.maximum(count, 1))[:-1]])
    column = column[order]
    error = np.concatenate([np.maximum(r.residual[first], r.residual[last]), np.zeros(none.size)])[order]
    return Intervals(
        column,
        np.where(count[column] > 0, np.arange(column.size) - start[column], -1),
        count[column],
        *(np.concatenate([part, empty])[order] for part in (r.low[first], r.high[last], *omega)),
        doubt[column],
        error,
    )


def _joined(cut, along, span, fixed, radius) -> Intervals:
    """Return the intervals along B_VE if some columns have K_VE = 0.

    Nothing reads the scene's position in these columns, and z = 1 is no pole.
    """
    flat, owner = fixed.reshape(-1), np.repeat(np.arange(fixed.shape[0]), fixed.shape[-1])
    parts = []
    for loop, mask in ((cut, flat != 0), (replace(cut, integrates=False), flat == 0)):
        names = np.flatnonzero(mask)
        if names.size:
            own = None if radius is None else radius[owner[names]]
            part = stable_intervals(loop.at(owner[names]), along, span, flat[names, None], own)
            parts.append(replace(part, column=names[part.column]))
    whole = Intervals.join(parts)
    return whole.take(np.argsort(whole.column, kind="stable"))


def trace_excludes_stability(cut: Cut, owner, along: str, fixed, span):
    """Return columns whose closed loop has a trace beyond the number of its eigenvalues on the whole span: one lies outside.

    A tick that is unstable by itself grows so much within a frame that the frame's matrix keeps no digit of its small
    eigenvalues, and double precision permits no finer statement. The trace, the sum of the eigenvalues, is a quotient of linear
    functions of the wall parameter: without a pole in the span its extremes are at the ends.
    """
    with np.errstate(all="ignore"):
        base = cut.order + np.trace(cut.E, axis1=-2, axis2=-1)
        gain = (cut.C * np.swapaxes(cut.B, -1, -2)).sum(-1)
        x, v = gain[..., OFFSET] + (cut.D[..., ADVANCE, 0] if cut.integrates else 0), gain[..., V]
        errors = (cut.dC * np.abs(np.swapaxes(cut.B, -1, -2)) + np.abs(cut.C) * np.swapaxes(cut.dB, -1, -2)).sum(-1)
        dx, dv = errors[..., OFFSET] + (cut.dD[..., ADVANCE, 0] if cut.integrates else 0), errors[..., V]
        off = np.trace(cut.dE, axis1=-2, axis2=-1)
        through_x, through_v = cut.D[..., OFFSET, 0], cut.D[..., V, 0]
        traces, sizes, missed, through = [], [], [], []
        for end in span:
            K, B = (end, fixed) if along == K_VE else (fixed, end)
            through.append(1 - K * through_x[owner] - B * through_v[owner])
            traces.append(base[owner] + (K * x[owner] + B * v[owner]) / through[-1])
            part = (np.abs(K * x[owner]) + np.abs(B * v[owner])) / np.abs(through[-1])
            sizes.append(np.abs(base[owner]) + part)
            lost = np.abs(K) * cut.dD[..., OFFSET, 0][owner] + np.abs(B) * cut.dD[..., V, 0][owner]
            missed.append(off[owner] + (np.abs(K) * dx[owner] + np.abs(B) * dv[owner] + part * lost) / np.abs(through[-1]))
        beyond = [
            np.abs(t) - more > np.maximum(BEYOND_ORDER * cut.order, TRACE_ROUNDING * s)
            for t, s, more in zip(traces, sizes, missed, strict=True)
        ]
        return beyond[0] & beyond[1] & (traces[0] * np.sign(traces[1]) > 0) & (through[0] * through[1] > 0)
