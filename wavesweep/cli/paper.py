"""`wavesweep paper`."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click

from wavesweep.cli.options import Options, common


@click.command("paper")
@common
def command(options: Options) -> None:
    """Draw every figure of the paper and judge every statement of it.

    Takes no SPEC: the paper's come with the program. Writes to results/paper, or to --out, a table and a figure for each
    of Figures 2, 4, 5, 6, 7 and 8, the table open-choices of what the paper leaves open, the table passive-bank of filter
    banks whose way in is passive, and the table statements: for each one a verdict with its numbers. The last three are
    also Markdown. With --out - the statements go to stdout. The work is too little for workers.
    """
    from wavesweep import paper
    from wavesweep.cli.output import progress, say, where
    from wavesweep.results import publish, stream

    if options.overrides:
        raise click.UsageError("--set: the paper's values are its own; change copies of its specs, one command at a time")
    directory, said = Path(options.out or Path("results", "paper")), []
    with progress(options.quiet) as report:
        started = time.perf_counter()
        for table in paper.tables(report):
            if not options.to_stdout:
                written = publish(table, directory, options.force, options.plot)
                said.append(where(written, time.perf_counter() - started))
            started = time.perf_counter()
    # The last table is that of the statements.
    if options.to_stdout:
        stream(table, sys.stdout.buffer)
    if not options.quiet:
        for line in [*said, paper.counted(table.columns)]:
            say(line)
