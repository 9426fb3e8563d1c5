"""What is left of a comparison if everything of this tool were free but what it cannot do without.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/floors.py [--study]

For 200 columns of each problem of `wavesweep bench`, in turn, medians of 15: D-decomposition on 180 angles, a refined batched
grid, this tool, and of that compiling the loops, which every method begins with, and the DataFrame. Then slices along numbers:
the time in which frames are made, which a search without them cannot be below; and of all that, the parts which no faster
drawing and no faster search would save: the products of ticks, and characteristic polynomials or eigenvalues. --study: the
sweep of two million slices with two workers as well, and what two processors need at least for the processor seconds that it
used.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from panel_speed import CASES, seconds

import wavesweep
from wavesweep.bench import rivals, this_tool
from wavesweep.bench.problems import PROBLEMS, bundles
from wavesweep.library import frame
from wavesweep.monodromy import lift, open_ticks, periodic
from wavesweep.stability import interpolated
from wavesweep.sweep import drawn_task
from wavesweep.system import keep_memory

STUDY = Path(__file__).parents[2] / "sweeps" / "design-study.toml"


def main():
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", action="store_true", help="the sweep of two million slices as well")
    study = parser.parse_args().study
    comparisons()
    keep_memory()  # as commands do
    frames()
    if study:
        two_millions()


def comparisons():
    """Ratios to other methods, and the largest that compiling and the DataFrame leave."""
    print("| problem | D-decomposition, refined grid (ms) | this tool (ms) | compile, DataFrame (ms) | ratios | at most |")
    print("| --- | --- | --- | --- | --- | --- |")
    for problem in PROBLEMS:
        spec = problem.ask(200)
        table = this_tool.library(spec)
        columns = {name: table[name].to_numpy() for name in table}
        works = (
            partial(rivals.decomposed, spec, 180),
            partial(rivals.refined, spec, (25, 1e-9)),
            partial(this_tool.library, spec),
            lambda spec=spec: list(bundles(spec)),
            lambda columns=columns: frame("zwidth", columns),
        )
        times = np.median([[seconds(work) for work in works] for _ in range(16)][1:], axis=0) * 1e3
        (angles, refined, ours, *free), left = times, sum(times[3:])
        print(
            f"| {problem.name} | {angles:.2f}, {refined:.1f} | {ours:.2f} | {free[0]:.2f}, {free[1]:.2f} | "
            f"{angles / ours:.2f}, {refined / ours:.1f} | {angles / left:.1f}, {refined / left:.0f} |",
            flush=True,
        )


def frames():
    """Slices along numbers, and the share of making frames: drawing, connecting, lifting and closing loops."""
    spent = dict.fromkeys(("frames", "ticks", "polynomials"), 0.0)
    count = [0]

    def timed(part, work, *given, **options):
        started = time.perf_counter()
        try:
            return work(*given, **options)
        finally:
            spent[part] += time.perf_counter() - started

    def counted(find, evaluate, *given, **options):
        def made(column, p):
            count[0] += p.size
            return timed("frames", evaluate, column, p)

        return find(made, *given, **options)

    drawn_task.stable_along_any = partial(counted, drawn_task.stable_along_any)
    for part, module, name in (
        ("ticks", lift, "growth"),
        ("ticks", periodic, "in_a_row"),
        ("ticks", open_ticks, "in_a_row"),
        ("polynomials", interpolated, "characteristic"),
        ("polynomials", np.linalg, "eigvals"),
    ):
        setattr(module, name, partial(timed, part, getattr(module, name)))
    print("| loop | along | over | ms a slice | frames a slice | their time (ms) | ticks, polynomials (ms) |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for name, source, along, span, axes in CASES:
        loop, rows = wavesweep.compile(source), []
        for _ in range(4):
            spent.update(dict.fromkeys(spent, 0.0))
            count[0] = 0
            rows.append((seconds(partial(loop.stable_intervals, along, span, **axes)), *spent.values(), count[0]))
        whole, made, ticks, polynomials, frames = np.median(rows[1:], axis=0)
        print(
            f"| {name} | {along} | {', '.join(axes)} | {10 * whole:.2f} | {frames / 100:.0f} | {10 * made:.2f} | "
            f"{10 * ticks:.2f}, {10 * polynomials:.2f} |",
            flush=True,
        )


def two_millions():
    """The design study with two workers, and the seconds that two processors need for its processor seconds."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "wavesweep", "zwidth", str(STUDY), "--out", out, "--jobs", "2", "--quiet"]
        wall, used = seconds(partial(subprocess.run, command, check=True)), resource.getrusage(resource.RUSAGE_CHILDREN)
    total = used.ru_utime + used.ru_stime
    print(
        f"two million slices, two workers: {wall:.1f} s, {total:.1f} processor seconds, so {total / 2:.1f} s on two processors"
    )


if __name__ == "__main__":
    main()
