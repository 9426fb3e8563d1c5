"""Several specs beside each other: the stable intervals of the wall's stiffness of each, as one table."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from wavesweep.program.analyses.claims import of_rows, word_among
from wavesweep.program.analyses.response_jobs import own_value, units_in
from wavesweep.program.columns import Columns, joined
from wavesweep.program.spec import Axis, Spec, sweep_axes
from wavesweep.program.sweep.grid import keys_of
from wavesweep.program.sweep.running import WorkOptions
from wavesweep.program.tables.interval_table import interval_kind, intervals
from wavesweep.program.tables.table import Table, facts_of, with_unlike_units


def intervals_of_specs(specs: Sequence[Spec], **work: Unpack[WorkOptions]) -> Table:
    """The stable intervals along K_VE of several specs, each over its own sweep.

    specs: their names differ. A row per spec and stable interval: the column `spec`, the axes of
    all sweeps, and the columns of `zwidth`. A spec without one of the axes has its own value in
    that column, or a missing one if its controller does not read it. work: as for `intervals`; its
    progress is called with the counts of one spec after the other.
    """
    swept = []  # each spec with the axes beside K_VE
    axes: list[Axis] = []
    walls = []  # each spec with the unit of its stiffness
    for spec in specs:  # before the work for any of them
        stiffness, other_axes = sweep_axes(spec, "K_VE")
        spec.refuse_require("zwidth of several specs")
        swept.append((spec, other_axes))
        axes += other_axes
        walls.append((spec.name, spec.names.keys[stiffness.path].unit))
    names = list(dict.fromkeys(axis.name for axis in axes))
    tables = []
    blocks = []
    for spec in specs:  # one after the other: each uses all workers
        table = intervals(spec, "K_VE", **(work | {"part": f"walls of {spec.name}"}))
        tables.append(table)
        blocks.append(_with_spec(spec, table.columns, names))
    columns = joined(_with_all_columns(blocks))
    felt = [(spec.name, spec.at_port("N/m")) for spec in specs]
    units = {name: units_in(swept, name) for name in names}
    for prefix, unit_in_specs in (("", walls), ("felt_", felt), ("open_", walls)):
        units[f"{prefix}low"] = unit_in_specs
        units[f"{prefix}high"] = unit_in_specs
    facts = with_unlike_units(_facts(specs, tables, [axis.path for axis in axes]), units)

    def forget() -> None:
        for table in tables:
            table.forget()

    return replace(Table.of("zwidth-specs", columns, facts), forget=forget)


def _with_spec(spec: Spec, columns: Columns, names: Sequence[str]) -> Columns:
    rows = len(columns["along"])
    read = keys_of(spec)
    with_spec = {"spec": np.full(rows, spec.name, dtype=object)}
    for name in names:
        with_spec[name] = (
            columns[name] if name in columns else np.full(rows, own_value(spec, name, read))
        )
    rest = {name: column for name, column in columns.items() if name not in with_spec}
    return with_spec | rest


def _with_all_columns(blocks: Sequence[Columns]) -> list[Columns]:
    """Rows with the columns that rows of other specs have: of a spec without [for_all] those are of
    its own numbers, and none is refuted."""
    names = dict.fromkeys(name for block in blocks for name in block)
    whole: list[Columns] = []
    for block in blocks:
        rows = len(block["along"])
        without = {"guarantee": np.full(rows, "spec", object), "settled": block["certified"]}
        for name in ("left_open", "counterexample"):
            without[name] = np.full(rows, "", object)
        missing = np.full(rows, np.nan)
        whole.append({name: block.get(name, without.get(name, missing)) for name in names})
    return whole


def _facts(
    specs: Sequence[Spec], tables: Sequence[Table], swept: Collection[str]
) -> dict[str, Any]:
    counts = dict.fromkeys(("computed", "skipped", "certified"), 0)
    compute_s = 0.0
    notices: list[str] = []
    warnings: list[str] = []
    claims = {}
    for spec, table in zip(specs, tables, strict=True):
        for name in counts:
            counts[name] += table.facts["slices"][name]
        compute_s += table.facts["timings"]["compute_s"]
        notices += [f"{spec.name}: {said}" for said in table.facts["notices"]]
        warnings += [f"{spec.name}: {said}" for said in table.facts["warnings"]]
        for word in table.facts["claims"]:
            claims[word_among(spec.name, word)] = of_rows(table.facts, word)
    methods = tables[0].facts["methods"]
    timings = {"compute_s": compute_s}
    facts = facts_of(list(specs), methods, counts, timings, notices, swept, claims=claims)
    return facts | {"warnings": warnings}


KINDS = (
    interval_kind(
        "zwidth-specs", figure="wavesweep.program.plots.interval_figures.of_specs", before=1
    ),
)
