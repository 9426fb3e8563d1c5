"""`wavesweep bench`."""

import os
import sys
import time
from pathlib import Path

import click

from wavesweep.cli.options import Options, run_options
from wavesweep.reproducibility import ONE_THREAD

FOLDER = Path("results", "bench")


@click.command("bench")
@click.option(
    "--quick", is_flag=True, help="Run the smallest problems only, in a few seconds. The run times are then not meaningful."
)
@run_options()
def command(quick: bool, options: Options) -> None:
    """Measure run time against error, for this tool and for other methods.

    Takes no SPEC, and about four minutes. Errors are relative to references of 50 digits. All run times use one thread,
    and the two methods of each ratio run alternately. One table and one figure are written to results/bench, or to --out:
    critical stiffness and responses, the cost of compiling, of slices, of workers and of starting, a profile, and hard
    cases in which digits are lost.
    """
    if options.file:
        raise click.UsageError(f"--out {options.out}: expected a folder, since this command writes several files")
    if options.overrides:
        raise click.UsageError(
            "--set: not possible here; the problems of the benchmark are fixed, so that runs can be compared"
        )
    # A BLAS reads this when numpy loads it, so nothing that imports numpy may stand above; processes that the benchmark
    # starts inherit it.
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    from wavesweep.bundled import program
    from wavesweep.cli.messages import progress, say, show_json, where
    from wavesweep.cli.output import alone
    from wavesweep.results import stream

    bench, started = program("benchmarks/bench"), time.perf_counter()
    with alone(["bench"], Path(options.out or FOLDER), options), progress(options.quiet) as report:
        run = bench.measure(quick=quick, progress=report)
        written = [] if options.to_stdout else _write(run, options)
    if options.to_stdout:
        stream(run, sys.stdout.buffer)
    if options.as_json:
        lines, files = list(bench.lines(run.columns)), [str(path) for path in written]
        show_json({"command": "bench", "lines": lines, "files": files, "seconds": round(time.perf_counter() - started, 3)})
    if options.quiet or options.as_json:
        return
    for line in bench.lines(run.columns):
        say(line)
    if written:
        say(where(written, time.perf_counter() - started))


def _write(run, options: Options) -> list[Path]:
    from wavesweep.plots import drawn
    from wavesweep.results import publish

    return publish(drawn(run), Path(options.out or FOLDER), options.overwrite, options.formats, locked=True)
