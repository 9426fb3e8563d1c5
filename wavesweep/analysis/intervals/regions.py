"""Between the crossings: the count of unstable eigenvalues of each region, and whether it fits the crossings."""

from dataclasses import dataclass

import numpy as np

from wavesweep.analysis.intervals.crossings import Crossings
from wavesweep.analysis.intervals.curve import K_VE, residual, terms
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.cut import Cut, close

SMALL_RESIDUAL = 1e-9


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


def regions(cut: Cut, along: str, fixed, span, found: Crossings) -> Regions:
    """Cut the span at the crossings and label what lies between (loops `cut`, one per column)."""
    low, high = span
    near = np.abs(found.value - low) <= 4 * np.spacing(np.maximum(abs(low), np.abs(found.value)))
    at_low = np.full(fixed.size, np.nan)
    at_low[found.column[near]] = found.theta[near]
    inside = (found.value > low) & (found.value < high) & ~near
    order = np.lexsort((found.value[inside], found.column[inside]))
    column, value, theta, jump = (part[inside][order] for part in (found.column, found.value, found.theta, found.jump))
    everyone = np.arange(fixed.size)
    start = np.searchsorted(column, everyone) + everyone  # where each column's first region stands
    region = np.repeat(everyone, np.bincount(column, minlength=fixed.size) + 1)
    lows, low_theta, gain = np.full(region.size, float(low)), np.full(region.size, np.nan), np.zeros(region.size)
    low_theta[start] = at_low
    later = np.ones(region.size, bool)
    later[start] = False
    lows[later], low_theta[later], gain[later] = value, theta, jump
    highs, high_theta = np.full(region.size, float(high)), np.full(region.size, np.nan)
    earlier = np.append(later[1:], False)
    highs[earlier], high_theta[earlier] = value, theta
    unstable, clear = _count(cut.at(region), along, fixed[region], (lows + highs) / 2)
    fits = np.ones(region.size, bool)
    fits[later] = (unstable[later] - unstable[earlier]) == gain[later]
    fits[earlier] &= fits[later]
    error = np.zeros(region.size)
    error[later] = _residual(cut.at(column), along, fixed[column], value, theta)
    error[earlier] = np.maximum(error[earlier], error[later])
    return Regions(region, lows, highs, low_theta, high_theta, unstable, clear & fits & (error <= SMALL_RESIDUAL), error)


def _residual(cut, along, fixed, value, theta):
    w = np.where(theta == np.pi, -2.0, np.where(theta == 0.0, 0.0, on_circle(theta)))
    K, B = (value, fixed) if along == K_VE else (fixed, value)
    # At z = 1 an integrating loop meets the equation 0 = 0 at K_VE = 0, by structure.
    with np.errstate(invalid="ignore"):
        return np.where(cut.integrates & (theta == 0.0), 0.0, residual(terms(cut, w), K, B))


def _count(cut, along, fixed, value):
    """Number of eigenvalues outside the unit circle, and whether none lies within rounding of it."""
    K, B = (value, fixed) if along == K_VE else (fixed, value)
    E = close(cut, K, B)
    finite = np.isfinite(E).all((-1, -2))
    delta = np.linalg.eigvals(np.where(finite[:, None, None], E, 0.0))
    outside = 2 * delta.real + delta.real**2 + delta.imag**2  # |z|^2 - 1, without cancellation for slow poles
    tolerance = 256 * np.finfo(float).eps * np.maximum(1, np.abs(E).max((-1, -2), initial=0))
    count = np.where(finite, (outside > 0).sum(-1), -1)
    return count, finite & (np.abs(outside).min(-1, initial=np.inf) > tolerance)
