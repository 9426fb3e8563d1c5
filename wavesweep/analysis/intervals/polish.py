"""Polishing a crossing in state space to rounding."""

import numpy as np

from wavesweep.analysis.intervals.curve import transfer_and_slope
from wavesweep.lifted.circle import on_circle
from wavesweep.lifted.cut import ADVANCE, OFFSET, Cut, V

ROUNDS = 12  # Newton from a seed of 8 digits needs 2; from the fallback's arcs a few more


def polish(cut: Cut, along: str, fixed, theta, scale):
    """Newton on `Im K(theta) = 0`, `K = (one - fixed*other)/solved`, from the seeds theta.

    cut: one loop per seed. fixed: the other wall parameter, per seed. scale: the largest value of interest; where K is
    beyond it, Newton runs on 1/K, since a crossing at a very large K lies next to a pole of K.
    Returns (theta, value, converged): the angle (rad per frame), the wall parameter there, and whether Newton's last step
    is at rounding.
    Accuracy: value good to about 1e-13 relative, less where the curve crosses the real axis at a grazing angle.
    """
    theta, value = theta.astype(float), np.full(theta.shape, np.nan)
    done, active = np.zeros(theta.shape, bool), np.arange(theta.size)
    for _ in range(ROUNDS):
        if not active.size:
            break
        now, slope = _value_and_slope(cut.at(active), along, fixed[active], theta[active])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            far = np.abs(now) > scale
            now, slope = np.where(far, 1 / now, now), np.where(far, -slope / now**2, slope)
            step = -now.imag / slope.imag
        step = np.where(np.isfinite(step), step, 0.0)
        small = np.abs(step) <= 1e-9 * np.minimum(theta[active], np.pi - theta[active])
        theta[active] = np.clip(theta[active] + step, 1e-3 * theta[active], np.pi - 1e-3 * (np.pi - theta[active]))
        with np.errstate(divide="ignore"):
            estimate = now.real + step * slope.real  # the step's error is its square: exact at 1e-9
            value[active] = np.where(far, 1 / estimate, estimate)
        done[active] = small & (slope.imag != 0)
        active = active[~small]
    return theta, value, done


def _value_and_slope(cut, along, fixed, theta):
    """K(theta) and dK/dtheta, complex."""
    w = on_circle(theta)
    G, dG = transfer_and_slope(cut, w)
    if cut.integrates:
        x, v, one = G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., V], w
        dx, dv, d_one = dG[..., ADVANCE] + w * dG[..., OFFSET] + G[..., OFFSET], w * dG[..., V] + G[..., V], 1.0
    else:
        x, v, one, dx, dv, d_one = G[..., OFFSET], G[..., V], 1.0, dG[..., OFFSET], dG[..., V], 0.0
    if along == "B_VE":
        x, v, dx, dv = v, x, dv, dx
    top, d_top = one - fixed * v, d_one - fixed * dv
    with np.errstate(divide="ignore", invalid="ignore"):
        value = top / x
        slope = (d_top - value * dx) / x * (1j * (1 + w))
    return value, slope
