"""Controllers without waves: direct coupling at the fast rate and at the slow one, and a
power-domain local model."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from wavesweep.haptics.controller_page import F_S, BlockDiagram, Slow, device

HELD = "wall force K*x + B*v at the slow rate"


def dc(values: Mapping[str, Any]) -> BlockDiagram:
    """The paper's ideal: the wall's force in every tick, so the frame is one tick."""
    blocks, wires, velocity = device(values)
    force = F_S.format(x="device.x", v=velocity)
    return BlockDiagram(
        blocks, wires | {"device.f": f"f_h - ({force})"}, force, "ideal wall at the fast rate"
    )


def dc_slow(values: Mapping[str, Any]) -> BlockDiagram:
    """hand -> device -> sampled slow wall -> held force -> device."""
    blocks, wires, _, force = _slow_wall(values)
    return BlockDiagram(blocks, wires | {"device.f": f"f_h - {force}"}, force, HELD)


def dc_lm(values: Mapping[str, Any]) -> BlockDiagram:
    """The slow wall's held force, and a fast spring and damper about the samples that this force
    was computed from."""
    slow = Slow.of(values)
    blocks, wires, velocity, force = _slow_wall(values)
    for name, signal, gain in (
        ("x_ref", "device.x", "local_model.K_LM"),
        ("v_ref", velocity, "local_model.B_LM"),
    ):
        sampled = {name: slow.block(type="hold")}
        held_blocks, through, shown = slow.in_place(name, f"{name}.y")
        blocks, wires = blocks | sampled | held_blocks, wires | {f"{name}.u": signal} | through
        force = f"{force} + {gain}*({signal} - {shown})"
    return BlockDiagram(blocks, wires | {"device.f": f"f_h - ({force})"}, force, HELD)


class SlowWall(NamedTuple):
    """The device, and the slow wall: blocks, wires, the measured velocity and the wall's force
    as it is held."""

    blocks: dict[str, dict[str, object]]
    wires: dict[str, str]
    velocity: str
    force: str


def _slow_wall(values: Mapping[str, Any]) -> SlowWall:
    slow, (blocks, wires, velocity) = Slow.of(values), device(values)
    held_blocks, through, force = slow.in_place("wall", "wall.y")
    blocks = blocks | {"wall": slow.block(type="hold")} | held_blocks
    return SlowWall(
        blocks, wires | {"wall.u": F_S.format(x="device.x", v=velocity)} | through, velocity, force
    )
