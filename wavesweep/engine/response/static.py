"""The limit of a response towards 0 Hz, and the reading of responses from position and force."""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.response.bounded_sums import ordered_product
from wavesweep.engine.response.lifted import Lifted, Sums
from wavesweep.engine.response.linear_systems import solved

STEP = 1e-30  # of z, for slopes
STILL = 1e-9  # of the terms of a displacement: below it the displacement is rounding
NOTHING = 1e-11  # of the hand's force, or of the terms of a position: a value that may be rounding below it counts as zero
LOST = 0.1  # relative error beyond which a number has no correct digit


def at_port(outputs, step):
    """Return position and force against the hand, `(..., 2, points)`, from the outputs of a port (see `Port`).

    step: `z - 1` of the tick, or its size if the outputs are errors. Without a force, that is the hand's own, 1 N.
    """
    found = np.empty((*outputs.shape[:-2], 2, outputs.shape[-1]), outputs.dtype)
    found[..., 0, :] = outputs[..., 0, :] / step
    found[..., 1, :] = outputs[..., 1, :] if outputs.shape[-2] > 1 else np.iscomplexobj(step)
    if outputs.shape[-2] > 2:
        found[..., 1, :] += outputs[..., 2, :] / step
    return found


def at_signal(outputs, step):
    """Return the signal, `(..., 1, points)`, from the outputs of a port between an input and it; step: see `at_port`."""
    found = outputs[..., :1, :] + 0 * step
    return found + outputs[..., 1:2, :] / step if outputs.shape[-2] > 1 else found


def relative_response(found, error):
    """Return admittance, impedance and their relative errors; a number without a correct digit is NaN.

    found, error: position and force, `(..., 2, points)`.
    """
    relative = np.where(error == 0, 0.0, error / np.abs(found)) + 4 * np.finfo(float).eps
    relative = np.where(relative < LOST, relative, np.nan)
    admittance = np.where(np.isnan(relative[..., 0, :]), np.nan, found[..., 0, :])
    impedance = np.where(np.isnan(relative[..., 1, :]), np.nan, found[..., 1, :] / admittance)
    known = np.isfinite(impedance)  # an admittance may be so small that it has no inverse in double precision
    whole = np.where(known, relative.sum(-2), np.nan)
    return admittance, np.where(known, impedance, np.nan), relative[..., 0, :], whole


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


def limit_of(loop: Lifted) -> tuple[np.ndarray, np.ndarray, AtRest]:
    """Return position (m) and force against the hand (N) at rest under 1 N, and bounds on their errors, `(2, ...)` each.

    Of loops whose position moves on these are the changes in a tick. Also returned is what the force does in the end: it
    follows from the structure if the port knows it, or else from the bounds on errors.

    With w = z - 1 of the tick and M ticks in a frame, both sides of `(z^M - 1 - E) X = g` and of the outputs of a frame are
    expanded to first order: `E X_0 = -g_0`, `E X_1 = M X_0 - g_1`. A change within a tick vanishes with w, and its slope is the
    quantity that has changed.
    """
    (value, off), (slope, off_slope), (size, of_slopes) = _limits(loop)
    none, one = np.zeros((2, *slope[0].shape)), np.array([1.0, 0.0]).reshape(2, *(1,) * slope[0].ndim)
    position = np.stack([slope[0], off_slope[0]])
    force = np.stack([value[1], off[1]]) if len(value) > 1 else one + none
    moved = np.stack([value[2], off[2]]) if len(value) > 2 else none
    if len(value) > 2:
        force = force + np.stack([slope[2], off_slope[2]])
    rest = loop.port.rest and loop.port.rest()
    if rest is not None:  # what is not 0 with a loop's own numbers is not 0
        far = [np.abs(each[0]) > each[1] for each in (position, np.where(rest.going, moved, force))]
        rest = AtRest(rest.going, rest.silent & ~far[1], rest.rigid & ~far[0])
        position = np.where(np.abs(value[0]) <= off[0], position, np.nan)  # it may be going
    else:
        still, zero = np.abs(value[0]) <= off[0], [np.abs(each[0]) <= each[1] for each in (position, force, moved)]
        going = np.abs(value[0]) > off[0] + STILL * size[0]
        silent = np.where(going, zero[2], zero[1] & (force[1] <= NOTHING) & (len(value) > 1))
        rest = AtRest(going, silent, ~going & still & zero[0] & (position[1] <= NOTHING * of_slopes[0]))
        position[1] = np.where(still, position[1], np.nan)  # it may be going
        force[1] = np.where(zero[2], force[1], np.nan)
    position = np.where(rest.rigid, 0.0, np.where(rest.going, np.stack([value[0], off[0]]), position))
    force = np.where(rest.silent, 0.0, np.where(rest.going, moved, force))
    return *np.stack([position, force], 1), rest


def limit_between(loop: Lifted) -> tuple[np.ndarray, np.ndarray]:
    """Return the limit of a response between an input and a signal towards 0 Hz, `(...)`, and its relative error.

    NaN: no limit exists, as for a signal that a constant input moves without end, or it is not known. The error of a number
    that does not exist is 0, and so is that of a response that is nothing but rounding, as of one that an integrator removes.
    """
    (value, off), (slope, off_slope), (size, of_slopes) = _limits(loop)
    found, error, terms, going = value[0], off[0], size[0], np.zeros(value[0].shape, bool)
    if len(value) > 1:
        found, error, terms = found + slope[1], error + off_slope[1], terms + of_slopes[1]
        going = np.abs(value[1]) > off[1] + STILL * size[1]
        error = np.where(going | (np.abs(value[1]) <= off[1]), error, np.nan)
    nothing = (np.abs(found) <= error) & (error <= NOTHING * terms)
    relative = np.where(nothing | going, 0.0, error / np.abs(found) + 4 * np.finfo(float).eps)
    relative = np.where((relative < LOST) & ~loop.lost, relative, np.nan)
    return np.where(nothing, 0.0, np.where(going | np.isnan(relative), np.nan, found)), relative


def _limits(loop):
    """Return the outputs in a tick under a constant force and their slopes, `(outputs, ...)`, each with bounds on its errors.

    Also returned are the sizes of the terms of both.
    """
    frame, M = loop.frame, loop.frame.ticks
    sums = Sums.of(frame, _AtRest())
    (E, dE), rough = frame.E, loop.port.rough
    parts = sums.left[..., 0], sums.rows[..., 0, :], sums.own[..., 0]
    (g, g_1), (G, G_1), (h, h_1) = ((part.real, part.imag / STEP) for part in parts)
    missed, dG, dh = sums.dleft[..., 0] + 0 * g, sums.drows, sums.down[..., 0]
    X, dX = (each[..., 0] for each in solved(-E, dE, g[..., None], missed[..., None]))
    right, more = g_1 - M * X, M * (missed + dX)
    X_1, dX_1 = (each[..., 0] for each in solved(-E, dE, right[..., None], more[..., None]))
    one, two = np.abs(X), np.abs(X_1)
    value, slope = ordered_product(G, X) + h, ordered_product(G_1, X) + ordered_product(G, X_1) + h_1
    size = ordered_product(frame.sizes[0], one) + frame.size_of_own
    size_1 = M * size + ordered_product(frame.sizes[0], two)
    error = ordered_product(np.abs(G), dX) + ordered_product(dG, one) + dh + rough * size
    error_1 = ordered_product(np.abs(G_1), dX) + ordered_product(np.abs(G), dX_1)
    error_1 = error_1 + ordered_product(dG, M * one + two) + M * dh + rough * size_1
    value, slope, *pairs = (np.moveaxis(part, -1, 0) / M for part in (value, slope, error, error_1, size, size_1))
    return (value, pairs[0]), (slope, pairs[1]), tuple(pairs[2:])
