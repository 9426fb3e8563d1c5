"""Stable intervals over a sweep, as a table: those of the spec's loop and, as an option, those for hands."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.spec import Axis, Spec
from wavesweep.stability.certificate import words
from wavesweep.sweep.interval_job import IntervalJob, job_of, task_over
from wavesweep.sweep.job import cut_otherwise
from wavesweep.sweep.proving import facts_of_proofs, notice_of
from wavesweep.sweep.running import Work, run
from wavesweep.sweep.table import Columns, Table, facts_of, spans_held
from wavesweep.sweep.tasks import END_HANDS, FELT, RECORD

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Guarantee, Hands

FEW = 4  # slices of a chunk of guarantees: each takes from tenths of a second to some seconds
ABOUT_ENDS = (*END_HANDS["low"], *END_HANDS["high"], "settled")


def intervals(
    spec: Spec,
    along: str | None = None,
    hands: "Hands | None" = None,
    prove: bool = False,
    **work: Any,
) -> Table:
    """Stable intervals along `along` (the spec's own by default) for every combination of the other axes of [sweep].

    hands: adds the column `hand` and rows for other hands. Its words are "free" for the device alone, "operator" for the
    spec's operator if it has one, "passive" and "box" (see `Hands`), and "port" for the intervals in which the spec's own
    loop is stable and passive at the hand's port. If only the port is added, the other rows are those of the spec's loop.
    prove: compute columns in doubt again in ball arithmetic.
    work: jobs, backend, scheduler, progress, checkpoint and force, see `Work`.
    Raises UsageError, CheckpointError (torn, or of another run), WavesweepError (a worker process died).
    """
    stages = stages_of(spec, along, hands, prove=prove)
    work = Work.of(work)
    found = run({stage.hand: stage.job for stage in stages}, work)
    timings = {name: number for name, number in found.timings.items() if hands is None or name != "workers"}
    facts = _facts(spec, hands, stages, found.certified, timings) | {"warnings": found.warnings}
    facts = _with_proofs(facts, stages[0], found) if prove else facts
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


def stages_of(spec: Spec, along: str | None, hands: "Hands | None", *, prove: bool = False) -> list[Stage]:
    """The stages of a run, settled before anything is computed. Raises UsageError for a job that cannot be done."""
    own = job_of(spec, along, prove=prove)
    how = method(own)
    if hands is None:
        return [Stage("", own, how)]
    hands.refuse(own)
    free = hands.without_operator(spec)
    stages = [Stage("free" if free is None else "operator", own, how)]
    if free is not None and hands.replaced:
        stages.insert(0, Stage("free", job_of(free, along), how))
    return stages + [Stage(each.kind, _guaranteed(own, each), each.method) for each in hands.guarantees]


def _guaranteed(own: IntervalJob, guarantee: "Guarantee") -> IntervalJob:
    return replace(cut_otherwise(own, deep=FEW), guarantee=guarantee)


def at_points(
    spec: Spec, axis: Axis, points: Mapping[str, np.ndarray], ties: tuple[str, ...] = (), felt: bool = True
) -> Columns:
    """Stable intervals along `axis` at single points, as the records of a table, with the column `slice`: the point's number.

    points: path -> value at each point, `(n,)`; no two points are the same. ties: paths of numbers that follow the axis; their
    values are the factors. felt: compute the felt stiffness at the ends too, which is missing otherwise.
    """
    count = len(next(iter(points.values())))
    records = task_over(spec, axis, points, count, ties=ties, felt=felt, checked=True).records()
    return {name: np.ascontiguousarray(records[name]) for name in RECORD.names} | {"doubt": words(records["doubt"])}


def _rows(stages, found, hands) -> Iterator[Columns]:
    """Yield the rows of one stage after the other."""
    for stage in stages:
        for block in found.blocks(stage.hand):
            yield block if hands is None else _with_hand(block, stage.hand, hands.box)


def rows_again(
    spec: Spec, along: str | None, hands: "Hands | None", picked: Iterable[int], *, prove: bool = False
) -> Iterator[Columns]:
    """Compute some combinations of a table again, each by itself, and yield the rows of each.

    spec, along, hands, prove: as for `intervals`. picked: numbers of the combinations, counted over all kinds of rows.
    """
    stages = stages_of(spec, along, hands, prove=prove)
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


def _with_proofs(facts, stage, found) -> dict:
    """The facts with those about proofs."""
    store = found.stores[stage.hand]
    proved = facts_of_proofs(store.load(number) for number in store.finished())
    return facts | {"proved": proved, "notices": [*facts["notices"], notice_of(proved)]}


EXACT = "crossings of the unit circle from one real polynomial, proved by signs or discs, polished in state space"
PANELS = "roots of the eigenvalues' critical functions on Chebyshev panels, proved by discs or signs, polished"


def method(job: IntervalJob) -> str:
    """How the intervals of a job are found, in a line."""
    if job.exact is None:
        return f"{EXACT}, in loops of which the axis is one scalar gain of a frame; {PANELS}, in others"
    return EXACT if job.exact else PANELS
