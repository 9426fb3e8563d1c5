"""Tasks for a worker: picklable data that compute their own result, loading numpy alone."""

import os
import signal
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from typing import Protocol

import numpy as np

from wavesweep.analysis.intervals import Intervals, stable_along_any, stable_intervals
from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import WALL, draw
from wavesweep.lifted import Cut, close, cut_at_wall
from wavesweep.sweep.grid import groups, make_grid

WATCH = 0.5  # s between two looks at the parent

FIELDS = (
    ("column", "<i4"),
    ("intervals", "<i4"),
    ("interval", "<i4"),
    ("low", "<f8"),
    ("high", "<f8"),
    ("low_omega", "<f8"),
    ("high_omega", "<f8"),
    ("certified", "?"),
    ("residual", "<f8"),
    ("doubt", "i1"),
)
DTYPE = np.dtype(list(FIELDS))
END_HANDS = {end: tuple(f"{end}_hand_{part}" for part in ("mass", "damping", "stiffness")) for end in ("low", "high")}
# What holds for hands has besides the hand that sets an end, and whether it is proved for all that it is for.
HELD = np.dtype([*FIELDS, *((name, "<f8") for names in END_HANDS.values() for name in names), ("settled", "?")])


def records_of(found: Intervals) -> np.ndarray:
    """The intervals as records, sorted by column (numbered from 0 in the chunk)."""
    records = np.empty(found.column.size, DTYPE)
    records["intervals"], records["interval"] = found.count, np.maximum(found.index, 0)
    for name in ("column", "low", "high", "low_omega", "high_omega", "certified", "residual", "doubt"):
        records[name] = getattr(found, name)
    return records


def is_whole(records: np.ndarray, columns: int) -> bool:
    """Whether they are records and every one of the columns has as many as it says."""
    if not records.size:
        return False
    starts = np.flatnonzero(np.append(True, np.diff(records["column"]) != 0))
    rows = np.diff(np.append(starts, records.size))
    return np.array_equal(records["column"][starts], np.arange(columns)) and np.array_equal(
        rows, np.maximum(records["intervals"][starts], 1)
    )


def certified_columns(records: np.ndarray) -> int:
    """How many columns are certified; all records of a column agree on it."""
    return int((records["certified"] & (records["interval"] == 0)).sum())


class Task(Protocol):
    """Any piece of work: values and arrays that know what to do with themselves."""

    def records(self) -> np.ndarray:
        """Do it; a structured array."""


def timed(number: int, work: Task, parent: int) -> tuple[int, np.ndarray, float]:
    """Solve a chunk: its number, its records, and the processor's seconds that it took. parent: process id of whoever asks."""
    if os.getppid() == parent:
        _settle_in(parent)
    started = time.thread_time()
    records = work.records()
    return number, records, time.thread_time() - started


@cache  # once in a process
def _settle_in(parent):
    """Leave Ctrl-C, which reaches every process of a terminal, to the parent; and end when the parent is gone."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch():
        while os.getppid() == parent:
            time.sleep(WATCH)
        # Killed without a word; a pool's worker would wait for work for minutes.
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


TINY = 1e-300  # stands in for a zero that would take a state out of the loop
SYMBOL = dict(zip(WALL, ("K_VE", "B_VE"), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class Work:
    """What is to be solved: intervals along the path `along` within span = (low, high).

    groups: (members, values) pairs, see `groups`; the members of all of them number the loops from 0.
    walls: path -> value of every wall that each loop is closed with. bounds: beyond them the parameter makes no loop.
    cut: the compiled loop, where there is a single one and it is at hand.
    """

    along: str
    span: tuple[float, float]
    bounds: tuple[float, float]
    groups: tuple[tuple[np.ndarray, Mapping[str, object]], ...]
    walls: Mapping[str, np.ndarray]
    cut: Cut | None = None

    def records(self) -> np.ndarray:
        """Solve it; the intervals as records."""
        return records_of(solve(self))


def solve(work: Work) -> Intervals:
    """Solve it; columns of the result are numbered `loop * walls + wall`."""
    walls = len(work.walls[WALL[0]])
    along = _along_wall if work.along in WALL else _along_number
    parts = []
    for members, values in work.groups:
        found = along(work, values, members.size, walls)
        parts.append((found, members[found.column // walls] * walls + found.column % walls))
    return joined(parts)


def _along_wall(work, values, size, walls):
    """Exactly, the wall being one scalar of the cut loop."""
    loops = with_batch(work.cut or cut_at_wall(draw(values)), size)
    other = next(path for path in WALL if path != work.along)
    return stable_intervals(loops, SYMBOL[work.along], work.span, np.broadcast_to(work.walls[other], (size, walls)))


def _along_number(work, values, size, walls):
    """Through eigenvalues: the loop is compiled anew at every point that is asked for, once for all walls."""
    K, B = (work.walls[path] for path in WALL)

    def evaluate(column, p):
        loop, wall = np.divmod(column, walls)
        first, back = _different(loop, p)
        at, p = loop[first], np.where(p[first] == 0, TINY, p[first])
        varied = {path: v[at] if np.ndim(v) else v for path, v in values.items()} | {work.along: p}
        with np.errstate(all="ignore"):  # beside the real axis a loop may explode: what is not finite is seen by the panels
            cuts = with_batch(cut_at_wall(draw(varied)), p.size).at(back)
            return close(cuts, K[wall], B[wall])

    rate = np.broadcast_to(np.asarray(values["rates.fast_hz"], float), (size,))
    ticks = draw(values).ratio
    return stable_along_any(evaluate, work.span, size * walls, np.repeat(ticks / rate, walls), _bounds(work, rate))


def _different(loop, p):
    """Where each different pair of loop and value stands first, and for all of them which of these they equal."""
    order = np.lexsort((p.imag, p.real, loop))
    new = np.append(True, (np.diff(loop[order]) != 0) | (np.diff(p[order]) != 0))[: p.size]
    back = np.empty(p.size, int)
    back[order] = np.cumsum(new) - 1
    return order[new], back


def _bounds(work, rate):
    """Beyond which values there is no loop; for a cutoff, half way from the span to half the fast rate (Hz)."""
    low, high = work.bounds
    if work.along.endswith("cutoff_hz"):
        high = min(high, (work.span[1] + rate.min() / 2) / 2)
    return low, high


def with_batch(cut: Cut, size: int) -> Cut:
    """The cut as a batch of `size` loops; one that nothing varied is repeated."""
    return cut if cut.batch else cut.at(np.newaxis).at(np.zeros(size, int))


def joined(parts) -> Intervals:
    """Intervals of several groups as one, sorted by column; parts: (intervals, their columns' new numbers) pairs."""
    column = np.concatenate([columns for _, columns in parts])
    order = np.argsort(column, kind="stable")
    whole = {f.name: np.concatenate([getattr(part, f.name) for part, _ in parts])[order] for f in fields(Intervals)}
    return Intervals(**(whole | {"column": column[order]}))


PORT = np.dtype([
    ("column", "<i8"), ("port_margin", "<f8"), ("port_omega", "<f8"), ("port_passive", "?"), ("certified", "?"),
])  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class PortWork:
    """Loops of one drawing; column: their numbers, values: flat keys, arrays over them where they differ."""

    column: np.ndarray
    values: Mapping[str, object]

    def first(self, count: int) -> "PortWork":
        """The same for the first few loops."""
        return PortWork(self.column[:count], {path: v[:count] if np.ndim(v) else v for path, v in self.values.items()})

    def records(self) -> np.ndarray:
        """Compute it; a record per loop."""
        from wavesweep.analysis.passivity import port_margin

        found = port_margin(self.values)
        records = np.empty(self.column.size, PORT)
        records["column"], records["port_margin"], records["port_omega"] = self.column, found.margin, found.omega
        # A loop that keeps no digit has no margin, and with it no frequency of one.
        records["port_omega"][np.isnan(records["port_margin"])] = np.nan
        records["port_passive"], records["certified"] = found.passive, found.certified
        return records


def radius_over(spec, axes, cut=None) -> np.ndarray:
    """Spectral radius per frame of `ratio` ticks for every combination of the axes, flat, the first axis slowest.

    cut: the loop of the spec's own values, used where only the wall is swept.
    """
    grid = make_grid(spec, axes)
    K, B = grid.wall_values().values()
    found = np.empty((grid.loops, grid.walls))
    for members, values in groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops):
        diagram = draw(values)
        loops = cut if cut is not None and not grid.loop_axes else cut_at_wall(diagram)
        radius = spectral_radius(with_batch(loops, members.size).at((slice(None), None)), K, B)
        # A loop may have a frame of fewer ticks, as the ideal coupling has; counted per frame of the spec, controllers compare.
        with np.errstate(over="ignore"):
            found[members] = radius ** (values["rates.ratio"] // diagram.ratio)
    loop, wall = grid.column_of(np.arange(grid.size))
    return found[loop, wall]
