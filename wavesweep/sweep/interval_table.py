"""Stable intervals over a sweep, as a table: those of the spec's loop and, as an option, those for hands."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.analysis.doubt import words
from wavesweep.diagram import WALL
from wavesweep.spec import Axis, Spec
from wavesweep.sweep.grid import distinct_rows, groups, loop_of
from wavesweep.sweep.interval_job import IntervalJob, bounds_within, job_of, task_over
from wavesweep.sweep.job import cut_otherwise
from wavesweep.sweep.running import Work, run
from wavesweep.sweep.table import Columns, Table, facts_of, spans_held
from wavesweep.sweep.tasks import END_HANDS, FELT, RECORD

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Guarantee, Hands

WASTE = 4  # a product of loops and walls is computed whole if at most so many times the points are wanted
FEW = 4  # slices of a chunk of guarantees: each takes from tenths of a second to some seconds
ABOUT_ENDS = (*END_HANDS["low"], *END_HANDS["high"], "settled")


def intervals(
    spec: Spec,
    along: str | None = None,
    hands: "Hands | None" = None,
    **work: Any,
) -> Table:
    """Stable intervals along `along` (the spec's own by default) for every combination of the other axes of [sweep].

    hands: adds the column `hand` and rows for other hands. Its words are "free" for the device alone, "operator" for the
    spec's operator if it has one, "passive" and "box" (see `Hands`), and "port" for the intervals in which the spec's own
    loop is stable and passive at the hand's port. If only the port is added, the other rows are those of the spec's loop.
    work: jobs, backend, scheduler, progress, checkpoint and force, see `Work`.
    Raises UsageError, CheckpointError (torn, or of another run), WavesweepError (a worker process died).
    """
    stages = stages_of(spec, along, hands)
    work = Work.of(work)
    found = run({stage.hand: stage.job for stage in stages}, work)
    timings = {name: number for name, number in found.timings.items() if hands is None or name != "workers"}
    facts = _facts(spec, hands, stages, found.certified, timings) | {"warnings": found.warnings}
    axes = {axis.name: axis.values for axis in stages[0].job.grid.axes}
    return Table("zwidth", partial(_rows, stages, found, hands), facts, axes, forget=found.forget)


@dataclass(frozen=True, slots=True)
class Stage:
    """One kind of rows.

    hand: the word in the column `hand`, empty if the table has no such column. job: computes the rows. method: in a line.
    """

    hand: str
    job: IntervalJob
    method: str


def stages_of(spec: Spec, along: str | None, hands: "Hands | None") -> list[Stage]:
    """The stages of a run, settled before anything is computed. Raises UsageError for a job that cannot be done."""
    own = job_of(spec, along)
    how = method(own)
    if hands is None:
        return [Stage("", own, how)]
    hands.refuse(own)
    free = hands.without_operator(spec)
    stages = [Stage("free" if free is None else "operator", own, how)]
    if free is not None and hands.hand != "free":
        stages.insert(0, Stage("free", job_of(free, along), how))
    return stages + [Stage(each.kind, _guaranteed(own, each), each.method) for each in hands.guarantees()]


def _guaranteed(own: IntervalJob, guarantee: "Guarantee") -> IntervalJob:
    walls = own.grid.walls
    few = cut_otherwise(own, deep=max(1, FEW // walls), wide=min(FEW, walls))
    return replace(few, guarantee=guarantee, cut=None)


def at_points(
    spec: Spec, axis: Axis, points: Mapping[str, np.ndarray], ties: tuple[str, ...] = (), felt: bool = True
) -> Columns:
    """Stable intervals along `axis` at single points, as the records of a table, with the column `slice`: the point's number.

    points: path -> value at each point, `(n,)`; no two points are the same. ties: paths of numbers that follow the axis; their
    values are the factors. felt: compute the felt stiffness at the ends too, which is missing otherwise.
    """
    count = len(next(iter(points.values())))
    drawing = loop_of(spec, points)
    of_walls = () if drawing else WALL
    loops, loop = distinct_rows({path: column for path, column in points.items() if path not in of_walls}, count)
    walls, wall = distinct_rows({path: column for path, column in points.items() if path in of_walls}, count)
    if loops.size * walls.size > WASTE * count and count <= WASTE * loops.size:  # every point a loop with a wall of its own
        loops, loop, walls, wall = *(np.arange(count),) * 2, None, None
        parts = [(np.arange(count), loops, None)]
    elif loops.size * walls.size <= WASTE * count:
        parts = [(np.arange(count), np.sort(loops), np.sort(walls))]
    else:  # the product would be mostly points that nobody wants
        by = loop if loops.size <= walls.size else wall
        members = [np.flatnonzero(by == number) for number in range(by.max() + 1)]
        parts = [(each, np.unique(loops[loop[each]]), np.unique(walls[wall[each]])) for each in members]
    owners = loops[loop], walls if walls is None else walls[wall]
    found = [_part(spec, drawing, axis, points, ties, felt, *part, *owners) for part in parts]
    records = np.concatenate(found)
    records = records[np.argsort(records["slice"], kind="stable")]
    return {name: np.ascontiguousarray(records[name]) for name in RECORD.names} | {"doubt": words(records["doubt"])}


def _part(spec, drawing, axis, points, ties, felt, members, loops, walls, owner, wall_of):
    """The records of the points `members`, from the product of some loops and walls, each given by a point that has it; walls:
    None if every loop has the wall of its point alone."""
    of_walls = () if drawing else WALL
    changes = {path: column[loops] for path, column in points.items() if path not in of_walls}
    own = walls is None
    shape = (loops.size, 1) if own else walls.shape
    wanted = {
        path: points[path][loops if own else walls].reshape(shape) if path in points else np.full(shape, spec.values[path])
        for path in of_walls
    }
    parts = list(groups(spec, changes, loops.size, rates=True))
    task = task_over(spec, drawing, axis, bounds_within(spec, drawing, axis, parts), parts, wanted, checked=True)
    if ties or not felt:
        task = replace(task, felt=felt, **({"ties": ties} if ties else {}))
    records = task.records()
    number = np.searchsorted(loops, owner[members])
    number = number if own else number * walls.size + np.searchsorted(walls, wall_of[members])
    order = np.argsort(number, kind="stable")
    kept = records[np.isin(records["slice"], number)]
    kept["slice"] = members[order][np.searchsorted(number[order], kept["slice"])]
    return kept


def _rows(stages, found, hands) -> Iterator[Columns]:
    """Yield the rows of one stage after the other."""
    for stage in stages:
        for block in found.blocks(stage.hand):
            yield block if hands is None else _with_hand(block, stage.hand, hands.box)


def rows_again(spec: Spec, along: str | None, hands: "Hands | None", picked: Iterable[int]) -> Iterator[Columns]:
    """Compute some combinations of a table again, each by itself, and yield the rows of each.

    spec, along, hands: as for `intervals`. picked: numbers of the combinations, counted over all kinds of rows.
    """
    stages = stages_of(spec, along, hands)
    ends = np.cumsum([stage.job.grid.size for stage in stages])
    for number in picked:
        stage = stages[int(np.searchsorted(ends, number, side="right"))]
        combination = np.array([number - (ends[stages.index(stage)] - stage.job.grid.size)])
        single = cut_otherwise(stage.job, deep=1, wide=1)  # then the number of a chunk is that of its slice
        records = single.task(single.chunks[int(stage.job.grid.slice_of(combination)[0])]).records()
        block = stage.job.columns(np.repeat(combination, records.size), records)
        yield block if hands is None else _with_hand(block, stage.hand, hands.box)


def combinations(spec: Spec, along: str | None, hands: "Hands | None") -> int:
    """Number of combinations of a table of intervals, over all kinds of rows. spec, along, hands: as for `intervals`."""
    return sum(stage.job.grid.size for stage in stages_of(spec, along, hands))


def _with_hand(block, hand, box):
    """The block with the column `hand` behind the axes; if there is a box, with the columns ABOUT_ENDS before what is felt."""
    rows = len(block["along"])
    names = [name for name in block if name not in (*ABOUT_ENDS, *FELT)]
    names.insert(names.index("along") + 1, "hand")
    missing = {name: np.full(rows, np.nan) for name in ABOUT_ENDS} | {"settled": block["certified"]}
    found = missing | block | {"hand": np.full(rows, hand, dtype=object)}
    return {name: found[name] for name in (*names, *(ABOUT_ENDS if box else ()), *FELT)}


def _linear(axis) -> Iterator[str]:
    """Yield the notice of a range that is searched and has a spacing or values."""
    if axis.scale == "log" and not axis.values:
        yield f'{axis.name}: scale = "log" is for values (num); the whole range is searched, and drawn evenly'
    if axis.values:
        yield f"{axis.name} has values in [sweep]: searched between their ends, from {axis.start:g} to {axis.stop:g}"


def _facts(spec, hands, stages, certified, timings) -> dict:
    computed = sum(stage.job.slices for stage in stages)
    counts = {"computed": computed, "skipped": sum(stage.job.grid.size for stage in stages) - computed, "certified": certified}
    methods = {stage.hand or "intervals": stage.method for stage in stages}
    own = stages[0].job
    notices = [*_linear(own.axis), *own.grid.notices, *spans_held(spec, own.axis.path), *(hands.notices(own) if hands else ())]
    swept = [own.axis.path, *(axis.path for axis in own.grid.axes)]
    facts = facts_of(spec, methods, counts, timings, notices, swept)
    return facts | (hands.facts() if hands else {})


EXACT = "crossings of the unit circle from one real polynomial, proved by signs or discs, polished in state space"
PANELS = "roots of the eigenvalues' critical functions on Chebyshev panels, proved by discs or signs, polished"


def method(job: IntervalJob) -> str:
    """How the intervals of a job are found, in a line."""
    if job.exact is None:
        return f"{EXACT}, in loops of which the axis is one scalar gain of a frame; {PANELS}, in others"
    return EXACT if job.exact else PANELS
