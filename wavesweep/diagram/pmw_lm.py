"""Passive multirate wave control with filter bank, local model and position feedback, Figure 3 of the paper."""

from wavesweep.diagram.block import unit_delay
from wavesweep.diagram.device import device
from wavesweep.diagram.drawing import Diagram, hand, rates
from wavesweep.diagram.filters import butterworth
from wavesweep.diagram.pmw import antialiasing, encoder, position_term, slow_avatar
from wavesweep.diagram.wave import local_model


def pmw_lm(values) -> Diagram:
    """The loop of Figure 1 and the branch u_m -> HP -> local model -> LP2 -> v_2; v_m = v_1 + v_2 + Kp (x_s - x)."""
    facts = hand(values) | rates(values)
    period, delayed = facts["period"], values["local_model.delay"] == 1
    branch = (
        butterworth("hp", values["filters.hp.order"], values["filters.hp.cutoff_hz"], period, highpass=True),
        local_model(
            values["controller.b"],
            values["local_model.K_LM"],
            values["local_model.B_LM"],
            period,
            values["local_model.integration"],
        ),
        butterworth("lp2", values["filters.lp2.order"], values["filters.lp2.cutoff_hz"], period),
    )
    if delayed:
        branch += (unit_delay("late", "local wave of the last tick"),)
    junctions = {
        "hp.u": {"u_m": 1},
        "local.u": {"hp.y": 1},
        "lp2.u": {"local.v": 1},
        "late.u": {"lp2.y": 1},
        "v_m": {"v_1": 1, "late.y" if delayed else "lp2.y": 1} | position_term(values),
    }
    return Diagram(
        fast=(device(values, period), antialiasing(values, period), *branch),
        slow=(slow_avatar(values, period),),
        sums=encoder(values) | junctions,
        samples={"u_s": "lp1.y"},
        holds={"v_1": "avatar.v", "x_s": "avatar.x"},
        wall=("avatar.x_tilde", "avatar.x_dot"),
        waves=("u_m", "v_m"),
        **facts,
    )
