"""Drift that depends on the numbers of a loop, set aside in all ticks alike.

A rest e is kept by every kind of tick, `E e = 0`. With the lead S, a state that moves with it, and
the others R, `E_R V = -E_S` in all ticks together, and the states counted from the rest, `x_R - V
x_S`, follow `E_RR - V E_SR` whatever x_S is.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from wavesweep.engine._monodromy.drift import MarginalModes, consistent_solution
from wavesweep.engine._monodromy.periodic import Ticks
from wavesweep.engine.doubles import UNIT_ROUNDING


def lasting(
    drift: MarginalModes, ticks_at: Callable[[np.ndarray], Ticks], box: np.ndarray
) -> MarginalModes:
    """Return the drift with the lead that moves most at all corners of a box of numbers, so that V
    stays finite in all of it.

    ticks_at: gives the ticks at points of the box. More than one lead is left as it is.
    """
    if len(drift.varying) != 1:
        return drift
    states = np.array(sorted({*drift.remaining, *drift.varying}))
    corners = np.unique(np.array(list(product(*box.T))), axis=0)
    rows = _rows([tick.E for tick in ticks_at(corners).maps])[..., states]
    size = np.abs(rows).max((0, 1))
    units = np.where(size > 0, 1 / size, 1.0)
    moved = np.abs(np.linalg.svd(rows * units)[2][..., -1, :])
    return replace(drift, varying=(int(states[np.argmax(moved.min(0))]),))


def counted_from_rest(
    E: np.ndarray, dE: np.ndarray, V: np.ndarray, dV: np.ndarray, drift: MarginalModes
) -> tuple[np.ndarray, np.ndarray]:
    """Return `E_RR - V E_SR`, the changes of the states counted from the rest, and bounds on their
    errors; V, dV: of `shift_of`."""
    R = np.array(drift.remaining, int)
    S = np.array(drift.varying, int)
    to_R = (..., R[:, None], R)
    E_RR = E[to_R]
    dE_RR = dE[to_R]
    if not S.size:
        return E_RR, dE_RR
    to_S = (..., S[:, None], R)
    E_SR = E[to_S]
    dE_SR = dE[to_S]
    with np.errstate(invalid="ignore"):  # where V is not known
        dE_RR = dE_RR + np.abs(V) @ dE_SR + dV @ (np.abs(E_SR) + dE_SR)
        dE_RR = dE_RR + 4 * UNIT_ROUNDING * (np.abs(E_RR) + np.abs(V) @ np.abs(E_SR))
        return E_RR - V @ E_SR, np.where(np.isnan(dE_RR), np.inf, dE_RR)


def shift_of(E: np.ndarray, dE: np.ndarray, drift: MarginalModes) -> tuple[np.ndarray, np.ndarray]:
    """Return V, `(..., rest, leads)`, and a bound on its error, from the changes of all kinds of
    ticks `(kinds, ..., n, n)`.

    With `J E_R = I + N` for the rows of all ticks, an error is at most `(1 + |N|/(1 - |N|)) |J|`
    times what V leaves of them. NaN if there is no such rest, infinite bounds if it is not known
    how far V is off. Of complex ticks, or without errors, there is no bound.
    """
    R = np.array(drift.remaining, int)
    S = np.array(drift.varying, int)
    rows = _rows(E)
    errors = _rows(dE)
    if not S.size:
        nothing = np.zeros((*rows.shape[:-2], R.size, 0))
        return nothing, nothing
    E_R = rows[..., R]
    E_S = rows[..., S]
    dE_R = errors[..., R]
    dE_S = errors[..., S]
    V = consistent_solution(E_R, -E_S)
    if np.iscomplexobj(V) or not errors.any():
        return V, np.zeros(V.shape)
    size = np.abs(E_R).max(-1, keepdims=True, initial=0)
    weight = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
    with np.errstate(all="ignore"):
        terms = np.abs(E_R) @ np.abs(V) + np.abs(E_S)
        rounding = 2 * V.shape[-2] * UNIT_ROUNDING * terms
        residual = np.abs(E_R @ V + E_S) + dE_R @ np.abs(V) + dE_S + rounding
        J = np.linalg.pinv(np.nan_to_num(E_R * weight))
        N = np.abs(J @ (E_R * weight) - np.eye(R.size)) + np.abs(J) @ (dE_R * weight)
        share = N.sum(-1, keepdims=True).max(-2, keepdims=True)
        off = np.abs(J) @ (residual * weight)
        off = off + share / (1 - share) * off.max(-2, keepdims=True)
    return V, np.where((share < 0.5) & np.isfinite(off), off, np.inf)


def _rows(kinds: np.ndarray | Sequence[np.ndarray]) -> np.ndarray:
    """The rows of all kinds of ticks below each other, `(..., rows, n)`."""
    batch = np.broadcast_shapes(*(np.shape(changes)[:-2] for changes in kinds))
    alike = [np.broadcast_to(changes, (*batch, *changes.shape[-2:])) for changes in kinds]
    return np.concatenate(alike, axis=-2)
