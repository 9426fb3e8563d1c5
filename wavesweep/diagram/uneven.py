"""The package's controllers at rates of which one is no multiple of the other, as blocks placed on the fast tick.

With `fast/slow = q/p` in lowest terms all is in step again after q fast ticks, in which the slow environment runs p times. Its
step k is at time `k q/p` ticks. It reads what was sampled in the last fast tick, `floor(k q/p)`, and its result is there in the
next one, `ceil(k q/p)`, or `delay` ticks after that. So everything runs in a fast tick, the slow blocks in irregular ones.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from wavesweep.controllers import drawing_of
from wavesweep.diagram import WALL
from wavesweep.diagram.block import Block, numbers
from wavesweep.diagram.drawn import Drawn, Placed
from wavesweep.spec.keys import MOST_SLOW_STEPS

RATIO = "rates.ratio"


def steps_of(ratio: float) -> tuple[int, int]:
    """Fast ticks in a frame, and slow steps in it."""
    found = Fraction(ratio).limit_denominator(MOST_SLOW_STEPS)
    return found.numerator, found.denominator


@dataclass(frozen=True, slots=True)
class Uneven:
    """A controller of the package in the place of a loop that a spec draws (`Drawing`)."""

    kind: str

    @property
    def hand(self) -> tuple[str, str, str]:
        """The signals of the hand's force, the device's position and the force against the hand."""
        return "f_h", "device.x", "f_m"

    def rate(self, values: Mapping[str, object]) -> float:
        """The rate of the tick in Hz."""
        return values["rates.fast_hz"]

    def placed(self, values: Mapping[str, object], out: str = "", signals: tuple[str, str] = ("", "")) -> Drawn:
        """The drawn loop of `values`: flat keys, with numbers or arrays over a batch.

        out: a number of the wall to take out of its place. Its product is then the input `signals[0]`, and its factor is the
        signal `signals[1]`.
        """
        diagram = drawing_of(self.kind)(values)
        q, p = (1, 1) if diagram.ratio == 1 else steps_of(values[RATIO])
        reads, shown = [k * q // p for k in range(p)], [-(-k * q // p) for k in range(p)]
        placed = [Placed(block) for block in diagram.fast]
        placed += [Placed(block, q, tuple(reads)) for block in diagram.slow]
        wall = {signal: numbers(values[path]) for path, signal in zip(WALL, diagram.wall, strict=True) if path != out}
        sums = dict(diagram.sums) | {diagram.wall_force: wall}
        if out:
            wall |= {signals[0]: 1.0}
            sums |= {signals[1]: {diagram.wall[WALL.index(out)]: 1.0}}
        for slow, fast in diagram.samples.items():
            placed.append(Placed(_copy(f"sample {slow}"), q, tuple(reads)))
            sums |= {f"sample {slow}.u": {fast: 1.0}, slow: {f"sample {slow}.y": 1.0}}
        waits = [(at + diagram.delay) for at in shown]
        ends = [*reads[1:], reads[0] + q]  # of a slow result: the tick in which the next one is computed
        late = any(wait >= end for wait, end in zip(waits, ends, strict=True))
        for fast, slow in diagram.holds.items():
            source = slow
            if late:  # kept until it is shown
                kept = [min(wait, end - 1) % q for wait, end in zip(waits, ends, strict=True)]
                placed.append(Placed(_copy(f"kept {fast}"), q, tuple(sorted(kept))))
                sums |= {f"kept {fast}.u": {slow: 1.0}}
                source = f"kept {fast}.y"
            placed.append(Placed(_copy(f"shown {fast}"), q, tuple(sorted(wait % q for wait in waits))))
            sums |= {f"shown {fast}.u": {source: 1.0}, fast: {f"shown {fast}.y": 1.0}}
        return Drawn(diagram.period, tuple(placed), sums, ("f_h", *signals[: bool(out)]), rate=diagram.rate)


def _copy(name):
    one = np.ones((1, 1))
    return Block(name, ("u",), ("y",), (), np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), one)
