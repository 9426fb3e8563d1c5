"""The delay margin in seconds: the least dead time behind a signal with which a loop is not stable.

A signal that is held and acts on plants arrives there between two ticks, and one of a plant is read
between two ticks, so that a dead time of any length is exact. With another reader it would be
rounded up to a whole tick or to a run of that; then only whole frames are looked at, see
`loop_margins`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from wavesweep.engine.drawing import Drawing, DrawnBlock, path_of
from wavesweep.engine.expressions import ONE, Tree
from wavesweep.engine.intervals import Search
from wavesweep.engine.loop import Loops
from wavesweep.margins.broken_loops import with_block
from wavesweep.margins.lifted_margins import END_ERROR
from wavesweep.margins.loop_margins import Margin
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop

BLOCK, SECONDS = "late by the cut", "dead time of the cut"  # no block or number is called so
MOST_DEAD_TICKS = 1000  # ticks that are looked at
# of the search, in squares of states, see `dead_time_pieces.about`: some 70 ticks of small loops,
# in three seconds
MOST_WORK = 2e5
TICKS_BETWEEN_TRIALS = 4  # ticks from one dead time that is tried beforehand to the next


def in_seconds(spec: Spec, signal: str, margins: Sequence[Margin], times: int) -> list[Margin]:
    """Return the margins of the spec's own loop with a delay in seconds, `delay`, if it is known: in place of one in whole frames,
    or behind the others of a signal that is made once and has none, as that of an integrator alone. times: how often it is made
    in a frame."""
    others = [margin for margin in margins if margin.name != "delay_frames"]
    asked = margins and (len(others) < len(margins) or times == 1)
    delay = delay_margin(spec, signal) if asked else None
    if delay is None:
        return [*margins]
    behind = 1 + [margin.name for margin in others].index("phase")
    return [*others[:behind], delay, *others[behind:]]


def delay_margin(spec: Spec, signal: str) -> Margin | None:
    """Return the least dead time (s) behind a signal with which the loop is not stable.

    None if the signal has readers for which it would not be exact, or if its end is not found.
    Accuracy: EXACT, as the ends of certified intervals along a number.
    """
    loops = late(spec, signal)
    if loops is None or not _fails_within_reach(loops):
        return None
    span = (0.0, MOST_DEAD_TICKS / float(loops.rate))
    groups = ((np.zeros(1, int), loops.unbuilt),)
    search = Search(path_of(SECONDS), span, groups, lines=False, checked=True)
    records, (_, looked_at) = search.about(0.0, MOST_WORK)
    for row in records:
        ends_within = 0 < row["high"] < looked_at
        if row["intervals"] and row["low"] == 0 and ends_within and row["certified"]:
            return Margin("delay", float(row["high"]), float(row["high_omega"]), END_ERROR)
    return None


def _fails_within_reach(loops: Loops) -> bool:
    """Whether the loop is not known to be stable with one of the dead times of 4, 8, 12, .. ticks
    that the search may get to: if it is with all, the search would end there without an answer."""
    work = MOST_WORK
    for ticks in range(TICKS_BETWEEN_TRIALS, MOST_DEAD_TICKS, TICKS_BETWEEN_TRIALS):
        later = loops.unbuilt.changed({path_of(SECONDS): ticks / float(loops.rate)})
        ((_, built),) = later.built_alike(np.zeros(1, int))
        if not built.radii()[0] < 1:
            return True
        work -= TICKS_BETWEEN_TRIALS * len(built.drift().states) ** 2
        if work < 0:
            break
    return False


def late(spec: Spec, signal: str) -> Loops | None:
    """The spec's own loop with a dead time behind a signal, the number SECONDS; see
    `delay_margin`."""
    spec, signal = with_block(spec, signal)
    loop = own_loop(spec)
    drawing = _with_dead_time(loop.drawing, signal)
    return drawing and Loops(drawing, {**loop.values, path_of(SECONDS): 0.0})


def _with_dead_time(drawing: Drawing, signal: str) -> Drawing | None:
    """The drawing in which all wires read a signal as late as the dead time is; None if they may
    not."""
    plants = {block.name for block in drawing.blocks if block.plant}
    readers = {port.rpartition(".")[0] for port, terms in drawing.wires if signal in dict(terms)}
    source = signal.rpartition(".")[0]
    exact = readers.isdisjoint(plants) if source in plants else readers <= plants
    if not exact or not readers.isdisjoint(drawing.dead_times):
        return None
    behind = {signal: f"{BLOCK}.y"}
    wires = []
    for port, terms in drawing.wires:
        wires.append((port, tuple((behind.get(name, name), factor) for name, factor in terms)))
    wires.append((f"{BLOCK}.u", ((signal, ONE),)))
    keys = (("seconds", Tree.name(SECONDS)),)
    block = DrawnBlock(BLOCK, "delay", keys, ONE, Tree.number(0.0))
    return replace(drawing, blocks=(*drawing.blocks, block), wires=tuple(wires))
