"""Direct coupling to a slow wall with passive networks as hands, tick by tick: shares nothing with the package."""

import numpy as np
from scipy.linalg import expm


def random_hand(rng):
    """Mass, damping and stiffness matrices of a network of one to three masses, the first of which the hand holds."""
    size = int(rng.integers(1, 4))
    mass, damping, stiffness = np.zeros((3, size, size))
    for i in range(size):
        mass[i, i] = 10 ** rng.uniform(-4, 2) * (i > 0 or rng.random() < 0.7)
        for j in range(-1, i):  # to the ground, and to the masses before it, of which the last is always connected
            across = np.eye(size)[i] - (np.eye(size)[j] if j >= 0 else 0)
            stiffness += rng.choice([0 <= j == i - 1, 1]) * 10 ** rng.uniform(-2, 7) * np.outer(across, across)
            damping += rng.choice([0, 0, 0, 10 ** rng.uniform(-4, 0)]) * np.outer(across, across)
    return mass, damping, stiffness


def growth(hand, device, wall, frames, period):
    """Spectral radius of a pattern of frames; device: mass and damping, wall: stiffness and damping.

    frames: pairs of the length and the delay of the result, in ticks; a delay of the whole length is in place with the next
    sample.
    """
    mass, damping, stiffness = (part.copy() for part in hand)
    mass[0, 0] += device[0]
    damping[0, 0] += device[1]
    n, light = len(mass), np.eye(len(mass))
    rates, force = np.linalg.solve(mass, np.hstack([-stiffness, -damping])), np.linalg.solve(mass, light[:, :1])
    flow = np.zeros((2 * n + 1, 2 * n + 1))
    flow[:n, n : 2 * n], flow[n : 2 * n, : 2 * n], flow[n : 2 * n, 2 * n :] = light, rates, -force
    step = expm(flow * period)
    # states: positions, velocities, force that acts, force that is computed, last position
    state = np.eye(2 * n + 3)
    for length, delay in frames:
        for tick in range(length):
            if tick == 0:
                state[2 * n + 1] = wall[0] * state[0] + wall[1] * (state[0] - state[2 * n + 2]) / period
            if tick == delay:
                state[2 * n] = state[2 * n + 1]
            state[2 * n + 2] = state[0]
            state[: 2 * n] = (step @ state[: 2 * n + 1])[: 2 * n]
        if delay == length:
            state[2 * n] = state[2 * n + 1]
    return np.abs(np.linalg.eigvals(state)).max()
