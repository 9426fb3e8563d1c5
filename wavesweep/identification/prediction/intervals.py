"""The numbers that a search found, with their intervals of 95 %."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import stdtrit

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import UsageError
from wavesweep.identification.model import ORDER, OWN, Model
from wavesweep.identification.prediction.innovations import errors_of, projected, theta_of
from wavesweep.identification.prediction.search import NO_MASS, Place
from wavesweep.identification.prediction.smoother import CHANGED, CHANGED_OF_TWO, force_beside

DIFFERENCE = 1e-3  # of the size of a number, of central differences
BLOCKS = (10, 20)
LARGE_INNOVATION = 3.0  # standard deviations beyond which an innovation is large
NORMAL = 1.96  # standard deviations of 95 %


class StaticFriction(NamedTuple):
    """The friction at rest (N), which falls to that of the model as exp(-(v/speed)^2); speed:
    that of Stribeck (m/s)."""

    force: float
    speed: float


@dataclass(frozen=True, eq=False)
class Prediction:
    """The numbers `theta` of `model.names`, none of the log alone, and half the widths of their
    intervals.

    left: innovations, in the unit of the reading, from row `skip` on; used: false for those of
    outliers. noise: of the reading alone. walked: the rms of the force that is not in the log (N),
    from a smoother. correlation: of neighbouring innovations. searched: the numbers of the search
    by their names. static: None if friction is a line. place: where the search ended.
    """

    model: Model
    theta: np.ndarray
    half: np.ndarray
    left: np.ndarray
    used: np.ndarray
    skip: int
    noise: float
    walked: float
    correlation: float
    searched: Mapping[str, float]
    static: StaticFriction | None
    place: "Place"

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by their names."""
        return self.model.numbers(self.theta)


def estimated_at(log, search, point, skip, before, moved):
    """The numbers with their intervals."""
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, innovations = projected(errors, effects)
    if not gains[0] > 0:
        raise UsageError(NO_MASS)
    theta = theta_of(log, search.found(point), gains)
    if before is not None:
        moved = np.maximum(moved, np.abs(theta - before))
    count = len(gains)
    slopes = _slopes(log, search, point, gains, skip)
    to_theta = _differences(
        lambda both: theta_of(log, search.found(both[count:]), both[:count]),
        np.append(gains, point),
        np.append(1e-3 * np.abs(gains) + NEXT_TO_ZERO, DIFFERENCE * search.size),
    )
    half = _half_widths(innovations, slopes, to_theta)
    robust = _of_large(innovations, slopes, to_theta)
    few = log.part(0, CHANGED_OF_TWO if log.model.load else CHANGED)
    free = [
        index
        for index in range(slopes.shape[1])
        if index < count or search.names[index - count] not in ("white", "drift")
    ]
    step = _step(few, search, point, skip, free)
    extra = np.zeros(len(theta))
    # Decades by which the variances are changed.
    for decades in (
        ((2, 0), (-2, 0), (0, 3), (0, -3), (2, 3), (-2, -3)) if "white" in search.names else ()
    ):
        neighbour = point.copy()
        neighbour[search.names.index("white")] += decades[0]
        neighbour[search.names.index("drift")] += decades[1]
        if (neighbour < search.low).any() or (neighbour > search.high).any():
            continue
        with np.errstate(all="ignore"):
            _, errors, effects = errors_of(few, search.found(neighbour), skip)
            changed_gains, changed = projected(errors, effects)
            if not (changed_gains[0] > 0 and np.isfinite(changed).all()):
                continue
            changed_slopes = _slopes(few, search, neighbour, changed_gains, skip)
            noise = _half_widths(changed, changed_slopes, to_theta)
            shift = _step(few, search, neighbour, skip, free) - step
        extra = np.maximum(extra, np.abs(to_theta[:, free] @ shift) - noise)
    # How fast the walk is decides how much of a damping a log shows, and not which one.
    extra[1] = 0.0
    extra[len(extra) - log.coupled + 1 :: 2] = 0.0
    predictor = errors_of(log, search.found(point), skip)[0]
    names = tuple(name for name in log.model.names if name in OWN)
    spread = float(innovations.std())
    return Prediction(
        replace(log.model, without=names),
        theta,
        half + extra + moved + robust,
        innovations * log.unit,
        np.ones(len(innovations), bool),
        skip,
        log.unit * spread / np.sqrt(predictor.spread),
        force_beside(log, search, point, skip),
        float(innovations[1:] @ innovations[:-1] / (innovations @ innovations)),
        search.found(point),
        _static(log, search.found(point), gains),
        Place(log, search, point, skip),
    )


def _static(log, numbers, gains):
    """The static friction and the speed at which it fades; None for a line."""
    if "fading" not in numbers:
        return None
    rest = float((gains[1] + gains[2]) / gains[0]) * log.pushed
    speed = numbers["fading"] * log.unit * log.period ** (ORDER[log.model.measured] - 1)
    return StaticFriction(rest, speed)


def _step(log, search, point, skip, free):
    """Gains and numbers of one step of Gauss and Newton from a point with its variances held,
    `(free,)`."""
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, innovations = projected(errors, effects)
    slopes = _slopes(log, search, point, gains, skip)[:, free]
    size = np.maximum(np.linalg.norm(slopes, axis=0), NEXT_TO_ZERO)
    step = -np.linalg.lstsq(slopes / size, innovations, rcond=1e-10)[0] / size
    step[: len(gains)] += gains
    return step


def _slopes(log, search, point, gains, skip):
    """Derivatives of the innovations with respect to gains and numbers, `(rows, gains +
    numbers)`."""

    def left(at):
        _, errors, effects = errors_of(log, search.found(at), skip)
        return errors - gains @ effects

    _, _, effects = errors_of(log, search.found(point), skip)
    return np.hstack([-effects.T, _differences(left, point, DIFFERENCE * search.size)])


def _differences(function, point, steps):
    """Central differences of a function, `(values, numbers)`."""
    slopes = []
    for index, size in enumerate(steps):
        step = np.zeros(len(point))
        step[index] = size
        slopes.append((function(point + step) - function(point - step)) / (2 * size))
    return np.stack(slopes, axis=1)


def _of_large(innovations, slopes, to_theta):
    """By how much large innovations move the numbers: a step of Gauss and Newton to those of which
    no innovation counts for more than `LARGE_INNOVATION` standard deviations (Huber 1981).

    Ticks in which friction holds the device for a moment leave such innovations, and they do not
    have a mean of 0. With the slopes J, `(rows, numbers)`, J' e = 0 at the numbers found, so that
    the step, -J^+ clip(e), is J^+ (e - clip(e)). to_theta: `(theta, numbers)`.
    """
    deviation = np.median(np.abs(innovations)) / 0.6745  # of normal ones
    bound = LARGE_INNOVATION * deviation
    beyond = innovations - np.clip(innovations, -bound, bound)
    size = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    step = np.linalg.lstsq(slopes / size, beyond, rcond=1e-10)[0]
    return np.abs(to_theta @ (step / size))


def _half_widths(innovations, slopes, to_theta):
    """Half the widths of the intervals: the widest of those of white innovations and of blocks
    of scores."""
    size = np.maximum(np.linalg.norm(slopes, axis=0), NEXT_TO_ZERO)
    unit = slopes / size
    inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-12)
    # Standard deviations at which an innovation is clipped in the scores.
    bound = 5.0 * np.median(np.abs(innovations)) / 0.6745
    clipped = np.clip(innovations, -bound, bound)
    onto = to_theta / size
    squares = [NORMAL**2 * np.var(clipped) * np.diag(onto @ inverse @ onto.T)]
    for blocks in BLOCKS:
        parts = np.array_split(np.arange(len(innovations)), blocks)
        scores = np.stack([unit[part].T @ clipped[part] for part in parts])
        scores = scores - scores.mean(axis=0)
        spread = inverse @ (scores.T @ scores) @ inverse * blocks / (blocks - 1)
        squares.append(stdtrit(blocks - 1, 0.975) ** 2 * np.diag(onto @ spread @ onto.T))
    return np.sqrt(np.max(squares, axis=0))
