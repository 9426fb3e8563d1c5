"""Whether a fit explains a log: the residual against that of the encoder alone, and which effect
is missing."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import dropwhile, takewhile
from operator import attrgetter, itemgetter
from typing import NamedTuple

import numpy as np
from scipy.special import gammaincc

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.identification.curves import (
    CURVES,
    alone,
    forceless,
    with_curve,
)
from wavesweep.identification.fit import Fit, at_an_instant, by_prediction, fitted, moves, refined
from wavesweep.identification.model import ORDER, OWN, Model, late, measured, resonance
from wavesweep.identification.prediction.fitting import (
    innovations_of,
    predicted,
    refuse_friction_below_zero,
)
from wavesweep.identification.prediction.intervals import Prediction, estimated_at
from wavesweep.identification.prediction.scaled_log import ONE_WAY
from wavesweep.identification.prediction.search import FIT_LOGGER
from wavesweep.identification.prediction.smoother import LIKELIER

ENCODER_OFFSETS = 12  # offsets of the encoder's steps over which rounding errors are averaged
SWINGING = 0.25  # share of the mass that takes part in a resonance
NAMED_SHARE = 0.3  # share of the residual that an effect has to remove to be named
SAMPLES_TRIED = 3000  # samples at most to which a model with one more effect is fitted
LACKING = "fitted; whether the log has %s as well, %d of %d"


@dataclass(frozen=True)
class Verdict:
    """The judgement of a fit.

    explained: the encoder and white noise explain the residual. missing: "friction", "spring",
    "delay", "resonance", one of `CURVES`, "axes" (the forces of others), "lag" (of the force),
    "force" (one that the log does not have), "noise" (of the
    reading, which is not white), "one-way" (friction or a constant force), "unknown", "unseen" (the
    log would show no resonance at all), or empty if it is explained. frequency_hz: of the
    resonance, or where the residual is largest; otherwise NaN. share: of the residual's power that
    the effect would remove. rms: of the residual (m); expected: that of the encoder alone.
    correlation: of neighbouring residuals; correlation_expected: of the encoder alone.
    resonance_hz: the range in which a resonance with a quarter of the mass would be seen. withheld:
    the numbers have no intervals, since they are those of a model that lacks something of the
    motion. lacking: rms of the force that the model lacks (N).
    """

    explained: bool
    missing: str
    frequency_hz: float
    share: float
    rms: float
    expected: float
    correlation: float
    correlation_expected: float
    resonance_hz: tuple[float, float] | None
    withheld: bool = False
    lacking: float = 0.0


def identified(
    model: Model,
    force: np.ndarray,
    reading: np.ndarray,
    period: float,
    resolution: float,
    other_forces: Sequence[np.ndarray] = (),
) -> tuple[Fit, Verdict]:
    """Fit a model to a log and judge the fit.

    If the encoder and white noise explain what is left, it is the fit by the likelihood of rounded
    readings, see `fit.fitted`; otherwise that by the errors of predictions, whose intervals allow
    for forces that the log does not have. other_forces: those of other axes, which may be what it lacks.

    Errors: UsageError if the force does not show in the readings, or if friction comes out below 0
    in a log that the model does not explain.
    """
    log = (force, reading, period, resolution)
    prediction = predicted(model, *log)
    fit = fitted(model, *log, prediction)
    verdict = judged(fit) if fit else None
    if verdict is None or verdict.missing not in ("", "one-way", "unseen"):
        refuse_friction_below_zero(prediction)
        fit, verdict = lacking(by_prediction(prediction, *log), prediction, other_forces)
    if fit.estimate:
        one_way = "offset" in fit.model.without
    else:
        one_way = prediction.place.log.one_way
    if model.friction and one_way:  # a constant force, however large, would do the same
        unknown = np.where(np.array(fit.model.names) == "friction", np.inf, 0.0)
        fit = replace(fit, extra=fit.extra + unknown)
    return (at_an_instant(fit) if model.measured == "acceleration" else fit), verdict


class Effect(NamedTuple):
    """An effect that a model lacks, with which a fit is `likelier` (logarithm of the odds). left:
    of the missing force (N).

    tone_hz: of a resonance. moved: what a curve changes in the numbers.
    """

    name: str
    likelier: float
    left: float
    tone_hz: float = float("nan")
    moved: np.ndarray | float = 0.0


def _least_explained_part(prediction, rows):
    """The first and the last row of at most SAMPLES_TRIED, those of which a fit explains least."""
    if rows - prediction.skip <= SAMPLES_TRIED:
        return 0, rows
    residual = np.where(prediction.used, prediction.left, 0.0)
    parts = len(residual) // SAMPLES_TRIED
    sizes = residual[: parts * SAMPLES_TRIED].reshape(-1, SAMPLES_TRIED).std(axis=1)
    first = prediction.skip + SAMPLES_TRIED * int(np.argmax(sizes))
    return first, first + SAMPLES_TRIED


def _with_curves(model, bare, count, other_forces):
    """Yield the effects that are curves of the motion, or other forces by their names, of so many
    rows, beside a fit without."""
    curves = [*CURVES, *other_forces]
    # Beside friction that which depends on direction is a constant force, which the walk has.
    if model.friction:
        curves.remove("sided friction")
    for number, name in enumerate(curves, 1):
        FIT_LOGGER.info(LACKING, name, number, len(curves))
        beside = with_curve(name, bare.place, other_forces.get(name, ()))
        if beside.force < np.inf:
            likelier = count * np.log(bare.rms / beside.rms)
            yield Effect(name, likelier, beside.force, moved=beside.theta - bare.theta)


def _lagging(force):
    """The force behind lags of first order, whose sums are close to it behind one in between."""
    from scipy.signal import lfilter

    lagging = []
    # Time constants in ticks.
    for time_constant in (1.0, 4.0, 16.0):
        decay = np.exp(-1 / time_constant)
        lagging.append(lfilter([1 - decay], [1, -decay], force))
    return lagging


def lacking(
    fit: Fit, prediction: Prediction, other_forces: Sequence[np.ndarray]
) -> tuple[Fit, Verdict]:
    """What a fit by predictions lacks: the effect without which most is left of the innovations, or
    else a force.

    Where this is a curve of the motion that explains nearly all of the force, the numbers are those
    of the fit with it.
    """
    rows = fit.rows
    first, end = _least_explained_part(prediction, len(rows.force))
    force, effects, seen = _lacking_effects(fit, prediction, other_forces, first, end)
    effects = [effect for effect in effects if effect.likelier > LIKELIER and seen]
    # A lag that leaves a tenth of the force goes before curves, which are likelier by a part of it.
    lag = [effect for effect in effects if effect.name == "lag" and effect.left < 0.1 * force]
    best = _best(lag or effects)
    name = "force" if seen else "noise"
    share = 0.0
    tone_hz = float("nan")
    if best is not None:
        share = float(1 - best.left / force)
    pushed = float(np.std(rows.force[first:end]))
    # The share of the force of the log, below which a force that the model lacks,
    # whatever it depends on, is less than amplifiers and sensors know of it: it widens the
    # intervals by what it changes
    withheld = bool(share > NAMED_SHARE and force > 1e-5 * pushed)
    # As much force as the log has itself may be that of a motion that no model here has. A log that
    # leaves the mass open has its own refusal.
    open_mass = float((fit.half + fit.extra)[0]) > np.log(3) / 2
    # A force that nothing explains leaves no interval beyond half of the force of the log.
    much = not open_mass and force > 0.5 * pushed
    if withheld:
        name = best.name
        tone_hz = best.tone_hz
    # Where a drift moves the device a curve of its position explains a little of the drift.
    for effect in () if withheld else effects:
        fit = replace(fit, extra=np.maximum(fit.extra, np.abs(effect.moved)))
    # A curve is fitted beside the numbers if it explains 95 % of the force.
    if name in CURVES and share > 0.95:
        curved = with_curve(name, prediction.place)
        if curved.rms < np.inf:
            fit = _beside(fit, prediction, curved)
            withheld = False
    withheld = withheld or bool(much and name == "force")
    residual = fit.residual[rows.skip :][rows.used]
    expected, usual = _of_encoder(fit)
    rms = float(np.sqrt(np.mean(residual**2)))
    correlation = prediction.correlation
    of_rest = rms, expected, correlation, usual
    return fit, Verdict(False, name, tone_hz, share, *of_rest, None, withheld, force)


def _lacking_effects(
    fit: Fit, prediction: Prediction, other_forces: Sequence[np.ndarray], first: int, end: int
) -> tuple[float, list[Effect], bool]:
    """The force that a fit leaves in the rows from first to end, effects that may explain it, and
    whether a force beside that of the log is seen there at all."""
    rows = fit.rows
    part = (rows.force[first:end], rows.reading[first:end], rows.period, rows.resolution)
    force, effects = _with_models(replace(fit.model, without=()), prediction, part)
    if fit.model.measured == "acceleration":
        return force, effects, True
    bare = alone(prediction.place, first, end)
    count = end - first
    seen = count * np.log(forceless(bare.place) / bare.rms) > LIKELIER
    if seen and not fit.model.load:
        lagging = [late[first:end] for late in _lagging(rows.force)]
        of_axes = [coupled[first:end] for coupled in other_forces]
        acting = {"lag": lagging} | ({"axes": of_axes} if of_axes else {})
        effects += _with_curves(fit.model, bare, count, acting)
    return bare.force, effects, seen


def _with_models(model, prediction, log):
    """The force that a model lacks in some rows (N), and the effects of the models with one more
    number."""
    effects = []
    larger_models = list(_larger(model))
    if not larger_models:
        return prediction.walked, effects
    bare = innovations_of(model, prediction.searched, *log)
    for number, (name, larger) in enumerate(larger_models, 1):
        FIT_LOGGER.info(LACKING, name, number, len(larger_models))
        innovations = innovations_of(larger, prediction.searched, *log)
        if np.isfinite(innovations.rms):
            likelier = len(log[0]) * np.log(bare.rms / innovations.rms)
            effects.append(Effect(name, likelier, innovations.walked, innovations.tone_hz))
    return bare.walked, effects


def _best(effects):
    """The likeliest effect; of those that are nearly as likely, one that an option fits.

    Friction goes before that which depends on direction, of which it is a case.
    """
    if not effects:
        return None
    best = max(effects, key=attrgetter("likelier"))
    plain = [effect for effect in effects if effect.name == "friction"]
    if best.name == "sided friction" and plain:
        return plain[0]
    fitting = [
        effect
        for effect in effects
        if effect.name not in CURVES and effect.likelier > best.likelier - LIKELIER
    ]
    if fitting:
        return max(fitting, key=attrgetter("likelier"))
    return best


def _beside(fit, prediction, curved):
    """The fit with a curve.

    Its intervals are wider by what the last pass of the smoother changed and, as the curve leaves a
    share of the force, by this share of what it changed.
    """
    estimate = estimated_at(*curved.place, None, curved.moved)
    open_share = min(curved.force / prediction.walked, 1.0)
    half = estimate.half + open_share * np.abs(estimate.theta - prediction.theta)
    estimate = replace(estimate, used=prediction.used, half=half)
    rows = fit.rows
    return by_prediction(estimate, rows.force, rows.reading, rows.period, rows.resolution)


def _larger(model):
    """The models with one more effect, by the name of this."""
    if model.delay is not None:
        yield "delay", replace(model, delay=None)
    if model.load:
        return
    if not (model.friction or model.spring or model.measured == "acceleration"):
        yield "resonance", replace(model, load=True)
    if not model.friction:
        yield "friction", replace(model, friction=True)
    if not model.spring:
        yield "spring", replace(model, spring=True)


def _odds_of_bands(noise: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first lines of 24 bands of a spectrum, equally wide in octaves, and the end of the last one;
    and the probability that white noise has at least the power of each, which is Gamma distributed."""
    edges = np.unique(np.round(np.geomspace(1, len(noise) // 2 + 1, 25)).astype(int))
    powers = np.add.reduceat(np.abs(np.fft.rfft(noise))[: edges[-1]] ** 2, edges[:-1])
    return edges, gammaincc(np.diff(edges), powers / np.sum(noise**2))


def judged(fit: Fit) -> Verdict:
    """Judge a fit."""
    rows = fit.rows
    estimate = fit.estimate
    # Divided by the square roots of its weights, the score is white if the model is right.
    root = np.sqrt(estimate.weight)
    basis = np.linalg.qr(_sized(root[:, None] * estimate.slopes))[0]
    whitened = estimate.score / np.maximum(root, NEXT_TO_ZERO)
    whitened = whitened - basis @ (basis.T @ whitened)
    edges, odds = _odds_of_bands(whitened)
    seen = _seen(fit, root, basis, whitened)
    residual = fit.residual[rows.skip :]
    rms = float(np.sqrt(np.mean(residual[rows.used] ** 2)))
    # The residual, relative to the motion, that double precision alone explains.
    exact = estimate.rounded or rms < 1e-10 * np.ptp(rows.reading)
    alike = _like_friction(fit)
    # The probability of the power of a band below which white noise does not explain it.
    remains = not exact and (seen.effect or float(odds.min()) < 1e-8)
    # In which a resonance would be seen.
    stretch = [*takewhile(itemgetter(1), dropwhile(lambda effect: not effect[1], seen.frequencies))]
    band = (stretch[0][0], stretch[-1][0]) if stretch else None
    unseen = band is None and not fit.model.load
    missing = next((word for word, holds in (("one-way", alike), ("unseen", unseen)) if holds), "")
    named = (missing, float("nan"), 0.0)
    if remains:
        named = max(
            [("resonance", seen.tone_hz, seen.share), *_tried(fit)], key=lambda effect: effect[2]
        )
        if named[2] < NAMED_SHARE:
            worst = int(np.argmin(odds))
            named = (
                "unknown",
                float(np.sqrt(edges[worst] * edges[worst + 1]) / len(whitened) / rows.period),
                named[2],
            )
    expected, usual = _of_encoder(fit)
    return Verdict(
        not any((remains, missing)), *named, rms, expected, _neighbours(residual), usual, band
    )


class _Seen(NamedTuple):
    """What the residual shows of effects that a model lacks. effect: whether one is seen.

    tone_hz, share: of the resonance that explains most, and its share of the residual.
    frequencies: those tried, and whether a resonance there would be seen.
    """

    effect: bool
    tone_hz: float
    share: float
    frequencies: list[tuple[float, bool]]


def _seen(fit: Fit, root: np.ndarray, basis: np.ndarray, whitened: np.ndarray) -> _Seen:
    """The effects in a whitened score `(rows,)`. root: of its weights; basis: of what the numbers
    of the model change."""
    is_seen = False
    tone = float("nan")
    tone_share = 0.0
    frequencies = []
    for frequency, changes in _effects(fit):
        directions = (root * fit.rows.used)[:, None] * changes
        residual_beside = _orthogonal(basis, directions)
        projections = whitened @ residual_beside
        spread = np.linalg.norm(whitened[:, None] * residual_beside, axis=0)
        is_seen |= bool((np.abs(projections) > 5.0 * spread).any())  # standard deviations
        share = float(np.sum(projections**2) / np.sum(whitened**2))
        if frequency:
            # The expected significance at which an effect is seen in spite of errors of three sigmas.
            significance = np.abs(directions[:, 0] @ residual_beside)
            frequencies.append((frequency, bool((significance > 8.0).any())))
            if share > tone_share:
                tone = frequency
                tone_share = share
    return _Seen(is_seen, tone, tone_share, frequencies)


def _of_encoder(fit):
    """The rms and the correlation of neighbours that the rounding of the encoder alone would
    leave."""
    rows = fit.rows
    errors = []
    steps = fit.readings[rows.skip :] / (rows.resolution or 1.0)
    for shift in range(ENCODER_OFFSETS):
        shifted = steps + shift / ENCODER_OFFSETS
        error = rows.resolution * (np.round(shifted) - shifted)
        errors.append((np.mean(error**2), _neighbours(error)))
    square, correlation = np.mean(errors, axis=0).tolist()
    return square**0.5, correlation


def _like_friction(fit: Fit) -> bool:
    """Whether a constant force opposes a device that moves in one direction only, as Coulomb
    friction would."""
    if (
        fit.model.friction
        or fit.model.spring
        or fit.model.load
        or fit.model.measured == "acceleration"
    ):
        return False
    moved = moves(fit.model, fit.readings[fit.rows.skip :])
    direction = float(np.mean(np.sign(moved[moved != 0])))
    offset = fit.numbers["offset"]
    half = fit.half[fit.model.names.index("offset")]
    return abs(direction) > ONE_WAY and offset * direction < 0 and abs(offset) > 2 * half


def _tried(fit: Fit) -> Iterator[tuple[str, float, float]]:
    """Yield each number that the model lacks, and the share of the residual that a fit with it
    removes."""
    model = fit.model
    rows = fit.rows
    end = rows.skip + SAMPLES_TRIED
    rows = replace(
        rows, force=rows.force[:end], reading=rows.reading[:end], used=rows.used[:SAMPLES_TRIED]
    )
    effects = {
        "friction": None if model.friction or model.load else replace(model, friction=True),
        "spring": None if model.spring or model.load else replace(model, spring=True),
        "delay": None if model.delay is None else replace(model, delay=None),
    }
    before = _left(model, fit.theta, rows)
    for name, effect in effects.items():
        if effect is not None:
            numbers = fit.numbers | {"log_mass": np.log(fit.numbers["mass"])}
            numbers |= {"friction": 0.05 * float(np.std(rows.force))} if name == "friction" else {}
            after = _left(effect, np.array([numbers[name_of] for name_of in effect.names]), rows)
            yield name, float("nan"), 1 - after / before


def _left(model, theta, rows):
    """The sum of squares of the residual of the best numbers."""
    return float(np.sum(rows.residual(model, refined(model, theta, rows)) ** 2))


def _orthogonal(basis, directions):
    """An orthonormal basis of the directions, orthogonal to the basis of the fit."""
    rest = _sized(directions)
    for _ in range(2):
        rest = rest - basis @ (basis.T @ rest)
    size = np.linalg.norm(rest, axis=0)
    rest = rest[:, size > 1e-7]
    if rest.shape[1]:
        return np.linalg.qr(rest)[0]
    return np.zeros((len(rest), 1))


def _sized(directions):
    """The directions with a length of 1."""
    return directions / np.maximum(np.linalg.norm(directions, axis=0), NEXT_TO_ZERO)


def _neighbours(errors):
    errors = errors - errors.mean()
    total = float(np.sum(errors**2))
    if total:
        return float(np.sum(errors[1:] * errors[:-1]) / total)
    return 0.0


def _effects(fit: Fit) -> Iterator[tuple[float, np.ndarray]]:
    """Yield the changes of the readings by each effect that the model lacks; for a resonance
    with its frequency, else 0."""
    numbers, (force, period, skip) = (
        fit.numbers | {"friction": 0.0},
        (fit.rows.force, fit.rows.period, fit.rows.skip),
    )
    places = measured(numbers, "position", force, period, skip)
    at_rest = numbers | dict.fromkeys((*OWN, "delay"), 0.0)
    speeds = np.gradient(places)
    pushing = late(force, round(numbers["delay"]))[skip:]
    curves = (np.abs(speeds), speeds * np.abs(speeds), speeds**2 * pushing)
    for by in (
        *([] if fit.model.friction else [np.sign(speeds)]),
        *([] if fit.model.spring else [places]),
        *([] if fit.model.delay is None else [(late(force, 1) - force)[skip:]]),
        *([] if fit.model.load else curves),
    ):
        yield 0.0, _as_read(fit.model, measured(at_rest, "position", by, period)[:, None], period)
    lowest = 3 / (len(force) * period)
    highest = 0.4 / period
    pushing = pushing - pushing[0]
    for tone in np.geomspace(lowest, highest, 48):  # frequencies of a resonance that are tried
        # With two masses m (1 - q) and m q, the first one has the admittance 1/(m s^2) + q/(1 -
        # q)/m/(s^2 + 2 z w s + w^2).
        # A damping ratio of 0.03.
        mode = (
            SWINGING
            / (1 - SWINGING)
            / numbers["mass"]
            * resonance(pushing, tone, 0.03, period, 0.0, "position")
        )
        yield float(tone), _as_read(fit.model, np.stack([mode, np.gradient(mode)], axis=1), period)


def _as_read(model, changes, period):
    """Changes of the position, `(ticks, any)`, as those of what is measured."""
    for _ in range(ORDER[model.measured]):
        changes = np.gradient(changes, period, axis=0)
    return changes
