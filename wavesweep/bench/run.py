"""All measurements, one after the other."""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Callable, Iterator
from functools import partial

from wavesweep import __version__
from wavesweep.bench import accuracy, growth, hotpath, responses, start, stiffness
from wavesweep.bench.problems import PROBLEMS
from wavesweep.bench.references import FILE
from wavesweep.bench.table import Row, columns_of
from wavesweep.bench.timing import FULL, QUICK
from wavesweep.sweep import Run

METHODS = {
    "run_time": "wall time, medians; ratios from pairs that were run in turn, in one process with one thread",
    "error": "relative, against 50-digit arithmetic",
}


def measure(*, quick: bool, progress: Callable[[int, int], None] | None = None) -> Run:
    """Measure everything and give the table; quick: a few seconds, enough to see that all of it works.

    progress: called with how many parts are done, and of how many.
    """
    started, rows, parts = time.perf_counter(), [], list(_parts(quick))
    for done, part in enumerate(parts, start=1):
        rows += part()
        if progress is not None:
            progress(done, len(parts))
    return Run(columns_of(rows), _facts(quick, time.perf_counter() - started))


def _parts(quick: bool) -> Iterator[Callable[[], Iterator[Row]]]:
    """The measurements, each to be called in its turn."""
    patience = QUICK if quick else FULL
    for problem in stiffness.problems(quick=quick):
        yield partial(stiffness.rows, problem, patience, quick=quick)
    for rows in (responses.rows, growth.compile_rows, growth.slice_rows, growth.worker_rows, start.rows):
        yield partial(rows, patience, quick=quick)
    yield partial(hotpath.rows, 1 if quick else 20)
    yield accuracy.rows


def _facts(quick: bool, seconds: float) -> dict:
    import control
    import numpy as np

    return {
        "schema_version": 1, "tool_version": __version__, "spec_sha256": hashlib.sha256(FILE.read_bytes()).hexdigest(),
        "methods": METHODS, "quick": quick, "titles": _titles(), "timings": {"total_s": round(seconds, 3)},
        "versions": {"python": platform.python_version(), "numpy": np.__version__, "control": control.__version__},
        "machine": platform.machine(),
    }  # fmt: skip


def _titles() -> dict[str, str]:
    """Problem -> what it is called in a figure."""
    return {problem.name: problem.title for problem in PROBLEMS} | {"fig6": "response of Fig. 6"}
