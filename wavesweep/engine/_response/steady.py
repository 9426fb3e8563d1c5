"""Steady response of loops to a sinusoidal force of the hand, as the hand feels it, with bounds
on its errors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._monodromy.bounded import sum_rounding
from wavesweep.engine._response.bordered import fits
from wavesweep.engine._response.lifted import Lifted, Sums
from wavesweep.engine._response.static import (
    LOST_DIGITS,
    ZERO_OF_TERMS,
    AtRest,
    Response,
    at_port,
    at_signal,
    dcgain,
    dcgain_between,
    relative_response,
)
from wavesweep.engine.doubles import FEW_ROUNDINGS
from wavesweep.engine.rows import different

if TYPE_CHECKING:
    from wavesweep.engine._response.circle import Circle

# relative error up to which the modes are believed; beyond it the larger system is solved
GOOD = 1e-9
RICHARDSON_WEIGHTS = (1 + 20 + 64) / 45  # the sum of their sizes, of three frequencies


def respond(
    loop: Lifted, frequency_hz: np.ndarray | Sequence[float] | float, good: float = GOOD
) -> Response:
    """Return transmitted admittance and impedance with bounds on their relative errors.

    frequency_hz: `(points,)`, Hz; 0 for the static limit. good: relative error up to which a number
    is not computed again in a slower way.

    The force `exp(j w k T)` gives a sum over `w + 2 pi m/T_s`, and both results are its components
    at w itself. The state at the start of a frame solves `(w - E) X = g`, with the loop closed and
    without what drifts, so that no pole of an open loop enters. It is found through the modes of E;
    if these cancel too far, from a larger system (see `Bordered`). Accuracy: as bounded, from the
    residual of the solution, the errors of all entries and the size of the inverse.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    still = frequency == 0
    shape = *loop.port.batch, frequency.size
    response = Response(
        np.empty(shape, complex), np.empty(shape, complex), np.empty(shape), np.empty(shape)
    )
    with np.errstate(all="ignore"):
        for portion in _portions(loop, np.flatnonzero(~still)):
            moving = _responses(loop, loop.circle(frequency[portion]), good)
            for array, values in zip(response, moving, strict=True):
                array[..., portion] = values
        if still.any():
            limits = static_response(loop)
            for array, limit in zip(response, limits, strict=True):
                array[..., still] = limit[..., None]
    return response


def _portions(loop: Lifted, columns: np.ndarray) -> Iterator[Any]:
    """The columns of frequencies, some at a time, as many as keep arrays of loops, states and
    frequencies small."""
    # Numbers of loops, states and frequencies at a time.
    width = max(1, 2_000_000 // max(1, loop.weight))
    return (columns[start : start + width] for start in range(0, columns.size, width))


def transfer(
    loop: Lifted, frequency_hz: np.ndarray | Sequence[float] | float, good: float = GOOD
) -> tuple[np.ndarray, np.ndarray]:
    """Return the response of a signal to an input, `(..., points)`, and bounds on its relative
    errors; see `Port.between`.

    loop: over the frame of such a port. frequency_hz, good and the accuracy: as for `respond`, and
    NaN as there. The component is that at the input's own frequency, of the signal as each tick
    shows it. A path that is held over the frame has none at multiples of the frame's rate.
    """
    frequency = np.atleast_1d(np.asarray(frequency_hz, float))
    still = frequency == 0
    shape = *loop.port.batch, frequency.size
    value = np.empty(shape, complex)
    unsure = np.empty(shape)
    frame = loop.frame
    with np.errstate(all="ignore"):
        to_state = frame.sizes[1]
        to_output = frame.sizes[0]
        through_states = (to_output @ to_state)[..., :1, 0]
        terms = (frame.forced_size[..., :1] + through_states) / frame.ticks
        for portion in _portions(loop, np.flatnonzero(~still)):
            points = loop.circle(frequency[portion])
            quantities, errors = _quantities(loop, points, good)
            signal = quantities[..., 0, :]
            error = errors[..., 0, :]
            small = (np.abs(signal) <= error) & (error <= ZERO_OF_TERMS * terms)
            none = small & (points.frame == 0)
            signal = np.where(none, 0.0, signal)
            error = np.where(none, 0.0, error)
            relative = np.where(error == 0, 0.0, error / np.abs(signal)) + FEW_ROUNDINGS
            relative = np.where(relative < LOST_DIGITS, relative, np.nan)
            unsure[..., portion] = relative
            value[..., portion] = np.where(np.isnan(relative), np.nan, signal)
        if still.any():
            limit, of_limit = dcgain_between(loop)
            value[..., still] = limit[..., None]
            unsure[..., still] = of_limit[..., None]
    return value, unsure


def static_response(loop: Lifted) -> Response:
    """Return admittance (m/N) and impedance (N/m) in the limit towards 0 Hz, and their relative
    errors, `(...)` each.

    NaN: it does not exist, or is not known. If a constant force moves the position without end,
    there is no admittance. If it does not move it at all in the end, as a position that an
    integrator holds, the admittance is 0, and there is no impedance; or it is not known, if the
    force against the hand vanishes with the position. The error of a number that does not exist is
    0. Accuracy: the smaller one of a bound and of the distance to an extrapolation from low
    frequencies, which shares no formula with the limit.
    """
    with np.errstate(all="ignore"):
        (position, force), (of_position, of_force), rest = dcgain(loop)
        nothing_comes = rest.silent & ~rest.rigid
        impedance = np.where(nothing_comes, 0.0, force / position)
        limits = np.stack([position, impedance])
        of_admittance = of_position / np.abs(position)
        from_force = np.where(force == 0, 0.0, of_force / np.abs(force))
        from_position = np.where(force == 0, 0.0, of_admittance)
        error = np.stack([of_admittance, from_force + from_position])
        rough = ~(error <= GOOD).all(0) & ~(rest.going | rest.rigid | loop.lost)
        if rough.any():
            low = np.full(limits.shape, np.inf)
            if rough.ndim == 1:
                few = Lifted.of(loop.port.some(rough))
                low[:, rough] = _from_low_frequencies(few, limits[:, rough])
            else:
                low[...] = _from_low_frequencies(loop, limits)
            error = np.where(rough & (limits != 0), np.fmin(error, low), error)
        error += np.where(limits == 0, 0.0, FEW_ROUNDINGS)
        resolved = error < LOST_DIGITS
        limits = np.where(resolved, limits, np.nan)
        error = np.where(resolved, error, np.nan)
        force_comes = np.abs(force) > of_force
        numbers = _at_rest(rest, limits, error, force_comes)
        return Response(*(np.where(loop.lost, np.nan, number) for number in numbers))


def _at_rest(
    rest: AtRest, limits: np.ndarray, error: np.ndarray, force_comes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Admittance and impedance with their errors, as far as they exist; force_comes: whether a force
    is known to come."""
    admittance, impedance = limits
    of_admittance, of_impedance = error
    # A constant force moves the position without end: there is no admittance.
    admittance = np.where(rest.going, np.nan, admittance)
    of_admittance = np.where(rest.going, 0.0, of_admittance)
    # It does not move it at all: the admittance is 0, and there is no impedance if a force comes.
    no_impedance = np.where(force_comes, 0.0, np.nan)
    admittance = np.where(rest.rigid, 0.0, admittance)
    of_admittance = np.where(rest.rigid, 0.0, of_admittance)
    impedance = np.where(rest.rigid, np.nan, impedance)
    of_impedance = np.where(rest.rigid, no_impedance, of_impedance)
    return admittance + 0j, impedance + 0j, of_admittance, of_impedance


def _from_low_frequencies(loop: Lifted, limits: np.ndarray) -> np.ndarray:
    """Return how far a limit of admittance and impedance may be off, relative, `(2, ...)`, by
    Richardson's extrapolation from frequencies f, f/2 and f/4.

    Their real parts g are even in f, so the limit is `(g(f) - 20 g(f/2) + 64 g(f/4))/45`.
    """
    poles = np.abs(loop.modal.poles)
    slow = np.min(poles, axis=-1, where=poles > 0, initial=1.0)
    # Powers of four, and one for each loop, so that a result does not depend on the batch that the
    # loop is in.
    # The static limit is compared to a frequency this far below the slowest pole and the frame's
    # rate.
    level = np.floor(np.log2(2e-4 * slow * loop.port.rate / loop.frame.ticks) / 2)
    low = [np.full((*level.shape, 3), np.nan, kind) for kind in (complex, complex, float, float)]
    for power in different(level):
        response = _responses(loop, loop.circle(4.0**power * np.array([1, 0.5, 0.25])), GOOD)
        low = [
            np.where((level == power)[..., None], new, old)
            for new, old in zip(response, low, strict=True)
        ]
    off = []
    for value, at_low, error in zip(limits, low[:2], low[2:], strict=True):
        first = (4 * at_low[..., 1] - at_low[..., 0]).real / 3
        second = (4 * at_low[..., 2] - at_low[..., 1]).real / 3
        expected = (16 * second - first) / 15
        missed = RICHARDSON_WEIGHTS * (error * np.abs(at_low)).max(-1)
        away = np.abs(value - expected) + missed
        off.append(away / np.minimum(np.abs(value), np.abs(expected)))
    return np.stack(off)


def _responses(loop: Lifted, points: Circle, good: float) -> Response:
    """`respond` for some frequencies that are not 0."""
    quantities, error = _quantities(loop, points, good)
    force = quantities[..., 1, :]
    of_force = error[..., 1, :]
    small = (np.abs(force) <= of_force) & (of_force <= ZERO_OF_TERMS)
    none = small & (points.frame == 0)  # as of one that is held over the frame
    quantities[..., 1, :] = np.where(none, 0.0, force)
    error[..., 1, :] = np.where(none, 0.0, of_force)
    return relative_response(quantities, error)


def _quantities(loop: Lifted, points: Circle, good: float) -> tuple[np.ndarray, np.ndarray]:
    """What a port shows, `(..., quantities, points)`, and bounds on its errors, NaN of a loop
    that is lost."""
    quantities, error, again = _by_modes(loop, points)
    ways = [again]
    if fits(loop.port):
        ways.append(lambda index: loop.bordered.outputs(points.at(index)))
    reading = _reading(loop)
    for improve in ways:
        doubtful = ~(error <= good * np.abs(quantities)).all(-2) & ~loop.lost[..., None]
        columns = np.flatnonzero(doubtful.any(axis=tuple(range(doubtful.ndim - 1))))
        # Entries of one batch of matrices.
        width = max(1, 200_000 // (3 * loop.order + 1) ** 2 // max(1, loop.lost.size))
        for start in range(0, columns.size, width):
            index = columns[start : start + width]
            step = points.tick[index]
            outputs, of_outputs = improve(index)
            number = reading(outputs, step)
            less = reading(of_outputs, np.abs(step))
            better = doubtful[..., None, index] & ~(less >= error[..., index])
            quantities[..., index] = np.where(better, number, quantities[..., index])
            error[..., index] = np.where(better, less, error[..., index])
    return quantities, np.where(loop.lost[..., None, None], np.nan, error)


def _reading(loop: Lifted) -> Callable[..., Any]:
    """How quantities follow from the outputs of the port."""
    return at_signal if loop.port.of_signal else at_port


def _by_modes(loop: Lifted, points: Circle) -> tuple[np.ndarray, np.ndarray, Callable[..., Any]]:
    """Return position and force, `(..., 2, points)`, or the signal of a port between two, bounds on
    errors, and a function.

    The function returns the outputs at some of the points again, with a better bound.
    """
    sums = Sums.of(loop.frame, points)
    modal = loop.modal
    ticks = loop.frame.ticks
    X, *accuracy = modal.solve(points.frame, sums.driven, sums.ddriven)
    states = X.mT[..., None, :, :]
    size = np.abs(sums.rows)
    outputs = ((sums.rows * states).sum(-1) + sums.forced) / ticks
    rounding = sum_rounding(X.shape[-2] + 2, of_complex=True)
    of_sums = (size * np.abs(states)).sum(-1) + np.abs(sums.forced)
    rest = rounding * of_sums + sums.drows @ np.abs(X) + sums.dforced

    def error(of_states: np.ndarray, index: np.ndarray | slice) -> np.ndarray:
        """The bound on errors of the outputs, from that on errors of the states."""
        grown = of_states.mT[..., None, :, :]
        return ((size[..., index, :] * grown).sum(-1) + rest[..., index]) / ticks

    def again(index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        chosen = (measure[..., index] for measure in accuracy)
        bound = modal.careful_bound(points.frame[index], *chosen)
        return outputs[..., index], error(bound, index)

    step = points.tick
    reading = _reading(loop)
    bound = error(modal.bound(*accuracy), slice(None))
    return reading(outputs, step), reading(bound, np.abs(step)), again
