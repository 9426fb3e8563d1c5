"""The wave controllers `pmw` and `pmw-lm`, one fast tick at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from wavesweep.analysis.simulation.avatar import (
    Avatar,
    Contact,
    Port,
    allows,
    away,
    contact,
    free,
    grazing,
    port,
    pressed,
    touch,
)
from wavesweep.analysis.simulation.cascade import Section, State, advance, at_rest, butterworth, output
from wavesweep.analysis.simulation.hardware import Mail, collect, post
from wavesweep.errors import IllPosedLoopError

ROUNDING = 1e-12  # of a wave, by which a share of it may be off: without LP1 a grazing avatar leaves a share of 0


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

    lp1: State
    hp: State
    lp2: State
    slow: Avatar  # after the last slow event
    held: Avatar  # the pair (v_1, x̄_s) that the fast loop reads
    local: Avatar
    v_2: float  # the local model's wave of the tick before
    mail: Mail = ()  # slow results that are still on their way


class WaveTick(NamedTuple):
    """The waves of one tick; `u_s` and `slow` are None except at slow events, the last three if there is no local model."""

    f_m: float
    u_m: float
    v_m: float
    touching: bool
    u_s: float | None
    slow: Avatar | None
    u_h: float | None
    v_l: float | None
    v_2: float | None


def pmw(values: Mapping, surface: float | None = None) -> WaveLaw:
    """Return the law of `pmw`. If `surface` (m) is given, the wall is one-sided from there on."""
    wall = _spring(values, "environment", "VE", values["rates.ratio"] / values["rates.fast_hz"])
    return WaveLaw(
        b=values["controller.b"],
        Kp=values["controller.Kp"],
        ratio=values["rates.ratio"],
        delay=values["environment.delay"],
        lp1=_filter(values, "lp1", "low"),
        wall=wall if surface is None else wall._replace(position=surface, one_sided=True),
        local=None,
        hp=(),
        lp2=(),
        local_delay=1,
    )


def pmw_lm(values: Mapping, surface: float | None = None) -> WaveLaw:
    """Return the law of `pmw-lm`: that of `pmw` with filter bank and local model."""
    return pmw(values, surface)._replace(
        local=_spring(values, "local_model", "LM", 1 / values["rates.fast_hz"]),
        hp=_filter(values, "hp", "high"),
        lp2=_filter(values, "lp2", "low"),
        local_delay=values["local_model.delay"],
    )


def _filter(values: Mapping, name: str, passes: str) -> tuple[Section, ...]:
    order, cutoff_hz = (values[f"filters.{name}.{part}"] for part in ("order", "cutoff_hz"))
    return butterworth(passes, order, cutoff_hz, values["rates.fast_hz"])


def _spring(values: Mapping, table: str, letters: str, period: float) -> Port:
    constants = (values[f"{table}.K_{letters}"], values[f"{table}.B_{letters}"])
    return port(*constants, values["controller.b"], period, values[f"{table}.integration"])


def wave_memory(law: WaveLaw) -> WaveMemory:
    """Return the memory of a loop that has not moved yet, its avatar at x = 0."""
    states = (at_rest(sections) for sections in (law.lp1, law.hp, law.lp2))
    avatar = Avatar(touching=not law.wall.one_sided or law.wall.position < 0.0)
    return WaveMemory(*states, slow=avatar, held=avatar, local=Avatar(), v_2=0.0)


def wave_tick(
    law: WaveLaw, memory: WaveMemory, k: int, x: float, v_hat: float, late: int | None = 0
) -> tuple[WaveMemory, WaveTick]:
    """Run one tick: ``f_m = b·v̂ - √(2b)·v_m``, ``u_m = √(2b)·v̂ - v_m``, and the answers to ``u_m``.

    Parameters: `k` the tick, `x` the position (m), `v_hat` the measured velocity (m/s), `late` the ticks by which a slow
    result computed now exceeds its delay, None if it is lost.
    """
    event = k % law.ratio == 0
    delay = None if late is None else law.delay + late
    held, mail = collect(memory.held, memory.mail, k)
    memory = memory._replace(held=held, mail=mail)
    root = math.sqrt(2 * law.b)
    u_m, meets = _outgoing(law, memory, x, root * v_hat, closes=event and delay == 0)
    v_m = root * v_hat - u_m

    lp1, low = advance(law.lp1, memory.lp1, u_m)
    u_h, v_l, v_2, remembered = _local_tick(law, memory, u_m)
    memory, u_s, slow = memory._replace(lp1=lp1, **remembered), None, None
    if event:
        u_s, slow = low, (meets or contact(law.wall, memory.slow, low))(law.wall, memory.slow, low)
        memory = memory._replace(slow=slow, held=slow if delay == 0 else held, mail=post(mail, slow, k, delay))
    f_m = law.b * v_hat - root * v_m
    return memory, WaveTick(f_m, u_m, v_m, memory.held.touching, u_s, slow, u_h, v_l, v_2)


def _local_tick(law: WaveLaw, memory: WaveMemory, u_m: float):
    """Answer ``u_m`` with the local model: its waves, and its new state."""
    if law.local is None:
        return None, None, None, {}
    hp, u_h = advance(law.hp, memory.hp, u_m)
    local = _local_answer(law, memory, u_h)
    lp2, y = advance(law.lp2, memory.lp2, local.v)
    v_2 = y if law.local_delay == 0 else memory.v_2
    return u_h, local.v, v_2, {"hp": hp, "local": local, "lp2": lp2, "v_2": y}


def _local_answer(law: WaveLaw, memory: WaveMemory, u_h: float) -> Avatar:
    """Move the local model, which is one of a contact: free while the pair held at the tick's start is off the wall."""
    return touch(law.local, memory.local, u_h) if memory.held.touching else away(law.local, u_h)


def _outgoing(law: WaveLaw, memory: WaveMemory, x: float, sent: float, *, closes: bool) -> tuple[float, Contact | None]:
    """Solve ``u_m = √(2b)·v̂ - v_m``, in which ``v_m`` may itself depend on ``u_m`` within the tick.

    For each way of meeting the wall ``v_m`` is affine in ``u_m``: its slope is the part of a unit wave that a loop at rest
    returns. The first way that its own solution allows is taken; they are tried in the order in which `contact` decides.
    There is exactly one if `1 + slope` has the same sign for all of them.
    Returns the wave, and the way if the slow loop is part of it. Errors: IllPosedLoopError if there is none, or several.
    """
    if not closes and law.local_delay:
        return sent - _returned(law, memory, x, 0.0, None), None
    ways = (pressed, free, grazing) if closes and law.wall.one_sided else (pressed if closes else None,)
    if len(ways) > 1 and law.wall.ahead > 0:  # else the gap alone decides
        shares = [1 + _slope(law, memory, meets) for meets in (ways if law.wall.B else ways[:2])]
        if min(shares) < -ROUNDING and max(shares) > ROUNDING:
            raise IllPosedLoopError(
                "within the tick the avatar both touches the one-sided wall and does not, or neither: u_m has no single value; "
                "give the environment or the local model a delay"
            )
    for meets in ways:
        slope = _slope(law, memory, meets)
        if slope == -1.0 and meets is grazing:
            break  # without LP1 a grazing avatar leaves u_m open; the free solution is its limit
        if slope == -1.0:
            raise IllPosedLoopError(
                "the wave that leaves the user's side comes back within the tick as its own negative: "
                "u_m has no value; give the environment or the local model a delay"
            )
        u_m = (sent - _returned(law, memory, x, 0.0, meets)) / (1 + slope)
        if len(ways) == 1 or allows(law.wall, memory.slow, output(law.lp1, memory.lp1, u_m), meets):
            break
    return u_m, meets


def _slope(law: WaveLaw, memory: WaveMemory, meets: Contact | None) -> float:
    """Return the part of a unit ``u_m`` in ``v_m`` within the tick: the loop at rest, its wall at the avatar."""
    rest = wave_memory(law)._replace(held=Avatar(touching=memory.held.touching))
    return _returned(law._replace(wall=law.wall._replace(position=0.0)), rest, 0.0, 1.0, meets)


def _returned(law: WaveLaw, memory: WaveMemory, x: float, u_m: float, meets: Contact | None) -> float:
    """Return ``v_m = v_1 + v_2 + Kp·(x̄_s - x)`` for an outgoing wave ``u_m``; nothing is stored.

    `meets` is the assumed way of meeting the wall, None if the slow loop responds later.
    """
    held = memory.held
    if meets:
        held = meets(law.wall, memory.slow, output(law.lp1, memory.lp1, u_m))
    v_2 = memory.v_2
    if law.local_delay == 0:
        v_2 = output(law.lp2, memory.lp2, _local_answer(law, memory, output(law.hp, memory.hp, u_m)).v)
    return held.v + v_2 + law.Kp * (held.x - x)
