"""How far a loop that is broken at one signal is from instability: gain, phase, delay and disk
margins, peak sensitivities."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavesweep.engine.doubles import EPS, NEXT_TO_ZERO
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import GAIN, path_of
from wavesweep.engine.frames import LinearFractional, on_circle, solve
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import (
    NORM_TOLERANCE,
    SOFT,
    START,
    Peak,
    TickMaps,
    angles,
    squared_norm,
    with_middles,
)
from wavesweep.program.analyses.interval_jobs import records_of_loop

# times more or less gain, up to which a limit is looked for; also the value of a margin and of a
# peak without a limit, as columns.csv and docs/margins.md say
LARGEST_GAIN_FACTOR = 1e6
SPANS = 16.0, 1e3, LARGEST_GAIN_FACTOR  # of the gain; a short span is known better
SPARED = 1e-6  # relative error of a margin up to which there is no doubt
TOUCHES = 1e-7  # a peak or dip of the gain within this distance of 1 may touch it
# distance of the direct term's size from 1 beyond which the pencil of the gain 1 is regular
DIRECT = 1e-6
ROUNDED_ANGLE = 1e-12  # of pi, by which an angle of half the rate may be off it
BESIDE_ZERO = 1e-7  # rad; stands for the angle 0, at which an integrator has no response


@dataclass(frozen=True, slots=True)
class Margin:
    """One margin.

    value: NaN if it is not known. omega: its frequency, rad/s up to half the rate of the frame; NaN
    without a limit. bound: on the error of the value, relative, to first order. doubt: a number of
    `Doubt`. limited: whether there is a limit; otherwise the value is the end of what was looked
    at.
    """

    name: str
    value: float
    omega: float
    bound: float
    doubt: int = Doubt.NONE
    limited: bool = True

    @staticmethod
    def unlimited(name: str, value: float, doubt: int) -> "Margin":
        """A margin without a limit up to that value, if there is no doubt about it."""
        return Margin(name, np.nan if doubt else value, np.nan, 0.0, doubt, limited=bool(doubt))


@dataclass(frozen=True, eq=False)
class BrokenLoop:
    """A loop broken at a signal that is made once per frame: `-L(z) = C (z - 1 - E)^-1 B + D`, and
    bounds on errors of these.

    loop: a single one, with a gain at the signal. cut: the same, at the number GAIN by which the
    signal is multiplied. lifted: the same as a `LiftedLoop` of one sample, which settles what is in
    doubt here. Accuracy: see `slope_and_error`.
    """

    loop: Loops
    cut: LinearFractional
    lifted: Any = None
    times = 1

    @cached_property
    def parts(self) -> tuple[np.ndarray, ...]:
        """E, B, C and D."""
        return self.cut.open_alone()

    @cached_property
    def errors(self) -> tuple[np.ndarray, ...]:
        """Bounds on the errors of their entries."""
        errors = self.cut.of_errors().open_alone()
        if self.cut.integrates:  # which is read with a factor of exactly 1
            errors[2][..., -1] = 0.0
        return errors

    @property
    def period(self) -> float:
        """Of the frame, s."""
        return float(self.cut.period)

    def response(self, theta) -> np.ndarray:
        """Return L at the angles `theta` (rad per frame)."""
        E, B, C, D = self.parts
        A = on_circle(np.asarray(theta, float))[..., None, None] * np.eye(len(E)) - E
        return -(C @ solve(A, B + 0 * A[..., :1]) + D)[..., 0, 0]

    def slope_and_error(self, theta: float) -> tuple[complex, float]:
        """Return the derivative of L by the angle, and a bound on its error: of the frame's
        entries, and of rounding."""
        E, B, C, D = self.parts
        dE, dB, dC, dD = self.errors
        w = complex(on_circle(theta))
        identity = np.eye(len(E))
        A = w * identity - E
        state = solve(A, B + 0j)
        read = solve(A.T, C.T + 0j).T
        rounding = len(E) * EPS
        rounded = rounding * (abs(w) * identity + np.abs(E))
        error = np.abs(read) @ ((dE + rounded) @ np.abs(state) + dB) + dC @ np.abs(state) + dD
        error = error + rounding * (np.abs(C) @ np.abs(state) + np.abs(D))
        slope = complex((read @ state)[0, 0]) * 1j * (1 + w)
        return slope, float(error[0, 0])

    def sensitivity(self, less: float = 0.0) -> TickMaps:
        """Return the map S = 1/(1 + L), less a number."""
        E, B, C, D = self.parts
        left = 1 - D
        matrices = [(E + B / left @ C, B / left, C / left, 1 / left - less)]
        return TickMaps.of(matrices, np.zeros(1, int), ()).in_even_units()

    def unit_gains(self) -> tuple[np.ndarray, bool, float]:
        """Return all angles in (0, pi) at which |L| crosses 1, whether it is known that there are
        no others, and up to which angle rounding hides one beside 0.

        |L| = 1 exactly where the real part of S is 1/2. The pencil of that level has all the angles as eigenvalues; between
        these and their middles the size of L shows where it crosses, and halving finds the root to
        rounding.
        """

        def size(theta):
            return np.nan_to_num(
                np.log(np.abs(self.response(theta))), nan=np.inf, posinf=1e3, neginf=-1e3
            )

        with np.errstate(all="ignore"):
            met = angles(self.sensitivity().pencil(np.zeros(1, int), np.array([0.5])))
            points = np.unique(np.concatenate([with_middles(met)[0], SOFT, START]))
            points = points[np.isfinite(points)]
            sizes = size(points)
            above = sizes > 0
            change = np.flatnonzero(above[:-1] != above[1:])
            low = points[change]
            high = points[change + 1]
            while (high - low > NEXT_TO_ZERO + 4 * EPS * high).any():
                unit_angles = (low + high) / 2
                is_below_root = (size(unit_angles) > 0) == above[change]
                low = np.where(is_below_root, unit_angles, low)
                high = np.where(is_below_root, high, unit_angles)
            unit_angles = (low + high) / 2
        touches = np.abs(sizes) <= TOUCHES
        if unit_angles.size:
            # At the ends a rotation by 180 degrees is meant, which no other one exceeds.
            touches &= (points > 0) & (points < np.pi)
        near = np.flatnonzero(touches)
        is_beside = np.zeros(near.size, bool)
        for root in unit_angles:
            slope, _ = self.slope_and_error(root)
            slope_of_size = abs((slope * self.response(root).conj()).real)
            is_beside |= (
                slope_of_size * np.abs(points[near] - root) <= 2 * np.abs(sizes[near]) + 1e-12
            )
        at_rest, hidden = self._largest_at_rest(points[near], sizes[near])
        _, _, _, D = self.parts
        regular = abs(abs(float(D[0, 0])) - 1) > DIRECT
        return unit_angles, bool((is_beside | at_rest).all()) and regular, hidden

    def _largest_at_rest(self, points, sizes) -> tuple[np.ndarray, float]:
        """Return at which of some angles log |L| is that of a largest L(0) = 1, `-c theta^2/2`, and
        the angle up to which the error of L may hide a crossing of 1 next to it.

        There L is near to 1, and a rotation by almost 180 degrees is meant.
        """
        nowhere = np.zeros(points.size, bool)
        if not points.size or points[0] > 0 or not self.response(0.0).real > 0:
            return nowhere, 0.0
        c = -2 * sizes[-1] / points[-1] ** 2 if points[-1] else 0.0
        if not c > 0:
            return nowhere, 0.0
        parabola = c / 2 * points**2
        at_rest = np.abs(sizes + parabola) <= parabola / 2 + 1e-12
        _, error = self.slope_and_error(BESIDE_ZERO)
        return at_rest, float(np.sqrt(2 * error / c))


def scalar_margins(loop: BrokenLoop) -> tuple[list[Margin], int]:
    """Return the margins of a loop, empty if it is not stable, and why its stability is in doubt, a
    code.

    gain_up, gain_down: factors of the signal at the ends of the stable interval around 1;
    LARGEST_GAIN_FACTOR and 0 if they are beyond LARGEST_GAIN_FACTOR and 1/LARGEST_GAIN_FACTOR.
    phase (degrees): up to which every rotation of the signal leaves the loop stable. delay_frames:
    a delay of fewer whole frames leaves it stable. disk: the largest a for which every factor (1 +
    a d/2)/(1 - a d/2), |d| < 1, does, so those from 1/disk_gain to disk_gain, and rotations up to
    disk_phase. sensitivity, complementary: the largest |1/(1 + L)| and
    |L/(1 + L)|.
    Accuracy: see `Margin.bound`. Peaks by level sets (see `hinf_norm`), gains as in
    `stable_intervals`. Source: P. Seiler, A. Packard, P. Gahinet, IEEE Control Systems Magazine 40
    (2020), with a disk of no skew.
    """
    gains, doubt = _gains(loop)
    if not gains:
        return [], doubt
    return [*gains, *_phases(loop), *_peaks(loop)], doubt


def stable_around_1(loop: Loops, lowest: float | None = None) -> tuple[np.record | None, int]:
    """Return the stable interval around 1 of the factor of a signal, a record of the search, None
    if none is known, and the doubt about the factors that were looked at.

    loop: with a gain at the signal. lowest: of the factors, 1 over the largest one by default.
    """
    for most in SPANS:
        least = 1 / most if lowest is None else lowest
        records = records_of_loop(loop, path_of(GAIN), (least, most))
        doubt = int(records["doubt"][0])
        around_1 = records[(records["low"] < 1) & (records["high"] > 1)]
        if not around_1.size:
            return None, doubt
        ends_below = around_1["low"][0] > least or lowest is not None
        if ends_below and around_1["high"][0] < most:
            break
    return around_1[0], doubt


def seen_once_a_frame(omega: float, period: float) -> float:
    """Return the frequency (rad/s), up to half the rate of the frame, at which an oscillation is
    seen once a frame.

    period: of the frame, s. The search gives it as a part of the loop sees it that runs by itself,
    in a shorter frame of its own. `omega -> |omega - 2 pi n/period|`.
    """
    if not omega * period > np.pi * (1 + ROUNDED_ANGLE):
        return omega
    rate = 2 * np.pi / period
    return abs(omega - rate * round(omega / rate))


def _gains(loop):
    """The gain margins, none if the loop is not known to be stable, and the doubt about its
    interval."""
    around_1, doubt = stable_around_1(loop.loop, 0.0)
    if around_1 is None:
        return [], doubt
    margins = []
    ends = (
        ("gain_up", float(around_1["high"]), float(around_1["high_omega"])),
        ("gain_down", float(around_1["low"]), float(around_1["low_omega"])),
    )
    for name, gain, omega_of_part in ends:
        omega = seen_once_a_frame(omega_of_part, loop.period)
        if not 1 / LARGEST_GAIN_FACTOR < gain < LARGEST_GAIN_FACTOR:
            margins.append(Margin.unlimited(name, LARGEST_GAIN_FACTOR if gain > 1 else 0.0, doubt))
            continue
        theta = omega * loop.period
        response = complex(loop.response(theta))
        free = 0 < theta < np.pi * (1 - ROUNDED_ANGLE)
        error = _error(loop, theta, response.imag, lambda slope: slope.imag, free=free)
        residual = abs(1 + gain * response)
        margins.append(_margin(name, gain, omega, error / abs(response) + residual, doubt))
    return margins, doubt


def _error(loop, theta, left, along, *, free=True):
    """A bound on the error of L where a real part of it is 0: of L itself, and as the angle moves
    with it.

    left: what is left of that part; along: gives it from the derivative of L; free: whether the
    angle may move.
    """
    slope, error = loop.slope_and_error(theta)
    error += abs(left)
    if not free:
        return error
    with np.errstate(all="ignore"):
        return error + abs(slope) * float(np.float64(error) / abs(along(slope)))


def _margin(name, value, omega, bound, doubt):
    if doubt == Doubt.NONE and not bound <= SPARED:
        doubt = Doubt.ROUNDING
    return Margin(name, value, omega, float(bound), doubt)


def _phases(loop) -> Iterator[Margin]:
    theta, certain, hidden = loop.unit_gains()
    doubt = Doubt.NONE if certain else Doubt.CROWDED
    slow = abs(complex(loop.response(np.pi))) < 1 - TOUCHES
    if not theta.size:
        if hidden:
            turned = abs(loop.slope_and_error(BESIDE_ZERO)[0]) * hidden
            yield _margin("phase", 180.0, 0.0, turned / np.pi, doubt)
            doubt = doubt if hidden * LARGEST_GAIN_FACTOR <= np.pi else Doubt.ROUNDING
        else:
            yield Margin.unlimited("phase", 180.0, doubt)  # which no rotation exceeds
        yield Margin.unlimited("delay_frames", LARGEST_GAIN_FACTOR, doubt if slow else Doubt.FAST)
        return
    response = loop.response(theta)
    lag = np.angle(-response)
    turns = np.abs(lag)
    at = int(np.argmin(turns))
    turn = float(turns[at])
    error = _error_at_unit_gain(loop, theta[at], response[at])
    yield _margin(
        "phase", float(np.degrees(turn)), float(theta[at]) / loop.period, error / turn, doubt
    )
    if not slow:
        yield Margin.unlimited("delay_frames", np.nan, Doubt.FAST)
        return
    frames = (lag % (2 * np.pi)) / theta
    at = int(np.argmin(frames))
    delay = float(frames[at])
    error = _error_at_unit_gain(loop, theta[at], response[at])
    turn = delay * float(theta[at])
    yield _margin("delay_frames", delay, float(theta[at]) / loop.period, error / turn, doubt)


def _error_at_unit_gain(loop, theta, response):
    """A bound on the error of L at an angle at which its size is 1."""
    L = complex(response)
    return _error(
        loop, float(theta), abs(L) - 1, lambda slope: (slope * L.conjugate()).real / abs(L)
    )


def _peaks(loop) -> Iterator[Margin]:
    for name, less in (("disk", 0.5), ("sensitivity", 0.0), ("complementary", 1.0)):
        peak = squared_norm(loop.sensitivity(less))
        theta = float(peak.theta[0])
        size = float(np.sqrt(peak.value[0]))
        angle = max(theta, BESIDE_ZERO)  # an integrator has no response at 0
        S = 1 / (1 + complex(loop.response(angle)))
        _, error = loop.slope_and_error(angle)
        error_of_S = abs(S) ** 2 * error + abs(abs(S - less) - size)
        bound = NORM_TOLERANCE + error_of_S / size
        if name == "disk":
            doubt = Doubt.NONE if peak.certified[0] else Doubt.SEARCH
            yield from disk_margins(1 / size, theta / loop.period, bound, doubt)
        else:
            yield peak_margin(name, peak, loop.period, bound)


def peak_margin(name: str, peak: Peak, period: float, bound: float) -> Margin:
    """Return the margin of the peak of a squared response.

    Beyond LARGEST_GAIN_FACTOR it has no limit, as next to a drift that it moves.
    """
    doubt = Doubt.NONE if peak.certified[0] else Doubt.SEARCH
    if peak.value[0] >= LARGEST_GAIN_FACTOR**2:
        return Margin.unlimited(name, LARGEST_GAIN_FACTOR, Doubt.NONE)
    size = float(np.sqrt(peak.value[0])) if np.isfinite(peak.value[0]) else np.nan
    return _margin(name, size, float(peak.theta[0]) / period, bound, doubt)


def disk_margins(disk: float, omega: float, bound: float, doubt: int) -> Iterator[Margin]:
    """Yield the disk margin with its gain and its phase, `(1 + a/2)/(1 - a/2)` and `2
    atan(a/2)`."""
    yield _margin("disk", disk, omega, bound, doubt)
    gain = (2 + disk) / (2 - disk) if disk < 2 else np.inf
    if gain < LARGEST_GAIN_FACTOR:
        of_gain = bound * 4 * disk / (4 - disk**2)
    else:
        of_gain = 0.0
    yield limited_or_not("disk_gain", gain, omega, of_gain, doubt)
    phase = 2 * np.arctan(disk / 2)
    of_phase = bound * np.sin(phase) / phase
    yield _margin("disk_phase", float(np.degrees(phase)), omega, of_phase, doubt)


def limited_or_not(name: str, gain: float, omega: float, bound: float, doubt: int) -> Margin:
    """Return the margin of a gain, which has a limit between 1/LARGEST_GAIN_FACTOR and
    LARGEST_GAIN_FACTOR."""
    if 1 / LARGEST_GAIN_FACTOR < gain < LARGEST_GAIN_FACTOR:
        return _margin(name, gain, omega, bound, doubt)
    return Margin.unlimited(name, LARGEST_GAIN_FACTOR if gain > 1 else 0.0, doubt)
