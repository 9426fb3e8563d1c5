"""The loop of the model in ball arithmetic (python-flint): every number with a proved bound on its error.

Written down from the model's equations tick by tick, and shares no code with the package. What it gives is the characteristic
polynomial `d - K_VE N_x - B_VE N_v` of a frame, which is linear in the wall.
"""

from dataclasses import dataclass
from fractions import Fraction
from math import ceil

from flint import acb, acb_mat, arb, arb_mat

SHARE = {"explicit": 0, "implicit": 1, "trapezoidal": arb(1) / 2}  # of the new step in the spring's displacement


@dataclass(frozen=True)
class Frame:
    """The loop cut at the wall: `s+ = A s + B F`, and rows over (s, F) of what the wall reads."""

    A: arb_mat
    B: arb_mat
    x: arb_mat
    v: arb_mat
    size: int

    def trace(self, K, B):
        """(numerator, denominator) of the sum of the closed loop's eigenvalues."""
        through, total = arb(1), arb(0)
        for gain, row in ((arb(K), self.x), (arb(B), self.v)):
            through -= gain * row[0, self.size]
            total += gain * (_columns(row, 0, self.size) * self.B)[0, 0]
        return self.A.trace() * through + total, through

    def polynomials(self):
        """(d, N_x, N_v), in z."""
        d, rows = self.A.charpoly(), (self.x, self.v)
        return d, *((self.A - self.B * _columns(row, 0, self.size)).charpoly() - d + d * row[0, self.size] for row in rows)


class Forms:
    """Signals of a tick as linear forms (rows) in the states, the forces of the wall and of the hand, and the wave that
    closes the tick's loop."""

    def __init__(self, names):
        self.size = len(names) + 3
        self.names = names
        self.now = {name: self.unit(i) for i, name in enumerate(names)}
        self.after, self.seen = {}, {}
        self.force, self.hand, self.wave = (self.unit(len(names) + i) for i in range(3))

    def unit(self, index=None):
        """The form that is one variable, or zero."""
        return arb_mat(1, self.size, [int(i == index) for i in range(self.size)])

    def run(self, name, sections, u):
        """A filter's sections, `y = b0 u + p`, `p+ = b1 u - a1 y + q`, `q+ = b2 u - a2 y`."""
        for k, (b0, b1, b2, a1, a2) in enumerate(sections):
            p, q = f"{name}.p{k}", f"{name}.q{k}"
            y = u * b0 + self.now[p]
            self.after[p] = u * b1 - y * a1 + self.now.get(q, self.unit())
            if q in self.now:
                self.after[q] = u * b2 - y * a2
            u = y
        return u


def butterworth(order, cutoff_hz, T, highpass):
    """Sections (b0, b1, b2, a1, a2) with unit gain at DC, or at half the rate."""
    w, found = (arb.pi() * arb(cutoff_hz) * T).tan(), []
    far = -1 if highpass else 1  # 1 + far z^-1 is the zero of every pole
    for k in range(order // 2):
        cosine = (arb.pi() * (2 * k + 1) / (2 * order)).sin()  # poles w exp(+-j(pi/2 + angle))
        bottom = 1 + 2 * cosine * w + w * w
        gain = (1 if highpass else w * w) / bottom
        found.append((gain, 2 * far * gain, gain, 2 * (w * w - 1) / bottom, (1 - 2 * cosine * w + w * w) / bottom))
    if order % 2:
        gain = (1 if highpass else w) / (1 + w)
        found.append((gain, far * gain, None, (w - 1) / (w + 1), None))
    return found


def device(values, T):
    """Rows of `(x, v)+` over `(x, v, f)`, in closed form: exponentials of large matrices have no useful bound."""
    m, d, k = (
        arb(values[f"device.{a}"]) + arb(values[f"operator.{a}"]) if a != "stiffness" else arb(values["operator.stiffness"])
        for a in ("mass", "damping", "stiffness")
    )
    if k == 0 and d == 0:
        return (1, T, T * T / (2 * m)), (0, 1, T / m)
    if k == 0:
        gone = -(-d * T / m).expm1()
        return (1, gone * m / d, (T - gone * m / d) / d), (0, 1 - gone, gone / d)
    sigma = d / (2 * m)
    square = sigma * sigma - k / m
    if square < 0:
        root = (-square).sqrt()
        shrink = (-sigma * T).exp()
        c, h = shrink * (root * T).cos(), shrink * (root * T).sin() / root
    else:
        root = square.sqrt()
        slow, quick = ((root - sigma) * T).exp(), (-(root + sigma) * T).exp()
        c, h = (slow + quick) / 2, (slow - quick) / (2 * root)
    rest = c + sigma * h
    return (rest, h, (1 - rest) / k), (-k / m * h, c - sigma * h, h / m)


@dataclass(frozen=True)
class Tick:
    """One tick over (states, wall's force, hand's force): the next states, and rows of signals."""

    step: arb_mat
    x: arb_mat
    f_m: arb_mat
    x_tilde: arb_mat
    x_dot: arb_mat
    seen: dict[str, arb_mat]

    @property
    def size(self):
        """Number of states."""
        return self.step.nrows()


def clock(values):
    """(ratio, delay, T) of the loop as it runs."""
    alone = values["controller.kind"] == "dc"
    ratio, delay = (1, 0) if alone else (values["rates.ratio"], values["environment.delay"])
    return ratio, delay, 1 / arb(values["rates.fast_hz"])


def tick(values, phase) -> Tick:
    """The tick at `phase` of the frame."""
    ratio, delay, T = clock(values)
    sections = _sections(values, T)
    forms = Forms(_states(values, sections, delay))
    kind = values["controller.kind"]
    draw = _waves if kind.startswith("pmw") else _coupled if "-vc" in kind else _direct
    f_m, v_m, x_tilde, x_dot = draw(forms, values, sections, (phase, ratio, delay, T))
    f_m = _late(forms, values, f_m)
    put = _closer(forms, v_m)
    seen = {name: put(form) for name, form in {**forms.seen, "x": forms.now["x"], "v": forms.now["v"], "f_m": f_m}.items()}
    step = _step(forms, values, seen["f_m"], T, put)
    return Tick(step, seen["x"], seen["f_m"], put(x_tilde), put(x_dot), seen)


def _late(forms, values, f_m):
    """The force of motors whose amplifier is late."""
    names = _amplifier(values)
    forms.after |= dict(zip(names, [f_m, *(forms.now[name] for name in names)], strict=False))
    return forms.now[names[-1]] if names else f_m


def _lateness(values):
    """The ticks after which the force of the motors has arrived, and the share of the last one in which it acts already."""
    late = Fraction(values.get("device.dead_time", 0.0)).limit_denominator(10**9) * round(values["rates.fast_hz"])
    late += values.get("device.delay", 0)
    return ceil(late), ceil(late) - late


def _amplifier(values):
    return [f"f_m of {i} ticks ago" for i in range(1, _lateness(values)[0] + 1)]


def frame(values) -> Frame:
    """Multiply the ticks of a frame; its precision is `flint.ctx.prec` bits."""
    ratio, delay, _ = clock(values)
    first = tick(values, 0)
    n, whole = first.size, first.step
    for phase, times in runs(ratio, delay):
        whole = _columns(tick(values, phase).step, 0, n) ** times * whole
    read = (_columns(row, 0, n + 1) for row in (first.x_tilde, first.x_dot))
    return Frame(_columns(whole, 0, n), _columns(whole, n, n + 1), *read, n)


def runs(ratio, delay):
    """(phase, how often) of the ticks after the first, in order."""
    usual = next((i for i in range(1, ratio) if i != delay), 0)
    if not 0 < delay < ratio:
        return [(usual, ratio - 1)] if ratio > 1 else []
    runs = [(usual, delay - 1), (delay, 1), (usual, ratio - 1 - delay)]
    return [(phase, times) for phase, times in runs if times]


def _columns(matrix, start, stop):
    return arb_mat([row[start:stop] for row in matrix.tolist()])


def _closer(forms, v_m):
    """A function that puts the solution of `wave = v_m` into a form and drops that column."""
    n = forms.size - 1
    loop = v_m * (1 / (1 - v_m[0, n])) if v_m is not None else forms.unit()
    return lambda form: _columns(form + loop * form[0, n], 0, n)


def _step(forms, values, f_m, T, put):
    """The states after the tick, a row each, over the states and both forces."""
    now, hand = [put(forms.now[name]) for name in ("x", "v")], put(forms.hand)
    after = {name: put(form) for name, form in forms.after.items()}
    (_, share), names, moved = _lateness(values), _amplifier(values), now
    early = T * share.numerator / share.denominator  # the time in which the force of the next tick acts already
    for part, force in ((T - early, f_m), *([(early, after[names[-1]])] if share else ())):
        moved = [moved[0] * of_x + moved[1] * of_v + (hand - force) * of_f for of_x, of_v, of_f in device(values, part)]
    after |= {"x": moved[0], "v": moved[1], "x_before": now[0]}
    return arb_mat([after[name].tolist()[0] for name in forms.names])


def _sections(values, T):
    used = {"pmw": ("lp1",), "pmw-lm": ("lp1", "hp", "lp2")}.get(values["controller.kind"], ())
    return {
        name: butterworth(values[f"filters.{name}.order"], values[f"filters.{name}.cutoff_hz"], T, name == "hp")
        for name in used
    }


def _states(values, sections, delay):
    """Names of what a tick remembers."""
    kind = values["controller.kind"]
    names = ["x", "v"] + (["x_before"] if values["device.velocity"] == "difference" else [])
    for name, parts in sections.items():
        for k, part in enumerate(parts):
            names += [f"{name}.p{k}"] + ([f"{name}.q{k}"] if part[2] is not None else [])
    held = {"dc": [], "dc-slow": ["F"], "dc-lm": ["F", "x_ref", "v_ref"], "dc-vc": ["x_bar", "v_bar"]}
    held = held.get(kind, ["x_bar", "v_bar", "F"] if kind == "dc-vc-lm" else ["v_1", "x_bar"])
    names += held + ([f"{name}.next" for name in held] if delay else [])
    if kind.startswith(("pmw", "dc-vc")):
        names += ["x_s", "x_dot"]
    if kind == "dc-vc-lm":
        names += ["x_l", "x_dot_l"]
    if kind == "pmw-mean":
        names += ["sum"]
    if kind == "pmw-lm":
        names += ["x_l", "x_dot_l"] + (["v_2"] if values["local_model.delay"] else [])
    return names + _amplifier(values)


def _velocity(forms, values, T):
    exact = values["device.velocity"] == "exact"
    forms.seen["v_hat"] = forms.now["v"] if exact else (forms.now["x"] - forms.now["x_before"]) * (1 / T)
    return forms.seen["v_hat"]


def _hold(forms, fresh, phase, ratio, delay):
    """What the held signals show in this tick; fresh: their new values at phase 0, by name."""
    shown = {}
    for name, value in fresh.items():
        waiting = forms.now.get(f"{name}.next")
        shown[name] = waiting if delay and phase == delay % ratio else forms.now[name]
        if phase == 0:
            waiting = value
            shown[name] = value if delay == 0 else shown[name]
        forms.after[name] = shown[name]
        if delay:
            forms.after[f"{name}.next"] = waiting
    return shown


def _direct(forms, values, _sections, clock):
    """`dc`, `dc-slow`, `dc-lm`: (f_m, nothing, what the wall reads)."""
    *when, T = clock
    forms.seen |= {"F_s": forms.force} if clock[0] == 0 else {}
    x, v_hat = forms.now["x"], _velocity(forms, values, T)
    if values["controller.kind"] == "dc":
        return forms.force, None, x, v_hat
    fresh = {"F": forms.force, "x_ref": x, "v_ref": v_hat}
    held = _hold(forms, {name: fresh[name] for name in fresh if name in forms.now}, *when)
    f_m = held["F"]
    if values["controller.kind"] == "dc-lm":
        f_m = f_m + (x - held["x_ref"]) * arb(values["local_model.K_LM"])
        f_m = f_m + (v_hat - held["v_ref"]) * arb(values["local_model.B_LM"])
    return f_m, None, x, v_hat


def _coupled(forms, values, _sections, clock):
    """`dc-vc`, `dc-vc-lm`: (f_m, nothing, what the wall reads)."""
    phase, ratio, delay, T = clock
    K, B, x, v_hat = arb(values["controller.K_VC"]), arb(values["controller.B_VC"]), forms.now["x"], _velocity(forms, values, T)

    def follow(position, velocity, period, integration, runs, pull, stiffness, damping):
        """The step of a massless avatar on which `pull - stiffness x~ - damping v` acts: x~, the new position, and v."""
        before = forms.now[velocity] * (period / 2) if integration == "trapezoidal" else forms.unit()
        known = forms.now[position] + before
        total = damping + stiffness * period * SHARE[integration]
        v = (pull - known * stiffness) * (1 / total)
        return *_integrate(forms, position, velocity, v, period, integration, runs), v

    pull = x * K + v_hat * B
    slow = "x_s", "x_dot", ratio * T, values["environment.integration"], phase == 0
    x_tilde, x_s, v_s = follow(*slow, pull - forms.force, K, B)
    fresh = {"x_bar": x_s, "v_bar": v_s, "F": forms.force}
    held = _hold(forms, {name: fresh[name] for name in fresh if name in forms.now}, phase, ratio, delay)
    f_m = pull - held["x_bar"] * K - held["v_bar"] * B
    if values["controller.kind"] == "dc-vc-lm":
        K_LM, B_LM = arb(values["local_model.K_LM"]), arb(values["local_model.B_LM"])
        rest = held["F"] - held["x_bar"] * K_LM - held["v_bar"] * B_LM
        fast = "x_l", "x_dot_l", T, values["local_model.integration"], True
        x_l, _, v_l = follow(*fast, pull - rest, K + K_LM, B + B_LM)
        f_m = rest + x_l * K_LM + v_l * B_LM
    forms.seen |= {"F_s": forms.force} if phase == 0 else {}
    return f_m, None, x_tilde, v_s


def _waves(forms, values, sections, clock):
    """`pmw`, `pmw-mean`, `pmw-lm`: (f_m, v_m, what the wall reads)."""
    phase, ratio, delay, T = clock
    b = arb(values["controller.b"])
    root = (2 * b).sqrt()
    v_hat, v_m = _velocity(forms, values, T), forms.wave
    u_m = v_hat * root - v_m
    if values["controller.kind"] == "pmw-mean":
        whole = forms.now["sum"] + u_m
        u_s, forms.after["sum"] = whole * (1 / arb(ratio)), whole if phase else forms.unit()
    else:
        u_s = forms.run("lp1", sections["lp1"], u_m)
    x_dot = (u_s * root - forms.force) * (1 / b)
    x_tilde, x_s = _integrate(forms, "x_s", "x_dot", x_dot, ratio * T, values["environment.integration"], phase == 0)
    v_s = u_s - forms.force * (2 / b).sqrt()
    held = _hold(forms, {"v_1": v_s, "x_bar": x_s}, phase, ratio, delay)
    total = held["v_1"] + (held["x_bar"] - forms.now["x"]) * arb(values["controller.Kp"])
    if values["controller.kind"] == "pmw-lm":
        y = _local(forms, values, sections, u_m, T)
        forms.seen["v_2"] = forms.now.get("v_2", y)
        total, forms.after["v_2"] = total + forms.seen["v_2"], y
        forms.after = {name: form for name, form in forms.after.items() if name in forms.names}
    forms.seen |= {"u_m": u_m, "v_m": v_m}
    forms.seen |= {"u_s": u_s, "v_s": v_s, "x_s": x_s, "x_dot_s": x_dot, "F_s": forms.force} if phase == 0 else {}
    return v_hat * b - v_m * root, total, x_tilde, x_dot


def _integrate(forms, position, velocity, x_dot, period, integration, runs):
    """(what the spring sees, the new position), and the memory of both."""
    x = forms.now[position]
    push = (x_dot + forms.now[velocity]) * (arb(1) / 2) if integration == "trapezoidal" else x_dot
    new = x + push * period
    forms.after[position], forms.after[velocity] = (new, x_dot) if runs else (x, forms.now[velocity])
    return (x if integration == "explicit" else new), new


def _local(forms, values, sections, u_m, T):
    """The wave that comes back from the local model, filtered."""
    b, K, B = (arb(values[key]) for key in ("controller.b", "local_model.K_LM", "local_model.B_LM"))
    integration = values["local_model.integration"]
    u_h = forms.run("hp", sections["hp"], u_m)
    x, before = forms.now["x_l"], forms.now["x_dot_l"]
    known = x + before * (T / 2) if integration == "trapezoidal" else x
    x_dot = (u_h * (2 * b).sqrt() - known * K) * (1 / (b + B + K * T * SHARE[integration]))
    x_tilde, _ = _integrate(forms, "x_l", "x_dot_l", x_dot, T, integration, True)
    forms.seen |= {"u_h": u_h, "v_l": u_h - (x_tilde * K + x_dot * B) * (2 / b).sqrt()}
    return forms.run("lp2", sections["lp2"], forms.seen["v_l"])


def response(values, frequency_hz):
    """(admittance, impedance) at the hand's own frequency, as balls: the steady state under `exp(j w k T)`, its component.

    frequency_hz: an arb; the loop has no pole there.
    """
    ratio, delay, T = clock(values)
    ticks = [(tick(values, phase), times) for phase, times in [(0, 1), *runs(ratio, delay)]]
    first = ticks[0][0]
    n = first.size
    wall = first.x_tilde * arb(values["environment.K_VE"]) + first.x_dot * arb(values["environment.B_VE"])
    wall = _columns(wall, 0, n) * (1 / (1 - wall[0, n]))
    turn = acb(0, 2 * arb.pi() * frequency_hz * T).exp()
    parts = [(_ready(t, wall if i == 0 else None), times) for i, (t, times) in enumerate(ticks)]
    A = acb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
    for (step, *_), times in parts:
        A = step**times * A
    driven, *_ = _march(parts, acb_mat(n, 1, [0] * n), turn)
    unit = acb_mat(n, n, [turn**ratio if i == j else 0 for i in range(n) for j in range(n)])
    _, x, f_m = _march(parts, (unit - A).solve(driven), turn)
    return x / ratio, f_m / x


def _ready(t, wall):
    """(states to states, hand to states, x row, f_m row) with the wall's force put in."""
    n = t.size
    states, hand = _columns(t.step, 0, n), _columns(t.step, n + 1, n + 2)
    f_m = _columns(t.f_m, 0, n)
    if wall is not None:
        states, f_m = states + _columns(t.step, n, n + 1) * wall, f_m + wall * t.f_m[0, n]
    return acb_mat(states), acb_mat(hand), acb_mat(_columns(t.x, 0, n)), acb_mat(f_m)


def _march(parts, state, turn):
    """The state after a frame, and the sums of x and f_m times turn^-i."""
    x = f_m = acb(0)
    force = acb(1)
    for (step, hand, x_row, f_row), times in parts:
        for _ in range(times):
            x, f_m = x + (x_row * state)[0, 0] / force, f_m + (f_row * state)[0, 0] / force
            state, force = step * state + hand * force, force * turn
    return state, x, f_m


def lifted(values, frequency_hz):
    """The map from the frame's hand forces to its positions under `exp(j w j T_s)`, an acb_mat, M by M also for `dc`.

    Raises ValueError where the bits do not give every entry to 18 digits of the largest.
    """
    ratio, delay, T = clock(values)
    M = values["rates.ratio"]
    first = tick(values, 0)
    n = first.size
    wall = first.x_tilde * arb(values["environment.K_VE"]) + first.x_dot * arb(values["environment.B_VE"])
    wall = _columns(wall, 0, n) * (1 / (1 - wall[0, n]))
    order = [(first, wall)] + [(tick(values, phase), None) for phase, times in runs(ratio, delay) for _ in range(times)]
    ticks = [_ready(*part) for part in (order if ratio == M else order * M)]
    state = acb_mat(n, n, [int(i == j) for i in range(n) for j in range(n)])
    forces, rows, direct = [], [], []
    for step, hand, x_row, _ in ticks:
        rows.append(x_row * state)
        direct.append([(x_row * force)[0, 0] for force in forces])
        state, forces = step * state, [step * force for force in forces] + [hand]
    turn = acb(0, 2 * arb.pi() * frequency_hz * T * M).exp()
    unit = acb_mat(n, n, [turn if i == j else 0 for i in range(n) for j in range(n)])
    reply = (unit - state).solve(acb_mat([[force[k, 0] for force in forces] for k in range(n)]))
    found = [
        [e + (direct[i][j] if j < i else 0) for j, e in enumerate((row * reply).tolist()[0])] for i, row in enumerate(rows)
    ]
    largest = max(e.abs_upper() for row in found for e in row)
    if not all(e.is_finite() and e.real.rad() + e.imag.rad() < 1e-18 * largest for row in found for e in row):
        raise ValueError("not enough bits")
    return acb_mat(found)


def displacements(values, theta):
    """The map from the frame's hand forces to the displacements in its ticks at theta (rad per frame), M by M, complex."""
    M = values["rates.ratio"]
    positions = lifted(values, theta / (2 * arb.pi() * M) * arb(values["rates.fast_hz"])).tolist()
    turn = acb(0, theta).exp()
    after = [*positions[1:], [turn * entry for entry in positions[0]]]
    return [[complex(b - a) for a, b in zip(*rows, strict=True)] for rows in zip(positions, after, strict=True)]
