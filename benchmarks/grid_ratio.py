"""All stable K_VE for 100 values of B_VE against a 100 x 100 grid of eigenvalues of the same compiled loop, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/grid_ratio.py [--least] [--before COMMIT]

The call of the library, certificate and DataFrame included, and numpy's batched eigenvalues, in turn; medians of 15, in
processor time. With --least the exit code is 1 if a ratio is below a third of what it was when these lines were written.

With --least also what a chunk of a sweep costs of which nothing is known from before, beside eigenvalues of random matrices of
as many states; here a loss of 15 % is one. With --before the whole of the largest sweep, by that commit and by this checkout.
"""

import argparse
import sys
import tempfile
from pathlib import Path
from statistics import median

import numpy as np
from two_commits import HERE, checked_out, said

import wavesweep
from bench.measuring import Patience, forget, interleaved
from wavesweep.haptics.controller_page import wall_cut
from wavesweep.program.analyses.interval_jobs import job_of
from wavesweep.program.platform_compat import keep_memory
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

PAPER = Path(__file__).parents[1] / "sweeps" / "paper"
CASES = {  # loop, and the least ratio
    "pmw": ({"controller": {"kind": "pmw"}}, 1.6),
    "dc-slow": ({"controller": {"kind": "dc-slow"}}, 0.5),
    "fig4": (PAPER / "fig4.toml", 2.5),
    "pmw-lm": (PAPER / "fig5-explicit.toml", 3.3),
}
DAMPING, STIFFNESS = np.linspace(0, 15, 100), np.linspace(0, 20000, 101)[1:]


FIVE_AXES = """
[controller]
kind = "pmw-lm"
[environment]
integration = "explicit"
delay = 1
[sweep]
along = "K_VE"
K_VE = { start = 0, stop = 20000 }
b = { start = 10, stop = 60, num = 20 }
Kp = { start = 0, stop = 60, num = 20 }
K_LM = { start = 0, stop = 2000, num = 20 }
B_VE = { start = 0, stop = 12, num = 8 }
"""
CASCADE = (Path(__file__).parents[1] / "sweeps" / "recipes" / "cascade.toml").read_text().partition("[sweep]")[0]
GAIN = '[sweep]\nalong = "k"\nk = { start = 0.1, stop = 20000 }\nJ = { start = 1, stop = 100, num = 400 }'
MASS = '[sweep]\nalong = "J"\nJ = { start = 1, stop = 100 }\nk = { start = 50, stop = 500, num = 40 }'
SWEEPS = {  # spec, eigenvalue problems for each of its slices, and the least ratio
    "five axes along K_VE": (FIVE_AXES, 4, 0.54),
    "fig4 along K_VE": ((PAPER / "fig4.toml").read_text(), 100, 2.7),
    "a drawn cascade along a gain": (CASCADE + GAIN, 500, 0.66),
    "a drawn cascade along a mass": (CASCADE + MASS, 1000, 0.86),
}
LOSS = 1.15  # of the time by the commit before


def sweeps(folder: Path) -> list[str]:
    """Print a line per sweep; the names of those that are too slow."""
    slow = []
    for name, (text, problems, least) in SWEEPS.items():
        path = folder / "spec.toml"
        path.write_text(text, encoding="utf-8")
        spec = load(path)
        job = job_of(spec)
        chunk = job.chunks[len(job.chunks) // 2]
        loop = own_loop(spec)
        states = loop.frames(loop.drift()).shape[-1]
        E = np.random.default_rng(0).standard_normal((chunk.slices * problems, states, states))
        pair = interleaved(lambda E=E: np.linalg.eigvals(E), job.task(chunk), Patience(0.0, 9, 9), forget)
        print(
            f"{name}: {chunk.slices} slices {pair.second:.3f} s; {len(E)} eigenvalue problems of {states} states "
            f"{pair.first:.3f} s; ratio {pair.ratio:.3f} (at least {least})"
        )
        slow += [name] * (pair.ratio < least)
    return slow


def whole_sweep(before: str, folder: Path) -> list[str]:
    """Print what the largest sweep costs by a commit and by this checkout, in turn; its name if it is too slow."""
    checkout = checked_out(before, folder / "before")
    path = folder / "five-axes.toml"
    path.write_text(FIVE_AXES, encoding="utf-8")
    times = []
    for _ in range(4):
        pair = []
        for side in (checkout, HERE):
            with tempfile.TemporaryDirectory() as out:
                pair.append(said(side, "zwidth", path, Path(out))[1])
        times.append(pair)
    first, second = np.median(times, axis=0)
    ratio = median(now / then for then, now in times)
    print(f"all of five axes: {first:.2f} s by {before}, {second:.2f} s now, {ratio:.2f} times (at most {LOSS})")
    return ["all of five axes"] * (ratio > LOSS)


def main() -> int:
    """Print a line per loop and per sweep; 1 if one is too slow, and it is asked for."""
    keep_memory()  # as commands do
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--least", action="store_true", help="the exit code is 1 if a ratio is below its least")
    parser.add_argument("--before", help="a commit, as that of the last release")
    options = parser.parse_args()
    slow = grids()
    with tempfile.TemporaryDirectory() as folder:
        if options.least:
            slow += sweeps(Path(folder))
        if options.before:
            slow += whole_sweep(options.before, Path(folder))
    return int(bool(slow) and options.least)


def grids() -> list[str]:
    """Print a line per loop; the names of those that are too slow."""
    slow = []
    for name, (source, least) in CASES.items():
        loop = wavesweep.compile(source)
        cut = wall_cut(loop.spec.values)

        def exact(loop=loop):
            return loop.stable_intervals(span=(0, 20000), B_VE=DAMPING)

        def grid(cut=cut):
            return np.abs(1 + np.linalg.eigvals(cut.at((None, None)).closed(STIFFNESS[:, None], DAMPING))).max(-1) < 1

        table, _ = exact(), grid()
        pair = interleaved(grid, exact, Patience(0.0, 15, 15))
        certified = f"{int(table.certified.sum())} of {len(table)} rows certified"
        print(
            f"{name}, {cut.order} states: {1e3 * pair.second:.2f} ms, {certified}; "
            f"grid {1e3 * pair.first:.1f} ms; {pair.ratio:.1f} times as fast (at least {least})"
        )
        slow += [name] * (pair.ratio < least)
    return slow


if __name__ == "__main__":
    sys.exit(main())
