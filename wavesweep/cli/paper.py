"""`wavesweep paper`."""

import sys
import time
from pathlib import Path

import click

from wavesweep.cli.options import Options, run_options

LAST = "statements"  # table of every run


@click.command("paper")
@run_options()
def command(options: Options) -> None:
    """Reproduce the paper's figures and test its statements.

    Takes no SPEC: the paper's specs are part of the program. The results go to results/paper, or to --out: a table and a
    figure for each of Figures 2, 4, 5, 6, 7 and 8; the table open-choices, with the values that the paper leaves open; the
    table passive-bank, with filter banks whose returned waves pass a passive map; and the table statements, with a verdict
    and its numbers for each statement. The last three are also written as Markdown. With --out - the statements go to
    stdout.
    """
    from wavesweep.bundled import program
    from wavesweep.cli.messages import progress, say, show_json, where
    from wavesweep.cli.output import alone
    from wavesweep.results import publish, stream

    paper = program("sweeps/paper/reproduce")

    if options.file:
        raise click.UsageError(f"--out {options.out}: expected a folder, since this command writes several files")
    if options.overrides:
        raise click.UsageError("--set: the paper's values are its own; copy one of its specs and change the copy")
    directory, said, files, began = Path(options.out or Path("results", "paper")), [], [], time.perf_counter()
    # Every run writes the statements, so two of them are never at work on the same tables.
    with alone([LAST], directory, options), progress(options.quiet) as report:
        started = time.perf_counter()
        for table in paper.tables(report):
            if not options.to_stdout:
                written = publish(table, directory, options.overwrite, options.formats, locked=table.kind == LAST)
                files += written
                said.append(where(written, time.perf_counter() - started))
            started = time.perf_counter()
    # The last table is that of the statements.
    if options.to_stdout:
        stream(table, sys.stdout.buffer)
    if options.as_json:
        verdicts = table.columns["verdict"].tolist()
        counts = {verdict: verdicts.count(verdict) for verdict in paper.VERDICTS}
        seconds = round(time.perf_counter() - began, 3)
        show_json({"command": "paper", "verdicts": counts, "files": [str(path) for path in files], "seconds": seconds})
    elif not options.quiet:
        for line in [*said, paper.counted(table.columns)]:
            say(line)
