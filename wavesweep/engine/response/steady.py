"""Steady response of loops to a sinusoidal force of the hand, as the hand feels it, with bounds on its errors."""

import numpy as np

from wavesweep.engine.monodromy.rounding import ROUNDING
from wavesweep.engine.response.bordered import fits
from wavesweep.engine.response.lifted import Lifted, Sums
from wavesweep.engine.response.static import (
    LOST,
    NOTHING,
    Response,
    at_port,
    at_signal,
    dcgain,
    dcgain_between,
    relative_response,
)
from wavesweep.engine.rows import different

GOOD = 1e-9  # relative error up to which the modes are believed; beyond it the larger system is solved
EXTRAPOLATED = 85 / 45  # the sum of the sizes of the weights by which an extrapolation adds up three values
LOW = 2e-4  # of the slowest pole and of the frame's rate: the frequency to which the static limit is compared
TERMS = 2_000_000  # numbers of loops, states and frequencies at a time
BLOCK = 200_000  # entries of one batch of matrices


def respond(loop: Lifted, frequency_hz, good: float = GOOD) -> Response:
    """Return transmitted admittance and impedance with bounds on their relative errors.

    frequency_hz: `(points,)`, Hz; 0 for the static limit. good: relative error up to which a number is not computed again in a
    slower way.

    The force `exp(j w k T)` gives a sum over `w + 2 pi m/T_s`, and both results are its components at w itself. The state at
    the start of a frame solves `(w - E) X = g`, with the loop closed and without what drifts, so that no pole of an open loop
    enters. It is found through the modes of E; if these cancel too far, from a larger system (see `Bordered`).
    Accuracy: as bounded, from the residual of the solution, the errors of all entries and the size of the inverse.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    still = frequency == 0
    response = Response(*(np.empty((*loop.port.batch, frequency.size), kind) for kind in (complex, complex, float, float)))
    with np.errstate(all="ignore"):
        moving, width = np.flatnonzero(~still), max(1, TERMS // max(1, loop.weight))
        for at in (moving[start : start + width] for start in range(0, moving.size, width)):
            for array, values in zip(response, _responses(loop, loop.circle(frequency[at]), good), strict=True):
                array[..., at] = values
        if still.any():
            for array, limits in zip(response, static_response(loop), strict=True):
                array[..., still] = limits[..., None]
    return response


def transfer(loop: Lifted, frequency_hz, good: float = GOOD) -> tuple[np.ndarray, np.ndarray]:
    """Return the response of a signal to an input, `(..., points)`, and bounds on its relative errors; see `port_between`.

    loop: over the frame of such a port. frequency_hz, good and the accuracy: as for `respond`, and NaN as there. The component
    is that at the input's own frequency, of the signal as each tick shows it. A path that is held over the frame has none at
    multiples of the frame's rate.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    value, unsure = (np.empty((*loop.port.batch, frequency.size), kind) for kind in (complex, float))
    still, width, frame = frequency == 0, max(1, TERMS // max(1, loop.weight)), loop.frame
    with np.errstate(all="ignore"):
        moving = np.flatnonzero(~still)
        terms = (frame.forced_size[..., :1] + (frame.sizes[0] @ frame.sizes[1])[..., :1, 0]) / frame.ticks
        for at in (moving[start : start + width] for start in range(0, moving.size, width)):
            points = loop.circle(frequency[at])
            signal, error = (quantities[..., 0, :] for quantities in _quantities(loop, points, good))
            none = (np.abs(signal) <= error) & (error <= NOTHING * terms) & (points.frame == 0)
            signal, error = np.where(none, 0.0, signal), np.where(none, 0.0, error)
            relative = np.where(error == 0, 0.0, error / np.abs(signal)) + 4 * np.finfo(float).eps
            unsure[..., at] = relative = np.where(relative < LOST, relative, np.nan)
            value[..., at] = np.where(np.isnan(relative), np.nan, signal)
        if still.any():
            value[..., still], unsure[..., still] = (limits[..., None] for limits in dcgain_between(loop))
    return value, unsure


def static_response(loop: Lifted) -> Response:
    """Return admittance (m/N) and impedance (N/m) in the limit towards 0 Hz, and their relative errors, `(...)` each.

    NaN: it does not exist, or is not known. If a constant force moves the position without end, there is no admittance. If it
    does not move it at all in the end, as a position that an integrator holds, the admittance is 0, and there is no impedance;
    or it is not known, if the force against the hand vanishes with the position. The error of a number that does not exist
    is 0.
    Accuracy: the smaller one of a bound and of the distance to an extrapolation from low frequencies, which shares no formula
    with the limit.
    """
    with np.errstate(all="ignore"):
        (position, force), (of_position, of_force), rest = dcgain(loop)
        limits = np.stack([position, np.where(rest.silent & ~rest.rigid, 0.0, force / position)])
        error = np.stack([of_position / np.abs(position), np.where(force == 0, 0.0, of_force / np.abs(force))])
        error[1] += np.where(force == 0, 0.0, error[0])
        rough = ~(error <= GOOD).all(0) & ~(rest.going | rest.rigid | loop.lost)
        if rough.any():
            low = np.full(limits.shape, np.inf)
            if rough.ndim == 1:
                low[:, rough] = _from_low_frequencies(Lifted.of(loop.port.some(rough)), limits[:, rough])
            else:
                low[...] = _from_low_frequencies(loop, limits)
            error = np.where(rough & (limits != 0), np.fmin(error, low), error)
        error += np.where(limits == 0, 0.0, 4 * np.finfo(float).eps)
        limits = np.where(error < LOST, limits, np.nan)
        error = np.where(error < LOST, error, np.nan)
        limits[0], error[0] = np.where(rest.going, np.nan, limits[0]), np.where(rest.going, 0.0, error[0])
        none = np.where(np.abs(force) > of_force, 0.0, np.nan)  # whether it is known that a rigid loop has no impedance
        for row, (value, unsure) in enumerate(((0.0, 0.0), (np.nan, none))):
            limits[row], error[row] = np.where(rest.rigid, value, limits[row]), np.where(rest.rigid, unsure, error[row])
        limits, error = np.where(loop.lost, np.nan, limits), np.where(loop.lost, np.nan, error)
    return Response(limits[0] + 0j, limits[1] + 0j, error[0], error[1])


def _from_low_frequencies(loop, limits):
    """Return how far a limit of admittance and impedance may be off, relative, `(2, ...)`, by frequencies f, f/2 and f/4.

    Their real parts are even in f.
    """
    poles = np.abs(loop.modal.poles)
    slow = np.min(poles, axis=-1, where=poles > 0, initial=1.0)
    # Powers of four, and one for each loop, so that a result does not depend on the batch that the loop is in.
    level = np.floor(np.log2(LOW * slow * loop.port.rate / loop.frame.ticks) / 2)
    low = [np.full((*level.shape, 3), np.nan, kind) for kind in (complex, complex, float, float)]
    for power in different(level):
        response = _responses(loop, loop.circle(4.0**power * np.array([1, 0.5, 0.25])), GOOD)
        low = [np.where((level == power)[..., None], new, old) for new, old in zip(response, low, strict=True)]
    off = []
    for value, at_low, error in zip(limits, low[:2], low[2:], strict=True):
        first, second = ((4 * at_low[..., i + 1] - at_low[..., i]).real / 3 for i in (0, 1))
        expected, missed = (16 * second - first) / 15, EXTRAPOLATED * (error * np.abs(at_low)).max(-1)
        off.append((np.abs(value - expected) + missed) / np.minimum(np.abs(value), np.abs(expected)))
    return np.stack(off)


def _responses(loop, points, good):
    """`respond` for some frequencies that are not 0."""
    quantities, error = _quantities(loop, points, good)
    force, unsure = quantities[..., 1, :], error[..., 1, :]
    none = (np.abs(force) <= unsure) & (unsure <= NOTHING) & (points.frame == 0)  # as of one that is held over the frame
    quantities[..., 1, :], error[..., 1, :] = np.where(none, 0.0, force), np.where(none, 0.0, unsure)
    return relative_response(quantities, error)


def _quantities(loop, points, good):
    """What a port shows, `(..., quantities, points)`, and bounds on its errors, NaN of a loop that is lost."""
    quantities, error, again = _by_modes(loop, points)
    ways = (again, lambda index: loop.bordered.outputs(points.at(index)))
    for improve in ways if fits(loop.port) else ways[:1]:
        doubtful = ~(error <= good * np.abs(quantities)).all(-2) & ~loop.lost[..., None]
        columns = np.flatnonzero(doubtful.any(axis=tuple(range(doubtful.ndim - 1))))
        width = max(1, BLOCK // (3 * loop.order + 1) ** 2 // max(1, loop.lost.size))
        for start in range(0, columns.size, width):
            index = columns[start : start + width]
            number, less = (_reading(loop)(*pair) for pair in zip(improve(index), _both_steps(points, index), strict=True))
            better = doubtful[..., None, index] & ~(less >= error[..., index])
            quantities[..., index] = np.where(better, number, quantities[..., index])
            error[..., index] = np.where(better, less, error[..., index])
    return quantities, np.where(loop.lost[..., None, None], np.nan, error)


def _reading(loop):
    """How quantities follow from the outputs of the port."""
    return at_signal if loop.port.between else at_port


def _both_steps(points, index):
    step = points.tick[index]
    return step, np.abs(step)


def _by_modes(loop, points):
    """Return position and force, `(..., 2, points)`, or the signal of a port between two, bounds on errors, and a function.

    The function returns the outputs at some of the points again, with a better bound.
    """
    sums, modal, ticks = Sums.of(loop.frame, points), loop.modal, loop.frame.ticks
    X, *accuracy = modal.solve(points.frame, sums.driven, sums.ddriven)
    size, states = np.abs(sums.rows), np.swapaxes(X, -1, -2)[..., None, :, :]
    total = (sums.rows * states).sum(-1) + sums.forced
    rest = (size * (ROUNDING * np.abs(states))).sum(-1) + sums.drows @ np.abs(X) + sums.dforced + ROUNDING * np.abs(sums.forced)

    def error(bound, index):
        grown = np.swapaxes(bound, -1, -2)[..., None, :, :]
        return ((size[..., index, :] * grown).sum(-1) + rest[..., index]) / ticks

    def again(index):
        chosen = (measure[..., index] for measure in accuracy)
        return total[..., index] / ticks, error(modal.careful_bound(points.frame[index], *chosen), index)

    step, length = _both_steps(points, slice(None))
    at = _reading(loop)
    return at(total / ticks, step), at(error(modal.bound(*accuracy), slice(None)), length), again
