"""Forces of a device that its model lacks and that are curves of its motion, looked for in the
innovations of a fit.

A force that walks at random does not know of the motion: a fit by predictions allows for it. A
curve does, as friction that depends on direction, a drag, an inductance that saturates or a spring
that hardens, and then mass and damping are those of no line. So each curve that is listed here is
fitted beside the model, as a sum of forces of unknown size at the motion that a smoother finds, and
compared by what it leaves of the innovations (Ljung, System Identification, 1999, section 16.6).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.identification.model import late
from wavesweep.identification.prediction.innovations import errors_of, projected, theta_of
from wavesweep.identification.prediction.scaled_log import ScaledLog
from wavesweep.identification.prediction.search import Place, least_of
from wavesweep.identification.prediction.smoother import (
    force_beside,
    path_within_ticks,
    smoothed_states,
)

STEPS_WITH_CURVE = 12  # of the search with a curve
# of a curve over the mass, per tick; friction that turns round is steeper, and no line in a tick
STEEPEST = 0.5


class Motion(NamedTuple):
    """Velocity and position over their rms, and the force of the log, late as it acts, over its
    own, at one moment of each tick."""

    speed: np.ndarray
    place: np.ndarray
    force: np.ndarray


Curve = Callable[[Motion], Sequence[np.ndarray]]


def _side(motion):
    return np.tanh(30.0 * motion.speed)  # 30 usual speeds over that at which friction turns round


CURVES: dict[str, Curve] = {
    "sided friction": lambda motion: (_side(motion), np.abs(_side(motion))),
    "sided damping": lambda motion: (np.abs(motion.speed),),
    "drag": lambda motion: (motion.speed * np.abs(motion.speed),),
    "hardening": lambda motion: (motion.place, motion.place**2, motion.place**3),
    "saturating mass": lambda motion: (motion.force * motion.speed**2, motion.speed**3),
    "saturating force": lambda motion: (motion.force**3,),
}


class Beside(NamedTuple):
    """A fit with a curve. rms: of its innovations. force: that is left beside it (N), inf without a
    mass above 0.

    theta: the numbers of the model. moved: by how much the last pass of the smoother moved them.
    """

    rms: float
    force: float
    place: Place
    theta: np.ndarray | float = 0.0
    moved: np.ndarray | float = 0.0


def alone(place: Place, first: int, end: int) -> Beside:
    """The fit of some rows of a log without a curve, from that of all."""
    few = place._replace(log=place.log.part(first, end))
    return _fitted(few._replace(point=least_of(*few, STEPS_WITH_CURVE)))


def with_curve(name: str, place: Place, other_forces: Sequence[np.ndarray] = ()) -> Beside:
    """The fit of a log with a curve, from that without; with forces of other axes in its place, if
    there are some."""
    fit = place
    numbers = []
    # Passes of the smoother: the second with the curve, the third with what it does within a tick.
    for _ in range(3):
        if other_forces:
            ticks = round(fit.search.found(fit.point)["delay"])
            beside = [np.stack([late(force, ticks), 0.0 * force]) for force in other_forces]
        else:
            beside = _held(CURVES[name], fit)
        log = replace(fit.log, beside=tuple(beside))
        fit = fit._replace(log=log)
        fit = fit._replace(point=least_of(*fit, STEPS_WITH_CURVE))
        numbers_of_fit = fit.search.found(fit.point)
        _, errors, effects = errors_of(fit.log, numbers_of_fit, fit.skip)
        gains, _ = projected(errors, effects)
        if not gains[0] > 0:
            return Beside(np.inf, np.inf, place)
        numbers.append(theta_of(fit.log, numbers_of_fit, gains))
    return _fitted(fit)._replace(moved=np.abs(numbers[-1] - numbers[-2]))


def _fitted(fit: Place) -> Beside:
    _, errors, effects = errors_of(fit.log, fit.search.found(fit.point), fit.skip)
    gains, residual = projected(errors, effects)
    if not gains[0] > 0:
        return Beside(float(residual.std()), np.inf, fit)
    theta = theta_of(fit.log, fit.search.found(fit.point), gains)
    return Beside(float(residual.std()), force_beside(*fit), fit, theta)


def forceless(fit: Place) -> float:
    """The rms of the innovations of a fit in which no force acts beside that of the log."""
    few = fit.point.copy()
    for name in ("white", "drift"):
        few[fit.search.names.index(name)] = fit.search.low[fit.search.names.index(name)]
    _, errors, effects = errors_of(fit.log, fit.search.found(few), fit.skip)
    return float(projected(errors, effects)[1].std())


def _held(curve: Curve, fit: Place) -> list[np.ndarray]:
    """The means of each force of a curve over the ticks, of the motion of a fit, as smoothed."""
    log, search, point, skip = fit
    numbers = search.found(point)
    predictor, errors, effects = errors_of(log, numbers, skip)
    gains, _ = projected(errors, effects)
    states = smoothed_states(log, predictor, numbers, gains, skip)
    speed = states[predictor.tick.speed]
    # Without a position among the states, by trapezoids: half a tick late a spring would be a
    # damper.
    place = states[0] if predictor.tick.speed else np.cumsum(speed) - speed / 2
    return means_over_ticks(curve, log, numbers, gains, speed, place - place.mean())


def means_over_ticks(
    curve: Curve,
    log: ScaledLog,
    numbers: Mapping[str, float],
    gains: np.ndarray,
    speed: np.ndarray,
    place: np.ndarray,
) -> list[np.ndarray]:
    """The means of each force of a curve over the ticks, see `ScaledLog.side`, from velocities and
    positions at the rows (Simpson's rule in each part of a tick).

    gains: the last of them are those of the curve, if the log has it beside its force.
    """
    sizes = [np.sqrt(np.mean(column**2)) + NEXT_TO_ZERO for column in (speed, place, log.force)]

    def motion(speed, place, force):
        return Motion(speed / sizes[0], place / sizes[1], force / sizes[2])

    whole_ticks = int(np.floor(numbers["delay"]))
    now = late(log.force, whole_ticks)
    before = late(log.force, whole_ticks + 1)
    turned = slope = 0.0
    if log.beside:
        then = np.append(speed[1:], speed[-1])
        begun = np.stack(curve(motion(speed, place, now)))
        ended = np.stack(curve(motion(then, place, now)))
        turned = gains[-len(begun) :] @ (ended - begun)
        # Between velocities of one sign a curve is a line.
        one_sign = (speed * then > 0) & (speed != then)
        slope = np.where(one_sign, -turned / np.where(one_sign, then - speed, 1.0), 0.0)
        slope = np.clip(slope, -STEEPEST, STEEPEST)
    path = path_within_ticks(log, numbers, gains, speed, turned, slope)
    means = []
    changes = []
    for length, force, first, middle, last in zip(
        path.lengths,
        (before, before, now, now),
        path.speeds[:-1],
        path.middles,
        path.speeds[1:],
        strict=True,
    ):
        # Integrals of the parabola through the three velocities.
        middle_place = place + length * (5 * first + 8 * middle - last) / 24
        there = place + length * (first + 4 * middle + last) / 6
        begun = np.stack(curve(motion(first, place, force)))
        halfway = np.stack(curve(motion(middle, middle_place, force)))
        ended = np.stack(curve(motion(last, there, force)))
        means.append((begun + 4 * halfway + ended) / 6)
        changes.append(ended - begun)
        place = there
    over_parts = zip(np.stack(means, axis=1), np.stack(changes, axis=1), strict=True)
    return [path.over_tick(*parts) for parts in over_parts]
