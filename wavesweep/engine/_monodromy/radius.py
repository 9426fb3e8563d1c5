"""Loops on a smaller circle: no eigenvalue of a frame M is larger than a radius where the frame
M/radius is stable."""

from dataclasses import replace

import numpy as np

from wavesweep.engine._monodromy.bounded import sum_rounding
from wavesweep.engine._monodromy.cut import ADVANCE, LinearFractional


def within(E: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return `M/radius` less identity, M being the frames with E `(..., n, n)` less identity;
    radius: `(...)`, up to 1."""
    r = np.asarray(radius)[..., None]
    diagonal_places = np.arange(E.shape[-1])
    diagonal = np.diagonal(E, axis1=-2, axis2=-1)
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # a frame that overflows is for the caller to see
        scaled = E / r[..., None]
        small = (1 + diagonal) / r - 1  # each without cancellation where it is taken
        near_one = (diagonal + (1 - r)) / r
        scaled[..., diagonal_places, diagonal_places] = np.where(
            diagonal.real < -0.5, small, near_one
        )
    return scaled


def errors_within(E: np.ndarray, dE: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Return bounds on the errors of the entries of `within`, each of three roundings; dE: of those
    of E."""
    r = np.asarray(radius)[..., None, None]
    with np.errstate(over="ignore", invalid="ignore"):
        return (dE + sum_rounding(3) * (np.abs(E) + (1 - r) * np.eye(E.shape[-1]))) / r


def cut_within(cut: LinearFractional, radius: np.ndarray) -> LinearFractional:
    """Return the cut of loops whose frames are those of `cut` over the radius, `(...)` as the
    batch.

    An integrator, whose eigenvalue 1 is outside of the circle, becomes an ordinary state. Frames by
    which the numbers are late are a factor 1/radius each.
    """
    E, B, x, v = cut.with_integrator()
    dE, dB, dx, dv = cut.errors_with_integrator()
    r = np.asarray(radius)[..., None, None]
    D = cut.D.copy()
    dD = cut.dD.copy()
    D[..., ADVANCE, :] = 0.0
    dD[..., ADVANCE, :] = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        dE = errors_within(E, dE, radius)
        E = within(E, radius)
        dB = (dB + sum_rounding(1) * np.abs(B)) / r
        B = B / r
        if cut.late:
            grown = r**-cut.late
            x = x * grown
            v = v * grown
            D = D * grown
            rounding = sum_rounding(cut.late + 3)  # of the power, not more than a product's
            dx = dx * grown + rounding * np.abs(x)
            dv = dv * grown + rounding * np.abs(v)
            dD = dD * grown + rounding * np.abs(D)
    # The rows VELOCITY, ADVANCE and OFFSET: an ordinary state has no advance.
    C = np.concatenate([v, np.zeros_like(v), x], axis=-2)
    dC = np.concatenate([dv, np.zeros_like(dv), dx], axis=-2)
    names = (*cut.states, *(["integrator"] if cut.integrates else []))
    free = tuple(within(block, radius) for block in cut.uncontrolled)
    ordinary = replace(cut, integrates=False, states=names, poles_at_one=0, uncontrolled=free)
    return replace(ordinary, E=E, B=B, C=C, D=D, dE=dE, dB=dB, dC=dC, dD=dD)
