"""This tool: as a library, as a command, and a profile of one call, with the share that LAPACK takes alone."""

from __future__ import annotations

import cProfile
import os
import pstats
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from inspect import unwrap
from pathlib import Path
from typing import Any

import numpy as np

import wavesweep
from bench.measuring import Row, forget
from bench.problems import COLUMNS, PROBLEMS, SPECS, Intervals, Problem
from wavesweep import Spec
from wavesweep.engine._monodromy.open_frame import cut_of
from wavesweep.engine._search.open_loops import open_loops
from wavesweep.engine._stability.boundary import polish
from wavesweep.engine._stability.crossings import sampled_polynomial
from wavesweep.engine._stability.real_roots import isolate
from wavesweep.engine._stability.regions import regions
from wavesweep.program import results

STAGES = {  # function -> the stage that it is; together they are the whole call
    open_loops: "draw, connect and lift",
    cut_of: "cut",
    sampled_polynomial: "polynomial from samples",
    isolate: "roots and their proof",
    polish: "polish",
    regions: "count and label",
}
LAPACK = "LAPACK alone"
_ROUTINES = ("eigvals", "eig", "solve", "inv", "slogdet")


def library(spec: Spec) -> Any:
    """Compile and compute all stable intervals with their certificates: the DataFrame that a user gets."""
    (along,) = (axis for axis in spec.sweep if axis.name == "K_VE")
    axes = {axis.name: axis.values for axis in spec.sweep if axis is not along}
    return _compiled(spec).stable_intervals("K_VE", (along.start, along.stop), **axes)


_compiled = lru_cache(maxsize=8)(wavesweep.compile)


def answer_of(table: Mapping[str, Any]) -> Intervals:
    """The answer in a table of intervals."""
    interval = np.asarray(table["interval"])
    stable = np.asarray(table["intervals"]) > 0
    column = np.cumsum(interval <= 0) - 1
    return Intervals(column[stable], np.asarray(table["low"])[stable], np.asarray(table["high"])[stable])


def command(problem: Problem, columns: int) -> Intervals:
    """`wavesweep zwidth` as a process of its own, and its table read back."""
    settings = [word for setting in problem.overrides(columns) for word in ("--set", setting)]
    with tempfile.TemporaryDirectory() as out:
        spec = SPECS / f"{problem.spec}.toml"
        run(["-m", "wavesweep", "zwidth", str(spec), "--no-plot", "--quiet", "--out", out, *settings])
        return answer_of(results.read(Path(out) / "zwidth.parquet"))


def run(arguments: Sequence[str]) -> None:
    """Run this Python with these arguments, with this package on its path and its bytecode cached, as if installed."""
    reach = os.pathsep.join([str(Path(wavesweep.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL, env=kept | {"PYTHONPATH": reach})


def profile_rows(repeats: int = 20) -> Iterator[Row]:
    """Profile this tool on every problem: seconds of a first call, and the share of each stage."""
    for problem in PROBLEMS:
        spec = problem.ask(max(COLUMNS))
        call = partial(library, spec)
        call()
        profile = cProfile.Profile()
        for _ in range(repeats):
            forget()
            profile.runcall(call)
        stats = pstats.Stats(profile)
        seconds = {**_stages(stats), LAPACK: _lapack(stats)}
        for name, spent in seconds.items():
            yield {
                "part": "profile", "problem": problem.name, "method": name, "size": max(COLUMNS),
                "seconds": spent / repeats, "ratio": spent / stats.total_tt, "yardstick": "a whole first call, profiled",
                "pairs": repeats,
            }  # fmt: skip


def _stages(stats: pstats.Stats) -> dict[str, float]:
    """Cumulative seconds of each stage, and of the rest."""
    spent = {stage: stats.stats[_profiled(function)][3] for function, stage in STAGES.items()}
    return {**spent, "tables and the rest": stats.total_tt - sum(spent.values())}


def _profiled(function: Callable) -> tuple[str, int, str]:
    """Key of a function in a profile."""
    code = unwrap(function).__code__  # and not that of a decorator, which others share
    return code.co_filename, code.co_firstlineno, code.co_name


def _lapack(stats: pstats.Stats) -> float:
    """Own time of numpy's calls into LAPACK."""
    return sum(
        own for (file, _, function), (_, _, own, _, _) in stats.stats.items() if function in _ROUTINES and "linalg" in file
    )
