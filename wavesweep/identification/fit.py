"""The fit of a model to a log: by the errors of predictions and, where nothing but the encoder
errs, by its rounding as well.

The fit by predictions (`prediction`) allows for forces that the log does not have. If the log shows
none, the likelihood of rounded readings over the whole log tells the numbers much better: least
squares, outliers, and then the likelihood, from the row on at which the force before the first one
no longer matters, at a free position and velocity.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.identification.estimates import Estimate, estimated
from wavesweep.identification.model import (
    DIFFERENCE_STEP,
    ORDER,
    OWN,
    Model,
    euler,
    measured,
    readings,
    sensitivities,
)
from wavesweep.identification.prediction.fitting import predicted
from wavesweep.identification.prediction.intervals import Prediction, StaticFriction
from wavesweep.identification.prediction.scaled_log import ONE_WAY, OUTLIER_SHARE

FIRST_ROWS = 5  # rows from which the initial velocity is guessed
FITTING_ROUNDS = 3  # of least squares without outliers, and of the likelihood about new numbers
SLOW_TURN = 0.005  # of the usual velocity, at which friction turns round to see what this changes


@dataclass(frozen=True, eq=False)
class LogRows:
    """A log as it is fitted: force (N), held over each tick, and what was read, both of all rows;
    period (s).

    resolution: step of the readings, 0 for none. skip: rows at the start that are left out; used:
    false for outliers among the others, `(ticks - skip,)`.
    """

    force: np.ndarray
    reading: np.ndarray
    period: float
    resolution: float = 0.0
    skip: int = 0
    used: np.ndarray | float = 1.0

    def residual(self, model: Model, theta: np.ndarray) -> np.ndarray:
        """Reading minus that of the model, 0 for an outlier."""
        fitted_readings = readings(model, theta, self.force, self.period, self.skip)
        return (self.reading[self.skip :] - fitted_readings) * self.used

    def slopes(self, model: Model, theta: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Derivatives of the model's readings with respect to its numbers, 0 for an outlier."""
        slopes = sensitivities(model, theta, self.force, self.period, steps, self.skip)
        return slopes * np.broadcast_to(self.used, len(slopes))[:, None]


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit.

    theta: the numbers of `model.names`, and half the widths of their intervals. readings, residual:
    of all rows, not a number in the first ones. noise: white noise of the readings in addition to
    their rounding. estimate: the likelihood about theta; None of a fit by predictions, whose
    readings are predicted from one row to the next. walked: rms of the force that these found
    beside that of the log (N). static: friction at rest, where these found that it falls with
    speed. extra: by how much wider the intervals are than those of a model that explains the log.
    """

    model: Model
    theta: np.ndarray
    half: np.ndarray
    rows: LogRows
    readings: np.ndarray
    residual: np.ndarray
    noise: float
    estimate: Estimate | None = None
    walked: float = 0.0
    static: StaticFriction | None = None
    extra: np.ndarray | float = 0.0

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by their names."""
        return self.model.numbers(self.theta)


def by_prediction(
    prediction: Prediction, force: np.ndarray, reading: np.ndarray, period: float, resolution: float
) -> Fit:
    """The fit by the errors of predictions."""
    residual = np.append(np.full(prediction.skip, np.nan), prediction.left)
    rows = LogRows(force, reading, period, resolution, prediction.skip, prediction.used)
    return Fit(
        model=prediction.model,
        theta=prediction.theta,
        half=prediction.half,
        rows=rows,
        readings=reading - residual,  # as predicted from one row to the next
        residual=residual,
        noise=prediction.noise,
        walked=prediction.walked,
        static=prediction.static,
    )


def _without_turn(end: "_Secants", numbers: int) -> tuple[np.ndarray, np.ndarray]:
    """What the turn changes in the readings, `(rows,)`, and half the widths of the intervals of the
    numbers, `(numbers,)`, with what these would move by if that were left out, to first order."""
    turned = end.slopes[:, numbers:] @ end.estimates.step[numbers:]
    J = end.slopes[:, :numbers]
    size = np.linalg.norm(J, axis=0)
    moved = np.abs(np.linalg.lstsq(J / size, turned, rcond=1e-12)[0] / size)
    return turned, end.estimates.half[:numbers] + moved


def fitted(
    model: Model,
    force: np.ndarray,
    reading: np.ndarray,
    period: float,
    resolution: float,
    prediction: Prediction | None = None,
) -> Fit | None:
    """Fit a model to a log by the likelihood of rounded readings; None if the errors grow over the log as
    those of no encoder do.

    force: N, held over each tick. reading: what the model says is measured (m, m/s or m/s^2). period:
    s. resolution: step of the readings. prediction: the fit by predictions, if there is one.
    """
    rows = LogRows(force, reading, period, resolution)
    begun = replace(model, without=_hidden(model, reading, moves(model, reading)))
    prediction = prediction or predicted(model, force, reading, period, resolution)
    theta, rows = _from_prediction(begun, prediction, rows)
    if not _encoder_alone(begun, theta, rows, prediction.noise):
        return None
    model, theta, rows = _later(begun, theta, rows)
    for _ in range(FITTING_ROUNDS):
        used = _inliers(model, theta, rows)
        if np.array_equal(used, rows.used):
            break
        rows = replace(rows, used=used)
        theta = refined(model, theta, rows)
    end = _by_secants(model, theta, rows)
    if end is None:
        return None
    # The model takes the size of friction.
    theta = np.where(np.array(model.names) == "friction", np.abs(end.theta), end.theta)
    turned, half = _without_turn(end, len(theta))
    places = readings(model, theta, force, period, rows.skip) + turned
    places = np.append(np.full(rows.skip, np.nan), places)
    return Fit(
        model, theta, half, rows, places, reading - places, end.estimates.noise, end.estimates
    )


class _Secants(NamedTuple):
    """The end of a fit by secants: the numbers; the slopes of the readings in these and in the slow
    speeds of `_slower_turn`, `(rows, numbers + speeds)`; and what follows from them for both."""

    theta: np.ndarray
    slopes: np.ndarray
    estimates: Estimate


def _by_secants(model: Model, theta: np.ndarray, rows: LogRows) -> _Secants | None:
    """Gauss-Newton steps with secants over an interval; None if they lead nowhere.

    Narrower secants may be those of one event, a stop or a start, so they come from wider ones.
    """
    # The widest step of a derivative with friction, relative to the scale of the number.
    widest = 0.01 * scales(model, theta, rows)
    steps = widest if model.friction else DIFFERENCE_STEP * scales(model, theta, rows)
    count = len(theta)
    share = 1.0  # of the slow speed, with which the turn is marched
    for _ in range(FITTING_ROUNDS):
        beside = _slower_turn(model, theta, rows, share)
        with np.errstate(all="ignore"):
            J = np.hstack([rows.slopes(model, theta, steps), beside])
            residual = rows.residual(model, theta)
        depend = (np.linalg.norm(J, axis=0) > 0).all()
        if not depend or not np.isfinite([J.sum(), residual.sum()]).all():
            return None
        estimates = estimated(J, residual, rows.resolution)
        half = estimates.half[:count]
        theta = theta + estimates.step[:count]
        share = float(np.clip(estimates.step[count:].sum(), 0.1, 10.0))
        delay = np.abs(model.numbers(theta)["delay"])
        if not (np.isfinite(theta).all() and delay < len(rows.force)):
            return None
        steps = np.minimum(half, widest) if model.friction else steps
        # Changes below 0.05 half-widths end the rounds.
        if (np.abs(estimates.step[:count]) < 0.05 * half).all():
            break
    return _Secants(theta, J, estimates)


def _slower_turn(model, theta, rows, share):
    """What friction that turns round at a small speed changes in the readings, and the same if the
    offset is friction that depends on direction: `(rows, 2)`, `(rows, 0)` without friction.

    Friction of a device is F_c tanh(v/v_t): it creeps before it slides. For small v_t this changes
    the readings in proportion to v_t, which damping and friction take up. So v_t is a number of the
    fit like the others. share: v_t to march with, over `SLOW_TURN` of the usual speed.
    """
    none = np.zeros((len(rows.reading) - rows.skip, 0))
    if not model.friction:
        return none
    told = (rows.force, rows.period, rows.skip)
    numbers = model.numbers(theta)
    forms = [{}]
    if 0 < abs(numbers["offset"]) < numbers["friction"]:
        forms.append({"sided": True})
    with np.errstate(all="ignore"):
        at_once = measured(numbers, model.measured, *told)
        turning = share * SLOW_TURN * float(np.std(measured(numbers, "velocity", *told)))
        changed = [
            (measured(numbers | {"turning": turning} | form, model.measured, *told) - at_once)
            * (rows.used / share)
            for form in forms
        ]
    shown = [change for change in changed if np.ptp(change) > 0]
    return np.stack(shown, axis=1) if shown else none


def _from_prediction(model, prediction, rows):
    """Numbers and rows to begin with, from a fit by predictions; the numbers of the log alone
    are guessed."""
    rows = replace(rows, skip=prediction.skip)
    numbers = prediction.numbers
    if model.friction:
        numbers |= _at_first(model, rows)
    else:
        numbers |= _own(model, numbers, rows)
    return np.array([numbers[name] for name in model.names]), rows


def _at_first(model, rows):
    """Position and velocity at the first row of the fit, from the readings there."""
    place = rows.reading[rows.skip :]
    if model.measured == "position":
        return {
            "start": place[0],
            "velocity": (place[FIRST_ROWS] - place[0]) / (FIRST_ROWS * rows.period),
        }
    return {"velocity": float(np.median(place[: FIRST_ROWS + 1])) * (model.measured == "velocity")}


def _encoder_alone(model, theta, rows, noise):
    """Whether the first rows of a log lie about the model, with numbers near these, as closely
    as its readings are known."""
    # At most so many rows are marched with friction, tick by tick; in more of them the predictions
    # know enough.
    if model.friction and len(rows.force) > 10_000:
        return False
    end = rows.skip + 5000  # rows that show whether errors grow
    rows = replace(rows, force=rows.force[:end], reading=rows.reading[:end])
    # where a device stops, it is not linear
    for _ in range(FITTING_ROUNDS if model.friction else 1):
        with np.errstate(all="ignore"):
            residual = rows.residual(model, theta)
            slopes = rows.slopes(model, theta, DIFFERENCE_STEP * scales(model, theta, rows))
        size = np.maximum(np.linalg.norm(slopes, axis=0), NEXT_TO_ZERO)
        if not np.isfinite([residual.sum(), slopes.sum()]).all():
            return False
        step = np.linalg.lstsq(slopes / size, residual, rcond=1e-12)[0] / size
        theta = theta + step
        residual = residual - slopes @ step
        usual = float(np.median(np.abs(residual))) / 0.6745  # a standard deviation of normal noise
        # Beyond 5 times the noise of the readings or their step an error is not
        # that of an encoder; errors of the last digits of the motion are smaller.
        if usual < 5.0 * max(noise, rows.resolution, 1e-7 * float(np.ptp(rows.reading))):
            return True
    return False


def moves(model: Model, readings: np.ndarray) -> np.ndarray:
    """Readings as velocities, up to a factor; without those of an acceleration, which shows
    none."""
    if model.measured == "position":
        return np.diff(readings)
    return readings * (model.measured == "velocity")


def at_an_instant(fit: Fit) -> Fit:
    """The same fit with intervals for a sensor that gives the acceleration at an instant, not its
    mean over the tick before.

    To first order that is the error of Euler's rule in mass and damping, and a part of a tick of
    delay does not show.
    """
    moved = np.zeros(len(fit.theta)) + fit.extra
    moved[:2] += euler(fit.numbers, fit.rows.period)
    moved[[name == "delay" for name in fit.model.names]] += 1.0
    return replace(fit, extra=moved)


def _hidden(model, reading, way):
    """The numbers that friction hides: the speed of a device at rest; a constant force, if the
    device moves one way.

    way: the readings as velocities.
    """
    # Equal readings at the start of a log show a device held by friction.
    at_rest = model.friction and np.ptp(reading[:10]) == 0
    one_way = model.friction and not model.spring and abs(way.sum()) > ONE_WAY * np.abs(way).sum()
    return ("velocity",) * int(at_rest) + ("offset",) * int(one_way)


def _later(model, theta, rows):
    """Model, numbers and rows of the least squares from the first row on that the force before
    the log does not move."""
    last = len(rows.force) // 2
    while True:
        numbers = model.numbers(theta)
        later = 1 + (
            model.measured == "acceleration"
        )  # rows that a force of before the log moves in any case
        skip = int(np.clip(np.ceil(numbers["delay"] + 0.5) + later, 0, last))
        place = rows.reading[skip:]
        direction = moves(model, readings(model, theta, rows.force, rows.period, rows.skip))
        model = replace(model, without=_hidden(model, place, direction))
        rows = replace(rows, skip=skip)
        numbers |= _at_first(model, rows) if model.friction else _own(model, numbers, rows)
        if "offset" in model.without:  # friction has taken it
            numbers["friction"] = abs(
                numbers["friction"] - np.sign(direction.sum()) * numbers["offset"]
            )
        theta = refined(model, np.array([numbers[name] for name in model.names]), rows)
        if model.numbers(theta)["delay"] + later <= skip or skip == last:
            return model, theta, replace(rows, used=np.ones(len(place), bool))


def _own(model, given_numbers, rows):
    """The numbers of the log alone that fit best to given ones of a device without friction."""
    linear_names = [name for name in model.own if name not in model.without]
    A, still = _columns(model, given_numbers, linear_names, rows.force, rows.period, rows.skip)
    size = np.linalg.norm(A, axis=0)
    return dict(
        zip(
            linear_names,
            np.linalg.lstsq(A / size, rows.reading[rows.skip :] - still)[0] / size,
            strict=True,
        )
    )


def _columns(model, given_numbers, linear_names, force, period, skip):
    """What a unit of each number of the log alone adds to the readings, `(rows, own)`, and the
    readings without these."""
    none = np.zeros(len(force))
    still = given_numbers | dict.fromkeys(OWN, 0.0)
    forces = [(none, {name: 1.0}) for name in linear_names] + [(force, {})]
    fitted_columns = [
        measured(still | unit_force, model.measured, push, period, skip)
        for push, unit_force in forces
    ]
    return np.stack(fitted_columns[:-1], axis=1), fitted_columns[-1]


def _inliers(model, theta, rows):
    """Which readings are no outliers, `(ticks - skip,)`, from a linear fit in which distant ones
    count less (Huber)."""
    rows = replace(rows, used=np.ones(len(rows.used)))
    residual = rows.residual(model, theta)
    J = rows.slopes(model, theta, DIFFERENCE_STEP * scales(model, theta, rows))
    basis = np.linalg.qr(J / np.maximum(np.linalg.norm(J, axis=0), NEXT_TO_ZERO))[0]
    off = residual - np.median(residual)
    for _ in range(4 * FITTING_ROUNDS):
        deviation = np.median(np.abs(off)) / 0.6745 + NEXT_TO_ZERO
        # Readings beyond 1.5 standard deviations count less while outliers are searched.
        root = np.sqrt(np.minimum(1.0, 1.5 * deviation / np.maximum(np.abs(off), NEXT_TO_ZERO)))[
            :, None
        ]
        off = residual - basis @ np.linalg.lstsq(root * basis, root[:, 0] * residual)[0]
    # Standard deviations from the median beyond which a reading is an outlier, if it is
    # also two steps off
    used = np.abs(off) <= max(6.0 * deviation, 2 * rows.resolution)
    if np.mean(~used) < OUTLIER_SHARE:
        return used
    return np.ones(len(used), bool)


def scales(model: Model, theta: np.ndarray, rows: LogRows) -> np.ndarray:
    """Changes of the numbers that move the device by about as much as it moves in the log."""
    numbers = model.numbers(theta)
    reach = float(np.ptp(rows.reading))
    rms = float(np.std(rows.force))
    mass = numbers["mass"]
    seconds = rows.period * len(rows.force)
    fast = min(seconds, 0.3) ** (
        ORDER[model.measured] - 1
    )  # s, from what is measured to a velocity
    sizes = {
        "log_mass": 1.0,
        "damping": max(abs(numbers["damping"]), mass / min(seconds, 0.3)),
        "stiffness": max(abs(numbers["stiffness"]), mass * 40.0),
        "friction": max(abs(numbers["friction"]), 0.3 * rms),
        "delay": 1.0,
        "log_load": 1.0,
        "load_damping": max(abs(numbers.get("load_damping", 0.0)), mass / min(seconds, 0.3)),
        "log_coupling": 1.0,
        "coupling_damping": max(
            abs(numbers.get("coupling_damping", 0.0)), mass / min(seconds, 0.3)
        ),
        "twist": reach * fast * min(seconds, 0.3),
        "slip": reach * fast,
        "start": reach,
        "velocity": reach * fast,
        "offset": rms,
        "bias": reach,
    }
    return np.array([sizes[name] for name in model.names])


def refined(model: Model, theta: np.ndarray, rows: LogRows) -> np.ndarray:
    """The numbers of the least squares, from numbers close to them."""
    size = scales(model, theta, rows)
    reach = float(np.ptp(rows.reading))

    def off(part):
        with np.errstate(all="ignore"):
            scaled = -rows.residual(model, theta + (part - 1) * size) / reach
        return np.nan_to_num(np.clip(scaled, -1e6, 1e6), nan=1e6)

    def slopes(part):
        with np.errstate(all="ignore"):
            new_slopes = rows.slopes(model, theta + (part - 1) * size, DIFFERENCE_STEP * size)
        return np.nan_to_num(new_slopes * (size / reach), posinf=1e6, neginf=-1e6)

    # With friction the positions have kinks, so smaller steps mean nothing.
    if model.friction:
        finest = {"xtol": 1e-7, "ftol": 1e-9}
    else:
        finest = {"xtol": 1e-11, "ftol": 1e-14}
    done = least_squares(
        off, np.ones(len(theta)), slopes, x_scale="jac", gtol=None, max_nfev=40, **finest
    )
    return theta + (done.x - 1) * size
