"""Seconds of rows for all of [for_all]: `python benchmarks/for_all.py`, with OPENBLAS_NUM_THREADS=1 for one thread.

Frames of four lengths in any order, of all lengths from 16 to 33, lost results, and boxes of one to three numbers that are not
known, each in the loop of the paper's Figure 4 or under another controller. The median of three runs; what is proved and what
refutes more.
"""

import statistics
import time

from cliffs import FIG4

from wavesweep.program.spec import load
from wavesweep.program.tables.interval_table import intervals

FOUR = {"rates.ratio": {"values": [16, 20, 25, 33], "varying": True}}
MASS = {"device.mass": {"start": 0.08, "stop": 0.125}}
HAND = {"operator.stiffness": {"start": 0, "stop": 1000}}
CASES = [
    ("four lengths", {}, FOUR),
    ("four lengths, nominal step", {"environment": {"step": "nominal"}}, FOUR),
    ("four lengths, dc-slow", {"controller": {"kind": "dc-slow"}}, FOUR),
    ("four lengths, pmw-lm", {"controller": {"kind": "pmw-lm"}}, FOUR),
    ("16 to 33", {}, {"rates.ratio": {"start": 16, "stop": 33, "varying": True}}),
    ("two results lost in a row", {}, {"lost": 2}),
    ("mass", {}, MASS),
    ("mass and hand", {}, MASS | HAND),
    ("mass, damping and hand", {}, MASS | HAND | {"device.damping": {"start": 1, "stop": 2}}),
]


def timed(more, for_all):
    """The row for all, and the seconds that it takes."""
    spec = load({name: {**table, **more.get(name, {})} for name, table in FIG4.items()} | {"for_all": for_all})
    seconds = []
    for _ in range(3):
        started = time.perf_counter()
        table = intervals(spec, along="K_VE", jobs=1).columns
        seconds.append(time.perf_counter() - started)
    return {name: column[-1] for name, column in table.items()}, statistics.median(seconds)


for title, more, for_all in CASES:
    row, seconds = timed(more, for_all)
    known = "settled" if row["settled"] else "not settled"
    print(f"{title:28} {seconds:6.2f} s  proved to {row['high']:8.3f}, refuted from {row['fails_from']:8.3f}, {known}")
