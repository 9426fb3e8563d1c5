"""Load of large sweeps: time, memory of the run and of its workers, disk at its peak, time to write and to draw.

    python benchmarks/load.py 1 4        # millions of slices, one run after the other; 10 takes about 80 s on 2 cores

It runs `wavesweep zwidth` as a user does, in a temporary folder, and looks at /proc and at the folder ten times a second.
"""

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SPEC = """
[environment]
integration = "explicit"
[controller]
kind = "pmw"
[sweep]
K_VE = {{ start = 0, stop = 20000 }}
b = {{ start = 5, stop = 100, num = {loops} }}
B_VE = {{ start = 0, stop = 15, num = 500 }}
"""
LOOK = 0.1  # s


def main():
    print("| slices | time (s) | computing (s) | writing (s) | run (MB) | worker (MB) | disk (MB) | estimate (MB) |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for millions in map(float, sys.argv[1:] or ["1"]):
        with tempfile.TemporaryDirectory() as folder:
            row = measured(Path(folder), max(1, round(millions * 2000)))
        print("| " + " | ".join(f"{number:,.0f}" for number in row) + " |", flush=True)


def measured(folder, loops):
    """Give the numbers of a row for a sweep of 500 slices a loop."""
    (folder / "load.toml").write_text(SPEC.format(loops=loops))
    from wavesweep.program.analyses.interval_jobs import job_of
    from wavesweep.program.spec import load
    from wavesweep.program.sweep.estimates import expected_bytes

    expected = expected_bytes(job_of(load(folder / "load.toml")))
    started, run, worker, disk = time.perf_counter(), 0, 0, 0
    command = [sys.executable, "-m", "wavesweep", "zwidth", "load.toml", "--out", "out", "--quiet"]
    with subprocess.Popen(command, cwd=folder) as process:
        while process.poll() is None:
            run = max(run, peak_memory(process.pid))
            worker = max([worker, *(peak_memory(pid) for pid in children(process.pid))])
            disk = max(disk, size(folder / "out"))
            time.sleep(LOOK)
    if process.returncode:
        raise SystemExit(f"the run failed with exit code {process.returncode}")
    seconds = time.perf_counter() - started
    facts = json.loads((folder / "out" / "zwidth.datapackage.json").read_text())["wavesweep"]
    computing = facts["timings"]["compute_s"]
    return (
        facts["slices"]["computed"],
        seconds,
        computing,
        seconds - computing,
        run / 1e6,
        worker / 1e6,
        disk / 1e6,
        expected / 1e6,
    )


def peak_memory(pid):
    """Largest resident memory of a process so far (bytes), 0 if it is gone."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmHWM")), 0)


def children(pid):
    """Ids of the processes that a process has started from any of its threads."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += map(int, task.read_text().split())
        except OSError:
            continue
    return found


def size(folder):
    """Bytes of the files in a folder, which come and go meanwhile."""
    total = 0
    for file in folder.rglob("*"):
        try:
            total += file.stat().st_size if file.is_file() else 0
        except OSError:
            continue
    return total


if __name__ == "__main__":
    main()
