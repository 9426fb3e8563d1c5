"""Several specs beside each other: the stable intervals of the wall's stiffness, and the responses, as two tables."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Unpack

import numpy as np

from wavesweep.core.columns import Columns, joined
from wavesweep.core.errors import SpecError
from wavesweep.core.spec import Spec, sweep_axes
from wavesweep.core.sweep.running import Options
from wavesweep.core.tables.intervals import interval_kind, intervals
from wavesweep.core.tables.kind import Kind
from wavesweep.core.tables.responses import METHODS, BodeTally, bode_lines, responses
from wavesweep.core.tables.table import Table, facts_of, with_unlike_units


def compare(specs: Sequence[Spec], **work: Unpack[Options]) -> list[Table]:
    """The tables `compare` and `compare-bode` of several specs, each with its own sweep and its own frequencies.

    specs: their names differ. The first table has a row per spec and stable interval along K_VE: the column `spec`, the axes
    of all sweeps, and the columns of `zwidth`. A spec without one of the axes has its own value in that column, or a missing
    one if its controller does not read it. The second is that of `responses`. work: as for `intervals`;
    its progress is called with the counts of one spec after the other, and with those of all responses.
    """
    for spec in specs:  # before the work for any of them
        sweep_axes(spec, "K_VE")
        if missing := spec.without_hand():
            raise SpecError(missing)
    walls, found = _walls(specs, **work)
    both = responses(specs, **(work | {"part": "responses "}))

    def forget():  # once both tables are written
        for table in (*found, both):
            table.forget()

    return [walls, replace(both, kind="compare-bode", forget=forget)]


def walls_of(specs: Sequence[Spec], **work: Unpack[Options]) -> list[Table]:
    """The first of these tables alone."""
    for spec in specs:  # before the work for any of them
        sweep_axes(spec, "K_VE")
    walls, found = _walls(specs, **work)

    def forget():
        for table in found:
            table.forget()

    return [replace(walls, forget=forget)]


def _walls(specs: Sequence[Spec], **work: Unpack[Options]) -> tuple[Table, list[Table]]:
    """The table `compare`, and those of each spec that it is made of."""
    from wavesweep.core.analyses.responses import units_in

    # In turn: each uses all workers.
    for spec in specs:
        spec.refuse_require("compare")
    found = [intervals(spec, "K_VE", **(work | {"part": f"walls of {spec.name}"})) for spec in specs]
    axes = [axis for spec in specs for axis in sweep_axes(spec, "K_VE")[1]]
    names = list(dict.fromkeys(axis.name for axis in axes))
    columns = joined([_with_spec(spec, table.columns, names) for spec, table in zip(specs, found, strict=True)])
    units = {name: units_in([(spec, sweep_axes(spec, "K_VE")[1]) for spec in specs], name) for name in names}
    walls = [(spec.name, spec.names.keys[sweep_axes(spec, "K_VE")[0].path].unit) for spec in specs]
    felt = [(spec.name, spec.units_felt[0]) for spec in specs]
    units |= {"low": walls, "high": walls, "felt_low": felt, "felt_high": felt, "open_low": walls, "open_high": walls}
    facts = with_unlike_units(_facts(specs, found, [axis.path for axis in axes]), units)
    return Table.of("compare", columns, facts), found


def _with_spec(spec: Spec, columns: Columns, names: Sequence[str]) -> Columns:
    from wavesweep.core.analyses.responses import own_value
    from wavesweep.core.sweep.grid import keys_of

    rows, read = len(columns["along"]), keys_of(spec)
    axes = {name: columns.get(name, np.full(rows, own_value(spec, name, read))) for name in names}
    rest = {name: column for name, column in columns.items() if name not in axes}
    return {"spec": np.full(rows, spec.name, dtype=object)} | axes | rest


def _facts(specs, tables, swept):
    facts = [table.facts for table in tables]
    counts = {name: sum(each["slices"][name] for each in facts) for name in ("computed", "skipped", "certified")}
    timings = {"compute_s": sum(each["timings"]["compute_s"] for each in facts)}
    notices = [f"{spec.name}: {said}" for spec, each in zip(specs, facts, strict=True) for said in each["notices"]]
    return facts_of(list(specs), facts[0]["methods"] | METHODS, counts, timings, notices, swept)


KINDS = (
    interval_kind("compare", figure="wavesweep.core.plots.intervals.compare", before=1),
    Kind("compare-bode", lambda _: BodeTally(), bode_lines, figure="wavesweep.core.plots.responses.bode", study="bode"),
)
