"""The longest tick of a drawn loop: ticks in which nothing runs and nothing that changes is read
are divided out.

A controller of 20 ms on a tick of 1 ms is the loop that is drawn at 50 Hz: plants are exact between
ticks, and what is held does not change there. So the frames are the same, of a twentieth of the
ticks, and dead times have a twentieth of the states. This is for analyses of the loop by itself;
forces from outside, responses and simulations have the spec's own tick.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from math import gcd
from typing import TYPE_CHECKING

from wavesweep.engine._drawing.drawing import Drawing, scalars
from wavesweep.engine._loops.dead_time import in_longer_ticks

if TYPE_CHECKING:
    from wavesweep.engine._drawing.drawn_block import DrawnBlock

# blocks that only pass on what they read in a tick, or so many ticks ago
RELAYS = ("gain", "hold", "delay")


def with_common_tick(
    drawing: Drawing, values: Mapping[str, object]
) -> tuple[Drawing, Mapping[str, object]]:
    """Return the drawing with the longest tick that these loops have in common, and the numbers
    with the whole ticks of dead times counted in it; values: flat numbers."""
    ticks, relays = _ticks(drawing, scalars(values))
    if ticks <= 1 or _acts_between(drawing, relays):
        return drawing, values
    blocks = (_in_longer(block, ticks, relays) for block in drawing.blocks)
    longer = replace(drawing, tick_hz=drawing.tick_hz / ticks, blocks=tuple(blocks))
    return longer, {**values, **in_longer_ticks(drawing, values, ticks)}


def _ticks(drawing: Drawing, constants: dict[str, float]) -> tuple[int, tuple[str, ...]]:
    """How many ticks of a loop one could be, 0 if any number of them, and its relays; constants: its
    numbers by name."""
    ticks = 0
    relays = []
    for block in drawing.blocks:
        every = int(block.every.value(constants))
        phase = int(block.phase.value(constants))
        if block.plant or block.dead_time:
            continue
        if every > 1:
            ticks = gcd(ticks, every, phase, *block.phases)
        elif block.type in RELAYS:
            relays.append(block.name)
            if block.type == "delay":
                ticks = gcd(ticks, int(dict(block.keys)["steps"].value(constants)))
        else:
            ticks = 1
    return ticks, tuple(relays)


def _acts_between(drawing: Drawing, relays: tuple[str, ...]) -> bool:
    """Whether something that changes between the ticks at which blocks run acts on plants or dead
    times there.

    Plants, dead times and relays of these change there. What a dead time makes of signals that are
    held arrives at plants just when it does, and a dead time reads plants when it does, whatever
    the tick is: these two do not count.
    """
    plants = {block.name for block in drawing.blocks if block.plant}
    late = set(drawing.dead_times)
    reads: dict[str, set[str]] = defaultdict(set)  # the blocks that each block reads
    for port, terms in drawing.wires:
        reads[_block_of(port)].update(_block_of(signal) for signal, _ in terms)
    changing = plants | late
    count = 0
    while len(changing) > count:
        count = len(changing)
        changing |= {name for name in relays if reads[name] & changing}
    late_of_held = {name for name in late if not reads[name] & changing}
    acts_on_plants = any(reads[name] & (changing - late_of_held) for name in plants)
    acts_on_late = any(reads[name] & (changing - plants) for name in late)
    return acts_on_plants or acts_on_late


def _block_of(name: str) -> str:
    return name.rpartition(".")[0]


def _in_longer(block: DrawnBlock, ticks: int, relays: tuple[str, ...]) -> DrawnBlock:
    """The block with its times counted in longer ticks; plants, dead times and relays are of
    every tick."""
    if block.name in relays and block.type == "delay":
        return replace(block, keys=(("steps", dict(block.keys)["steps"] / ticks),))
    if block.name in relays or block.plant or block.dead_time:
        return block
    every = block.every / ticks
    phase = block.phase / ticks
    phases = tuple(tick // ticks for tick in block.phases)
    return replace(block, every=every, phase=phase, phases=phases)
