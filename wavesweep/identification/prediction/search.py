"""The search for the numbers in which innovations are not linear: a look at a grid, then least
squares."""

import logging
from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from wavesweep.engine.errors import UsageError
from wavesweep.identification.prediction.innovations import errors_of, projected
from wavesweep.identification.prediction.scaled_log import ScaledLog

# what a fit is at, which a command shows
FIT_LOGGER = logging.getLogger("wavesweep.proof.fit")
FEWEST, MOST = -2.0, 20.0  # ticks of delay
ROUGH, DELAYS = (-1.0, 1.0, 3.0, 7.0), np.arange(FEWEST, MOST + 0.5, 0.5)  # tried first, and then
RATES = (1.0, 20.0)  # damping over mass (1/s), tried first
HIGHEST_DECADE = 8.0  # decade of a variance
SPARE_ROWS = 4  # rows that are left out beyond the delay
# speeds at which friction turns round, over the slowest
SHARPEST, TURNING_TRIED = 1e-4, (1e-3, 0.01, 0.1, 0.3, 1.0, 3.0)
NO_MASS = (
    "the force does not show in the position: no mass, however large or small, fits better than none; record a pulse, a chirp "
    "or noise that moves the device by many steps of its encoder"
)
OTHER_SIGN = (
    "the position moves against the force, as a mass below 0 would; --scale force=-1 turns its sign"
)


class Place(NamedTuple):
    """A point of a search in a log, of which the first `skip` rows are left out."""

    log: ScaledLog
    search: "Search"
    point: np.ndarray
    skip: int


class Search:
    """The numbers that are searched: their names, a point, sizes and bounds, all of them arrays."""

    def __init__(self, log: ScaledLog, begun: Mapping[str, float]) -> None:
        model = log.model
        rows = len(log.reading)
        rate = max(abs(begun["rate"]), 2.0)
        fastest = 0.5 / log.period
        lowest = _least_variances(rows)
        entries = {"rate": (begun["rate"], rate, -50.0 - 50.0 / (rows * log.period), fastest)}
        if model.spring:
            entries["square"] = (begun["square"], max(begun["square"], 1.0), -np.inf, np.inf)
        if model.load:
            entries["log_share"] = (np.log(begun["share"]), 0.2, -7.0, 7.0)
            entries["load_rate"] = (begun["load_rate"], rate, -fastest, fastest)
            highest = 2 * np.log(3.0 / log.period)
            entries["log_square"] = (np.log(begun["square"]), 0.2, -np.inf, highest)
            loss = begun["coupling_rate"]
            entries["coupling_rate"] = (loss, max(loss, rate) / 2, -fastest, fastest)
        if model.delay is None:
            entries["delay"] = (begun["delay"], 0.5, FEWEST, MOST)
        if model.measured != "acceleration":
            entries["white"] = (np.log10(begun["white"]), 1.0, lowest[0], HIGHEST_DECADE)
            entries["drift"] = (np.log10(begun["drift"]), 1.5, lowest[1], HIGHEST_DECADE)
        if model.friction:
            usual = float(log.speeds.std())
            least = np.log(SHARPEST * log.slowest)
            entries["turning"] = (np.log(begun["turning"]), 0.7, least, np.log(usual))
            if "fading" in begun:
                # Times the slowest turn: the least speed at which friction fades.
                least = np.log(10.0 * log.slowest)
                entries["fading"] = (np.log(begun["fading"]), 0.7, least, np.log(3 * usual))
        self.names = tuple(entries)
        self.begun, self.size, self.low, self.high = np.array(list(entries.values())).T
        self.fixed = {"square": 0.0, "delay": model.delay or 0.0, "white": 0.0, "drift": 0.0}

    def found(self, point: np.ndarray) -> dict[str, float]:
        """The numbers of a point by their names."""
        numbers = self.fixed | dict(zip(self.names, point.tolist(), strict=True))
        for name in ("white", "drift"):
            if name in self.names:
                numbers[name] = 10 ** numbers[name]
        for name in ("turning", "fading"):
            if name in numbers:
                numbers[name] = float(np.exp(numbers[name]))
        if "log_share" in numbers:
            numbers["share"] = float(np.exp(numbers["log_share"]))
            numbers["square"] = float(np.exp(numbers["log_square"]))
        return numbers


def _least_variances(rows):
    """Decades of the variances of forces, below which nothing of them shows in so many rows."""
    return 4 * np.log10(2 / rows), 6 * np.log10(2 / rows)


def begun_at(log: ScaledLog, near: Mapping[str, float] | None) -> dict[str, float]:
    """The best of a grid of numbers; with those of a smaller model, near these."""
    model = log.model
    least = _least_variances(len(log.reading))
    rough, delays = (ROUGH, DELAYS) if model.delay is None else ((model.delay,), (model.delay,))
    squares = [0.0]
    if model.spring:
        # Frequencies of a spring (Hz), tried first.
        squares = [
            (2 * np.pi * tone) ** 2
            for tone in (0.3, 1.0, 3.0, 10.0, 30.0)
            if tone * log.period < 0.2
        ]
    # Decades of the variances that are tried first.
    whites = [10 ** max(decade, least[0]) for decade in (-8.0, -4.0, 0.0, 4.0)]
    drifts = [10 ** max(decade, least[1]) for decade in (-14.0, -10.0, -7.0, -4.0, -1.0)]
    if model.measured == "acceleration":
        whites = drifts = [0.0]
    look = _FirstLook(log, SPARE_ROWS + int(max(0.0, *delays)))
    if near is not None:
        look.around(near, square=[near["square"], *squares], delay=[near["delay"], *delays])
        if not look.best:
            raise UsageError(NO_MASS)
        return look.best
    look.at(RATES, squares, rough, whites[:3], drifts[1:2])
    if not look.best:
        look.at(RATES, squares, delays[::2], whites, drifts[::2])
    if not look.best:
        raise UsageError(OTHER_SIGN if look.sign > 10.0 else NO_MASS)
    look.around(look.best, square=squares, delay=delays)
    whites = [look.best["white"] * ratio for ratio in (1e-2, 1.0, 1e2)]
    look.around(look.best, white=whites, drift=drifts)
    return look.best


class _FirstLook:
    """Places of a grid that were tried for a log.

    best: the numbers with a mass whose errors are least; error: the sum of their squares. sign: how
    many times its noise a negative mass was.
    """

    def __init__(self, log: ScaledLog, skip: int) -> None:
        self.log = log
        self.skip = skip
        self.best: dict[str, float] = {}
        self.error = np.inf
        self.sign = 0.0

    def around(self, numbers, **changed):
        """Try what is given, with the other numbers as they are."""
        values = {name: [numbers[name]] for name in ("rate", "square", "delay", "white", "drift")}
        self.at(*(values | changed).values())

    def at(self, rates, squares, delays, whites, drifts):
        """Try all combinations."""
        places = list(product(rates, squares, whites, drifts, delays))
        for number, (rate, square, white, drift, delay) in enumerate(places, 1):
            FIT_LOGGER.info("a first look at %d of %d places", number, len(places))
            numbers = {
                "rate": rate,
                "square": square,
                "delay": delay,
                "white": white,
                "drift": drift,
                "turning": self.log.slowest,
            }
            with np.errstate(all="ignore"):
                _, errors, effects = errors_of(self.log, numbers, self.skip)
                gains, innovations = projected(errors, effects)
            # Errors are compared as those of predictions.
            error = float(innovations @ innovations)
            if not np.isfinite(error):
                continue
            if gains[0] > 0 and error < self.error:
                self.error = error
                self.best = numbers
            if gains[0] < 0:
                noise = np.sqrt(error / len(innovations)) / np.linalg.norm(effects[0])
                self.sign = max(self.sign, -gains[0] / noise)


def least_of(log, search, point, skip, most_steps):
    """The point with the least sum of squares of innovations, from another one."""
    scale = None

    def residual(scaled):
        """The innovations that the best gains leave, `(rows,)`, over their standard deviation at
        the first point that has any; 1e6 where there are none."""
        nonlocal scale
        with np.errstate(all="ignore"):
            try:
                _, errors, effects = errors_of(log, search.found(scaled * search.size), skip)
            except np.linalg.LinAlgError:
                return np.full(len(log.reading) - skip, 1e6)
            # Squares of larger ones are no doubles.
            usable = np.abs(errors).max() < 1e150 and np.abs(effects).max() < 1e150
            if not usable:
                return np.full(len(log.reading) - skip, 1e6)
            gains, rest = projected(errors, effects)
            if not gains[0] > 0:  # it is 1/mass, and no mass is negative: all errors stay
                rest = errors
        # of all points of the search, so that their sums of squares compare
        scale = scale or float(rest.std())
        return np.clip(rest / scale, -1e6, 1e6)

    FIT_LOGGER.info("looking for the least errors, in up to %d steps", most_steps)
    low = search.low / search.size
    high = search.high / search.size
    start = np.clip(point / search.size, low + 1e-6, high - 1e-6)
    limits = {"xtol": 1e-4, "ftol": 1e-6, "gtol": None, "max_nfev": most_steps}

    def least_from(start):
        # A number without any effect, as the variance of a walk that is not there, would take a step
        # to its bound, and cut those of all others.
        def tethered(scaled):
            # Standard deviations by which a size of a number costs errors as it moves.
            return np.append(residual(scaled), 1e-2 * (scaled - start))

        solution = least_squares(
            tethered, start, "2-point", bounds=(low, high), diff_step=1e-5, **limits
        )
        return solution.x

    best = least_from(start)
    # At a whole number of ticks the errors have a kink, behind which there may be a lower minimum.
    if "delay" in search.names:
        index = search.names.index("delay")
        tried = [best]
        # Ticks of delay from a minimum, tried as well.
        for ticks in (-0.5, -0.25, -0.1, 0.1, 0.25, 0.5):
            neighbour = best.copy()
            neighbour[index] = np.clip(
                best[index] + ticks / search.size[index], low[index] + 1e-6, high[index] - 1e-6
            )
            tried.append(neighbour)
        lowest = min(tried, key=lambda each: float(np.sum(residual(each) ** 2)))
        if lowest is not best:
            best = least_from(lowest)
    return best * search.size
