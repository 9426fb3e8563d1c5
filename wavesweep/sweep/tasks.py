"""Tasks for a worker: picklable data that compute their own records and load numpy alone."""

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Protocol

import numpy as np

from wavesweep.analysis.intervals import Intervals, stable_intervals
from wavesweep.analysis.response import felt, felt_map
from wavesweep.analysis.spectrum import spectral_radius
from wavesweep.diagram import WALL, draw, identity
from wavesweep.errors import IllPosedLoopError
from wavesweep.kernel import using
from wavesweep.lifted import Cut, cut_at_wall, with_batch
from wavesweep.lifted.lift import frame_at_rest
from wavesweep.sweep.any_number import along_any_number, varied
from wavesweep.sweep.grid import groups, make_grid

WATCH = 0.5  # s between two looks at the parent

FIELDS = (
    ("slice", "<i4"),
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
FELT = ("felt_low", "felt_high")
_FELT = tuple((name, "<f8") for name in FELT)
RECORD = np.dtype([*FIELDS, *_FELT])
END_HANDS = {end: tuple(f"{end}_hand_{part}" for part in ("mass", "damping", "stiffness")) for end in ("low", "high")}
# Guarantees for hands have the hand that sets each end as well, and whether they are proved for every hand.
HAND_RECORD = np.dtype([*FIELDS, *((name, "<f8") for names in END_HANDS.values() for name in names), ("settled", "?"), *_FELT])


def records_of(found: Intervals) -> np.ndarray:
    """The intervals as records, sorted by slice (numbered from 0 in the chunk)."""
    records = np.zeros(found.column.size, RECORD)
    records["slice"] = found.column
    records["intervals"], records["interval"] = found.count, np.maximum(found.index, 0)
    for name in ("low", "high", "low_omega", "high_omega", "certified", "residual", "doubt"):
        records[name] = getattr(found, name)
    return records


def certified_slices(records: np.ndarray) -> int:
    """How many slices are certified; all records of a slice agree on it."""
    return int((records["certified"] & (records["interval"] == 0)).sum())


class Task(Protocol):
    """A task for a worker: picklable data with a `records()` method that computes the result."""

    def records(self) -> np.ndarray:
        """Compute the result, a structured array."""


def timed(number: int, task: Task, kernel: str) -> tuple[int, np.ndarray, float]:
    """Compute a chunk with that kernel: its number, its records and the processor seconds used.

    Errors: those of the task; an IllPosedLoopError has the number.
    """
    started = time.thread_time()
    try:
        with using(kernel):
            records = task.records()
    except IllPosedLoopError as error:
        error.chunk = number
        raise
    return number, records, time.thread_time() - started


def settle_in(parent: int) -> None:
    """Make this process a worker of the process `parent`: signals and warnings are left to it, and both end together.

    Memory that is freed is kept.

    The watch begins before the first task. A parent that was killed while this process was starting is not its parent any
    more, and a pool's worker would wait for minutes for its next task.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    warnings.simplefilter("ignore")
    keep_memory()

    def watch():
        while os.getppid() == parent:
            time.sleep(WATCH)
        os._exit(1)

    if os.getppid() != parent:
        os._exit(1)
    threading.Thread(target=watch, daemon=True).start()


KEPT = 2**27  # bytes that the allocator keeps
FROM_HEAP = 2**25  # bytes up to which an array comes from there, the most that glibc allows
M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # of malloc.h


def keep_memory() -> None:
    """Let glibc's allocator keep memory that is freed, for the matrices of the next step; others are left as they are.

    Otherwise it gives that memory back to the system, which clears it before it is used again: a fifth of the time of a sweep.
    It is for processes that are of this program alone.
    """
    import ctypes

    with suppress(AttributeError, OSError, TypeError):  # no glibc, or no library of this process
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(M_MMAP_THRESHOLD, FROM_HEAP)
        mallopt(M_TRIM_THRESHOLD, KEPT)


SYMBOL = dict(zip(WALL, ("K_VE", "B_VE"), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class IntervalTask:
    """Stable intervals along the path `along` within span = (low, high).

    groups: (members, values) pairs, see `groups`; the members of all of them number the loops from 0.
    walls: path -> value of every wall that each loop is closed with, `(walls,)`, or `(loops, walls)` if loops have their own.
    bounds: the drawing exists between these values of the parameter. cut: the compiled loop, if there is only one and it
    is known already. ties: paths of numbers that follow the parameter; their values are the factors. felt: give
    the felt stiffness at the ends too.
    """

    along: str
    span: tuple[float, float]
    bounds: tuple[float, float]
    groups: tuple[tuple[np.ndarray, Mapping[str, object]], ...]
    walls: Mapping[str, np.ndarray]
    cut: Cut | None = None
    ties: tuple[str, ...] = ()
    felt: bool = True

    def records(self) -> np.ndarray:
        """The intervals as records."""
        drawn: dict[int, tuple] = {}
        return with_felt(self, records_of(solve(self, drawn)), drawn)


def with_felt(task: IntervalTask, records: np.ndarray, drawn: Mapping[int, tuple] = MappingProxyType({})) -> np.ndarray:
    """The records with the static stiffness that the hand feels at both ends of each interval (N/m; NaN: none); drawn: see
    `solve`."""
    walls = task.walls[WALL[0]]
    loop, wall = np.divmod(records["slice"], walls.shape[-1])
    K = np.atleast_2d(walls)[loop if walls.ndim > 1 else 0, wall]
    for name in FELT:
        records[name] = np.nan
    for number, (members, values) in enumerate(task.groups if task.felt else ()):
        mine = np.isin(loop, members) if len(task.groups) > 1 else True
        rows = np.flatnonzero(mine & (records["intervals"] > 0))
        at = np.searchsorted(members, loop[rows])
        if not rows.size:
            continue
        if task.along in WALL and not task.ties:
            batch = _batch(values)
            diagram, whole = drawn.get(number) or (None, None)
            known = felt_map(diagram or draw(values), batch, whole) if batch else _felt_of_one(*identity(values))
            known = np.broadcast_to(known.reshape(3, -1), (3, members.size))[:, at]
            for name, end in zip(FELT, ("low", "high"), strict=True):
                records[name][rows] = felt(known, records[end][rows] if task.along == WALL[0] else K[rows])
            continue

        def stiffness(some, p, values=values, at=at, rows=rows):
            wall = p if task.along == WALL[0] else K[rows[some]]
            return felt(felt_map(draw(varied(task, values, at[some], p)), p.shape), wall)

        felt_at_ends(records, rows, stiffness)
    return records


BESIDE = 1e-4  # of an end, how far from it is looked where a mode has the frame's own period there
AGREED = 1e-3  # relative difference of two such looks, beyond which nothing is felt that is the same on both sides


def felt_at_ends(records: np.ndarray, rows: np.ndarray, stiffness: Callable) -> None:
    """Fill in the stiffness felt at both ends of these rows, along a number that is no wall.

    stiffness(some, p): that of the loops of the rows `some`, at these values of the number. A 0 takes a branch out of the loop,
    so ends at 0 are computed apart. At a crossing of z = 1 a frame does not determine the state at rest, since a mode that
    alternates from tick to tick repeats in it; the stiffness is smooth there, and follows from both sides.
    """
    p, omega = (
        np.concatenate([records[name][rows] for name in names]) for names in (("low", "high"), ("low_omega", "high_omega"))
    )
    own, found = np.tile(np.arange(rows.size), 2), np.empty(p.size)
    with np.errstate(all="ignore"):
        for some in (np.flatnonzero(p == 0), np.flatnonzero(p != 0)):
            if some.size:
                found[some] = stiffness(own[some], p[some])
        at = np.flatnonzero((omega == 0) & (p != 0))
        if at.size:
            sides = np.multiply.outer([1 - BESIDE, 1 + BESIDE, 1 - 2 * BESIDE, 1 + 2 * BESIDE], p[at])
            beside = stiffness(np.tile(own[at], 4), sides.ravel()).reshape(4, -1)
            near, far = beside[0] + beside[1], beside[2] + beside[3]
            found[at] = np.where(np.abs(near - far) <= AGREED * np.abs(near), (4 * near - far) / 6, np.nan)
    for name, part in zip(FELT, np.split(found, 2), strict=True):
        records[name][rows] = part


@lru_cache(maxsize=64)  # a compiled loop is asked again and again
def _felt_of_one(_, items):
    """What is felt of the walls of a single loop, see `identity`."""
    return felt_map(draw(dict(items)))


def _batch(values):
    """The shape of the arrays among the values."""
    return np.broadcast_shapes(*(value.shape for value in values.values() if isinstance(value, np.ndarray)))


def solve(task: IntervalTask, drawn: dict[int, tuple] | None = None) -> Intervals:
    """The intervals, sorted by slice; slices are numbered `loop * walls + wall`.

    drawn: gets, for groups of several loops, the drawing and its frame, with which `with_felt` goes on.
    """
    walls = task.walls[WALL[0]].shape[-1]
    exact = task.along in WALL and not task.ties
    parts, slices = [], []
    for number, (members, values) in enumerate(task.groups):
        own = {
            path: np.broadcast_to(each[members] if each.ndim > 1 else each, (members.size, walls))
            for path, each in task.walls.items()
        }
        if exact:
            parts.append(_along_wall(task, values, own, number, drawn if task.felt else None))
        else:
            parts.append(along_any_number(task, values, own))
        slices.append(members[parts[-1].column // walls] * walls + parts[-1].column % walls)
    if len(parts) == 1:
        return replace(parts[0], column=slices[0])
    slices = np.concatenate(slices)
    order = np.argsort(slices, kind="stable")
    return replace(Intervals.join(parts), column=slices).take(order)


def _along_wall(task, values, walls, number, drawn):
    """Exact intervals: the wall is one scalar of the cut loop."""
    other, cut = next(path for path in WALL if path != task.along), task.cut
    if cut is None:
        diagram, whole = draw(values), None
        if drawn is not None and _batch(values):
            whole = frame_at_rest(diagram)
            drawn[number] = diagram, whole
        cut = cut_at_wall(diagram, whole)
    loops = with_batch(cut, len(walls[other]))
    return stable_intervals(loops, SYMBOL[task.along], task.span, walls[other])


def radius_over(spec, axes, cut=None) -> np.ndarray:
    """Spectral radius per frame of `ratio` ticks for every combination of the axes, flat, the first axis slowest.

    cut: the loop of the spec's own values, used if only the wall is swept.
    """
    grid = make_grid(spec, axes)
    if grid.drawing:
        from wavesweep.sweep.drawn_loops import radii

        return radii(grid)[grid.slice_of(np.arange(grid.size))]
    K, B = grid.wall_values().values()
    found = np.empty((grid.loops, grid.walls))
    for members, values in groups(spec, grid.loop_values(np.arange(grid.loops)), grid.loops, rates=True):
        diagram = draw(values)
        loops = cut if cut is not None and not grid.loop_axes else cut_at_wall(diagram)
        radius = spectral_radius(with_batch(loops, members.size).at((slice(None), None)), K, B)
        # A loop may have a frame of fewer ticks, as the ideal coupling has; counted per frame of the spec, controllers compare.
        with np.errstate(over="ignore"):
            found[members] = radius ** (values["rates.ratio"] // diagram.ratio)
    return found.reshape(-1)[grid.slice_of(np.arange(grid.size))]
