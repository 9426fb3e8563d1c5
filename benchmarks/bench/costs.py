"""Costs: of compiling over the ratio and the filters' order, of sweeping over slices and workers, of starting a process."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from bench.measuring import Patience, Row, interleaved
from bench.problems import SPECS, load_paper
from bench.this_tool import run
from wavesweep.haptics.controller_page import wall_cut
from wavesweep.program.tables.interval_table import intervals

RATIOS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
FILTERS = ("lp1", "hp", "lp2")
ORDERS = tuple(range(1, 13))
SLICES = (100, 300, 1000, 3000, 10_000)
FOR_WORKERS = (3000, 10_000, 30_000)  # slices; below the first of them no workers are started by themselves
_IMPORTS = "import numpy, click, pyarrow.parquet"
_FIGURE = f"{_IMPORTS}; from matplotlib.backends.backend_agg import FigureCanvasAgg; from matplotlib.figure import Figure"
ROUNDS = Patience(6.0, 5, 15)  # of whole processes


def exponent(size: Sequence[float], seconds: Sequence[float]) -> float:
    """Exponent p of `seconds ~ size^p`, by least squares on logarithms; NaN if there are fewer than two sizes."""
    return float(np.polyfit(np.log(size), np.log(seconds), 1)[0]) if len(size) > 1 else np.nan


def compile_rows(patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Time from a loaded spec to the loop cut at the wall."""
    base = load_paper("fig6").values
    few = slice(None, 2 if quick else None)
    ratios = {n: _compiling({**base, "rates.ratio": n}) for n in RATIOS[few]}
    yield from _series("compile", "ratio of the rates", ratios, patience)
    orders = {n: _compiling({**base, **{f"filters.{name}.order": n for name in FILTERS}}) for n in ORDERS[few]}
    yield from _series("compile", "order of all filters", orders, patience)


def _compiling(values: dict[str, Any]) -> Callable[[], Any]:
    return lambda: wall_cut(values)


def slice_rows(patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Time of a sweep over b, a loop per slice, in this process."""
    calls = {n: partial(_swept, n, 1) for n in SLICES[: 2 if quick else None]}
    yield from _series("slices", "sweep over b in one process", calls, patience)


def worker_rows(patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Time of a sweep over b with one and two worker processes, including the time to start them."""
    for n in () if quick else FOR_WORKERS:
        alone = partial(_swept, n, 1)
        pair = interleaved(partial(_swept, n, 2), alone, patience, clock=time.perf_counter)
        yield {
            "part": "workers", "problem": "sweep over b", "method": "2 workers", "setting": f"{n} slices", "size": n,
            "seconds": pair.first, "seconds_each": pair.first / n, "ratio": pair.ratio, "yardstick": "1 process",
            "pairs": pair.pairs,
        }  # fmt: skip


def start_rows(patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Time of whole processes, in comparison with the imports that they need at least. quick: the help only."""
    rounds = patience if quick else ROUNDS
    with tempfile.TemporaryDirectory() as out:
        zwidth = ["-m", "wavesweep", "zwidth", str(SPECS / "fig4.toml"), "--quiet", "--overwrite", "--out", out]
        for name, arguments, yardstick in (
            ("wavesweep --help", ["-m", "wavesweep", "--help"], "import click"),
            ("wavesweep zwidth fig4.toml --no-plot", [*zwidth, "--no-plot"], _IMPORTS),
            ("wavesweep zwidth fig4.toml", zwidth, _FIGURE),
        )[: 1 if quick else None]:
            pair = interleaved(partial(run, arguments), partial(run, ["-c", yardstick]), rounds)
            yield {
                "part": "start", "problem": "whole process", "method": name, "seconds": pair.first,
                "ratio": pair.ratio, "yardstick": yardstick, "pairs": pair.pairs,
            }  # fmt: skip


def _swept(slices: int, jobs: int) -> Any:
    axis = f"sweep.b={{ start = 5, stop = 80, num = {slices} }}"
    spec = load_paper("fig5-explicit", ("sweep.K_LM=[500]", "sweep.Kp=[20]", axis))
    return intervals(spec, along="K_VE", jobs=jobs, backend=None if jobs == 1 else "loky")


def _series(part: str, name: str, calls: dict[int, Callable[[], Any]], patience: Patience) -> Iterator[Row]:
    """A row for every size, timed alternately with the smallest."""
    smallest = next(iter(calls.values()))
    for size, call in calls.items():
        call()  # warm
        pair = interleaved(call, smallest, patience)
        yield {
            "part": part, "problem": name, "method": "this tool", "setting": str(size), "size": size,
            "seconds": pair.first, "seconds_each": pair.first / size if part == "slices" else np.nan,
            "ratio": pair.ratio, "yardstick": f"{next(iter(calls))}", "pairs": pair.pairs,
        }  # fmt: skip
