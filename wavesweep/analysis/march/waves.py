"""The wave controllers `pmw` and `pmw-lm`, one fast tick at a time."""

from __future__ import annotations

import math
from typing import Mapping, NamedTuple

from wavesweep.analysis.march.avatar import Avatar, Port, port, touch
from wavesweep.analysis.march.clock import Mail, collect, post
from wavesweep.analysis.march.filters import Section, advance, at_rest, butterworth, output
from wavesweep.errors import IllPosedLoopError


class WaveLaw(NamedTuple):
    """The constants of a wave controller; `local` is None for `pmw`."""

    b: float
    Kp: float
    ratio: int
    delay: int
    lp1: tuple[Section, ...]
    wall: Port
    local: Port | None
    hp: tuple[Section, ...]
    lp2: tuple[Section, ...]
    local_delay: int


class WaveMemory(NamedTuple):
    """Everything that a wave controller keeps from tick to tick."""

    lp1: tuple[complex, ...]
    hp: tuple[complex, ...]
    lp2: tuple[complex, ...]
    slow: Avatar  # after the last slow event
    held: Avatar  # the pair (v_1, x̄_s) that the fast loop reads
    local: Avatar
    v_2: float  # the local model's wave of the tick before
    mail: Mail = ()  # slow results that are still on their way


class WaveTick(NamedTuple):
    """The waves of one tick; `u_s` and `slow` are None but at slow events, the last three None without local model."""

    f_m: float
    u_m: float
    v_m: float
    u_s: float | None
    slow: Avatar | None
    u_h: float | None
    v_l: float | None
    v_2: float | None


def wave_law(values: Mapping) -> WaveLaw:
    """The controller of a spec's flat values."""
    kind, b, fast_hz = values["controller.kind"], values["controller.b"], values["rates.fast_hz"]
    ratio = values["rates.ratio"]

    def design(name, passes):
        return butterworth(passes, values[f"filters.{name}.order"], values[f"filters.{name}.cutoff_hz"], fast_hz)

    def spring(table, letters, period):
        constants = (values[f"{table}.K_{letters}"], values[f"{table}.B_{letters}"])
        return port(*constants, b, period, values[f"{table}.integration"])

    with_local = kind == "pmw-lm"
    return WaveLaw(
        b=b,
        Kp=values["controller.Kp"],
        ratio=ratio,
        delay=values["environment.delay"],
        lp1=design("lp1", "low"),
        wall=spring("environment", "VE", ratio / fast_hz),
        local=spring("local_model", "LM", 1 / fast_hz) if with_local else None,
        hp=design("hp", "high") if with_local else (),
        lp2=design("lp2", "low") if with_local else (),
        local_delay=values["local_model.delay"] if with_local else 1,
    )


def wave_memory(law: WaveLaw) -> WaveMemory:
    """Nothing has moved yet."""
    states = (at_rest(sections) for sections in (law.lp1, law.hp, law.lp2))
    return WaveMemory(*states, slow=Avatar(), held=Avatar(), local=Avatar(), v_2=0.0)


def wave_tick(law: WaveLaw, memory: WaveMemory, k: int, x: float, v_hat: float) -> tuple[WaveMemory, WaveTick]:
    """One tick: ``f_m = b·v̂ − √(2b)·v_m``, ``u_m = √(2b)·v̂ − v_m``, and what ``u_m`` then sets in motion.

    Parameters: `k` the tick, `x` the position (m), `v_hat` the measured velocity (m/s).
    """
    event = k % law.ratio == 0
    closes = event and law.delay == 0
    held, mail = collect(memory.held, memory.mail, k)
    memory = memory._replace(held=held, mail=mail)
    root = math.sqrt(2 * law.b)
    u_m = _outgoing(law, memory, x, root * v_hat, closes)
    v_m = root * v_hat - u_m

    lp1, low = advance(law.lp1, memory.lp1, u_m)
    memory, u_s, slow = memory._replace(lp1=lp1), None, None
    if event:
        u_s, slow = low, touch(law.wall, memory.slow, low)
        memory = memory._replace(slow=slow, held=slow if closes else held, mail=post(mail, slow, k, law.delay))
    u_h = v_l = v_2 = None
    if law.local:
        hp, u_h = advance(law.hp, memory.hp, u_m)
        local = touch(law.local, memory.local, u_h)
        lp2, y = advance(law.lp2, memory.lp2, local.v)
        v_l, v_2 = local.v, y if law.local_delay == 0 else memory.v_2
        memory = memory._replace(hp=hp, local=local, lp2=lp2, v_2=y)
    return memory, WaveTick(law.b * v_hat - root * v_m, u_m, v_m, u_s, slow, u_h, v_l, v_2)


def _outgoing(law: WaveLaw, memory: WaveMemory, x: float, sent: float, closes: bool) -> float:
    """The ``u_m`` with ``u_m = √(2b)·v̂ − v_m``, where ``v_m`` may itself come from ``u_m`` within the tick.

    ``v_m`` is affine in ``u_m``; its slope is what a loop at rest gives back of a unit wave.
    """
    without = _returned(law, memory, x, 0.0, closes)
    if not closes and law.local_delay:
        return sent - without
    slope = _returned(law, wave_memory(law), 0.0, 1.0, closes)
    if slope == -1.0:
        raise IllPosedLoopError("the wave that leaves the user's side comes back within the tick as its own negative: "
                                "u_m has no value; give the environment or the local model a delay")
    return (sent - without) / (1 + slope)


def _returned(law: WaveLaw, memory: WaveMemory, x: float, u_m: float, closes: bool) -> float:
    """``v_m = v_1 + v_2 + Kp·(x̄_s − x)`` if the tick's outgoing wave were ``u_m``; nothing is stored."""
    held = touch(law.wall, memory.slow, output(law.lp1, memory.lp1, u_m)) if closes else memory.held
    v_2 = memory.v_2
    if law.local_delay == 0:
        v_2 = output(law.lp2, memory.lp2, touch(law.local, memory.local, output(law.hp, memory.hp, u_m)).v)
    return held.v + v_2 + law.Kp * (held.x - x)
