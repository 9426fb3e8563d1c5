"""The innovations of a Kalman filter: what readings differ by from their predictions, and the gains
of forces and friction, in which they are linear."""

from collections.abc import Mapping

import numpy as np

from wavesweep.identification.model import ORDER, OWN, late
from wavesweep.identification.prediction.scaled_log import ScaledLog
from wavesweep.identification.predictor import Predictor, tick_of

# numbers on which the filter depends
FILTERING = ("rate", "square", "share", "load_rate", "coupling_rate", "white", "drift")


def errors_of(log: ScaledLog, numbers: Mapping[str, float], skip: int):
    """The predictor of some numbers, the innovations of the readings alone, and what unit gains add
    to them.

    The last are `(gains, rows)`.
    """

    def filtered():
        tick = tick_of(log.model, numbers, log.period)
        rows = len(log.reading) - skip
        predictor = Predictor(tick, numbers["white"], numbers["drift"], rows, log.one_way)
        return predictor, predictor.innovations(log.reading, skip)

    filter_numbers = tuple(numbers[name] for name in FILTERING if name in numbers)
    predictor, errors = log.remembered((skip, *filter_numbers), filtered)
    effects = [predictor.effect(parts, skip) for parts in pushes_of(log, numbers, predictor.tick)]
    return predictor, errors, np.stack(effects)


def pushes_of(log, numbers, tick):
    """The effects of unit gains: of the force over the mass and, with friction, of that of
    friction."""
    whole_ticks = int(np.floor(numbers["delay"]))
    now = late(log.force, whole_ticks) * log.moving
    before = late(log.force, whole_ticks + 1) * log.moving
    begun = tick.begun(numbers["delay"] - whole_ticks)
    pushes = [[(begun, now), (tick.held - begun, before)]]
    if log.model.friction:
        pushes.append(_spread(tick, -log.side(numbers["turning"])))
        if "fading" in numbers:
            pushes.append(_spread(tick, -log.side(numbers["turning"], numbers["fading"])))
    pushes += [_spread(tick, force) for force in log.beside]
    return pushes


def _spread(tick, means):
    """The effects of a force that changes within ticks, from its means, see `ScaledLog.side`."""
    mean, moment = means
    parts = [(tick.held, mean)]
    if moment.any():
        parts.append((tick.lever, moment))
    return parts


def projected(errors, effects):
    """The gains that leave least of the errors, and what they leave. effects: of unit gains,
    `(gains, rows)`."""
    products = effects @ effects.T
    size = np.maximum(np.sqrt(np.diag(products)), 1e-150)
    gains = (
        np.linalg.pinv(products / np.outer(size, size), rcond=1e-12)
        @ (effects @ errors / size)
        / size
    )
    return gains, errors - gains @ effects


def mean_square(log, search, point, skip):
    """The mean square of the innovations; infinite for a mass that is not positive."""
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, innovations = projected(errors, effects)
    if gains[0] > 0:
        return float(np.mean(innovations**2))
    return np.inf


def theta_of(log, scaled, gains):
    """The numbers of the model in SI units."""
    model = log.model
    period = log.period
    mass = log.pushed * period ** (2 - ORDER[model.measured]) / (gains[0] * log.unit)
    numbers = {
        "log_mass": np.log(mass),
        "damping": scaled["rate"] * mass,
        "stiffness": scaled["square"] * mass,
        "friction": gains[1] / gains[0] * log.pushed if model.friction else 0.0,
        "delay": scaled["delay"],
    }
    if model.load:
        numbers["log_load"] = np.log(scaled["share"] * mass)
        numbers["load_damping"] = scaled["load_rate"] * scaled["share"] * mass
        numbers["log_coupling"] = np.log(scaled["square"] * mass)
        numbers["coupling_damping"] = scaled["coupling_rate"] * mass
    theta = [numbers[name] for name in model.names if name not in OWN]
    beside = gains[len(gains) - len(log.beside) :]
    return np.array([*theta, *(beside[: log.coupled] / gains[0])])
