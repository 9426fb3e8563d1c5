"""Where the time of one call goes, and what of it LAPACK takes alone: the floor of this way of computing it."""

from __future__ import annotations

import cProfile
import pstats
from collections.abc import Iterator
from functools import partial

from wavesweep.bench import ours
from wavesweep.bench.problems import COLUMNS, PROBLEMS
from wavesweep.bench.table import Row

# (end of the file's path, function) -> what it stands for; together they are the whole call.
STAGES = {
    ("diagram/__init__.py", "draw"): "draw and discretise",
    ("lifted/cut.py", "cut_at_wall"): "connect, lift and cut",
    ("intervals/hopeless.py", "surely_unstable"): "screen",
    ("intervals/polynomial.py", "sampled_polynomial"): "polynomial from samples",
    ("intervals/isolate.py", "isolate"): "roots and their proof",
    ("intervals/polish.py", "polish"): "polish",
    ("intervals/regions.py", "regions"): "count and label",
}
LAPACK = "LAPACK alone"
_ROUTINES = ("eigvals", "eig", "solve", "inv", "slogdet")


def rows(repeats: int = 20) -> Iterator[Row]:
    """Profile this tool on every problem: seconds of a call, and what share of it each stage has."""
    for problem in PROBLEMS:
        spec = problem.ask(max(COLUMNS))
        call = partial(ours.library, spec)
        call()
        profile = cProfile.Profile()
        profile.enable()
        for _ in range(repeats):
            call()
        profile.disable()
        stats = pstats.Stats(profile)
        seconds = {**_stages(stats), LAPACK: _lapack(stats)}
        for name, spent in seconds.items():
            yield {
                "part": "profile", "problem": problem.name, "method": name, "size": max(COLUMNS),
                "seconds": spent / repeats, "ratio": spent / stats.total_tt, "yardstick": "the whole call, profiled",
                "pairs": repeats,
            }  # fmt: skip


def _stages(stats: pstats.Stats) -> dict[str, float]:
    """Cumulative seconds of each stage, and of all that is in none of them."""
    spent = dict.fromkeys(STAGES.values(), 0.0)
    for (file, _, function), (_, _, _, cumulative, _) in stats.stats.items():
        for (tail, name), stage in STAGES.items():
            if function == name and file.endswith(tail):
                spent[stage] += cumulative
    return {**spent, "tables and the rest": stats.total_tt - sum(spent.values())}


def _lapack(stats: pstats.Stats) -> float:
    """Own time of numpy's calls into LAPACK."""
    return sum(
        own
        for (file, _, function), (_, _, own, _, _) in stats.stats.items()
        if function in _ROUTINES and "linalg" in file
    )
