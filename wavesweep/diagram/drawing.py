"""The drawing of a multirate loop: blocks at two rates, samplers, holds, a wall, and who feeds whom."""

from collections.abc import Mapping
from dataclasses import dataclass

from wavesweep.diagram.block import Block

Sum = Mapping[str, object]
"""A summing junction: source signal -> gain (a number or an array over the batch)."""


@dataclass(frozen=True, slots=True, eq=False)
class Diagram:
    """Who feeds whom, at which rate; time is counted in fast ticks.

    fast, slow: blocks that run every tick, and at phase 0 of every frame of `ratio` ticks.
    sums: junctions by the signal that they make, read by either side; a block's input `"block.port"` is such a signal.
    samples: slow signal -> the fast signal that it is the value of at phase 0.
    holds: fast signal -> the slow signal whose latest value it shows from phase `delay` of the frame on.
    wall: the slow signals (displacement in m, velocity in m/s) that the wall reads; its force is the signal `F_s`.
    outputs: what an analysis may ask of the fast side: `dx` (m, the displacement in the tick) and `f_m` (N).
    held_by_spring: the operator's stiffness is not zero, so a shift of the whole scene is felt.
    wall_drifts: with a spring in the hand and no position fed back, a combination of states is conserved (the avatar's
    position is then the integral of a signal whose steady value no wall force can change).
    reference: the state whose position stands for that of the scene when it is not held by a spring.
    held_positions: which of the held signals are positions.
    rate: ticks per second (Hz) as it was given, which 1/period is not to the last bit; None stands for 1/period.
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
    held_by_spring: bool = False
    wall_drifts: bool = False
    outputs: tuple[str, str] = ("device.dx", "f_m")
    reference: str = "frame.device.x"
    held_positions: frozenset[str] = frozenset({"x_s", "x_ref"})
    rate: object = None
