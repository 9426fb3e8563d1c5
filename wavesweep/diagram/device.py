"""The haptic device with the operator's hand on it, under forces held over a tick."""

import numpy as np

from wavesweep.diagram.block import Block, matrix, numbers


def device(values, period) -> Block:
    """Zero-order-hold device `(m + m_h) a + (d + d_h) v + k_h x = f`, with its velocity estimate.

    values: the flat keys `device.*` and `operator.*` (kg, N*s/m, N/m), numbers or arrays. period: T in s.
    Inputs: `f` (N). Outputs: `x` (m), `v_hat` (m/s), `dx` (m, the displacement in this tick).
    Accuracy: a few ulp of each entry for every damping and stiffness, zero and overdamped included.
    """
    mass = values["device.mass"] + values["operator.mass"]
    damping = (values["device.damping"] + values["operator.damping"]) / mass
    stiffness = values["operator.stiffness"] / mass
    s, g = impulse_and_step(damping, stiffness, period)
    v_row = [-damping * s - stiffness * g, -stiffness * s]
    x_row = [s, -stiffness * g]
    if values["device.velocity"] == "exact":
        return Block(
            "device",
            ("f",),
            ("x", "v_hat", "dx"),
            ("v", "x"),
            E=matrix([v_row, x_row]),
            B=matrix([[s / mass], [g / mass]]),
            C=matrix([[0, 1], [1, 0], x_row]),
            D=matrix([[0], [0], [g / mass]]),
            labels=("device velocity", "device position"),
        )
    # The encoder's difference is a state of its own, w = (x[k] - x[k-1])/T, so that a free device keeps no second copy
    # of its position, in which the drift would hide.
    w_row = [s / period, -1, -stiffness * g / period]
    return Block(
        "device",
        ("f",),
        ("x", "v_hat", "dx"),
        ("v", "w", "x"),
        E=matrix([[v_row[0], 0, v_row[1]], w_row, [s, 0, -stiffness * g]]),
        B=matrix([[s / mass], [g / (mass * period)], [g / mass]]),
        C=matrix([[0, 0, 1], [0, 1, 0], [s, 0, -stiffness * g]]),
        D=matrix([[0], [0], [g / mass]]),
        labels=("device velocity", "measured velocity", "device position"),
    )


def impulse_and_step(damping, stiffness, period):
    """Position at `period` of `x'' + damping x' + stiffness x = u` after a unit impulse and under a unit step.

    damping (1/s), stiffness (1/s^2), period (s): numbers or arrays. Returns (s, g) in s and s^2.
    Equations: s = int_0^T e^{..}, g = int_0^T s; a Taylor series over T/2^p, then p doublings
    `g2 = g (2 - stiffness g) + s^2`, `s2 = s (2 - damping s - 2 stiffness g)`, which add only positive terms if the
    device is overdamped.
    """
    damping, stiffness, period = np.broadcast_arrays(*(numbers(a) for a in (damping, stiffness, period)))
    reach = np.maximum(np.abs(damping * period), 2 * np.sqrt(np.abs(stiffness)) * np.abs(period))
    # Each element has its own number of doublings: its bits must not depend on what else is in the batch.
    doublings = np.where(reach > 0.5, np.ceil(np.log2(np.maximum(reach, 0.5))) + 1, 0).astype(int)
    tau = period * 0.5**doublings
    s, g = _taylor(damping * tau, stiffness * tau * tau)
    s, g = s * tau, g * tau * tau
    with np.errstate(over="ignore", invalid="ignore"):  # damping below zero, where an end at zero is looked for, may explode
        for step in range(int(doublings.max(initial=0))):
            more = step < doublings
            s, g = (
                np.where(more, s * (2 - damping * s - 2 * stiffness * g), s),
                np.where(more, g * (2 - stiffness * g) + s * s, g),
            )
    return s, g


TERMS = 18  # exact to rounding for |damping| <= 1/2 and stiffness <= 1/16


def _taylor(damping, stiffness):
    """The same for a unit period."""
    slope, curve = np.ones_like(damping), -damping
    s, g = slope + curve / 2, slope / 2 + curve / 6
    factorial = 2.0
    for order in range(3, TERMS):
        slope, curve = curve, -damping * curve - stiffness * slope
        factorial *= order
        s, g = s + curve / factorial, g + curve / (factorial * (order + 1))
    return s, g
