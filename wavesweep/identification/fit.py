"""The fit of a model to a log, and how far the encoder lets its numbers be known.

The likelihood is that of errors of the size of the encoder's rounding and of white noise. Rounding is no white noise: its error
is a sawtooth of the position, the same as long as the device rests. Its effect on the numbers is therefore found by itself:
the fitted motion is rounded again at many other places of the encoder's steps, with the noise that is left, and each error is
carried through the fit. A stretch in which the device stays within a step, at rest or at a turn, counts as one reading.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from wavesweep.errors import UsageError
from wavesweep.identification.model import Model, positions, sensitivities

PLACES = (64, 200)  # of the encoder's steps, at which the motion is rounded again; the fewest in long logs
LONG = 6_000_000  # samples at all places together, for which there are fewer
DEVIATIONS = 1.96  # of a normal distribution: 95 % of the errors
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

    theta: the numbers of `model.names`; half: half the widths of their intervals. positions: fitted (m). motion: the same, at
    rest where the readings are. residual: what is left (m). weights: of the samples, 1 or less. basis: orthonormal,
    `(ticks, numbers)`: what the fit takes of weighted errors. noise: standard deviation of the white noise beside rounding (m).
    resolution: step of the encoder (m), 0 for none.
    """

    model: Model
    theta: np.ndarray
    half: np.ndarray
    positions: np.ndarray
    motion: np.ndarray
    weights: np.ndarray
    noise: float
    resolution: float
    basis: np.ndarray
    residual: np.ndarray

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by their names."""
        return self.model.numbers(self.theta)


def fitted(model: Model, force: np.ndarray, position: np.ndarray, period: float, resolution: float, start=None) -> Fit:
    """Fit a model to a log. force: N, held over each tick. position: m. period: s. resolution: step of the encoder (m)."""
    if model.friction:
        model = replace(model, without=tuple(_hidden(model, position)))
    weights = np.ones(len(force))
    theta = _begun(model, force, position, period) if start is None else start
    theta = refined(model, theta, force, position, period, weights)
    noise = 0.0
    for _ in range(2):
        found = positions(model, theta, force, period)
        before = noise
        noise = _noise(position - found, resolution, weights)
        new = _weights(found, resolution) if noise < DITHERED * resolution else np.ones(len(force))
        if np.array_equal(new, weights) and before == noise:
            break
        weights = new
        theta = refined(model, theta, force, position, period, weights)
    found = positions(model, theta, force, period)
    J = sensitivities(model, theta, force, period, scales(model, theta, force, position, period))
    root = np.sqrt(weights)[:, None]
    size = np.linalg.norm(root * J, axis=0)
    size[size == 0] = 1.0
    basis, upper = np.linalg.qr(root * J / size)
    residual = position - found
    noise = _noise(residual, resolution, weights, len(theta))
    inverse = np.linalg.pinv(upper) / size[:, None]
    motion = _rested(found, position, weights)
    moved = [basis.T @ (root[:, 0] * e) for e in likely_errors(motion, resolution, noise, places_of(found, *PLACES))]
    half = DEVIATIONS * (inverse @ np.array(moved).T).std(axis=1)
    return Fit(model, theta, half, found, motion, weights, noise, resolution, basis, residual)


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


def likely_errors(found: np.ndarray, resolution: float, noise: float, places: int) -> Iterator[np.ndarray]:
    """Yield the errors of readings of this motion at so many places of the encoder's steps, with white noise."""
    source = np.random.default_rng(0)
    for place in range(places):
        true = found + resolution * place / places
        read = true + noise * source.standard_normal(len(found)) if noise else true
        yield (resolution * np.floor(read / resolution + 0.5) if resolution else read) - true


def _noise(residual, resolution, weights, numbers=0):
    """Standard deviation of white noise that explains what is left beside rounding."""
    total = np.sum(weights * residual**2) / max(np.sum(weights) - numbers, 1.0)
    rounding = resolution**2 / 12
    # Rounding alone scatters a little around its mean.
    return float(np.sqrt(total - rounding)) if total > 1.1 * rounding else 0.0


def _weights(found, resolution):
    """1, but of a stretch around a turn within half a step the share of each sample in one reading."""
    if not resolution:
        return np.ones(len(found))
    moves = np.sign(np.diff(found))
    turns = np.concatenate([[0], np.flatnonzero(moves[1:] != moves[:-1]) + 1, [len(found) - 1]])
    at = np.arange(len(found))
    after = np.minimum(np.searchsorted(turns, at), len(turns) - 1)
    before = np.maximum(np.searchsorted(turns, at, side="right") - 1, 0)
    near = [np.abs(found - found[turns[each]]) < resolution / 2 for each in (before, after)]
    weights = np.ones(len(found))
    for first, last in _stretches(near[0] | near[1]):
        weights[first:last] = 1 / (last - first)
    return weights


def _rested(found, position, weights):
    """The motion, at rest where the log begins or ends within a step or has one reading: the fit may drift there a little."""
    motion = found.copy()
    for first, last in _stretches(weights < 1):
        if first == 0 or last == len(found) or np.ptp(position[first:last]) == 0:
            motion[first:last] = found[first:last].mean()
    return motion


def _stretches(masked):
    """Pairs of the first and the last index, plus one, of the stretches in which a mask holds."""
    return np.flatnonzero(np.diff(np.concatenate([[0], masked.astype(int), [0]]))).reshape(-1, 2)


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


def refined(model: Model, theta: np.ndarray, force, position, period: float, weights: np.ndarray) -> np.ndarray:
    """The numbers of the least weighted squares, from others near by."""
    size = scales(model, theta, force, position, period)
    root, reach = np.sqrt(weights), float(np.ptp(position))

    def off(part):
        with np.errstate(all="ignore"):
            left = root * (positions(model, theta + (part - 1) * size, force, period) - position) / reach
        return np.nan_to_num(np.clip(left, -1e6, 1e6), nan=1e6)

    def slopes(part):
        with np.errstate(all="ignore"):
            found = sensitivities(model, theta + (part - 1) * size, force, period, size)
        return np.nan_to_num(root[:, None] * found * size / reach, posinf=1e6, neginf=-1e6)

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
    log, weights = (force[part], position[part], period), np.ones(len(force[part]))
    if part.start is not None:
        known = dict(zip(model.names, _first(model, *log), strict=True))
    else:
        known = dict(zip(model.names, theta, strict=True))
    held = replace(model, delay=float(known["delay"]))  # a delay moves far as long as the other numbers are rough
    rubbing = (0.05, 0.3) if model.friction else (0.0,)
    best = None
    for delay, share in product(
        dict.fromkeys([held.delay, 0.0]) if model.friction and model.delay is None else [held.delay], rubbing
    ):
        held = replace(model, delay=delay)
        start = known | {"friction": share * float(np.std(log[0])), "delay": delay}
        theta_held = refined(held, np.array([start[name] for name in held.names]), *log, weights)
        left = float(np.sum((positions(held, theta_held, log[0], period) - log[1]) ** 2))
        if best is None or left < best[0]:
            best = (left, start | dict(zip(held.names, theta_held, strict=True)))
    known = best[1]
    if part.start is None:
        return np.array([known[name] for name in model.names])
    whole = refined(model, np.array([known[name] for name in model.names]), *log, weights)
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
