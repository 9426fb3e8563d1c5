"""Whether a fit explains a log: what is left, held against what the encoder leaves by itself, and which effect is missing."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import dropwhile, takewhile

import numpy as np
from scipy.signal import lfilter
from scipy.special import gammaincc

from wavesweep.identification.fit import Fit, fitted, refined, widened
from wavesweep.identification.model import Model, late, positions

SHOWN = 12  # places of the encoder's steps, from which the usual size of rounding errors is told
BANDS = 24  # of the spectrum, equally wide in octaves
EXACT = 1e-10  # of the motion, below which what is left is that of double precision
RARE = 1e-8  # probability of the power of a band, below which white noise does not make it
SIGMAS = 5.0  # beyond which an effect that the model does not have is seen
TONES = 48  # frequencies of a resonance that are tried
RINGING = 0.03  # its damping ratio
SWINGING = 0.25  # share of the mass that swings in it
SURE = 8.0  # sigmas of an effect that surely goes beyond SIGMAS, with errors of three against it
ONE_WAY = 0.98  # share of the motion in one direction, beyond which friction is like a constant force
CLEAR = 0.3  # share of what is left that an effect has to take away to be named
TRIED = 8000  # samples, at most, to which a model with one effect more is fitted


@dataclass(frozen=True)
class Verdict:
    """The judgement of a fit.

    explained: the residual is what the encoder and white noise leave. missing: "friction", "spring", "delay", "resonance",
    "one-way" (friction or a constant force), "unknown", "unseen" (the log would show no resonance at all), or empty if it is
    explained. frequency_hz: of the resonance, or where most is left; otherwise NaN. share: of the residual's power that the
    effect would take away. rms: of the residual (m); expected: that of the encoder alone. correlation: of neighbouring
    residuals; correlation_expected: of the encoder alone. resonance_hz: between these the log shows a
    resonance in which a quarter of the mass swings.
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


def identified(model: Model, force: np.ndarray, position: np.ndarray, period: float, resolution: float) -> tuple[Fit, Verdict]:
    """Fit a model to a log and judge the fit, whose intervals are widened if it does not explain the log; see `fitted`."""
    fit = fitted(model, force, position, period, resolution)
    verdict = judged(fit)
    return (widened(fit) if verdict.missing not in ("", "one-way", "unseen") else fit), verdict


def judged(fit: Fit) -> Verdict:
    """Judge a fit."""
    rows, told = fit.rows, fit.told
    # Divided by the roots of its weights the score is white if the model is right.
    root = np.sqrt(told.weight)
    basis = np.linalg.qr(_sized(root[:, None] * told.slopes))[0]
    left = _projected(basis, told.score / np.maximum(root, 1e-300))
    edges = _edges(len(left))
    # Powers of white noise are Gamma distributed.
    odds = gammaincc(np.diff(edges), _powers(left, edges) / np.sum(left**2))
    seen, tone, taken, shown = False, float("nan"), 0.0, []
    for frequency, changes in _effects(fit):
        directions = (root * rows.used)[:, None] * changes
        beside = _orthogonal(basis, directions)
        along = left @ beside
        seen |= bool((np.abs(along) > SIGMAS * np.linalg.norm(left[:, None] * beside, axis=0)).any())
        share = float(np.sum(along**2) / np.sum(left**2))
        if frequency:
            shown.append((frequency, bool((np.abs(directions[:, 0] @ beside) > SURE).any())))
        if frequency and share > taken:
            tone, taken = frequency, share
    residual, step = fit.residual[rows.skip :], rows.resolution
    rms = float(np.sqrt(np.mean(residual[rows.used] ** 2)))
    exact = told.rounded or rms < EXACT * np.ptp(rows.position)
    alike, remains = _like_friction(fit), not exact and (seen or float(odds.min()) < RARE)
    band = _band(shown)
    explained = not (remains or alike or band is None)
    named = ("one-way" if alike else "" if band else "unseen", float("nan"), 0.0)
    if remains:
        named = max(("resonance", tone, taken), *_tried(fit), key=lambda each: each[2])
        if named[2] < CLEAR:
            worst = int(np.argmin(odds))
            named = ("unknown", float(np.sqrt(edges[worst] * edges[worst + 1]) / len(left) / rows.period), named[2])
    places = [fit.positions[rows.skip :] / (step or 1.0) + part / SHOWN for part in range(SHOWN)]
    rounding = [step * (np.round(each) - each) for each in places]
    square, usual = np.mean([(np.mean(each**2), _neighbours(each)) for each in rounding], axis=0).tolist()
    return Verdict(explained, *named, rms, square**0.5, _neighbours(residual), usual, band)


def _band(shown):
    """The first and the last frequency of the first stretch in which a resonance is seen; None if it never is."""
    stretch = list(takewhile(lambda each: each[1], dropwhile(lambda each: not each[1], shown)))
    return (stretch[0][0], stretch[-1][0]) if stretch else None


def _like_friction(fit: Fit) -> bool:
    """Whether a constant force against a device that moves one way alone was found, which Coulomb friction would be as well."""
    if fit.model.friction or fit.model.spring:
        return False
    moves = np.diff(fit.positions[fit.rows.skip :])
    way = float(np.mean(np.sign(moves[moves != 0])))
    offset, half = fit.numbers["offset"], fit.half[fit.model.names.index("offset")]
    return abs(way) > ONE_WAY and offset * way < 0 and abs(offset) > 2 * half


def _tried(fit: Fit) -> Iterator[tuple[str, float, float]]:
    """Yield each number that the model does not have, and the share of what is left that a fit with it takes away."""
    model, rows = fit.model, fit.rows
    end = rows.skip + TRIED
    rows = replace(rows, force=rows.force[:end], position=rows.position[:end], used=rows.used[:TRIED])
    effects = {
        "friction": None if model.friction else replace(model, friction=True),
        "spring": None if model.spring else replace(model, spring=True),
        "delay": None if model.delay is None else replace(model, delay=None),
    }
    before = _left(model, fit.theta, rows)
    for name, more in effects.items():
        if more is not None:
            known = fit.numbers | {"log_mass": np.log(fit.numbers["mass"])}
            known |= {"friction": 0.05 * float(np.std(rows.force))} if name == "friction" else {}
            after = _left(more, np.array([known[each] for each in more.names]), rows)
            yield name, float("nan"), 1 - after / before


def _left(model, theta, rows):
    """The squares that are left of a log by the best numbers."""
    return float(np.sum(rows.residual(model, refined(model, theta, rows)) ** 2))


def _projected(basis, errors):
    return errors - basis @ (basis.T @ errors)


def _orthogonal(basis, directions):
    """The directions without what the fit takes of them, orthonormal."""
    rest = _sized(directions)
    for _ in range(2):
        rest = rest - basis @ (basis.T @ rest)
    size = np.linalg.norm(rest, axis=0)
    rest = rest[:, size > 1e-7]
    return np.linalg.qr(rest)[0] if rest.shape[1] else np.zeros((len(rest), 1))


def _sized(directions):
    """The directions with a length of 1."""
    return directions / np.maximum(np.linalg.norm(directions, axis=0), 1e-300)


def _edges(rows):
    """The first lines of the bands of a spectrum, and the end of the last one."""
    return np.unique(np.round(np.geomspace(1, rows // 2 + 1, BANDS + 1)).astype(int))


def _powers(errors, edges):
    return np.add.reduceat(np.abs(np.fft.rfft(errors))[: edges[-1]] ** 2, edges[:-1])


def _neighbours(errors):
    errors = errors - errors.mean()
    total = float(np.sum(errors**2))
    return float(np.sum(errors[1:] * errors[:-1]) / total) if total else 0.0


def _effects(fit: Fit) -> Iterator[tuple[float, np.ndarray]]:
    """Yield what each effect that the model does not have changes in the positions; of a resonance with its frequency."""
    found, (force, period, skip) = fit.numbers | {"friction": 0.0}, (fit.rows.force, fit.rows.period, fit.rows.skip)
    places = fit.positions[skip:]
    for by in (
        *([] if fit.model.friction else [np.sign(np.gradient(places))]),
        *([] if fit.model.spring else [places]),
        *([] if fit.model.delay is None else [(late(force, 1) - force)[skip:]]),
    ):
        yield 0.0, _response(found, by, period)[:, None]
    lowest, highest = 3 / (len(force) * period), 0.4 / period
    pushing = late(force, round(found["delay"]))[skip:]
    for tone in np.geomspace(lowest, highest, TONES):
        yield float(tone), _ringing(pushing, float(tone), period, found["mass"])


def _response(found, force, period):
    model = Model(spring=True, delay=0.0)
    at_rest = {"log_mass": np.log(found["mass"]), "damping": found["damping"], "stiffness": found["stiffness"]}
    theta = np.array([at_rest.get(name, 0.0) for name in model.names])
    return positions(model, theta, force, period)


def _ringing(force, tone, period, mass):
    """What a swinging share of the mass adds to the position (m), and its change from tick to tick, `(ticks, 2)`.

    Of two masses m (1 - q) and m q the first has the admittance 1/(m s^2) + q/(1 - q)/m/(s^2 + 2 z w s + w^2).
    """
    angle = 2 * np.pi * tone * period
    pole = np.exp(angle * complex(-RINGING, 1.0))
    past = [1.0, -2 * pole.real, abs(pole) ** 2]
    static = SWINGING / (1 - SWINGING) / mass / (2 * np.pi * tone) ** 2
    mode = lfilter([0.0, static * sum(past)], past, force - force[0])
    return np.stack([mode, np.gradient(mode)], axis=1)
