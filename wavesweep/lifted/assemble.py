"""From a drawing to one block per rate: the fast side of a tick, the slow side of a frame."""

from wavesweep.diagram.block import Block
from wavesweep.diagram.delay import unit_delay
from wavesweep.diagram.drawing import Diagram
from wavesweep.diagram.drift import latch
from wavesweep.lifted.connect import connect
from wavesweep.lifted.lift import lift_held
from wavesweep.lifted.prune import prune


def fast_side(diagram: Diagram, outputs) -> Block:
    """The tick: from the hand's force and the held signals to `outputs`; states that these do not read are left out."""
    block, _ = prune(connect("fast", diagram.fast, diagram.sums, (diagram.hand.force, *diagram.holds), tuple(outputs)))
    return block


def slow_side(diagram: Diagram, outputs, injected=False, wall=None) -> tuple[Block, tuple[str, ...]]:
    """The frame, cut at the wall: from the wall's force to the slow signals `outputs`.

    injected: adds an input `inject.NAME` for every sample, which is added to what the sampler reads (the hand's force
    reaches the slow side by no other way). wall: a junction that makes that force, which closes the loop.
    Returns the block and the names of the states that were left out.
    """
    sampled = tuple(dict.fromkeys(diagram.samples.values()))
    fast = fast_side(diagram, sampled)
    frame = lift_held(fast, diagram.ratio, diagram.delay, tuple(diagram.holds), sampled)
    sums = slow_sums(diagram)
    if injected:
        sums |= {name: sums[name] | {f"inject.{name}": 1} for name in diagram.samples}
    sums |= wall or {}
    inputs = (() if wall else (diagram.wall_force,)) + (tuple(f"inject.{name}" for name in diagram.samples) if injected else ())
    block, unread = prune(connect("slow", (frame, *diagram.slow, *latches(diagram)), sums, inputs, tuple(outputs)))
    dropped_early = tuple(
        f"frame.{b.name}.{s}" for b in diagram.fast for s in b.states if f"{b.name}.{s}" not in fast.states
    )
    return block, dropped_early + unread


def latches(diagram: Diagram) -> tuple[Block, ...]:
    """What remembers the held signals of the frame before, where they are shown with a delay."""
    delayed = diagram.holds if diagram.delay > 0 else ()
    return tuple(unit_delay(latch(name).removesuffix(".u_before")) for name in delayed)


def wall_sum(diagram: Diagram, K_VE, B_VE) -> dict:
    """The junction that makes the wall's force, `K_VE` (N/m) and `B_VE` (N*s/m) being numbers or arrays."""
    return {diagram.wall_force: {diagram.wall[0]: K_VE, diagram.wall[1]: B_VE}}


def slow_sums(diagram: Diagram) -> dict:
    """The drawing's junctions and those that tie the lifted block "frame" to samplers and holds."""
    sums = dict(diagram.sums)
    for name, source in diagram.holds.items():
        sums |= {f"frame.{name}.old": {f"hold_{name}.y": 1}, f"frame.{name}.new": {source: 1}, f"hold_{name}.u": {source: 1}}
    return sums | {name: {f"frame.{source}": 1} for name, source in diagram.samples.items()}
