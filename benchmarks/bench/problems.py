"""Problems for every method, the reference answers at 50 digits, and the score of an answer.

A problem is to find all stable K_VE in each column of a sweep over a loop of the paper. `benchmarks/references.py` makes
`references.json`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import wavesweep
from wavesweep import Spec, WavesweepError
from wavesweep.engine._monodromy.cut import LinearFractional
from wavesweep.engine.rows import distinct_rows, selected
from wavesweep.haptics.controller_page import keys_of_page, wall_cut
from wavesweep.program.spec import sweep_axes
from wavesweep.program.sweep.grid import make_grid

COLUMNS = (25, 50, 100, 200)
FILE = Path(__file__).with_name("references.json")
SPECS = Path(__file__).parents[2] / "sweeps" / "paper"


@dataclass(frozen=True)
class Problem:
    """All stable intervals of K_VE in (0, stop) for each column, a combination of the values of `axes`.

    spec: name of one of the paper's specs. axes: in the order of its [sweep] table, new ones last; their product has the
    largest of COLUMNS columns.
    """

    name: str
    title: str
    spec: str
    stop: float
    axes: Mapping[str, tuple[float, ...]]

    def overrides(self, columns: int) -> tuple[str, ...]:
        """Settings that turn the paper's spec into this problem, as for `--set`."""
        axes = {**coarse(self.axes, columns)}
        lists = (f"sweep.{name}={list(values)}" for name, values in axes.items())
        return (f"sweep.K_VE={{ start = 0, stop = {self.stop!r} }}", *lists)

    def ask(self, columns: int) -> Spec:
        """The problem as a spec."""
        return load_paper(self.spec, self.overrides(columns))

    def numbers(self, columns: int) -> np.ndarray:
        """Positions of the columns of the coarser problem among those of the finest."""
        whole = np.arange(max(COLUMNS)).reshape([len(values) for values in self.axes.values()])
        few = coarse(self.axes, columns)
        steps = (slice(None, None, len(self.axes[name]) // len(few[name]) or 1) for name in self.axes)
        return whole[tuple(steps)].ravel()


def load_paper(name: str, overrides: tuple[str, ...] = ()) -> Spec:
    """Load one of the paper's specs by its name; overrides as for `--set`."""
    return wavesweep.load(SPECS / f"{name}.toml", overrides)


def coarse(axes: Mapping[str, tuple[float, ...]], columns: int) -> dict[str, tuple[float, ...]]:
    """Take every second value of the first axis with an even number of values, until only so many combinations are left."""
    few = dict(axes)
    while np.prod([len(values) for values in few.values()]) > columns:
        name = next(name for name, values in few.items() if len(values) % 2 == 0)
        few[name] = few[name][::2]
    return few


def _spaced(start: float, stop: float, number: int) -> tuple[float, ...]:
    # Rounded, so that the values are the same doubles wherever they are computed.
    return tuple(np.linspace(start, stop, number).round(6).tolist())


PROBLEMS = (
    Problem("fig4", "Fig. 4", "fig4", 2500.0, {"B_VE": _spaced(0, 15, 200)}),
    Problem("fig4-b25", "Fig. 4 with b = 25: a hole", "fig4-b25", 6000.0, {"B_VE": _spaced(0, 15, 200)}),
    Problem(
        "pmw-lm", "pmw-lm, explicit wall", "fig5-explicit", 1500.0,
        {"K_LM": _spaced(0, 3000, 50), "Kp": (0.0, 20.0, 10.0, 40.0)},
    ),
    Problem(
        "five-axes", "slice of a five-axis sweep", "fig5-explicit", 1000.0,
        {"K_LM": (0.0, 1000.0), "Kp": (20.0, 0.0), "B_VE": (2.0, 0.5),
         "b": tuple(np.geomspace(5, 80, 25).round(6).tolist())},
    ),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Bundle:
    """Columns whose loops share one drawing.

    column: their numbers. loops: the loops that they share, cut at the wall. owner: the index of each column's loop. B_VE: the
    damping of each, N*s/m.
    """

    column: np.ndarray
    loops: LinearFractional
    owner: np.ndarray
    B_VE: np.ndarray

    @property
    def cut(self) -> LinearFractional:
        """A loop for each column."""
        return self.loops.at(self.owner)


@lru_cache(maxsize=8)
def bundles(spec: Spec) -> tuple[Bundle, ...]:
    """Draw and compile the loops of all columns, the first step of every method, which is remembered as a compiled loop is.

    Columns that differ in the damping of the wall alone have one loop.
    """
    axis, others = sweep_axes(spec, "K_VE")
    grid = make_grid(spec, others, axis.path, rates=False)
    loops = range(grid.loops)
    changes = grid.loop_values(loops)
    B = np.broadcast_to(changes.get("environment.B_VE", spec.values["environment.B_VE"]), grid.loops)
    column = np.empty(grid.loops, int)
    column[grid.slice_of(np.arange(grid.size))] = np.arange(grid.size)
    found = []
    for members, values in grid.groups(loops):
        others = {path: v for path, v in values.items() if np.ndim(v) and path != "environment.B_VE"}
        first, owner = distinct_rows(others, members.size)
        cut = wall_cut(selected(values, first)).as_batch(first.size)
        found.append(Bundle(column[members], cut, owner, B[members]))
    return tuple(found)


def digest(spec: Spec) -> str:
    """Digest of everything on which the answer depends: the keys that the loop reads, and the sweep."""
    read = {path: spec.values[path] for path in sorted(keys_of_page(spec.values))}
    for path in ("device.delay", "device.dead_time"):  # as in the references, which know of none
        if not read[path]:
            del read[path]
    text = json.dumps({**read, "sweep": [[axis.name, axis.values, axis.stop] for axis in spec.sweep]})
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def references() -> dict[str, Any]:
    """Read the file of references."""
    return json.loads(FILE.read_text(encoding="utf-8"))


def checked(part: dict[str, Any], digest: str, name: str) -> dict[str, Any]:
    """Return the part of the references. Errors: WavesweepError if the problem has changed since they were made."""
    if part["digest"] != digest:
        raise WavesweepError(
            f"the references of {name} belong to another question than the benchmark now asks; "
            "benchmarks/references.py makes them anew"
        )
    return part


@dataclass(frozen=True, eq=False)
class Intervals:
    """Stable intervals: numbers of their columns, `(n,)`, and their ends in N/m, `(n,)` each."""

    column: np.ndarray
    low: np.ndarray
    high: np.ndarray


@dataclass(frozen=True)
class Score:
    """error_max, error_median: relative, over the critical stiffnesses of intervals that were found; NaN without any.

    found: intervals of the reference that overlap exactly one interval of the answer, which overlaps no other.
    there: intervals of the reference. wrong: columns with another number of intervals than the reference.
    """

    error_max: float
    error_median: float
    found: int
    there: int
    wrong: int


def score(answer: Intervals, truth: Sequence[Sequence[tuple[float, float]]], span: tuple[float, float]) -> Score:
    """Compare with the reference. truth: the intervals of each column. An end of the range is not a critical stiffness."""
    errors: list[float] = []
    found = wrong = 0
    for number, there in enumerate(truth):
        mine = np.flatnonzero(answer.column == number)
        claimed = list(zip(answer.low[mine].tolist(), answer.high[mine].tolist(), strict=True))
        wrong += len(claimed) != len(there)
        meets = np.array([[a < d and c < b for c, d in claimed] for a, b in there]).reshape(len(there), len(claimed))
        for i, j in zip(*np.nonzero(meets), strict=True):
            if meets[i].sum() == 1 and meets[:, j].sum() == 1:
                found += 1
                pairs = zip(claimed[j], there[i], strict=True)
                errors += [abs(got - true) / abs(true) for got, true in pairs if true not in span]
    known = (max(errors), float(np.median(errors))) if errors else (np.nan, np.nan)
    return Score(*known, found, sum(map(len, truth)), wrong)
