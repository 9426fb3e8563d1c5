"""The fit of a device to a frequency response: the admittance of the model, sampled or analogue,
with relative errors."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import stdtrit

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import UsageError
from wavesweep.identification.explained import NAMED_SHARE
from wavesweep.identification.model import OWN, Model, euler, reach, step
from wavesweep.identification.points import FrequencyResponse

LATE = (0, 1, 2, 4, 8, 16, 32)  # delays tried first (ticks)
RARE_ODDS = 9.0  # logarithm of the odds beyond which an effect or a single frequency is not noise
RESONANCES_TRIED = 80  # frequencies of a resonance that are tried


@dataclass(frozen=True, eq=False)
class ResponseFit:
    """The numbers `names` of a model, half the widths of their intervals, and the judgement, as for
    a log.

    fitted: admittance (m/N). residual: relative, complex. correlation: of neighbouring residuals.
    extra: by how much wider the intervals are on both sides if the model does not explain the
    response.
    """

    model: Model
    theta: np.ndarray
    half: np.ndarray
    fitted: np.ndarray
    residual: np.ndarray
    explained: bool
    missing: str
    frequency_hz: float
    share: float
    correlation: float
    extra: np.ndarray | float

    @property
    def names(self) -> tuple[str, ...]:
        """The numbers that are fitted."""
        return _names(self.model)

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by their names."""
        return _numbers(self.model, self.theta)


def _names(model):
    return tuple(name for name in model.names if name not in OWN)


def _numbers(model, theta):
    return model.numbers(np.append(theta, np.zeros(len(model.own))))


@dataclass(frozen=True, slots=True)
class Hold:
    """How a response was measured: with a force that was held over ticks of `period` s, or with an
    analogue one.

    The delay is in ticks; of an analogue force `period` is its unit.
    """

    period: float
    held: bool = True


def admittance(numbers: Mapping[str, float], frequency_hz: np.ndarray, hold: Hold) -> np.ndarray:
    """Admittance (m/N) of the model, `(frequencies,)`: of one that is sampled, positions at the
    ticks over the held force."""
    period = hold.period
    if not hold.held:
        s = 2j * np.pi * frequency_hz
        impedance = numbers["mass"] * s**2 + numbers["damping"] * s + numbers["stiffness"]
        return np.exp(-s * period * numbers["delay"]) / impedance
    angle = 2 * np.pi * frequency_hz * period
    whole_ticks = np.floor(numbers["delay"])
    fraction = numbers["delay"] - whole_ticks
    # With a delay of part of a tick, the force of the tick before acts in this part, see `model`.
    now = reach(numbers, (1 - fraction) * period)
    before = reach(numbers, period) - now
    A = step(numbers, period)
    ahead = np.exp(1j * angle)[:, None]
    by_force = (now + before / ahead)[..., None]
    return np.linalg.solve(ahead[..., None] * np.eye(len(A)) - A, by_force)[:, -1, 0] * np.exp(
        -1j * angle * whole_ticks
    )


def fitted_response(measured: FrequencyResponse, hold: Hold, model: Model) -> ResponseFit:
    """Fit a model of one mass without friction."""
    theta, residual, J = _fit(measured, hold, model, _first(measured, hold, model))
    if not (
        np.isfinite(J).all() and np.linalg.norm(J, axis=0).all()
    ):  # least squares left the range of doubles
        raise UsageError(
            "expected the response of a device, found one that no numbers fit, as of noise"
        )
    numbers = 2 * len(measured.frequency_hz) - len(theta)
    square = float(residual @ residual) / numbers
    extra = 0.0
    half = stdtrit(numbers, 0.975) * np.sqrt(square * np.diag(np.linalg.pinv(J.T @ J)))
    H = admittance(_numbers(model, theta), measured.frequency_hz, hold)
    complexes = residual[: len(H)] + 1j * residual[len(H) :]
    related = float(
        np.sum((complexes[1:] * complexes[:-1].conj()).real)
        / max(np.sum(np.abs(complexes) ** 2), NEXT_TO_ZERO)
    )
    named = max(_tried(measured, hold, model, theta, residual, J), key=lambda effect: effect[2])
    # noise explains shares of 1/n; the largest of many is ln(number)/n
    rare = len(H) * named[2] > np.log(RESONANCES_TRIED) + RARE_ODDS
    far = (
        float(np.max(np.abs(complexes) ** 2) / max(np.mean(np.abs(complexes) ** 2), NEXT_TO_ZERO))
        > np.log(len(H)) + RARE_ODDS
    )
    # Neighbouring residuals of noise are correlated by at most 3.5 standard deviations.
    explained = not (rare or far or related * np.sqrt(2 * len(H)) > 3.5)
    if explained:
        named = ("", float("nan"), 0.0)
    elif named[2] < NAMED_SHARE:
        named = ("unknown", float(measured.frequency_hz[np.argmax(np.abs(complexes))]), named[2])
    if not explained:  # there are fewer independent errors than frequencies
        # Intervals are widened by a correlation of neighbouring residuals of at most 0.99.
        extra = half * (np.sqrt(2 / (1 - np.clip(related, 0.0, 0.99))) - 1)
        extra[:2] += euler(_numbers(model, theta), hold.period) * hold.held
    return ResponseFit(
        model, theta, half, H, measured.admittance / H - 1, explained, *named, related, extra
    )


def _weights(measured):
    """One over the standard deviation of the relative error, up to a factor common to all
    frequencies."""
    square = np.minimum(measured.coherence, 0.9999)
    return np.sqrt(square / (1 - square)) / np.sqrt(0.9999 / 0.0001)


def _off(measured, hold, model, theta):
    # The logarithm of the ratio: unlike the difference over the measured size, errors leave no bias
    # in it.
    with np.errstate(all="ignore"):
        fitted = admittance(_numbers(model, theta), measured.frequency_hz, hold)
        off = _weights(measured) * np.log(measured.admittance / fitted)
    return np.nan_to_num(np.concatenate([off.real, off.imag]), nan=1e6, posinf=1e6, neginf=-1e6)


def _fit(measured, hold, model, start):
    size = np.maximum(np.abs(start), [{"delay": 1.0}.get(name, 1e-3) for name in _names(model)])
    done = least_squares(
        lambda part: _off(measured, hold, model, part * size),
        start / size,
        "3-point",
        x_scale="jac",
        xtol=1e-12,
        ftol=1e-14,
    )
    return done.x * size, done.fun, done.jac / size


def _first(measured, hold, model):
    """The numbers to begin with, `[log m, d, k if there is a spring, delay if it is fitted]`: of each delay
    tried, `1/H = k - m w^2 + j w d` by linear least squares of relative errors, and the best of these."""
    omega = 2 * np.pi * measured.frequency_hz
    best = None
    for late in LATE if model.delay is None else (model.delay,):
        turn = omega * hold.period * (late + 0.5 * hold.held)  # a held force is half a tick late
        ahead = measured.admittance * np.exp(1j * turn)
        columns = [-(omega**2), 1j * omega]
        if model.spring:
            columns.append(np.ones_like(omega))
        A = np.stack([column * ahead for column in columns], axis=1)
        A = np.concatenate([A.real, A.imag])
        unit = np.concatenate([np.ones_like(omega), np.zeros_like(omega)])
        size = np.linalg.norm(A, axis=0)
        x = np.linalg.lstsq(A / size, unit, rcond=None)[0] / size
        error = float(np.sum((A @ x - unit) ** 2))
        if x[0] > 0 and (best is None or error < best[0]):
            delays = [float(late)] if model.delay is None else []
            best = error, np.array([np.log(x[0]), *x[1:], *delays])
    if best is None:
        raise UsageError(
            "no mass, however large or small, has this response; do force and position have the same sign?"
        )
    return best[1]


def _tried(measured, hold, model, theta, residual, J) -> Iterator[tuple[str, float, float]]:
    """Yield effects that the model lacks, and the share of the residual that each removes."""
    before = float(residual @ residual)
    numbers = _numbers(model, theta)
    if model.spring:
        larger_models = []
    else:
        larger_models = [("spring", replace(model, spring=True))]
    larger_models += [] if model.delay is None else [("delay", replace(model, delay=None))]
    for name, larger in larger_models:
        start = np.array([numbers[name] for name in _names(larger)])
        after = _fit(measured, hold, larger, start)[1]
        yield name, float("nan"), 1 - float(after @ after) / before
    hertz = measured.frequency_hz
    weights = _weights(measured)
    for tone in np.geomspace(hertz[0], hertz[-1], RESONANCES_TRIED):
        mode = (
            # A damping ratio of 0.03 is tried.
            weights / (tone**2 - hertz**2 + 2j * 0.03 * tone * hertz) / measured.admittance
        )
        A = np.c_[J, np.append(mode.real, mode.imag), np.append(-mode.imag, mode.real)]
        size = np.linalg.norm(A, axis=0)
        rest = residual - A / size @ np.linalg.lstsq(A / size, residual, rcond=None)[0]
        yield "resonance", float(tone), 1 - float(rest @ rest) / before
