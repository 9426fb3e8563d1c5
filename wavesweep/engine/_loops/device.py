"""A mass with a damper and a spring under a force that is held over a tick."""

from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._loops.block import matrix, numbers
from wavesweep.engine.doubles import EPS, LARGEST_DOUBLE


def motion(
    s: Any, g: Any, damping: Any, stiffness: Any, mass: Any
) -> tuple[np.ndarray, np.ndarray]:
    """E and B of the states (v, x) under a force; the signs of damping and stiffness are those
    of their own forces."""
    E = matrix([[damping * s + stiffness * g, stiffness * s], [s, stiffness * g]])
    B = matrix([[s / mass], [g / mass]])
    return E, B


class ImpulseAndStep(NamedTuple):
    """What `impulse_and_step` returns."""

    s: np.ndarray
    g: np.ndarray
    of_s: np.ndarray | None = None
    of_g: np.ndarray | None = None


def impulse_and_step(damping: Any, stiffness: Any, period: Any) -> ImpulseAndStep:
    """Position at `period` of `x'' + damping x' + stiffness x = u` after a unit impulse and under a
    unit step, with sizes.

    damping (1/s), stiffness (1/s^2), period (s): numbers or arrays. Returns (s, g) in s and s^2,
    and their changes by a rounding of each term of all sums, in roundings; these are missing (None)
    if there is nothing to double, and then both are known to a few roundings of themselves. After
    many turns of an oscillation s and g are much smaller than these changes, and NaN beyond
    LOST_PHASE.

    With the impulse response s(t), `g(T) = int_0^T s(t) dt`. Both are a Taylor series over T/2^p,
    and then p times those of twice the time,

        s -> s (2 - damping s - 2 stiffness g),   g -> g (2 - stiffness g) + s^2

    which adds only positive terms if the device is overdamped. The changes go through the
    derivatives of the two, and the sizes of the new terms are added.
    """
    damping, stiffness, period = np.broadcast_arrays(
        numbers(damping), numbers(stiffness), numbers(period)
    )
    reach = np.maximum(np.abs(damping * period), 2 * np.sqrt(np.abs(stiffness)) * np.abs(period))
    # Each element has its own number of doublings: its bits must not depend on what else is in the
    # batch.
    finite_reach = np.clip(reach, SERIES_REACH, LARGEST_DOUBLE)
    doublings = np.where(reach > SERIES_REACH, np.ceil(np.log2(finite_reach)) + 1, 0).astype(int)
    tau = period * 0.5**doublings
    # a mass next to 0 makes an infinite damping, whose frame is not known
    with np.errstate(invalid="ignore"):
        s, g = _taylor(damping * tau, stiffness * tau * tau)
    s = s * tau
    g = g * tau * tau
    if not doublings.any():
        return ImpulseAndStep(s, g)
    of_s = np.abs(s)
    of_g = np.abs(g)
    certain = np.ones(s.shape, bool)
    # damping below zero, where an end at zero is looked for, may explode
    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(int(doublings.max(initial=0))):
            unfinished = step < doublings
            by_s = np.abs(2 - 2 * damping * s - 2 * stiffness * g)
            by_g = np.abs(2 - 2 * stiffness * g)
            terms_s = np.abs(s) * (2 + np.abs(damping * s) + 2 * np.abs(stiffness * g))
            terms_g = np.abs(g) * (2 + np.abs(stiffness * g)) + np.abs(s * s)
            new_of_s = by_s * of_s + 2 * np.abs(stiffness * s) * of_g + terms_s
            new_of_g = by_g * of_g + 2 * np.abs(s) * of_s + terms_g
            new_s = s * (2 - damping * s - 2 * stiffness * g)
            new_g = g * (2 - stiffness * g) + s * s
            of_s = np.where(unfinished, new_of_s, of_s)
            of_g = np.where(unfinished, new_of_g, of_g)
            s = np.where(unfinished, new_s, s)
            g = np.where(unfinished, new_g, g)
            rounding = np.abs(stiffness) * of_g * EPS
            certain &= rounding <= LOST_PHASE * np.maximum(1, np.abs(stiffness * g))
    return ImpulseAndStep(np.where(certain, s, np.nan), np.where(certain, g, np.nan), of_s, of_g)


# of |damping| T and 2 sqrt(stiffness) T, or of a row sum, without unit: up to it the Taylor series is
# taken at once
SERIES_REACH = 0.5
# relative: beyond, errors to first order say nothing, since what has lost its phase comes to rest
# by rounding
LOST_PHASE = 1e-6


def _taylor(damping: np.ndarray, stiffness: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same over a unit period, from the derivatives d_n of the impulse response at 0,

    d_1 = 1,   d_2 = -damping,   d_(n+1) = -damping d_n - stiffness d_(n-1)
    """
    slope = np.ones_like(damping)
    curve = -damping
    s = slope + curve / 2
    g = slope / 2 + curve / 6
    factorial = 2.0
    for order in range(3, 18):  # exact to rounding for |damping| <= 1/2 and stiffness <= 1/16
        slope, curve = curve, -damping * curve - stiffness * slope
        factorial *= order
        s = s + curve / factorial
        g = g + curve / (factorial * (order + 1))
    return s, g
