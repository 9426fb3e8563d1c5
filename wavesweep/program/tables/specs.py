"""Several specs beside each other: the stable intervals of the wall's stiffness of each, as one table."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from wavesweep.program.analyses.response_jobs import own_value, units_in
from wavesweep.program.columns import Columns, joined
from wavesweep.program.spec import Spec, sweep_axes
from wavesweep.program.sweep.grid import keys_of
from wavesweep.program.sweep.running import WorkOptions
from wavesweep.program.tables.interval_table import interval_kind, intervals
from wavesweep.program.tables.table import Table, facts_of, with_unlike_units


def intervals_of_specs(specs: Sequence[Spec], **work: Unpack[WorkOptions]) -> Table:
    """The stable intervals along K_VE of several specs, each over its own sweep.

    specs: their names differ. A row per spec and stable interval: the column `spec`, the axes of all sweeps, and the columns of
    `zwidth`. A spec without one of the axes has its own value in that column, or a missing one if its controller does not read
    it. work: as for `intervals`; its progress is called with the counts of one spec after the other.
    """
    swept = []
    for spec in specs:  # before the work for any of them
        swept.append((spec, sweep_axes(spec, "K_VE")[1]))
        spec.refuse_require("zwidth of several specs")
    # One after the other: each uses all workers.
    tables = [intervals(spec, "K_VE", **(work | {"part": f"walls of {spec.name}"})) for spec in specs]
    axes = [axis for _, other_axes in swept for axis in other_axes]
    names = list(dict.fromkeys(axis.name for axis in axes))
    columns = joined([_with_spec(spec, table.columns, names) for spec, table in zip(specs, tables, strict=True)])
    units = {name: units_in(swept, name) for name in names}
    walls = [(spec.name, spec.names.keys[sweep_axes(spec, "K_VE")[0].path].unit) for spec in specs]
    felt = [(spec.name, spec.units_felt[0]) for spec in specs]
    units |= {"low": walls, "high": walls, "felt_low": felt, "felt_high": felt, "open_low": walls, "open_high": walls}
    facts = with_unlike_units(_facts(specs, tables, [axis.path for axis in axes]), units)

    def forget():
        for table in tables:
            table.forget()

    return replace(Table.of("zwidth-specs", columns, facts), forget=forget)


def _with_spec(spec: Spec, columns: Columns, names: Sequence[str]) -> Columns:
    rows, read = len(columns["along"]), keys_of(spec)
    axes = {name: columns.get(name, np.full(rows, own_value(spec, name, read))) for name in names}
    rest = {name: column for name, column in columns.items() if name not in axes}
    return {"spec": np.full(rows, spec.name, dtype=object)} | axes | rest


def _facts(specs, tables, swept):
    facts = [table.facts for table in tables]
    counts = {name: sum(of_spec["slices"][name] for of_spec in facts) for name in ("computed", "skipped", "certified")}
    timings = {"compute_s": sum(of_spec["timings"]["compute_s"] for of_spec in facts)}
    notices = [f"{spec.name}: {said}" for spec, of_spec in zip(specs, facts, strict=True) for said in of_spec["notices"]]
    return facts_of(list(specs), facts[0]["methods"], counts, timings, notices, swept)


KINDS = (interval_kind("zwidth-specs", figure="wavesweep.program.plots.interval_figures.of_specs", before=1),)
