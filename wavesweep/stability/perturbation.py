"""Intervals of loops in whose ticks terms cancel: whether rounding of these terms could move an end or hide one."""

import numpy as np

from wavesweep.monodromy.circle import on_circle
from wavesweep.monodromy.rounding import at_angles_of, balance, may_have
from wavesweep.stability.along_any import EXACT
from wavesweep.stability.double_eigenvalues import function_of_two
from wavesweep.stability.guardian_maps import ONE
from wavesweep.stability.polishing import ATTACHED, vectors_of
from wavesweep.stability.regions import NEAR_ZERO
from wavesweep.stability.spectrum import excess
from wavesweep.stability.stable import Intervals

WITHIN = (0.5,)  # of an interval, or of the span of a column without one: where its verdict is examined
STEP = 1e-6  # of an end, over which the slope of an eigenvalue is taken


def shaken(found: Intervals, span, period, errors, exact=np.nan) -> np.ndarray:
    """Return whether rounding could move an end of each element by more than EXACT, or change the verdict within it.

    found: elements. span: (low, high). period: s of a frame, per column. errors(column, p): frames less identity `(k, n, n)` of
    these loops at these values of the parameter, and bounds on the errors of their entries. exact: a value at which an
    eigenvalue is exactly 1, by the structure of the loop.

    An end moves by the change of the eigenvalue that crosses there, over its slope. The change is its distance from the circle
    in these frames, which may be made otherwise than those that gave the end, and the bound between its left and right
    eigenvector, to first order. An end that is ATTACHED to the span is exact, or as good as that of the span.
    """
    low, high = (np.where(found.count > 0, *pair) for pair in zip((found.low, found.high), span, strict=True))
    width, column, end = span[1] - span[0], found.column, np.concatenate([low, high])
    omega = np.concatenate([found.low_omega, found.high_omega])
    some = np.flatnonzero(~np.isnan(omega) & (end - span[0] > ATTACHED * width) & ~((end == exact) & (omega == 0)))
    end, whose = end[some], some % column.size
    least, at = np.abs(end) + NEAR_ZERO * width, on_circle(omega[some] * period[column[whose]])
    with np.errstate(all="ignore"):
        within = np.concatenate([(1 - share) * low + share * high for share in WITHIN])
        owner = np.concatenate([np.tile(column, len(WITHIN)), np.tile(column[whose], 2)])
        E, dE = errors(owner, np.concatenate([within, end, end + STEP * least]))
        first, last = within.size, within.size + end.size
        lost = _may_not_be(np.tile(found.count > 0, len(WITHIN)), E[:first], dE[:first]).reshape(len(WITHIN), -1).any(0)
        moved = _moved(E[first:last], dE[first:last], E[last:], STEP * least, at)
        lost[whose[~(moved <= EXACT * least)]] = True
    return lost


def _may_not_be(stable, E, dE):
    """Whether a loop may be stable or not otherwise than as given, or E is not finite.

    A loop is surely unstable if no eigenvalue can be on a circle between the unit circle and its largest one.
    """
    finite = np.isfinite(E).all((-1, -2)) & np.isfinite(dE).all((-1, -2))
    E, dE = (np.where(finite[:, None, None], part, 0.0) for part in (E, dE))
    delta = np.linalg.eigvals(E).astype(complex)
    size, verdict = np.abs(1 + delta), (excess(delta) < 0).all(-1)
    largest = size.max(-1, initial=1.0)
    radius = np.maximum(np.sqrt(largest), largest / 2)  # where a frame grows so much, rounding of it reaches far as well
    rank = np.where(stable[:, None], np.abs(excess(delta)), np.abs(size - radius[:, None]))
    return ~finite | (verdict != stable) | may_have(E, dE, at_angles_of(delta, np.where(stable, 1.0, radius), rank))


def _moved(E, dE, later, step, at):
    """By how much the value of the parameter at which an eigenvalue next to `1 + at` is on the circle may be off.

    later: E at a further step of the parameter. NaN if E is not finite.
    """
    moved, slope = _moved_alone(E, dE, (later - E) / step[:, None, None], at), np.full(step.size, np.nan)
    real = np.flatnonzero(at.imag == 0)
    if real.size:  # two eigenvalues may meet there
        place, kind = np.where(at[real].real < -1, -2.0, 0.0), np.full(real.size, ONE)
        value, unsure = function_of_two(E[real], kind, place, dE[real])
        change = function_of_two(later[real], kind, place, dE[real])[0] - value
        slope[real] = (np.abs(value) + unsure) / np.abs(change) * step[real]
    return np.fmin(moved, slope)


def _moved_alone(E, dE, slope, at):
    finite = np.isfinite(E).all((-1, -2)) & np.isfinite(slope).all((-1, -2))
    E, units = balance(np.where(finite[:, None, None], E, 0.0))
    dE, slope = (part * (units[:, None, :] / units[:, :, None]) for part in (dE, slope))
    delta = np.linalg.eigvals(E).astype(complex)
    left, right = vectors_of(E, np.take_along_axis(delta, np.argmin(np.abs(delta - at[:, None]), -1)[:, None], -1)[:, 0])
    delta = (left @ E @ right)[:, 0, 0]  # a quotient of Rayleigh, which is as good as the entries
    z = 1 + delta
    speed = (np.conj(z) * (left @ slope @ right)[:, 0, 0]).real
    off = np.abs(excess(delta)) / 2 + np.abs(z) * (np.abs(left) @ dE @ np.abs(right))[:, 0, 0]
    return np.where(finite, off / np.abs(speed), np.nan)
