"""The loop of the model at 50 digits, tick by tick from its equations: a witness that shares no code with the package.

Every signal of a tick is a linear form in the state before the tick, the hand's force, the wall's force and the wave
v_m that closes the algebraic loop; the form of v_m is solved for itself and put into all others. `march` runs the ticks in
doubles, one after the other.
"""

from collections import defaultdict
from dataclasses import dataclass

import mpmath
import numpy as np

mp = mpmath.mp.clone()
mp.dps = 50


def number(value):
    """The double `value`, exactly."""
    return mp.mpf(value)


def zero_order_hold(values, T):
    """`(x, v)+ = F (x, v) + G f` of the device with the hand on it, by the matrix exponential."""
    m = number(values["device.mass"]) + number(values["operator.mass"])
    d = number(values["device.damping"]) + number(values["operator.damping"])
    k = number(values["operator.stiffness"])
    whole = mp.expm(mp.matrix([[0, T, 0], [-k / m * T, -d / m * T, T / m], [0, 0, 0]]), method="taylor")
    return [[whole[i, j] for j in range(2)] for i in range(2)], [whole[i, 2] for i in range(2)]


def butterworth_sections(order, cutoff_hz, T, highpass):
    """Coefficients (b0, b1, b2, a1, a2) of the sections: analog prototype, prewarping, bilinear transform."""
    warped = mp.tan(mp.pi * number(cutoff_hz) * T)
    zero, sections = (1 if highpass else -1), []
    for k in range(1, order // 2 + 1):
        s = warped * mp.expjpi(mp.mpf(2 * k + order - 1) / (2 * order))
        z = (1 + s) / (1 - s)
        a1, a2 = -2 * z.real, abs(z) ** 2
        gain = (1 - a1 + a2) / 4 if highpass else (1 + a1 + a2) / 4
        sections.append((gain, -2 * zero * gain, gain, a1, a2))
    if order % 2:
        z = (1 - warped) / (1 + warped)
        gain = (1 + z) / 2 if highpass else (1 - z) / 2
        sections.append((gain, -zero * gain, mp.mpf(0), -z, mp.mpf(0)))
    return sections


def filter_response(order, cutoff_hz, T, highpass, z):
    """The filter's transfer function at z."""
    out = mp.mpf(1)
    for b0, b1, b2, a1, a2 in butterworth_sections(order, cutoff_hz, T, highpass):
        out *= (b0 + b1 / z + b2 / z**2) / (1 + a1 / z + a2 / z**2)
    return out


@dataclass(frozen=True)
class Tick:
    """One tick: next state and signals as matrices over (state, f_h, F_s); the wall reads x_tilde and x_dot."""

    step: np.ndarray
    seen: dict[str, np.ndarray]
    x_tilde: np.ndarray | None
    x_dot: np.ndarray | None


class Sheet:
    """The signals of one tick as linear forms, written down in the order of the model's equations."""

    def __init__(self, names, closing):
        self.names = names
        self.size = len(names) + 3
        self.now = {name: self.unit(i) for i, name in enumerate(names)}
        self.after = dict(self.now)
        self.f_h, self.F, self.loop = (self.unit(len(names) + i) for i in range(3))
        self.closing, self.seen = closing, {}

    def unit(self, index):
        """The form that is one variable."""
        form = np.array([mp.mpf(0)] * self.size, dtype=object)
        form[index] = mp.mpf(1)
        return form

    def filter(self, name, sections, u):
        """Run `u` through second-order sections in transposed direct form."""
        for k, (b0, b1, b2, a1, a2) in enumerate(sections):
            y = u * b0 + self.now[f"{name}{k}a"]
            self.after[f"{name}{k}a"] = u * b1 - y * a1 + self.now[f"{name}{k}b"]
            self.after[f"{name}{k}b"] = u * b2 - y * a2
            u = y
        return u

    def closed(self, v_m):
        """A function that puts the solution of `loop = v_m` into a form, and drops the loop's column."""
        value = v_m / (1 - v_m[-1])

        def put(form):
            return (form + value * form[-1])[:-1] if form is not None else None

        return put


def tick(values, phase):
    """The tick at `phase` of the frame, from the model's equations."""
    kind = values["controller.kind"]
    T = 1 / number(values["rates.fast_hz"])
    ratio = 1 if kind == "dc" else values["rates.ratio"]
    D = 0 if kind == "dc" else values["environment.delay"]
    waves = kind.startswith("pmw")
    sections = {}
    for name in {"pmw": ("lp1",), "pmw-lm": ("lp1", "hp", "lp2")}.get(kind, ()):
        order, cutoff = values[f"filters.{name}.order"], values[f"filters.{name}.cutoff_hz"]
        sections[name] = butterworth_sections(order, cutoff, T, name == "hp")
    memory = [f"{name}{k}{part}" for name in sections for k in range(len(sections[name])) for part in "ab"]
    slow = ["x_s", "x_dot", "v_1", "x_bar", "v_next", "x_next"] + (["x_l", "x_dot_l", "v_2"] if kind == "pmw-lm" else [])
    direct = ["F", "x_ref", "v_ref", "F_next", "x_ref_next", "v_ref_next"]
    encoder = ["x_before"] if values["device.velocity"] == "difference" else []
    sheet = Sheet(["x", "v", *encoder, *(memory + slow if waves else direct)], waves)
    now, after = sheet.now, sheet.after
    v_hat = now["v"] if values["device.velocity"] == "exact" else (now["x"] - now["x_before"]) / T
    controller = wave_controller if waves else direct_controller
    f_m, v_m, read = controller(sheet, values, sections, (phase, ratio, D, T), v_hat)
    flow, push = zero_order_hold(values, T)
    f = sheet.f_h - f_m
    after["x"] = now["x"] * flow[0][0] + now["v"] * flow[0][1] + f * push[0]
    after["v"] = now["x"] * flow[1][0] + now["v"] * flow[1][1] + f * push[1]
    after["x_before"] = now["x"]
    put = sheet.closed(v_m)
    seen = {**sheet.seen, "x": now["x"], "v": now["v"], "v_hat": v_hat, "f_m": f_m}
    step = np.array([put(after[name]) for name in sheet.names])
    return Tick(step, {name: put(form) for name, form in seen.items()}, *(put(r) for r in read))


def direct_controller(sheet, values, _sections, clock, v_hat):
    """`dc`, `dc-slow` and `dc-lm`: what the wall reads is sampled, what it answers is held."""
    phase, ratio, D, _ = clock
    now, after = sheet.now, sheet.after
    held, read = [now["F"], now["x_ref"], now["v_ref"]], (None, None)
    waiting = [now["F_next"], now["x_ref_next"], now["v_ref_next"]]
    if phase == D % ratio and D > 0:
        held = waiting
    if phase == 0:
        read, sheet.seen["F_s"] = (now["x"], v_hat), sheet.F
        waiting = [sheet.F, *read]
        held = waiting if D == 0 else held
    for names, forms in ((("F", "x_ref", "v_ref"), held), (("F_next", "x_ref_next", "v_ref_next"), waiting)):
        after.update(zip(names, forms, strict=True))
    f_m = held[0]
    if values["controller.kind"] == "dc-lm":
        f_m = f_m + (now["x"] - held[1]) * number(values["local_model.K_LM"])
        f_m = f_m + (v_hat - held[2]) * number(values["local_model.B_LM"])
    return f_m, sheet.loop * 0, read


def wave_controller(sheet, values, sections, clock, v_hat):
    """`pmw` and `pmw-lm`: encoder, LP1, avatar, held pair, local model."""
    phase, ratio, D, T = clock
    now, after = sheet.now, sheet.after
    b, Kp = number(values["controller.b"]), number(values["controller.Kp"])
    root = mp.sqrt(2 * b)
    v_m = sheet.loop
    u_m = v_hat * root - v_m
    u_s = sheet.filter("lp1", sections["lp1"], u_m)
    held, waiting, read = [now["v_1"], now["x_bar"]], [now["v_next"], now["x_next"]], (None, None)
    if phase == D % ratio and D > 0:
        held = waiting
    if phase == 0:
        x_dot = (u_s * root - sheet.F) / b
        x_tilde, x_s = integrate(values["environment.integration"], now["x_s"], now["x_dot"], x_dot, ratio * T)
        after["x_s"], after["x_dot"], read = x_s, x_dot, (x_tilde, x_dot)
        waiting = [u_s - sheet.F * mp.sqrt(2 / b), x_s]
        sheet.seen |= {"u_s": u_s, "v_s": waiting[0], "x_s": x_s, "x_dot_s": x_dot, "F_s": sheet.F}
        held = waiting if D == 0 else held
    after["v_1"], after["x_bar"] = held
    after["v_next"], after["x_next"] = waiting
    total = held[0] + (held[1] - now["x"]) * Kp
    if values["controller.kind"] == "pmw-lm":
        y = local_branch(sheet, values, sections, u_m, (b, root, T))
        v_2 = now["v_2"] if values["local_model.delay"] else y
        total, after["v_2"], sheet.seen["v_2"] = total + v_2, y, v_2
    sheet.seen |= {"u_m": u_m, "v_m": v_m}
    return v_hat * b - v_m * root, total, read


def integrate(integration, x, x_dot_before, x_dot, period):
    """(displacement that the spring sees, next position)."""
    if integration == "explicit":
        return x, x + x_dot * period
    step = x_dot if integration == "implicit" else (x_dot + x_dot_before) / 2
    return x + step * period, x + step * period


def local_branch(sheet, values, sections, u_m, constants):
    """`u_h = HP(u_m)`, the local model with `F_l = K_LM x~ + B_LM x_dot`, `y = LP2(v_l)`."""
    b, root, T = constants
    K, B = number(values["local_model.K_LM"]), number(values["local_model.B_LM"])
    now, after = sheet.now, sheet.after
    u_h = sheet.filter("hp", sections["hp"], u_m)
    integration, x_l, before = values["local_model.integration"], now["x_l"], now["x_dot_l"]
    share = {"explicit": 0, "implicit": T, "trapezoidal": T / 2}[integration]
    at_rest, _ = integrate(integration, x_l, before, before * 0, T)  # x~ = at_rest + share * x_dot
    x_dot = (u_h * root - at_rest * K) / (b + B + K * share)
    x_tilde, after["x_l"] = integrate(integration, x_l, before, x_dot, T)
    after["x_dot_l"] = x_dot
    v_l = u_h - (x_tilde * K + x_dot * B) * mp.sqrt(2 / b)
    sheet.seen |= {"u_h": u_h, "v_l": v_l}
    return sheet.filter("lp2", sections["lp2"], v_l)


def power(A, n):
    """`A^n` of an object array."""
    out = np.array([[mp.mpf(i == j) for j in range(len(A))] for i in range(len(A))], dtype=object)
    while n:
        out, A, n = (out @ A if n & 1 else out), (A @ A if n > 1 else A), n >> 1
    return out


@dataclass(frozen=True)
class Frame:
    """The loop cut at the wall over a frame: `s+ = A s + B F`, `x_tilde = c_x s + d_x F`, `x_dot = c_v s + d_v F`."""

    A: np.ndarray
    B: np.ndarray
    x: np.ndarray
    v: np.ndarray
    ticks: tuple
    period: object

    def closed(self, K, B):
        """Frame-to-frame matrix with the wall in place, as an mpmath matrix."""
        return mp.matrix((self.A + np.outer(self.B, self.wall(K, B))).tolist())

    def wall(self, K, B):
        """`F = row s`."""
        read = self.x * number(K) + self.v * number(B)
        return read[:-1] / (1 - read[-1])

    def transfer(self, z):
        """(G_x, G_v) at z."""
        n = len(self.B)
        state = mp.lu_solve(mp.matrix((np.diag([z] * n) - self.A).tolist()), mp.matrix(self.B.tolist()))
        state = np.array([*state, mp.mpf(1)], dtype=object)
        return self.x @ state, self.v @ state

    def value_at(self, theta, along, fixed):
        """The wall parameter (complex; real on the stability boundary) at `z = exp(j theta)`."""
        G_x, G_v = self.transfer(mp.expj(theta))
        solved, other = (G_x, G_v) if along == "K_VE" else (G_v, G_x)
        return (1 - number(fixed) * other) / solved


def frame(values):
    """Multiply the ticks of a frame, with the wall's force as an input."""
    kind = values["controller.kind"]
    ratio, D = (1, 0) if kind == "dc" else (values["rates.ratio"], values["environment.delay"])
    usual = next((i for i in range(1, ratio) if i != D), 0)
    first, plain, latching = (tick(values, phase) for phase in (0, usual, D % ratio))
    ticks = tuple(first if i == 0 else latching if i == D else plain for i in range(ratio))
    n = len(first.step)
    rest = power(plain.step[:, :n], ratio - 1)
    if 0 < D < ratio:
        rest = power(plain.step[:, :n], ratio - 1 - D) @ latching.step[:, :n] @ power(plain.step[:, :n], D - 1)
    whole = rest @ first.step
    keep = [*range(n), n + 1]
    period = ratio / number(values["rates.fast_hz"])
    return Frame(whole[:, :n], whole[:, n + 1], first.x_tilde[keep], first.x_dot[keep], ticks, period)


def spectral_radius(values, drift=1e-15):
    """The largest eigenvalue of a frame but for those at 1 (to `drift`, which half the digits of a double one are)."""
    whole = frame(values).closed(values["environment.K_VE"], values["environment.B_VE"])
    # Moved away from 0, where pure delays put several: QR would wait for ever for entries small beside zeros.
    for away in (2, 3, 1.5):
        try:
            eigenvalues = mp.eig(whole + away * mp.eye(whole.rows), left=False, right=False)
        except RuntimeError:  # QR does not converge: another distance from 0
            continue
        return max(abs(z - away) for z in eigenvalues if abs(z - away - 1) > drift)
    raise RuntimeError("no distance from 0 lets QR converge")


def response(values, frequency_hz, whole):
    """(admittance, impedance) at the hand's own frequency: the steady state under `exp(j w k T)`, and its component.

    whole: `frame(values)`, which many frequencies share.
    """
    K, B = values["environment.K_VE"], values["environment.B_VE"]
    n, M = len(whole.B), len(whole.ticks)
    turn = mp.expj(2 * mp.pi * mp.mpf(frequency_hz) / number(values["rates.fast_hz"]))
    state = np.array([mp.mpf(0)] * n, dtype=object)
    driven, _, _ = run(whole, K, B, state, turn)
    A = whole.closed(K, B)
    start = mp.lu_solve(mp.eye(n) * turn**M - A, mp.matrix(driven.tolist()))
    _, x, f_m = run(whole, K, B, np.array(list(start), dtype=object), turn)
    return x, f_m / x


def run(whole, K, B, state, turn):
    """March a frame under `turn^i`: the state after it, and the means of `x` and `f_m` times `turn^-i`."""
    read = whole.ticks[0].x_tilde * number(K) + whole.ticks[0].x_dot * number(B)
    x = f_m = mp.mpc(0)
    F, f = mp.mpf(0), mp.mpc(1)
    for i, t in enumerate(whole.ticks):
        if i == 0:
            known = np.array([*state, f, mp.mpf(0)], dtype=object)
            F = (read @ known) / (1 - read[-1])
        known = np.array([*state, f, F], dtype=object)
        x, f_m = x + (t.seen["x"] @ known) / f, f_m + (t.seen["f_m"] @ known) / f
        state, f = t.step @ known, f * turn
    M = len(whole.ticks)
    return state, x / M, f_m / M


def limit(values, frequency_hz, whole, step=1e-14):
    """`response` at a frequency where the formula is 0/0: the mean of both sides, whose error is of order step^2."""
    sides = [mp.mpf(frequency_hz) * (1 + sign * mp.mpf(step)) for sign in (-1, 1)]
    pairs = [response(values, side, whole) for side in sides]
    return tuple((left + right) / 2 for left, right in zip(*pairs, strict=True))


SLOW = ("u_s", "v_s", "x_s", "x_dot_s", "F_s")  # signals with a number per frame


def march(values, force):
    """The signals from rest under the hand's force (N, a number per tick): name -> array, with a number per tick or frame."""
    ticks = frame(values).ticks
    doubles = {id(t): [t.step.astype(float), np.array([*t.seen.values()]).astype(float), [*t.seen]] for t in ticks}
    read = ticks[0].x_tilde * values["environment.K_VE"] + ticks[0].x_dot * values["environment.B_VE"]
    read, found = (read[:-1] / (1 - read[-1])).astype(float), defaultdict(list)
    known = np.zeros(len(read) + 1)
    for k, f_h in enumerate(force):
        known[-2] = f_h
        if k % len(ticks) == 0:
            known[-1] = read @ known[:-1]
        step, rows, names = doubles[id(ticks[k % len(ticks)])]
        for name, number in zip(names, (rows @ known).tolist(), strict=True):
            found[name].append(number)
        known[:-2] = step @ known
    return {name: np.array(numbers) for name, numbers in found.items()}
