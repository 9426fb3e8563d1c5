"""How good designs are, the nearest miss if no design meets all bounds, and some designs of a front as specs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.designs.family import Scenario, described
from wavesweep.designs.keys import Design
from wavesweep.designs.table import wish_units
from wavesweep.engine.drawing.drawing import name_of
from wavesweep.program.analyses.hardware_limits import GIVEN
from wavesweep.program.reading.keys import BAND_EDGES
from wavesweep.program.results.folder import BEST, HEADER
from wavesweep.program.spec import Spec
from wavesweep.program.spec.writing import as_toml
from wavesweep.program.tables.table import Table

MOST = 10  # designs that are written
WORST_SHARE = 10.0  # of a bound: what its violation counts at most; values that are not known count more than all
LEAST_LOG = 1e-9  # of a quantity whose logarithm is an objective
EXPERIMENT = ("from", "input", "amplitude", "at_s", "width_s", "duration_s", "wall")  # keys of [simulate] that a design keeps
BY_RATIO = ("z_width", "felt")  # quantities that count by their ratios


def judged(design: Design, records: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return objectives to be made small, `(designs, objectives)`, and violations, `(designs,)`.

    A violation is 0 if all bounds are kept and all values are certified; a design with fewer values that are missing or not
    certified has the smaller one. Without a free wish the objective is the smallest margin with its sign reversed.
    """
    free = [wish for wish in design.wishes if wish.bound is None]
    bounded = [wish for wish in design.wishes if wish.bound is not None]
    objectives, violation = (
        [_objective(wish, records[wish.name]) for wish in free],
        np.zeros(len(records[design.wishes[0].name])),
    )
    margins = []
    for wish in bounded:
        margin = wish.margin(records[wish.name])
        margins.append(np.where(np.isnan(margin), -np.inf, margin))
        by = np.maximum(-margin, 0.0)
        violation += np.where(np.isnan(by), WORST_SHARE, WORST_SHARE * by / (WORST_SHARE + by))
    for wish in design.wishes:
        unknown = _missing(wish, records) | ~records[f"{wish.name}_certified"]
        violation += np.where(unknown, WORST_SHARE * len(design.wishes), 0.0)
    if not free:
        objectives = [-np.min(margins, axis=0)]
    return np.stack(objectives, axis=1), violation


def _missing(wish, records):
    """Where there is no value; a design that can render no wall has none."""
    value = records[wish.name]
    return np.isnan(value) | ((value <= 0) & (wish.name in BY_RATIO))


def _objective(wish, value):
    value = np.log(np.maximum(value, LEAST_LOG)) if wish.name in BY_RATIO else value
    return np.where(np.isnan(value), np.inf, -value if wish.kind.more else value)


def miss(spec: Spec, records: np.ndarray, scenarios: Sequence[Scenario], units: Mapping[str, str]) -> str:
    """Return a text on the nearest miss and on the wishes that conflict with each other; units: of the wishes."""
    design = spec.design
    _, violation = judged(design, records)
    at = int(np.argmin(violation))
    misses = [_nearest(wish, records[at], scenarios, units[wish.name]) for wish in design.wishes]
    against = _against(design, records)
    bounded = any(wish.bound is not None for wish in design.wishes)
    missing = any(bool(_missing(wish, records)[at]) for wish in design.wishes)
    wanted = "meets all bounds" if bounded else f"has a {'' if missing else 'certified '}value for every wish"
    loop = "that is unstable or not proved for all of [for_all]" if spec.for_all else "that is unstable"
    why = f"; a loop {loop} has no value, and `wavesweep check` says which numbers make it so" if missing else ""
    return f"no design of {len(records)} {wanted}; the nearest has {'; '.join(misses)}{against}{why}"


def _nearest(wish, record, scenarios, unit):
    """The value of a wish in the nearest design, with its bound and the scenario that sets it."""
    value, bound, place = record[wish.name], "", ""
    said = "not known" if np.isnan(value) else f"{value:.6g} {unit}".removesuffix(" 1").rstrip()
    if wish.bound is not None:
        bound = f" ({wish.kind.bound.replace('_', ' ')} {wish.bound:g})"
        place = described(scenarios, int(record[f"{wish.name}_scenario"]))
    doubt = "" if np.isnan(value) or record[f"{wish.name}_certified"] else ", not certified"
    return f"{wish.name} {said}{bound}{doubt}{f' with {place}' if place else ''}"


def _against(design, records):
    """Return a text on the first pair of bounds that each were met by some designs but never by the same one.

    If there is no such pair, the text names the bounds that no design met; it is empty if there are none.
    """
    met = {wish.name: wish.margin(records[wish.name]) >= 0 for wish in design.wishes if wish.bound is not None}
    names = list(met)
    for i, name in enumerate(names):
        for name_after in names[i + 1 :]:
            if met[name].any() and met[name_after].any() and not (met[name] & met[name_after]).any():
                counts = f"{met[name].sum()} designs met the one, {met[name_after].sum()} the other, none both"
                return f"; {name} stands against {name_after}: {counts}"
    never = [name for name, flags in met.items() if not flags.any()]
    return f"; no design meets even alone the bound on {', '.join(never)}" if never else ""


def chosen(rows: int) -> list[int]:
    """Return the rows of the table that are written: equally spaced, the first and the last among them."""
    return sorted({round(row) for row in np.linspace(0, rows - 1, min(rows, MOST)).tolist()})


def text_of(spec: Spec, row: dict[str, object], stop: float) -> str:
    """Return the spec of a design as text.

    Its [sweep] is over everything that the design holds for, so that the worst row of `zwidth` has the value of the table,
    but for ratios, which no [sweep] has, and for what [for_all] has, which it keeps. It sweeps no number that the search chose,
    but for the one that a drawn loop is looked along, and keeps the experiment of [simulate].
    """
    tables = spec.with_values({axis.name: row[axis.name] for axis in spec.design.vary}).tables()
    sweep = _sweep(spec, tables["sweep"], row, stop)
    tables = {name: table for name, table in tables.items() if name not in ("sweep", "bode", "design", "simulate", "measured")}
    if spec.simulate:
        tables["simulate"] = {name: spec.hardware[name] for name in GIVEN if spec.hardware[name]}
        if spec.simulate["input"] != "record":
            tables["simulate"] |= {name: spec.simulate[name] for name in EXPERIMENT if f"simulate.{name}" in spec.given}
    said = ", ".join(f"{name} {row[name]:.6g} {unit}".removesuffix(" 1") for name, unit in wish_units(spec).items())
    for path in spec.given:
        *_, name, last = path.split(".")
        if last in BAND_EDGES:  # the order and the cutoff follow from them
            tables["filters"][name] = {edge: value for edge, value in tables["filters"][name].items() if edge in BAND_EDGES}
    ratios = ", ".join(f"{number}/{reference}" for number, reference, _ in spec.design.ratios)
    left = f"# No [sweep] has the ratios that it holds for: {ratios}.\n" * bool(ratios)
    return f"{HEADER}{said}, at their worst.\n{left}{as_toml(tables | {'sweep': sweep})}"


def _sweep(spec: Spec, searched: Mapping[str, Any], row: Mapping[str, object], stop: float) -> dict[str, Any]:
    """The [sweep] of a design, over everything that it holds for; searched: that of the spec."""
    design = spec.design
    walls = sorted(design.wishes, key=lambda wish: wish.name not in ("z_width", "felt"))
    varied = {axis.path for axis in design.vary} - {axis.path for axis in spec.sweep if axis.name == spec.along}
    left_out = {axis.name for axis in spec.sweep if axis.path in varied}
    sweep = {name: value for name, value in searched.items() if name not in left_out}
    if spec.wall:
        names = spec.drawing.wall if spec.drawing else ("K_VE", "B_VE")
        damping = walls[0].options.get("B_VE", (spec.values[spec.wall[1]],))
        sweep = {"along": names[0], names[0]: {"start": 0.0, "stop": stop}, names[1]: list(damping)}
    swept = {name_of(spec.names.find(name).path) for name in sweep if name != "along"} if spec.drawing else set()
    return sweep | {name: values for name, values in _scenario_axes(spec, row).items() if name not in swept}


def _scenario_axes(spec: Spec, row: Mapping[str, object]) -> dict[str, list]:
    """The numbers of [design.for_all] that [for_all] does not have, with their values."""
    design = spec.design
    of_all = {axis.path for axis in spec.for_all.axes} if spec.for_all else set()
    held = {name_of(axis.path): list(axis.values) for axis in design.for_all if axis.path not in of_all}
    held |= {f"operator.{key}": list(values) for key, values in design.hand.items()}
    # What sets the worst may lie between the values that the spec lists.
    worst = dict(pair.split("=") for pair in str(row.get("z_width_scenario", "")).split(", ") if "=" in pair)
    return held | {
        name: sorted({*held[name], type(held[name][0])(float(value))}) for name, value in worst.items() if name in held
    }


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
