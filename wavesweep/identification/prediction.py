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

import logging
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.optimize import least_squares
from scipy.signal import savgol_filter
from scipy.special import erf, spence, stdtrit

from wavesweep.engine.doubles import NEXT_TO_ZERO
from wavesweep.engine.errors import UsageError
from wavesweep.identification.model import ORDER, OWN, Model, late, of_modes, resonance
from wavesweep.identification.predictor import Predictor, tick_of

# what a fit is at, which a command shows
FIT_LOGGER = logging.getLogger("wavesweep.proof.fit")
PART = 6000  # rows with the largest forces, from which a long log's numbers are found first
WIDTHS = (2, 4, 8, 16, 32, 64)  # rows to either side, over which a first velocity is smoothed
ONE_WAY = 0.98  # share of the motion one way above which friction is a constant force
CLEAR_OF_NOISE = 6.0  # times the noise of a velocity, below which a twentieth of its size has to be
FEWEST, MOST = -2.0, 20.0  # ticks of delay
ROUGH, DELAYS = (-1.0, 1.0, 3.0, 7.0), np.arange(FEWEST, MOST + 0.5, 0.5)  # tried first, and then
RATES = (1.0, 20.0)  # damping over mass (1/s), tried first
HIGHEST_DECADE = 8.0  # decade of a variance
SPARE_ROWS = 4  # rows that are left out beyond the delay
DIFFERENCE = 1e-3  # of the size of a number, of central differences
SMOOTHER_PASSES = 6  # at most
# speeds at which friction turns round, over the slowest
SHARPEST, TURNING_TRIED = 1e-4, (1e-3, 0.01, 0.1, 0.3, 1.0, 3.0)
BLOCKS = (10, 20)
LARGE_INNOVATION = 3.0  # standard deviations beyond which an innovation is large
CHANGED, CHANGED_OF_TWO = 20_000, 6_000  # rows at most, with which they are changed; of two masses
NORMAL = 1.96  # standard deviations of 95 %
# numbers on which the filter depends
FILTERING = ("rate", "square", "share", "load_rate", "coupling_rate", "white", "drift")
RESONANCES, RINGING = 150, 0.03  # frequencies of a resonance that are tried, and its damping ratio
# variances, white and of the walk, of the filters through which they are looked for
FILTERS = ((1e-2, 1e-6), (1e-5, 1e-9))
# logarithm of the odds by which two masses have to explain the innovations better than one, a model
# with one more effect better than without, and a round of the smoother better than the one before
LIKELIER = 15.0
LARGEST = 1e150  # innovations that are squared
OUTLIER_SHARE = 0.02  # share of the rows that may be outliers; more are not

NO_MASS = (
    "the force does not show in the position: no mass, however large or small, fits better than none; record a pulse, a chirp "
    "or noise that moves the device by many steps of its encoder"
)
NO_RESONANCE = (
    "no resonance of two masses on a spring shows for certain: record a chirp or noise through the resonance, with more force, "
    "or leave --two-masses out"
)
NO_FRICTION = (
    "expected a friction of at least 0, found {friction:.2g} N at most: the force against the motion grows with speed by more "
    "than a line, as a drag does; leave --friction out"
)
OTHER_SIGN = (
    "the position moves against the force, as a mass below 0 would; --scale force=-1 turns its sign"
)


@dataclass(frozen=True, eq=False)
class ScaledLog:
    """A log in units of its own: ticks, `unit` for what is read (m, m/s or m/s^2), `pushed` for
    forces (N).

    speeds: velocity per tick at each row, for friction, which turns round at `slowest` or more.
    path: the velocity within the ticks; None for straight lines. moving: 0 while it rests.
    one_way: there is friction, and the device moves one way only, so that a constant force would do
    the same. beside: forces of unit size that act as well, whose gains are fitted, as means over
    each tick, see `side`; gains of the first `coupled` of them are numbers of the device. The last
    values that `remembered` made are kept: a search asks for most of them again with one other
    number.
    """

    model: Model
    force: np.ndarray
    reading: np.ndarray
    period: float
    unit: float
    pushed: float
    moving: np.ndarray | float = 1.0
    speeds: np.ndarray | None = None
    slowest: float = 0.0
    path: "Path | None" = None
    one_way: bool = False
    beside: tuple[np.ndarray, ...] = ()
    coupled: int = 0
    _kept: dict[Hashable, Any] = field(init=False, default_factory=dict, repr=False)

    def remembered(self, key: Hashable, make: Callable[[], Any]) -> Any:
        """What `make` gives for a key."""
        if key not in self._kept:
            if len(self._kept) == 8:  # values that a log remembers
                del self._kept[next(iter(self._kept))]
            self._kept[key] = make()
        return self._kept[key]

    def part(self, first: int, end: int) -> "ScaledLog":
        """Some of its rows."""
        few = replace(
            self, force=self.force[first:end], reading=self.reading[first:end] - self.reading[first]
        )
        few = replace(few, beside=tuple(force[:, first:end] for force in self.beside))
        if self.speeds is not None:
            few = replace(few, moving=self.moving[first:end], speeds=self.speeds[first:end])
        if self.path is not None:
            few = replace(few, path=Path(*(each[..., first:end] for each in self.path)))
        return few

    def side(self, turning: float, fading: float = np.inf) -> np.ndarray:
        """The means of F = tanh(v/turning) exp(-(w/fading)^2) over each tick, in which the velocity
        is a straight line, or several of them; and those of (1/2 - t) F, t of a tick after its
        start: `(2, rows)`.

        w is turning log cosh(v/turning), which is |v| but for the turn: so there is a primitive.
        """
        return self.remembered(("side", turning, fading), lambda: self._side(turning, fading))

    def _side(self, turning, fading):
        if self.path is None:
            means, changes = _along_line(self.speeds, _next(self.speeds), turning, fading)
            return self.moving * np.stack([means, -changes / 12])
        ends = self.path.speeds
        means, changes = _along_line(ends[:-1], ends[1:], turning, fading)
        holds = ~np.isnan(self.path.held)
        means = np.where(holds, self.path.held, means)
        return self.moving * self.path.over_tick(means, np.where(holds, 0.0, changes))


def _along_line(now, then, turning, fading):
    """The mean of the F of `ScaledLog.side` over velocities on a straight line from a to b, and the
    change of the force on a straight line that has its lever: of (1/2 - s) F, s from 0 to 1.

    With primitives P of tanh(v/turning) and Q of P, that of (1/2 - s) tanh is
    (Q(b) - Q(a))/(b - a)^2 - (P(a) + P(b))/2/(b - a); a line from f to g has -(g - f)/12. What is
    missing beside a device that turns round is at the turn, and not all over the line.
    """
    change = then - now
    middle = (now + then) / 2
    straight = np.abs(change) > 1e-3 * turning
    over = np.where(straight, change, 1.0)
    ways = [turning * _log_cosh(speed / turning) for speed in (now, then)]
    way = turning * _log_cosh(middle / turning)
    areas = [turning**2 * _area_of_log_cosh(speed / turning) for speed in (now, then)]
    lever = (areas[1] - areas[0]) / over**2 - (ways[0] + ways[1]) / (2 * over)
    side = np.tanh(middle / turning)
    changes = np.where(straight, -12 * lever, (1 - side**2) * change / turning)
    if fading == np.inf:
        return np.where(straight, (ways[1] - ways[0]) / over, side), changes
    primitives = [np.sqrt(np.pi) / 2 * fading * erf(each / fading) for each in ways]
    left = [np.exp(-((each / fading) ** 2)) for each in (*ways, way)]
    means = np.where(straight, (primitives[1] - primitives[0]) / over, side * left[2])
    return means, changes * left[2] + side * (left[1] - left[0])


def _next(signal):
    """The signal a tick later; the last value stays."""
    return np.append(signal[1:], signal[-1])


class Path(NamedTuple):
    """The velocity within each tick, in four parts: before and after the force of the log changes,
    and each of these before and after the device turns round, or stops.

    lengths: of the parts, in ticks, `(4, rows)`. speeds: at their ends, `(5, rows)`. decay: by how
    much of itself the acceleration falls in a tick, as damping has it, `(rows,)`. held: the share
    of its largest that friction bears in a part in which it holds the device, NaN in others, `(4,
    rows)`.
    """

    lengths: np.ndarray
    speeds: np.ndarray
    decay: np.ndarray
    held: np.ndarray

    @property
    def middles(self) -> np.ndarray:
        """The velocities in the middle of the parts, `(4, rows)`.

        From a to b in L ticks at an acceleration that falls by d in a tick, the velocity is above
        the straight line by d (b - a) L/8 in the middle.
        """
        first = self.speeds[:-1]
        last = self.speeds[1:]
        return (first + last) / 2 + self.decay * self.lengths * (last - first) / 8

    def over_tick(self, means: np.ndarray, changes: np.ndarray | float) -> np.ndarray:
        """The means over a tick of a force f and of (1/2 - t) f, `(2, rows)`.

        means: of f in the parts. changes: of f from the start of a part to its end; on a straight
        line over a length L, (middle - t) f has the integral -L^2/12 of this.
        """
        middles = np.cumsum(self.lengths, axis=0) - self.lengths / 2
        impulses = self.lengths * means
        within = self.lengths**2 * changes / 12
        moments = (0.5 - middles) * impulses - within
        return np.stack([impulses.sum(axis=0), moments.sum(axis=0)])


class Place(NamedTuple):
    """A point of a search in a log, of which the first `skip` rows are left out."""

    log: ScaledLog
    search: "Search"
    point: np.ndarray
    skip: int


class StaticFriction(NamedTuple):
    """The friction at rest (N), which falls to that of the model as exp(-(v/speed)^2); speed:
    that of Stribeck (m/s)."""

    force: float
    speed: float


@dataclass(frozen=True, eq=False)
class Prediction:
    """The numbers `theta` of `model.names`, none of the log alone, and half the widths of their
    intervals.

    left: innovations, in the unit of the reading, from row `skip` on; used: false for those of
    outliers. noise: of the reading alone. walked: the rms of the force that is not in the log (N),
    from a smoother. correlation: of neighbouring innovations. searched: the numbers of the search
    by their names. static: None if friction is a line. place: where the search ended.
    """

    model: Model
    theta: np.ndarray
    half: np.ndarray
    left: np.ndarray
    used: np.ndarray
    skip: int
    noise: float
    walked: float
    correlation: float
    searched: Mapping[str, float]
    static: StaticFriction | None
    place: "Place"

    @property
    def numbers(self) -> dict[str, float]:
        """All numbers by their names."""
        return self.model.numbers(self.theta)


def _log_cosh(x):
    """log(2 cosh x)."""
    return np.abs(x) + np.log1p(np.exp(-2 * np.abs(x)))


def _area_of_log_cosh(x):
    """The integral of `_log_cosh` from 0 to x."""
    size = np.abs(x)
    beyond = spence(1 + np.exp(-2 * size)) / 2 + np.pi**2 / 24  # Li_2(-z) is spence(1 + z)
    return np.sign(x) * (size**2 / 2 + beyond)


def scaled(
    model: Model, force: np.ndarray, reading: np.ndarray, period: float, resolution: float
) -> ScaledLog:
    """A log in the units of the fit. resolution: step of the readings, 0 for none."""
    unit = max(resolution / np.sqrt(12), 1e-8 * float(np.ptp(reading)))
    pushed = float(np.std(force))
    log = ScaledLog(model, force / pushed, (reading - reading[0]) / unit, period, unit, pushed)
    if not model.friction:
        return log
    order = ORDER[model.measured]
    for width in WIDTHS:
        if 2 * width + 1 > len(force) // 20 and width > WIDTHS[0]:
            break
        if order < 2:
            speeds = savgol_filter(log.reading, 2 * width + 1, 2, deriv=1 - order)
        else:
            speeds = np.cumsum(log.reading)
        noise = 3 * np.sqrt(3 / (2 * width**3 + 3 * width**2 + width))
        used = width
        if CLEAR_OF_NOISE / 3 * noise < 0.05 * speeds.std():
            break
    moving = np.ones(len(force))
    if model.measured == "position":
        near = max(2 * used + 1, 9)
        span = maximum_filter1d(log.reading, near) - minimum_filter1d(log.reading, near)
        moving[(span <= 1.01 * resolution / unit) & (np.abs(speeds) < noise)] = 0.0
    one_way = not model.spring and abs(speeds.sum()) > ONE_WAY * np.abs(speeds).sum()
    return replace(
        log,
        speeds=speeds,
        moving=moving,
        # Of the usual velocity, at which friction turns round first.
        slowest=max(noise, 5e-3 * float(speeds.std())),
        one_way=bool(one_way),
    )


def errors_of(log: ScaledLog, found: Mapping[str, float], skip: int):
    """The predictor of some numbers, the innovations of the readings alone, and what unit gains add
    to them.

    The last are `(gains, rows)`.
    """

    def filtered():
        tick = tick_of(log.model, found, log.period)
        rows = len(log.reading) - skip
        predictor = Predictor(tick, found["white"], found["drift"], rows, log.one_way)
        return predictor, predictor.innovations(log.reading, skip)

    filter_numbers = tuple(found[name] for name in FILTERING if name in found)
    predictor, errors = log.remembered((skip, *filter_numbers), filtered)
    effects = [predictor.effect(parts, skip) for parts in _pushes(log, found, predictor.tick)]
    return predictor, errors, np.stack(effects)


def _pushes(log, found, tick):
    """The effects of unit gains: of the force over the mass and, with friction, of that of
    friction."""
    whole_ticks = int(np.floor(found["delay"]))
    now = late(log.force, whole_ticks) * log.moving
    before = late(log.force, whole_ticks + 1) * log.moving
    begun = tick.begun(found["delay"] - whole_ticks)
    pushes = [[(begun, now), (tick.held - begun, before)]]
    if log.model.friction:
        pushes.append(_spread(tick, -log.side(found["turning"])))
        if "fading" in found:
            pushes.append(_spread(tick, -log.side(found["turning"], found["fading"])))
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
            entries["log_square"] = (
                np.log(begun["square"]),
                0.2,
                -np.inf,
                2 * np.log(3.0 / log.period),
            )
            entries["coupling_rate"] = (
                begun["coupling_rate"],
                max(begun["coupling_rate"], rate) / 2,
                -fastest,
                fastest,
            )
        if model.delay is None:
            entries["delay"] = (begun["delay"], 0.5, FEWEST, MOST)
        if model.measured != "acceleration":
            entries["white"] = (np.log10(begun["white"]), 1.0, lowest[0], HIGHEST_DECADE)
            entries["drift"] = (np.log10(begun["drift"]), 1.5, lowest[1], HIGHEST_DECADE)
        if model.friction:
            usual = float(log.speeds.std())
            entries["turning"] = (
                np.log(begun["turning"]),
                0.7,
                np.log(SHARPEST * log.slowest),
                np.log(usual),
            )
            if "fading" in begun:
                entries["fading"] = (
                    np.log(begun["fading"]),
                    0.7,
                    # Times the slowest turn: the least speed at which friction fades.
                    np.log(10.0 * log.slowest),
                    np.log(3 * usual),
                )
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
    wild = _spikes(reading, resolution)
    between = np.interp(np.arange(len(reading)), np.flatnonzero(~wild), reading[~wild])
    whole = scaled(model, force, between, period, resolution)
    beside = tuple(-each / whole.pushed for each in coupled)
    whole = replace(whole, beside=beside, coupled=len(beside))
    log = whole
    rows = 3000 if model.load else PART  # half as many of two masses
    if len(force) > rows:
        sizes = whole.force[: len(force) // rows * rows].reshape(-1, rows).std(axis=1)
        first = rows * int(np.argmax(sizes))
        log = whole.part(first, first + rows)
    search, point, skip = _near(log, whole)
    if log is not whole:
        point = least_of(whole, search, point, skip, 5)
    rounds = _Rounds(whole, point)
    if model.friction:
        rounds = _smoothing(rounds, search, skip)
        curved = None if coupled else _with_curve(rounds.log, search, rounds.point, skip)
        if curved is not None:
            line = rounds.before
            search, point = curved
            rounds = _smoothing(_Rounds(rounds.log, point), search, skip)
            # What the form of friction does to mass and delay shows how well it tells them.
            of_form = [name in ("log_mass", "delay") for name in model.names if name not in OWN]
            rounds = rounds._replace(
                moved=np.maximum(rounds.moved, of_form * np.abs(rounds.before - line))
            )
    found = estimated_at(rounds.log, search, rounds.point, skip, rounds.before, rounds.moved)
    return replace(found, used=~wild[skip:])


def refuse_friction_below_zero(found: Prediction) -> None:
    """Raise UsageError if a fit has a friction below 0."""
    if not found.model.friction:
        return
    at = found.model.names.index("friction")
    most = float(found.theta[at] + found.half[at])
    if most < 0:
        raise UsageError(NO_FRICTION.format(friction=most))


class _Rounds(NamedTuple):
    """A log with the velocities of the smoother, the point of a search, and by how much the last
    round moved the numbers."""

    log: ScaledLog
    point: np.ndarray
    before: np.ndarray | None = None
    moved: np.ndarray | float = 0.0


def _smoothing(rounds, search, skip):
    """Rounds of a smoother that gives the velocity, and of a search with the friction at this
    velocity."""
    log, point, before, moved = rounds
    still = log.moving == 0.0
    square = np.inf
    passed = log, point
    for number in range(1, 1 + SMOOTHER_PASSES):
        FIT_LOGGER.info(
            "friction along the motion, round %d of at most %d", number, SMOOTHER_PASSES
        )
        predictor, errors, effects = errors_of(log, search.found(point), skip)
        gains, left = projected(errors, effects)
        if not gains[0] > 0:
            break
        now = theta_of(log, search.found(point), gains)
        if before is not None:
            moved = np.abs(now - before)
        before = now
        previous = square
        square = float(np.mean(left**2))
        likelier = len(left) / 2 * np.log(previous / square)
        if number > 2 and likelier < LIKELIER:  # passes of the smoother, at least
            if square > previous:
                log, point = passed
            break
        passed = log, point
        found = search.found(point)
        states = smoothed_states(log, predictor, found, gains, skip)
        speeds = states[predictor.tick.speed]
        if not np.corrcoef(speeds, log.speeds)[0, 1] > 0.5:
            break
        # No device rests under a force above its friction, though its encoder may stand still.
        held = np.abs(_forces(log, found, gains, states[-1])).max(axis=0) <= _rest(found, gains)
        log = replace(log, moving=np.where(still & held, 0.0, 1.0))
        path = path_within_ticks(log, found, gains, speeds, walk=states[-1])
        log = replace(log, speeds=speeds, path=path)
        # A search from far above the speed at which friction turns round does not get there.
        at = search.names.index("turning")
        tried = [point]
        for ratio in TURNING_TRIED:
            other = point.copy()
            other[at] = np.log(ratio * log.slowest)
            tried.append(other)
        point = min(tried, key=lambda each: _square(log, search, each, skip))
        point = least_of(log, search, point, skip, 8)
    return _Rounds(log, point, before, moved)


def _with_curve(log, search, point, skip):
    """A search with friction that falls with speed (Stribeck), and its point; None if it does
    not explain the log better."""
    log = log.part(0, CHANGED)  # so many rows show it
    without = _square(log, search, point, skip)
    if not np.isfinite(without):
        return None
    begun = search.found(point)
    tried = []
    # Speeds at which static friction fades, over the usual one, tried first.
    for share in (0.1, 0.3, 1.0):
        curved = Search(log, begun | {"fading": share * float(log.speeds.std())})
        tried.append((_square(log, curved, curved.begun, skip), curved))
    _, curved = min(tried, key=itemgetter(0))
    point = least_of(log, curved, curved.begun, skip, 8)
    _, errors, effects = errors_of(log, curved.found(point), skip)
    _, sliding, fades = projected(errors, effects)[0]
    falls = sliding > 0 and fades > 0.1 * sliding  # it has to fall with speed by a tenth
    enough = _square(log, curved, point, skip) < without * np.exp(-2 * LIKELIER / len(log.reading))
    if falls and enough:
        return (curved, point)
    return None


def _spikes(reading, resolution):
    """Which readings are far to one side of both neighbours, which are near to each other and to
    their own: outliers.

    A velocity under a force that turns round is as far from its neighbours, but so are these from
    theirs.
    """
    change = np.diff(reading)
    before = change[:-1]
    after = -change[1:]
    usual = np.median(np.abs(before + after)) / 0.6745
    height = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    around = np.abs(np.pad(change, 1))
    alone = np.maximum(np.abs(before - after), np.maximum(around[:-3], around[3:])) < 0.5 * height
    # Standard deviations of a second difference, beyond which a single reading is an outlier.
    spikes = np.pad(alone & (height > max(20.0 * usual, 3 * resolution)), 1)
    if spikes.mean() < OUTLIER_SHARE:
        return spikes
    return np.zeros(len(reading), bool)


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
    found = search.found(point)
    _, errors, effects = errors_of(log, found, skip)
    gains, left = projected(errors, effects)
    if model.friction and gains[1] < 0:  # a drag, which no friction explains
        return Innovations(np.inf, np.inf, float("nan"))
    tone_hz = float("nan")
    if model.load:
        tone_hz = float(np.sqrt(found["square"] * (1 + 1 / found["share"]))) / (2 * np.pi)
    return Innovations(
        float(left.std()) * log.unit, force_beside(log, search, point, skip), tone_hz
    )


def _near(log, whole, near=None):
    """The search, its best point for `log`, a part of the whole log, and the rows that are left
    out.

    near: numbers of a smaller model to begin with.
    """
    if not log.model.load:
        begun = _begun(log, near)
        skip = int(max(begun["delay"], 0.0)) + SPARE_ROWS
        search = Search(whole, begun)
        return search, least_of(log, search, search.begun, skip, 20), skip
    alone = replace(log, model=replace(log.model, load=False))
    begun = _begun(alone, near)
    search = Search(alone, begun)
    skip = int(max(begun["delay"], 0.0)) + SPARE_ROWS
    point = least_of(alone, search, search.begun, skip, 20)
    without = _square(alone, search, point, skip)
    skip = int(MOST) // 2 + SPARE_ROWS
    tried = []
    for begun in _resonances(alone, search.found(point), skip):
        search = Search(whole, begun)
        point = least_of(log, search, search.begun, skip, 10)
        tried.append((_square(log, search, point, skip), search, point))
    if not tried:
        raise UsageError(NO_RESONANCE)
    _, search, point = min(tried, key=itemgetter(0))
    point = least_of(log, search, point, skip, 30)
    square = _square(log, search, point, skip)
    if not square < without * np.exp(-2 * LIKELIER / len(log.reading)):
        raise UsageError(NO_RESONANCE)
    return search, point, skip


def _square(log, search, point, skip):
    """The mean square of the innovations; infinite for a mass that is not positive."""
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, left = projected(errors, effects)
    if gains[0] > 0:
        return float(np.mean(left**2))
    return np.inf


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
            gains, left = projected(errors, both)
            if (gains > 0).all():
                share = float(left @ left) / float(alone @ alone)
                pairs.append((share, tone, gains[1] / gains[0], filtered))
    starts = []
    for _, tone, share, filtered in sorted(pairs, key=itemgetter(0)):
        if len(starts) < 2 and all(  # resonances from which two masses are searched
            # Logarithm of their ratio, at least.
            abs(np.log(tone / near)) > 0.3
            for near, _ in starts
        ):
            numbers = of_modes(1.0 + share, filtered["rate"], tone, RINGING, share)
            shape = {
                "share": share,
                "load_rate": filtered["rate"],
                "square": np.exp(numbers["log_coupling"]),
            }
            starts.append((tone, filtered | shape | {"coupling_rate": numbers["coupling_damping"]}))
    return [begun for _, begun in starts]


def smoothed_states(log, predictor, found, gains, skip):
    """The states at each row, from all readings."""
    push = np.zeros((len(predictor.M), len(log.reading)))
    for gain, parts in zip(gains, _pushes(log, found, predictor.tick), strict=True):
        for effect, force in parts:
            push += gain * np.outer(effect, force)
    return predictor.smoothed(log.reading, push, skip)


def path_within_ticks(log, found, gains, speeds, turned=0.0, slope=0.0, walk=0.0) -> Path:
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
    decay = found["rate"] * log.period + np.zeros(len(speeds)) + slope

    def moved(time):
        return time * (1 - decay * time / 2 + (decay * time) ** 2 / 6)

    def rubbed(speeds):
        if not log.model.friction:
            return 0.0 * speeds
        fading = gains[2] * np.exp(-((speeds / found["fading"]) ** 2)) if "fading" in found else 0.0
        return (gains[1] + fading) * np.tanh(speeds / found["turning"])

    whole_ticks = int(np.floor(found["delay"]))
    part = found["delay"] - whole_ticks
    jump = gains[0] * (late(log.force, whole_ticks) - late(log.force, whole_ticks + 1)) * log.moving
    then = _next(speeds)
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
    path = Path(
        np.stack([before, part - before, after - part, 1 - after]),
        np.stack(
            [
                speeds,
                np.where(turns_before, 0.0, there),
                there,
                np.where(turns_after, 0.0, there),
                then,
            ]
        ),
        decay,
        np.full((4, len(speeds)), np.nan),
    )
    if log.model.friction:
        _stop(path, part, _forces(log, found, gains, walk), _rest(found, gains))
    return path


def _forces(log, found, gains, walk):
    """The forces before that of the log changes in a tick and after it, `(2, rows)`."""
    whole_ticks = int(np.floor(found["delay"]))
    return np.stack([gains[0] * late(log.force, whole_ticks + tick) + walk for tick in (1, 0)])


def _rest(found, gains):
    """The friction at rest."""
    return float(np.sum(gains[1 : 3 if "fading" in found else 2]))


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
    found = search.found(point)
    predictor, errors, effects = errors_of(log, found, skip)
    gains, left = projected(errors, effects)
    walk = float(smoothed_states(log, predictor, found, gains, skip)[-1].std())
    white = float(left.std()) * np.sqrt(found["white"] / predictor.spread)
    return float(np.hypot(walk, white)) / abs(gains[0]) * log.pushed


def _begun(log: ScaledLog, near: Mapping[str, float] | None) -> dict[str, float]:
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

    def around(self, numbers, **others):
        """Try what is given, with the other numbers as they are."""
        values = {name: [numbers[name]] for name in ("rate", "square", "delay", "white", "drift")}
        self.at(*(values | others).values())

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
                gains, left = projected(errors, effects)
            # Errors are compared as those of predictions.
            error = float(left @ left)
            if not np.isfinite(error):
                continue
            if gains[0] > 0 and error < self.error:
                self.error = error
                self.best = numbers
            if gains[0] < 0:
                noise = np.sqrt(error / len(left)) / np.linalg.norm(effects[0])
                self.sign = max(self.sign, -gains[0] / noise)


def least_of(log, search, point, skip, most):
    """The point with the least sum of squares of innovations, from another one."""
    scale = None

    def residual(scaled):
        nonlocal scale
        with np.errstate(all="ignore"):
            try:
                _, errors, effects = errors_of(log, search.found(scaled * search.size), skip)
            except np.linalg.LinAlgError:
                return np.full(len(log.reading) - skip, 1e6)
            # Squares of larger ones are no doubles.
            if not max(np.abs(errors).max(), np.abs(effects).max()) < LARGEST:
                return np.full(len(log.reading) - skip, 1e6)
            gains, rest = projected(errors, effects)
            if not gains[0] > 0:  # no mass is negative
                rest = errors
        scale = scale or float(rest.std())
        return np.clip(rest / scale, -1e6, 1e6)

    FIT_LOGGER.info("looking for the least errors, in up to %d steps", most)
    low = search.low / search.size
    high = search.high / search.size
    start = np.clip(point / search.size, low + 1e-6, high - 1e-6)
    limits = {"xtol": 1e-4, "ftol": 1e-6, "gtol": None, "max_nfev": most}

    def least_from(start):
        # A number without any effect, as the variance of a walk that is not there, would take a step
        # to its bound, and cut those of all others.
        def tethered(scaled):
            # Standard deviations by which a size of a number costs errors as it moves.
            return np.append(residual(scaled), 1e-2 * (scaled - start))

        found = least_squares(
            tethered, start, "2-point", bounds=(low, high), diff_step=1e-5, **limits
        )
        return found.x

    best = least_from(start)
    # At a whole number of ticks the errors have a kink, behind which there may be a lower minimum.
    if "delay" in search.names:
        at = search.names.index("delay")
        tried = [best]
        # Ticks of delay from a minimum, tried as well.
        for ticks in (-0.5, -0.25, -0.1, 0.1, 0.25, 0.5):
            other = best.copy()
            other[at] = np.clip(best[at] + ticks / search.size[at], low[at] + 1e-6, high[at] - 1e-6)
            tried.append(other)
        lowest = min(tried, key=lambda each: float(np.sum(residual(each) ** 2)))
        if lowest is not best:
            best = least_from(lowest)
    return best * search.size


def theta_of(log, found, gains):
    """The numbers of the model in SI units."""
    model = log.model
    period = log.period
    mass = log.pushed * period ** (2 - ORDER[model.measured]) / (gains[0] * log.unit)
    numbers = {
        "log_mass": np.log(mass),
        "damping": found["rate"] * mass,
        "stiffness": found["square"] * mass,
        "friction": gains[1] / gains[0] * log.pushed if model.friction else 0.0,
        "delay": found["delay"],
    }
    if model.load:
        numbers["log_load"] = np.log(found["share"] * mass)
        numbers["load_damping"] = found["load_rate"] * found["share"] * mass
        numbers["log_coupling"] = np.log(found["square"] * mass)
        numbers["coupling_damping"] = found["coupling_rate"] * mass
    theta = [numbers[name] for name in model.names if name not in OWN]
    beside = gains[len(gains) - len(log.beside) :]
    return np.array([*theta, *(beside[: log.coupled] / gains[0])])


def estimated_at(log, search, point, skip, before, moved):
    """The numbers with their intervals."""
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, left = projected(errors, effects)
    if not gains[0] > 0:
        raise UsageError(NO_MASS)
    theta = theta_of(log, search.found(point), gains)
    if before is not None:
        moved = np.maximum(moved, np.abs(theta - before))
    count = len(gains)
    slopes = _slopes(log, search, point, gains, skip)
    to_theta = _differences(
        lambda both: theta_of(log, search.found(both[count:]), both[:count]),
        np.append(gains, point),
        np.append(1e-3 * np.abs(gains) + NEXT_TO_ZERO, DIFFERENCE * search.size),
    )
    half = _half_widths(left, slopes, to_theta)
    robust = _of_large(left, slopes, to_theta)
    few = log.part(0, CHANGED_OF_TWO if log.model.load else CHANGED)
    free = [
        at
        for at in range(slopes.shape[1])
        if at < count or search.names[at - count] not in ("white", "drift")
    ]
    step = _step(few, search, point, skip, free)
    extra = np.zeros(len(theta))
    # Decades by which the variances are changed.
    for decades in (
        ((2, 0), (-2, 0), (0, 3), (0, -3), (2, 3), (-2, -3)) if "white" in search.names else ()
    ):
        other = point.copy()
        other[search.names.index("white")] += decades[0]
        other[search.names.index("drift")] += decades[1]
        if (other < search.low).any() or (other > search.high).any():
            continue
        with np.errstate(all="ignore"):
            _, errors, effects = errors_of(few, search.found(other), skip)
            changed_gains, changed = projected(errors, effects)
            if not (changed_gains[0] > 0 and np.isfinite(changed).all()):
                continue
            changed_slopes = _slopes(few, search, other, changed_gains, skip)
            noise = _half_widths(changed, changed_slopes, to_theta)
            shift = _step(few, search, other, skip, free) - step
        extra = np.maximum(extra, np.abs(to_theta[:, free] @ shift) - noise)
    # How fast the walk is decides how much of a damping a log shows, and not which one.
    extra[1] = 0.0
    extra[len(extra) - log.coupled + 1 :: 2] = 0.0
    predictor = errors_of(log, search.found(point), skip)[0]
    names = tuple(name for name in log.model.names if name in OWN)
    spread = float(left.std())
    return Prediction(
        replace(log.model, without=names),
        theta,
        half + extra + moved + robust,
        left * log.unit,
        np.ones(len(left), bool),
        skip,
        log.unit * spread / np.sqrt(predictor.spread),
        force_beside(log, search, point, skip),
        float(left[1:] @ left[:-1] / (left @ left)),
        search.found(point),
        _static(log, search.found(point), gains),
        Place(log, search, point, skip),
    )


def _static(log, found, gains):
    """The static friction and the speed at which it fades; None for a line."""
    if "fading" not in found:
        return None
    rest = float((gains[1] + gains[2]) / gains[0]) * log.pushed
    speed = found["fading"] * log.unit * log.period ** (ORDER[log.model.measured] - 1)
    return StaticFriction(rest, speed)


def _step(log, search, point, skip, free):
    """Gains and numbers of one step of Gauss and Newton from a point with its variances held,
    `(free,)`."""
    _, errors, effects = errors_of(log, search.found(point), skip)
    gains, left = projected(errors, effects)
    slopes = _slopes(log, search, point, gains, skip)[:, free]
    size = np.maximum(np.linalg.norm(slopes, axis=0), NEXT_TO_ZERO)
    step = -np.linalg.lstsq(slopes / size, left, rcond=1e-10)[0] / size
    step[: len(gains)] += gains
    return step


def _slopes(log, search, point, gains, skip):
    """Derivatives of the innovations with respect to gains and numbers, `(rows, gains +
    numbers)`."""

    def left(at):
        _, errors, effects = errors_of(log, search.found(at), skip)
        return errors - gains @ effects

    _, _, effects = errors_of(log, search.found(point), skip)
    return np.hstack([-effects.T, _differences(left, point, DIFFERENCE * search.size)])


def _differences(function, point, steps):
    """Central differences of a function, `(values, numbers)`."""
    slopes = []
    for at, size in enumerate(steps):
        step = np.zeros(len(point))
        step[at] = size
        slopes.append((function(point + step) - function(point - step)) / (2 * size))
    return np.stack(slopes, axis=1)


def _of_large(left, slopes, to_theta):
    """By how much large innovations move the numbers: a step of Gauss and Newton to those of which
    no innovation counts for more than `LARGE_INNOVATION` standard deviations (Huber 1981).

    Ticks in which friction holds the device for a moment leave such innovations, and they do not
    have a mean of 0.
    """
    most = LARGE_INNOVATION * np.median(np.abs(left)) / 0.6745
    size = np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    step = np.linalg.lstsq(slopes / size, left - np.clip(left, -most, most), rcond=1e-10)[0]
    return np.abs(to_theta @ (step / size))


def _half_widths(left, slopes, to_theta):
    """Half the widths of the intervals: the widest of those of white innovations and of blocks
    of scores."""
    size = np.maximum(np.linalg.norm(slopes, axis=0), NEXT_TO_ZERO)
    unit = slopes / size
    inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-12)
    # Standard deviations at which an innovation is clipped in the scores.
    most = 5.0 * np.median(np.abs(left)) / 0.6745
    clipped = np.clip(left, -most, most)
    onto = to_theta / size
    squares = [NORMAL**2 * np.var(clipped) * np.diag(onto @ inverse @ onto.T)]
    for blocks in BLOCKS:
        parts = np.array_split(np.arange(len(left)), blocks)
        scores = np.stack([unit[part].T @ clipped[part] for part in parts])
        scores = scores - scores.mean(axis=0)
        spread = inverse @ (scores.T @ scores) @ inverse * blocks / (blocks - 1)
        squares.append(stdtrit(blocks - 1, 0.975) ** 2 * np.diag(onto @ spread @ onto.T))
    return np.sqrt(np.max(squares, axis=0))
