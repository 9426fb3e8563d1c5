"""The haptic device with the operator's hand on it, carried exactly over a tick of held forces."""

from __future__ import annotations

import numpy as np

_TERMS = 18  # of the Taylor series at norm 1/4: the next term is below 1e-27


def zero_order_hold(mass: float, damping: float, stiffness: float, lengths) -> np.ndarray:
    """Solve how position and velocity move over a tick in which the net force is constant.

    ``mass·a + damping·v + stiffness·x = f`` gives ``x' = x + a·x + b·v + c·f``, ``v' = v + d·x + e·v + g·f``, exactly.

    Parameters: `mass` kg (> 0), `damping` N·s/m, `stiffness` N/m (either may be zero or large), `lengths` of ticks (s)
    in any shape. Returns shape ``lengths.shape + (6,)``: ``a, b, c, d, e, g``, the *increments*, so that slow motion
    keeps its digits.

    Accuracy: relative about 1e-15 of the largest coefficient in each row for ticks short beside the device's time
    constants, and 1e-16·(tick/time constant) where they are not. Taylor's series of the scaled exponential minus one,
    doubled back by ``2E + E²``, has no case of its own for missing damping, missing stiffness or equal poles.
    """
    tick = np.asarray(lengths, dtype=float)
    drag, spring = damping * tick / mass, stiffness * tick**2 / mass
    generator = np.zeros((*tick.shape, 3, 3))  # of (x, v·tick, f·tick²/mass), all in metres
    generator[..., 0, 1] = generator[..., 1, 2] = 1.0
    generator[..., 1, 0], generator[..., 1, 1] = -spring, -drag
    increment = _exponential_minus_one(generator)
    a, b, c = np.moveaxis(increment[..., 0, :], -1, 0)
    d, e, g = np.moveaxis(increment[..., 1, :], -1, 0)
    return np.stack([a, b * tick, c * tick**2 / mass, d / tick, e, g * tick / mass], axis=-1)


def _exponential_minus_one(generator: np.ndarray) -> np.ndarray:
    """Compute ``exp(G) - 1`` for a stack of square matrices, small entries kept to relative rounding."""
    size = np.abs(generator).sum(axis=-1).max()
    doublings = max(0, int(np.ceil(np.log2(size))) + 2)
    small = generator / 2.0**doublings
    increment = np.zeros_like(small)
    for k in range(_TERMS, 0, -1):  # Horner: G(1 + G/2(1 + G/3(…)))
        increment = (small + small @ increment) / k
    for _ in range(doublings):
        increment = 2 * increment + increment @ increment
    return increment
