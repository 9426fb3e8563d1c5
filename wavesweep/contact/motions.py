"""Motions that go on for ever: a wall of the class, a push, and a force that repeats."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import gcd

import numpy as np

from wavesweep.contact.wall_loop import WallsAlong
from wavesweep.program.number_words import MOST_DIGITS, in_all_digits


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A motion that repeats: what the wall's curve reads and the force that it gives, by frame.

    reading, force: `(period,)`. value: of the number of the wall. The curve through the points
    (reading, force) rises with slopes from 0 to 1 and begins at (0, 0); push: the constant force,
    in units of the wall's, that keeps the motion in its place. digits: of the forces, which have
    no more, and of the readings in words.
    """

    value: float
    reading: np.ndarray
    force: np.ndarray
    push: float
    digits: int

    def __str__(self) -> str:
        pairs = zip(self.reading, self.force, strict=True)
        points = ", ".join(f"({y:.{self.digits}g}, {u:.{self.digits}g})" for y, u in pairs)
        return f"a wall through {points}, frame by frame for ever, with a push of {in_all_digits(self.push)}"


@cache
def _rational() -> tuple[np.ndarray, np.ndarray]:
    """Periods, in frames, and angles `2 pi a/period`, a and the period in lowest terms."""
    periods = range(2, 41)  # frames
    pairs = [(P, a) for P in periods for a in range(1, P // 2 + 1) if gcd(a, P) == 1]
    periods, turns = np.array(pairs).T
    return periods, 2 * np.pi * turns / periods


def motion_beyond(
    walls: WallsAlong,
    end: float,
    limit: float,
    inside: float = 1e-3,  # of the value at which a motion begins to exist
) -> Motion | None:
    """The motion nearest to `end` on the way to `limit`; None if none is found.

    inside: share of the value at which the motion begins to exist, by which it is moved on.

    A force `u = cos(theta k + a)` with a rational angle, of period P, is answered by `y = -L u`, so
    that `y - u = -(1 + L) u` is a sine as well. If its phase differs by less than pi/P from that of
    u, both can be ordered alike over the P frames: then a curve of slopes from 0 to 1 leads through
    all points (y, u), and the motion is one of the loop. No multiplier serves there, since the
    phase of none exceeds `pi/2 - pi/P` at that angle.

    Source: S. Wang, J. Carrasco, W. P. Heath, Phase limitations of Zames-Falb multipliers, IEEE
    Trans. Autom. Control 63 (2018); P. Seiler, J. Carrasco, Construction of periodic
    counterexamples to the discrete-time Kalman conjecture, IEEE Control Systems Letters 5 (2021).
    """
    periods, angles = _rational()
    one, other = walls.opened(angles)
    found = []
    for side in (1, -1):
        turned = np.exp(-1j * side * (np.pi - np.pi / periods))
        with np.errstate(divide="ignore", invalid="ignore"):
            found.append(-(one * turned).imag / (other * turned).imag)
    values, number = np.concatenate(found), np.tile(np.arange(periods.size), 2)
    way = limit - end
    moved = values + inside * np.sign(way) * np.abs(values)
    between = ((values - end) * way > 0) & ((limit - moved) * way >= 0)
    opened = one[number] + np.where(between, moved, 0.0) * other[number]
    between &= np.abs(np.angle(-opened)) < np.pi / periods[number]
    if not between.any():
        return None
    nearest = np.flatnonzero(between)[np.argmin(np.abs(values[between] - end))]
    period, angle = int(periods[number[nearest]]), angles[number[nearest]]
    return _of(walls, period, angle, opened[nearest], float(moved[nearest]))


def motion_at(walls: WallsAlong, value: float) -> Motion | None:
    """A motion at a value itself, the one farthest from ceasing to exist; None if none is."""
    periods, angles = _rational()
    one, other = walls.opened(angles)
    opened = one + value * other
    room = np.pi / periods - np.abs(np.angle(-opened))
    most = int(np.argmax(room))
    if room[most] > 0:
        return _of(walls, int(periods[most]), angles[most], opened[most], value)
    return None


def _of(walls, period, angle, opened, value):
    """The motion of a force of this angle where `1 + L` is `opened`.

    Its forces have as few digits as are enough for a motion of the loop: rounded, they have the
    angles `2 pi k/period` for all k, and `y - u = -(1 + L) u` at each.
    """
    lag = np.angle(-opened)  # of y - u behind u
    phase = (np.pi / period - lag) / 2  # both phases lie between 0 and pi/period: the same order
    turns = angle * np.arange(period) + phase
    sine = np.cos(turns)
    one, other = walls.opened(2 * np.pi * np.arange(1, period) / period)
    opened_at_all = one + value * other
    # Digits of a force in words, few to begin with.
    for digits in range(4, MOST_DIGITS + 1):
        force = np.array([float(f"{u:.{digits}g}") for u in sine - sine.min()])
        parts = np.fft.fft(force)
        parts[0] = 0.0  # whatever the push makes it
        parts[1:] *= -opened_at_all
        reading = force + np.fft.ifft(parts).real
        order = np.argsort(reading)
        rise = np.diff(force[order])
        if ((rise >= 0) & (rise <= np.diff(reading[order]))).all():
            break
    return Motion(value, reading - reading.min(), force, float(force.mean()), digits)
