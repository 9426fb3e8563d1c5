"""Stable intervals over a sweep, as a table: those of the spec's loop and, as an option, those for hands."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.analysis.doubt import words
from wavesweep.diagram import WALL
from wavesweep.errors import UsageError
from wavesweep.spec import Axis, Spec
from wavesweep.sweep.checkpoint import DamagedError, MemoryCheckpoint, blocks, checkpoint_of, columns_of
from wavesweep.sweep.grid import groups, loop_of
from wavesweep.sweep.job import Job, bounds_within, cut_otherwise, expected_seconds, job_of, refuse_full_disk, task_over
from wavesweep.sweep.table import Columns, Table, facts_of, joined
from wavesweep.sweep.tasks import END_HANDS, FELT, RECORD, certified_slices
from wavesweep.sweep.workers import Workers, choose, results

if TYPE_CHECKING:
    from wavesweep.sweep.hands import Guarantee, Hands

Progress = Callable[[int, int, int], None]
WASTE = 4  # a product of loops and walls is computed whole if at most so many times the points are wanted
FEW = 4  # slices of a chunk of guarantees: each takes from tenths of a second to some seconds
ABOUT_ENDS = (*END_HANDS["low"], *END_HANDS["high"], "settled")


def intervals(
    spec: Spec,
    along: str | None = None,
    hands: "Hands | None" = None,
    jobs: int | None = None,
    backend: str | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    force: bool = False,
) -> Table:
    """Stable intervals along `along` (the spec's own by default) for every combination of the other axes of [sweep].

    hands: adds the column `hand` and rows for other hands. Its words are "free" for the device alone, "operator" for the
    spec's operator if it has one, "passive" and "box" (see `Hands`), and "port" for the intervals in which the spec's own
    loop is stable and passive at the hand's port. If only the port is added, the other rows are those of the spec's loop.
    jobs: number of worker processes if the work is worth them. backend: one of `BACKENDS`, which is then used in any case.
    scheduler: address of the dask scheduler. progress: is called with the number of slices done, of all slices, and of
    certified ones. checkpoint: folder for finished chunks, from which a run of the same spec goes on; by default they
    stay in memory. force: start again if the folder cannot be used.
    Raises UsageError, CheckpointError (torn, or of another run), WavesweepError (a worker process died).
    """
    started = time.perf_counter()
    stages = stages_of(spec, along, hands)
    refuse_full_disk(checkpoint, [stage.job for stage in stages])
    tallies, stores, warnings = [], [], []
    for stage in stages:
        job, report = stage.job, progress and _continued(progress, sum(each.job.slices for each in stages), tallies)
        workers = choose(jobs, backend, scheduler, len(job.chunks), partial(expected_seconds, job))
        stores.append(checkpoint_of(job, checkpoint and checkpoint / stage.hand, force, warnings))
        tallies.append(compute(job, stores[-1], workers, report))
    timings = {
        "compute_s": time.perf_counter() - started,
        "kernel_s": sum(tally.seconds for tally in tallies),
        **({"workers": workers.count} if hands is None else {}),
        "slices_from_checkpoint": sum(tally.kept for tally in tallies),
    }
    facts = _facts(spec, hands, stages, sum(tally.certified for tally in tallies), timings) | {"warnings": warnings}
    axes = {axis.name: axis.values for axis in stages[0].job.grid.axes}
    forget = partial(_forget, stores, hands and checkpoint, warnings)
    return Table("zwidth", partial(_rows, stages, stores, hands), facts, axes, forget=forget)


@dataclass(frozen=True, slots=True)
class Stage:
    """One kind of rows.

    hand: the word in the column `hand`, empty if the table has no such column. job: computes the rows. method: in a line.
    """

    hand: str
    job: Job
    method: str


def stages_of(spec: Spec, along: str | None, hands: "Hands | None") -> list[Stage]:
    """The stages of a run, settled before anything is computed. Raises UsageError for a job that cannot be done."""
    own = job_of(spec, along)
    how = method(own)
    if hands is None:
        return [Stage("", own, how)]
    if own.grid.drawing:
        raise UsageError(
            "hands and ports: expected a [controller] whose rates divide, found a loop that is assembled tick by tick; give "
            "the hand's mass, damping and stiffness in [operator], or draw it as a block"
        )
    hands.refuse(own)
    free = hands.without_operator(spec)
    stages = [Stage("free" if free is None else "operator", own, how)]
    if free is not None and hands.hand != "free":
        stages.insert(0, Stage("free", job_of(free, along), how))
    return stages + [Stage(each.kind, _guaranteed(own, each), each.method) for each in hands.guarantees()]


def _guaranteed(own: Job, guarantee: "Guarantee") -> Job:
    walls = own.grid.walls
    few = cut_otherwise(own, deep=max(1, FEW // walls), wide=min(FEW, walls))
    return replace(few, guarantee=guarantee, cut=None)


class Tally:
    """Counts of slices, of those taken from a checkpoint, and of certified ones, and the seconds spent in the workers."""

    def __init__(self):
        self.done = self.kept = self.certified = 0
        self.seconds = 0.0

    def add(self, slices, records, seconds=0.0):
        """Count a chunk."""
        self.done += slices
        self.certified += certified_slices(records)
        self.seconds += seconds


def compute(job: Job, store, workers: Workers, progress: Progress | None = None) -> Tally:
    """Compute every chunk that the checkpoint `store` does not have yet, and save it there."""
    tally, chunks = Tally(), job.chunks
    for number in store.finished():
        try:
            tally.add(chunks[number].slices, store.load(number))
        except DamagedError as error:
            store.set_aside(number, error)
    tally.kept, known = tally.done, set(store.finished())
    missing = (number for number in range(len(chunks)) if number not in known)
    finished = results(workers, missing, lambda number: job.task(chunks[number]))
    try:
        for number, records, seconds in finished:
            store.save(number, records)
            tally.add(chunks[number].slices, records, seconds)
            if progress:
                progress(tally.done, job.slices, tally.certified)
    except BaseException as error:
        if store.place:
            error.add_note(
                f"{tally.done} of {job.slices} slices are kept in {store.place}; the same command goes on from there."
            )
        raise
    finally:
        finished.close()
    return tally


def at_points(spec: Spec, axis: Axis, points: Mapping[str, np.ndarray], ties: tuple[str, ...] = ()) -> Columns:
    """Stable intervals along `axis` at single points, as the records of a table, with the column `slice`: the point's number.

    points: path -> value at each point, `(n,)`; no two points are the same. ties: paths of numbers that follow the axis; their
    values are the factors.
    """
    count = len(next(iter(points.values())))
    drawing = loop_of(spec, points)
    of_walls = () if drawing else WALL
    loops, loop = _distinct_rows({path: column for path, column in points.items() if path not in of_walls}, count)
    walls, wall = _distinct_rows({path: column for path, column in points.items() if path in of_walls}, count)
    if loops.size * walls.size <= WASTE * count:
        parts = [(np.arange(count), np.sort(loops), np.sort(walls))]
    else:  # the product would be mostly points that nobody wants
        by = loop if loops.size <= walls.size else wall
        members = [np.flatnonzero(by == number) for number in range(by.max() + 1)]
        parts = [(each, np.unique(loops[loop[each]]), np.unique(walls[wall[each]])) for each in members]
    found = [_part(spec, drawing, axis, points, ties, *part, loops[loop], walls[wall]) for part in parts]
    records = np.concatenate(found)
    records = records[np.argsort(records["slice"], kind="stable")]
    return {name: np.ascontiguousarray(records[name]) for name in RECORD.names} | {"doubt": words(records["doubt"])}


def _distinct_rows(columns, count):
    """Index of the first point of each distinct row of the columns, and for each point the number of its row."""
    if not columns:
        return np.zeros(1, int), np.zeros(count, int)
    _, first, back = np.unique(np.stack(list(columns.values()), axis=1), axis=0, return_index=True, return_inverse=True)
    return first, back.reshape(-1)


def _part(spec, drawing, axis, points, ties, members, loops, walls, owner, wall_of):
    """The records of the points `members`, from the product of some loops and walls, each given by a point that has it."""
    of_walls = () if drawing else WALL
    changes = {path: column[loops] for path, column in points.items() if path not in of_walls}
    wanted = {path: points[path][walls] if path in points else np.full(walls.size, spec.values[path]) for path in of_walls}
    bounds = bounds_within(spec, drawing, axis, changes, loops.size)
    task = task_over(spec, drawing, axis, bounds, groups(spec, changes, loops.size), wanted)
    records = (replace(task, ties=ties) if ties else task).records()
    number = np.searchsorted(loops, owner[members]) * walls.size + np.searchsorted(walls, wall_of[members])
    order = np.argsort(number, kind="stable")
    kept = records[np.isin(records["slice"], number)]
    kept["slice"] = members[order][np.searchsorted(number[order], kept["slice"])]
    return kept


def _continued(progress, total, before):
    """The reports of one stage as reports of all of them; before: the tallies of the stages before it."""
    done, certified = sum(tally.done for tally in before), sum(tally.certified for tally in before)
    return lambda now, _, proved: progress(done + now, total, certified + proved)


def in_memory(job: Job) -> Columns:
    """The table of a job, computed in this process."""
    store = MemoryCheckpoint()
    compute(job, store, Workers(1, None, None, "as a library"))
    return joined(blocks(job, store))


def _rows(stages, stores, hands) -> Iterator[dict[str, np.ndarray]]:
    """Yield the rows of one stage after the other."""
    for stage, store in zip(stages, stores, strict=True):
        for block in blocks(stage.job, store):
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
        block = columns_of(stage.job, np.repeat(combination, records.size), records)
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


def _forget(stores, folder, warnings):
    """Remove the checkpoints of all stages and their common folder, unless it holds one of a run for other hands."""
    for store in stores:
        try:
            store.remove()
        except OSError as error:
            warnings.append(f"{store.place}: {error.strerror}; the next run removes this checkpoint")
    if folder:
        with suppress(OSError):
            folder.rmdir()


def _facts(spec, hands, stages, certified, timings) -> dict:
    computed = sum(stage.job.slices for stage in stages)
    counts = {"computed": computed, "skipped": sum(stage.job.grid.size for stage in stages) - computed, "certified": certified}
    methods = {stage.hand or "intervals": stage.method for stage in stages}
    own = stages[0].job
    notices = [*own.grid.notices, *(hands.notices(own) if hands else ())]
    swept = [own.axis.path, *(axis.path for axis in own.grid.axes)]
    facts = facts_of(spec, methods, counts, timings, notices, swept)
    return facts | (hands.facts() if hands else {})


def method(job: Job) -> str:
    """How the intervals of a job are found, in a line."""
    if job.exact:
        return "crossings of the unit circle from one real polynomial, proved by signs or discs, polished in state space"
    return "roots of the eigenvalues' critical functions on Chebyshev panels, proved by Smith's discs, polished"
