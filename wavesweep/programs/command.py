"""The commands that take no SPEC: `bench` and `paper`, each of a program beside the package."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from wavesweep.program.cli.options import Options, run_options
from wavesweep.program.platform_compat import ONE_THREAD

if TYPE_CHECKING:
    from wavesweep.program.tables.table import Table


@click.command("bench")
@click.option(
    "--quick",
    is_flag=True,
    help="Run the smallest problems only, in a few seconds. The run times are then not meaningful.",
)
@run_options()
def bench(quick: bool, options: Options) -> None:
    """Measure run time against error, for this tool and for other methods.

    Takes no SPEC, and about eight minutes. Errors are relative to references of 50 digits. All run
    times use one thread, and the two methods of each ratio run alternately: with loops known from a
    call before, and as a first call. One table and one figure are written to results/bench, or to
    --out: critical stiffness and responses, the cost of compiling, of slices, of workers and of
    starting, a profile, and hard cases in which digits are lost.
    """
    _refuse(
        options,
        "not possible here; the problems of the benchmark are fixed, so that runs can be compared",
    )
    # A BLAS reads this when numpy loads it, so nothing that imports numpy may stand above;
    # processes that the benchmark starts inherit it.
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    from wavesweep.program.bundled import program
    from wavesweep.program.plots import drawn

    own = program("benchmarks/bench")

    def said(table: Table) -> tuple[dict[str, Any], list[str]]:
        lines = list(own.lines(table.columns))
        return {"lines": lines}, lines

    _produce(
        "bench",
        "bench",
        options,
        lambda report: [drawn(own.measure(quick=quick, progress=report))],
        said,
    )


@click.command("paper")
@run_options()
def paper(options: Options) -> None:
    """Reproduce the paper's figures and test its statements.

    Takes no SPEC: the paper's specs are part of the program. The results go to results/paper, or to
    --out: a table and a figure for each of Figures 2, 4, 5, 6, 7 and 8; the table open-choices,
    with the values that the paper leaves open; the table passive-bank, with filter banks whose
    returned waves pass a passive map; and the table statements, with a verdict and its numbers for
    each statement. The last three are also written as Markdown. With --out - the statements go to
    stdout.
    """
    from wavesweep.program.bundled import program

    own = program("sweeps/paper/reproduce")
    _refuse(options, "the paper's values are its own; copy one of its specs and change the copy")

    def said(table: Table) -> tuple[dict[str, Any], list[str]]:
        verdicts = table.columns["verdict"].tolist()
        counts = {verdict: verdicts.count(verdict) for verdict in own.VERDICTS}
        return {"verdicts": counts}, [own.counted(table.columns)]

    # Every run writes the statements last, so two of them are never at work on the same tables.
    _produce("paper", "statements", options, own.tables, said)


def _refuse(options: Options, why: str) -> None:
    """Raise UsageError for options that only a command with a SPEC has a meaning for; why: no key can be set."""
    if options.file:
        raise click.UsageError(
            f"--out {options.out}: expected a folder, since this command writes several files"
        )
    if options.overrides:
        raise click.UsageError(f"--set: {why}")


def _produce(
    command: str,
    last: str,
    options: Options,
    tables: Callable[[Any], Iterable[Table]],
    said: Callable[[Table], tuple[dict[str, Any], list[str]]],
) -> None:
    """Write the tables of a program to files or the last one, of the kind `last`, to stdout, and say what that one says."""
    from wavesweep.program.cli.messages import progress, say, show_json, where
    from wavesweep.program.cli.output import alone
    from wavesweep.program.results import publish, stream

    directory, lines, files, began = (
        Path(options.out or Path("results", command)),
        [],
        [],
        time.perf_counter(),
    )
    with alone([last], directory, options):
        started = began
        for table in tables(progress()):
            if not options.to_stdout:
                written = publish(
                    table, directory, options.overwrite, options.formats, locked=table.kind == last
                )
                files += written
                lines.append(where(written, time.perf_counter() - started))
            started = time.perf_counter()
    if options.to_stdout:
        stream(table, sys.stdout.buffer)
    facts, words = said(table)
    if options.as_json:
        paths, seconds = [str(path) for path in files], round(time.perf_counter() - began, 3)
        show_json({"command": command, **facts, "files": paths, "seconds": seconds})
    elif not options.quiet:
        for line in [*lines, *words]:
            say(line)
