"""The haptic device with the operator's hand on it, under forces held over a tick."""

import numpy as np

from wavesweep.loops.block import Block, loss, matrix, numbers


def device(values, period) -> Block:
    """Zero-order-hold device `(m + m_h) a + (d + d_h) v + k_h x = f`, with its velocity estimate.

    values: the flat keys `device.*` and `operator.*` (kg, N*s/m, N/m), numbers or arrays. period: T in s.
    Inputs: `f` (N). Outputs: `x` (m), `v_hat` (m/s), `dx` (m, the displacement in this tick).
    Accuracy: a few ulp of each entry for every damping and stiffness, zero and overdamped included.
    """
    mass = values["device.mass"] + values["operator.mass"]
    damping = (values["device.damping"] + values["operator.damping"]) / mass
    stiffness = values["operator.stiffness"] / mass
    s, g, of_s, of_g = impulse_and_step(damping, stiffness, period)
    exact = values["device.velocity"] == "exact"
    # The encoder's difference is a state of its own, w = (x[k] - x[k-1])/T, so that a free device keeps no second copy
    # of its position, in which the drift would hide.
    arrays = _exact if exact else _by_difference
    parts = arrays(s, g, -damping, -stiffness, mass, period, -1)
    sizes = None if of_s is None else arrays(of_s, of_g, *map(np.abs, (damping, stiffness, mass, period)), 1)
    states = ("v", "x") if exact else ("v", "w", "x")
    names = {"v": "device velocity", "w": "measured velocity", "x": "device position"}
    labels = tuple(names[state] for state in states)
    condition = 1.0 if sizes is None else loss(parts[0], sizes[0], tick=True)
    facts = {"condition": condition, "terms": sizes, "at_rest": _at_rest(damping, stiffness, mass, exact), "labels": labels}
    return Block("device", ("f",), ("x", "v_hat", "dx"), states, *parts, **facts)


def _at_rest(damping, stiffness, mass, exact):
    """E, B, C and D that say that nothing moves, and that the spring has the force."""
    force, rest = [-damping, -stiffness], [1, 0]
    if exact:
        return matrix([force, rest]), matrix([[1 / mass], [0]]), matrix([[0, 1], [1, 0], [0, 0]]), np.zeros((3, 1))
    E = matrix([[force[0], 0, force[1]], [1, -1, 0], [1, 0, 0]])
    return E, matrix([[1 / mass], [0], [0]]), matrix([[0, 0, 1], [0, 1, 0], [0, 0, 0]]), np.zeros((3, 1))


def _exact(s, g, damping, stiffness, mass, period, _):
    """E, B, C and D with the exact velocity; see `motion`."""
    del period
    C = matrix([[0, 1], [1, 0], [s, stiffness * g]])
    return *motion(s, g, damping, stiffness, mass), C, matrix([[0], [0], [g / mass]])


def _by_difference(s, g, damping, stiffness, mass, period, before):
    """The same with the velocity from the change of position; before: the share of its last value in its change."""
    x_row = [s, 0, stiffness * g]
    E = matrix([[damping * s + stiffness * g, 0, stiffness * s], [s / period, before, stiffness * g / period], x_row])
    B = matrix([[s / mass], [g / (mass * period)], [g / mass]])
    return E, B, matrix([[0, 0, 1], [0, 1, 0], x_row]), matrix([[0], [0], [g / mass]])


def motion(s, g, damping, stiffness, mass):
    """E and B of the states (v, x) under a force; the signs of damping and stiffness are those of their own forces."""
    return matrix([[damping * s + stiffness * g, stiffness * s], [s, stiffness * g]]), matrix([[s / mass], [g / mass]])


def impulse_and_step(damping, stiffness, period):
    """Position at `period` of `x'' + damping x' + stiffness x = u` after a unit impulse and under a unit step, with sizes.

    damping (1/s), stiffness (1/s^2), period (s): numbers or arrays. Returns (s, g) in s and s^2, and their changes by a
    rounding of each term of all sums, in roundings; these are missing (None) if there is nothing to double, and then both are
    known to a few roundings of themselves. After many turns of an oscillation s and g are much smaller than that.
    Equations: s = int_0^T e^{..}, g = int_0^T s; a Taylor series over T/2^p, then p doublings
    `g2 = g (2 - stiffness g) + s^2`, `s2 = s (2 - damping s - 2 stiffness g)`, which add only positive terms if the
    device is overdamped.
    """
    damping, stiffness, period = np.broadcast_arrays(*(numbers(a) for a in (damping, stiffness, period)))
    reach = np.maximum(np.abs(damping * period), 2 * np.sqrt(np.abs(stiffness)) * np.abs(period))
    # Each element has its own number of doublings: its bits must not depend on what else is in the batch.
    doublings = np.where(reach > 0.5, np.ceil(np.log2(np.clip(reach, 0.5, np.finfo(float).max))) + 1, 0).astype(int)
    tau = period * 0.5**doublings
    with np.errstate(invalid="ignore"):  # a mass next to 0 makes an infinite damping, whose frame is not known
        s, g = _taylor(damping * tau, stiffness * tau * tau)
    s, g = s * tau, g * tau * tau
    if not doublings.any():
        return s, g, None, None
    of_s, of_g = np.abs(s), np.abs(g)
    with np.errstate(over="ignore", invalid="ignore"):  # damping below zero, where an end at zero is looked for, may explode
        for step in range(int(doublings.max(initial=0))):
            more = step < doublings
            two_s, two_g = np.abs(2 - 2 * damping * s - 2 * stiffness * g), np.abs(2 - 2 * stiffness * g)
            terms_s = np.abs(s) * (2 + np.abs(damping * s) + 2 * np.abs(stiffness * g))
            terms_g = np.abs(g) * (2 + np.abs(stiffness * g)) + np.abs(s * s)
            of_s, of_g = (
                np.where(more, two_s * of_s + 2 * np.abs(stiffness * s) * of_g + terms_s, of_s),
                np.where(more, two_g * of_g + 2 * np.abs(s) * of_s + terms_g, of_g),
            )
            s, g = (
                np.where(more, s * (2 - damping * s - 2 * stiffness * g), s),
                np.where(more, g * (2 - stiffness * g) + s * s, g),
            )
    return s, g, of_s, of_g


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
