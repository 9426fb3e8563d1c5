"""A log of force and position, read from a CSV file; what cannot be used is refused with one message."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from wavesweep.errors import UsageError
from wavesweep.spec.checking import nearest
from wavesweep.spec.reading import read_bytes

MOST_BYTES = 1_000_000_000
LEAST_ROWS = 50
JITTER = 0.01  # of a period, from which it is said
GAP = 1.5  # periods between two rows of which one may be missing
SHOWN = 60  # letters of a file that a message repeats
TURNING = {"force": "torque", "position": "angle"}


@dataclass(frozen=True, eq=False)
class Log:
    """Equally spaced samples: `force` is held from a row to the next, `position` is that at the row's time.

    period: s. start: time of the first row (s). turns: torque (N*m) and angle (rad) are in the place of force (N) and position
    (m). jitter: the largest deviation of a time from equal steps, in periods. sha256: of the file. scaled: names of the columns
    whose scale was given.
    """

    force: np.ndarray
    position: np.ndarray
    period: float
    start: float
    turns: bool
    jitter: float
    sha256: str
    scaled: tuple[str, ...]

    @property
    def times(self) -> np.ndarray:
        """Time of each row (s), equally spaced."""
        return self.start + self.period * np.arange(len(self.force))


def read_log(path: str | Path, columns: Mapping[str, str], scales: Mapping[str, float]) -> Log:
    """Read a log. columns: name in the file of time, force (or torque) and position (or angle), where it is another one.

    scales: factors that turn the numbers of the file into s, N (or N*m) and m (or rad).
    Errors: UsageError that names the file, the line or the column, what was expected and what was found.
    """
    data = read_bytes(path, MOST_BYTES)
    names, rows = _numbers(path, data)
    turns = {**columns}.keys() & set(TURNING.values()) or (
        not {"force", "position"} & {*columns, *names} and set(TURNING.values()) <= set(names)
    )
    roles = {"time": "time"} | {role: TURNING[role] if turns else role for role in TURNING}
    for option, given in (("--column", columns), ("--scale", scales)):
        for name in given:
            if name not in roles.values():
                raise UsageError(f"{option} {name}: expected one of {', '.join(roles.values())}, found {name}")
    found = {}
    for role, name in roles.items():
        wanted = columns.get(name, name)
        tries = [wanted, *(f"{wanted}_{unit}" for unit in ("s", "N", "m", "Nm", "rad") if name not in columns)]
        known = [each for each in tries if each in names]
        if not known:
            meant = nearest(wanted, names)
            hint = f"; did you mean --column {name}={meant}?" if meant else f"; --column {name}=NAME tells it"
            listed = ", ".join(names)[:SHOWN]
            raise UsageError(f"{path}: expected a column {wanted}, found {listed}{hint}")
        found[role] = rows[:, names.index(known[0])] * scales.get(name, 1.0)
    _refuse_unusable(path, found, roles)
    period, jitter = _period(path, found["time"], roles["time"])
    digest = hashlib.sha256(data).hexdigest()
    first = float(found["time"][0])
    return Log(found["force"], found["position"], period, first, bool(turns), jitter, digest, tuple(scales))


def _numbers(path: str | Path, data: bytes) -> tuple[list[str], np.ndarray]:
    """The names in the header and the numbers below it, `(rows, columns)`."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UsageError(f"{path}: expected a CSV file in UTF-8, found bytes that are none ({error.reason})") from error
    header, _, body = text.partition("\n")
    for mark, word in ((";", "semicolons"), ("\t", "tabs")):
        if mark in header and "," not in header:
            expected = "expected commas between columns and points in numbers"
            raise UsageError(f"{path}:1: {expected}, found {word}; export the log again with commas")
    names = [name.strip() for name in next(csv.reader([header]), [])]
    try:
        rows = np.loadtxt(StringIO(body), delimiter=",", ndmin=2, comments=None)
    except ValueError:
        raise UsageError(_first_fault(path, names, body)) from None
    if len(rows) and rows.shape[1] != len(names):
        raise UsageError(_first_fault(path, names, body))
    if len(rows) < LEAST_ROWS:
        raise UsageError(f"{path}: expected at least {LEAST_ROWS} rows of numbers below the header, found {len(rows)}")
    return names, rows


def _first_fault(path: str | Path, names: list[str], body: str) -> str:
    for line, row in enumerate(csv.reader(body.splitlines()), start=2):
        if len(row) > len(names) and len(row) == 2 * len(names):
            return f"{path}:{line}: expected points in numbers, found {','.join(row)[:SHOWN]}; are these decimal commas?"
        if row and len(row) != len(names):
            return f"{path}:{line}: expected {len(names)} values as in the header, found {len(row)}"
        for name, cell in zip(names, row, strict=False):
            try:
                float(cell)
            except ValueError:
                return f"{path}:{line}: {name}: expected a number, found {cell.strip()[:SHOWN] or 'nothing'}"
    return f"{path}: expected rows of numbers below the header, found none that can be read"


def _refuse_unusable(path: str | Path, found: Mapping[str, np.ndarray], roles: Mapping[str, str]) -> None:
    for role, column in found.items():
        wrong = ~np.isfinite(column)
        if wrong.any():
            row = int(wrong.argmax())
            raise UsageError(f"{path}:{row + 2}: {roles[role]}: expected a finite number, found {column[row]}")
        if role != "time" and np.ptp(column) == 0:
            why = "nothing moves it" if role == "position" else "it has to change to move the device"
            raise UsageError(f"{path}: {roles[role]}: expected a column that changes, found {column[0]:g} in every row; {why}")


def _period(path: str | Path, times: np.ndarray, name: str) -> tuple[float, float]:
    """The period (s) and the largest deviation of a time from equal steps, in periods."""
    steps = np.diff(times)
    if (steps <= 0).any():
        row = int((steps <= 0).argmax())
        raise UsageError(
            f"{path}:{row + 3}: {name}: expected times that increase, found {times[row + 1]:.9g} after {times[row]:.9g}"
        )
    period = float(np.median(steps))
    if (steps > GAP * period).any():
        row = int((steps > GAP * period).argmax())
        found = f"{steps[row]:.6g} s between two rows and {period:.6g} s between most"
        raise UsageError(f"{path}:{row + 3}: {name}: expected equal steps, found {found}; take a part without gaps")
    period = float(times[-1] - times[0]) / (len(times) - 1)
    even = times[0] + period * np.arange(len(times))
    return period, float(np.abs(times - even - np.median(times - even)).max() / period)


def pairs(given: Iterable[str], option: str) -> dict[str, str]:
    """The words NAME=VALUE of an option as a mapping. Errors: UsageError for another form."""
    found = {}
    for each in given:
        name, equals, value = (part.strip() for part in each.partition("="))
        if not (name and equals and value):
            raise UsageError(f"{option} {each}: expected NAME=VALUE, e.g. position={'2e-5' if option == '--scale' else 'enc'}")
        found[name] = value
    return found


def step_of(position: np.ndarray) -> float:
    """The step of the encoder that the readings show (m), 0 if they show none."""
    steps = np.unique(np.abs(np.diff(position)))
    steps = steps[steps > 1e-9 * np.ptp(position)]
    if not steps.size:
        return 0.0
    step = float(steps[0])
    for _ in range(2):  # the least of many, then their common step
        whole = np.round(steps / step)
        if (np.abs(steps - whole * step) > 0.02 * step).any():
            return 0.0
        step = float(np.sum(steps * whole) / np.sum(whole * whole))
    return step
