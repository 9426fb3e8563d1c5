"""The fit of a device by the errors of predictions, for logs of forces that are not all known.

A friction curve, a drifting offset or a cable moves a device by little within a tick, and by much
within a second. So each reading is predicted from those before it, by a Kalman filter that also
follows a force that walks at random, and the numbers are those with the least sum of squares of the
innovations (Ljung, System Identification, 1999, sections 3.3 and 7.2). One over the mass and the
friction are linear in the innovations, and follow for each choice of the other numbers (variable
projection, Golub and Pereyra 1973); so does the state at the first row. The variances of the
forces, relative to that of the reading, are fitted as well.

Friction is `F tanh(v/v_t)`, averaged over the tick, with the velocity from a smoother. If the log
shows that it falls with speed, `(F_s - F) exp(-(v/v_s)^2)` is added to F (Armstrong-Helouvry,
Dupont and Canudas de Wit 1994). Nothing pushes a device that rests.

An interval is the widest of those of white innovations and of sums of scores over 10 and over 20
blocks of rows, wider by what other variances, the last round of the smoother and, in mass and
delay, a curve in place of a line change.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.identification.model import ORDER, OWN, Model, late, of_modes, resonance
from wavesweep.identification.prediction.innovations import errors_of, mean_square, projected
from wavesweep.identification.prediction.intervals import Prediction, estimated_at
from wavesweep.identification.prediction.scaled_log import ScaledLog, scaled, spikes
from wavesweep.identification.prediction.search import (
    MOST,
    RATES,
    SPARE_ROWS,
    Search,
    begun_at,
    least_of,
)
from wavesweep.identification.prediction.smoother import (
    LIKELIER,
    Rounds,
    force_beside,
    smoothed,
    with_falling_friction,
)

RESONANCES, RINGING = 150, 0.03  # frequencies of a resonance that are tried, and its damping ratio
# variances, white and of the walk, of the filters through which they are looked for
FILTERS = ((1e-2, 1e-6), (1e-5, 1e-9))
NO_RESONANCE = (
    "no resonance of two masses on a spring shows for certain: record a chirp or noise through the resonance, with more force, "
    "or leave --two-masses out"
)
NO_FRICTION = (
    "expected a friction of at least 0, found {friction:.2g} N at most: the force against the motion grows with speed by more "
    "than a line, as a drag does; leave --friction out"
)


def _strongest_part(log: ScaledLog, rows: int) -> ScaledLog:
    """So many rows with the largest forces, from which a long log's numbers are found first."""
    if len(log.force) <= rows:
        return log
    sizes = log.force[: len(log.force) // rows * rows].reshape(-1, rows).std(axis=1)
    first = rows * int(np.argmax(sizes))
    return log.part(first, first + rows)


def predicted(
    model: Model,
    force: np.ndarray,
    reading: np.ndarray,
    period: float,
    resolution: float,
    coupled: Sequence[np.ndarray] = (),
) -> Prediction:
    """Fit a model to a log by the errors of its predictions.

    force: N, held over each tick. reading: m, m/s or m/s^2. period: s. resolution: step of the
    readings, 0 for none. coupled: what else resists as well, each with a number that is the last of
    theta, as means over each tick, see `ScaledLog.side`.

    Errors: UsageError if the force does not show in the readings.
    """
    wild = spikes(reading, resolution)
    between = np.interp(np.arange(len(reading)), np.flatnonzero(~wild), reading[~wild])
    whole = scaled(model, force, between, period, resolution)
    beside = tuple(-each / whole.pushed for each in coupled)
    whole = replace(whole, beside=beside, coupled=len(beside))
    log = _strongest_part(whole, 3000 if model.load else 6000)  # half as many of two masses
    search, point, skip = _near(log, whole)
    if log is not whole:
        point = least_of(whole, search, point, skip, 5)
    rounds = Rounds(whole, point)
    if model.friction:
        rounds = smoothed(rounds, search, skip)
        curved = None if coupled else with_falling_friction(rounds.log, search, rounds.point, skip)
        if curved is not None:
            line = rounds.before
            search, point = curved
            rounds = smoothed(Rounds(rounds.log, point), search, skip)
            # What the form of friction does to mass and delay shows how well it tells them.
            of_form = [name in ("log_mass", "delay") for name in model.names if name not in OWN]
            moved = np.maximum(rounds.moved, of_form * np.abs(rounds.before - line))
            rounds = rounds._replace(moved=moved)
    estimate = estimated_at(rounds.log, search, rounds.point, skip, rounds.before, rounds.moved)
    return replace(estimate, used=~wild[skip:])


def refuse_friction_below_zero(prediction: Prediction) -> None:
    """Raise UsageError if a fit has a friction below 0."""
    if not prediction.model.friction:
        return
    index = prediction.model.names.index("friction")
    highest = float(prediction.theta[index] + prediction.half[index])
    if highest < 0:
        raise UsageError(NO_FRICTION.format(friction=highest))


class Innovations(NamedTuple):
    """rms: of the innovations of a model, in the unit of the reading. walked: of the force that is
    not in the log (N).

    tone_hz: of the resonance of two masses.
    """

    rms: float
    walked: float
    tone_hz: float


def innovations_of(
    model: Model,
    near: Mapping[str, float],
    force: np.ndarray,
    reading: np.ndarray,
    period: float,
    resolution: float,
) -> Innovations:
    """The innovations of a model that is fitted to a log; infinite if it does not fit.

    near: `Prediction.searched` of the same model, or of one that lacks an effect.
    """
    log = scaled(model, force, reading, period, resolution)
    try:
        search, point, skip = _near(log, log, near)
    except UsageError:
        return Innovations(np.inf, np.inf, float("nan"))
    numbers = search.found(point)
    _, errors, effects = errors_of(log, numbers, skip)
    gains, innovations = projected(errors, effects)
    if model.friction and gains[1] < 0:  # a drag, which no friction explains
        return Innovations(np.inf, np.inf, float("nan"))
    tone_hz = float("nan")
    if model.load:
        tone_hz = float(np.sqrt(numbers["square"] * (1 + 1 / numbers["share"]))) / (2 * np.pi)
    return Innovations(
        float(innovations.std()) * log.unit, force_beside(log, search, point, skip), tone_hz
    )


def _near(log, whole, near=None):
    """The search, its best point for `log`, a part of the whole log, and the rows that are left
    out.

    near: numbers of a smaller model to begin with. A load on a spring is looked for from each
    frequency at which the log resonates after a fit without it. It is taken if the logarithm of the
    likelihood, `-n/2 log(mean square)` of n readings, grows by more than LIKELIER.
    Errors: UsageError if it does not.
    """
    if not log.model.load:
        begun = begun_at(log, near)
        skip = int(max(begun["delay"], 0.0)) + SPARE_ROWS
        search = Search(whole, begun)
        return search, least_of(log, search, search.begun, skip, 20), skip
    alone = replace(log, model=replace(log.model, load=False))
    begun = begun_at(alone, near)
    search = Search(alone, begun)
    skip = int(max(begun["delay"], 0.0)) + SPARE_ROWS
    point = least_of(alone, search, search.begun, skip, 20)
    without = mean_square(alone, search, point, skip)
    skip = int(MOST) // 2 + SPARE_ROWS
    tried = []
    for begun in _resonances(alone, search.found(point), skip):
        search = Search(whole, begun)
        point = least_of(log, search, search.begun, skip, 10)
        tried.append((mean_square(log, search, point, skip), search, point))
    if not tried:
        raise UsageError(NO_RESONANCE)
    _, search, point = min(tried, key=itemgetter(0))
    point = least_of(log, search, point, skip, 30)
    square = mean_square(log, search, point, skip)
    if not square < without * np.exp(-2 * LIKELIER / len(log.reading)):
        raise UsageError(NO_RESONANCE)
    return search, point, skip


def _resonances(log, found, skip):
    """Two masses, by the resonances that explain most beside one mass, apart from each other.

    found: the numbers of one mass.
    """
    model = log.model
    period = log.period
    tones = np.geomspace(3 / (len(log.reading) * period), 0.4 / period, RESONANCES)
    unit = period ** (2 - ORDER[model.measured])
    pushing = log.force - log.force[0]  # a constant force does not move the resonance
    modes = [
        resonance(pushing, tone, RINGING, period, 0.0, model.measured) / unit for tone in tones
    ]
    delays = (0.0, 2.0, 5.0) if model.delay is None else (model.delay,)  # ticks, tried with them
    # The rate of one mass is not that of two where a resonance is damped, and is nearly where it rings.
    places = [found]
    for delay in delays:
        places.append(found | {"rate": RATES[0], "delay": delay})
    pairs = []
    for place, (white, drift) in product(places, FILTERS):
        filtered = place | {"white": white, "drift": drift}
        predictor, errors, effects = errors_of(log, filtered, skip)
        alone = projected(errors, effects)[1]
        whole_ticks = round(place["delay"])
        for tone, mode in zip(tones, modes, strict=True):
            both = np.stack([effects[0], predictor.innovations(late(mode, whole_ticks), skip)])
            gains, innovations = projected(errors, both)
            if (gains > 0).all():
                share = float(innovations @ innovations) / float(alone @ alone)
                pairs.append((share, tone, gains[1] / gains[0], filtered))
    starts = []
    for _, tone, share, filtered in sorted(pairs, key=itemgetter(0)):
        # Two resonances from which two masses are searched, whose logarithms are so far apart.
        if len(starts) < 2 and all(abs(np.log(tone / near)) > 0.3 for near, _ in starts):
            numbers = of_modes(1.0 + share, filtered["rate"], tone, RINGING, share)
            shape = {"share": share, "load_rate": filtered["rate"]}
            shape["square"] = np.exp(numbers["log_coupling"])
            starts.append((tone, filtered | shape | {"coupling_rate": numbers["coupling_damping"]}))
    return [begun for _, begun in starts]
