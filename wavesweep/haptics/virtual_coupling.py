"""Virtual coupling: a spring and a damper at the fast rate between the device and its avatar,
behind which is the slow wall.

J. E. Colgate, M. C. Stanley, J. M. Brown, Issues in the haptic display of tool use, IROS 1995; R.
J. Adams, B. Hannaford, Stable haptic interaction with virtual environments, IEEE Trans. Robotics
and Automation 15, 1999.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from wavesweep.haptics.controller_page import F_S, BlockDiagram, Slow, device

_K, _B = "controller.K_VC", "controller.B_VC"


def dc_vc(values: Mapping[str, Any]) -> BlockDiagram:
    """hand -> device -> sampled coupling -> massless avatar and wall -> held avatar -> coupling
    in every tick -> device."""
    blocks, wires, velocity, shown = _slow_avatar(values, "x_s", "v_s")
    force = f"{_K}*(device.x - {shown['x_s']}) + {_B}*({velocity} - {shown['v_s']})"
    blocks |= {"coupling": {"type": "gain"}}
    return BlockDiagram(
        blocks,
        wires | {"coupling.u": force, "device.f": "f_h - coupling.y"},
        "coupling.y",
        _assumes(values),
    )


def dc_vc_lm(values: Mapping[str, Any]) -> BlockDiagram:
    """The same slow avatar, and a fast one, which a spring and a damper about the slow one's
    pose and force act on."""
    blocks, wires, velocity, shown = _slow_avatar(values, "x_s", "v_s", "F_s")
    fast, of_fast, x_l = _massless(
        "local", values["local_model.integration"], velocity, "model.y", {}
    )
    F_l = f"{shown['F_s']} + local_model.K_LM*({x_l} - {shown['x_s']}) + local_model.B_LM*(local_speed.y - {shown['v_s']})"
    blocks |= {**fast, "model": {"type": "gain"}}
    wires |= {**of_fast, "model.u": F_l, "device.f": "f_h - model.y"}
    return BlockDiagram(blocks, wires, "model.y", _assumes(values))


def _assumes(values: Mapping[str, Any]) -> str:
    return f"{values['environment.integration']} integration of the wall"


class SlowAvatar(NamedTuple):
    """The device, and the slow avatar at the wall: blocks, wires, the measured velocity, and
    what shows each signal."""

    blocks: dict[str, dict[str, object]]
    wires: dict[str, str]
    velocity: str
    shown: dict[str, str]


def _slow_avatar(values: Mapping[str, Any], *signals: str) -> SlowAvatar:
    """Device, avatar without mass and wall, which run at the slow rate; signals: x_s, v_s or F_s,
    which are shown when their delay is over."""
    slow = Slow.of(values)
    blocks, wires, velocity = device(values)
    integration = values["environment.integration"]
    massless, of_avatar, x = _massless("avatar", integration, velocity, "wall.y", slow.block())
    blocks |= {**massless, "wall": slow.block(type="hold")}
    wires |= {**of_avatar, "wall.u": F_S.format(x=x, v="avatar_speed.y")}
    sources = {"x_s": "avatar.y", "v_s": "avatar_speed.y", "F_s": "wall.y"}
    shown = {}
    for name in signals:
        held_blocks, through, shown[name] = slow.in_place(name, sources[name])
        blocks |= held_blocks
        wires |= through
    return SlowAvatar(blocks, wires, velocity, shown)


def _massless(
    name: str, integration: str, velocity: str, force: str, runs: Mapping[str, object]
) -> tuple[dict[str, dict[str, object]], dict[str, str], str]:
    """An avatar without mass, whose damper takes what its spring and a force leave: `B_VC v = K_VC
    (x - x~) + B_VC v^ - F`.

    Gives blocks, wires, and the position x~ that springs read: that before the step if the
    integration is explicit.
    """
    method = "trapezoidal" if integration == "trapezoidal" else "implicit"
    blocks = {
        f"{name}_speed": {**runs, "type": "hold"},
        name: {**runs, "type": "integrator", "method": method},
    }
    wires, x = {f"{name}.u": f"{name}_speed.y"}, f"{name}.y"
    if integration == "explicit":
        blocks[f"{name}_before"], x = {**runs, "type": "delay"}, f"{name}_before.y"
        wires[f"{name}_before.u"] = f"{name}.y"
    wires[f"{name}_speed.u"] = f"{velocity} + ({_K}*(device.x - {x}) - {force})/{_B}"
    return blocks, wires, x
