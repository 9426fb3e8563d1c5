"""Delays in series with a number: whole frames of them are z^-d on the circle, and no states.

Of a delay whose readers all run at every n-th tick, or whose input changes at every n-th tick, one
value in n counts. d = q n + r ticks of it are then r ticks of another phase, and q runs at every n-th
tick: fewer states, and a number beside it acts once in n ticks.

The ticks of a loop repeat after a frame, so what comes a frame later has the same effects, a frame
later. Let every way from the product of a number to what the number multiplies pass a delay once.
Then to take d whole frames from the delay multiplies that loop's response, from the product to what
is multiplied, by z^d, z being that of a frame, and does nothing else to the loop without the number.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from math import lcm
from typing import NamedTuple

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing, scalars
from wavesweep.engine._drawing.drawn_block import DrawnBlock
from wavesweep.engine._drawing.expressions import ONE, Tree

# frames, up to which the states of a delay take less time than a factor on the circle
FEW_FRAMES = 20


def without_whole_frames(
    drawing: Drawing, values: Mapping[str, object], *numbers: str
) -> tuple[Drawing, Mapping[str, object], int]:
    """Return the drawing and its values with the delays and dead times in series with a number, or
    with two of the same wire, shortened to a frame or less, and the frames that this takes away;
    both as they are and 0 if these are few.

    values: flat numbers, or arrays over a batch, with the ticks of dead times, see `structure`.
    numbers: scalar gains of the drawing, see `scalar_place` and `shares_wire`.
    """
    constants = scalars(values)
    if sum(_steps(drawing, constants).values()) <= FEW_FRAMES and not drawing.dead_times:
        return drawing, values, 0
    drawing = _in_slower_ticks(drawing, constants)
    ways = _Ways.without(drawing, constants, numbers)
    every = {block.name: int(block.every.values(constants)) for block in drawing.blocks}
    runs = {block.name: max(1, len(block.phases)) for block in drawing.blocks}
    frame = lcm(*every.values())
    frames = 0
    keys = {}
    ticks = {}
    for name, steps in _steps(drawing, constants).items():
        if ways.all_pass(name):
            in_a_frame = frame // every[name] * runs[name]
            whole = _whole_frames(steps, in_a_frame)
            keys[name] = ("steps", Tree.number(float(steps - whole * in_a_frame)))
            frames += whole
    for name, seconds in drawing.dead_times.items():
        path = f"block.{name}.ticks"
        if path in constants and ways.all_pass(name):
            whole = _whole_frames(constants[path], frame)
            ticks[path] = constants[path] - whole * frame
            keys[name] = ("seconds", seconds - Tree.number(float(whole * frame)) / drawing.tick_hz)
            frames += whole
    if frames <= FEW_FRAMES:
        return drawing, values, 0
    return _with_keys(drawing, keys), {**values, **ticks}, frames


class _Clock(NamedTuple):
    """When a block runs: in the ticks `phase + every*j`."""

    every: int
    phase: int

    @staticmethod
    def of(block: DrawnBlock, constants: Mapping[str, object]) -> "_Clock | None":
        """The clock of a block, None if it runs at uneven ticks; constants: numbers by name."""
        every = int(block.every.values(constants))
        phases = block.phases or (int(block.phase.values(constants)),)
        return _Clock(every, phases[0] % every) if len(phases) == 1 else None


def _in_slower_ticks(drawing: Drawing, constants: dict[str, float]) -> Drawing:
    """The drawing with delays at the ticks that count of them, see the heading."""
    blocks = {block.name: block for block in drawing.blocks}
    sources = defaultdict(set)
    readers = defaultdict(set)
    for port, terms in (*drawing.wires, *drawing.couplings):
        for signal, _ in terms:
            if _block_of(signal) in blocks:  # and no signal from outside
                sources[_block_of(port)].add(_block_of(signal))
                readers[_block_of(signal)].add(_block_of(port))
    steps = _steps(drawing, constants)
    pending = list(steps)
    while pending:
        name = pending.pop()
        clock_of_delay = _Clock.of(blocks[name], constants)
        for neighbours, sign in ((readers[name], -1), (sources[name], 1)):
            clocks = {_Clock.of(blocks[neighbour], constants) for neighbour in neighbours}
            clock = clocks.pop() if len(clocks) == 1 else None
            if (
                not clock_of_delay
                or not clock
                or clock.every == clock_of_delay.every
                or clock.every % clock_of_delay.every
            ):
                continue
            # wait: from the sources' tick to the delay's next run, or from a run to the readers' tick.
            # It then runs `rest` ticks behind the sources, or before the readers, at every tick of
            # their clock, and shows what it read `runs` such ticks before: as late as it was.
            wait = sign * (clock_of_delay.phase - clock.phase) % clock_of_delay.every
            runs, rest = divmod(wait + steps[name] * clock_of_delay.every, clock.every)
            if not runs:
                continue
            steps[name] = runs
            clock_of_delay = _Clock(clock.every, (clock.phase + sign * rest) % clock.every)
            every, phase = (Tree.number(float(number)) for number in clock_of_delay)
            keys = (("steps", Tree.number(float(runs))),)
            blocks[name] = replace(blocks[name], keys=keys, every=every, phase=phase, phases=())
            pending += (readers[name] | sources[name]) & steps.keys()
    return replace(drawing, blocks=tuple(blocks.values()))


def _whole_frames(steps: int, in_a_frame: int) -> int:
    """How many whole frames may be taken from a delay, which keeps at least one step."""
    return max(0, steps - 1) // in_a_frame


def with_delays_of_one_step(drawing: Drawing, values: Mapping[str, object]) -> Drawing:
    """Return the drawing with delays of one step in place of longer ones; values: flat numbers."""
    steps = _steps(drawing, scalars(values))
    longer = [name for name in steps if steps[name] > 1]
    return _with_keys(drawing, dict.fromkeys(longer, ("steps", ONE)))


def _steps(drawing: Drawing, constants: dict[str, float]) -> dict[str, int]:
    """The steps of delays that are given in steps, by name; constants: numbers by name."""
    steps = {}
    for block in drawing.blocks:
        keys = dict(block.keys)
        if block.type == "delay" and "steps" in keys:
            steps[block.name] = int(keys["steps"].values(constants))
    return steps


def _with_keys(drawing: Drawing, keys: dict[str, tuple[str, Tree]]) -> Drawing:
    """The drawing with another key in place of the only one of some delays, by name."""
    if not keys:
        return drawing
    blocks = []
    for block in drawing.blocks:
        if block.name in keys:
            block = replace(block, keys=(keys[block.name],))  # noqa: PLW2901 - the same block
        blocks.append(block)
    return replace(drawing, blocks=tuple(blocks))


class _Ways:
    """Which blocks read which in a loop without a number.

    readers: of each block, those that read it. begin: the blocks that the number's product enters.
    end: those that make what the number multiplies.
    """

    def __init__(self) -> None:
        self.readers: dict[str, set[str]] = defaultdict(set)
        self.begin: set[str] = set()
        self.end: set[str] = set()

    @staticmethod
    def without(
        drawing: Drawing, constants: Mapping[str, object], numbers: Sequence[str]
    ) -> "_Ways":
        """The ways of a loop without these numbers; constants: numbers by name."""
        ways = _Ways()
        zero = dict.fromkeys(numbers, Tree.number(0.0))
        table, _, place = drawing.scalar_place(numbers[0]).partition(".")
        for port, terms in (*drawing.wires, *drawing.couplings):
            reader = _block_of(port)
            for signal, gain in terms:
                source = _block_of(signal)
                if any(gain.reads(number) for number in numbers):
                    ways.begin.add(reader)
                    ways.end.add(source)
                with suppress(ZeroDivisionError):  # a gain that is none, of loops that are none
                    if not np.any(gain.with_trees(zero).values(constants)):
                        continue
                ways.readers[source].add(reader)
        if table == "block":  # a gain, or a word of firmware
            factor = _block_of(place)
            ways.begin |= ways.readers[factor]
            ways.end.add(factor)
            gains = dict(next(block.keys for block in drawing.blocks if block.name == factor))
            if "k" in gains and not np.any(gains["k"].with_trees(zero).values(constants)):
                ways.readers[factor] = set()
        return ways

    def all_pass(self, delay: str) -> bool:
        """Whether all ways from the number's product to what it multiplies pass a delay, and pass it
        once."""
        before = self._reached(self.begin, {delay})
        behind = self._reached(self.readers[delay], set())
        leads_there = delay in self._reached(self.begin, set())
        leads_on = delay in self.end or bool(behind & self.end)
        return leads_there and leads_on and not before & self.end and delay not in behind

    def _reached(self, begin: set[str], without: set[str]) -> set[str]:
        """The blocks that ways from some blocks reach, these included, but for ways by others."""
        reached = set()
        open_ = set(begin) - without
        while open_:
            block = open_.pop()
            reached.add(block)
            open_ |= self.readers[block] - reached - without
        return reached


def _block_of(name: str) -> str:
    return name.rpartition(".")[0]
