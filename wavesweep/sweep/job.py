"""One sweep's job, settled before anything is computed: intervals along what, of which columns, in which chunks."""

import time
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.diagram import WALL, draw
from wavesweep.errors import SpecError, UsageError
from wavesweep.lifted import Cut, cut_at_wall
from wavesweep.spec import KEYS, Axis, Spec, sweep_axes
from wavesweep.sweep.grid import Grid, groups, is_plain, make_grid
from wavesweep.sweep.tasks import Work

SECONDS = 0.3  # a chunk should take so long: longer, and a crash loses more; shorter, and handing it out costs more
FEWEST, MOST = 16, 4096  # columns of a chunk; more would leave the processor's cache
# Seconds per column and squared order, measured: one polynomial per column; arcs, which crowded poles of high order need;
# eigenvalues at many points, along anything but the wall.
BY_POLYNOMIAL, BY_ARCS, BY_EIGENVALUES = 0.4e-6, 30e-6, 40e-6
CROWDED = 24  # states


@dataclass(frozen=True, slots=True)
class Chunk:
    """The loops `loops` closed with the walls `walls` (index ranges); its columns are consecutive, from `first` on."""

    number: int
    loops: range
    walls: range
    first: int

    @property
    def columns(self) -> int:
        """How many columns it has."""
        return len(self.loops) * len(self.walls)


@dataclass(frozen=True, slots=True)
class Chunks:
    """All chunks of `loops x walls` columns, column = loop * walls + wall; each of `deep` loops and `wide` walls at most.

    One of the two is whole: several loops with all their walls, or a part of the walls of one loop. So a chunk is a run of
    consecutive columns. Where the borders are leaves no trace in the results.
    """

    loops: int
    walls: int
    deep: int
    wide: int

    def __len__(self) -> int:
        return -(-self.loops // self.deep) * self._across

    @property
    def _across(self):
        return -(-self.walls // self.wide)

    def __getitem__(self, number: int) -> Chunk:
        down, across = divmod(number, self._across)
        loops = range(down * self.deep, min((down + 1) * self.deep, self.loops))
        walls = range(across * self.wide, min((across + 1) * self.wide, self.walls))
        return Chunk(number, loops, walls, loops.start * self.walls + walls.start)

    def of(self, column) -> np.ndarray:
        """Number of the chunk that each column is in."""
        loop, wall = np.divmod(column, self.walls)
        return loop // self.deep * self._across + wall // self.wide


def cut_up(loops: int, walls: int, cost: float) -> Chunks:
    """Cut the columns into chunks of about `SECONDS`; cost: s per column, as expected (see `expected_cost`)."""
    columns = int(np.clip(SECONDS / cost, FEWEST, MOST))
    if walls > columns:
        return Chunks(loops, walls, 1, columns)
    return Chunks(loops, walls, columns // walls, walls)


def expected_cost(order: int, wall: bool) -> float:
    """Seconds that a column of a loop with `order` states takes, roughly; wall: along K_VE or B_VE.

    A fixed rule and no measurement, so that a run that goes on finds the chunks of the one that was stopped.
    """
    share = BY_EIGENVALUES if not wall else BY_POLYNOMIAL if order <= CROWDED else BY_ARCS
    return share * max(order, 2) ** 2


if TYPE_CHECKING:
    from wavesweep.sweep.guarantees import Guarantee


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Stable intervals along `axis` for every column of the grid, cut into chunks.

    resolved: what the whole numbers and derived keys among the axes make of the spec, per combination of theirs.
    guarantee: for whom the intervals shall hold; the loop as it is where there is none.
    """

    grid: Grid
    axis: Axis
    chunks: Chunks
    resolved: dict
    cut: Cut | None = None
    guarantee: "Guarantee | None" = None

    @property
    def columns(self) -> int:
        """How many columns are computed."""
        return self.grid.loops * self.grid.walls

    def work(self, chunk: Chunk) -> Work:
        """What a worker needs for that chunk: values and arrays."""
        changes = self.grid.loop_values(np.arange(chunk.loops.start, chunk.loops.stop))
        parts = groups(self.grid.spec, changes, len(chunk.loops), resolved=self.resolved)
        walls = {path: v[chunk.walls.start : chunk.walls.stop] for path, v in self.grid.wall_values().items()}
        span = (float(self.axis.start), float(self.axis.stop))
        given = self.axis.path, span, bounds_of(self.axis.path, span), tuple(parts), walls, self.cut
        if self.guarantee is None:
            return Work(*given)
        from wavesweep.sweep.guarantees import HandWork

        return HandWork(*given, self.guarantee)


def ask(spec: Spec, along: str | None = None) -> Question:
    """The question of a spec's [sweep]. Raises UsageError where it cannot be answered; nothing is computed before."""
    axis, others = sweep_axes(spec, along)
    return question(make_grid(spec, others, axis.path), axis)


def question(grid: Grid, axis: Axis, cut: Cut | None = None) -> Question:
    """The same for a grid; cut: its compiled loop, where it has only one."""
    if axis.structural:
        raise UsageError(
            f"intervals along {axis.name}: expected a number that the loop varies with smoothly, found one that decides "
            f"how it is built; sweep it as values ({axis.name} = [...]) and look along another axis, such as K_VE"
        )
    resolved = _resolve_all(grid)
    ends = [next(iter(resolved.values())), *list(resolved.values())[-1:]]
    order = cut.order if cut else max(cut_at_wall(draw(values)).order for values in ends)
    cost = expected_cost(order, axis.path in WALL)
    return Question(grid, axis, cut_up(grid.loops, grid.walls, cost), resolved, cut)


def _resolve_all(grid) -> dict:
    """What each combination of the axes that go through the spec makes of it; refuses one that makes no loop."""
    axes = [axis for axis in grid.loop_axes if not is_plain(grid.spec, axis.path)]
    resolved = {}
    for values in product(*(axis.values for axis in axes)):
        changes = {axis.path: value for axis, value in zip(axes, values, strict=True)}
        try:
            resolved[tuple(changes.items())] = dict((grid.spec.with_values(changes) if changes else grid.spec).values)
        except SpecError as error:
            named = ", ".join(f"{axis.name} = {value!r}" for axis, value in zip(axes, values, strict=True))
            raise UsageError(f"[sweep]: every combination is computed, and {named} makes no loop: {error}") from error
    return resolved


def bounds_of(path, span):
    """Beyond which values of the key there is no loop; a gain may be looked at a little below zero."""
    key, (low, high) = KEYS[path], span
    below = low / 2 if key.above_low or key.low != 0 else -np.inf
    return below, np.inf if key.high is None else (high + key.high) / 2


def cut_otherwise(asked: Question, **sizes) -> Question:
    """The same question in chunks of other sizes (deep, wide)."""
    return replace(asked, chunks=replace(asked.chunks, **sizes))


PROBES = 6  # samples of the sweep
SHARE = 10  # a sample is so many times smaller than a chunk: large enough that what a batch costs does not decide
LONGEST = 0.3  # s; no further sample after that


def expected_seconds(asked: Question) -> float:
    """Seconds of work in one process for the whole question, by solving a small part of it."""
    samples = _samples(asked)
    samples[0].records()  # the first call of everything costs more than it will later
    started, seconds, columns = time.perf_counter(), 0.0, 0
    for sample in samples:
        sample.records()
        seconds = time.perf_counter() - started
        columns += sum(members.size for members, _ in sample.groups) * len(next(iter(sample.walls.values())))
        if seconds > LONGEST:
            break
    return seconds / columns * asked.columns


def _samples(asked):
    """Pieces of the work, alternately from its ends and its middle."""
    chunks = asked.chunks
    enough = max(1, chunks.deep * chunks.wide // SHARE)
    wide = min(chunks.walls, enough)
    small = cut_otherwise(asked, deep=max(1, enough // wide), wide=wide)
    shares = np.linspace(0, 1, PROBES)[[0, 3, 5, 1, 4, 2]]
    numbers = dict.fromkeys(np.rint(shares * (len(small.chunks) - 1)).astype(int).tolist())
    return [small.work(small.chunks[number]) for number in numbers]
