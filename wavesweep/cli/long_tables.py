"""The way from a spec to files for tables of intervals, which need not fit into memory: rows pass through in blocks."""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesweep import plots, results, spec, sweep
from wavesweep.cli.hand_summary import HandTally
from wavesweep.cli.interval_summary import IntervalTally
from wavesweep.cli.options import Options
from wavesweep.cli.talk import progress, say, where

if TYPE_CHECKING:
    from wavesweep.sweep import LongRun
    from wavesweep.sweep.guarantees import Holders


def produce_intervals(
    kind: str, source: str, options: Options, along: str | None = None, holders: Holders | None = None
) -> None:
    """Load the spec, find the intervals along `along` (its own by default), write the table to files or stdout.

    `holders`: whose intervals are wanted beside those of the loop as it is.
    """
    started = time.perf_counter()
    asked = spec.load(source, options.overrides)
    directory = Path(options.out or Path("results", asked.name))
    if not (options.force or options.to_stdout):
        # Asked before the work and not only after it: a refusal should not cost a long run.
        results.refuse_other_spec(kind, directory, asked.sha256)
    if not options.to_stdout:
        results.refuse_unusable(directory)
    find = sweep.intervals if holders is None else partial(sweep.held_intervals, holders=holders)
    name = kind if holders is None else f"{kind}-hands"
    with _checkpoint(name, directory, options) as folder, progress(options.quiet) as report:
        run = find(
            asked, along=along, jobs=options.jobs, backend=options.backend, scheduler=options.scheduler,
            progress=report, checkpoint=folder, force=options.force,
        )  # fmt: skip
        tally = IntervalTally() if holders is None else HandTally()
        if options.to_stdout:
            fields = results.fields(kind, run.axes, run.along, run.extra)
            results.stream_blocks(fields, _passing(run, tally.add), sys.stdout.buffer)
            sys.stdout.buffer.flush()
            paths = []
        else:
            paths = _write(kind, run, directory, options, tally)
        # The rows are safe: what they were made from may go.
        run.forget()
    if options.quiet:
        return
    for line, warning in tally.lines(run.facts):
        say(line, warning)
    if paths:
        say(where(paths, time.perf_counter() - started))


@contextmanager
def _checkpoint(kind: str, directory: Path, options: Options) -> Iterator[Path]:
    """Give the folder for finished chunks: beside the results, or for a table on stdout one that goes in any case."""
    if not options.to_stdout:
        yield directory / f".{kind}.parts"
        return
    with tempfile.TemporaryDirectory(prefix="wavesweep-", ignore_cleanup_errors=True) as folder:
        yield Path(folder) / "parts"


def _passing(run: LongRun, *watchers: Any) -> Iterator[Mapping[str, Any]]:
    for block in run.blocks():
        for watch in watchers:
            watch(block)
        yield block


def _write(kind: str, run: LongRun, directory: Path, options: Options, tally: IntervalTally | HandTally) -> list[Path]:
    """Write all files; of the rows only those that the figure shows are kept."""
    picture = plots.Picture(run.axes, hands="hand" in run.extra) if options.plot else None
    fields = results.fields(kind, run.axes, run.along, run.extra)
    with results.TableWriter(kind, fields, run.facts, directory, options.force) as writer:
        watchers = [tally.add, picture.add] if picture else [tally.add]
        for block in _passing(run, *watchers):
            writer.append(block)
        return writer.finish(figure=partial(picture.draw, run.facts) if picture else None)
