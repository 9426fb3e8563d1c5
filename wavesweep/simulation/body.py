"""The haptic device with the operator's hand on it: exact over a tick of held forces, with Coulomb friction or without.

If friction stops the device within a tick, the tick is divided exactly at that time, so that there is no chatter.
"""

import math
from typing import NamedTuple

import numpy as np

_TERMS = 18  # of the Taylor series at norm 1/4: the next term is below 1e-27
_REST = 1e-20  # of the motion: smaller terms of the series are below rounding


def zero_order_hold(mass: float, damping: float, stiffness: float, lengths) -> np.ndarray:
    """Increments of position and velocity over a tick with a constant net force.

    ``mass·a + damping·v + stiffness·x = f`` gives ``x' = x + a·x + b·v + c·f``, ``v' = v + d·x + e·v + g·f``, exactly.

    Parameters: `mass` kg (> 0), `damping` N·s/m, `stiffness` N/m (either may be zero or large), `lengths` of ticks (s)
    in any shape. Returns shape ``lengths.shape + (6,)``: ``a, b, c, d, e, g``, the *increments*, so that slow motion
    keeps its digits.

    Accuracy: relative about 1e-15 of the largest coefficient in each row for ticks that are short against the device's time
    constants, and 1e-16·(tick/time constant) if they are not. Taylor's series of the scaled exponential minus one,
    doubled back by ``2E + E²``, has no case of its own for missing damping, missing stiffness or equal poles.
    """
    tick = np.asarray(lengths, dtype=float)
    drag, spring = damping * tick / mass, stiffness * tick**2 / mass
    generator = np.zeros((*tick.shape, 3, 3))  # of (x, v·tick, f·tick²/mass), all in metres
    generator[..., 0, 1] = generator[..., 1, 2] = 1.0
    generator[..., 1, 0], generator[..., 1, 1] = -spring, -drag
    increment = exponential_minus_one(generator)
    a, b, c = np.moveaxis(increment[..., 0, :], -1, 0)
    d, e, g = np.moveaxis(increment[..., 1, :], -1, 0)
    return np.stack([a, b * tick, c * tick**2 / mass, d / tick, e, g * tick / mass], axis=-1)


def exponential_minus_one(generator: np.ndarray) -> np.ndarray:
    """Compute ``exp(G) - 1`` for a stack of square matrices, small entries kept to relative rounding."""
    size = np.abs(generator).sum(axis=-1).max(initial=1e-300)
    doublings = max(0, int(np.ceil(np.log2(size))) + 2)
    small = generator / 2.0**doublings
    increment = np.zeros_like(small)
    for k in range(_TERMS, 0, -1):  # Horner: G(1 + G/2(1 + G/3(…)))
        increment = (small + small @ increment) / k
    for _ in range(doublings):
        increment = 2 * increment + increment @ increment
    return increment


class Body(NamedTuple):
    """Mass (kg), damping (N·s/m), stiffness (N/m) and Coulomb friction (N) of the body that the forces move."""

    mass: float
    damping: float
    stiffness: float
    friction: float


def slide(body: Body, x: float, v: float, f: float, length: float, plant: tuple[float, ...]) -> tuple[float, float]:
    """Move the body for `length` seconds under the held force ``f`` (N) and friction; returns position and velocity.

    In motion friction is the constant force ``-friction·sgn(v)`` and the tick is linear. If the velocity reaches 0
    the body stays at rest if ``|f - stiffness·x| <= friction`` holds it, and otherwise sets off towards that force.

    Parameters: `x` (m) and `v` (m/s) at the start, `plant` the increments of a whole tick of this length.

    Accuracy: the instant of rest is a closed form, the motion up to it a Taylor series to rounding.
    """
    whole = True
    while length > 0.0:
        pull = f - body.stiffness * x
        if v == 0.0 and abs(pull) <= body.friction:
            return x, 0.0
        net = f - math.copysign(body.friction, v or pull)
        stop = rest_time(body, x, v, net)
        if not stop < length:  # also where an unstable loop has made it NaN
            return _whole(plant, x, v, net) if whole else coast(body, x, v, net, length)
        x, v = coast(body, x, v, net, stop)[0], 0.0
        length, whole = length - stop, False
    return x, v


def rest_time(body: Body, x: float, v: float, f: float) -> float:
    """Time (s) at which the velocity is next zero under the constant force ``f``; infinity if it never is.

    With ``c = d/2m`` the velocity is ``exp(-c·t)·(v·C - w·S)``, ``w = (k·x - f)/m + c·v``, with C and S cosine and
    sine over ω, their hyperbolic counterparts, or 1 and t. It is zero if ``S/C = v/w``.
    """
    if v == 0.0:
        return math.inf if body.stiffness == 0.0 else _half_swing(body)
    c = body.damping / (2 * body.mass)
    w = (body.stiffness * x - f) / body.mass + c * v
    v, w = (v, w) if v > 0.0 else (-v, -w)
    square = body.stiffness / body.mass - c * c
    if square > 0.0:
        omega = math.sqrt(square)
        return math.atan2(omega * v, w) / omega
    gamma = math.sqrt(-square)
    if w <= gamma * v:
        return math.inf
    return math.atanh(gamma * v / w) / gamma if gamma > 0.0 else v / w


def _half_swing(body: Body) -> float:
    """Time (s) from rest to rest of a body that is set in motion by a constant force."""
    square = body.stiffness / body.mass - (body.damping / (2 * body.mass)) ** 2
    return math.pi / math.sqrt(square) if square > 0.0 else math.inf


def _whole(plant: tuple[float, ...], x: float, v: float, f: float) -> tuple[float, float]:
    a, b, c, d, e, g = plant
    return x + (a * x + b * v + c * f), v + (d * x + e * v + g * f)


def coast(body: Body, x: float, v: float, f: float, length: float) -> tuple[float, float]:
    """Solve ``m·a + d·v + k·x = f`` for any length of time by Taylor's series, in steps with fast convergence."""
    fastest = max(body.damping / body.mass, math.sqrt(body.stiffness / body.mass))
    steps = max(1, math.ceil(length * fastest)) if length > 0.0 else 0
    for _ in range(steps):
        x, v = _series(body, x, v, f, length / steps)
    return x, v


def _series(body: Body, x: float, v: float, f: float, t: float) -> tuple[float, float]:
    """Sum ``c[n+2] = (f·[n = 0] - d·(n+1)·c[n+1]·/t - k·c[n])·t²/(m·(n+1)(n+2))``, the terms of x(t)."""
    drag, spring = body.damping * t / body.mass, body.stiffness * t * t / body.mass
    term, following = x, v * t
    push, n = f * t * t / body.mass, 0
    position, distance = term + following, following
    size = abs(following) + abs(push) + spring * abs(x)
    while abs(term) + abs(following) > _REST * size or n < 2:
        term, following = following, (push - drag * (n + 1) * following - spring * term) / ((n + 1) * (n + 2))
        push, n = 0.0, n + 1
        position, distance = position + following, distance + (n + 1) * following
    return position, distance / t
