"""A log of a run beside its simulation: inputs from the log, and what was measured of the outputs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.program.columns import run_column
from wavesweep.program.csv_files import Csv, option, read_csv, seconds
from wavesweep.program.reading.units import TIME, column_named, converted, unit_in
from wavesweep.program.spec import Spec
from wavesweep.program.tables.columns import signals_of
from wavesweep.simulation.columns import COLUMNS

MOST_TICKS = 10_000_000  # of a log
BESIDE = "log_"  # begins the columns of what was measured


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """Columns of a log, a value per tick: that of the newest row, each of which counts from the
    tick next to its time on.

    inputs: signals from outside by their names. outputs: what was measured, by the names of
    columns of the simulation. fresh: whether a tick has a new row. units: of outputs. columns: of
    the file, by the names of what is taken from it. said: sentences on units. sha256: of the file.
    """

    inputs: Mapping[str, np.ndarray]
    outputs: Mapping[str, np.ndarray]
    fresh: np.ndarray
    units: Mapping[str, str]
    columns: Mapping[str, str]
    said: tuple[str, ...]
    sha256: str


def _places(
    path: str | Path, file: Csv, units: Mapping[str, str], columns: Mapping[str, str]
) -> dict[str, tuple[str, str]]:
    """Column and its unit of each name that a file has; columns: those that the user names."""
    places = {}
    for name, unit in units.items():
        wanted = columns.get(name)
        if wanted in file.names:
            places[name] = (wanted, unit_in(wanted, unit))
            continue
        usual = dict.fromkeys((name, *TIME)) if name == "time" else (name,)
        place = column_named(file.names, (wanted,) if wanted else usual, unit)
        if place:
            places[name] = place
        elif wanted:
            meant = nearest(wanted, file.names)
            hint = f"; did you mean {option(name, meant)}?" if meant else ""
            raise UsageError(f"{path}: expected a column {wanted}, found {file.listed}{hint}")
    return places


def _refuse_unknown(flag: str, names: Iterable[str], known: Collection[str]) -> None:
    """UsageError for a name that the run does not have."""
    for name in names:
        if name not in known:
            near = nearest(name, known)
            meant = f"; did you mean {near}?" if near else ""
            raise UsageError(
                f"{flag} {name}: expected one of {', '.join(known)}, found {name}{meant}"
            )


def _refuse_lacking(
    path: str | Path, file: Csv, role: str, names: Collection[str], places: Collection[str]
) -> None:
    """UsageError for a log without any column of a role, which may have some names."""
    if not any(name in places for name in names):
        expected = f"a column of {role} ({', '.join(sorted(names))})"
        hint = f"--column {min(names)}=NAME gives its name"
        raise UsageError(f"{path}: expected {expected}, found {file.listed}; {hint}")


def read_run(
    path: str | Path, columns: Mapping[str, str], scales: Mapping[str, float], spec: Spec
) -> MeasuredRun:
    """Read a log of a spec's loop.

    columns: the name in the file of time, of inputs and of outputs; others are those that the file
    has under their own names. scales: factors to SI, or the unit of the port, by the same names.

    Errors: UsageError for a file that cannot be used, a name that the run does not have, or a log
    without an input or without an output.
    """
    entries, shown = _names(spec)
    known_units = {"time": "s"} | {name: unit for name, (_, unit) in entries.items()} | shown
    _refuse_unknown("--column", columns, known_units)
    _refuse_unknown("--scale", scales, known_units)
    file = read_csv(path, 1_000_000_000)  # bytes
    places = _places(path, file, known_units, columns)
    for role, names in (("time", ["time"]), ("an input", entries), ("an output", shown)):
        _refuse_lacking(path, file, role, names, places)
    rows = file.numbers([column for column, _ in places.values()], 2)
    values = {}
    said = []
    for (name, place), column in zip(places.items(), rows.T, strict=True):
        unit = known_units[name]
        values[name] = column * scales.get(name, 1.0)
        if unit:
            values[name], text = converted(column, place, path, name, scales, unit)
            said.append(text)
    newest = _newest_rows(path, values["time"], spec.tick_hz)
    return MeasuredRun(
        inputs={entries[name][0]: values[name][newest] for name in entries if name in places},
        outputs={name: values[name][newest] for name in shown if name in places},
        fresh=np.diff(newest, prepend=-1) > 0,
        units={name: unit for name, unit in shown.items() if name in places},
        columns={name: column for name, (column, _) in places.items()},
        said=tuple(filter(None, said)),
        sha256=file.sha256,
    )


def _names(spec: Spec) -> tuple[dict[str, tuple[str, str]], dict[str, str]]:
    """The inputs of a run, by the names of their columns, with signal and unit; and the units of
    its other columns."""
    fields = {field.name: spec.at_port(field.unit) for field in COLUMNS["simulate"]}
    drawing = spec.drawing
    entries = {}
    if drawing is None or drawing.hand:
        entries["f_h"] = (drawing.hand[0] if drawing else "f_h", fields["f_h"])
    for name, signal, unit in drawing.inputs if drawing else ():
        if not (drawing.hand and signal == drawing.hand[0]):
            entries[run_column("inputs", name)] = (signal, unit)
    drawn = {} if drawing is None else signals_of({"spec": spec.tables()})
    shown = {name: field.unit for name, field in drawn.items() if name not in entries}
    motion = ("x", "v", "x_hat", "v_hat", "f_m", "f_device", "F_s")
    if "f_h" in entries:
        shown |= {name: fields[name] for name in motion if name not in shown}
    return entries, shown


def _newest_rows(path: str | Path, times: np.ndarray, tick_hz: float) -> np.ndarray:
    """The row that counts in each tick, from the first row's to the last row's."""
    steps = np.diff(times)
    if (steps <= 0).any():
        row = int((steps <= 0).argmax())
        raise UsageError(
            f"{path}: time: expected times that increase, found {seconds(times[row + 1])} after {seconds(times[row])}"
        )
    places = np.round((times - times[0]) * tick_hz)
    if places[-1] > MOST_TICKS:
        raise UsageError(
            f"{path}: time: expected at most {MOST_TICKS} ticks, found {places[-1]:.0f}; take a part of it, or --scale time=0.001 if it "
            "is in ms"
        )
    return np.searchsorted(places, np.arange(int(places[-1]) + 1), side="right") - 1


def beside(
    columns: Mapping[str, np.ndarray], run: MeasuredRun
) -> tuple[dict[str, np.ndarray], dict[str, dict[str, float]]]:
    """What was measured as columns beside those of the simulation, and by how much these differ in
    the ticks with a new row: the root mean square, the largest, when, and the size of the log."""
    added = {}
    apart = {}
    count = len(columns["tick"])
    fresh = run.fresh[:count]
    for name, measured in run.outputs.items():
        if name not in columns:
            continue
        added[f"{BESIDE}{name}"] = measured[:count]
        off = np.where(fresh, columns[name] - measured[:count], 0.0)
        if not count or np.isnan(off).all():
            continue
        worst = int(np.abs(off).argmax())
        apart[name] = {
            "rms": float(np.sqrt((off**2).sum() / fresh.sum())),
            "largest": float(abs(off[worst])),
            "largest_s": float(columns["time_s"][worst]),
            "measured_rms": float(np.sqrt(np.mean(measured[:count][fresh] ** 2))),
        }
    return added, apart


def notices_of(run: MeasuredRun, columns: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Yield what is said of the units of a log, and of outputs that do not begin at rest."""
    yield from run.said
    for name, measured in run.outputs.items():
        if name in columns and len(measured) and abs(measured[0]) > 0.1 * np.ptp(measured) > 0:
            yield f"{name} begins at {measured[0]:.6g} in the log, and at 0 in the simulation, which begins at rest"
