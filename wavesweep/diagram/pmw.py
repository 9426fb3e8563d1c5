"""Passive multirate wave control, Figure 1 of the paper."""

import numpy as np

from wavesweep.diagram.block import numbers
from wavesweep.diagram.device import device
from wavesweep.diagram.drawing import Diagram, hand, rates
from wavesweep.diagram.filters import butterworth
from wavesweep.diagram.wave import avatar


def pmw(values) -> Diagram:
    """hand -> device -> encoder u_m -> LP1 -> sampler -> avatar and wall -> v_s -> hold -> v_m -> device."""
    facts = hand(values) | rates(values)
    return Diagram(
        fast=(device(values, facts["period"]), antialiasing(values, facts["period"])),
        slow=(slow_avatar(values, facts["period"]),),
        sums=encoder(values) | {"v_m": {"v_1": 1} | position_term(values)},
        samples={"u_s": "lp1.y"},
        holds={"v_1": "avatar.v", "x_s": "avatar.x"},
        wall=("avatar.x_tilde", "avatar.x_dot"),
        waves=("u_m", "v_m"),
        **facts,
    )


def encoder(values) -> dict:
    """Junctions at the user's side: f_m = b v_hat - sqrt(2b) v_m, u_m = sqrt(2b) v_hat - v_m, LP1 and avatar."""
    b = values["controller.b"]
    root = np.sqrt(2 * numbers(b))
    return {
        "device.f": {"f_h": 1, "f_m": -1},
        "f_m": {"device.v_hat": b, "v_m": -root},
        "u_m": {"device.v_hat": root, "v_m": -1},
        "lp1.u": {"u_m": 1},
        "avatar.u": {"u_s": 1},
        "avatar.F": {"F_s": 1},
    }


def position_term(values) -> dict:
    """Equation (3): Kp (x_s - x_m), added to the wave that returns to the user."""
    gain = values["controller.Kp"]
    return {"x_s": gain, "device.x": -1 * gain} if np.any(gain) else {}


def antialiasing(values, period):
    """LP1, before the downsampler."""
    return butterworth("lp1", values["filters.lp1.order"], values["filters.lp1.cutoff_hz"], period)


def slow_avatar(values, period):
    """The avatar, which runs once a frame."""
    return avatar(values["controller.b"], period * values["rates.ratio"], values["environment.integration"])
