"""The way from specs to files that all commands with a table share."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesweep import results, spec
from wavesweep.cli.options import Options
from wavesweep.cli.summary import summary
from wavesweep.cli.talk import progress, say, where

if TYPE_CHECKING:
    from wavesweep.spec import Spec
    from wavesweep.sweep import Run

Compute = Callable[..., "Run"]
Draw = Callable[[Any, Any, Path], None]


def produce(kind: str, sources: Sequence[str], options: Options, compute: Compute, draw: Draw) -> None:
    """Load the specs, compute, and write the table to files or stdout.

    `compute(specs, jobs=, backend=, scheduler=, progress=)` gives the run, `draw(columns, facts, path)` its figure.
    """

    def compute_one(specs: list[Spec], **work: Any) -> dict[str, Run]:
        return {kind: compute(specs, **work)}

    produce_tables({kind: draw}, sources, options, compute_one)


def produce_tables(
    draws: Mapping[str, Draw],
    sources: Sequence[str],
    options: Options,
    compute: Callable[..., dict[str, Run]],
    asked: Callable[[Spec], Spec] = lambda spec: spec,
) -> None:
    """Do the same for a command with several tables.

    `draws` has the figure of every kind of table that there can be, the main one first: that is what stdout gets.
    `compute` gives a run for each kind that there is this time. `asked` makes a spec that was loaded the one whose
    digest the results stand under.
    """
    started = time.perf_counter()
    specs = [asked(spec.load(source, options.overrides)) for source in sources]
    directory = Path(options.out or Path("results", "+".join(each.name for each in specs)))
    if len(specs) == 1 and not (options.force or options.to_stdout):
        # Asked before the work and not only after it: a refusal should not cost a long run.
        for kind in draws:
            results.refuse_other_spec(kind, directory, specs[0].sha256)
    if not options.to_stdout:
        results.refuse_unusable(directory)
    with progress(options.quiet) as report:
        runs = compute(specs, jobs=options.jobs, backend=options.backend, scheduler=options.scheduler, progress=report)
    if options.to_stdout:
        main = next(iter(draws))
        results.stream(main, runs[main].columns, sys.stdout.buffer)
        sys.stdout.buffer.flush()
    written = [] if options.to_stdout else _write(draws, runs, directory, options)
    if options.quiet:
        return
    for kind, run in runs.items():
        for line, warning in summary(kind, run.columns, run.facts):
            say(line, warning)
    for paths in written:
        say(where(paths, time.perf_counter() - started))


def _write(draws: Mapping[str, Draw], runs: Mapping[str, Run], directory: Path, options: Options) -> list[list[Path]]:
    """Write the files of each table, and give their paths."""
    written = []
    for kind, draw in draws.items():
        if kind not in runs:
            results.discard(kind, directory)  # another spec's: it would stand beside this one's as if it were its own
            continue
        run = runs[kind]
        figure = partial(draw, run.columns, run.facts) if options.plot else None
        written.append(results.write(kind, run.columns, run.facts, directory, options.force, figure))
    return written
