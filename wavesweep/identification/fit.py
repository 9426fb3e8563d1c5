"""The fit of a model to a log, and how far the encoder lets its numbers be known.

The likelihood is that of errors of the size of the encoder's rounding and of white noise. Rounding is no white noise: its error
is a sawtooth of the position, the same as long as the device rests. Its effect on the numbers is therefore found by itself:
motions as far from the fitted one as the errors may have put it are rounded at many other places of the encoder's steps, with
the noise that is left, and each error is carried through the fit. Without the first part intervals are too narrow: the errors
are those of one motion, and where it creeps or rests, those of another one within the same readings differ much from them.
A stretch in which the device stays within a step, at rest or at a turn, has one reading of its place.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from wavesweep.errors import UsageError
from wavesweep.identification.model import Model, positions, sensitivities

PLACES = (64, 200)  # of the encoder's steps, at which the motion is rounded again; the fewest in long logs
LONG = 6_000_000  # samples at all places together, for which there are fewer
DITHERED = 0.3  # steps of white noise beyond which rounding errors are white
ONE_WAY = 0.98  # share of the way in one direction, beyond which friction is like a constant force
RESTING = 10  # equal readings at the start of a log, of a device that is held by friction
PART = 5000  # samples of a long log that are first fitted with friction
COARSE = 4000  # samples, at most, of the first search
RATES = np.geomspace(0.03, 300, 13)  # damping over mass that it tries (1/s)
TONES = np.geomspace(0.2, 100, 16)  # natural frequencies that it tries (Hz)
NEAR = np.geomspace(0.5, 2, 7)  # of the best of these
LATE = (0, 1, 2, 4, 8, 16, 32)  # ticks that it tries


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit.

    theta: the numbers of `model.names`; half: half the widths of their intervals. positions: fitted (m). residual: what is left
    (m). still: stretches with one reading of the place, see `counted`. slopes: of the positions by the numbers, `(ticks,
    numbers)`; basis: orthonormal, what the fit takes of counted errors. moved: likely errors of the numbers, `(numbers,
    places)`. noise: standard deviation of the white noise beside rounding (m).
    resolution: step of the encoder (m), 0 for none.
    """

    model: Model
    theta: np.ndarray
    half: np.ndarray
    positions: np.ndarray
    residual: np.ndarray
    still: np.ndarray
    slopes: np.ndarray
    basis: np.ndarray
    moved: np.ndarray
    noise: float
    resolution: float

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by their names."""
        return self.model.numbers(self.theta)

    @property
    def weights(self) -> np.ndarray:
        """Of the samples: 1, or the share in one reading, `(ticks,)`."""
        return weights_of(self.still, len(self.residual))


def fitted(model: Model, force: np.ndarray, position: np.ndarray, period: float, resolution: float, start=None) -> Fit:
    """Fit a model to a log. force: N, held over each tick. position: m. period: s. resolution: step of the encoder (m)."""
    if model.friction:
        model = replace(model, without=tuple(_hidden(model, position)))
    still = np.zeros((0, 2), int)
    theta = _begun(model, force, position, period) if start is None else start
    theta = refined(model, theta, force, position, period, still)
    noise = 0.0
    for _ in range(2):
        found = positions(model, theta, force, period)
        before = noise
        noise = _noise(position - found, resolution, still)
        new = _still(found, resolution) if noise < DITHERED * resolution else still[:0]
        if np.array_equal(new, still) and before == noise:
            break
        still = new
        theta = refined(model, theta, force, position, period, still)
    found = positions(model, theta, force, period)
    J = sensitivities(model, theta, force, period, scales(model, theta, force, position, period))
    size = np.linalg.norm(J, axis=0)
    size[size == 0] = 1.0
    basis, upper = np.linalg.qr(counted(still, J / size))
    residual = position - found
    noise = _noise(residual, resolution, still, len(theta))
    inverse = np.linalg.pinv(upper) / size[:, None]
    fit = Fit(model, theta, theta, found, residual, still, J, basis, np.zeros((len(theta), 1)), noise, resolution)
    for _ in range(2):  # of the fitted motion, and of those that it may have been
        errors = likely_errors(fit, places_of(found, *PLACES))
        fit = replace(fit, moved=inverse @ np.array([basis.T @ counted(still, each) for each in errors]).T)
    return replace(fit, half=np.quantile(np.abs(fit.moved), 0.95, axis=1))


def places_of(found: np.ndarray, fewest: int, most: int) -> int:
    """How many places of the encoder's steps a log of this length is rounded at."""
    return min(max(LONG // len(found), fewest), most)


def _hidden(model, position):
    """Yield the numbers that friction hides: the speed of a device at rest; a constant force, if the device moves one way."""
    if np.ptp(position[:RESTING]) == 0:
        yield "velocity"
    moves = np.diff(position)
    if not model.spring and abs(moves.sum()) > ONE_WAY * np.abs(moves).sum():
        yield "offset"


def likely_errors(fit: Fit, places: int, noise: float | None = None) -> Iterator[np.ndarray]:
    """Yield errors of readings (m) of motions near the fitted one, at so many places of the encoder's steps, with noise."""
    source, resolution, noise = np.random.default_rng(0), fit.resolution, fit.noise if noise is None else noise
    for place in range(places):
        true = fit.positions + fit.slopes @ fit.moved[:, source.integers(fit.moved.shape[1])] + resolution * place / places
        read = true + noise * source.standard_normal(len(true)) if noise else true
        yield (resolution * np.floor(read / resolution + 0.5) if resolution else read) - true


def _noise(residual, resolution, still, numbers=0):
    """Standard deviation of white noise that explains what is left beside rounding."""
    weights = weights_of(still, len(residual))
    total = np.sum(weights * residual**2) / max(np.sum(weights) - numbers, 1.0)
    rounding = resolution**2 / 12
    # Rounding alone scatters a little around its mean.
    return float(np.sqrt(total - rounding)) if total > 1.1 * rounding else 0.0


def _still(found, resolution):
    """Stretches around a turn within half a step, `(stretches, 2)`: the first sample and the one after the last."""
    if not resolution:
        return np.zeros((0, 2), int)
    moves = np.sign(np.diff(found))
    turns = np.concatenate([[0], np.flatnonzero(moves[1:] != moves[:-1]) + 1, [len(found) - 1]])
    at = np.arange(len(found))
    after = np.minimum(np.searchsorted(turns, at), len(turns) - 1)
    before = np.maximum(np.searchsorted(turns, at, side="right") - 1, 0)
    near = [np.abs(found - found[turns[each]]) < resolution / 2 for each in (before, after)]
    masked = (near[0] | near[1]).astype(int)
    return np.flatnonzero(np.diff(np.concatenate([[0], masked, [0]]))).reshape(-1, 2)


def weights_of(still: np.ndarray, samples: int) -> np.ndarray:
    """1, but the share of each sample in one reading in the stretches `still`."""
    weights = np.ones(samples)
    for first, last in still:
        weights[first:last] = 1 / (last - first)
    return weights


def counted(still: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """Errors in proportion to what they tell: in a stretch of K samples the mean has one reading, what deviates from it √K.

    Errors in it are neither all the same nor independent. Of a device at rest the second part says that it does not creep.
    """
    if not len(still):
        return errors
    found, sizes = errors.copy(), np.diff(still)[:, 0]
    within = np.repeat(np.arange(len(still)), sizes)
    at = np.arange(len(within)) + np.repeat(still[:, 1] - np.cumsum(sizes), sizes)
    sums = np.add.reduceat(np.concatenate([errors, np.zeros_like(errors[:1])]), still.ravel())[::2]
    means, shares = (sums.T / sizes).T, sizes**-0.5
    found[at] = ((shares**0.5)[within] * errors[at].T + ((shares - shares**0.5) * means.T)[..., within]).T
    return found


def scales(model: Model, theta: np.ndarray, force: np.ndarray, position: np.ndarray, period: float) -> np.ndarray:
    """Sizes of changes of the numbers that move the device about as far as it moves."""
    found, reach, rms = model.numbers(theta), float(np.ptp(position)), float(np.std(force))
    mass, seconds = found["mass"], period * len(force)
    sizes = {
        "log_mass": 1.0,
        "damping": max(abs(found["damping"]), mass / min(seconds, 0.3)),
        "stiffness": max(abs(found["stiffness"]), mass * 40.0),
        "friction": max(abs(found["friction"]), 0.3 * rms),
        "delay": 1.0,
        "start": reach,
        "velocity": reach / min(seconds, 0.3),
        "offset": rms,
    }
    return np.array([sizes[name] for name in model.names])


def refined(model: Model, theta: np.ndarray, force, position, period: float, still: np.ndarray) -> np.ndarray:
    """The numbers of the least squares, from others near by."""
    size = scales(model, theta, force, position, period)
    reach = float(np.ptp(position))

    def off(part):
        with np.errstate(all="ignore"):
            left = counted(still, positions(model, theta + (part - 1) * size, force, period) - position) / reach
        return np.nan_to_num(np.clip(left, -1e6, 1e6), nan=1e6)

    def slopes(part):
        with np.errstate(all="ignore"):
            found = sensitivities(model, theta + (part - 1) * size, force, period, size)
        return np.nan_to_num(counted(still, found * (size / reach)), posinf=1e6, neginf=-1e6)

    # The march with friction has kinks, in which smaller steps are lost.
    finest = {"xtol": 1e-7, "ftol": 1e-9} if model.friction else {"xtol": 1e-11, "ftol": 1e-14}
    done = least_squares(off, np.ones(len(theta)), slopes, x_scale="jac", gtol=None, max_nfev=40, **finest)
    return theta + (done.x - 1) * size


def _begun(model, force, position, period):
    """Numbers near the best ones: those of the same model with the delay held, of a part of a long log with friction."""
    theta, part = _first(model, force, position, period), slice(None)
    if model.friction and len(force) > PART:
        blocks = force[: len(force) // PART * PART].reshape(-1, PART)
        first = PART * int(np.argmax(blocks.std(axis=1)))
        part = slice(first, first + PART)
    log, still = (force[part], position[part], period), np.zeros((0, 2), int)
    known = dict(zip(model.names, theta if part.start is None else _first(model, *log), strict=True))
    late = float(known.get("delay", model.delay or 0.0))
    lates = dict.fromkeys([late, 0.0] if model.friction and model.delay is None else [late])
    best = None
    for delay, share in product(lates, (0.05, 0.3) if model.friction else (0.0,)):
        # It is held: a delay moves far as long as the other numbers are rough.
        held = replace(model, delay=delay)
        start = known | {"friction": share * float(np.std(log[0])), "delay": delay}
        theta_held = refined(held, np.array([start[name] for name in held.names]), *log, still)
        left = float(np.sum((positions(held, theta_held, log[0], period) - log[1]) ** 2))
        if best is None or left < best[0]:
            best = (left, start | dict(zip(held.names, theta_held, strict=True)))
    known = best[1]
    if part.start is None:
        return np.array([known[name] for name in model.names])
    whole = refined(model, np.array([known[name] for name in model.names]), *log, still)
    return np.where([name in ("start", "velocity") for name in model.names], theta, whole)


def _first(model, force, position, period):
    """Numbers to begin with: of each rate of decay and frequency tried the rest is linear; then delays with the best."""
    every = -(-len(force) // COARSE)
    whole = len(force) // every * every
    push, place, tick = force[:whole].reshape(-1, every).mean(axis=1), position[:whole:every], period * every
    tones = [(2 * np.pi * tone) ** 2 for tone in TONES if tone < 0.3 / tick] if model.spring else [0.0]
    held = (model.delay or 0.0) / every
    tried = [_beginning(push, place, tick, rate, square, held) for square in tones for rate in RATES]
    best = min(filter(None, tried), default=None)
    for near in (NEAR, NEAR**0.25) if best else ():  # of rates and frequencies between those tried, and of delays
        rates, squares = (near * best[2], near * best[3]) if model.spring else (near * best[2], [0.0])
        tried = [_beginning(push, place, tick, rate, square, best[4]) for square in squares for rate in rates]
        best = min([best, *filter(None, tried)])
        lates = [late / every for late in LATE] if model.delay is None else []
        best = min([best, *filter(None, [_beginning(push, place, tick, *best[2:4], late) for late in lates])])
    if best is None:
        raise UsageError(
            "no mass, however large or small, moves as the log says; is the sign of the force that of the position?"
        )
    _, mass, rate, square, late, start, velocity, offset = best
    known = {
        "log_mass": np.log(mass),
        "damping": rate * mass,
        "stiffness": square * mass,
        "friction": 0.05 * np.std(force),
        "delay": late * every,
        "start": start,
        "velocity": velocity,
        "offset": offset,
    }
    return np.array([known[name] for name in model.names])


def _beginning(push, place, tick, rate, square, late):
    """Squared error and numbers of the best mass, start, velocity and constant force; None if the mass would be negative."""
    model = Model(spring=True, delay=late)

    def moved(force, start, velocity, offset):
        return positions(model, np.array([0.0, rate, square, start, velocity, offset]), force, tick)

    none = np.zeros(len(push))
    with np.errstate(all="ignore"):
        columns = [moved(push, 0, 0, 0), moved(none, 1, 0, 0), moved(none, 0, 1, 0), moved(none, 0, 0, 1)]
    A = np.stack(columns, axis=1)
    size = np.linalg.norm(A, axis=0)
    if not np.isfinite(size).all() or not size.all():
        return None
    x = np.linalg.lstsq(A / size, place, rcond=1e-10)[0] / size
    if x[0] <= 0:
        return None
    return float(np.sum((A @ x - place) ** 2)), 1 / x[0], rate, square, late, x[1], x[2], x[3] / x[0]
