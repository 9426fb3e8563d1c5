"""The ticks that frames of varying length consist of: along one number, or over a box of
numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from wavesweep.engine.blocks import FACTOR, PRODUCT, MultirateLoop
from wavesweep.engine.drawing import Drawing, name_of, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import Tree
from wavesweep.engine.frames import MarginalModes, OpenTicks, Ticks
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import EnclosedLoop, Side
from wavesweep.engine.switched import (
    TOTAL_DEGREE,
    FramesOver,
    LoopFrames,
    Symbol,
    TickPlace,
    WrittenFrames,
    inside_of,
    lasting,
)
from wavesweep.for_all.frames_of_members import Members, frames_of_ticks

TWO_VALUES = np.array([0.5, 2.0])  # of a number: what differs with them depends on it
FRAME = "frame"  # as a delay: the result is in place with the next sample, whenever that is
ANY_NUMBER = -1  # of results, or of messages of a channel, in a row that are lost
LOST = "lost"  # as a delay: the result never arrives, and the last one is held
# Kinds of ticks beside those of the phases, of which 0 is the sample: one whose result is in place
# at once; one in which a result comes into place; an ordinary one; and the moment before the next
# sample in which a result comes into place.
THROUGH, SHOW, TICK, LATE = "through", "show", "tick", "late"


@dataclass(frozen=True, slots=True)
class Schedule:
    """Which slow blocks run in each kind of tick.

    kinds: the blocks of each kind; None for a moment at which only the blocks `shown` run. nominal:
    the nominal length of a frame; elapsed: see `FramesInAnyOrder`. at_phases: the blocks that run
    at each phase, in ticks after the sample; their kind is the phase, or, if messages of channels
    among them are lost, the phase and these channels.
    """

    kinds: Mapping[object, frozenset[str] | None]
    nominal: int
    elapsed: bool
    shown: frozenset[str]
    at_phases: Mapping[int, frozenset[str]]

    def sample(self, symbol: Symbol) -> object:
        """Return the kind of the sample that ends a frame."""
        if symbol.through:
            return THROUGH
        return self._at_phase(0, symbol)

    def before_sample(self, symbol: Symbol) -> list[object]:
        """Return the kinds of a frame's ticks, from the one after its first sample to the one
        before its last."""
        kinds: list[object] = []
        for phase in range(1, symbol.ticks):
            kinds.append(self._at_phase(phase, symbol) if phase in self.at_phases else TICK)
        if symbol.delay in (symbol.ticks, FRAME):
            kinds.append(LATE)
        elif symbol.delay not in (None, 0, LOST):
            kinds[symbol.delay - 1] = SHOW
        return kinds

    def _at_phase(self, phase: int, symbol: Symbol) -> object:
        """The kind of a tick in which the blocks of a phase run, but for channels whose message
        is lost."""
        lost = symbol.gone & self.at_phases[phase]
        return (phase, lost) if lost else phase

    @property
    def slow(self) -> set[str]:
        """The slow blocks."""
        return set().union(*(blocks or () for blocks in self.kinds.values()))

    def with_period(self, drawing: Drawing, step: int) -> Drawing:
        """Return the drawing with another period of its slow blocks, in ticks; `scheduled` sets
        their phases."""
        every = Tree.number(step)
        phase = Tree.number(0.0)
        names = self.slow
        blocks = []
        for block in drawing.blocks:
            if block.name not in names:
                blocks.append(block)
                continue
            slow = replace(block, every=every, phase=phase, phases=())
            blocks.append(slow.stepwise(drawing.tick_hz) if self.elapsed else slow)
        return replace(drawing, blocks=tuple(blocks))

    def scheduled(self, loop: MultirateLoop) -> MultirateLoop:
        """Return the loop with a frame that has one tick of each kind: connecting it gives the
        map of each kind."""
        placed = []
        running = self.running([block.block.name for block in loop.placed])
        for block, runs in zip(loop.placed, running.T, strict=True):
            phase = tuple(np.flatnonzero(runs).tolist())
            placed.append(replace(block, every=len(self.kinds), phase=phase))
        return replace(loop, placed=tuple(placed))

    def running(self, names: Sequence[str]) -> np.ndarray:
        """Return which blocks run in each kind of tick, `(kinds, blocks)`."""
        slow_names = self.slow
        slow = [name in slow_names for name in names]
        rows = []
        for blocks in self.kinds.values():
            # At a moment of None only those that are shown run.
            running = self.shown if blocks is None else blocks
            of_slow = [name in running for name in names]
            rows.append(np.where(slow, of_slow, blocks is not None))
        return np.array(rows)


@dataclass(frozen=True, slots=True)
class Plan:
    """What the frames of a loop consist of; symbols: the kinds of frames."""

    drawing: Drawing
    values: Mapping[str, object]
    schedule: Schedule
    symbols: Sequence[Symbol]

    def along(self, number: str) -> LoopFrames:
        """Return the frames as a family along a number that one wire or gain reads; empty for the
        loop at its own values.

        Errors: UsageError for a number that the loop reads otherwise.
        """
        ticks, drift, index = self.open_at(number)
        relative, _ = drift.relative_ticks(ticks)
        varying = drift if drift.varying else None
        return LoopFrames.of(relative, drift.remaining, self.written(index), varying)

    def along_each(
        self, number: str, columns: Mapping[str, np.ndarray], size: int
    ) -> list[LoopFrames]:
        """Return `along` of each of several loops, for searches: what drifts is that of two of them.

        columns: the numbers in which these differ, `(size,)` each. Numbers of which some are zero, or
        from which dead times follow, are the same in all.
        """
        read = {path: column for path, column in columns.items() if path in self.values}
        batch = replace(self, values=self.values | read)
        ticks, drift, index = batch.open_at(number)
        if drift.varying:  # which may be what differs from loop to loop alone
            alone = (Loops(self.drawing, batch.values).one(at) for at in range(size))
            return [replace(self, values=loop.values).along(number) for loop in alone]
        relative, _ = drift.relative_ticks(ticks)
        written = batch.written(index)
        return [LoopFrames.of(relative.of_loop(at), drift.remaining, written) for at in range(size)]

    def open_at(self, number):
        """The different ticks, open at a number, what drifts in them, and the index of each kind at
        each step; see `different_ticks`."""
        at_steps = [self.schedule.with_period(self.drawing, step) for step in self.steps]
        if number and not all(
            loop_at_step.scalar_place(name_of(number)) for loop_at_step in at_steps
        ):
            raise UsageError(
                f"intervals along {number}: while frames vary ([for_all]), expected a number that one wire or gain reads "
                "linearly, found another; look along another one (a gain in the wire behind a block is one), or leave `varying` "
                "out"
            )
        varied = self._at_two_values(number)

        def ticks_at(step):
            at_step = self.schedule.with_period(self.drawing, step)
            whole = self.schedule.scheduled(Loops(at_step, varied).drawn())
            if not number:
                return Ticks.of(whole, alone=True, terms=True)
            without = self.values | {path_of(name_of(number)): 0.0}
            cut_open = Loops(at_step, without).drawn(name_of(number))
            return OpenTicks.of(self.schedule.scheduled(cut_open), whole, PRODUCT, FACTOR).ticks

        maps, _, index = self.different_ticks(ticks_at)
        return Ticks(tuple(maps), np.arange(len(maps))), self._drift(varied), index

    def _at_two_values(self, number):
        """The values of every loop twice, with TWO_VALUES of a number, one after the other."""
        if not number:
            return self.values
        loops = Loops(self.drawing, self.values).batch or (1,)
        twice = {}
        for path, value in self.values.items():
            twice[path] = np.repeat(value, TWO_VALUES.size) if np.ndim(value) else value
        return twice | {path_of(name_of(number)): np.tile(TWO_VALUES, loops)}

    def over(self, sides: Sequence[Side], box: np.ndarray) -> FramesOver:
        """Return the frames over the cells of a box of sides."""
        inside = inside_of(box)

        def with_numbers(points):
            columns = (side.number(points[:, at]) for at, side in enumerate(sides))
            return self.values | {
                side.path: column for side, column in zip(sides, columns, strict=True)
            }

        def drawn_at(step):
            return self.schedule.with_period(self.drawing, step)

        def ticks_at(step, points=inside, places=None):
            loop = Loops(drawn_at(step), with_numbers(points)).drawn()
            return Ticks.of(self.schedule.scheduled(loop), alone=True, terms=True, places=places)

        _, picked, index = self.different_ticks(ticks_at)
        drift = self._drift(with_numbers(inside))

        def counted_at(points):
            maps = []
            for step, some in groupby(picked, lambda pick: pick[0]):
                ticks = ticks_at(step, points, [place for _, place in some])
                maps += [ticks.maps[kind] for kind in ticks.kind]
            return drift.relative_ticks(Ticks(tuple(maps), np.arange(len(maps))))

        ticks = []
        for step, some in groupby(picked, lambda pick: pick[0]):
            enclosed = EnclosedLoop(drawn_at(step), self.values, sides, TOTAL_DEGREE)
            loop = self.schedule.scheduled(Loops(drawn_at(step), with_numbers(inside)).drawn())
            held_ports = loop.held()
            ticks += [(enclosed, TickPlace(loop, place, held_ports)) for _, place in some]
        rows, samples, symbols, _ = self.written(index)
        _, groups = counted_at(inside)
        lead = lasting(drift, lambda points: counted_at(points)[0], box)
        return FramesOver(ticks, lead, rows, samples, symbols, groups[len(drift.constant) :])

    def members(self, paths: Sequence[str], box: np.ndarray) -> Members:
        """Return the frames of members of a box of numbers at these paths, in plain doubles."""
        inside = inside_of(box)

        def with_numbers(points):
            return self.values | {path: points[:, at].copy() for at, path in enumerate(paths)}

        def ticks_at(step, points=inside, places=None):
            loop = Loops(
                self.schedule.with_period(self.drawing, step), with_numbers(points)
            ).drawn()
            return Ticks.of(self.schedule.scheduled(loop), alone=True, terms=True, places=places)

        _, picked, index = self.different_ticks(ticks_at)
        drift = self._drift(with_numbers(inside))
        rows, samples, symbols, follows = self.written(index)

        def counted_at(points):
            maps = []
            for step, some in groupby(picked, lambda pick: pick[0]):
                ticks = ticks_at(step, points, [place for _, place in some])
                maps += [ticks.maps[kind] for kind in ticks.kind]
            ticks, _ = drift.relative_ticks(Ticks(tuple(maps), np.arange(len(maps))))
            return ticks

        lead = lasting(drift, counted_at, box)

        def frames_at(points):
            return frames_of_ticks(counted_at(points), lead, rows, samples)

        return Members(frames_at, len(drift.remaining), symbols, follows)

    def different_ticks(self, ticks_at):
        """Return the different maps of ticks, the step and the place that each is from, and the index
        of each kind at each step."""
        maps = []
        picked = []
        index = {}
        for step in self.steps:
            ticks = ticks_at(step)
            for place, kind in enumerate(self.schedule.kinds):
                map_of_place = ticks.maps[ticks.kind[place]]
                alike = next(
                    (i for i in range(len(maps)) if _alike(maps[i], map_of_place)), len(maps)
                )
                if alike == len(maps):
                    maps.append(map_of_place)
                    picked.append((step, place))
                index[kind, step] = alike
        return maps, picked, index

    @property
    def steps(self) -> list[int]:
        """The periods of the slow blocks, in ticks."""
        if self.schedule.elapsed:
            return sorted({symbol.ticks for symbol in self.symbols})
        return [self.schedule.nominal]

    def _drift(self, values) -> MarginalModes:
        both_loops = Loops(
            self.schedule.with_period(self.drawing, self.schedule.nominal), values
        ).twins()
        return MarginalModes.of(*map(self.schedule.scheduled, both_loops))

    def written(self, index) -> WrittenFrames:
        """The frames as ticks; index: of the map of a kind at a step."""
        schedule = self.schedule
        steps = self.steps
        symbols = list(self.symbols)
        samples = {schedule.sample(symbol) for symbol in symbols}
        remaining = [kind for kind in schedule.kinds if kind not in samples]
        if all(index[kind, step] == index[kind, steps[0]] for kind in remaining for step in steps):
            symbols = list(dict.fromkeys(replace(symbol, step=None) for symbol in symbols))
        symbols, follows = _endless(symbols)
        rows = []
        ends = []
        for symbol in symbols:
            step = symbol.step or steps[0]
            rows.append(tuple(index[kind, step] for kind in schedule.before_sample(symbol)))
            at_end = symbol.ticks if schedule.elapsed else steps[0]
            ends.append(index[schedule.sample(symbol), at_end])
        return WrittenFrames(tuple(rows), tuple(ends), tuple(symbols), follows)


def _endless(symbols):
    """The symbols after which frames go on for ever, and which of them (columns) may follow which
    (rows).

    After the last result that may be lost, none is in place at once; where all others are, nothing
    can come then.
    """
    while True:
        follows = np.array(
            [[_may_follow(before, after) for after in symbols] for before in symbols]
        )
        goes_on = follows.any(1)
        if goes_on.all():
            return symbols, follows
        symbols = [symbol for symbol, on in zip(symbols, goes_on, strict=True) if on]


def _may_follow(before, after):
    # A result that is in place at once is so at the end of the frame before.
    at_once = after.delay == 0
    in_a_row = after.lost == 0 or after.lost == before.lost + 1
    return in_a_row and before.through == at_once and after.step in (None, before.ticks)


def _alike(first, second):
    return first.inputs == second.inputs and all(
        np.array_equal(getattr(first, part), getattr(second, part)) for part in "EBCD"
    )
