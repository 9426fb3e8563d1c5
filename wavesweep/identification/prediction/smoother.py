"""The motion of a device as a smoother has it, of all readings: velocities within ticks, along
which friction acts, and the force that the log does not have."""

from dataclasses import replace
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from wavesweep.identification.model import late
from wavesweep.identification.prediction.innovations import (
    errors_of,
    mean_square,
    projected,
    pushes_of,
    theta_of,
)
from wavesweep.identification.prediction.scaled_log import Path, ScaledLog, a_tick_later
from wavesweep.identification.prediction.search import FIT_LOGGER, TURNING_TRIED, Search, least_of

SMOOTHER_PASSES = 6  # at most
CHANGED, CHANGED_OF_TWO = 20_000, 6_000  # rows at most, with which they are changed; of two masses
# logarithm of the odds by which two masses have to explain the innovations better than one, a model
# with one more effect better than without, and a round of the smoother better than the one before
LIKELIER = 15.0


class Rounds(NamedTuple):
    """A log with the velocities of the smoother, the point of a search, and by how much the last
    round moved the numbers."""

    log: ScaledLog
    point: np.ndarray
    before: np.ndarray | None = None
    moved: np.ndarray | float = 0.0


def _start(log, search, point: np.ndarray, skip: int) -> np.ndarray:
    """The point of a search, or the same with another speed at which friction turns round, from which
    the mean square is least: from far above that speed a search does not get there."""
    turning = search.names.index("turning")
    tried = [point]
    for ratio in TURNING_TRIED:
        other = point.copy()
        other[turning] = np.log(ratio * log.slowest)
        tried.append(other)
    return min(tried, key=lambda start: mean_square(log, search, start, skip))


def smoothed(rounds, search, skip):
    """Rounds of a smoother that gives the velocity, and of a search with the friction at this
    velocity."""
    log, point, before, moved = rounds
    still = log.moving == 0.0
    square = np.inf
    passed = log, point
    for number in range(1, 1 + SMOOTHER_PASSES):
        said = "friction along the motion, round %d of at most %d"
        FIT_LOGGER.info(said, number, SMOOTHER_PASSES)
        predictor, errors, effects = errors_of(log, search.found(point), skip)
        gains, innovations = projected(errors, effects)
        if not gains[0] > 0:
            break
        now = theta_of(log, search.found(point), gains)
        if before is not None:
            moved = np.abs(now - before)
        before = now
        previous = square
        square = float(np.mean(innovations**2))
        likelier = len(innovations) / 2 * np.log(previous / square)
        if number > 2 and likelier < LIKELIER:  # passes of the smoother, at least
            if square > previous:
                log, point = passed
            break
        passed = log, point
        smoothed_fit = search.found(point)
        states = smoothed_states(log, predictor, smoothed_fit, gains, skip)
        speeds = states[predictor.tick.speed]
        if not np.corrcoef(speeds, log.speeds)[0, 1] > 0.5:
            break
        # No device rests under a force above its friction, though its encoder may stand still.
        pushing = np.abs(_forces(log, smoothed_fit, gains, states[-1])).max(axis=0)
        held = pushing <= _rest(smoothed_fit, gains)
        log = replace(log, moving=np.where(still & held, 0.0, 1.0))
        path = path_within_ticks(log, smoothed_fit, gains, speeds, walk=states[-1])
        log = replace(log, speeds=speeds, path=path)
        point = least_of(log, search, _start(log, search, point, skip), skip, 8)
    return Rounds(log, point, before, moved)


def with_falling_friction(log, search, point, skip):
    """A search with friction that falls with speed (Stribeck), and its point; None if it does
    not explain the log better."""
    log = log.part(0, CHANGED)  # so many rows show it
    without = mean_square(log, search, point, skip)
    if not np.isfinite(without):
        return None
    begun = search.found(point)
    tried = []
    # Speeds at which static friction fades, over the usual one, tried first.
    for share in (0.1, 0.3, 1.0):
        curved = Search(log, begun | {"fading": share * float(log.speeds.std())})
        tried.append((mean_square(log, curved, curved.begun, skip), curved))
    _, curved = min(tried, key=itemgetter(0))
    point = least_of(log, curved, curved.begun, skip, 8)
    _, errors, effects = errors_of(log, curved.found(point), skip)
    _, sliding, fades = projected(errors, effects)[0]
    falls = sliding > 0 and fades > 0.1 * sliding  # it has to fall with speed by a tenth
    enough = mean_square(log, curved, point, skip) < without * np.exp(
        -2 * LIKELIER / len(log.reading)
    )
    if falls and enough:
        return (curved, point)
    return None


def smoothed_states(log, predictor, numbers, gains, skip):
    """The states at each row, from all readings."""
    push = np.zeros((len(predictor.M), len(log.reading)))
    for gain, parts in zip(gains, pushes_of(log, numbers, predictor.tick), strict=True):
        for effect, force in parts:
            push += gain * np.outer(effect, force)
    return predictor.smoothed(log.reading, push, skip)


def path_within_ticks(log, numbers, gains, speeds, turned=0.0, slope=0.0, walk=0.0) -> Path:
    """The velocity within each tick between those at its ends, v_0 and v_1.

    With D = n + p the force of the log is that of the tick before for p of a tick, and v' is by
    J = g (f[k-n] - f[k-n-1]) another one from there on; by H, what friction changes, from the
    moment r before p at which the device turns round on, and by I from the moment s after p on.
    Damping and the slope of a drag take d v' from v' in a tick, so that an acceleration of 1 at
    first moves the velocity by q(t) = (1 - exp(-d t))/d after t. So with c at first

        v_1 = v_0 + c q(1) + H q(1 - r) + J q(1 - p) + I q(1 - s),
        v(r) = v_0 + c q(r) = 0,
        v(s) = v(p) + (c + H + J) q(s - p) = 0.

    A force that turns round between two moments at which the device does leaves it the sign that
    it had. On straight lines in place of these the moments are off, by more the stronger the force
    is: delay and mass are then by a share of friction over force another one. And a drag of the
    usual size would be by 1/12 of d another one. turned: what other curves change over a tick;
    slope: of a drag, over the mass, per tick.
    """
    decay = numbers["rate"] * log.period + np.zeros(len(speeds)) + slope

    def moved(time):
        return time * (1 - decay * time / 2 + (decay * time) ** 2 / 6)

    def rubbed(speeds):
        if not log.model.friction:
            return 0.0 * speeds
        fading = (
            gains[2] * np.exp(-((speeds / numbers["fading"]) ** 2)) if "fading" in numbers else 0.0
        )
        return (gains[1] + fading) * np.tanh(speeds / numbers["turning"])

    whole_ticks = int(np.floor(numbers["delay"]))
    part = numbers["delay"] - whole_ticks
    jump = gains[0] * (late(log.force, whole_ticks) - late(log.force, whole_ticks + 1)) * log.moving
    then = a_tick_later(speeds)
    once = speeds * then < 0
    begun = then - speeds - moved(1 - part) * jump
    around = rubbed(speeds) - rubbed(then) + turned
    to_other = np.where(once, around, 2 * rubbed(speeds))
    from_other = np.where(once, around, -2 * rubbed(then))
    before = after = np.full(len(speeds), part)
    change_before = change_after = np.zeros(len(speeds))
    for _ in range(12):  # for the moment in a tick at which a device turns round
        turning = change_before * moved(1 - before) + change_after * moved(1 - after)
        first = (begun - turning) / moved(1.0)
        at_jump = speeds + moved(part) * first
        turns_before = speeds * at_jump < 0
        turns_after = at_jump * then < 0
        change_before = np.where(turns_before, to_other, 0.0)
        change_after = np.where(turns_after, from_other, 0.0)
        there = at_jump + change_before * moved(part - before)
        with np.errstate(all="ignore"):
            early = np.clip(-speeds / first, 0.0, part)
            late_on = np.clip(part - there / (first + change_before + jump), part, 1.0)
        before = np.where(turns_before, early, part)
        after = np.where(turns_after, late_on, part)
    durations = [before, part - before, after - part, 1 - after]
    at_first = np.where(turns_before, 0.0, there)
    at_second = np.where(turns_after, 0.0, there)
    velocities = [speeds, at_first, there, at_second, then]
    not_known = np.full((4, len(speeds)), np.nan)
    path = Path(np.stack(durations), np.stack(velocities), decay, not_known)
    if log.model.friction:
        _stop(path, part, _forces(log, numbers, gains, walk), _rest(numbers, gains))
    return path


def _forces(log, numbers, gains, walk):
    """The forces before that of the log changes in a tick and after it, `(2, rows)`."""
    whole_ticks = int(np.floor(numbers["delay"]))
    return np.stack([gains[0] * late(log.force, whole_ticks + tick) + walk for tick in (1, 0)])


def _rest(numbers, gains):
    """The friction at rest."""
    return float(np.sum(gains[1 : 3 if "fading" in numbers else 2]))


def _stop(path, part, forces, friction):
    """Have the path rest where friction stops the device and is larger than the force.

    forces: before the force of the log changes and after it.
    """
    speeds = path.speeds[0]
    early, after = forces
    way = np.sign(speeds)
    slowing = friction - way * early
    halts = np.abs(speeds) < slowing * part
    stops_early = halts & (np.abs(early) < friction)
    there = speeds + (early - way * friction - path.decay * speeds) * part
    with np.errstate(all="ignore"):
        first = np.where(halts, np.abs(speeds) / slowing, part)
    there = np.where(halts, (early + way * friction) * (part - first), there)
    there = np.where(stops_early, 0.0, there)
    slowing_after = friction - np.sign(there) * after
    stops_after = (np.abs(after) < friction) & (np.abs(there) < slowing_after * (1 - part))
    with np.errstate(all="ignore"):
        second = np.where(stops_early, 0.0, np.abs(there) / slowing_after)
    # A device that rests all of a tick is left out as a whole, see `ScaledLog`.
    # Of a tick: below this a device rests in all of it.
    moves = np.where(stops_early, first, part + second) > 0.05
    rests = (stops_early | stops_after) & (moves | ~stops_after)
    stops_early &= rests
    stops_after &= rests
    path.held[1, stops_early] = (early / friction)[stops_early]
    path.lengths[:, rests] = np.stack([first, part - first, second, 1 - part - second])[:, rests]
    path.speeds[1, rests] = np.where(halts, 0.0, there)[rests]
    path.speeds[2, rests] = there[rests]
    path.speeds[3, rests] = 0.0
    path.speeds[4, stops_after] = 0.0
    path.held[3, stops_after] = (after / friction)[stops_after]


def force_beside(log, search, point, skip):
    """The rms of the force that is not in the log (N): of the walk, from a smoother, and of the
    white one."""
    numbers = search.found(point)
    predictor, errors, effects = errors_of(log, numbers, skip)
    gains, innovations = projected(errors, effects)
    walk = float(smoothed_states(log, predictor, numbers, gains, skip)[-1].std())
    white = float(innovations.std()) * np.sqrt(numbers["white"] / predictor.spread)
    return float(np.hypot(walk, white)) / abs(gains[0]) * log.pushed
