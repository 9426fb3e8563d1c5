"""What [for_all] and channels allow: numbers that are not known, and kinds of frames with what may follow.

A frame goes from the tick after a sample of the slow environment to its next sample. Then all in it depends on its own length:
the step of this sample is the time since the last one, or the nominal one.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from typing import Any

from wavesweep.checker.reader.controllers import SYMBOLS, Controller
from wavesweep.checker.reader.expressions import names_in, parsed
from wavesweep.checker.reader.loops import Instant, Schedule, Unreadable

RATIO = "rates.ratio"
DELAY = "environment.delay"
WHOLE = {RATIO, DELAY, "device.delay", "local_model.delay"} | {
    f"filters.{name}.order" for name in ("lp1", "hp", "lp2")
}
MOST = 256  # combinations of listed values, and kinds of frames


@dataclass
class ForAll:
    """ranges, listed: numbers that are constant but not known; varying: those that may change from frame to frame.

    lost: slow results in a row that may not come.
    """

    ranges: dict[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    listed: dict[str, list] = field(default_factory=dict)
    varying: dict[str, list] = field(default_factory=dict)
    chances: dict[str, Any] = field(default_factory=dict)
    lost: int = 0
    loss: Any = None

    @property
    def members(self) -> list[dict[str, Any]]:
        """All combinations of listed values, the last key fastest."""
        return [
            dict(zip(self.listed, values, strict=True)) for values in product(*self.listed.values())
        ]


def read(tables: dict, exact: Callable[[Any], Fraction]) -> ForAll:
    """The table [for_all] of a spec."""
    found = ForAll()
    for name, given in tables.get("for_all", {}).items():
        path = SYMBOLS.get(name, name) if "controller" in tables else name
        if name == "contact":
            continue  # of walls that let go: rows of their own
        if name == "lost":
            found.lost = _whole(exact(given))
        elif name == "loss":
            found.loss = given
        elif not isinstance(given, dict) or name == "tick":
            raise Unreadable(f"for_all.{name} has no proof here")
        elif given.get("varying") and path not in (RATIO, DELAY) and "controller" in tables:
            raise Unreadable(f"{name} varies from frame to frame, of which there is no proof here")
        else:
            _of_number(found, path, given, exact)
    if len(found.members) > MOST:
        raise Unreadable(f"{len(found.members)} combinations of values; at most {MOST}")
    return found


def _of_number(found: ForAll, name: str, given: dict, exact):
    unknown = given.keys() - {"start", "stop", "values", "varying", "shares", "next"}
    if unknown:
        raise Unreadable(f"the key for_all.{name}.{min(unknown)} is not known")
    varying = given.get("varying", False)
    if "values" in given:
        values = [value if value == "frame" else exact(value) for value in given["values"]]
    else:
        low, high = exact(given["start"]), exact(given["stop"])
        if not varying and name not in WHOLE:
            found.ranges[name] = low, high
            return
        values = [Fraction(each) for each in range(_whole(low), _whole(high) + 1)]
    values = list(dict.fromkeys(values))
    if varying:
        found.varying[name] = values
        found.chances[name] = given.get("shares", given.get("next"))
    elif given.keys() & {"shares", "next"}:
        raise Unreadable(f"for_all.{name} has chances, and does not vary")
    else:
        found.listed[name] = values


def _whole(value: Fraction) -> int:
    if value.denominator != 1 or not 0 <= value <= 100_000:
        raise Unreadable(f"{float(value)!r} has to be a whole number")
    return int(value)


def letter_of(values: dict[str, Any], lost: bool = False) -> str:
    parts = [
        f"{name}={value if value == 'frame' else _plain(value)}" for name, value in values.items()
    ]
    return ";".join(parts + ["lost"] * lost)


def _plain(value: Fraction) -> str:
    return str(value.numerator) if value.denominator == 1 else repr(float(value))


Loop = Any  # a Controller or a Drawing
Moves = dict[Any, dict[str, tuple[str, Any, Any]]]


def frames_of(
    found: ForAll, loop_with: Callable[[dict], Loop]
) -> tuple[dict[str, Schedule], Moves]:
    """Schedules of all kinds of frames, and {losses in a row so far: {letter: (frame, losses in a row after it, None)}}.

    loop_with: the loop with other values of numbers.
    """
    kinds = [
        dict(zip(found.varying, values, strict=True)) for values in product(*found.varying.values())
    ]
    if len(kinds) * (1 + bool(found.lost)) > MOST:
        raise Unreadable(f"{len(kinds)} kinds of frames; at most {MOST}")
    of_kind = _controller if isinstance(loop_with({}), Controller) else _drawing
    schedules: dict[str, Schedule] = {}
    moves: Moves = {losses: {} for losses in range(found.lost + 1)}
    for values in kinds:
        for lost in (False, True) if found.lost else (False,):
            name = letter_of(values, lost)
            schedules[name] = _from_sample_to_sample(of_kind(found, loop_with, values, lost))
            for losses, following in moves.items():
                if not lost:
                    following[name] = (name, 0, None)
                elif losses < found.lost:
                    following[name] = (name, losses + 1, None)
    return schedules, moves


def _from_sample_to_sample(schedule: Schedule) -> Schedule:
    """The same from just after its first tick on, which comes at its end."""
    (_, sample), *others = schedule.times
    times = [(Fraction(0), "begin"), *others, (schedule.period, sample)]
    return Schedule(
        schedule.period, {**schedule.kinds, "begin": Instant()}, times, {}, schedule.motion, {}
    )


def _controller(found: ForAll, loop_with, values: dict, lost: bool) -> Schedule:
    """Of frames and results of a controller: the environment integrates over the frame, or over the nominal one."""
    nominal = loop_with({})
    loop = loop_with(values)
    if loop.key("rates.slow_hz") is not None and RATIO in found.varying:
        raise Unreadable("rates.slow_hz stands beside frames that vary")
    if loop.ratio.denominator > 1 or loop.kind in ("dc", "pmw-mean"):
        raise Unreadable(
            f"frames of {loop.kind} that vary, or do not last whole ticks, have no proof here"
        )
    if loop.delay != "frame" and (
        loop.delay > loop.ratio or (loop.delay == 0 and len(found.varying.get(DELAY, "0")) > 1)
    ):
        raise Unreadable(
            "results that come after their frame, or at once or later, have no proof here"
        )
    step = loop.choice("environment.step", "", "", "elapsed", "nominal")
    if not step and loop.kind not in ("dc-slow", "dc-lm") and RATIO in found.varying:
        raise Unreadable("environment.step is missing, where frames vary")
    if step == "nominal":
        loop.Ts = nominal.Ts
    return loop.schedule(lost)


STEPPED = {
    "difference",
    "integrator",
    "pi",
    "pid",
    "lowpass",
    "avatar",
}  # blocks whose law depends on the step
STEADY = {
    "gain",
    "hold",
    "saturation",
    "delay",
    "biquad",
    "fir",
    "mean",
    "ss",
    "tf",
    "wave",
}  # that do the same in each run


def _drawing(found: ForAll, loop_with, values: dict, lost: bool) -> Schedule:
    """Of blocks that run once in a frame, whose number of ticks is the number that `every` of them reads."""
    if lost or found.loss is not None or len(found.varying) != 1:
        raise Unreadable("in a drawn loop one number varies, and messages of channels are lost")
    loop = loop_with(values)
    (name,) = found.varying
    slow = [block for block, keys in loop.blocks.items() if name in _names(loop, keys.get("every"))]
    others = [
        block
        for block in loop.blocks
        if block not in slow and block not in loop.plants and loop.every(block) > 1
    ]
    if others or len({loop.every(block) for block in slow}) != 1:
        raise Unreadable(
            f"blocks of other rates than {name} beside frames that vary have no proof here"
        )
    for block, keys in loop.blocks.items():
        wires = [wire for port, wire in loop.wires.items() if port.startswith(f"{block}.")]
        read = _names(loop, [*(given for key, given in keys.items() if key != "every"), *wires])
        stepped = block in slow and (
            (keys["type"] in STEPPED and loop.phase(block) > 0) or "dt" in read
        )
        if stepped or name in read or (block in slow and keys["type"] not in STEPPED | STEADY):
            raise Unreadable(f"the block {block} has no rule here for steps that vary")
    return loop.schedule()


def _names(loop, given) -> set[str]:
    """All that expressions read, through names of signals and numbers."""
    if isinstance(given, list):
        return {name for each in given for name in _names(loop, each)}
    if not isinstance(given, str):
        return set()
    found = names_in(parsed(given))
    further = [loop.signals.get(name, loop.numbers.get(name)) for name in found]
    return found | _names(loop, further)
