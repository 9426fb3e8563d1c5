"""Frames of a sampled wall from their equations alone, tick by tick: a frame begins with its sample, SI units."""

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter

T = 1e-3


def matrix_of(march, states, *frame):
    return np.array([march(column, *frame) for column in np.eye(states)]).T


def ticked(m=0.1, d=1.5):
    """What a held force does to velocity and position of the device in a tick."""
    whole = expm(T * np.array([[-d / m, 0, 1 / m], [1, 0, 0], [0, 0, 0]]))
    return whole[:2, 0], whole[:2, 2]


def dc_slow(K, B=1.0, **device):
    """Velocity, position, the one before, and the force that is held."""
    free, forced = ticked(**device)

    def march(state, length, _, delay):
        (v, x, last, held), result = state, 0.0
        for tick in range(length):
            if tick == 0:
                result = K * x + B * (x - last) / T
            held = result if tick == delay else held
            v, last, x = free[0] * v - forced[0] * held, x, x + free[1] * v - forced[1] * held
        return v, x, last, result if delay == length else held

    return lambda length, before, delay=1: matrix_of(march, 4, length, before, delay)


def pmw(K, B=1.0, b=10.0, cutoff=8.57, **device):
    """Velocity, what the position moved by, the filter's last input and output, the avatar, and the wave that is held."""
    (free, forced), ((b0, b1), (_, a1)) = ticked(**device), butter(1, cutoff, fs=1 / T)

    def wall(y, avatar):
        speed = (np.sqrt(2 * b) * y - K * avatar) / (b + B)
        return speed, y - np.sqrt(2 / b) * (K * avatar + B * speed)

    def march(state, length, before, delay):
        (v, moved, u, y, avatar, wave), result = state, 0.0
        for tick in range(length):
            if tick == delay == 0:  # round within the tick: what the wave is with a wave of 0, and what one of 1 adds
                none, one = (wall(b0 * (np.sqrt(2 * b) * moved / T - each) + b1 * u - a1 * y, avatar)[1] for each in (0, 1))
                wave = none / (1 - (one - none))
            elif tick == delay:
                wave = result
            now = np.sqrt(2 * b) * moved / T - wave
            y, u = b0 * now + b1 * u - a1 * y, now
            if tick == 0:
                speed, result = wall(y, avatar)
                avatar += before * T * speed
            push = -(b * moved / T - np.sqrt(2 * b) * wave)
            v, moved = free[0] * v + forced[0] * push, free[1] * v + forced[1] * push
        return v, moved, u, y, avatar, result if delay == length else wave

    return lambda length, before, delay=1: matrix_of(march, 6, length, before, delay)


def growth_of(frame, pattern, nominal=None):
    """What frames of (ticks, delay) multiply the motion by, one after the other for ever; nominal: ticks of the wall's step.

    frame: a matrix of ticks, the ticks of the wall's step and a delay, None of a result that never comes.
    """
    product, before = np.eye(6), pattern[-1][0]
    for ticks, delay in pattern:
        product, before = frame(ticks, nominal or before, delay) @ product, ticks
    return np.abs(np.linalg.eigvals(product)).max()
