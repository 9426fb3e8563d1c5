"""Delays in series with a number: whole frames of them are z^-d on the circle, and no states.

The ticks of a loop repeat after a frame, so what comes a frame later has the same effects, a frame
later. Let every way from the product of a number to what the number multiplies pass a delay once.
Then to take d whole frames from the delay multiplies that loop's response, from the product to what
is multiplied, by z^d, z being that of a frame, and does nothing else to the loop without the number.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from math import lcm

import numpy as np

from wavesweep.engine._drawing.drawing import Drawing, scalars
from wavesweep.engine._drawing.expressions import Tree

# frames, up to which the states of a delay take less time than a factor on the circle
FEW_FRAMES = 16


def without_whole_frames(
    drawing: Drawing, values: Mapping[str, object], number: str
) -> tuple[Drawing, int]:
    """Return the drawing with the delays in series with a number shortened to a frame or less, and
    the frames that this takes away; the drawing as it is and 0 if these are few.

    values: flat numbers, or arrays over a batch. number: a scalar gain of the drawing, see
    `scalar_place`.
    """
    known = scalars(values)
    ways = _Ways.without(drawing, known, number)
    every = {block.name: int(block.every.values(known)) for block in drawing.blocks}
    frame = lcm(*every.values())
    frames = 0
    blocks = []
    for block in drawing.blocks:
        keys = dict(block.keys)
        if block.type == "delay" and "steps" in keys and ways.all_pass(block.name):
            steps = int(keys["steps"].values(known))
            in_a_frame = frame // every[block.name] * max(1, len(block.phases))
            whole = max(0, steps - 1) // in_a_frame  # a delay has at least one step
            frames += whole
            short = Tree.number(float(steps - whole * in_a_frame))
            block = replace(block, keys=(("steps", short),))  # noqa: PLW2901 - the same block
        blocks.append(block)
    if frames <= FEW_FRAMES:
        return drawing, 0
    return replace(drawing, blocks=tuple(blocks)), frames


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
    def without(drawing: Drawing, known: Mapping[str, object], number: str) -> "_Ways":
        """The ways of a loop without this number; known: numbers by name."""
        ways = _Ways()
        table, _, place = drawing.scalar_place(number).partition(".")
        for port, terms in (*drawing.wires, *drawing.couplings):
            reader = _block_of(port)
            for signal, gain in terms:
                source = _block_of(signal)
                if gain.reads(number):
                    ways.begin.add(reader)
                    ways.end.add(source)
                if np.any(gain.with_number(number, 0.0).values(known)):
                    ways.readers[source].add(reader)
        if table == "block":  # a gain, or a word of firmware
            factor = _block_of(place)
            ways.begin |= ways.readers[factor]
            ways.end.add(factor)
            gains = dict(next(block.keys for block in drawing.blocks if block.name == factor))
            if "k" in gains and not np.any(gains["k"].with_number(number, 0.0).values(known)):
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

    def _reached(self, begin, without):
        """The blocks that ways from some blocks reach, these included, but for ways by others."""
        reached = set()
        open_ = set(begin) - without
        while open_:
            block = open_.pop()
            reached.add(block)
            open_ |= self.readers[block] - reached - without
        return reached


def _block_of(name):
    return name.rpartition(".")[0]
