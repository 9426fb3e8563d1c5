"""The limit of a response towards 0 Hz, and the reading of responses from position and force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._monodromy.bounded import Bounded, sum_rounding
from wavesweep.engine._response.lifted import Lifted, Sums
from wavesweep.engine._response.ordered_product import ordered_product
from wavesweep.engine.doubles import FEW_ROUNDINGS, GONE_SUM

SLOPE_STEP = 1e-30  # of z, for slopes
# of the hand's force, or of the terms of a position: a value that may be rounding below it counts
# as zero
ZERO_OF_TERMS = 1e-11
LOST_DIGITS = 0.1  # relative error beyond which a number has no correct digit


class Response(NamedTuple):
    """Admittance (m/N) and impedance (N/m), complex, `(..., points)`, and bounds on their relative
    errors.

    NaN: not known; with an error of 0 the number is known to have no bound.
    """

    admittance: np.ndarray
    impedance: np.ndarray
    admittance_error: np.ndarray
    impedance_error: np.ndarray


def at_port(outputs: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return position and force against the hand, `(..., 2, points)`, from the outputs of a port
    (see `Port`).

    step: `z - 1` of the tick, or its size if the outputs are errors. Without a force, that is the
    hand's own, 1 N.
    """
    quantities = np.empty((*outputs.shape[:-2], 2, outputs.shape[-1]), outputs.dtype)
    quantities[..., 0, :] = outputs[..., 0, :] / step
    quantities[..., 1, :] = outputs[..., 1, :] if outputs.shape[-2] > 1 else np.iscomplexobj(step)
    if outputs.shape[-2] > 2:
        quantities[..., 1, :] += outputs[..., 2, :] / step
    return quantities


def at_signal(outputs: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return the signal, `(..., 1, points)`, from the outputs of a port between an input and it;
    step: see `at_port`."""
    signal = outputs[..., :1, :] + 0 * step
    return signal + outputs[..., 1:2, :] / step if outputs.shape[-2] > 1 else signal


def relative_response(quantities: np.ndarray, error: np.ndarray) -> Response:
    """Return admittance, impedance and their relative errors; a number without a correct digit is
    NaN.

    quantities, error: position and force, `(..., 2, points)`.
    """
    relative = np.where(error == 0, 0.0, error / np.abs(quantities)) + FEW_ROUNDINGS
    relative = np.where(relative < LOST_DIGITS, relative, np.nan)
    position = quantities[..., 0, :]
    force = quantities[..., 1, :]
    of_position = relative[..., 0, :]
    of_force = relative[..., 1, :]
    admittance = np.where(np.isnan(of_position), np.nan, position)
    impedance = np.where(np.isnan(of_force), np.nan, force / admittance)
    finite = np.isfinite(
        impedance
    )  # an admittance may be so small that it has no inverse in double precision
    impedance = np.where(finite, impedance, np.nan)
    of_impedance = np.where(finite, of_position + of_force, np.nan)
    return Response(admittance, impedance, of_position, of_impedance)


class _AtRest:
    """The point z = 1 of the circle, with a complex step for slopes (W. Squire, G. Trapp, SIAM
    Rev. 40, 1998)."""

    def turn(self, count: int) -> np.ndarray:
        return np.array([1 + 1j * SLOPE_STEP * count])

    def ladder(self, count: int) -> np.ndarray:
        return 1 + 1j * SLOPE_STEP * np.arange(count)[:, None]


@dataclass(frozen=True, slots=True)
class AtRest:
    """What a constant force of the hand does in the end, `(...)` or for all loops of one structure.

    going: it moves the position without end. silent: no force reaches the hand. rigid: it does not
    move the position at all.
    """

    going: np.ndarray
    silent: np.ndarray
    rigid: np.ndarray


def dcgain(loop: Lifted, rests: bool | None = None) -> tuple[np.ndarray, np.ndarray, AtRest]:
    """Return position (m) and force against the hand (N) at rest under 1 N, and bounds on their
    errors, `(2, ...)` each.

    Of loops whose position moves on these are the changes in a tick. Also returned is what the
    force does in the end: it follows from the structure if the port knows it, or else from the
    bounds on errors, and of one loop from whether it can stand still, if that is known (see
    `integrator_modes.rests`): a loop that cannot moves on along what drifts in it.

    With w = z - 1 of the tick and M ticks in a frame, both sides of `(z^M - 1 - E) X = g` and of
    the outputs of a frame are expanded to first order: `E X_0 = -g_0`, `E X_1 = M X_0 - g_1`. A
    change within a tick vanishes with w, and its slope is the quantity that has changed.
    """
    outputs = _limits(loop)
    changes = outputs[0].value  # of the position in a tick
    still = np.zeros((2, *changes.value.shape))
    moving = np.stack(changes[:2])
    position = np.stack(outputs[0].slope[:2])
    moved = still  # the change of the force in a tick
    if len(outputs) > 1:
        force = np.stack(outputs[1].value[:2])
    else:
        force = still.copy()
        force[0] = 1.0  # the hand's own
    if len(outputs) > 2:
        moved = np.stack(outputs[2].value[:2])
        force = force + np.stack(outputs[2].slope[:2])
    rest = loop.port.rest and loop.port.rest()
    if rest is not None:  # what is not 0 with a loop's own numbers is not 0
        shown = np.where(rest.going, moved, force)
        silent = rest.silent & ~_is_sure(shown)
        rigid = rest.rigid & ~_is_sure(position)
        vague = rest.going & _is_nothing(moving) & (loop.lost.size > 1)  # what one loop does not do
        moved = np.where(vague, np.nan, moved)
        rest = AtRest(rest.going, silent & ~vague, rigid)
        position = np.where(_is_nothing(moving), position, np.nan)  # it may be going
    else:
        stays = _is_nothing(moving)
        going = np.abs(changes.value) > changes.error + GONE_SUM * changes.size
        if rests is not None:
            alone = loop.port.drifts == 1 == loop.port.moves.shape[-1]
            stays = np.full(stays.shape, rests or not loop.port.drifts)
            going = ~stays & (alone | _is_sure(moving))
        no_force = _is_nothing(force) & (force[1] <= ZERO_OF_TERMS) & (len(outputs) > 1)
        silent = np.where(going, _is_nothing(moved), no_force)
        no_position = _is_nothing(position) & (position[1] <= ZERO_OF_TERMS * outputs[0].slope.size)
        rest = AtRest(going, silent, ~going & stays & no_position)
        position[1] = np.where(stays, position[1], np.nan)  # it may be going
        force[1] = np.where(_is_nothing(moved), force[1], np.nan)
    position = np.where(rest.going, moving, position)
    position = np.where(rest.rigid, 0.0, position)
    force = np.where(rest.going, moved, force)
    force = np.where(rest.silent, 0.0, force)
    limits = np.stack([position[0], force[0]])
    errors = np.stack([position[1], force[1]])
    return limits, errors, rest


def _is_nothing(pair: Any) -> np.ndarray:
    """Whether a number may be 0; pair: it, and a bound on its error."""
    return np.abs(pair[0]) <= pair[1]


def _is_sure(pair: np.ndarray) -> np.ndarray | bool:
    """Whether a number is not 0 for sure; neither is known of NaN."""
    return np.abs(pair[0]) > pair[1]


def dcgain_between(loop: Lifted) -> tuple[np.ndarray, np.ndarray]:
    """Return the limit of a response between an input and a signal towards 0 Hz, `(...)`, and its
    relative error.

    NaN: no limit exists, as for a signal that a constant input moves without end, or it is not
    known. The error of a number that does not exist is 0, and so is that of a response that is
    nothing but rounding, as of one that an integrator removes.
    """
    outputs = _limits(loop)
    limit, error, terms = outputs[0].value
    going = np.zeros(limit.shape, bool)
    if len(outputs) > 1:  # the change in a tick of the share that drifts
        change, slope = outputs[1]
        limit = limit + slope.value
        error = error + slope.error
        terms = terms + slope.size
        going = np.abs(change.value) > change.error + GONE_SUM * change.size
        error = np.where(going | _is_nothing(change), error, np.nan)
    nothing = _is_nothing((limit, error)) & (error <= ZERO_OF_TERMS * terms)
    relative = error / np.abs(limit) + FEW_ROUNDINGS
    relative = np.where(nothing | going, 0.0, relative)
    relative = np.where((relative < LOST_DIGITS) & ~loop.lost, relative, np.nan)
    limit = np.where(going | np.isnan(relative), np.nan, limit)
    return np.where(nothing, 0.0, limit), relative


class _Known(NamedTuple):
    """Numbers, bounds on their errors, and the sizes of the terms of their sums, `(...)`."""

    value: np.ndarray
    error: np.ndarray
    size: np.ndarray


class _Limit(NamedTuple):
    """An output in a tick under a constant force, and its slope with the z of the tick."""

    value: _Known
    slope: _Known


def _limits(loop: Lifted) -> list[_Limit]:
    """Return the limit of each output of the port."""
    frame = loop.frame
    M = loop.frame.ticks
    rough = sum_rounding(M + loop.order)
    sums = Sums.of(frame, _AtRest())
    g, g_1 = _with_slope(sums.driven[..., 0])
    G, G_1 = _with_slope(sums.rows[..., 0, :])
    h, h_1 = _with_slope(sums.forced[..., 0])
    dg = sums.ddriven[..., 0] + 0 * g
    dG = sums.drows
    dh = sums.dforced[..., 0]
    still = -frame.E
    X, dX = still.solved(Bounded(g, dg).part(..., None)).part(..., 0)
    right = Bounded(g_1, M * dg) - Bounded(X, dX) * M
    X_1, dX_1 = still.solved(right.part(..., None)).part(..., 0)
    size_X = np.abs(X)
    size_X_1 = np.abs(X_1)
    value = ordered_product(G, X) + h
    slope = ordered_product(G_1, X) + ordered_product(G, X_1) + h_1
    size = ordered_product(frame.sizes[0], size_X) + frame.forced_size
    size_1 = M * size + ordered_product(frame.sizes[0], size_X_1)
    error = ordered_product(np.abs(G), dX) + ordered_product(dG, size_X) + dh + rough * size
    error_1 = ordered_product(np.abs(G_1), dX) + ordered_product(np.abs(G), dX_1)
    error_1 = error_1 + ordered_product(dG, M * size_X + size_X_1) + M * dh + rough * size_1
    values = (np.moveaxis(array, -1, 0) / M for array in (value, error, size))
    slopes = (np.moveaxis(array, -1, 0) / M for array in (slope, error_1, size_1))
    at_rest = [_Known(*entry) for entry in zip(*values, strict=True)]
    turning = [_Known(*entry) for entry in zip(*slopes, strict=True)]
    return [_Limit(*both) for both in zip(at_rest, turning, strict=True)]


def _with_slope(array: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The value at z = 1, and the slope there, of what was computed at `_AtRest`."""
    return array.real, array.imag / SLOPE_STEP
