"""The limit of a response towards 0 Hz, and the reading of responses from position and force."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavesweep.engine.response.bounded_sums import ordered_product
from wavesweep.engine.response.lifted import Lifted, Sums
from wavesweep.engine.response.linear_systems import solved

STEP = 1e-30  # of z, for slopes
STILL = 1e-9  # of the terms of a displacement: below it the displacement is rounding
NOTHING = 1e-11  # of the hand's force, or of the terms of a position: a value that may be rounding below it counts as zero
LOST = 0.1  # relative error beyond which a number has no correct digit


class Response(NamedTuple):
    """Admittance (m/N) and impedance (N/m), complex, `(..., points)`, and bounds on their relative errors.

    NaN: not known; with an error of 0 the number is known to have no bound.
    """

    admittance: np.ndarray
    impedance: np.ndarray
    admittance_error: np.ndarray
    impedance_error: np.ndarray


def at_port(outputs, step):
    """Return position and force against the hand, `(..., 2, points)`, from the outputs of a port (see `Port`).

    step: `z - 1` of the tick, or its size if the outputs are errors. Without a force, that is the hand's own, 1 N.
    """
    quantities = np.empty((*outputs.shape[:-2], 2, outputs.shape[-1]), outputs.dtype)
    quantities[..., 0, :] = outputs[..., 0, :] / step
    quantities[..., 1, :] = outputs[..., 1, :] if outputs.shape[-2] > 1 else np.iscomplexobj(step)
    if outputs.shape[-2] > 2:
        quantities[..., 1, :] += outputs[..., 2, :] / step
    return quantities


def at_signal(outputs, step):
    """Return the signal, `(..., 1, points)`, from the outputs of a port between an input and it; step: see `at_port`."""
    signal = outputs[..., :1, :] + 0 * step
    return signal + outputs[..., 1:2, :] / step if outputs.shape[-2] > 1 else signal


def relative_response(quantities, error) -> Response:
    """Return admittance, impedance and their relative errors; a number without a correct digit is NaN.

    quantities, error: position and force, `(..., 2, points)`.
    """
    relative = np.where(error == 0, 0.0, error / np.abs(quantities)) + 4 * np.finfo(float).eps
    relative = np.where(relative < LOST, relative, np.nan)
    admittance = np.where(np.isnan(relative[..., 0, :]), np.nan, quantities[..., 0, :])
    impedance = np.where(np.isnan(relative[..., 1, :]), np.nan, quantities[..., 1, :] / admittance)
    finite = np.isfinite(impedance)  # an admittance may be so small that it has no inverse in double precision
    impedance, of_impedance = np.where(finite, impedance, np.nan), np.where(finite, relative.sum(-2), np.nan)
    return Response(admittance, impedance, relative[..., 0, :], of_impedance)


class _AtRest:
    """The point z = 1 of the circle, with a complex step for slopes (W. Squire, G. Trapp, SIAM Rev. 40, 1998)."""

    def turn(self, count):
        return np.array([1 + 1j * STEP * count])

    def ladder(self, count):
        return 1 + 1j * STEP * np.arange(count)[:, None]


@dataclass(frozen=True, slots=True)
class AtRest:
    """What a constant force of the hand does in the end, `(...)` or for all loops of one structure.

    going: it moves the position without end. silent: no force reaches the hand. rigid: it does not move the position at all.
    """

    going: np.ndarray
    silent: np.ndarray
    rigid: np.ndarray


def dcgain(loop: Lifted) -> tuple[np.ndarray, np.ndarray, AtRest]:
    """Return position (m) and force against the hand (N) at rest under 1 N, and bounds on their errors, `(2, ...)` each.

    Of loops whose position moves on these are the changes in a tick. Also returned is what the force does in the end: it
    follows from the structure if the port knows it, or else from the bounds on errors.

    With w = z - 1 of the tick and M ticks in a frame, both sides of `(z^M - 1 - E) X = g` and of the outputs of a frame are
    expanded to first order: `E X_0 = -g_0`, `E X_1 = M X_0 - g_1`. A change within a tick vanishes with w, and its slope is the
    quantity that has changed.
    """
    (value, off), (slope, off_slope), (size, of_slopes) = _limits(loop)
    none, unit = np.zeros((2, *slope[0].shape)), np.array([1.0, 0.0]).reshape(2, *(1,) * slope[0].ndim)
    position = np.stack([slope[0], off_slope[0]])
    force = np.stack([value[1], off[1]]) if len(value) > 1 else unit + none
    moved = np.stack([value[2], off[2]]) if len(value) > 2 else none
    if len(value) > 2:
        force = force + np.stack([slope[2], off_slope[2]])
    rest = loop.port.rest and loop.port.rest()
    if rest is not None:  # what is not 0 with a loop's own numbers is not 0
        far = [np.abs(value) > error for value, error in (position, np.where(rest.going, moved, force))]
        rest = AtRest(rest.going, rest.silent & ~far[1], rest.rigid & ~far[0])
        position = np.where(np.abs(value[0]) <= off[0], position, np.nan)  # it may be going
    else:
        still, zero = np.abs(value[0]) <= off[0], [np.abs(pair[0]) <= pair[1] for pair in (position, force, moved)]
        going = np.abs(value[0]) > off[0] + STILL * size[0]
        silent = np.where(going, zero[2], zero[1] & (force[1] <= NOTHING) & (len(value) > 1))
        rest = AtRest(going, silent, ~going & still & zero[0] & (position[1] <= NOTHING * of_slopes[0]))
        position[1] = np.where(still, position[1], np.nan)  # it may be going
        force[1] = np.where(zero[2], force[1], np.nan)
    position = np.where(rest.rigid, 0.0, np.where(rest.going, np.stack([value[0], off[0]]), position))
    force = np.where(rest.silent, 0.0, np.where(rest.going, moved, force))
    return *np.stack([position, force], 1), rest


def dcgain_between(loop: Lifted) -> tuple[np.ndarray, np.ndarray]:
    """Return the limit of a response between an input and a signal towards 0 Hz, `(...)`, and its relative error.

    NaN: no limit exists, as for a signal that a constant input moves without end, or it is not known. The error of a number
    that does not exist is 0, and so is that of a response that is nothing but rounding, as of one that an integrator removes.
    """
    (value, off), (slope, off_slope), (size, of_slopes) = _limits(loop)
    limit, error, terms, going = value[0], off[0], size[0], np.zeros(value[0].shape, bool)
    if len(value) > 1:
        limit, error, terms = limit + slope[1], error + off_slope[1], terms + of_slopes[1]
        going = np.abs(value[1]) > off[1] + STILL * size[1]
        error = np.where(going | (np.abs(value[1]) <= off[1]), error, np.nan)
    nothing = (np.abs(limit) <= error) & (error <= NOTHING * terms)
    relative = np.where(nothing | going, 0.0, error / np.abs(limit) + 4 * np.finfo(float).eps)
    relative = np.where((relative < LOST) & ~loop.lost, relative, np.nan)
    return np.where(nothing, 0.0, np.where(going | np.isnan(relative), np.nan, limit)), relative


def _limits(loop):
    """Return the outputs in a tick under a constant force and their slopes, `(outputs, ...)`, each with bounds on its errors.

    Also returned are the sizes of the terms of both.
    """
    frame, M = loop.frame, loop.frame.ticks
    sums = Sums.of(frame, _AtRest())
    (E, dE), rough = frame.E, loop.port.rough
    with_slopes = sums.driven[..., 0], sums.rows[..., 0, :], sums.forced[..., 0]
    (g, g_1), (G, G_1), (h, h_1) = ((array.real, array.imag / STEP) for array in with_slopes)
    missed, dG, dh = sums.ddriven[..., 0] + 0 * g, sums.drows, sums.dforced[..., 0]
    X, dX = (column[..., 0] for column in solved(-E, dE, g[..., None], missed[..., None]))
    right, of_right = g_1 - M * X, M * (missed + dX)
    X_1, dX_1 = (column[..., 0] for column in solved(-E, dE, right[..., None], of_right[..., None]))
    size_X, size_X_1 = np.abs(X), np.abs(X_1)
    value, slope = ordered_product(G, X) + h, ordered_product(G_1, X) + ordered_product(G, X_1) + h_1
    size = ordered_product(frame.sizes[0], size_X) + frame.forced_size
    size_1 = M * size + ordered_product(frame.sizes[0], size_X_1)
    error = ordered_product(np.abs(G), dX) + ordered_product(dG, size_X) + dh + rough * size
    error_1 = ordered_product(np.abs(G_1), dX) + ordered_product(np.abs(G), dX_1)
    error_1 = error_1 + ordered_product(dG, M * size_X + size_X_1) + M * dh + rough * size_1
    value, slope, *pairs = (np.moveaxis(array, -1, 0) / M for array in (value, slope, error, error_1, size, size_1))
    return (value, pairs[0]), (slope, pairs[1]), tuple(pairs[2:])
