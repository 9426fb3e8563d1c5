"""A log of what pushed a device and how it moved, read from a CSV file; one that cannot be used
is refused with one message."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.csv_files import LEAST, MOST, Csv, of_time, option, read_csv, seconds
from wavesweep.program.reading.units import TIME, column_named, converted, unit_in, unit_of

JITTER = 0.01  # of a period, from which it is reported
SHORTEST, LONGEST = 1e-7, 10.0  # s between two rows
PUSHES = {"force": "torque", "current": "current"}  # with the names of what turns
MOTIONS = {"position": "angle", "velocity": "speed", "acceleration": "angular_acceleration"}
# the same of a circuit
VOLTAGE = {"force": "voltage"}
CURRENTS = {"velocity": "current", "position": "charge"}
NAMES = {  # of a column, in small letters, in place of those above
    "time": (*TIME, "timestamp", "stamp", "seconds"),
    "force": ("force", "f"),
    "torque": ("torque", "tau", "moment"),
    "current": ("current", "i"),
    "position": ("position", "pos", "x", "displacement"),
    "velocity": ("velocity", "vel", "v", "speed"),
    "acceleration": ("acceleration", "accel", "acc", "a"),
    "angle": ("angle", "theta", "phi"),
    "speed": ("speed", "omega"),
    "angular_acceleration": ("angular_acceleration", "alpha"),
    "voltage": ("voltage", "volts", "u"),
    "charge": ("charge", "q"),
}
OF_AXES = (
    "fx",
    "fy",
    "fz",
)  # columns with the forces of other axes, if they are not the one that is read
UNITS = {  # of what is read; those of a coil are volt and ampere
    "time": ("s",),
    "force": ("N", "V"),
    "torque": ("N*m",),
    "current": ("A",),
    "position": ("m",),
    "velocity": ("m/s", "A"),
    "acceleration": ("m/s^2",),
    "angle": ("rad",),
    "speed": ("rad/s",),
    "angular_acceleration": ("rad/s^2",),
    "voltage": ("V",),
    "charge": ("C",),
}


@dataclass(frozen=True, eq=False)
class Log:
    """Equally spaced samples: `force` is held from a row to the next, `reading` is measured at the
    time of the row.

    measured: what the reading is, a key of MOTIONS. period: s. start: time of the first row (s).
    turns: the force is a torque (N*m), and the reading one of an angle (rad), in place of N and m.
    circuit: the force is a voltage (V), and the reading a current (A) or a charge (C).
    jitter: the largest deviation of a time from equal steps, in periods. sha256: of the file.
    scaled: names of the columns whose scale was given. taken: sentences on columns that have
    another unit in their names. others: what the file has as forces of other axes. period_half:
    half the width of the period's interval of 95 %, relative.
    """

    force: np.ndarray
    reading: np.ndarray
    measured: str
    period: float
    start: float
    turns: bool
    jitter: float
    sha256: str
    scaled: tuple[str, ...]
    taken: tuple[str, ...] = ()
    others: tuple[np.ndarray, ...] = ()
    period_half: float = 0.0
    circuit: bool = False

    @property
    def times(self) -> np.ndarray:
        """Time of each row (s), equally spaced."""
        return self.start + self.period * np.arange(len(self.force))


def _refuse_unknown(
    columns: Mapping[str, str], scales: Mapping[str, float], names: Collection[str]
) -> None:
    """Refuse options for columns that no log has."""
    for flag, options in (("--column", columns), ("--scale", scales)):
        for name in options:
            if name not in names:
                raise UsageError(f"{flag} {name}: expected one of {', '.join(names)}, found {name}")


def columns_of(axes: Sequence[str], columns: Mapping[str, str]) -> list[dict[str, str]]:
    """The columns of each axis, as of `read_log`: x and fx of an axis x, or those that are given,
    one for each axis with commas between them, as position=q1,q2, or one for all."""
    usual = {"position": ",".join(axes), "force": ",".join(f"f{axis}" for axis in axes)}
    named = {name: text.split(",") for name, text in {**usual, **columns}.items()}
    for name, names in named.items():
        if len(names) not in (1, len(axes)):
            found = ",".join(names)
            raise UsageError(
                f"--column {name}: expected {len(axes)} columns with commas, found {found}"
            )
    return [
        {name: names[place % len(names)] for name, names in named.items()}
        for place in range(len(axes))
    ]


def _refuse_missing(path: str | Path, name: str, wanted: str, file: Csv) -> None:
    """Refuse a file without a wanted column, and name the nearest one, or one with such a word."""
    meant = nearest(wanted, file.names)
    alike = (name, meant) if meant else None
    if alike is None and wanted == name:
        kind = next((k for k in (PUSHES, MOTIONS) if name in (*k, *k.values())), {name: name})
        kinds = (*kind, *kind.values()) if name in kind else (*kind.values(), *kind)
        for kind_of_column, column in product(kinds, file.names):
            words = re.split(r"[\W_]+", column.lower())
            # Shorter words are no hint to a column that is likely meant.
            named = [word for word in NAMES[kind_of_column] if len(word) > 3 and word in words]
            likely = (named and len(words) > 1) or unit_of(column, *UNITS[kind_of_column])
            if likely and alike is None:
                alike = (kind_of_column, column)
    hint = f"; --column {name}=NAME gives its name"
    axes = [axis for axis in file.names if f"f{axis}" in file.names]
    if alike is not None:
        hint = f"; did you mean {option(*alike)}?"
    elif len(axes) > 1:
        hint = f"; --axes {','.join(axes)} fits all axes together"
    raise UsageError(f"{path}: expected a column {wanted}, found {file.listed}{hint}")


def _taken_name(kind, by_values, columns, places):
    """The quantity that a log is taken to have, of a kind: of those in the file one that `columns`
    names, then the first; without any the first of all."""
    names = list(dict.fromkeys(kind.values() if by_values else kind))
    named = [name for name in names if columns.get(name)]
    return next((name for name in (*named, *names) if name in places), names[0])


def read_log(
    path: str | Path,
    columns: Mapping[str, str],
    scales: Mapping[str, float],
    constant: float | None = None,
) -> Log:
    """Read a log. columns: the name in the file of time, a push and a motion, where it differs.

    A push is a force, a torque or a current; a motion is a position, a velocity or an acceleration,
    or an angle, a speed or an angular acceleration. A voltage drives a current or a charge. Of several in the file one that `columns` names
    is taken, then the first in this order. scales: factors that turn the numbers of the file into
    s, N, m and so on. constant: N/A or N*m/A, of the motor with this current. Errors: UsageError
    that names the file, the line or the column, what was expected and what was found.
    """
    file = read_csv(path, 1_000_000_000)  # bytes
    if not any(file.names):
        expected = "expected a header and rows of numbers below it"
        raise UsageError(f"{path}: {expected}, found an empty file")
    places, turns, circuit, used = _columns_used(path, file, columns, scales)
    _, push, motion = used
    _refuse_constant_of_motor(path, push, turns, constant)
    taken_columns = [places[name][0] for name in used]
    beside = [name for name in OF_AXES if name in file.names and name not in taken_columns]
    rows = file.numbers(taken_columns + beside, 50)  # rows, at least
    readings = {}
    taken = []
    for name, column in zip(used, rows.T, strict=False):
        readings[name], said = converted(column, places[name], path, name, scales, *UNITS[name])
        taken.append(said)
    _refuse_constant(path, readings, motion)
    period, jitter, period_half = _period(path, file, readings["time"])
    motions = CURRENTS if circuit else MOTIONS
    measured = next(name for name, derivative in motions.items() if motion in (name, derivative))
    force = readings[push] * (1.0 if constant is None else constant)
    first = float(readings["time"][0])
    of_file = file.sha256, tuple(scales), tuple(filter(None, taken)), tuple(rows[:, len(used) :].T)
    times = period, first, turns, jitter
    return Log(force, readings[motion], measured, *times, *of_file, period_half, circuit)


def _columns_used(
    path: str | Path, file: Csv, columns: Mapping[str, str], scales: Mapping[str, float]
) -> tuple[dict, bool, bool, tuple[str, str, str]]:
    """The place of each name in a file, whether it is of a turning device, and of a circuit, and the
    names of time, push and motion that are read. Errors: UsageError for names that are not known or not
    there."""
    quantities = {**PUSHES, **MOTIONS}
    column_names = dict.fromkeys(["time", *quantities, *quantities.values(), "voltage", "charge"])
    _refuse_unknown(columns, scales, column_names)
    places = _places_of(file.names, column_names, columns)
    turns = _is_turning(columns, places)
    circuit = _is_circuit(columns, places)
    pushes, motions = (VOLTAGE, CURRENTS) if circuit else (PUSHES, MOTIONS)
    by_values = turns or circuit  # the keys are the names of what moves along a line
    push = _taken_name(pushes, by_values, columns, places)
    motion = _taken_name(motions, by_values, columns, places)
    used = ("time", push, motion)
    for name in used:
        if name not in places:
            _refuse_missing(path, name, columns.get(name, name), file)
    return places, turns, circuit, used


def _places_of(
    in_file: Sequence[str], names: Iterable[str], columns: Mapping[str, str]
) -> dict[str, tuple[str, Any]]:
    """The column of the file that has each name, or one of its other names, with the text of its
    unit; those that it has not are left out."""
    places = {}
    for name in names:
        if name not in columns:
            place = column_named(in_file, dict.fromkeys((name, *NAMES[name])), UNITS[name][0])
            places |= {name: place} if place else {}
        elif columns[name] in in_file:
            places[name] = (columns[name], unit_in(columns[name], *UNITS[name]))
    return places


def _is_turning(columns: Mapping[str, str], places: Mapping[str, object]) -> bool:
    """Whether a log is one of a device that turns: by the columns that are named, or else by those
    that there are."""
    straight = {"force", *MOTIONS}
    turned = {"torque", *MOTIONS.values()}
    if turned & columns.keys():
        return True
    if straight & columns.keys() or {"force", "position"} & {*places}:
        return False
    return bool(turned & {*places})


def _is_circuit(columns: Mapping[str, str], places: Mapping[str, object]) -> bool:
    """Whether a log is one of a voltage and what it drives: by the columns that are named, or else
    by those that there are."""
    if {"voltage", "charge"} & columns.keys():
        return True
    moves = {"force", "torque", *MOTIONS, *MOTIONS.values()} & {*places}
    return not moves and {"voltage", "current"} <= {*places}


def _refuse_constant_of_motor(
    path: str | Path, push: str, turns: bool, constant: float | None
) -> None:
    """Refuse a current without the motor's constant, and the constant without a current."""
    if (push == "current") == (constant is not None):
        return
    unit = "N*m/A" if turns else "N/A"
    raise UsageError(
        f"{path}: a current needs the motor's constant: --motor-constant LOW..HIGH in {unit}"
        if push == "current"
        else f"--motor-constant: expected a log of a current, found one of a {push}; leave it out"
    )


def _refuse_constant(path: str | Path, columns: Mapping[str, np.ndarray], motion: str) -> None:
    for name, column in columns.items():
        if (largest := float(np.abs(column).max())) and not LEAST <= largest <= MOST:
            raise UsageError(
                f"{path}: {name}: expected a largest size of {LEAST:g} to {MOST:g}, found {largest:g}"
            )
        if name != "time" and np.ptp(column) == 0:
            if name == motion:
                why = "nothing moves it"
            else:
                why = "it has to change to move the device"
            raise UsageError(
                f"{path}: {name}: expected a column that changes, found {column[0]:g} in every row; {why}"
            )


def _period(path: str | Path, file: Csv, times: np.ndarray) -> tuple[float, float, float]:
    """The period (s), the largest deviation of a time from equal steps, in periods, and half the
    width of the period's interval, relative."""
    steps = np.diff(times)
    if (steps <= 0).any():
        row = int((steps <= 0).argmax())
        raise UsageError(
            f"{path}:{file.line(row + 1)}: time: expected times that increase, "
            f"found {seconds(times[row + 1])} after {seconds(times[row])}"
        )
    period = float(np.median(steps))
    usual = np.percentile(steps, [5, 95])  # stamps of whole ms have steps of two lengths
    # Periods between two rows above which one may be missing.
    gap = steps > 1.5 * period + usual[1] - usual[0]
    if gap.any():
        row = int(gap.argmax())
        problem = f"{steps[row]:.6g} s between two rows and {period:.6g} s between most"
        raise UsageError(
            f"{path}:{file.line(row + 1)}: time: expected equal steps, found {problem}; take a part without gaps"
        )
    period, half = _slope(times)
    if not SHORTEST <= period <= LONGEST:
        expected = f"expected steps of {SHORTEST:g} to {LONGEST:g} s, found {period:.6g} s"
        raise UsageError(f"{path}: time: {expected}; {of_time('time', period)}")
    late = times - times[0] - period * np.arange(len(times))  # whatever the first one is late by
    off = np.abs(late - np.median(late)) / period
    if off.max() > 0.5:  # of a period: deviation of a time above which the steps are not equal
        row = int(off.argmax())
        problem = f"a time {off[row]:.3g} steps from where equal ones of {period:.6g} s have it"
        raise UsageError(
            f"{path}:{file.line(row)}: time: expected equal steps, found {problem}; resample the log, or take an even part"
        )
    return period, float(off.max()), half


def _slope(times: np.ndarray) -> tuple[float, float]:
    """The period (s) by the line of least squares through all times, and half the width of its
    interval of 95 %, relative: two standard errors of the slope, with what is left of each row
    correlated with the next as in an autoregression of first order."""
    rows = np.arange(len(times)) - (len(times) - 1) / 2
    spread = float(rows @ rows)
    period = float(rows @ (times - times[0])) / spread
    residual = times - times.mean() - period * rows
    power = float(residual @ residual)
    alike = float(residual[1:] @ residual[:-1]) / power if power else 0.0
    longer = max((1 + alike) / (1 - alike), 1.0)
    error = np.sqrt(longer * power / (len(times) - 2) / spread)
    return period, 2 * float(error) / period


def step_of(reading: np.ndarray) -> float:
    """The step of the encoder that is visible in the readings, 0 if there is none."""
    steps = np.unique(np.abs(np.diff(reading)))
    steps = steps[steps > 1e-9 * np.ptp(reading)]
    if not steps.size:
        return 0.0
    step = float(steps[0])
    for _ in range(2):  # the least of many, then their common step
        rounded = np.round(steps / step)
        if (np.abs(steps - rounded * step) > 0.02 * step).any():
            return 0.0
        step = float(np.sum(steps * rounded) / np.sum(rounded * rounded))
    return step
