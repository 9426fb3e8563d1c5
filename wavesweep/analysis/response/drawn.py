"""Responses of drawn loops at the hand's port: admittance, and the impedance of the part of the loop that opposes the hand."""

import numpy as np

from wavesweep.analysis.response.bordered import solved
from wavesweep.analysis.response.delayed import solved_frame
from wavesweep.analysis.response.port import STILL, Port, driven
from wavesweep.analysis.response.steady import Response
from wavesweep.analysis.response.ticks import ordered_product
from wavesweep.lifted.circle import on_circle

POINTS = 256  # frequencies at a time
NOTHING = 1e-11  # of the hand's force, or of the terms of a position, up to which what rounding may leave of it is none
LOST = 0.1  # relative error from which on a number has no digit


def respond_port(port: Port, frequency_hz) -> Response:
    """Return admittance (m/N) and impedance (N/m) of the port, `(points,)`, with estimates of their relative errors.

    port: the loop seen from the hand. frequency_hz: in Hz; 0 for the static limit. With the force z^k in tick k, the state at
    the start of a frame solves `(z^M - Phi) X = g`; Phi is the frame and g the effect of the force in it. The admittance is the
    displacement's component at the force's own frequency, over z - 1. The frame is begun at two different ticks, and the error
    is the difference of the two results plus the bound of the solution.
    Accuracy: as stated with each number; near multiples of the frame's rate, drifts other than a shift of positions cost
    digits.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    found = [np.empty(frequency.size, kind) for kind in (complex, complex, float, float)]
    for still in (False, True):
        chosen = np.flatnonzero((frequency == 0) == still)
        for at in (chosen[start : start + POINTS] for start in range(0, chosen.size, POINTS)):
            for part, values in zip(found, _both(port, frequency[at], still), strict=True):
                part[at] = values
    return Response(*found)


def _both(port, frequency, still):
    """Return admittance, impedance and their errors; still: whether the frequency is 0 Hz."""
    if still:
        return tuple(np.broadcast_to(part, frequency.size) for part in static_port_response(port))
    with np.errstate(all="ignore"):
        (one, error), (two, _) = (_once(each, frequency) for each in (port, port.turned(max(1, port.kind.size // 2))))
        w = on_circle(2 * np.pi * frequency * port.period)
        return _response(*_of_drift(one, error + np.abs(one - two), w))


def _of_drift(found, error, w):
    """Return position and force against the hand, `(2 or 1, ...)`, and errors, from the outputs of the port.

    w: `z - 1` of the tick.
    """
    shown = [found[0] / w, *found[1:2]]
    off = [error[0] / np.abs(w), *error[1:2]]
    if len(found) > 2:
        shown[1], off[1] = shown[1] + found[2] / w, off[1] + error[2] / np.abs(w)
    return np.stack(shown), np.stack(off)


def _response(found, error):
    """Return admittance, impedance and their relative errors, from position and force and errors of these."""
    with np.errstate(all="ignore"):
        relative = np.where(error == 0, 0.0, error / np.abs(found)) + 4 * np.finfo(float).eps
        relative = np.where(relative < LOST, relative, np.nan)
        admittance = np.where(np.isnan(relative[0]), np.nan, found[0])
        if len(found) == 1:
            return admittance, 1 / admittance, relative[0], relative[0]
        return admittance, np.where(np.isnan(relative[1]), np.nan, found[1] / admittance), relative[0], relative.sum(0)


def static_port_response(port: Port, *, twice: bool = True) -> tuple[np.ndarray, ...]:
    """Return admittance (m/N) and impedance (N/m) of a port in the limit towards 0 Hz, and bounds on their relative errors.

    All are `(...)`, one entry for each port of a batch. NaN: there is none, or it is not known. If a constant force moves the
    position without end, there is no admittance. If it does not move it at all in the end, as a position that an integrator
    holds, the admittance is 0, and there is no impedance; or it is not known, if the force against the hand vanishes with the
    position. The error of a number that does not exist is 0.

    With w = z - 1 of the tick and M ticks in a frame, both sides of `(z^M - 1 - E) X = g` and of the outputs of a frame are
    expanded to first order: `E X_0 = -g_0`, `E X_1 = M X_0 - g_1`. A change within a tick vanishes with w, and its slope is the
    quantity that has changed. Slopes are those of a complex step (W. Squire, G. Trapp, SIAM Rev. 40, 1998). The error is that
    of both solutions, and the difference of two frames that begin with different ticks; twice: whether the second is computed.
    """
    with np.errstate(all="ignore"):
        value, slope, errors, (size, of_slopes) = _still(port)
        value_2, slope_2, *_ = _still(port.turned(port.kind.size // 2)) if twice else (value, slope)
        off, off_slope = (error + np.abs(a - b) for error, a, b in zip(errors, (value, slope), (value_2, slope_2), strict=True))
        going = np.abs(value) > off + STILL * size  # of the change in a tick: it changes without end
        found, error = [slope[:1], value[1:2]], [off_slope[:1], off[1:2]]
        forces = np.zeros(value[0].shape), np.zeros(value[0].shape)
        if len(value) > 2:
            found[1], error[1] = found[1] + slope[2:], np.where(np.abs(value[2:]) > off[2:], np.nan, error[1] + off_slope[2:])
            forces = value[2], off[2] / np.abs(value[2])
        rigid = (np.abs(found[0]) <= error[0]) & (error[0] <= NOTHING * of_slopes[:1]) & (np.abs(value[:1]) <= off[:1])
        found[0], error[0] = np.where(rigid, 0.0, found[0]), np.where(rigid, 0.0, error[0])
        error[0] = np.where(np.abs(value[:1]) > off[:1], np.nan, error[0])  # if it is going, and if that is not clear
        none = (np.abs(found[-1]) <= error[-1]) & (error[-1] <= NOTHING) & (len(value) > 1)  # of 1 N: nothing but rounding
        found[-1], error[-1] = np.where(none, 0.0, found[-1]), np.where(none, 0.0, error[-1])
        admittance, impedance, *relative = _response(np.concatenate(found), np.concatenate(error))
        stiffness = np.where(forces[0] == 0, 0.0, forces[0] / value[0])
        unsure = np.where(forces[0] == 0, 0.0, forces[1] + off[0] / np.abs(value[0]))
    impedance, unsure = (np.where(going[0], *pair) for pair in ((stiffness, impedance), (unsure, relative[1])))
    opposed = len(value) == 1 or np.abs(found[1][0]) > error[1][0]
    unsure = np.where(rigid[0], np.where(opposed, 0.0, np.nan), unsure)
    impedance = np.where(rigid[0], np.nan, impedance)
    return admittance + 0j, impedance + 0j, np.where(going[0], 0.0, relative[0]), unsure


STEP = 1e-30  # of z, for slopes


def _still(port):
    """Return the outputs of a frame under a constant force and their slopes, `(outputs, ...)`, with their errors and sizes.

    The errors are bounds for both. The sizes are those of the terms of both.
    """
    frame, M, rough = driven(port, np.array([1 + 1j * STEP])), port.kind.size, port.rough
    parts = (part for each in (frame.g, frame.G, frame.h) for part in (each.real, each.imag / STEP))
    E, unsure, (g, g_1, G, G_1, h, h_1) = -frame.E, frame.dE, parts
    right, missed = (g, rough * frame.g_size), rough * M * frame.g_size
    if port.laws:
        E, unsure, right = _with_law(E, unsure, right, (g_1 / M, missed / M))
    X, dX = (each[..., 0] for each in solved(E, unsure, *(part[..., None] for part in right)))
    more = missed + M * dX
    X_1, dX_1 = (each[..., 0] for each in solved(E, unsure, (g_1 - M * X)[..., None], more[..., None]))
    size = ordered_product(frame.G_size, np.abs(X)) + frame.h_size
    value, slope = ordered_product(G, X) + h, ordered_product(G_1, X) + ordered_product(G, X_1) + h_1
    error = ordered_product(np.abs(G), dX) + rough * size
    size_1 = M * size + ordered_product(frame.G_size, np.abs(X_1))
    error_1 = rough * size_1 + ordered_product(np.abs(G_1), dX) + ordered_product(np.abs(G), dX_1)
    parts = (np.moveaxis(part, -1, 0) / M for part in (value, slope, error, error_1, size, size_1))
    value, slope, *pairs = parts
    return value, slope, tuple(pairs[:2]), tuple(pairs[2:])


def _with_law(E, unsure, right, later):
    """Return the equations `E X = g` with a conserved combination of the states determined by the start of the force.

    right: g and its error. NaN if the mean of the force changes the combination without end.

    With `l E = 0`, the expansion of `(M w + E) X = g + g_1 w` gives `l g = 0` and `l X = l g_1/M` (later: `g_1/M`, and its
    error). The second equation is added along l, a direction in which E is zero. A state that it keeps constant gives no
    displacement, whatever its value is.
    """
    left, values, _ = np.linalg.svd(np.where(np.isfinite(E), E, 0.0))
    law, scale = left[..., -1], values[..., :1, None]
    whole = E + scale * law[..., :, None] * law[..., None, :]
    off = np.abs(np.linalg.pinv(np.where(np.isfinite(whole), whole, 0.0)))
    vague = ordered_product(np.swapaxes(off, -1, -2), ordered_product(np.swapaxes(unsure, -1, -2), np.abs(law)))  # of the law
    (g, dg), (g_1, dg_1) = right, later
    mean, size = (
        (law * g).sum(-1, keepdims=True),
        (np.abs(law) * (dg + STILL * np.abs(g)) + vague * np.abs(g)).sum(-1, keepdims=True),
    )
    left_in, error = (law * g_1).sum(-1, keepdims=True), (np.abs(law) * dg_1 + vague * np.abs(g_1)).sum(-1, keepdims=True)
    g = np.where(np.abs(mean) <= size, g + scale[..., 0] * law * left_in, np.nan)
    dg = dg + scale[..., 0] * (np.abs(law) * error + vague * np.abs(left_in))
    twist = vague[..., :, None] * np.abs(law)[..., None, :]
    return whole, unsure + scale * (twist + np.swapaxes(twist, -1, -2)), (g, dg)


def _once(port, frequency):
    """Return components `(outputs, points)` at the force's frequency and bounds on their errors."""
    z, M = np.exp(2j * np.pi * frequency * port.period), port.kind.size
    frame = driven(port, z)
    wM = on_circle(2 * np.pi * frequency * port.period * M)
    rough = port.rough
    g, dg = frame.g[..., None], rough * frame.g_size[..., None]
    X, dX = (each[..., 0] for each in solved_frame(frame.E, frame.dE, wM[:, None, None], g, dg))
    total = (frame.G @ X[..., None])[..., 0] + frame.h
    terms = (frame.G_size @ np.abs(X)[..., None])[..., 0] + frame.h_size
    error = (np.abs(frame.G) @ dX[..., None])[..., 0] + rough * terms
    return total.T / M, error.T / M
