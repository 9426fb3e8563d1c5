"""Measured limits of walls, walls that were tried, and measured responses, from the files that a
spec names."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.csv_files import LETTERS_SHOWN, read_csv

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec

FREQUENCY, NAME, COHERENCE = "frequency_hz", "admittance", "coherence"
FREQUENCIES = (FREQUENCY, "frequency (hz)", "frequency", "freq_hz", "freq (hz)", "freq", "hz")
DERIVED = {
    NAME: 0,
    "mobility": 1,
    "accelerance": 2,
}  # responses of position, velocity and acceleration
WALL, STABLE = ("B_VE", "K_VE"), "stable"
LEAST_RESPONSE_ROWS = 8  # of a response that is fitted
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


def is_response(path: str | Path, columns: Mapping[str, str] | None = None) -> bool:
    """Whether a file contains a frequency response and not a log. columns: as of
    `read_response`."""
    return (
        FREQUENCY in (columns or {})
        or _frequency(read_csv(path, MOST_POINTS_BYTES * 10).names) != ""
    )


def _frequency(names: Sequence[str]) -> str:
    """The name of the column with the frequencies (Hz); empty if there is none."""
    return next((name for name in names if name.lower() in FREQUENCIES), "")


def read_response(
    path: str | Path,
    least: int = LEAST_RESPONSE_ROWS,
    most: int = MOST_POINTS_BYTES,
    scales: Mapping[str, float] | None = None,
    columns: Mapping[str, str] | None = None,
) -> FrequencyResponse:
    """Read a frequency response with at least `least` rows and at most `most` bytes.

    scales: factors that turn the numbers of the file into Hz and m/N, by the names `frequency` and
    `admittance` (or `mobility`, or `accelerance`). columns: the names in the file of
    `frequency_hz`, `admittance_abs` and so on, where they differ.

    Errors: UsageError that names the file and the line or column.
    """
    file = read_csv(path, most)
    columns = dict(columns or {})
    if FREQUENCY not in columns and _frequency(file.names):
        columns[FREQUENCY] = _frequency(file.names)
    forms = list(product(DERIVED, (("abs", "deg"), ("re", "im"))))
    known = [f"{name}_{suffix}" for name, suffixes in forms for suffix in suffixes]
    known = [FREQUENCY, COHERENCE, *known]
    if unknown := [name for name in columns if name not in known]:
        raise UsageError(
            f"--column {unknown[0]}: expected one of {', '.join(known)}, found {unknown[0]}"
        )
    if missing := [name for name in columns if columns[name] not in file.names]:
        raise UsageError(f"{path}: expected a column {columns[missing[0]]}, found {file.listed}")
    there = {name: columns.get(name, name) for name in known}
    there = {name: column for name, column in there.items() if column in file.names}
    readable = [
        (name, suffixes)
        for name, suffixes in forms
        if {f"{name}_{suffix}" for suffix in suffixes} <= {*there}
    ]
    if not readable or FREQUENCY not in there:
        expected = f"{NAME}_abs and {NAME}_deg, or {NAME}_re and {NAME}_im, next to {FREQUENCY}"
        raise UsageError(f"{path}: expected columns {expected}, found {file.listed}")
    name, suffix_pair = readable[0]
    names = [
        FREQUENCY,
        *(f"{name}_{suffix}" for suffix in suffix_pair),
        *[COHERENCE] * (COHERENCE in there),
    ]
    hertz, first, two, *rest = file.numbers([there[name] for name in names], least).T
    scales = scales or {}
    if unknown := [scaled for scaled in scales if scaled not in ("frequency", name)]:
        raise UsageError(
            f"--scale {unknown[0]}: expected one of frequency, {name}, found {unknown[0]}"
        )
    hertz = hertz * scales.get("frequency", 1.0)
    if (np.diff(hertz) <= 0).any() or hertz[0] <= 0:
        raise UsageError(
            f"{path}: {FREQUENCY}: expected frequencies above 0 that increase; take one response of several"
        )
    coherence = rest[0] if rest else np.ones(len(hertz))
    if ((coherence <= 0) | (coherence > 1)).any():
        raise UsageError(f"{path}: {COHERENCE}: expected numbers above 0, at most 1")
    if suffix_pair[0] == "abs":
        H, unusable = first * np.exp(1j * np.radians(two)), first <= 0
    else:
        H, unusable = first + 1j * two, (first == 0) & (two == 0)
    if unusable.any():
        raise UsageError(f"{path}: {names[1]}: expected an admittance above 0 at every frequency")
    H = scales.get(name, 1.0) * H
    return FrequencyResponse(
        hertz, H / (2j * np.pi * hertz) ** DERIVED[name], coherence, file.sha256
    )


def read_walls(path: str | Path) -> MeasuredWalls:
    """Read walls from the columns B_VE, K_VE and, optionally, `stable` (1 or 0, true or false).

    Errors: UsageError that names the file and the line or column.
    """
    file = read_csv(path, MOST_BYTES_OF_POINTS)
    for name in WALL:
        if name not in file.names:
            meant = nearest(name, [header for header in file.names if header not in WALL])
            hint = f"; is {meant} meant?" if meant else ""
            raise UsageError(
                f"{path}: expected the columns {' and '.join(WALL)}, found {file.listed}{hint}"
            )
    damping, stiffness = file.numbers(WALL).T
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
    rows = enumerate(csv.reader(file.body.split("\n")), start=file.above + 2)
    cells = [(line, row[file.names.index(STABLE)].strip()) for line, row in rows if row]
    flags = [FLAGS.get(text.lower().removesuffix(".0")) for _, text in cells]
    if None in flags:
        line, text = cells[flags.index(None)]
        raise UsageError(
            f"{file.path}:{line}: {STABLE}: expected 1 or 0, found {text[:LETTERS_SHOWN] or 'nothing'}"
        )
    return np.array(flags)


def walls_of(spec: Spec) -> MeasuredWalls | None:
    """The walls that [measured] names; None if it names none. Errors: UsageError."""
    return _points(
        spec, "z_width", lambda path: (walls_read := read_walls(path), len(walls_read.K_VE))
    )


def response_of(spec: Spec) -> FrequencyResponse | None:
    """The response that [measured] names; None if it names none. Errors: UsageError."""
    return _points(
        spec,
        "response",
        lambda path: (
            response_read := read_response(path, 1, MOST_BYTES_OF_POINTS),
            len(response_read.coherence),
        ),
    )


def _points(spec, name, read):
    if name not in spec.measured:
        return None
    points, count = read(path := Path(spec.source or "").parent / spec.measured[name])
    if count > MOST_POINTS:
        raise UsageError(f"{path}: expected at most {MOST_POINTS} points, found {count}")
    return points
