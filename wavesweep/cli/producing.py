"""The way from specs to files that all commands with a table share."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesweep import results, spec
from wavesweep.cli.options import Options
from wavesweep.cli.summary import summary
from wavesweep.cli.talk import progress, say, where

if TYPE_CHECKING:
    from wavesweep.sweep import Run

Compute = Callable[..., "Run"]
Draw = Callable[[Any, Any, Path], None]


def produce(kind: str, sources: Sequence[str], options: Options, compute: Compute, draw: Draw) -> None:
    """Load the specs, compute, and write the table to files or stdout.

    `compute(specs, jobs=, backend=, scheduler=, progress=)` gives the run, `draw(columns, facts, path)` its figure.
    """
    started = time.perf_counter()
    specs = [spec.load(source, options.overrides) for source in sources]
    directory = Path(options.out or Path("results", "+".join(each.name for each in specs)))
    if len(specs) == 1 and not (options.force or options.to_stdout):
        # Asked before the work and not only after it: a refusal should not cost a long run.
        results.refuse_other_spec(kind, directory, specs[0].sha256)
    with progress(options.quiet) as report:
        run = compute(specs, jobs=options.jobs, backend=options.backend, scheduler=options.scheduler, progress=report)
    if options.to_stdout:
        results.stream(kind, run.columns, sys.stdout.buffer)
        sys.stdout.buffer.flush()
    else:
        figure = (lambda path: draw(run.columns, run.facts, path)) if options.plot else None
        paths = results.write(kind, run.columns, run.facts, directory, options.force, figure)
    if options.quiet:
        return
    for line, warning in summary(kind, run.columns, run.facts):
        say(line, warning)
    if not options.to_stdout:
        say(where(paths, time.perf_counter() - started))
