"""Drift that depends on the numbers of a loop, set aside in all ticks alike.

A rest e is kept by every kind of tick, `E e = 0`. With the lead S, a state that moves with it, and
the others R, `E_R V = -E_S` in all ticks together, and the states counted from the rest, `x_R - V
x_S`, follow `E_RR - V E_SR` whatever x_S is.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from wavesweep.engine.doubles import UNIT_ROUNDING
from wavesweep.engine.frames import MarginalModes, Ticks, consistent_solution


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
    rows = _rows([each.E for each in ticks_at(corners).maps])[..., states]
    size = np.abs(rows).max((0, 1))
    units = np.where(size > 0, 1 / size, 1.0)
    rest = np.abs(np.linalg.svd(rows * units)[2][..., -1, :])
    return replace(drift, varying=(int(states[np.argmax(rest.min(0))]),))


def counted_from_rest(E, dE, V, dV, drift: MarginalModes) -> tuple[np.ndarray, np.ndarray]:
    """Return changes of the states that are kept, counted from the rest, and bounds on their
    errors; V, dV: of `shift_of`."""
    rest = np.array(drift.remaining, int)
    leads = np.array(drift.varying, int)
    to_rest = (..., rest[:, None], rest)
    own = E[to_rest]
    error = dE[to_rest]
    if not leads.size:
        return own, error
    to_leads = (..., leads[:, None], rest)
    lead = E[to_leads]
    of_lead = dE[to_leads]
    with np.errstate(invalid="ignore"):  # where V is not known
        error = error + np.abs(V) @ of_lead + dV @ (np.abs(lead) + of_lead)
        error = error + 4 * UNIT_ROUNDING * (np.abs(own) + np.abs(V) @ np.abs(lead))
        return own - V @ lead, np.where(np.isnan(error), np.inf, error)


def shift_of(E, dE, drift: MarginalModes) -> tuple[np.ndarray, np.ndarray]:
    """Return V, `(..., rest, leads)`, and a bound on its error, from the changes of all kinds of
    ticks `(kinds, ..., n, n)`.

    With `J M = I + N` for the rows M of all ticks, an error is at most `(1 + |N|/(1 - |N|)) |J|`
    times what V leaves of them. NaN if there is no such rest, infinite bounds if it is not known
    how far V is off. Of complex ticks, or without errors, there is no bound.
    """
    rest = np.array(drift.remaining, int)
    leads = np.array(drift.varying, int)
    rows = _rows(E)
    errors = _rows(dE)
    if not leads.size:
        nothing = np.zeros((*rows.shape[:-2], rest.size, 0))
        return nothing, nothing
    M = rows[..., rest]
    S = rows[..., leads]
    dM = errors[..., rest]
    dS = errors[..., leads]
    V = consistent_solution(M, -S)
    if np.iscomplexobj(V) or not errors.any():
        return V, np.zeros(V.shape)
    size = np.abs(M).max(-1, keepdims=True, initial=0)
    weight = np.where(size > 0, 1 / np.where(size > 0, size, 1.0), 0.0)
    with np.errstate(all="ignore"):
        terms = np.abs(M) @ np.abs(V) + np.abs(S)
        rounding = 2 * V.shape[-2] * UNIT_ROUNDING * terms
        left = np.abs(M @ V + S) + dM @ np.abs(V) + dS + rounding
        J = np.linalg.pinv(np.nan_to_num(M * weight))
        N = np.abs(J @ (M * weight) - np.eye(rest.size)) + np.abs(J) @ (dM * weight)
        share = N.sum(-1, keepdims=True).max(-2, keepdims=True)
        off = np.abs(J) @ (left * weight)
        off = off + share / (1 - share) * off.max(-2, keepdims=True)
    return V, np.where((share < 0.5) & np.isfinite(off), off, np.inf)


def _rows(parts):
    """The rows of all kinds of ticks below each other, `(..., rows, n)`."""
    batch = np.broadcast_shapes(*(np.shape(each)[:-2] for each in parts))
    alike = [np.broadcast_to(each, (*batch, *each.shape[-2:])) for each in parts]
    return np.concatenate(alike, axis=-2)
