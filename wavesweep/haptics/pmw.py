"""Passive multirate wave control, Figures 1 and 3 of the paper."""

from collections.abc import Mapping
from dataclasses import replace
from math import floor
from types import MappingProxyType
from typing import Any

from wavesweep.haptics.controller_page import F_S, RATIO, BlockDiagram, Slow, device


def pmw(values: Mapping[str, Any]) -> BlockDiagram:
    """Figure 1: hand -> device -> encoder u_m -> LP1 -> sampler -> avatar and wall -> v_s ->
    hold -> v_m -> device."""
    return _waves(values, _filter("lp1"))


def pmw_mean(values: Mapping[str, Any]) -> BlockDiagram:
    """Figure 1 with the mean of a frame's waves in LP1's place: of all passive channels, the one
    that is felt stiffest at rest.

    Where rates do not divide, the mean of the nearest whole number of ticks, which the result says.
    """
    ticks = floor(values[RATIO] + 0.5)
    page = _waves(values, {"type": "mean", "n": ticks})
    if values[RATIO] == ticks:
        return page
    return replace(
        page, assumes=f"mean of {ticks} ticks, a frame being {values[RATIO]:.6g}, {page.assumes}"
    )


def pmw_lm(values: Mapping[str, Any]) -> BlockDiagram:
    """Figure 3: Figure 1 and the branch u_m -> HP -> local model -> LP2 -> v_2; v_m = v_1 + v_2
    + Kp (x_s - x)."""
    blocks = {
        "hp": _filter("hp", "high"),
        "local": {
            "type": "local_model",
            "b": "controller.b",
            "K": "local_model.K_LM",
            "B": "local_model.B_LM",
            "integration": values["local_model.integration"],
        },
        "lp2": _filter("lp2"),
    }
    wires, v_2 = {"hp.u": "encoder.out", "local.in": "hp.y", "lp2.u": "local.out"}, "lp2.y"
    if values["local_model.delay"]:
        blocks, wires, v_2 = blocks | {"v_2": {"type": "delay"}}, wires | {"v_2.u": v_2}, "v_2.y"
    return _waves(values, _filter("lp1"), blocks, wires, v_2)


def _waves(
    values: Mapping[str, Any],
    lp1: dict[str, object],
    branch: Mapping[str, Mapping[str, object]] = MappingProxyType({}),
    of_branch: Mapping[str, str] = MappingProxyType({}),
    v_2: str = "",
) -> BlockDiagram:
    """The loop of Figure 1 with the block `lp1` before the sampler, and a further branch, whose
    wave is `v_2`."""
    slow, (blocks, wires, velocity) = Slow.of(values), device(values)
    blocks["encoder"] = {"type": "wave", "b": "controller.b"}
    blocks["lp1"] = lp1
    blocks["avatar"] = slow.block(
        type="avatar", b="controller.b", integration=values["environment.integration"]
    )
    held_blocks, through, v_1 = slow.in_place("v_1", "avatar.out")
    v_m = f"{v_1} + {v_2}" if v_2 else v_1
    if values["controller.Kp"]:  # equation (3) of the paper
        shown_blocks, further, x_s = slow.in_place("x_s", "avatar.x")
        held_blocks, through, v_m = (
            held_blocks | shown_blocks,
            through | further,
            f"{v_m} + controller.Kp*({x_s} - device.x)",
        )
    wires |= {
        "encoder.v": velocity,
        "encoder.in": v_m,
        "lp1.u": "encoder.out",
        "avatar.in": "lp1.y",
        "avatar.f": F_S.format(x="avatar.x_spring", v="avatar.v"),
        "device.f": "f_h - encoder.force",
    }
    assumes = f"{values['environment.integration']} integration of the wall"
    return BlockDiagram(
        {**blocks, **branch, **held_blocks},
        {**wires, **of_branch, **through},
        "encoder.force",
        assumes,
    )


def _filter(name: str, passes: str = "low") -> dict[str, object]:
    return {
        "type": "butterworth",
        "order": f"filters.{name}.order",
        "cutoff_hz": f"filters.{name}.cutoff_hz",
        "pass": passes,
    }
