"""Stable intervals over a sweep, as a table."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

from wavesweep.diagram import WALL
from wavesweep.spec import Spec
from wavesweep.sweep.checkpoint import MemoryParts, blocks, open_folder
from wavesweep.sweep.job import Question, ask, expected_seconds
from wavesweep.sweep.run import Columns, Table, facts_of, joined
from wavesweep.sweep.tasks import HELD, certified_columns
from wavesweep.sweep.workers import Workers, choose, results

Progress = Callable[[int, int, int], None]
JOBS = 2


def intervals(
    spec: Spec,
    along: str | None = None,
    jobs: int | None = None,
    backend: str | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    force: bool = False,
) -> Table:
    """Stable intervals along `along` (the spec's own by default) for every combination of the other axes of [sweep].

    jobs: worker processes where the work is worth them (2 by default). backend: any of joblib's, then used in any case;
    scheduler: address of the dask scheduler. progress(done, of, certified) is told of slices. checkpoint: folder for
    finished chunks, from which a run of the same spec goes on; by default they stay in memory. force: begin anew where
    the folder is of no use. Raises UsageError, CheckpointError (torn, or of another run), WavesweepError (a dead worker).
    """
    started = time.perf_counter()
    asked = ask(spec, along)
    parts = parts_of(asked, checkpoint, force)
    workers = choose(jobs or JOBS, backend, scheduler, len(asked.chunks), partial(expected_seconds, asked))
    tally = compute(asked, parts, workers, progress)
    timings = {
        "compute_s": time.perf_counter() - started,
        "kernel_s": tally.seconds,
        "workers": workers.count,
        "slices_from_checkpoint": tally.kept,
    }
    slices = {"computed": asked.columns, "skipped": asked.grid.size - asked.columns, "certified": tally.certified}
    facts = facts_of(spec, {"intervals": method(asked.axis.path)}, slices, timings, notices(asked.grid))
    axes = {axis.name: axis.values for axis in asked.grid.axes}
    return Table("zwidth", partial(blocks, asked, parts), facts, axes, forget=parts.remove)


def parts_of(asked: Question, checkpoint: Path | None, force: bool):
    """Where finished chunks are kept: in the folder `checkpoint`, or in memory without one or for a single chunk."""
    if checkpoint is None or (len(asked.chunks) < 2 and not checkpoint.exists()):
        return MemoryParts()
    from wavesweep import __version__

    run = {"spec_sha256": asked.grid.spec.sha256, "along": asked.axis.name, "tool_version": __version__, "layout": 2}
    if asked.guarantee is None:
        return open_folder(checkpoint, run, asked.chunks, force)
    return open_folder(checkpoint, run | {"guarantee": repr(asked.guarantee)}, asked.chunks, force, HELD)


class Tally:
    """What is done so far: slices, those of them from a checkpoint, certified ones, and seconds in the workers."""

    def __init__(self):
        self.done = self.kept = self.certified = 0
        self.seconds = 0.0

    def add(self, columns, records, seconds=0.0):
        """Count a chunk."""
        self.done += columns
        self.certified += certified_columns(records)
        self.seconds += seconds


def compute(asked: Question, parts, workers: Workers, progress: Progress | None = None) -> Tally:
    """Solve every chunk that is not among the parts yet, and add it to them."""
    tally, chunks, kept = Tally(), asked.chunks, parts.finished()
    for number in kept:
        tally.add(chunks[number].columns, parts.load(number))
    tally.kept = tally.done
    missing = sorted(set(range(len(chunks))) - set(kept))
    finished = results(workers, missing, lambda number: asked.work(chunks[number]))
    try:
        for number, records, seconds in finished:
            parts.save(number, records)
            tally.add(chunks[number].columns, records, seconds)
            if progress:
                progress(tally.done, asked.columns, tally.certified)
    except BaseException as error:
        if parts.place:
            error.add_note(
                f"{tally.done} of {asked.columns} slices are kept in {parts.place}; the same command goes on from there."
            )
        raise
    finally:
        finished.close()
    return tally


def in_memory(asked: Question) -> Columns:
    """The table of a question, solved in this process."""
    parts = MemoryParts()
    compute(asked, parts, Workers(1, None, None, "as a library"))
    return joined(blocks(asked, parts))


def method(path) -> str:
    """How intervals along that key are found, in a line."""
    if path in WALL:
        return "crossings of the unit circle from one real polynomial, proved by Smith's discs, polished in state space"
    return "roots of the eigenvalues' critical functions on Chebyshev panels, proved by Smith's discs, polished"


def notices(grid) -> list[str]:
    """What a user should know before reading the table."""
    kind = grid.spec.values["controller.kind"]
    return [f"{axis.name} is not read by {kind}: evaluated once, its rows repeated" for axis in grid.ignored]
