"""All measurements, and a summary in lines: speed at equal error, accuracy at equal time, and the growth of costs."""

from __future__ import annotations

import hashlib
import platform
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np

from bench import accuracy, frequency_responses, stiffness
from bench.costs import compile_rows, exponent, slice_rows, start_rows, worker_rows
from bench.measuring import FIELDS, FULL, QUICK, Row, columns_of
from bench.problems import FILE, PROBLEMS
from bench.stiffness import COMMAND, DECOMPOSITION, LIBRARY, PART
from bench.this_tool import LAPACK, profile_rows
from wavesweep import __version__
from wavesweep.program.columns import Columns
from wavesweep.program.tables.table import Table

METHODS = {
    "run_time": "processor time, medians; ratios from pairs that were run in turn, in one process with one thread",
    "first": "of a first call: all caches of this program and of the others' compiled loops are emptied before",
    "error": "relative, against 50-digit arithmetic",
}
GOOD = 1e-9  # the error at which run times are compared
FLOOR = np.finfo(float).eps  # nothing is called more accurate than this


def measure(*, quick: bool, progress: Callable[[int, int], None] | None = None) -> Table:
    """Measure everything and return the table.

    quick: the smallest problems only, in a few seconds. progress: called with the number of parts done and of all parts.
    """
    started, rows, parts = time.perf_counter(), [], list(_parts(quick))
    for done, part in enumerate(parts, start=1):
        rows += part()
        if progress is not None:
            progress(done, len(parts))
    return Table.of("bench", columns_of(rows), _facts(quick, time.perf_counter() - started), fields=FIELDS)


def _parts(quick: bool) -> Iterator[Callable[[], Iterator[Row]]]:
    """The measurements, as functions to be called one after the other."""
    patience = QUICK if quick else FULL
    for problem in stiffness.problems(quick=quick):
        yield partial(stiffness.rows, problem, patience, quick=quick)
    for rows in (frequency_responses.rows, compile_rows, slice_rows, worker_rows, start_rows):
        yield partial(rows, patience, quick=quick)
    yield partial(profile_rows, 1 if quick else 20)
    yield accuracy.rows


def _facts(quick: bool, seconds: float) -> dict:
    import control

    return {
        "schema_version": 1, "tool_version": __version__, "spec_sha256": hashlib.sha256(FILE.read_bytes()).hexdigest(),
        "methods": METHODS, "quick": quick, "titles": _titles(), "timings": {"total_s": round(seconds, 3)},
        "versions": {"python": platform.python_version(), "numpy": np.__version__, "control": control.__version__},
        "machine": platform.machine(), "processor": _processor(), "date": time.strftime("%Y-%m-%d"), "commit": _commit(),
    }  # fmt: skip


def _processor() -> str:
    """What the system calls its processor."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def _commit() -> str:
    """The commit of the checkout that is measured; empty without one."""
    with suppress(OSError):
        asked = ["git", "-C", str(FILE.parent), "describe", "--always", "--dirty"]
        return subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip()
    return ""


def _titles() -> dict[str, str]:
    """Problem -> its title in a figure."""
    return {problem.name: problem.title for problem in PROBLEMS} | {"fig6": "response of Fig. 6"}


def lines(columns: Columns) -> Iterator[str]:
    """Return the result of each measurement as a line of text. columns: the table of `measure`."""
    for problem in PROBLEMS:
        yield from _stiffness(_only(columns, part=PART, problem=problem.name), problem.title)
    yield from _response(_only(columns, part="response"))
    yield from _growth(columns)
    for row in _rows(_only(columns, part="start")):
        yield f"{row['method']}: {row['ratio']:.2f} times `{row['yardstick']}`"
    for row in _rows(_only(columns, part="profile", method=LAPACK)):
        yield f"profile, {row['problem']}: LAPACK alone takes {row['ratio']:.0%} of a first call"
    for row in _rows(_only(columns, part="accuracy")):
        yield f"accuracy, {row['problem']}, {row['setting']}: {row['error_max']:.0e} {row['yardstick']}".rstrip()


def _only(columns: Columns, **wanted: str) -> Columns:
    chosen = np.logical_and.reduce([columns[name] == value for name, value in wanted.items()])
    return {name: column[chosen] for name, column in columns.items()}


def _rows(columns: Columns) -> Iterator[dict]:
    for values in zip(*columns.values(), strict=True):
        yield dict(zip(columns, values, strict=True))


def _stiffness(here: Columns, title: str) -> Iterator[str]:
    own = list(_rows(_only(here, method=LIBRARY)))
    if not own:
        return
    ours = own[-1]
    yield (
        f"{title}: this tool finds {ours['found']:g} of {ours['there']:g} intervals, error {ours['error_max']:.0e}, "
        f"{1e6 * ours['seconds_each']:.3g} us per column again, {1e6 * ours['first_seconds'] / ours['size']:.3g} at a first "
        f"call; {ours['setting']}"
    )
    others = [row for row in _rows(here) if row["method"] not in (LIBRARY, COMMAND)]
    for method in dict.fromkeys(row["method"] for row in others):
        say = _by_angles if method == DECOMPOSITION else _against
        yield "  " + say([row for row in others if row["method"] == method], method, ours)
    yield "  " + _nearest(others)


def _by_angles(rows: list[dict], method: str, _ours: dict) -> str:
    """Every number of angles by name, since a user cannot know in advance which is enough."""
    each = (
        f"{row['ratio']:.3g} times as long ({row['first_ratio']:.3g} at a first call) with {row['setting']} "
        f"(error {row['error_max']:.0e}, {row['found']:g} intervals)"
        for row in rows
    )
    return f"{method}, which proves nothing, takes {', '.join(each)}"


def _nearest(others: list[dict]) -> str:
    """The method that is nearest in run time at equal error, with all intervals found."""
    equal = [row for row in others if row["error_max"] <= GOOD and not row["wrong"]]
    if not equal:
        return f"no other method finds every interval to {GOOD:.0e}"
    nearest = min(equal, key=lambda row: row["ratio"])
    return (
        f"nearest to {GOOD:.0e} with every interval, none of them proved: {nearest['method']} ({nearest['setting']}), "
        f"{nearest['ratio']:.3g} times the run time again, {nearest['first_ratio']:.3g} times at a first call"
    )


def _against(rows: list[dict], method: str, ours: dict) -> str:
    """One method: at equal error if it reaches that, otherwise at its best; and at equal time."""
    good = [row for row in rows if row["error_max"] <= GOOD]
    best = min(good, key=lambda row: row["ratio"]) if good else min(rows, key=_error)
    reached = f"error {best['error_max']:.0e}"
    if not good and np.isfinite(best["error_max"]) and "per axis" in best["setting"]:
        # A grid's error is its step, and its cost grows as the step shrinks.
        reached += f" ({GOOD:.0e} would take {best['ratio'] * best['error_max'] / GOOD:.0e} times, extrapolated)"
    found = f"{best['found']:g} of {best['there']:g} intervals"
    cheapest = min(rows, key=lambda row: row["ratio"])
    more = max(cheapest["error_max"], FLOOR) / max(ours["error_max"], FLOOR)
    text = (
        f"{method}: {best['ratio']:.3g} times the run time ({best['first_ratio']:.3g} at a first call) for {reached}, {found}"
    )
    if np.isfinite(more):
        text += f"; its fastest setting takes {cheapest['ratio']:.3g} times as long for {more:.0e} times the error"
    return text


def _error(row: dict) -> float:
    """The largest error, or infinity if no critical stiffness was found."""
    return float(np.nan_to_num(row["error_max"], nan=np.inf))


def _response(here: Columns) -> Iterator[str]:
    for row in _rows(here):
        yield (
            f"response, {row['setting']}: {row['method']} {1e3 * row['seconds']:.3g} ms, {row['ratio']:.3g} times "
            f"{row['yardstick']} ({row['first_ratio']:.3g} at a first call), error {row['error_max']:.0e}"
        )


def _growth(columns: Columns) -> Iterator[str]:
    for part in ("compile", "slices"):
        chosen = _only(columns, part=part)
        for name in dict.fromkeys(chosen["problem"].tolist()):
            one = _only(chosen, problem=name)
            size, ratio = one["size"], one["ratio"]
            # Relative to the smallest, each timed in turn with it: other loads of the machine cancel.
            yield (
                f"{part}, {name}: grows as its power {exponent(size, ratio):.2f} from {size[0]:g} to {size[-1]:g} "
                f"({1e3 * one['seconds'][0]:.3g} to {1e3 * one['seconds'][-1]:.3g} ms)"
            )
    for row in _rows(_only(columns, part="workers")):
        yield f"workers, {row['setting']}: 2 workers are {1 / row['ratio']:.2f} times as fast as one process, start included"
