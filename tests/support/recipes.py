"""The loops of sweeps/recipes once more, as plain loops over ticks: each gives the matrix of a frame.

Nothing of the package is used. A signal is a row: its dependence on the states at the beginning of the frame.
"""

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter


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


def lost_commands(kp, kd, I, n):
    """Without losses; n is how many there might be."""
    del n
    step, (x, v) = plant(1e-3, I), np.eye(2)
    return np.array(step(x, v, -kp * x - kd * v))


def late_messages(K, d, k):
    """All in time; k is how late they might be."""
    del k
    return np.array([[1 - K * 20e-3 / d]])


def random_loss(kp, kd, I, p, b, e):
    """Without losses."""
    del p, b, e
    return lost_commands(kp, kd, I, 0)


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


def cascade(h, k, T, K, J):
    step = plant(h, J)
    x, v, integral = np.eye(3)
    wanted = -K * x
    for _ in range(5):
        e = wanted - v
        integral = integral + h * e
        x, v = step(x, v, k * (e + integral / T))
    return np.array([x, v, integral])


def co_simulation(c, H, n, m):
    """Newmark's method in the form of a solver: the acceleration of the last step is a state."""
    h, own, coupling = H / n, 20 * np.pi**2, 16 * np.pi**2
    left, right = np.split(np.eye(6), 2)
    others = right[0], left[0]
    for _ in range(n):
        left = newmark(h, *left, coupling * others[0], m, c, own)
        right = newmark(h, *right, coupling * others[1], m, c, own)
    return np.array([*left, *right])


def newmark(h, x, v, a, f, m, c, k):
    ahead, faster = x + h * v + h * h / 4 * a, v + h / 2 * a
    a = (f - c * faster - k * ahead) / (m + c * h / 2 + k * h * h / 4)
    return ahead + h * h / 4 * a, faster + h / 2 * a, a


def current_loop(f, h, x, R, L):
    """The voltage of so many passes ago, and in the first part of a pass of one more."""
    whole, part = int(x), x - int(x)
    w, decay = 2 * np.pi * f, np.exp(-R / L * h * np.array([part, 1 - part]))
    i, filtered, integral, error, *voltage = np.eye(5 + whole)
    filtered = filtered + h / (1 / (4 * w) + h) * (i - filtered)
    integral = integral + h / 2 * (error - filtered)
    voltage = [w * (-L * filtered + R * integral), *voltage]
    i = decay[0] * i + (1 - decay[0]) / R * voltage[whole + 1] if part else i
    i = decay[1] * i + (1 - decay[1]) / R * voltage[whole]
    return np.array([i, filtered, integral, -filtered, *voltage[: whole + 1]])


def turning_rotor(fe, f, a, c, hz, R, L):
    """The current and the voltage as complex numbers, as the rotor sees them."""
    w, h, (i, integral, voltage) = 2 * np.pi * fe, 1 / hz, np.eye(3, dtype=complex)
    kept, pushed = expm(h * np.array([[-R / L - 1j * w, 1 / L], [0, -1j * w]]))[0]
    integral = integral - h * i
    asked = 2 * np.pi * f * (R * integral - L * i) + 1j * c * w * L * i
    return np.array([kept * i + pushed * np.exp(1j * (a - 1) * w * h) * voltage, integral, asked])


def in_stator(flux, voltage, angle, w, h, R, Ld, Lq, steps=60):
    """The flux linkage `(2, ...)` of a salient rotor that turns, a pass h later, in the frame of the stator; by Runge-Kutta."""

    def rate(flux, t):
        turned = np.array([[np.cos(angle + w * t), -np.sin(angle + w * t)], [np.sin(angle + w * t), np.cos(angle + w * t)]])
        return voltage - R * (turned @ (np.diag([1 / Ld, 1 / Lq]) @ (turned.T @ flux)))

    s = h / steps
    for t in s * np.arange(steps):
        first = rate(flux, t)
        second = rate(flux + s / 2 * first, t + s / 2)
        third = rate(flux + s / 2 * second, t + s / 2)
        flux = flux + s / 6 * (first + 2 * second + 2 * third + rate(flux + s * third, t + s))
    return flux


def salient_rotor(fe, f, t, c, hz, R, Ld, Lq):
    """Currents, integrals and voltages as the rotor sees them; what is between two passes is marched as the stator sees it."""
    w, h, n = 2 * np.pi * fe, 1 / hz, np.eye(6)
    L = np.diag([Ld, Lq])
    own, cross = t * L + (1 - t) * (Ld + Lq) / 2 * np.eye(2), np.array([[0, -1], [1, 0]])
    current, integral, late = n[:2], n[2:4], n[4:]
    integral = integral - h * current
    asked = 2 * np.pi * f * (R * integral - own @ current) + c * w * cross @ own @ current
    ahead, back = (np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]]) for a in (w * h / 2, -w * h))
    flux = in_stator(L @ current, ahead @ late, 0.0, w, h, R, Ld, Lq)
    return np.concatenate([np.linalg.inv(L) @ back @ flux, integral, asked])


def decimation(kp, kd, d, I, h, n):
    x, v = np.eye(2)
    torque = -kp * x - kd * v
    for _ in range(n):
        v = (v + h / I * torque) / (1 + h / I * d)
        x = x + h * v
    return np.array([x, v])


def batch_reactor(h, n):
    A = [
        [1.38, -0.2077, 6.715, -5.676],
        [-0.5814, -4.29, 0, 0.675],
        [1.067, 4.273, -6.654, 5.893],
        [0.048, 4.273, 1.343, -2.104],
    ]
    B, C = np.array([[0, 0], [5.679, 0], [1.136, -3.146], [1.136, 0]]), np.array([[1, 0, 1, -1], [0, 1, 0, 0]])
    F = np.zeros((8, 8))  # reactor, integrals of the controller, outputs as they were sent
    F[:4, :4], F[:4, 4:6], F[:4, 6:] = A, B @ [[-2, 0], [0, 8]], B @ [[0, -2], [5, 0]]
    F[4:6, 6:] = [[0, 1], [1, 0]]
    step, frame = expm(F * h), np.eye(8)
    for sent in ([0], [1]) if n == 2 else ([0, 1],):
        message = np.eye(8)
        message[6:][sent] = np.pad(C, ((0, 0), (0, 4)))[sent]
        frame = step @ message @ frame
    return frame


def admittance(D, M, K, tau, T):
    h = 0.002
    whole, part = int(tau / h + 1e-9), tau / h - int(tau / h + 1e-9)
    F = np.array([[0, 1, 0], [0, -1 / T, 1 / T], [0, 0, 0]])  # position, speed of the arm, speed that it is sent
    x, v, speed, acceleration, *sent = np.eye(5 + whole)
    before, acceleration = acceleration, (-K * x - D * speed) / M
    speed = speed + h / 2 * (acceleration + before)
    sent = [speed, *sent]
    for late, share in ((whole + 1, part), (whole, 1 - part)):
        if share > 1e-9:
            x, v, _ = expm(F * h * share) @ [x, v, sent[late]]
    return np.array([x, v, speed, acceleration, *sent[: whole + 1]])


def notch(k, f, q, depth, T):
    """The filter as the program of the thread has it: its last two inputs and outputs are states."""
    h = 1 / 400
    w = 2 * np.pi * f * h
    alpha = np.sin(w) / (2 * q)
    E = expm(h * np.array([[0, 1, 0], [0, -1 / T, 1 / T], [0, 0, 0]]))
    x, v, in1, in2, out1, out2, late = np.eye(7)
    out = ((1 + alpha * depth) * x - 2 * np.cos(w) * in1 + (1 - alpha * depth) * in2) / (1 + alpha)
    out = out - (-2 * np.cos(w) * out1 + (1 - alpha) * out2) / (1 + alpha)
    ahead, faster, _ = E @ [x, v, late]
    return np.array([ahead, faster, x, in1, out, out1, -k * out])


def engine_rates(n, N, I, kp, kd):
    x, v = np.eye(2)
    h, torque = n / 300, 0
    for t in range(np.lcm(n, N)):
        if t % N == 0:
            torque = -kp * x - kd * v
        if t % n == 0:
            v = v + h / I * torque
            x = x + h * v
    return np.array([x, v])


def exposure(T, g, n):
    """The images on their way are averages over cycles in which the mount moved evenly."""
    x, *images = np.eye(n + 2)
    u = -g * images[n]
    return np.array([x + T * u, x + T * u / 2, *images[:n]])


def late_camera(g, n, s, l, c, m, k, T):
    """All pictures get through; c is how many might not. Where the observer believes the robot to be is one number, and late
    pictures are moved by what it believes to have happened since.
    """
    del c
    F = np.array([[0, 1, 0, 0], [0, 0, 0, 1 / m], [50, 0, 0, 0], [0, 0, 0, 0]])  # place, speed, mean place, force
    step, decay = expm(1e-3 * F), np.exp(-0.02 / T)
    x, v, mean, believed, speed, *late = np.eye(5 + n)
    command, late = -g * believed, [mean, *late]
    believed = believed + l * (late[n] - believed) + s * 0.02 * speed
    late = [each + s * 0.02 * speed for each in late[:n]]
    speed, mean = decay * speed + (1 - decay) * command, 0 * mean
    for _ in range(20):
        x, v, mean, _ = step @ [x, v, mean, k * (command - v)]
    return np.array([x, v, mean, believed, speed, *late])


def quadrotor(J, Tm, f, kr, ka, kv, kx, n):
    F = np.zeros((6, 6))  # place, speed, pitch, its rate, torque, torque that is asked for
    F[0, 1] = F[2, 3] = 1
    F[1, 1], F[1, 2], F[3, 4], F[4, 4], F[4, 5] = -0.2, 9.81, 1 / J, -1 / Tm, 1 / Tm
    step, (b, a) = expm(1e-3 * F), butter(2, f, fs=1000)
    x, v, pitch, w, torque, first, second, before, *late = np.eye(8 + n)
    for t in range(20):
        if t == 0:
            seen, late = [x, *late][n], [x, *late][:n]
            lean, before = kv / 9.81 * (-kx * seen - (seen - before) / 0.02), seen
        if t % 4 == 0:
            attitude = ka * (lean - pitch)
        gyro = b[0] * w + first
        first, second = b[1] * w - a[1] * gyro + second, b[2] * w - a[2] * gyro
        x, v, pitch, w, torque, _ = step @ [x, v, pitch, w, torque, kr * (attitude - gyro)]
    return np.array([x, v, pitch, w, torque, first, second, before, *late])


def two_axes(l1, l2, I1, I2, d, q1, q2, phi, kh, bh, n, K, B):
    """In coordinates of the hand: along the normal and beside it, where the mass is a matrix."""
    turned = np.array([[np.cos(phi), np.sin(phi)], [-np.sin(phi), np.cos(phi)]])
    J = turned @ [[-l1 * np.sin(q1), -l2 * np.sin(q2)], [l1 * np.cos(q1), l2 * np.cos(q2)]]
    W = J @ np.diag([1 / I1, 1 / I2]) @ J.T
    F = np.zeros((5, 5))  # depth, place beside, their speeds, force of the wall
    F[:2, 2:4], F[2:4, :2] = np.eye(2), -kh * W
    F[2:4, 2:4], F[2:4, 4] = -J @ np.diag([d / I1, d / I2]) @ np.linalg.inv(J) - bh * W, -W[:, 0]
    step = np.linalg.matrix_power(expm(1e-3 * F), n)
    depth, beside, speed, slip, before = np.eye(5)
    force = K * depth + B * (depth - before) / (1e-3 * n)
    frame = np.array([*(step @ [depth, beside, speed, slip, force])[:4], depth])
    return frame if kh else np.delete(np.delete(frame, 1, 0), 1, 1)  # else nothing holds the place beside


FRAMES = {
    "late-messages": late_messages,
    "lost-commands": lost_commands,
    "random-loss": random_loss,
    "physics-joint": physics_joint,
    "policy": policy,
    "teleoperation": teleoperation,
    "engine": engine,
    "wheel": wheel,
    "hybrid-test": hybrid_test,
    "network": network,
    "two-rate-wall": two_rate_wall,
    "long-delay": long_delay,
    "cascade": cascade,
    "co-simulation": co_simulation,
    "current-loop": current_loop,
    "turning-rotor": turning_rotor,
    "salient-rotor": salient_rotor,
    "decimation": decimation,
    "batch-reactor": batch_reactor,
    "admittance": admittance,
    "notch": notch,
    "engine-rates": engine_rates,
    "exposure": exposure,
    "late-camera": late_camera,
    "quadrotor": quadrotor,
    "two-axes": two_axes,
}


def radius(name, numbers):
    """The spectral radius of the frame at these numbers."""
    return np.abs(np.linalg.eigvals(FRAMES[name](**numbers))).max()
