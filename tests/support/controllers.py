"""The laws of the paper's controllers as difference equations, tick by tick: a witness of the pages that draw them.

They share nothing with a page but the model that both were written from, so that a wrong sign, gain or delay in a page shows as
a difference. They are linear: effects of hardware are left to the simulation of the package.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from wavesweep.errors import IllPosedLoopError
from wavesweep.simulation.body import zero_order_hold

Mail = tuple[tuple[int, Any], ...]  # results under way, each with the tick from which it is held


class Loop(NamedTuple):
    """A compiled loop: tick (s), velocity measurement, plant's increments, frame in ticks, memory at rest, a tick's law."""

    T: float
    velocity: str
    plant: tuple[float, ...]
    frame: int
    memory: Any
    tick: Callable[..., tuple[Any, Any]]


def compile_loop(values: Mapping) -> Loop:
    """The loop of flat values."""
    T, kind = 1.0 / values["rates.fast_hz"], values["controller.kind"]
    whole = (values[f"device.{name}"] + values[f"operator.{name}"] for name in ("mass", "damping"))
    plant = tuple(zero_order_hold(*whole, values["operator.stiffness"], T).tolist())
    frame = 1 if kind == "dc" else values["rates.ratio"]
    if kind in ("pmw", "pmw-lm"):
        law = WaveLaw.of(values, T)
        memory, tick = WaveMemory(*map(at_rest, (law.lp1, law.hp, law.lp2)), Avatar(), Avatar(), Avatar(), 0.0), wave_tick
    else:
        law, memory, tick = DirectLaw.of(values, frame), DirectMemory(), direct_tick
    return Loop(T, values["device.velocity"], plant, frame, memory, lambda *args: tick(law, *args))


def collect(held: Any, mail: Mail, k: int) -> tuple[Any, Mail]:
    """The result held in tick k, and those under way."""
    due = [result for at, result in mail if at <= k]
    return (due[-1] if due else held), mail[len(due) :]


class Section(NamedTuple):
    """One pole pair (complex p) or one real pole of a filter: `q' = p q + g u`, `y = Re(r q) + d u`."""

    p: complex
    g: float
    r: complex
    d: float


def butterworth(passes: str, order: int, cutoff_hz: float, fast_hz: float) -> tuple[Section, ...]:
    """Digital Butterworth filter as one-pole sections, by the bilinear transform with prewarping; order 0 has none."""
    edge = math.tan(math.pi * cutoff_hz / fast_hz)
    angles = [math.pi * (2 * k + order + 1) / (2 * order) for k in range((order + 1) // 2)]
    return tuple(_section(passes, edge * cmath.exp(1j * angle), 2 * k + 1 == order) for k, angle in enumerate(angles))


def _section(passes, s, real):
    s = s.real if real else s
    p, to_one, to_minus_one = (1 + s) / (1 - s), -2 * s / (1 - s), 2 / (1 - s)
    at_gain, at_zero = (to_one, to_minus_one) if passes == "low" else (to_minus_one, -to_one)
    g, d = abs(to_one) ** 0.5, at_gain / 2 if real else abs(at_gain) ** 2 / 4
    return Section(p, g, d * at_zero / g if real else d * at_zero**2 / (1j * p.imag) / g, d)


def at_rest(sections: tuple[Section, ...]) -> tuple[complex, ...]:
    """The state of a cascade that has seen nothing."""
    return tuple(0.0j if section.p.imag else 0.0 for section in sections)


def advance(sections: tuple[Section, ...], state: tuple[complex, ...], u: float) -> tuple[tuple[complex, ...], float]:
    """The state after the sample u, and the output for it."""
    after = []
    for (p, g, r, d), q in zip(sections, state, strict=True):
        after.append(p * q + g * u)
        u = (r * q).real + d * u
    return tuple(after), u


class Sample(NamedTuple):
    """A force of the slow wall (N), and the position (m) and velocity (m/s) that it comes from."""

    F: float = 0.0
    x: float = 0.0
    v: float = 0.0


class DirectLaw(NamedTuple):
    """The constants of a direct coupling."""

    K: float
    B: float
    K_LM: float
    B_LM: float
    ratio: int
    delay: int

    @staticmethod
    def of(values: Mapping, ratio: int) -> DirectLaw:
        """The law of `dc`, `dc-slow` or `dc-lm`."""
        kind, wall = values["controller.kind"], (values["environment.K_VE"], values["environment.B_VE"])
        local = (values["local_model.K_LM"], values["local_model.B_LM"]) if kind == "dc-lm" else (0.0, 0.0)
        return DirectLaw(*wall, *local, ratio, 0 if kind == "dc" else values["environment.delay"])


class DirectMemory(NamedTuple):
    """The held sample, and those under way."""

    held: Sample = Sample()
    mail: Mail = ()


class DirectTick(NamedTuple):
    """The control force of a tick, and the slow force if one was computed."""

    f_m: float
    F_s: float | None


def direct_tick(law: DirectLaw, memory: DirectMemory, k: int, x: float, v_hat: float) -> tuple[DirectMemory, DirectTick]:
    """`f_m = F_s + K_LM (x - x_ref) + B_LM (v - v_ref)` with the held `F_s = K x_ref + B v_ref`."""
    held, mail = collect(memory.held, memory.mail, k)
    F_s = None
    if k % law.ratio == 0:
        F_s = law.K * x + law.B * v_hat
        held, mail = collect(held, (*mail, (k + law.delay, Sample(F_s, x, v_hat))), k)
    return DirectMemory(held, mail), DirectTick(held.F + law.K_LM * (x - held.x) + law.B_LM * (v_hat - held.v), F_s)


class Port(NamedTuple):
    """A spring and damper behind a wave port: `x~ = x + behind v_before + ahead v`, and the avatar moves to that with step."""

    K: float
    B: float
    b: float
    behind: float
    ahead: float
    step: float


class Avatar(NamedTuple):
    """The avatar after an update: position (m), velocity (m/s), force (N), the returned wave."""

    x: float = 0.0
    x_dot: float = 0.0
    F: float = 0.0
    v: float = 0.0


def touch(wall: Port, avatar: Avatar, u: float) -> Avatar:
    """`v = (sqrt(2b) u - F)/b`, `F = K x~ + B v`, returned `u - sqrt(2/b) F`."""
    K, B, b, behind, ahead, step = wall
    before = avatar.x + behind * avatar.x_dot
    x_dot = (math.sqrt(2 * b) * u - K * before) / (b + B + K * ahead)
    F = K * (before + ahead * x_dot) + B * x_dot
    return Avatar(before + step * x_dot, x_dot, F, u - math.sqrt(2 / b) * F)


class WaveLaw(NamedTuple):
    """The constants of a wave controller; `local` is None for `pmw`."""

    b: float
    Kp: float
    ratio: int
    delay: int
    wall: Port
    local: Port | None
    local_delay: int
    lp1: tuple[Section, ...]
    hp: tuple[Section, ...] = ()
    lp2: tuple[Section, ...] = ()

    @staticmethod
    def of(values: Mapping, T: float) -> WaveLaw:
        """The law of `pmw` or `pmw-lm`."""
        b, ratio, local = values["controller.b"], values["rates.ratio"], values["controller.kind"] == "pmw-lm"

        def port(table, letters, period):
            steps = {"explicit": (0.0, 0.0, 1.0), "implicit": (0.0, 1.0, 1.0), "trapezoidal": (0.5, 0.5, 0.5)}
            times = (period * share for share in steps[values[f"{table}.integration"]])
            return Port(values[f"{table}.K_{letters}"], values[f"{table}.B_{letters}"], b, *times)

        filters = [
            butterworth(passes, *(values[f"filters.{name}.{part}"] for part in ("order", "cutoff_hz")), values["rates.fast_hz"])
            for name, passes in (("lp1", "low"), ("hp", "high"), ("lp2", "low"))[: 3 if local else 1]
        ]
        wall, fast = port("environment", "VE", ratio * T), port("local_model", "LM", T) if local else None
        delays = values["environment.delay"], values["local_model.delay"] if local else 1
        return WaveLaw(b, values["controller.Kp"], ratio, delays[0], wall, fast, delays[1], *filters)


class WaveMemory(NamedTuple):
    """All that a wave controller keeps from tick to tick."""

    lp1: tuple[complex, ...]
    hp: tuple[complex, ...]
    lp2: tuple[complex, ...]
    slow: Avatar  # after the last slow event
    held: Avatar  # the pair (v_1, x_s) that the fast loop reads
    local: Avatar
    v_2: float  # the local model's wave of the tick before
    mail: Mail = ()


class WaveTick(NamedTuple):
    """The waves of one tick; `u_s` and `slow` are None except at slow events, the last three without a local model."""

    f_m: float
    u_m: float
    v_m: float
    u_s: float | None
    slow: Avatar | None
    u_h: float | None
    v_l: float | None
    v_2: float | None


def wave_tick(law: WaveLaw, memory: WaveMemory, k: int, x: float, v_hat: float) -> tuple[WaveMemory, WaveTick]:
    """`f_m = b v - sqrt(2b) v_m`, `u_m = sqrt(2b) v - v_m`, `v_m = v_1 + v_2 + Kp (x_s - x)`, and the answers to u_m.

    What comes back within the tick is affine in u_m, so two trial waves tell which one is its own answer.
    """
    held, mail = collect(memory.held, memory.mail, k)
    memory, root = memory._replace(held=held, mail=mail), math.sqrt(2 * law.b)
    none, one = (_answered(law, memory, k, x, u)[1] for u in (0.0, 1.0))
    if abs(1 + one - none) < 1e-15:
        raise IllPosedLoopError("u_m has no value; give the environment or the local model a delay")
    u_m = (root * v_hat - none) / (1 + one - none)
    memory, _, seen = _answered(law, memory, k, x, u_m)
    v_m = root * v_hat - u_m
    return memory, WaveTick(law.b * v_hat - root * v_m, u_m, v_m, *seen)


def _answered(law, memory, k, x, u_m):
    """The memory after u_m, the v_m that it makes, and the other waves."""
    lp1, low = advance(law.lp1, memory.lp1, u_m)
    memory, u_s, slow, u_h, v_l, v_2 = memory._replace(lp1=lp1), None, None, None, None, memory.v_2
    if k % law.ratio == 0:
        u_s, slow = low, touch(law.wall, memory.slow, low)
        held, mail = collect(memory.held, (*memory.mail, (k + law.delay, slow)), k)
        memory = memory._replace(slow=slow, held=held, mail=mail)
    if law.local is not None:
        hp, u_h = advance(law.hp, memory.hp, u_m)
        local = touch(law.local, memory.local, u_h)
        lp2, y = advance(law.lp2, memory.lp2, local.v)
        v_l, v_2 = local.v, memory.v_2 if law.local_delay else y
        memory = memory._replace(hp=hp, local=local, lp2=lp2, v_2=y)
    v_m = memory.held.v + v_2 + law.Kp * (memory.held.x - x)
    return memory, v_m, (u_s, slow, u_h, v_l, v_2 if law.local else None)
