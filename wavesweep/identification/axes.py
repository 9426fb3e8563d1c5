"""A device of several axes, each of which is fitted as one that the others hold back as well.

    M a + D v + F sgn(v) = f(t - D T) + f_0

M and D are symmetric, F is the friction of each axis. Axis i is the device of `prediction` with the
mass M_ii and the damping D_ii, beside which M_ij a_j + D_ij v_j of the other axes act, linear in
the innovations as friction is. Their motion is that of a smoother; where the force of the log
changes within a tick, the acceleration does by 1/M times this.
"""

from collections.abc import Sequence
from itertools import chain, combinations_with_replacement

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.identification.explained import Verdict, identified
from wavesweep.identification.fit import Fit
from wavesweep.identification.log import Log
from wavesweep.identification.model import ORDER, Model, late
from wavesweep.identification.prediction.fitting import predicted
from wavesweep.identification.prediction.innovations import errors_of, projected
from wavesweep.identification.prediction.intervals import Prediction
from wavesweep.identification.prediction.smoother import smoothed_states

# condition of the correlations of forces, beyond which some are sums of the others but for rounding
MOST_ALIKE = 1e8
ALIKE = "expected forces of the axes that differ, found some that are sums of others; push each axis with a signal of its own"


def identified_axes(
    model: Model, axes: Sequence[str], logs: Sequence[Log], steps: Sequence[float]
) -> tuple[dict[str, tuple[float, float]], list[tuple[Fit, Verdict]]]:
    """Fit a device of several axes to their logs, of the same rows: its numbers, with half the
    widths of their intervals; and the fit of each axis under what moves this one alone, with what
    it lacks.

    steps: of the readings, 0 for none. Errors: UsageError if the forces do not tell the masses.
    """
    forces = np.stack([log.force for log in logs])
    if np.linalg.cond(np.corrcoef(forces)) > MOST_ALIKE:
        raise UsageError(ALIKE)
    of_logs = []
    for log, step in zip(logs, steps, strict=True):
        of_logs.append((log.reading - log.reading[0], log.period, step))
    coupled: list[list[np.ndarray]] = [[] for _ in logs]
    rounds = []
    # All axes: alone, beside the motion of the others as it was found, and twice again.
    for _ in range(4):
        predictions = [
            predicted(model, force, *of_log, resisting)
            for force, of_log, resisting in zip(forces, of_logs, coupled, strict=True)
        ]
        rounds.append(_numbers(axes, predictions))
        coupled_before = coupled
        coupled = _coupled(axes, rounds[-1], forces, predictions)
    M = _mass_matrix(axes, rounds[-1])
    jumping = (M - np.diag(np.diag(M))) @ np.linalg.solve(M, forces)
    alone = []
    of_axes = zip(predictions, forces, of_logs, coupled_before, jumping, strict=True)
    for prediction, force, of_log, resisting, held in of_axes:
        resistance = np.tensordot(prediction.theta[-len(resisting) :], np.array(resisting)[:, 0], 1)
        earlier = as_early_as_the_force(resistance, held, prediction.searched["delay"])
        alone.append(identified(model, force - earlier, *of_log))
    wider = max(1.0, *(1 + np.max((fit.extra / fit.half)[:2]) for fit, _ in alone))
    numbers = {}
    for name, (value, half) in rounds[-1].items():
        numbers[name] = value, wider * (half + abs(value - rounds[-2][name][0]))
    return numbers, alone


def as_early_as_the_force(resistance: np.ndarray, held: np.ndarray, delay: float) -> np.ndarray:
    """The means of a force over ticks that begin `delay` ticks later, from those over ticks.

    held: what of it is held from such a tick to the next, as the accelerations that the forces of the log make, of which
    a line between two means would be a mean of three ticks; the rest has a line.
    """
    whole_ticks = int(np.floor(delay))
    part = delay - whole_ticks
    ticks = np.arange(len(resistance))
    mean = (1 - part) * late(held, whole_ticks) + part * late(held, whole_ticks + 1)
    return np.interp(ticks + delay, ticks, resistance - mean) + held


def _mass_matrix(axes: Sequence[str], numbers: dict[str, tuple[float, float]]) -> np.ndarray:
    return np.array(
        [[numbers["mass_" + "".join(sorted((first, two)))][0] for two in axes] for first in axes]
    )


def _names(axis: str, axes: Sequence[str], model: Model) -> list[str]:
    """The numbers of a fit of one axis, in the order of `Prediction.theta`: those of its own motion,
    and mass and damping of its coupling to each other axis."""
    names = [f"mass_{axis}{axis}", f"damping_{axis}{axis}"]
    if model.friction:
        names.append(f"friction_{axis}")
    if model.delay is None:
        names.append("delay")
    for second in axes:
        if second != axis:
            pair = "".join(sorted(axis + second))
            names += [f"mass_{pair}", f"damping_{pair}"]
    return names


def _numbers(
    axes: Sequence[str], predictions: Sequence[Prediction]
) -> dict[str, tuple[float, float]]:
    """The numbers and half the widths of their intervals; one that several axes tell is their mean
    and has the mean of the widths, as if all errors were the same. In the first round nothing is
    coupled: its fits end before the couplings, which are 0 with no width."""
    pairs = [*map("".join, combinations_with_replacement(axes, 2))]
    told = {f"{matrix}_{pair}": [] for matrix in ("mass", "damping") for pair in pairs}
    for axis, prediction in zip(axes, predictions, strict=True):
        names = _names(axis, axes, prediction.model)
        for name in names:
            told.setdefault(name, [])
        values = prediction.theta.copy()
        values[0] = np.exp(values[0])
        half = prediction.half.copy()
        half[0] *= values[0]
        if prediction.place.log.one_way:  # friction, number 2, may be a constant force
            half[2] = np.inf
        # without couplings in the first round
        for name, value, width in zip(names, values, half, strict=False):
            told[name].append((value, width))
    told["delay"] = told.pop("delay", [(predictions[0].searched["delay"], 0.0)])
    return {
        name: tuple(np.mean(of_fits or [(0.0, 0.0)], axis=0).tolist())
        for name, of_fits in told.items()
    }


def _coupled(axes, numbers, forces, predictions) -> list[list[np.ndarray]]:
    """What resists each axis beside itself: of each other axis, the means over each tick, see
    `ScaledLog.side`, of its acceleration and of its velocity."""
    M = _mass_matrix(axes, numbers)
    delay = numbers["delay"][0]
    whole_ticks = int(np.floor(delay))
    part = delay - whole_ticks
    jumps = [late(force, whole_ticks) - late(force, whole_ticks + 1) for force in forces]
    motions = []
    for prediction, jump in zip(predictions, np.linalg.solve(M, jumps), strict=True):
        log, search, point, skip = prediction.place
        predictor, errors, effects = errors_of(log, search.found(point), skip)
        gains, _ = projected(errors, effects)
        states = smoothed_states(log, predictor, search.found(point), gains, skip)
        unit = log.unit * log.period ** (ORDER[log.model.measured] - 1)
        speed = unit * states[predictor.tick.speed]
        change = np.append(np.diff(speed), 0.0)
        # The moment of a jump after a part of the tick.
        moment = -part * (1 - part) / 2 * jump
        motions.append(
            (np.stack([change / log.period, moment]), np.stack([speed + change / 2, -change / 12]))
        )
    return [
        [*chain(*(motion for other_axis, motion in enumerate(motions) if other_axis != axis))]
        for axis in range(len(motions))
    ]
