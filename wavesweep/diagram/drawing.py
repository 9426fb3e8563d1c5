"""The drawing of a multirate loop: blocks at two rates, samplers, holds, a wall, and their connections."""

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
    """Blocks and their connections at two rates; time is counted in fast ticks.

    fast, slow: blocks that run every tick, and at phase 0 of every frame of `ratio` ticks.
    sums: junctions by the signal that they make, read by either side; a block's input `"block.port"` is such a signal.
    samples: slow signal -> the fast signal whose value at phase 0 it is.
    holds: fast signal -> the slow signal whose latest value it has from phase `delay` of the frame on.
    wall: the slow signals (displacement in m, velocity in m/s) that the wall reads. wall_force: the signal of its force (N).
    hand: the hand's port.
    period: of a tick, s. ratio: ticks in a frame. delay: ticks until a slow result is in place.
    waves: the signals of the waves that leave and reach the user's side, if there are any; blocks name their own wave ports.
    rate: ticks per second (Hz) as it was given, from which 1/period may differ in the last bit; by default 1/period.
    structure: a diagram of the same structure with moderate numbers, in which drift is searched for; by default this one.
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
    """Return the tick (s) and its rate (Hz) as keywords of `Diagram`. values: the flat keys of a spec."""
    return {
        "period": 1 / numbers(values["rates.fast_hz"]),
        "rate": values["rates.fast_hz"],
    }


def rates(values) -> dict:
    """Return the ticks of a frame and the delay in it as keywords of `Diagram`. values: the flat keys of a spec."""
    return {"ratio": values["rates.ratio"], "delay": values["environment.delay"]}
