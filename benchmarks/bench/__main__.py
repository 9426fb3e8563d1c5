"""Measure run time against error, for this tool and for other methods: `python benchmarks/bench`, in about eight minutes.

Errors are relative to references of 50 digits. All run times use one thread, and the two methods of each ratio run alternately:
with loops known from a call before, and as a first call. One table and one figure: critical stiffness and responses, the cost
of compiling, of slices, of workers and of starting, a profile, and hard cases in which digits are lost.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from wavesweep.program.platform_compat import ONE_THREAD

# A BLAS reads this when numpy loads it, so nothing that imports numpy stands above; processes that are started inherit it.
os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bench
from wavesweep.engine.errors import WavesweepError
from wavesweep.program.plots import with_figure
from wavesweep.program.results import publish


def main(words: Sequence[str] | None = None) -> None:
    """Write what was measured, and say what it amounts to."""
    parser = argparse.ArgumentParser(prog="python benchmarks/bench", description=__doc__.partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="the smallest problems only, in seconds: run times mean nothing")
    parser.add_argument("--out", default="results/bench", help="folder of the table and the figure (default: %(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace the results of another run there")
    options = parser.parse_args(words)
    measured = bench.measure(quick=options.quick)
    table = with_figure(measured, partial(bench.draw, measured.columns, measured.facts))
    try:
        files = publish(table, options.out, options.overwrite)
    except WavesweepError as error:
        parser.error(str(error))
    print(*files, *bench.lines(measured.columns), sep="\n")


if __name__ == "__main__":
    main()
