"""Measured limits of walls, walls that were tried, and measured responses, from the files that a
spec names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.csv_files import LETTERS_SHOWN, Csv, read_csv, rows_of
from wavesweep.program.reading.units import Unit, column_named, converted, unit_in, unit_of

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec

SINGLE = 1e-6  # by which a coherence of single precision may be above 1
FREQUENCY, NAME, COHERENCE = "frequency_hz", "admittance", "coherence"
FREQUENCIES = (FREQUENCY, "frequency", "freq", "hz")
# responses of position, velocity and acceleration: how often the position is derived
DERIVED = {NAME: 0, "mobility": 1, "accelerance": 2}
SUFFIXES = (("abs", "deg"), ("re", "im"))  # of the two columns of a response
# units of a wall, of a hand that slides and of one that turns
WALL = {"B_VE": ("N*s/m", "N*m*s/rad"), "K_VE": ("N/m", "N*m/rad")}
# and of its responses
RESPONSE = {
    NAME: ("m/N", "rad/(N*m)"),
    "mobility": ("m/(N*s)", "rad/(N*m*s)"),
    "accelerance": ("m/(N*s^2)", "rad/(N*m*s^2)"),
}
STABLE = "stable"
MOST_POINTS_BYTES = 100_000_000
MOST_POINTS, MOST_BYTES_OF_POINTS = 10_000, 10_000_000  # of a file that a spec names
FLAGS = {"1": True, "true": True, "0": False, "false": False}


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """frequency_hz: above 0, increasing. admittance: complex (m/N). coherence: 0 to 1, 1 where
    the file has none."""

    frequency_hz: np.ndarray
    admittance: np.ndarray
    coherence: np.ndarray
    sha256: str


@dataclass(frozen=True, eq=False)
class MeasuredWalls:
    """Damping (N*s/m) and stiffness (N/m) of walls: limits or, with `stable`, walls that were
    tried."""

    B_VE: np.ndarray
    K_VE: np.ndarray
    stable: np.ndarray | None
    sha256: str


def is_response(path: str | Path, columns: Mapping[str, str] | None) -> bool:
    """Whether a file contains a frequency response and not a log. columns: as of
    `read_response`."""
    return (
        FREQUENCY in (columns or {})
        or _frequency(read_csv(path, MOST_POINTS_BYTES * 10).names) != ""
    )


def _frequency(names: Sequence[str]) -> str:
    """The name of the column with the frequencies; empty if there is none."""
    return (column_named(names, FREQUENCIES, "Hz") or ("",))[0]


def _response(suffixes, first, second):
    """A response of two columns, and where it is not above 0."""
    if suffixes == ("abs", "deg"):
        return first * np.exp(1j * np.radians(second)), first <= 0
    return first + 1j * second, (first == 0) & (second == 0)


def read_response(
    path: str | Path,
    least: int = 8,  # rows of a response that is fitted
    most_bytes: int = MOST_POINTS_BYTES,
    scales: Mapping[str, float] | None = None,
    columns: Mapping[str, str] | None = None,
    turns: bool | None = None,
) -> FrequencyResponse:
    """Read a frequency response with at least `least` rows and at most `most_bytes` bytes.

    scales: factors that turn the numbers of the file into Hz and m/N, by the names `frequency` and
    `admittance` (or `mobility`, or `accelerance`). columns: the names in the file of
    `frequency_hz`, `admittance_abs` and so on, where they differ. turns: whether it is one of a
    hand that turns, None where nobody knows.

    Errors: UsageError that names the file and the line or column.
    """
    file = read_csv(path, most_bytes)
    own_names = _own_names(file, dict(columns or {}))
    quantity, suffixes = _form(file, own_names)
    names = [FREQUENCY, *(f"{quantity}_{suffix}" for suffix in suffixes)]
    if COHERENCE in own_names:
        names.append(COHERENCE)
    hertz, first, second, *rest = file.numbers([own_names[name] for name in names], least).T
    scales = scales or {}
    for scaled in scales:
        if scaled not in ("frequency", quantity):
            expected = f"expected one of frequency, {quantity}, found {scaled}"
            raise UsageError(f"--scale {scaled}: {expected}")
    column = own_names[FREQUENCY]
    hertz, _ = converted(hertz, (column, unit_in(column, "Hz")), path, "frequency", scales, "Hz")
    expected = _of_device(RESPONSE[quantity], turns)
    parts = [first, second]
    for index, suffix in enumerate(suffixes):
        column = own_names[f"{quantity}_{suffix}"]
        name, units, factors = (quantity, expected, scales)
        if suffix == "deg":
            name, units, factors = ("phase", ("deg",), None)
        place = (column, unit_in(column, *units))
        parts[index], _ = converted(parts[index], place, path, name, factors, *units)
    if (np.diff(hertz) <= 0).any() or hertz[0] <= 0:
        raise UsageError(
            f"{path}: {FREQUENCY}: expected frequencies above 0 that increase; take one response of several"
        )
    coherence = rest[0] if rest else np.ones(len(hertz))
    if ((coherence <= 0) | (coherence > 1 + SINGLE)).any():
        raise UsageError(f"{path}: {COHERENCE}: expected numbers above 0, at most 1")
    response, unusable = _response(suffixes, *parts)
    if unusable.any():
        raise UsageError(f"{path}: {names[1]}: expected an admittance above 0 at every frequency")
    admittance = response / (2j * np.pi * hertz) ** DERIVED[quantity]
    return FrequencyResponse(hertz, admittance, np.minimum(coherence, 1.0), file.sha256)


def _own_names(file: Csv, columns: dict[str, str]) -> dict[str, str]:
    """The names in a file of the columns of a response that it has, by our names. columns: as of
    `read_response`."""
    names = [FREQUENCY, COHERENCE]
    for quantity, suffixes in product(DERIVED, SUFFIXES):
        names += [f"{quantity}_{suffix}" for suffix in suffixes]
    if FREQUENCY not in columns and _frequency(file.names):
        columns[FREQUENCY] = _frequency(file.names)
    for name in columns:
        if name not in names:
            expected = f"expected one of {', '.join(names)}, found {name}"
            raise UsageError(f"--column {name}: {expected}")
    for column in columns.values():
        if column not in file.names:
            raise UsageError(f"{file.path}: expected a column {column}, found {file.listed}")
    own_names = {name: columns.get(name, name) for name in names}
    return {name: column for name, column in own_names.items() if column in file.names}


def _form(file: Csv, own_names: Mapping[str, str]) -> tuple[str, tuple[str, str]]:
    """The quantity that a file has as two columns, and the suffixes of these. own_names: of its
    columns."""
    for quantity, suffixes in product(DERIVED, SUFFIXES):
        both = all(f"{quantity}_{suffix}" in own_names for suffix in suffixes)
        if both and FREQUENCY in own_names:
            return quantity, suffixes
    expected = f"{NAME}_abs and {NAME}_deg, or {NAME}_re and {NAME}_im, next to {FREQUENCY}"
    raise UsageError(f"{file.path}: expected columns {expected}, found {file.listed}")


def _of_device(units: tuple[str, str], turns: bool | None) -> tuple[str, ...]:
    """The unit of a device that slides, or of one that turns; both where nobody knows."""
    return units if turns is None else (units[turns],)


def read_walls(path: str | Path, units: Mapping[str, Sequence[str]] = WALL) -> MeasuredWalls:
    """Read walls from the columns B_VE, K_VE and, optionally, `stable` (1 or 0, true or false).
    units: of each, into the first of which that its own can be converted to.

    Errors: UsageError that names the file and the line or column.
    """
    file = read_csv(path, MOST_BYTES_OF_POINTS)
    places = []
    for name, expected in units.items():
        place = column_named(file.names, (name,), *expected)
        if place is None or place[0].partition(name)[0]:
            meant = nearest(name, [header for header in file.names if header not in WALL])
            hint = f"; is {meant} meant?" if meant else ""
            raise UsageError(
                f"{path}: expected the columns {' and '.join(WALL)}, found {file.listed}{hint}"
            )
        places.append(place)
    columns = file.numbers([column for column, _ in places]).T
    damping, stiffness = (
        converted(column, place, path, name, None, *units[name])[0]
        for column, place, name in zip(columns, places, WALL, strict=True)
    )
    for name, column in zip(WALL, (damping, stiffness), strict=True):
        if (column < 0).any():
            raise UsageError(
                f"{path}: {name}: expected numbers of at least 0, found {column.min():g}"
            )
    if STABLE in file.names:
        return MeasuredWalls(damping, stiffness, _stable_flags(file), file.sha256)
    if (stiffness == 0).any():
        hint = "where no wall is stable, give one that was tried, in a file with a column stable"
        raise UsageError(f"{path}: K_VE: expected limits above 0, found 0; {hint}")
    return MeasuredWalls(damping, stiffness, None, file.sha256)


def _stable_flags(file):
    """The column `stable` as booleans. Errors: UsageError that names the line."""
    rows = enumerate(rows_of(file.path, file.body.split("\n")), start=file.above + 2)
    cells = [(line, row[file.names.index(STABLE)].strip()) for line, row in rows if row]
    flags = [FLAGS.get(text.lower().removesuffix(".0")) for _, text in cells]
    if None in flags:
        line, text = cells[flags.index(None)]
        raise UsageError(
            f"{file.path}:{line}: {STABLE}: expected 1 or 0, found {text[:LETTERS_SHOWN] or 'nothing'}"
        )
    return np.array(flags)


def walls_of(spec: Spec) -> MeasuredWalls | None:
    """The walls that [measured] names, in the units of the spec's own wall; None if it names none.

    Errors: UsageError.
    """
    path = _measured_file(spec, "z_width")
    if path is None:
        return None
    units = {}
    for name, number in zip(WALL, reversed(spec.wall), strict=False):
        text = spec.names.keys[number].unit
        unit = unit_of(text or _of_device(WALL[name], _turns(spec))[0], *WALL[name])
        if unit is None:
            expected = f"expected {' or '.join(WALL[name])}, as {path} has it, found {text}"
            raise UsageError(f"{spec.name}: {number}.unit: {expected}")
        units[name] = unit
    walls = read_walls(path, WALL | {name: (unit.expected,) for name, unit in units.items()})
    _refuse_many(path, len(walls.K_VE))
    in_spec = {}
    for name, unit in units.items():
        in_spec[name] = Unit(1 / unit.factor, "", "").of(getattr(walls, name))
    return replace(walls, **in_spec)


def _turns(spec: Spec) -> bool:
    """Whether the hand of a spec turns."""
    return bool(spec.drawing and spec.drawing.turns)


def response_of(spec: Spec) -> FrequencyResponse | None:
    """The response that [measured] names; None if it names none. Errors: UsageError."""
    path = _measured_file(spec, "response")
    if path is None:
        return None
    response = read_response(path, 1, MOST_BYTES_OF_POINTS, turns=_turns(spec))
    _refuse_many(path, len(response.coherence))
    return response


def _measured_file(spec: Spec, name: str) -> Path | None:
    """The path of a file that [measured] names, which is relative to the spec's folder."""
    if name not in spec.measured:
        return None
    return Path(spec.source or "").parent / spec.measured[name]


def _refuse_many(path: Path, count: int) -> None:
    """Raise UsageError for more points than a spec may name."""
    if count > MOST_POINTS:
        raise UsageError(f"{path}: expected at most {MOST_POINTS} points, found {count}")
