"""Stable intervals over a sweep: those of the spec's loop and, as an option, those for hands; `zwidth`, `stability-region`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from wavesweep.program.analyses.assumptions import notices_of
from wavesweep.program.columns import Columns, joined
from wavesweep.program.number_words import span_in_words
from wavesweep.program.tables.kind import Kind, Line, Numbers, Recompute, Summary
from wavesweep.program.tables.table import Table, facts_of, spans_held

if TYPE_CHECKING:
    from wavesweep.program.analyses.claims import Claim
    from wavesweep.program.spec import Spec
    from wavesweep.program.sweep.job import Job
    from wavesweep.program.sweep.running import Run, WorkOptions
    from wavesweep.program.tables.hand_rows import Hands


def intervals(
    spec: Spec, along: str | None = None, hands: Hands | None = None, **work: Unpack[WorkOptions]
) -> Table:
    """Stable intervals along `along` (the spec's own by default) for every combination of the other axes of [sweep].

    hands: adds the column `hand` and rows for other hands. Its words are "free" for the device
    alone, "operator" for the spec's operator if it has one, "passive" and "box" (see `Hands`), and
    "port" for the intervals in which the spec's own loop is stable and passive at the hand's port.
    If only the port is added, the other rows are those of the spec's loop. work: jobs, backend,
    scheduler, progress, checkpoint and force, see `Work`. Raises UsageError, CheckpointError (torn,
    or of another run), WavesweepError (a worker process died).
    """
    from wavesweep.program.sweep.running import Work, run

    stages = stages_of(spec, along, hands)
    result = run({stage.hand: stage.job for stage in stages}, Work.of(work))
    timings = dict(result.timings)
    if hands is not None:
        timings.pop("workers", None)
    facts = _facts(spec, hands, stages, result.certified, timings)
    facts["warnings"] = result.warnings
    facts |= _in_the_way(stages[0], result)
    facts |= _without_wall(stages[0])
    axes = {axis.name: axis.values for axis in stages[0].job.grid.axes}
    kind = KINDS[2 if hands else 0]

    def blocks() -> Iterator[Columns]:
        for stage in stages:
            for block in result.blocks(stage.hand):
                yield kind.ordered(_finished(block, stage, stages, hands))

    return Table(kind.name, blocks, facts, axes, forget=result.forget, rows=result.rows)


@dataclass(frozen=True, slots=True)
class Stage:
    """One kind of rows.

    hand: the word in the column `hand`, empty if the table has no such column. job: computes the
    rows. method: in a line.
    """

    hand: str
    job: Job
    method: str


def stages_of(spec: Spec, along: str | None, hands: Hands | None) -> list[Stage]:
    """The stages of a run, settled before anything is computed. Raises UsageError for a job that cannot be done."""
    from wavesweep.program.analyses.interval_jobs import job_of, method

    job = job_of(spec, along)
    how = method(job.asked)
    if hands is None:
        return [Stage("", job, how), *_guaranteed(job, None)]
    hands.refuse(job)
    free = hands.without_operator(spec)
    stages = [Stage("free" if free is None else "operator", job, how)]
    if free is not None and hands.replaced:
        stages.insert(0, Stage("free", job_of(free, along), how))
    return [*stages, *_guaranteed(job, hands)]


def _guaranteed(job: Job, hands: Hands | None) -> Iterator[Stage]:
    """Yield the stages of what a run guarantees beside its own job."""
    from wavesweep.program.analyses.interval_jobs import guaranteed
    from wavesweep.program.sweep.job import cut_otherwise
    from wavesweep.program.tables.hand_rows import guarantees_of

    for guarantee in guarantees_of(job, hands):
        yield Stage(
            guarantee.kind, guaranteed(cut_otherwise(job, deep=1), guarantee), guarantee.method
        )


def of_calls(job: Job, progress: bool) -> tuple[Columns, dict[str, Claim]]:
    """The rows of a job of the library, computed in this process, those of what is guaranteed beside, and what all of these say.

    progress: whether to show a bar. Errors: UsageError for numbers,
    or a requirement, beside which that cannot be had.
    """
    from wavesweep.program.sweep.progress_bar import reporting
    from wavesweep.program.sweep.running import in_memory

    stages = [Stage("", job, ""), *_guaranteed(job, None)]
    if len(stages) > 1:
        import scipy.linalg  # noqa: F401 - whose threads are limited only if it is loaded
    blocks = []
    with reporting(progress) as report:
        for stage in stages:
            rows = in_memory(stage.job, report)
            blocks.append(_finished(rows, stage, stages, None))
    return joined(blocks), claims_of(job.grid.spec, stages)


def rows_again(
    spec: Spec, along: str | None, hands: Hands | None, picked: Iterable[int]
) -> Iterator[Columns]:
    """Compute some combinations of a table again, each by itself, and yield the rows of each.

    spec, along, hands: as for `intervals`. picked: numbers of the combinations, counted over all
    kinds of rows.
    """
    from wavesweep.program.sweep.job import cut_otherwise

    stages = stages_of(spec, along, hands)
    sizes = np.array([stage.job.grid.size for stage in stages])
    ends = np.cumsum(sizes)
    starts = ends - sizes
    for number in picked:
        of_stage = int(np.searchsorted(ends, number, side="right"))
        stage = stages[of_stage]
        combination = np.array([number - starts[of_stage]])
        single = cut_otherwise(
            stage.job, deep=1, wide=1
        )  # then the number of a chunk is that of its slice
        chunk = single.chunks[int(stage.job.grid.slice_of(combination)[0])]
        records = single.task(chunk)()
        block = stage.job.columns(np.repeat(combination, records.size), records)
        yield KINDS[2 if hands else 0].ordered(_finished(block, stage, stages, hands))


def _finished(block: Columns, stage: Stage, stages: Sequence[Stage], hands: Any) -> Columns:
    """The block, with a column that says whose its rows are if there are several kinds, and the columns of all."""
    from wavesweep.haptics.felt import RECORD

    if len(stages) == 1:
        return block
    rows = len(block["along"])
    columns: dict[str, np.ndarray] = {}
    for stage_of_run in stages:
        for name in stage_of_run.job.dtype.names or ():
            if name in (RECORD.names or ()):
                continue
            if stage_of_run.job.dtype[name].kind == "U":
                columns[name] = np.full(rows, "", object)
            else:
                columns[name] = np.full(rows, np.nan)
    if "settled" in columns:
        columns["settled"] = block["certified"]
    for name, column in block.items():
        columns[name] = column.astype(object) if column.dtype.kind == "U" else column
    columns["hand" if hands else "guarantee"] = np.full(rows, stage.hand or "spec", dtype=object)
    return columns


def _notices(spec: Spec, stages: Sequence[Stage]) -> Iterator[str]:
    """Yield notices about what is required, and about axes and ranges that a user may take for something else."""
    from wavesweep.program.sweep.grid import own_loop

    job = stages[0].job
    axis = job.asked.axis
    if axis.scale == "log" and not axis.values:
        yield f'{axis.name}: scale = "log" is for values (num); the whole range is searched, and drawn evenly'
    if axis.values:
        yield f"{axis.name} has values in [sweep]: searched between their ends, from {span_in_words(axis.start, axis.stop)}"
    yield from notices_of(job.grid)
    if job.asked.require:
        span = axis.start, axis.stop
        yield from job.asked.require.bound.notices(own_loop(spec), axis.path, axis.name, span)
    yield from spans_held(spec, axis.path)
    for stage in stages:
        if stage.job.asked.guarantee:
            yield from stage.job.asked.guarantee.notices(job)


def _facts(
    spec: Spec,
    hands: Any,
    stages: Sequence[Stage],
    certified: int,
    timings: Mapping[str, float],
) -> dict[str, Any]:
    computed = sum(stage.job.slices for stage in stages)
    combinations = sum(stage.job.grid.size for stage in stages)
    counts = {"computed": computed, "skipped": combinations - computed, "certified": certified}
    methods = {stage.hand or "intervals": stage.method for stage in stages}
    job = stages[0].job
    swept = [job.asked.axis.path, *(axis.path for axis in job.grid.axes)]
    claims = claims_of(spec, stages)
    notices = list(_notices(spec, stages))
    facts = facts_of(spec, methods, counts, timings, notices, swept, claims=claims)
    if job.asked.require:
        facts["require"] = job.asked.require.written()
    facts |= _limits_of_walls(spec, job.asked.axis.path, swept)
    if hands:
        facts |= hands.facts()
    return facts


def claims_of(spec: Spec, stages: Sequence[Stage]) -> dict[str, Claim]:
    """What the rows of each kind say, and of which loops, by the word of the kind."""
    from wavesweep.program.analyses.claims import NOBODY, Claim, Status, own_scope, required_by

    claims = {}
    for stage in stages:
        query = stage.job.asked
        if query.guarantee:
            claims[stage.hand] = query.guarantee.claim(spec)
            continue
        claimed = required_by(query.require, drawn=bool(spec.drawing))
        scope = own_scope(stage.job.grid.spec)
        if stage.hand == "free":
            scope = replace(scope, hands=NOBODY)
        claims[stage.hand or "spec"] = Claim(claimed, scope, Status.CERTIFIED)
    return claims


def _in_the_way(stage: Stage, result: Run) -> dict[str, Any]:
    """A fact of what keeps a loop from having an interval.

    That is the mode in the way, of the first row without one, if something is required or no row
    has one; with bounds on gains, the value that comes nearest to all of them; or that the loop conserves energy, so that nothing decides.
    """
    from wavesweep.program.analyses.mode_in_the_way import conserves, mode_in_the_way, outside
    from wavesweep.program.sweep.grid import frames_per_clock, loops_of, own_loop

    job = stage.job
    spec = job.grid.spec
    axis = job.asked.axis
    require = job.asked.require
    empty, full = _first_without(result.blocks(stage.hand), job.grid.axes, enough=bool(require))
    if full:
        return {}
    if empty is None:
        if spec.drawing and conserves(own_loop(spec)):
            return {"conserves": True}
        return {}
    changes = {other.path: empty[other.name] for other in job.grid.axes}
    if changes:
        spec = spec.with_values(changes)
    loops = own_loop(spec)
    span = axis.start, axis.stop
    if require and require.bound.gains:
        nearest = require.bound.nearest(loops, axis.path, span)
        return {"in_the_way": {"at": empty, **nearest}} if nearest else {}
    beyond = outside
    by_lines = False
    if require:
        by_lines = bool(require.bound.damped)
        beyond = require.bound.over(
            frames_per_clock(spec.drawing, loops_of(spec, spec.values))
        ).beyond
    mode = mode_in_the_way(loops, axis.path, span, beyond, by_lines=by_lines)
    if mode:
        return {"in_the_way": {"at": empty, **mode}}
    return {}


def _without_wall(stage: Stage) -> dict[str, Any]:
    """A fact of the first loop of a sweep that is unstable where its wall is not touched, of those
    that differ in other numbers than the wall's."""
    from wavesweep.program.analyses.free_space import first_unstable_without_wall

    grid = stage.job.grid
    if stage.job.asked.axis.path not in grid.spec.wall:
        return {}
    axes = [axis for axis in grid.axes if axis.path not in grid.spec.wall]
    unstable = first_unstable_without_wall(grid.spec, axes)
    if unstable is None:
        return {}
    values, radius = unstable
    place = {axis.name: value for axis, value in zip(axes, values, strict=True)}
    return {"without_wall": {"at": place, "radius": radius}}


def _first_without(
    blocks: Iterable[Columns], axes: Iterable[Any], *, enough: bool
) -> tuple[dict[str, Any] | None, bool]:
    """The values of the axes in the first row without an interval, and whether a row with one was
    met. enough: whether to stop at the first without one."""
    empty = None
    for block in blocks:
        without = np.flatnonzero(block["certified"] & (block["intervals"] == 0))
        if empty is None and without.size:
            empty = {axis.name: block[axis.name][without[0]].item() for axis in axes}
        if empty is not None and enough:
            return empty, False
        if (block["intervals"] > 0).any():
            return empty, True
    return empty, False


def _limits_of_walls(spec: Spec, along: str, swept: Iterable[str]) -> dict[str, Any]:
    """A fact of walls that friction and encoder, or sampling, may make buzz, if no axis changes these limits."""
    hardware = spec.hardware["resolution"] or spec.hardware["friction"]
    if spec.drawing or not hardware or along != spec.wall[0]:
        return {}
    from wavesweep.program.analyses.hardware_limits import deciding, limits_of_walls

    if any(map(deciding, swept)):
        return {}
    limits = limits_of_walls(spec)
    if limits:
        return {"limits_of_walls": limits}
    return {}


def _again(along: str | None, facts: Mapping[str, Any], _: Callable[[], str]) -> Recompute:
    """A way to compute rows of a table with these facts again."""
    from wavesweep.program.spec import load
    from wavesweep.program.tables.hand_rows import hands_of

    spec = load(facts["spec"])
    along = along or facts.get("along")
    hands = hands_of(facts.get("for_hands", ()))
    sizes = [stage.job.grid.size for stage in stages_of(spec, along, hands)]
    return Recompute(
        spec.sha256,
        combinations=sum(sizes),
        of_combinations=partial(rows_again, spec, along, hands),
    )


def interval_kind(name: str, along: str | None = "", **more: Any) -> Kind:
    """A kind of table of stable intervals.

    along: the axis (None: the spec's own) of one whose rows can be computed again.
    """
    more.setdefault("figure", "wavesweep.program.plots.interval_figures.zwidth")
    if along != "":
        more["again"] = partial(_again, along)

    def summary(table: Table) -> Summary:
        from wavesweep.program.tables.interval_summary import IntervalSummary

        return IntervalSummary(table.axes, table.facts)

    def lines(numbers: Numbers) -> Iterator[Line]:
        from wavesweep.program.tables.interval_sentences import interval_lines

        return interval_lines(numbers)

    return Kind(name, summary, lines, **more)


KINDS = (
    interval_kind("zwidth", "K_VE"),
    interval_kind("stability-region", None),
    interval_kind("zwidth-hands", "K_VE"),
    interval_kind("stability-region-hands", None),
)
