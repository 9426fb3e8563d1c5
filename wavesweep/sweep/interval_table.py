"""Stable intervals over a sweep, as a table."""

import time

import numpy as np

from wavesweep.spec import Spec, sweep_axes
from wavesweep.sweep.grid import make_grid
from wavesweep.sweep.run import Run, facts_of
from wavesweep.sweep.slices import solve_loops


def intervals(spec: Spec, along: str | None = None, jobs=None, backend=None, scheduler=None, progress=None) -> Run:
    """Stable intervals along `along` (the spec's own by default) for every combination of the other axes of [sweep]."""
    started = time.perf_counter()
    axis, others = sweep_axes(spec, along)
    grid = make_grid(spec, others, axis.path)
    found = solve_loops(grid, axis.path, (axis.start, axis.stop), np.arange(grid.loops))
    columns = table(grid, axis.name, found, np.arange(grid.size))
    distinct = grid.loops * grid.walls
    certified = np.ones(distinct, bool)
    certified[found.column[~found.certified]] = False
    return Run(columns, facts_of(
        spec, {"intervals": method(axis.path)},
        {"computed": distinct, "skipped": grid.size - distinct, "certified": int(certified.sum())},
        {"compute_s": time.perf_counter() - started}, notices(grid),
    ))


def table(grid, along: str, found, combination) -> dict:
    """The table's columns for the combinations (flat indices), from intervals whose columns are loop * walls + wall."""
    loop, wall = grid.column_of(combination)
    column = loop * grid.walls + wall
    first = np.searchsorted(found.column, column)
    rows = np.searchsorted(found.column, column, side="right") - first
    row = np.repeat(first - np.concatenate([[0], np.cumsum(rows)[:-1]]), rows) + np.arange(rows.sum())
    which = np.repeat(np.arange(combination.size), rows)
    leading = {name: values[which] for name, values in grid.axis_columns(combination).items()}
    return leading | {
        "along": np.full(row.size, along, dtype=object), "intervals": found.count[row],
        "interval": np.maximum(found.index[row], 0), "low": found.low[row], "high": found.high[row],
        "low_omega": found.low_omega[row], "high_omega": found.high_omega[row],
        "certified": found.certified[row], "residual": found.residual[row],
    }


def method(path) -> str:
    """How intervals along that key are found, in a line."""
    return "crossings of the unit circle from one real polynomial, proved by Smith's discs, polished in state space"


def notices(grid) -> list[str]:
    """What a user should know before reading the table."""
    kind = grid.spec.values["controller.kind"]
    return [f"{axis.name} is not read by {kind}: evaluated once, its rows repeated" for axis in grid.ignored]
