"""How good designs are, the nearest miss if no design meets all bounds, and some designs of a
front as specs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.designs.family import Scenario, described
from wavesweep.designs.keys import Design
from wavesweep.designs.table import wish_in_words, wish_units
from wavesweep.engine.drawing import name_of
from wavesweep.program.analyses.hardware_limits import GIVEN
from wavesweep.program.reading.keys import BAND_EDGES
from wavesweep.program.results.folder import BEST, HEADER
from wavesweep.program.spec import Spec
from wavesweep.program.spec.writing import as_toml
from wavesweep.program.tables.table import Table

# of a bound: what its violation counts at most; values that are not known count more than all
WORST_SHARE = 10.0
BY_RATIO = ("z_width", "felt")  # quantities that count by their ratios


def judged(design: Design, records: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return objectives to be made small, `(designs, objectives)`, and violations, `(designs,)`.

    A violation is 0 if all bounds are kept and all values are certified; a design with fewer values
    that are missing or not certified has the smaller one. Without a free wish the objective is the
    smallest margin with its sign reversed.
    """
    objectives = []
    margins = []
    violation = np.zeros(len(records[design.wishes[0].name]))
    for wish in design.wishes:
        value = records[wish.name]
        if wish.bound is None:
            objectives.append(_objective(wish, value))
            continue
        margin = wish.margin(value)
        margins.append(np.where(np.isnan(margin), -np.inf, margin))
        by = np.maximum(-margin, 0.0)
        violation += np.where(np.isnan(by), WORST_SHARE, WORST_SHARE * by / (WORST_SHARE + by))
    for wish in design.wishes:
        unknown = _missing(wish, records) | ~records[f"{wish.name}_certified"]
        violation += np.where(unknown, WORST_SHARE * len(design.wishes), 0.0)
    if not objectives:
        objectives = [-np.min(margins, axis=0)]
    return np.stack(objectives, axis=1), violation


def _missing(wish, records):
    """Where there is no value; a design that can render no wall has none."""
    value = records[wish.name]
    return np.isnan(value) | ((value <= 0) & (wish.word in BY_RATIO))


def _objective(wish, value):
    if wish.word in BY_RATIO:
        value = np.log(np.maximum(value, 1e-9))  # where the logarithm is an objective
    if wish.kind.more:
        value = -value
    return np.where(np.isnan(value), np.inf, value)


def miss(
    spec: Spec, records: np.ndarray, scenarios: Sequence[Scenario], units: Mapping[str, str]
) -> str:
    """Return a text on the nearest miss and on the wishes that conflict with each other; units:
    of the wishes."""
    design = spec.design
    _, violation = judged(design, records)
    nearest = int(np.argmin(violation))
    misses = [
        _nearest(wish, records[nearest], scenarios, units[wish.name]) for wish in design.wishes
    ]
    missing = any(bool(_missing(wish, records)[nearest]) for wish in design.wishes)
    if any(wish.bound is not None for wish in design.wishes):
        wanted = "meets all bounds"
    elif missing:
        wanted = "has a value for every wish"
    else:
        wanted = "has a certified value for every wish"
    said = f"no design of {len(records)} {wanted}; the nearest has {'; '.join(misses)}{_against(design, records)}"
    if missing:
        if spec.for_all:
            loop = "that is unstable or not proved for all of [for_all]"
        else:
            loop = "that is unstable"
        said += f"; a loop {loop} has no value, see `wavesweep check`, and what the search could not bound has none either"
    return said


def _nearest(wish, record, scenarios, unit):
    """The value of a wish in the nearest design, with its bound and the scenario that sets it."""
    value = record[wish.name]
    if np.isnan(value):
        said = f"{wish.name} not known"
    else:
        said = f"{wish.name} {wish_in_words(wish.name, value, unit, 6)}"
    if wish.bound is not None:
        said += f" ({wish.kind.bound.replace('_', ' ')} {wish.bound:g})"
    if not np.isnan(value) and not record[f"{wish.name}_certified"]:
        said += ", not certified"
    if wish.bound is not None:
        place = described(scenarios, int(record[f"{wish.name}_scenario"]))
        if place:
            said += f" with {place}"
    return said


def _against(design, records):
    """Return a text on the first pair of bounds that each were met by some designs but never by the
    same one.

    If there is no such pair, the text names the bounds that no design met; it is empty if there are
    none.
    """
    met = {}
    for wish in design.wishes:
        if wish.bound is not None:
            met[wish.name] = wish.margin(records[wish.name]) >= 0
    for first, second in combinations(met, 2):
        if met[first].any() and met[second].any() and not (met[first] & met[second]).any():
            counts = (
                f"{met[first].sum()} designs met the one, {met[second].sum()} the other, none both"
            )
            return f"; {first} stands against {second}: {counts}"
    never = [name for name, flags in met.items() if not flags.any()]
    if never:
        return f"; no design meets even alone the bound on {', '.join(never)}"
    return ""


def chosen(rows: int) -> list[int]:
    """Return the rows of the table that are written: equally spaced, the first and the last
    among them."""
    return sorted(
        # Designs that are written.
        {round(row) for row in np.linspace(0, rows - 1, min(rows, 10)).tolist()}
    )


def text_of(spec: Spec, row: dict[str, object], stop: float) -> str:
    """Return the spec of a design as text.

    Its [for_all] has what the design holds for, with the value of a number that sets the stiffest
    wall, so that the worst row of `zwidth` has the value of the table. It sweeps no number that the
    search chose, but for the one that a drawn loop is looked along, and keeps [design], whose
    wishes a report holds against what is reached, and the experiment of [simulate], without frames
    of a file, which may lie elsewhere.
    """
    tables = spec.with_values({axis.name: row[axis.name] for axis in spec.design.vary}).tables()
    sweep = _sweep(spec, tables["sweep"], stop)
    for name in ("sweep", "bode", "measured"):
        tables.pop(name, None)
    tables["design"] = spec.design.written()
    if spec.simulate:
        simulated = {name: spec.hardware[name] for name in GIVEN if spec.hardware[name]}
        given_keys = {path.split(".")[1] for path in spec.simulate.given}
        for name, value in spec.simulate.written().items():
            if name in given_keys and not (name == "frames" and spec.simulate.frames_file):
                simulated[name] = value
        tables["simulate"] = simulated
    for path in spec.given:
        *_, name, last = path.split(".")
        if last in BAND_EDGES:  # the order and the cutoff follow from them
            keys = tables["filters"][name]
            tables["filters"][name] = {
                edge: value for edge, value in keys.items() if edge in BAND_EDGES
            }
    wishes = [
        f"{name} {wish_in_words(name, row[name], unit, 6)}"
        for name, unit in wish_units(spec).items()
    ]
    text = f"{HEADER}{', '.join(wishes)}, at their worst.\n"
    tables["sweep"] = sweep
    if spec.for_all and spec.for_all.unknown:
        _add_worst(spec, row, tables["for_all"])
    return text + as_toml(tables)


def _sweep(spec: Spec, searched: Mapping[str, Any], stop: float) -> dict[str, Any]:
    """The [sweep] of a design, over its walls; searched: that of the spec."""
    design = spec.design
    if spec.wall:
        stiffness, damping = spec.drawing.wall if spec.drawing else ("K_VE", "B_VE")
        walls = sorted(design.wishes, key=lambda wish: wish.word not in ("z_width", "felt"))
        dampings = walls[0].options.get("B_VE", (spec.values[spec.wall[1]],))
        sweep = {
            "along": stiffness,
            stiffness: {"start": 0.0, "stop": stop},
            damping: list(dampings),
        }
    else:
        varied = {axis.path for axis in design.vary}
        sweep = dict(searched)
        for axis in spec.sweep:
            if axis.path in varied and axis.name != spec.along:
                sweep.pop(axis.name, None)
    return sweep


def _add_worst(
    spec: Spec, row: Mapping[str, object], for_all: Mapping[str, dict[str, Any]]
) -> None:
    """Add what sets the stiffest wall to the values of numbers in [for_all], as it may lie between
    them."""
    listed = {
        name_of(axis.path): for_all[axis.name]["values"]
        for axis in spec.for_all.unknown
        if axis.values
    }
    for pair in str(row.get("z_width_scenario", "")).split(", "):
        name, is_set, value = pair.partition("=")
        if is_set and name in listed:
            number = type(listed[name][0])(float(value))
            listed[name][:] = sorted({*listed[name], number})


def with_best(table: Table, spec: Spec) -> Table:
    """Return the table, with the specs of some of its designs in the folder BEST."""
    columns = table.columns
    rows = chosen(len(columns["certified"]))
    names = [f"{BEST}/{spec.name}-{number + 1:02d}.toml" for number in rows]
    stop = table.facts["stop"]

    def write(folder: Path) -> None:
        (folder / BEST).mkdir()
        for name, number in zip(names, rows, strict=True):
            row = {key: np.asarray(column[number]).item() for key, column in columns.items()}
            (folder / name).write_text(text_of(spec, row, stop), encoding="utf-8", newline="\n")

    return replace(table, facts=table.facts | {"best": names}, extra_files=write)
