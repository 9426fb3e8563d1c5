"""Loops of several rates drawn in Python: random ones."""

import numpy as np

from wavesweep.engine._loops import blocks
from wavesweep.engine._loops.multirate import MultirateLoop, ScheduledBlock

T = 1e-3


def random_block(r, name, period):
    kind = r.integers(4)
    if kind == 0:
        return blocks.defined("delay", name, period, steps=int(r.integers(0, 3)))
    if kind == 1:
        return blocks.defined("hold", name, period)
    if kind == 2:
        return blocks.butterworth(name, period, int(r.integers(1, 4)), r.uniform(0.01, 0.3) / period)
    return blocks.defined("difference", name, period)


def random_drawing(seed):
    """A mass under the feedback of a chain of filters, delays and integrators of one to four rates and any phases."""
    r = np.random.default_rng(seed)
    rates = r.choice([1, 2, 3, 4, 5, 6, 10], size=r.integers(1, 5), replace=False).tolist()
    placed, sums, last = [ScheduledBlock(blocks.mass("m", T, r.uniform(0.1, 1), r.uniform(0, 2)))], {}, "m.x"
    for index in range(int(r.integers(1, 5))):
        every = int(r.choice(rates))
        block = random_block(r, f"b{index}", every * T)
        placed.append(ScheduledBlock(block, every, int(r.integers(every))))
        sums[f"b{index}.u"] = {last: 1.0, "m.x": r.uniform(-0.5, 0.5)}
        last = f"b{index}.y"
    gain = r.uniform(1, 30)
    sums["m.f"] = {last: -gain / max(1.0, float(np.abs(block.D).max())), "m.v": -r.uniform(0, 3), "m.x": -r.uniform(0, 30)}
    return MultirateLoop(T, tuple(placed), sums)
