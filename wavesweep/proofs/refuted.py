"""What refutes a number in the frames and messages of the checker."""

import re
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import lcm

from wavesweep.checker import balls, file
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader import for_all, loop_of, with_numbers
from wavesweep.program.tables.refuters import Refuter
from wavesweep.proofs.sets import decimals

SAME_TIME = Fraction(1, 10**14)  # of a tick: rounding of its time in ms
TURNS = 3  # of a pattern, after which what is held repeats


def word_of(tables: dict, claim: file.Claim, refuter: Refuter) -> list[str]:
    """Return the letters of the frames of a refuter. Errors: Refused if the checker knows none."""
    values = {
        **claim.numbers,
        **{name: balls.side(name, ends) for name, ends in claim.sides.items()},
    }
    loop = loop_of(with_numbers(tables, values), balls)
    if refuter.messages:
        return list(_messages(loop, refuter.messages))
    if refuter.ticks:
        return list(_ticks(tables, loop, map(Fraction, refuter.ticks)))
    schedules, _, _ = file.schedules_of(tables, claim, {})
    letters: dict[tuple[Fraction, str], str] = {}
    for letter, schedule in schedules.items():
        ticks = schedule.period / loop.T
        delay = re.search(rf"{for_all.DELAY}=([^;]*)", letter)
        of_frame = delay[1] if delay else getattr(loop, "delay", "")
        results = ["lost"] if letter.endswith("lost") else ["", f"delay {of_frame}"]
        letters |= {(ticks, result): letter for result in results}
    try:
        return [letters[Fraction(ticks), result] for ticks, result in refuter.frames]
    except KeyError as error:
        ticks, result = error.args[0]
        why = f"frames of {ticks} ticks{f' with {result}' * bool(result)} are none that the checker knows of"
        raise Refused(f"{why}: ratios, delays and losses of [for_all] have a proof") from None


def _ticks(tables, loop, times) -> Iterator[str]:
    """Yield a letter for each tick of a pattern."""
    low, high = for_all.time_of_tick(loop, tables["for_all"].get("tick", {}))
    for time in times:
        if abs(time / 1000 - low) < SAME_TIME * low:
            yield "start"
        elif abs(time / 1000 - high) < SAME_TIME * high:
            yield "stop"
        else:
            yield decimals(time / 1000)


def _messages(loop, messages: Mapping[str, Sequence[int | None]]) -> Iterator[str]:
    """Yield a letter for each tick of a pattern in which a message may come."""
    channels = {name: for_all.channel_of(loop, name) for name in messages}
    frame = loop.frame_ticks()
    period = lcm(frame, *(len(messages[name]) * every for name, (every, *_) in channels.items()))
    newest: dict[str, list[int]] = {}
    for name, (every, phase, *_) in channels.items():
        arrivals: dict[int, int] = {}
        for number in range((TURNS + 1) * period // every):
            late = messages[name][number % len(messages[name])]
            if late is not None:
                tick = phase + every * number + late
                arrivals[tick] = max(number, arrivals.get(tick, -1))
        held = [-1]
        for tick in range((TURNS + 1) * period):
            held.append(max(held[-1], arrivals.get(tick, -1)))
        newest[name] = held  # after tick t at t + 1
    for tick in range(TURNS * period, (TURNS + 1) * period):
        first = tick % frame
        if not any(for_all.may_come(channel, first) for channel in channels.values()):
            continue
        parts = []
        for name, (every, phase, *_) in channels.items():
            before, now = newest[name][tick : tick + 2]
            back = (tick - phase) // every - now
            parts.append(f"{name} {'gets' if now > before else 'has'} {back}")
        yield f"{first}: {', '.join(parts)}"
