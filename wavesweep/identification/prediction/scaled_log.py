"""A log in the units of a fit by predictions: its force and readings over their own sizes, and what
friction does along the velocity within each tick."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import savgol_filter
from scipy.special import erf, spence

from wavesweep.identification.model import ORDER, Model

WIDTHS = (2, 4, 8, 16, 32, 64)  # rows to either side, over which a first velocity is smoothed
ONE_WAY = 0.98  # share of the motion one way above which friction is a constant force
OUTLIER_SHARE = 0.02  # share of the rows that may be outliers; more are not


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
            few = replace(few, path=Path(*(column[..., first:end] for column in self.path)))
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
            means, changes = _along_line(self.speeds, a_tick_later(self.speeds), turning, fading)
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
    gaussians = [np.exp(-((each / fading) ** 2)) for each in (*ways, way)]
    means = np.where(straight, (primitives[1] - primitives[0]) / over, side * gaussians[2])
    return means, changes * gaussians[2] + side * (gaussians[1] - gaussians[0])


def a_tick_later(signal):
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
        # Times the noise of a velocity, below which a twentieth of its size has to
        # be.
        if 6.0 / 3 * noise < 0.05 * speeds.std():
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


def spikes(reading, resolution):
    """Which readings are outliers, `(rows,)`: far to one side of both neighbours, which are near to
    each other and to their own neighbours. None if OUTLIER_SHARE of the rows are: then it is not
    single readings that err.

    A velocity under a force that turns round is as far from its neighbours, but so are these from
    theirs.
    """
    change = np.diff(reading)
    before = change[:-1]  # r_i - r_(i-1), of all i with two neighbours
    after = -change[1:]  # r_i - r_(i+1)
    # Standard deviation of a second difference, if these are normal.
    usual = np.median(np.abs(before + after)) / 0.6745
    height = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    around = np.abs(np.pad(change, 1))
    farther_before = around[:-3]  # |r_(i-1) - r_(i-2)|
    farther_after = around[3:]  # |r_(i+2) - r_(i+1)|
    between_neighbours = np.abs(before - after)  # |r_(i+1) - r_(i-1)|
    apart = np.maximum(between_neighbours, np.maximum(farther_before, farther_after))
    # 20 standard deviations of a second difference: beyond these a single reading is an outlier.
    is_high = height > max(20.0 * usual, 3 * resolution)
    outliers = np.pad((apart < 0.5 * height) & is_high, 1)
    if outliers.mean() < OUTLIER_SHARE:
        return outliers
    return np.zeros(len(reading), bool)
