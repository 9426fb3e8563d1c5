"""What [for_all] and channels allow: numbers that are not known, and kinds of frames with what may follow.

A frame goes from the tick after a sample of the slow environment to its next sample. Then all in it depends on its own length:
the step of this sample is the time since the last one, or the nominal one. Where some results are in place at once, and others
are not, a frame goes from its sample to the tick before the next one, which no step may depend on.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product
from math import prod
from typing import Any

from .controllers import Controller
from .drawings import Drawing, loses_at_random
from .expressions import names_in, parsed
from .loops import Instant, Schedule, Unreadable
from .names import EDGES, FILTERS, OWN, axes, called, path_of, rule_of, values_of

RATIO = "rates.ratio"
TICK = "for_all.tick"  # the side that is the time of a tick
DELAY = "environment.delay"
COUNTS = {
    "every",
    "phase",
    "steps",
    "order",
    "n",
    "late",
    "lost",
}  # of blocks: a number that one of them reads is whole
MOST = 256  # combinations of listed values, and kinds of frames
MESSAGES = {"late", "lost", "loss", "burst"}  # what may happen to those of a channel
LONGEST_TICK = 10_000  # of the spec's own ticks
MOST_VARYING, MOST_LOST, LARGEST_WEIGHT = 64, 16, 10**12
MOST_STATES = 10_000  # of what receivers have


@dataclass
class ForAll:
    """ranges, listed: numbers that are constant but not known; varying: those that may change from frame to frame.

    shares, following: weights of the values of those that vary at random, alone or after each value. lost: slow results in a row
    that may not come; loss: the probability that one does not. tick: the times of a tick, another one each time. contact: whether
    walls that let go are asked for.
    """

    ranges: dict[str, tuple[Fraction, Fraction]] = field(default_factory=dict)
    listed: dict[str, list] = field(default_factory=dict)
    varying: dict[str, list] = field(default_factory=dict)
    shares: dict[str, list] = field(default_factory=dict)
    following: dict[str, list] = field(default_factory=dict)
    lost: int = 0
    loss: Fraction = Fraction(0)
    tick: dict[str, Any] = field(default_factory=dict)
    contact: bool = False

    @property
    def asked(self) -> bool:
        """Whether it says anything but of contact."""
        numbers = self.ranges or self.listed or self.varying
        return bool(numbers or self.lost or self.tick or self.loss)

    @property
    def members(self) -> list[dict[str, Any]]:
        """All combinations of listed values, the last key fastest."""
        count = prod(map(len, self.listed.values()))
        if count > MOST:
            raise Unreadable(f"{count} combinations of values; at most {MOST}")
        return [
            dict(zip(self.listed, values, strict=True)) for values in product(*self.listed.values())
        ]


def read(tables: dict, exact: Callable[[Any], Fraction]) -> ForAll:
    """The table [for_all] of a spec; what it says of numbers by their one name."""
    found = ForAll()
    table = tables.get("for_all", {})
    controller = "controller" in tables
    blocks = tables.get("block", {}).values()
    texts = [str(keys[key]) for keys in blocks for key in COUNTS & keys.keys()]
    counts = {name for text in texts for name in names_in(parsed(text))}
    named = dict(axes(tables, "for_all", table))
    for name, entry in named.items():
        number = called(tables, name)
        varying = isinstance(entry, dict) and entry.get("varying")
        if varying and controller and number not in (RATIO, DELAY):
            raise Unreadable(f"{number} varies from frame to frame: expected {RATIO} or {DELAY}")
        rule = rule_of(tables, path_of(tables, name))
        _of_number(found, number, entry, exact, rule.whole if rule else number in counts)
    elapsed = tables.get("environment", {}).get("step") != "nominal"
    for name, values in [*found.varying.items()]:
        if len(values) == 1 and elapsed and name not in found.shares | found.following:
            found.listed[name] = found.varying.pop(name)
    entry = {name: table[name] for name in OWN["for_all"] if name in table.keys() - named.keys()}
    found.lost = _whole(exact(entry.get("lost", 0)), MOST_LOST)
    found.loss = exact(entry.get("loss", 0))
    if not 0 <= found.loss <= 1:
        raise Unreadable(f"for_all.loss = {float(found.loss):g} is no probability")
    found.tick = entry.get("tick", {})
    found.contact = entry.get("contact", False)
    if not isinstance(found.contact, bool) or not isinstance(found.tick, dict):
        raise Unreadable("for_all.contact is true or false, and for_all.tick a table")
    times = [exact(time) for key, time in found.tick.items() if key != "steps"]
    if "tick" in entry and not (times and all(time > 0 for time in times)):
        raise Unreadable("for_all.tick: times are above 0")
    wide = any(low < high for low, high in found.ranges.values())
    channels = [keys for keys in blocks if keys["type"] == "channel" and keys.keys() & MESSAGES]
    if found.contact and (found.loss or wide or found.shares or found.following or channels):
        raise Unreadable(
            "for_all.contact beside a range, chances, or messages that are late or lost"
        )
    if not controller and (found.lost or found.loss):
        raise Unreadable(
            "for_all has lost or loss beside a drawn loop, whose channels say what is lost"
        )
    if found.tick and (named or found.lost or found.loss or found.contact):
        raise Unreadable("tick stands alone in [for_all]")
    _refuse_chances(found, exact)
    if controller:
        _refuse_what_follows(tables, found)
    return found


def _refuse_chances(table: ForAll, exact) -> None:
    """Unreadable for weights that are not those of the values, or beside what is not at random."""
    if not (table.loss or table.shares or table.following):
        return
    missing = [name for name in table.varying if name not in table.shares | table.following]
    if table.lost or missing:
        raise Unreadable(
            f"for_all.{'lost' if table.lost else missing[0]} has no chances, beside others that have"
        )
    lengths = next((len(values) for name, values in table.varying.items() if name != DELAY), 1)
    for name, given in (table.shares | table.following).items():
        size = len(table.varying[name])
        rows = given
        if name not in table.following and not (name == DELAY and isinstance(given[0], list)):
            rows = [given]
        elif len(given) != lengths:
            raise Unreadable(
                f"for_all.{name} has not one list of chances for each length of frames"
            )
        for row in rows:
            weights = [exact(weight) for weight in row]
            if len(weights) != size or min(weights) < 0 or not 0 < max(weights) <= LARGEST_WEIGHT:
                raise Unreadable(f"for_all.{name} has not one share of 0 and more for each value")


def _refuse_what_follows(tables: dict, found: ForAll) -> None:
    """Unreadable for numbers from which others of the spec follow."""
    loop = tables.get("filters", {})
    edged = [f"filters.{name}" for name in FILTERS if loop.get(name, {}).keys() & {*EDGES}]
    slow = "slow_hz" in tables.get("rates", {})
    for name in (*found.ranges, *found.listed, *found.varying):
        table, _, key = name.rpartition(".")
        of_fast = name == "rates.fast_hz" and (slow or edged)
        if (
            key in EDGES
            or name == "rates.slow_hz"
            or of_fast
            or (table in edged and key != "ratio")
        ):
            raise Unreadable(f"for_all.{name}: other numbers follow from it, or it from others")


def _of_number(table: ForAll, name: str, entry: Any, exact, whole: bool):
    values = [exact(value) for value in values_of("for_all", name, entry)]
    chances: set = set()
    varying = False
    if isinstance(entry, dict):
        varying = entry.get("varying", False)
        chances = entry.keys() & {"shares", "next"}
        if not isinstance(varying, bool):
            raise Unreadable(f"for_all.{name}.varying is true or false")
        if "start" in entry:
            low, high = values
            if not varying and not whole:
                table.ranges[name] = low, high
                return
            values = [Fraction(count) for count in range(_whole(low), _whole(high) + 1)]
        if chances and not (varying and "values" in entry):
            raise Unreadable(f"for_all.{name} has chances, and does not vary, or has no values")
        if len(chances) > 1 or (name == DELAY and "next" in chances):
            raise Unreadable(f"for_all.{name} has shares or next, and delays have shares alone")
    if len(set(values)) < len(values):
        raise Unreadable(f"for_all.{name} has a value twice")
    if not varying:
        table.listed[name] = values
        return
    if len(values) > MOST_VARYING:
        raise Unreadable(f"for_all.{name} has {len(values)} values; at most {MOST_VARYING} vary")
    table.varying[name] = values
    for part, stored in (("shares", table.shares), ("next", table.following)):
        if part in chances:
            stored[name] = entry[part]


def _whole(value: Fraction, highest: int = 100_000) -> int:
    if value.denominator != 1 or not 0 <= value <= highest:
        raise Unreadable(f"{float(value)!r} has to be a whole number")
    return int(value)


def letter_of(values: dict[str, Any], lost: bool = False) -> str:
    parts = [f"{name}={_plain(value)}" for name, value in values.items()]
    return ";".join(parts + ["lost"] * lost)


def _plain(value: Fraction) -> str:
    return str(value.numerator) if value.denominator == 1 else repr(float(value))


Loop = Any  # a Controller or a Drawing
Moves = dict[Any, dict[str, tuple[str, Any, Any]]]


def frames_of(
    table: ForAll, loop_with: Callable[[dict], Loop], random: bool
) -> tuple[dict[str, Schedule], Moves, Any]:
    """Schedules of all kinds of frames, what may follow what, and the state in which a run begins.

    In any order a state is how many results in a row were lost; at random it is the kind of frame before. loop_with: the loop
    with other values of numbers.
    """
    kinds = [
        dict(zip(table.varying, values, strict=True)) for values in product(*table.varying.values())
    ]
    fates = (False, True) if table.lost or table.loss else (False,)
    if len(kinds) * len(fates) > MOST:
        raise Unreadable(f"{len(kinds) * len(fates)} kinds of frames; at most {MOST}")
    if not random and table.loss:
        raise Unreadable("results are lost at random, which no proof for all of them holds for")
    of_kind = _controller if isinstance(loop_with({}), Controller) else _drawing
    schedules: dict[str, Schedule] = {}
    for values in kinds:
        for lost in fates:
            schedules[letter_of(values, lost)] = of_kind(table, loop_with, values, lost)
    if random:
        return schedules, _at_random(table, kinds, fates, loop_with({}).arithmetic), None
    moves: Moves = {losses: {} for losses in range(table.lost + 1)}
    for losses, following in moves.items():
        for values in kinds:
            following[letter_of(values)] = (letter_of(values), 0, None)
            if losses < table.lost:
                following[letter_of(values, True)] = (letter_of(values, True), losses + 1, None)
    return schedules, moves, 0


def _at_random(table: ForAll, kinds, fates, arithmetic) -> Moves:
    """The chain of lengths, or None alone if no length depends on the one before; all else is independent."""
    if table.lost:
        raise Unreadable("lost counts results in a row, and loss is their probability")
    loss = arithmetic.number(table.loss)
    length = RATIO if RATIO in table.varying else next(iter(table.varying), "")
    chain = table.following.get(length)
    moves: Moves = {}
    for before in table.varying[length] if chain else [None]:
        moves[before] = {}
        for values in kinds:
            chance = arithmetic.number(1)
            for name in table.varying:
                weights = (
                    chain[table.varying[name].index(before)]
                    if chain and name == length
                    else table.shares.get(name)
                )
                if isinstance(weights[0], list):
                    weights = weights[table.varying[length].index(values[length])]
                share = arithmetic.exact(weights[table.varying[name].index(values[name])])
                chance = chance * (share / sum(map(arithmetic.exact, weights)))
            for lost in fates:
                of_result = chance * (loss if lost else 1 - loss)
                letter = letter_of(values, lost)
                if of_result:
                    moves[before][letter] = (letter, values[length] if chain else None, of_result)
    return moves


def _from_sample_to_sample(schedule: Schedule) -> Schedule:
    """The same from just after its first tick on, which comes at its end."""
    (_, sample), *remaining = schedule.times
    times = [(Fraction(0), "begin"), *remaining, (schedule.period, sample)]
    return Schedule(schedule.period, {**schedule.kinds, "begin": Instant()}, times, schedule.motion)


def _controller(table: ForAll, loop_with, values: dict, lost: bool) -> Schedule:
    """Of frames and results of a controller: the environment integrates over the frame, or over the nominal one."""
    nominal = loop_with({})
    loop = loop_with(values)
    if nominal.ratio.denominator > 1 or loop.kind in ("dc", "pmw-mean"):
        raise Unreadable(
            f"frames of {loop.kind} that vary, or do not last whole ticks, have no proof here"
        )
    step = loop.key("environment.step", "elapsed")
    if step == "nominal":
        loop.Ts = nominal.Ts
    delays = table.varying.get(DELAY, [])
    if 0 not in delays or len(delays) == 1:
        return _from_sample_to_sample(loop.schedule(lost))
    elapsed = step != "nominal" and RATIO in table.varying
    if loop.delay == loop.ratio or (elapsed and loop.kind not in ("dc-slow", "dc-lm")):
        raise Unreadable(
            "results at once, beside others of the next sample or steps that elapse, have no proof here"
        )
    return loop.schedule(lost)


def time_of_tick(loop: Loop, entry: dict) -> tuple[Fraction, Fraction]:
    """The shortest and the longest time (s) of a tick of [for_all] tick; the program counts with its own one."""
    exact = loop.arithmetic.exact
    own = exact(loop.T)
    keys = entry.keys() - {"steps"}
    if keys == {"late"}:
        low, high = own, own + exact(entry["late"])
    elif keys == {"start", "stop"}:
        low, high = exact(entry["start"]), exact(entry["stop"])
    else:
        raise Unreadable(f"for_all.tick has late, or start and stop, and not {', '.join(keys)}")
    if entry.get("steps", "nominal") != "nominal":
        raise Unreadable(
            "for_all.tick: a program that divides by the measured time has no proof here"
        )
    if not 0 < low <= own <= high <= LONGEST_TICK * own or low == high:
        raise Unreadable(
            "for_all.tick: times up from start to stop, above 0, with the spec's own one among them, "
            f"and at most {LONGEST_TICK} times this one"
        )
    return low, high


def ticks_of(
    loop: Loop, times: dict[str, tuple[Fraction, Fraction]]
) -> tuple[dict[str, Schedule], Moves]:
    """Each tick of a period by itself, whose times are those of some letters, {letter: from a time to another}.

    What moves does so for as long as the tick takes; all else is that of the own tick. Equal ticks are one kind.
    """
    whole = loop.schedule()
    dead = loop.late if isinstance(loop, Drawing) else loop.key("device.dead_time", 0) != 0
    if (
        dead
        or has_messages(loop)
        or [time for time, _ in whole.times] != [tick * loop.T for tick in range(len(whole.times))]
    ):
        raise Unreadable(
            "for_all.tick beside dead times, messages, or a frame of no whole ticks has no proof here"
        )
    schedules = {}
    moves: Moves = {}
    instants = [instant for _, instant in whole.times]
    for place, instant in enumerate(instants):
        moves[place] = {}
        for letter, ends in times.items():
            kind = f"{instants.index(instant)}: {letter}"
            low, high = ends
            time = loop.arithmetic.side(TICK, ends) if low < high else low
            schedules[kind] = Schedule(
                time,
                {instant: whole.kinds[instant]},
                [(Fraction(0), instant)],
                whole.motion,
            )
            moves[place][letter] = kind, (place + 1) % len(instants), None
    return schedules, moves


def has_messages(loop: Loop) -> bool:
    """Whether something may happen to messages of channels."""
    return isinstance(loop, Drawing) and any(
        keys["type"] == "channel" and keys.keys() & MESSAGES for keys in loop.blocks.values()
    )


def messages_of(loop: Drawing) -> tuple[dict[str, Schedule], Moves, Any]:
    """{letter: stretch}, {state: {letter: (letter, next state, None)}}, and the state in which a run begins, all messages there.

    A stretch goes from a tick in which a message may come, or has to be there, to the next such tick. A state is (place of the
    next stretch, what each receiver has), a message by how many were sent after it: 0 is the newest. A letter says the tick, and
    what each receiver then gets, or has and keeps: see `_next`.
    """
    channels = {
        name: channel_of(loop, name)
        for name, keys in loop.blocks.items()
        if keys["type"] == "channel"
    }
    cuts, ends = _stretches(loop, channels.values())
    start = (0, tuple(0 for _ in channels))
    moves: Moves = {}
    schedules: dict[str, Schedule] = {}
    todo = [start]
    while todo:
        place, before = state = todo.pop()
        if state in moves:
            continue
        first, until = cuts[place], ends[place]
        receivers = zip(channels.values(), before, strict=True)
        options = [_next(channel, first, back) for channel, back in receivers]
        moves[state] = {}
        for after in product(*options):
            receivers = zip(channels, after, strict=True)
            parts = [f"{name} {'gets' if new else 'has'} {back}" for name, (back, new) in receivers]
            letter = f"{first}: {', '.join(parts)}"
            if letter not in schedules:
                gets = [back if new else None for back, new in after]
                schedules[letter] = _stretch(loop, channels, first, until, gets)
            following = ((place + 1) % len(cuts), tuple(back for back, _ in after))
            moves[state][letter] = (letter, following, None)
            todo.append(following)
        if len(moves) > MOST_STATES:
            raise Unreadable(f"more than {MOST_STATES} states of messages")
    return schedules, moves, start


def messages_at_random(loop: Drawing) -> tuple[dict[str, Schedule], Moves, Any]:
    """The chain of channels that lose messages at random: a state is the next tick in which some send, and which are in a burst.

    With each message a burst begins or ends, and then it is lost with the probability of this state.
    """
    channels = [name for name, keys in loop.blocks.items() if keys["type"] == "channel"]
    for name in channels:
        if loop.whole(name, "late", 0) or loop.whole(name, "lost", 0):
            raise Unreadable(
                f"messages of {name} are late, or lost in a row, beside some that are lost at random"
            )
    cuts, ends = _stretches(loop, [(loop.every(name), loop.phase(name), 0, 0) for name in channels])
    schedules: dict[str, Schedule] = {}
    moves: Moves = {}
    todo = [(0, (False,) * len(channels))]
    while todo:
        place, bursts = state = todo.pop(0)
        if state in moves:
            continue
        first = cuts[place]
        moves[state] = {}
        sends = [(first - loop.phase(name)) % loop.every(name) == 0 for name in channels]
        facts = zip(channels, bursts, sends, strict=True)
        fates = [_fates(loop, *facts_of_channel) for facts_of_channel in facts]
        for outcome in product(*fates):
            chance = loop.arithmetic.number(1)
            for _, _, chance_of_channel in outcome:
                chance = chance * chance_of_channel
            if not chance:
                continue
            after = tuple(burst for burst, _, _ in outcome)
            gets = [0 if comes else None for _, comes, _ in outcome]
            letter = f"{first}: {', '.join(f'{name} gets {new}' for name, new in zip(channels, gets, strict=True))}"
            if letter not in schedules:
                schedules[letter] = _stretch(loop, channels, first, ends[place], gets)
            following = ((place + 1) % len(cuts), after)
            moves[state][f"{letter} {after}"] = (letter, following, chance)
            todo.append(following)
    return schedules, moves, None


def _fates(loop: Drawing, name: str, burst: bool, sends: bool) -> list[tuple[bool, bool, Any]]:
    """What may happen to a channel in a tick: (in a burst after it, whether a message comes, probability)."""
    number = loop.arithmetic.number
    if not sends:
        return [(burst, False, number(1))]
    begins, ends = loop.value(name, "burst", 0), loop.value(name, "burst_end", 1)
    changes = ends if burst else begins
    fates = []
    for after, of_burst in ((burst, 1 - changes), (not burst, changes)):
        loss = loop.value(name, "burst_loss", 1) if after else loop.value(name, "loss", 0)
        fates += [(after, True, of_burst * (1 - loss)), (after, False, of_burst * loss)]
    return fates


def channel_of(loop: Drawing, name: str) -> tuple[int, int, int, int]:
    """(every, phase, late, lost)."""
    late = loop.whole(name, "late", 0)
    lost = loop.whole(name, "lost", 0)
    if loses_at_random(loop.blocks[name]):
        raise Unreadable(
            f"messages of {name} are lost at random, which no proof for all of them holds for"
        )
    if late and loop.word(name, "missing", "held") == "zero":
        raise Unreadable(
            f"messages of {name} that are late, and zero where they are missing, have no proof here"
        )
    return loop.every(name), loop.phase(name), late, lost


def may_come(channel, tick: int) -> bool:
    """Whether in this tick a message may come, or has to be there or lost."""
    every, phase, late, _ = channel
    return (tick - phase) % every <= late


def _stretches(loop: Drawing, channels) -> tuple[list[int], list[int]]:
    """The ticks of a period in which messages may come, and where the stretches that begin there end."""
    period = loop.frame_ticks()
    cuts = [tick for tick in range(period) if any(may_come(channel, tick) for channel in channels)]
    return cuts, [*cuts[1:], period + cuts[0]]


def _next(channel, tick: int, back: int) -> list[tuple[int, bool]]:
    """What a receiver that had the message `back` before a tick may have after it: (message, whether it is new).

    A message comes no later than `late` ticks after it was sent. Of those newer than what is there, at most `lost` were sent so
    long ago, or longer.
    """
    every, phase, late, lost = channel
    age = (tick - phase) % every
    oldest = back + (age == 0)
    outcomes = [(new, True) for new in range(oldest) if age + every * new <= late]
    outcomes.append((oldest, False))
    return [
        (has, new)
        for has, new in outcomes
        if sum(age + every * age_of_new >= late for age_of_new in range(has)) <= lost
    ]


def _stretch(loop: Drawing, channels, first: int, until: int, gets) -> Schedule:
    """The instants from a tick to the one before another, of which the first one brings messages."""
    messages: list[dict] = [dict.fromkeys(channels) for _ in range(loop.frame_ticks())]
    messages[first] = dict(zip(channels, gets, strict=True))
    whole = loop.schedule(messages)
    times = [(time + again * whole.period, kind) for again in (0, 1) for time, kind in whole.times]
    begin = first * loop.arithmetic.exact(loop.T)
    end = until * loop.arithmetic.exact(loop.T)
    times = [
        (time - begin, kind) for time, kind in times if begin <= loop.arithmetic.least(time) < end
    ]
    return Schedule(end - begin, whole.kinds, times, whole.motion)


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


def _drawing(table: ForAll, loop_with, values: dict, lost: bool) -> Schedule:
    """Of blocks that run once in a frame, whose number of ticks is the number that `every` of them reads."""
    if lost or table.loss or len(table.varying) != 1:
        raise Unreadable("in a drawn loop one number varies, and messages of channels are lost")
    loop = loop_with(values)
    (name,) = table.varying
    if name in loop.names_read(loop.key("rates.tick_hz")):
        raise Unreadable(f"the tick lasts as long as {name} says, which varies from frame to frame")
    slow = [
        block for block, keys in loop.blocks.items() if name in loop.names_read(keys.get("every"))
    ]
    other_rates = [
        block
        for block in loop.blocks
        if block not in slow and block not in loop.plants and loop.every(block) > 1
    ]
    if other_rates or len({loop.every(block) for block in slow}) != 1:
        raise Unreadable(
            f"blocks of other rates than {name} beside frames that vary have no proof here"
        )
    for block, keys in loop.blocks.items():
        wires = [wire for port, wire in loop.wires.items() if port.startswith(f"{block}.")]
        read = loop.names_read([*(entry for key, entry in keys.items() if key != "every"), *wires])
        stepped = block in slow and (
            (keys["type"] in STEPPED and loop.phase(block) > 0) or "dt" in read
        )
        if stepped or name in read or (block in slow and keys["type"] not in STEPPED | STEADY):
            raise Unreadable(f"the block {block} has no rule here for steps that vary")
    return _from_sample_to_sample(loop.schedule())
