"""The haptic device with the operator's hand on it: exact over a tick of held forces, with Coulomb
friction or without.

If friction stops the device within a tick, the tick is divided exactly at that time, so that there
is no chatter.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wavesweep.engine.doubles import NEXT_TO_ZERO


def zero_order_hold(mass: float, damping: float, stiffness: float, lengths) -> np.ndarray:
    """Increments of position and velocity over a tick with a constant net force.

    ``mass·a + damping·v + stiffness·x = f`` gives ``x' = x + a·x + b·v + c·f``, ``v' = v + d·x +
    e·v + g·f``, exactly.

    Parameters: `mass` kg (> 0), `damping` N·s/m, `stiffness` N/m (either may be zero or large),
    `lengths` of ticks (s) in any shape. Returns shape ``lengths.shape + (6,)``: ``a, b, c, d, e,
    g``, the *increments*, so that slow motion keeps its digits.

    Accuracy: relative about 1e-15 of the largest coefficient in each row for ticks that are short
    against the device's time constants, and 1e-16·(tick/time constant) if they are not. Taylor's
    series of the scaled exponential minus one, doubled back by ``2E + E²``, has no case of its own
    for missing damping, missing stiffness or equal poles.
    """
    tick = np.asarray(lengths, dtype=float)
    drag = damping * tick / mass
    spring = stiffness * tick**2 / mass
    generator = np.zeros((*tick.shape, 3, 3))  # of (x, v·tick, f·tick²/mass), all in metres
    generator[..., 0, 1] = generator[..., 1, 2] = 1.0
    generator[..., 1, 0], generator[..., 1, 1] = -spring, -drag
    increment = exponential_minus_one(generator)
    a, b, c = np.moveaxis(increment[..., 0, :], -1, 0)
    d, e, g = np.moveaxis(increment[..., 1, :], -1, 0)
    return np.stack([a, b * tick, c * tick**2 / mass, d / tick, e, g * tick / mass], axis=-1)


def exponential_minus_one(generator: np.ndarray) -> np.ndarray:
    """Compute ``exp(G) - 1`` for a stack of square matrices, small entries kept to relative
    rounding."""
    size = np.abs(generator).sum(axis=-1).max(initial=NEXT_TO_ZERO)
    doublings = max(0, int(np.ceil(np.log2(size))) + 2)
    small = generator / 2.0**doublings
    increment = np.zeros_like(small)
    # Of the Taylor series at norm 1/4 the next term is below 1e-27.
    for k in range(18, 0, -1):  # Horner: G(1 + G/2(1 + G/3(…)))
        increment = (small + small @ increment) / k
    for _ in range(doublings):
        increment = 2 * increment + increment @ increment
    return increment


class Body(NamedTuple):
    """Mass (kg), damping (N·s/m), stiffness (N/m) and Coulomb friction (N) of the body that the
    forces move."""

    mass: float
    damping: float
    stiffness: float
    friction: float


def slide(
    body: Body, x: float, v: float, f: float, length: float, plant: Sequence[float] | None
) -> tuple[float, float]:
    """Move the body for `length` seconds under the held force ``f`` (N) and friction; returns
    position and velocity.

    In motion friction is the constant force ``-friction·sgn(v)`` and the tick is linear. If the
    velocity reaches 0 the body stays at rest if ``|f - stiffness·x| <= friction`` holds it, and
    otherwise sets off towards that force.

    Parameters: `x` (m) and `v` (m/s) at the start, `plant` the increments of a whole tick of this
    length.

    Accuracy: the instant of rest is a closed form, the motion up to it exact to rounding.
    """
    if not body.friction:
        return _moved(plant, x, v, f)
    while length > 0.0:
        pull = f - body.stiffness * x
        if v == 0.0 and abs(pull) <= body.friction:
            return x, 0.0
        net = f - math.copysign(body.friction, v or pull)
        stop = rest_time(body, x, v, net)
        if not stop < length:  # also where an unstable loop has made it NaN
            return _moved(plant or zero_order_hold(*body[:3], length).tolist(), x, v, net)
        x = _moved(zero_order_hold(*body[:3], stop).tolist(), x, v, net)[0]
        v = 0.0
        length = length - stop
        plant = None
    return x, v


def rest_time(body: Body, x: float, v: float, f: float) -> float:
    """Time (s) at which the velocity is next zero under the constant force ``f``; infinity if it
    never is.

    With ``c = d/2m`` the velocity is ``exp(-c·t)·(v·C - w·S)``, ``w = (k·x - f)/m + c·v``, with C
    and S cosine and sine over ω, their hyperbolic counterparts, or 1 and t. It is zero if ``S/C =
    v/w``.
    """
    c = body.damping / (2 * body.mass)
    w = (body.stiffness * x - f) / body.mass + c * v
    v, w = (
        (v, w) if v > 0.0 else (-v, -w) if v < 0.0 else (0.0, -abs(w))
    )  # which sets off, and swings for half a turn
    square = body.stiffness / body.mass - c * c
    if square > 0.0:
        omega = math.sqrt(square)
        return math.atan2(omega * v, w) / omega
    gamma = math.sqrt(-square)
    if w <= gamma * v:
        return math.inf
    if gamma > 0.0:
        return math.atanh(gamma * v / w) / gamma
    return v / w


def _moved(plant: Sequence[float], x: float, v: float, f: float) -> tuple[float, float]:
    a, b, c, d, e, g = plant
    return x + (a * x + b * v + c * f), v + (d * x + e * v + g * f)
