"""The drawing of a multirate loop: blocks at two rates, samplers, holds, a wall, and who feeds whom."""

from collections.abc import Mapping
from dataclasses import dataclass

from wavesweep.diagram.block import Block, numbers

Sum = Mapping[str, object]
"""A summing junction: source signal -> gain (a number or an array over the batch)."""


@dataclass(frozen=True, slots=True)
class Hand:
    """The hand's port: the device that it holds, and the signals there.

    device: name of a block with the ports of `wavesweep.diagram.device.device`. force: the external signal (N). reaction: the
    force that the controller puts against it (N).
    """

    device: str = "device"
    force: str = "f_h"
    reaction: str = "f_m"

    @property
    def push(self) -> str:
        """The force on the device, N."""
        return f"{self.device}.f"

    @property
    def position(self) -> str:
        """The device's position, m; its state has the same name."""
        return f"{self.device}.x"

    @property
    def displacement(self) -> str:
        """The displacement in the tick, m."""
        return f"{self.device}.dx"


@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """Who feeds whom, at which rate; time is counted in fast ticks.

    fast, slow: blocks that run every tick, and at phase 0 of every frame of `ratio` ticks.
    sums: junctions by the signal that they make, read by either side; a block's input `"block.port"` is such a signal.
    samples: slow signal -> the fast signal that it is the value of at phase 0.
    holds: fast signal -> the slow signal whose latest value it shows from phase `delay` of the frame on.
    wall: the slow signals (displacement in m, velocity in m/s) that the wall reads. wall_force: the signal of its force (N).
    hand: the hand's port.
    waves: the waves that leave and reach the user's side, if there are any; blocks say which of their ports carry others.
    rate: ticks per second (Hz) as it was given, which 1/period is not to the last bit; None stands for 1/period.
    structure: a diagram that is drawn alike from tame numbers, in which drift is looked for; None stands for this one.
    """

    fast: tuple[Block, ...]
    slow: tuple[Block, ...]
    sums: Mapping[str, Sum]
    samples: Mapping[str, str]
    holds: Mapping[str, str]
    wall: tuple[str, str]
    ratio: int
    delay: int
    period: object
    hand: Hand = Hand()
    wall_force: str = "F_s"
    waves: tuple[str, str] | None = None
    rate: object = None
    structure: "Diagram | None" = None


def hand(values) -> dict:
    """The tick and the hand, as keywords that a `Diagram` takes."""
    return {
        "period": 1 / numbers(values["rates.fast_hz"]),
        "rate": values["rates.fast_hz"],
    }


def rates(values) -> dict:
    """The frame and the slow environment's delay in it, as keywords that a `Diagram` takes."""
    return {"ratio": values["rates.ratio"], "delay": values["environment.delay"]}
