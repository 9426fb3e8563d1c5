"""Between the crossings: the count of unstable eigenvalues of each region, and whether it fits the crossings."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals.crossings import Crossings
from wavesweep.analysis.intervals.curve import K_VE, residual, terms
from wavesweep.analysis.intervals.rounding import shift
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.cut import Cut, close

SMALL_RESIDUAL = 1e-9  # of what crosses inside an unstable part, where only the count matters
USUAL = 64.0  # times rounding: what a polished end may leave of its equation
FIRM = 1e-9 / 16  # of an end, what one rounding of every entry of the loop may move it by; lifting a loop costs some more
NEAR_ZERO = 1e-5  # of the span, which an end is given in addition: one next to zero has few digits of itself
SHARES = (0.5, 0.1, 0.9, 1e-3, 0.999, 1e-6)  # of a region's width: the count is the same at all, and clearer at some


@dataclass(frozen=True, slots=True)
class Regions:
    """Consecutive parts of the swept range, sorted by column and value; no eigenvalue crosses the circle inside one.

    column, low, high; low_theta, high_theta: angle of what crosses at that end, NaN where only the range ends there.
    unstable: how many eigenvalues lie outside the unit circle; -1 where that cannot be told.
    sound: the label stands clear of rounding, both ends satisfy the characteristic equation, and the counts change by
    what the crossings say. residual: the larger of the two ends' relative residuals (0 at an end of the range).
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_theta: np.ndarray
    high_theta: np.ndarray
    unstable: np.ndarray
    sound: np.ndarray
    residual: np.ndarray


@dataclass(frozen=True, slots=True)
class Parts:
    """A span cut at its crossings: regions sorted by column and value, before they are labelled.

    column, low, high, low_theta, high_theta: as in `Regions`. gain: by how much the number of unstable eigenvalues
    should grow from the region before. later, earlier: masks of the regions that have one before, and one behind, them.
    order: the crossings in the order of the regions' inner ends.
    """

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray
    low_theta: np.ndarray
    high_theta: np.ndarray
    gain: np.ndarray
    later: np.ndarray
    earlier: np.ndarray
    order: np.ndarray

    def at(self, share) -> np.ndarray:
        """A point of each region, a share of its width from its low end."""
        return self.low + share * (self.high - self.low)

    def labelled(self, unstable, clear, fits, error) -> Regions:
        """Regions from the counts, whether these are clear of rounding, whether each inner end's change of count fits
        (`(inner ends,)`), and the residual of each inner end."""
        sound, residual = clear.copy(), np.zeros(self.column.size)
        good = fits & (error <= SMALL_RESIDUAL)
        sound[self.later] &= good
        sound[self.earlier] &= good
        residual[self.later] = error
        residual[self.earlier] = np.maximum(residual[self.earlier], error)
        return Regions(self.column, self.low, self.high, self.low_theta, self.high_theta, unstable, sound, residual)


def cut_span(span, columns: int, column, value, theta, jump, slack=0.0) -> Parts:
    """Cut the span of every column at its crossings; slack: how near to the low end a crossing counts as there."""
    low, high = span
    near = np.abs(value - low) <= np.maximum(slack, 4 * np.spacing(np.maximum(abs(low), np.abs(value))))
    at_low = np.full(columns, np.nan)
    at_low[column[near]] = theta[near]
    inside = np.flatnonzero((value > low) & (value < high) & ~near)
    order = inside[np.lexsort((value[inside], column[inside]))]
    everyone = np.arange(columns)
    start = np.searchsorted(column[order], everyone) + everyone  # where each column's first region stands
    region = np.repeat(everyone, np.bincount(column[order], minlength=columns) + 1)
    lows, low_theta, gain = np.full(region.size, float(low)), np.full(region.size, np.nan), np.zeros(region.size)
    low_theta[start] = at_low
    later = np.ones(region.size, bool)
    later[start] = False
    lows[later], low_theta[later], gain[later] = value[order], theta[order], jump[order]
    highs, high_theta = np.full(region.size, float(high)), np.full(region.size, np.nan)
    earlier = np.append(later[1:], False)
    highs[earlier], high_theta[earlier] = value[order], theta[order]
    return Parts(region, lows, highs, low_theta, high_theta, gain, later, earlier, order)


def regions(cut: Cut, owner, along: str, fixed, span, found: Crossings) -> Regions:
    """Cut the span at the crossings and label what lies between; loops `cut.at(owner)`, one per column.

    The eigenvalues of the first region of each column are counted; the counts of the others follow from the directions of
    the crossings, and where one of them comes to 0, which makes an interval stable, it is counted too. Columns whose
    crossings are not all proved have every region counted.
    """
    parts = cut_span(span, fixed.size, found.column, found.value, found.theta, found.jump)
    unstable, clear = np.zeros(parts.column.size, int), np.ones(parts.column.size, bool)

    def count(which):
        return count_where_clear(parts, which, lambda some, value: close(
            cut.at(owner[parts.column[some]]), *_wall(along, value, fixed[parts.column[some]])))

    first = np.flatnonzero(~parts.later)
    unstable[first], clear[first] = count(first)
    rise = np.cumsum(parts.gain)
    unstable += np.where(parts.later, rise - rise[first][parts.column] + unstable[first][parts.column], 0).astype(int)
    claimed = np.flatnonzero(parts.later & ((unstable <= 0) | ~found.complete[parts.column]))
    seen, clear[claimed] = count(claimed)
    clear[claimed] &= seen == unstable[claimed]
    unstable[claimed] = seen
    column, value, theta = (part[parts.order] for part in (found.column, found.value, found.theta))
    error = _residual(cut.at(owner[column]), along, fixed[column], value, theta)
    ends = np.flatnonzero((unstable[parts.later] == 0) | (unstable[parts.earlier] == 0))
    firm, at = np.ones(error.size, bool), column[ends]
    moved, left_over = shift(cut.at(owner[at]), along, fixed[at], _place(theta[ends]), np.isin(theta[ends], (0.0, np.pi)))
    usual = error[ends] <= USUAL * (left_over + np.finfo(float).eps)
    firm[ends] = usual & (moved <= FIRM * (np.abs(value[ends]) + NEAR_ZERO * (span[1] - span[0])))
    return parts.labelled(unstable, clear, firm, error)


def count_where_clear(parts: Parts, which, matrices):
    """Count the regions `which`, at the first of SHARES where no eigenvalue is within rounding of the circle.

    matrices(regions, value): the frame-to-frame matrices less identity of these regions at these values.
    """
    unstable, clear = np.zeros(which.size, int), np.zeros(which.size, bool)
    for share in SHARES:
        doubtful = np.flatnonzero(~clear)
        if not doubtful.size:
            break
        some = which[doubtful]
        count, sure = count_outside(matrices(some, parts.at(share)[some]))
        better = sure | (share == SHARES[0])
        unstable[doubtful[better]], clear[doubtful[better]] = count[better], sure[better]
    return unstable, clear


def _wall(along, value, fixed):
    return (value, fixed) if along == K_VE else (fixed, value)


def _place(theta):
    """`w = exp(j theta) - 1`, exactly at both ends of the circle."""
    return np.where(theta == np.pi, -2.0, np.where(theta == 0.0, 0.0, on_circle(theta)))


def _residual(cut, along, fixed, value, theta):
    w = _place(theta)
    K, B = _wall(along, value, fixed)
    # At z = 1 an integrating loop meets the equation 0 = 0 at K_VE = 0, by structure.
    with np.errstate(invalid="ignore"):
        return np.where(cut.integrates & (theta == 0.0), 0.0, residual(terms(cut, w), K, B))


def count_outside(E):
    """Number of eigenvalues outside the unit circle of `I + E`, and whether none lies within rounding of it.

    The count is -1 where E is not finite.
    """
    finite = np.isfinite(E).all((-1, -2))
    delta = np.linalg.eigvals(np.where(finite[:, None, None], E, 0.0))
    with np.errstate(over="ignore"):
        outside = 2 * delta.real + delta.real**2 + delta.imag**2  # |z|^2 - 1, without cancellation for slow poles
    tolerance = 256 * np.finfo(float).eps * np.maximum(1, np.abs(E).max((-1, -2), initial=0))
    count = np.where(finite, (outside > 0).sum(-1), -1)
    return count, finite & (np.abs(outside).min(-1, initial=np.inf) > tolerance)
