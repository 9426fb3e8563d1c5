"""The loops of sweeps/recipes once more, as plain loops over ticks: each gives the matrix of a frame.

Nothing of the package is used. A signal is a row: its dependence on the states at the beginning of the frame.
"""

import numpy as np
from scipy.linalg import expm


def plant(T, m, d=0.0, k=0.0):
    """The exact step of `m x'' + d x' + k x = f` over T: a function of x, v and f."""
    E = expm(T * np.array([[0, 1, 0], [-k / m, -d / m, 1 / m], [0, 0, 0]]))
    return lambda x, v, f: tuple(E[row, 0] * x + E[row, 1] * v + E[row, 2] * f for row in (0, 1))


def physics_joint(h, I, kp, kd):
    x, v = np.eye(2)
    v = (v - h / I * kp * x) / (1 + h * kd / I)
    return np.array([x + h * v, v])


def policy(f, zeta, I, g, n):
    step, w = plant(1e-3, I), 2 * np.pi * f
    x, v, observation, target, torque = np.eye(5)
    for t in range(20):
        if t == 0:
            observation = x
        if t == 10:
            target = -g * observation
        if t % n == 0:
            torque = I * w * w * (target - x) - 2 * zeta * I * w * v
        x, v = step(x, v, torque)
    return np.array([x, v, observation, target, torque])


def teleoperation(c, kp, kd, Fv, J, n):
    """Positions are relative to the leader's, which nothing holds."""
    step = plant(1e-4, J, Fv)
    xl, (vl, xf, vf, *arrived) = np.zeros(9), np.eye(9)
    for t in range(n):
        if t == 0:
            read = [xf, vf, xl, vl, c * vl, c * vf]
        if t == n // 2:
            arrived = read
        to_xl, to_vl, to_xf, to_vf, friction_l, friction_f = arrived
        pull_l = kp * (to_xl - xl) + kd * (to_vl - vl) + friction_l
        pull_f = kp * (to_xf - xf) + kd * (to_vf - vf) + friction_f
        (xl, vl), (xf, vf) = step(xl, vl, pull_l), step(xf, vf, pull_f)
    to_xl, to_vl, to_xf, to_vf, friction_l, friction_f = arrived
    return np.array([vl, xf - xl, vf, to_xl - xl, to_vl, to_xf - xl, to_vf, friction_l, friction_f])


def engine(K, kr, dr, mr, m, d, grip, N):
    step, h = plant(1e-3, m + 0.15 * grip, d + 8 * grip, 300 * grip), 5e-3
    x, v, read, xr, vr, force = np.eye(6)
    for t in range(5 * N):
        if t == 0:
            read = x
        if t % 5 == 0:
            vr = (vr + h / mr * (kr * (read - xr) - K * xr)) / (1 + h / mr * dr + h * h / mr * (kr + K))
            xr = xr + h * vr
        if t == 5 * N - 1:
            force = K * xr
        x, v = step(x, v, -force)
    return np.array([x, v, read, xr, vr, force])


def wheel(K, B, J, d, grip, n):
    step = plant(5e-4, J + 0.03 * grip, d + 0.5 * grip, 5 * grip)
    x, v, encoder, game, channel, motor = np.eye(6)
    for t in range(max(n, 10)):
        if t % 2 == 0:
            encoder = x
        if t % 5 == 0:
            before, game = game, encoder
            if t % n == 0:
                channel = -K * game - B * (game - before) / 2.5e-3
        if t % 2 == 1:
            motor = channel
        x, v = step(x, v, motor)
    return np.array([x, v, encoder, game, channel, motor])


def hybrid_test(c, k, ks, m, n):
    x, v, *late = np.eye(2 + n)
    return np.array([*plant(1e-3, m, c, k)(x, v, -ks * late[-1]), x, *late[:-1]])


def network(K, d, k):
    x, force = np.eye(2)
    return np.array([x + 1e-3 * k / d * force - 1e-3 * (20 - k) / d * K * x, -K * x])


def two_rate_wall(K, B, n):
    step = plant(1e-4, 0.1, 0.5)
    x, v, before = np.eye(3)
    speed, before = (x - before) / (1e-4 * n), x
    for _ in range(n):
        x, v = step(x, v, -K * x - B * speed)
    return np.array([x, v, before])


def long_delay(K, B, n):
    x, v, before, *late = np.eye(3 + n)
    late = [K * x + B * (x - before) / 1e-3, *late]
    return np.array([*plant(1e-3, 0.1)(x, v, -late[-1]), x, *late[:-1]])


FRAMES = {
    "physics-joint": physics_joint,
    "policy": policy,
    "teleoperation": teleoperation,
    "engine": engine,
    "wheel": wheel,
    "hybrid-test": hybrid_test,
    "network": network,
    "two-rate-wall": two_rate_wall,
    "long-delay": long_delay,
}


def radius(name, numbers):
    """The spectral radius of the frame at these numbers."""
    return np.abs(np.linalg.eigvals(FRAMES[name](**numbers))).max()
