"""Pages of controllers: blocks and wires as texts, with the paths of a spec's keys as numbers,
and the loops that they draw."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from math import ceil, floor
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine.drawing import TYPES, Drawing, DrawnBlock
from wavesweep.engine.errors import UsageError
from wavesweep.engine.expressions import Tree, parse
from wavesweep.haptics.controllers import CONTROLLERS, MOST_SLOW_STEPS, WALL

if TYPE_CHECKING:
    from wavesweep.engine.frames import LinearFractional

RATIO = "rates.ratio"
# the wall's force on a displacement x and a velocity v
F_S = "environment.K_VE*{x} + environment.B_VE*{v}"


def steps_of(ratio: float) -> tuple[int, int]:
    """Return the fast ticks in a frame, and the slow steps in it."""
    fraction = Fraction(ratio).limit_denominator(MOST_SLOW_STEPS)
    return fraction.numerator, fraction.denominator


@dataclass(frozen=True, slots=True)
class BlockDiagram:
    """A loop as its page draws it.

    blocks: name -> keys, of which `type` is one; numbers are texts of expressions in paths of keys.
    wires: input port -> text of an expression, linear in signals. reaction: text of the force
    against the hand. assumes: what a result says of its wall.
    """

    blocks: Mapping[str, Mapping[str, object]]
    wires: Mapping[str, str]
    reaction: str
    assumes: str = "a wall of which its controller's page says nothing"

    def behind_amplifier(self, ticks: int, dead_time: str) -> BlockDiagram:
        """Return the loop whose motors exert the control force so many ticks later, and the device
        feels theirs.

        dead_time: path of a time (s) by which it is later than that; empty without one.
        """
        if not ticks and not dead_time:
            return self
        late: dict[str, Any] = {"steps": ticks}
        if dead_time:
            late = {"steps": None, "seconds": f"{dead_time} + {ticks}/rates.fast_hz"}
        blocks = {**self.blocks, "amplifier": {"type": "delay", **late}}
        wires = {**self.wires, "amplifier.u": self.reaction, "device.f": "f_h - amplifier.y"}
        if dead_time:  # which would read a position or velocity of the device between two ticks
            blocks["command"] = {"type": "hold"}
            wires |= {"command.u": self.reaction, "amplifier.u": "command.y"}
        return replace(self, blocks=blocks, wires=wires, reaction="amplifier.y")


@dataclass(frozen=True, slots=True)
class Slow:
    """When the slow environment runs and when its results are in place, in fast ticks of the common
    frame.

    With fast/slow = q/p in lowest terms all is in step again after q fast ticks, in which the slow
    environment runs p times. Its step k is at time `t_k = k q/p` ticks. It reads what the fast tick
    at or before t_k holds, and its result is in place from the first fast tick at or after `t_k +
    D` on. D is a whole number of ticks, to the longest frame, or q/p itself: "frame", the instant
    of the next step, before that one reads.

    stored, shown: the ticks in which a result is put aside, since the next one is computed first,
    and in which it is put in place; empty where it need not be. by: the type of the block that
    shows it.
    """

    every: object
    reads: tuple[int, ...]
    stored: tuple[int, ...]
    shown: tuple[int, ...]
    by: str = "hold"

    @staticmethod
    def of(values: Mapping[str, Any]) -> Slow:
        """Return the times for the ratio of the rates and the delay of a spec."""
        q, p = steps_of(values[RATIO])
        late = Fraction(values["environment.delay"]).limit_denominator(MOST_SLOW_STEPS)
        every = RATIO if p == 1 else q
        steps = range(-2, p + 1)  # of one frame, with those before and after it
        times = {k: Fraction(k * q, p) for k in steps}
        computed = {k: floor(times[k]) for k in steps}
        waits = {k: ceil(times[k] + late) for k in steps}
        reads = tuple(computed[k] for k in range(p))
        shown = tuple(sorted(waits[k] % q for k in range(p)))
        if all(waits[k] == computed[k] for k in range(p)):
            return Slow(every, reads, (), ())
        # Whatever shows result k has to find it: a hold at waits[k], a delay, which shows what it
        # was given one run before, at waits[k - 1]. By then it is computed, or put aside before the
        # next one is, but not before its place is free.
        for by, runs in (("hold", 0), ("delay", 1)):
            ready = {k: waits[k - runs] for k in range(p)}
            if all(computed[k] <= ready[k] < computed[k + 1] for k in range(p)):
                return Slow(every, reads, (), shown, by)
            latest = {k: min(ready[k], computed[k + 1] - 1) for k in range(p)}
            free = {k: max(computed[k], waits[k - runs - 1] + 1) for k in range(p)}
            if all(free[k] <= latest[k] for k in range(p)):
                stored = tuple(sorted(latest[k] % q for k in range(p)))
                return Slow(every, reads, stored, shown, by)
        raise AssertionError(f"no place for results that are {late} ticks late, {q}/{p} to a frame")

    def block(self, **keys: object) -> dict[str, object]:
        """Return a block that runs with the slow environment."""
        return {"every": self.every, "phases": self.reads, **keys}

    def in_place(
        self, name: str, signal: str
    ) -> tuple[dict[str, dict[str, object]], dict[str, str], str]:
        """Return the blocks and wires that put a slow signal in place when its delay is over,
        and the signal that shows it."""
        blocks = {}
        wires = {}
        for stage, kind, phases in (
            ("kept", "hold", self.stored),
            ("shown", self.by, self.shown),
        ):
            if phases:
                blocks[f"{name}_{stage}"] = {"type": kind, "every": self.every, "phases": phases}
                wires[f"{name}_{stage}.u"] = signal
                signal = f"{name}_{stage}.y"
        return blocks, wires, signal


def device(values: Mapping[str, Any]) -> tuple[dict[str, dict[str, object]], dict[str, str], str]:
    """Return the device with the operator's hand on it, and the signal of its measured velocity."""
    with_hand = {key: f"device.{key} + operator.{key}" for key in ("mass", "damping")}
    blocks: dict[str, dict[str, object]] = {
        "device": {"type": "mass", **with_hand, "stiffness": "operator.stiffness"}
    }
    if values["device.velocity"] == "exact":
        return blocks, {}, "device.v"
    return blocks | {"velocity": {"type": "difference"}}, {"velocity.u": "device.x"}, "velocity.y"


def drawing_of_page(page: BlockDiagram) -> Drawing:
    """Return the drawing of a page, whose numbers are the keys of a spec."""

    blocks = tuple(_block(name, dict(keys)) for name, keys in page.blocks.items())
    signals = {f"{block.name}.{port}" for block in blocks for port in block.ports[1]} | {"f_h"}
    wires = tuple((port, _tree(text).linear(signals)) for port, text in page.wires.items())
    hand = "f_h", _tree("device.x").linear(signals), _tree(page.reaction).linear(signals)
    return Drawing(_tree("rates.fast_hz"), (), frozenset(), blocks, wires, hand, WALL)


def _block(name: str, keys: dict[str, Any]) -> DrawnBlock:
    kind, every, phases = keys.pop("type"), keys.pop("every", 1), keys.pop("phases", (0,))
    entries = []
    for path, key in TYPES[kind].keys.items():
        value = keys.get(path, key.default)
        if value is not None:
            entries.append((path, _tree(value) if key.type in ("number", "integer") else value))
    alone = phases if len(phases) > 1 else ()
    return DrawnBlock(name, kind, tuple(entries), _tree(every), _tree(phases[0]), alone)


@lru_cache(maxsize=256)
def _tree(value: Any) -> Tree:
    if isinstance(value, str):
        return parse(value)
    return Tree.number(value)


_DECIDING = (
    *("rates.ratio", "environment.delay", "environment.integration", "device.velocity"),
    *("local_model.delay", "local_model.integration"),
)
_AMPLIFIER, _DEAD_TIME = "device.delay", "device.dead_time"
_GAIN = "controller.Kp"  # without it, nothing holds the avatar's position


def loop_drawing(values: Mapping[str, Any], varied: Iterable[str] = ()) -> Drawing:
    """Return the loop that a spec's controller is, as a drawing whose numbers are the keys of a
    spec.

    values: flat keys; arrays over a batch may stand for floats. varied: paths of gains that count
    as other than 0. Errors: UsageError for a kind that no page draws.
    """
    return _drawing(*_page_of(values, varied))


def keys_of_page(values: Mapping[str, Any]) -> frozenset[str]:
    """Return the keys that the loop of a spec's controller depends on, with those of the wall."""
    return _read(*_page_of(values))


def assumption_of_page(values: Mapping[str, Any]) -> str:
    """Return what the page of a spec's controller declares of its wall."""
    kind, items = _page_of(values)
    page: BlockDiagram = CONTROLLERS[kind].page(dict(items))
    return page.assumes


def wall_cut(values: Mapping[str, object]) -> LinearFractional | None:
    """Return the loops of a controller cut at both numbers of its wall; None if its frame reads
    these more than once.

    values: flat keys, with numbers or arrays over the loops.
    """
    from wavesweep.engine.frames import open_loops
    from wavesweep.engine.loop import Loops

    loops = Loops(loop_drawing(values), values).read
    opened = open_loops(loops, *WALL, per_loop=True)
    return opened.cut if opened else None


_Items = tuple[tuple[str, Any], ...]


def _page_of(values: Mapping[str, Any], varied: Iterable[str] = ()) -> tuple[str, _Items]:
    """The kind of a controller, and the values that decide how its page draws it."""
    kind = values["controller.kind"]
    if kind not in CONTROLLERS:
        names = ", ".join(CONTROLLERS)
        raise UsageError(
            f"controller.kind: expected one of {names}, found {kind}, which has no page"
        )
    items = [(path, values[path]) for path in _DECIDING]
    items.append((_AMPLIFIER, int(values.get(_AMPLIFIER, 0))))
    for path in (_GAIN, _DEAD_TIME):
        items.append((path, path in varied or bool(np.any(values.get(path, 0.0)))))
    return kind, tuple(items)


@lru_cache(maxsize=256)
def _drawing(kind: str, items: _Items) -> Drawing:
    return drawing_of_page(_late(kind, dict(items)))


@lru_cache(maxsize=256)
def _read(kind: str, items: _Items) -> frozenset[str]:
    watched = _Watched(items)
    page = _late(kind, watched)
    reads: frozenset[str] = drawing_of_page(page).reads
    return reads | watched.seen | {"controller.kind", *WALL}


def _late(kind: str, values: Mapping[str, Any]) -> BlockDiagram:
    """The page of a controller, its force as late as the amplifier is."""
    page: BlockDiagram = CONTROLLERS[kind].page(values)
    dead_time = _DEAD_TIME if values[_DEAD_TIME] else ""
    return page.behind_amplifier(values[_AMPLIFIER], dead_time)


class _Watched(dict[str, Any]):
    """Values that remember which of them were asked for."""

    def __init__(self, items: _Items) -> None:
        super().__init__(items)
        self.seen: set[str] = set()

    def __getitem__(self, path: str) -> Any:
        self.seen.add(path)
        return super().__getitem__(path)
