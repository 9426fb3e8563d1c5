"""Write some designs of a front as specs, which every other command accepts."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from wavesweep.results.folder import BEST, HEADER
from wavesweep.search.study import wish_units
from wavesweep.spec import Spec
from wavesweep.spec.drawing import name_of
from wavesweep.spec.keys import BAND_EDGES
from wavesweep.spec.writing import as_toml
from wavesweep.sweep.hardware import GIVEN
from wavesweep.tables.table import Table

MOST = 10


def chosen(rows: int) -> list[int]:
    """Return the rows of the table that are written: equally spaced, the first and the last among them."""
    return sorted({round(each) for each in np.linspace(0, rows - 1, min(rows, MOST)).tolist()})


def spec_of(spec: Spec, row: dict[str, object]) -> Spec:
    """Return the spec with the numbers of a row of the table."""
    return spec.with_values({axis.name: row[axis.name] for axis in spec.design.vary})


def text_of(spec: Spec, row: dict[str, object], stop: float) -> str:
    """Return the spec of a design as text.

    Its [sweep] is over everything that the design holds for, so that the worst row of `zwidth` has the value of the table,
    but for ratios, which no [sweep] has, and for what [for_all] has, which it keeps.
    """
    design, tables = spec.design, spec_of(spec, row).tables()
    walls = sorted(design.wishes, key=lambda wish: wish.name not in ("z_width", "felt"))
    sweep = tables["sweep"]
    if spec.wall:
        names = spec.drawing.wall if spec.drawing else ("K_VE", "B_VE")
        damping = walls[0].options.get("B_VE", (spec.values[spec.wall[1]],))
        sweep = {"along": names[0], names[0]: {"start": 0.0, "stop": stop}, names[1]: list(damping)}
    of_all = {axis.path for axis in spec.for_all.axes} if spec.for_all else set()
    held = {name_of(axis.path): list(axis.values) for axis in design.for_all if axis.path not in of_all}
    held |= {f"operator.{part}": list(values) for part, values in design.hand.items()}
    # What sets the worst may lie between the values that the spec lists.
    worst = dict(part.split("=") for part in str(row.get("z_width_scenario", "")).split(", ") if "=" in part)
    held |= {name: sorted({*held[name], type(held[name][0])(float(value))}) for name, value in worst.items() if name in held}
    swept = {name_of(spec.names.find(name).path) for name in sweep if name != "along"} if spec.drawing else set()
    sweep |= {name: values for name, values in held.items() if name not in swept}
    tables = {name: table for name, table in tables.items() if name not in ("sweep", "bode", "design", "simulate", "measured")}
    tables["simulate"] = {name: spec.simulate[name] for name in GIVEN if spec.simulate[name]}
    said = ", ".join(f"{name} {row[name]:.6g} {unit}".removesuffix(" 1") for name, unit in wish_units(spec).items())
    for path in spec.given:
        *_, name, last = path.split(".")
        if last in BAND_EDGES:  # the order and the cutoff follow from them
            tables["filters"][name] = {part: each for part, each in tables["filters"][name].items() if part in BAND_EDGES}
    ratios = ", ".join(f"{one}/{other}" for one, other, _ in design.ratios)
    left = f"# No [sweep] has the ratios that it holds for: {ratios}.\n" if ratios else ""
    return f"{HEADER}{said}, at their worst.\n{left}{as_toml(tables | {'sweep': sweep})}"


def with_best(table: Table, spec: Spec) -> Table:
    """Return the table with the specs of some of its designs beside it, in the folder BEST."""
    columns = table.columns
    rows = chosen(len(columns["certified"]))
    names = [f"{BEST}/{spec.name}-{number + 1:02d}.toml" for number in rows]
    stop = table.facts["stop"]

    def write(folder: Path) -> None:
        (folder / BEST).mkdir()
        for name, number in zip(names, rows, strict=True):
            row = {key: np.asarray(column[number]).item() for key, column in columns.items()}
            (folder / name).write_text(text_of(spec, row, stop), encoding="utf-8", newline="\n")

    return replace(table, facts=table.facts | {"best": names}, beside=write)
