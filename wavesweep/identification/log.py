"""A log of force and position, read from a CSV file; a log that cannot be used is refused with one message."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavesweep.errors import UsageError
from wavesweep.identification.csv_files import read_csv
from wavesweep.spec.checking import nearest

MOST_BYTES = 1_000_000_000
LEAST_ROWS = 50
JITTER = 0.01  # of a period, from which it is reported
SHORTEST, LONGEST = 1e-7, 10.0  # s between two rows
UNEVEN = 0.5  # of a period: deviation of a time above which the steps are not equal
GAP = 1.5  # periods between two rows above which one may be missing
TURNING = {"force": "torque", "position": "angle"}


@dataclass(frozen=True, eq=False)
class Log:
    """Equally spaced samples: `force` is held from a row to the next, `position` is measured at the time of the row.

    period: s. start: time of the first row (s). turns: force and position are a torque (N*m) and an angle (rad), in place of N
    and m. jitter: the largest deviation of a time from equal steps, in periods. sha256: of the file. scaled: names of the
    columns whose scale was given.
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
    """Read a log. columns: the name in the file of time, force (or torque) and position (or angle), where it differs.

    scales: factors that turn the numbers of the file into s, N (or N*m) and m (or rad).
    Errors: UsageError that names the file, the line or the column, what was expected and what was found.
    """
    file = read_csv(path, MOST_BYTES)
    names = file.names
    if not any(names):
        raise UsageError(f"{path}: expected a header and rows of numbers below it, found an empty file")
    turns = {**columns}.keys() & set(TURNING.values()) or (
        not {"force", "position"} & {*columns, *names} and set(TURNING.values()) <= set(names)
    )
    roles = {"time": "time"} | {role: TURNING[role] if turns else role for role in TURNING}
    for option, given in (("--column", columns), ("--scale", scales)):
        for name in given:
            if name not in roles.values():
                raise UsageError(f"{option} {name}: expected one of {', '.join(roles.values())}, found {name}")
    used = {}
    for role, name in roles.items():
        wanted = columns.get(name, name)
        tries = [wanted, *(f"{wanted}_{unit}" for unit in ("s", "N", "m", "Nm", "rad") if name not in columns)]
        known = [each for each in tries if each in names]
        if not known:
            meant = nearest(wanted, names)
            hint = f"; did you mean --column {name}={meant}?" if meant else f"; --column {name}=NAME gives its name"
            raise UsageError(f"{path}: expected a column {wanted}, found {file.listed}{hint}")
        used[role] = known[0]
    rows = file.numbers(list(used.values()), LEAST_ROWS)
    found = {role: rows[:, place] * scales.get(name, 1.0) for place, (role, name) in enumerate(roles.items())}
    _refuse_unusable(path, found, roles)
    period, jitter = _period(path, found["time"], roles["time"])
    first = float(found["time"][0])
    return Log(found["force"], found["position"], period, first, bool(turns), jitter, file.sha256, tuple(scales))


def _refuse_unusable(path: str | Path, found: Mapping[str, np.ndarray], roles: Mapping[str, str]) -> None:
    for role, column in found.items():
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
    if not SHORTEST <= period <= LONGEST:
        expected = f"expected steps of {SHORTEST:g} to {LONGEST:g} s, found {period:.6g} s"
        raise UsageError(f"{path}: {name}: {expected}; --scale {name}=FACTOR turns another unit into s, e.g. 1e-9 from ns")
    late = times - times[0] - period * np.arange(len(times))
    off = np.abs(late - np.median(late)) / period
    if off.max() > UNEVEN:
        row = int(off.argmax())
        found = f"a time {off[row]:.3g} steps from where equal ones of {period:.6g} s have it"
        raise UsageError(
            f"{path}:{row + 2}: {name}: expected equal steps, found {found}; resample the log, or take an even part"
        )
    return period, float(off.max())


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
    """The step of the encoder that is visible in the readings (m), 0 if there is none."""
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
