"""How fast a sweep is, and what a dense grid of eigenvalues would take instead.

    python benchmarks/sweep_speed.py [SPEC] [--jobs 1,2] [--out DIR]

Runs `wavesweep zwidth SPEC` (sweeps/design-study.toml by default) once for each number of jobs, compares the bytes, and
prints wall time, peak memory, slices per second per worker and the speed-up; then the
time of the question's poor man's version: eigenvalues at 100 values of K_VE for a random thousandth of the slices.
"""

import argparse
import hashlib
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from wavesweep.haptics.controller_page import wall_cut
from wavesweep.program.analyses.interval_jobs import job_of
from wavesweep.program.spec import load

STUDY = Path(__file__).parents[1] / "sweeps" / "design-study.toml"
GRID, THOUSANDTH = 100, 1000


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("spec", nargs="?", default=str(STUDY))
    options.add_argument("--jobs", default="1,2", help="numbers of jobs, e.g. 1,2,4; none runs no sweep")
    options.add_argument("--out", help="keep the results there")
    given = options.parse_args()
    job = job_of(load(given.spec), "K_VE")
    print(f"{given.spec}: {job.slices} slices, {job.grid.loops} loops, {len(job.chunks)} chunks")
    with tempfile.TemporaryDirectory() as folder:
        jobs = [int(number) for number in given.jobs.split(",") if number]
        times = {number: run(given.spec, number, Path(given.out or folder) / f"jobs{number}") for number in jobs}
    for number, seconds in times.items():
        print(f"  {number} jobs: {times[1] / seconds:.2f} times as fast as one" if 1 in times else "")
    ratio(job)


def run(spec, jobs, out):
    """Wall seconds of one sweep, in a process of its own."""
    started = time.perf_counter()
    command = [
        sys.executable,
        "-m",
        "wavesweep",
        "zwidth",
        spec,
        "--out",
        str(out),
        "--jobs",
        str(jobs),
        "--quiet",
        "--overwrite",
    ]
    subprocess.run(command, check=True)
    wall = time.perf_counter() - started
    facts = json.loads((out / "zwidth.datapackage.json").read_text())["wavesweep"]
    timings, slices = facts["timings"], facts["slices"]
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    rate = slices["computed"] / timings["processor_s"]
    print(f"  {jobs} jobs ({timings['workers']} workers): wall {wall:.1f} s, of that computing {timings['compute_s']:.1f} s")
    print(f"    {rate:,.0f} slices per processor second")
    print(f"    {slices['certified']} of {slices['computed']} certified")
    print(f"    peak memory of the largest process so far {peak:.0f} MiB")
    for name in ("zwidth.csv", "zwidth.parquet", "zwidth.png"):
        with (out / name).open("rb") as file:
            digest, size = hashlib.file_digest(file, "sha256").hexdigest()[:16], (out / name).stat().st_size / 2**20
            print(f"    {name}: {digest}, {size:.1f} MiB")
    return wall


def ratio(job):
    """This tool and a dense grid of eigenvalues on the same random slices."""
    grid, random = job.grid, np.random.default_rng(1)
    count = max(1, job.slices // THOUSANDTH)
    column = np.sort(random.choice(job.slices, count, replace=False))
    # A zero among other values would need a drawing of its own; for the time it makes no difference.
    values = dict(grid.spec.values) | {path: np.maximum(v, 1e-9) for path, v in grid.loop_values(column).items()}
    wall_values = np.broadcast_to(values["environment.B_VE"], column.shape)
    K = np.linspace(*job.asked.span, GRID)
    started = time.thread_time()
    for start in range(0, count, 50):  # in the cache, as a careful user would
        part = {path: v[start : start + 50] if np.ndim(v) else v for path, v in values.items()}
        B = wall_values[start : start + 50]
        E = wall_cut(part).as_batch(B.size).at((slice(None), None)).closed(K, B[:, None])
        np.abs(1 + np.linalg.eigvals(E)).max(-1) < 1  # noqa: B015 - for its time
    dense = (time.thread_time() - started) / count * job.slices
    number = len(job.chunks) // 2
    task = job.task(job.chunks[number])
    started = time.thread_time()
    task()
    exact = (time.thread_time() - started) / job.chunks[number].slices * job.slices
    print(f"The whole sweep in one process: a grid of {GRID} eigenvalue problems a slice {dense:.0f} s (a random thousandth,")
    print(f"scaled), all intervals exactly {exact:.0f} s (one chunk, scaled): {dense / exact:.1f} times as fast, to 1e-12 in")
    print(f"place of {100 / (GRID - 1):.1f} % of the range, and certified")


if __name__ == "__main__":
    main()
