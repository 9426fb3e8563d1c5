"""`wavesweep paper`."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import click

from wavesweep.cli.options import STDOUT, debug, force, out, plot, quiet


@click.command("paper")
@out
@plot
@force
@quiet
@debug
def command(out: str | None, plot: bool, force: bool, quiet: bool, debug: bool) -> None:
    """Draw every figure of the paper and judge every statement of it.

    Takes no SPEC: the paper's come with the program. Writes a table and a figure for each of Figures 2, 4, 5, 6, 7
    and 8, the table open-choices of what the paper leaves open, and the table statements: for each one a verdict
    with its numbers. The last two are also Markdown. With --out - the statements go to stdout.
    """
    del debug
    from wavesweep import paper
    from wavesweep.cli.talk import progress, say, where
    from wavesweep.results.text import stream_blocks

    said = []
    with progress(quiet) as report:
        started = time.perf_counter()
        for table in paper.tables(report):
            if out != STDOUT:
                written = paper.write_table(table, Path(out or Path("results", "paper")), force=force, plot=plot)
                said.append(where(written, time.perf_counter() - started))
            started = time.perf_counter()
    if out == STDOUT:
        stream_blocks(table.fields, [table.run.columns], sys.stdout.buffer)
        sys.stdout.buffer.flush()
    if not quiet:
        for line in [*said, paper.counted(table.run.columns)]:
            say(line)
