"""From a loop with channels to a family of matrices, one for each thing that may happen to the
messages of a moment.

A channel sends a message in each of its runs. The message is in place at once, or late by some
ticks, or lost. One that is older than the newest one that has arrived is dropped. The states of a
channel are what it shows, and a register for each message that may be under way; an empty register
is set to zero in every tick, since one that kept its value would be an eigenvalue of 1 in every
frame. A matrix belongs to a step, from a moment at which some channel sends to the next. What may
follow depends on how many messages in a row were lost, and on when those under way arrive.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from wavesweep.engine.blocks import (
    FACTOR,
    PRODUCT,
    Block,
    MultirateLoop,
    ScheduledBlock,
)
from wavesweep.engine.drawing import Drawing, name_of, path_of, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import MarginalModes, Ticks
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import EnclosedLoop, Side
from wavesweep.engine.switched import (
    TOTAL_DEGREE,
    FramesOver,
    LoopFrames,
    TickPlace,
    WrittenFrames,
    inside_of,
)
from wavesweep.for_all.frames_of_members import Members, frames_of_ticks
from wavesweep.for_all.plan import ANY_NUMBER, TWO_VALUES

LOST = None  # what happens to a message that never arrives; otherwise the ticks by which it is late
MOST_SYMBOLS = 600  # matrices, beyond which no norm would be found in a useful time
NO_DRIFT = 1e-9  # of its terms: a change of what drifts below this is rounding
# Where a channel takes what it shows, or what is in a register, apart from the number of a
# register.
KEPT, SENT, NOTHING = "kept", "sent", "nothing"


class NotByWordsError(UsageError):
    """Messages whose words cannot be written out, but which may be looked at tick by tick."""


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel: when it sends, in ticks, how late its messages may be, and how many in a row may
    be lost.

    zero: whether it shows zero without a message, and not the last one. lost: ANY_NUMBER if they
    are lost at random. readers: when the blocks run that read it, each a period and a phase in
    ticks.
    """

    name: str
    every: int
    phase: int
    late: int = 0
    lost: int = 0
    zero: bool = False
    readers: tuple[tuple[int, int], ...] = ((1, 0),)

    @property
    def registers(self) -> int:
        """The most messages that are under way at once."""
        return -(-self.late // self.every)

    def sends(self, tick: int) -> bool:
        """Whether it sends in a tick."""
        return tick % self.every == self.phase

    def sent(self, tick: int) -> int:
        """The number of the last message that is sent up to a tick, 0 for the first one from tick 0
        on."""
        return (tick - self.phase) // self.every

    def oldest(self, since: int) -> int:
        """How many messages back the newest one that has arrived is at most, so many ticks after
        one was sent: all that are not lost have arrived after `late` ticks."""
        return max(0, -((since - self.late) // self.every)) + self.lost

    def different(self, tick: int) -> list[int]:
        """Return the ticks by which a message that is sent in a tick may be late, of those that no
        reader tells apart the first alone.

        A reader sees the newest message that has arrived, which is the same whenever that was
        since a reader ran. What shows zero without a message does so from when it sends, and a
        message that arrives then or later is seen.
        """
        first = {}
        for late in range(self.late + 1):
            arrives = tick + late
            waits = [(phase - arrives) % every for every, phase in self.readers]
            since = (arrives - self.phase) // self.every if self.zero else 0
            first.setdefault((arrives + min(waits, default=-arrives), since), late)
        return list(first.values())

    def block(self, shows, registers) -> Block:
        """The channel in a tick in which it shows, and holds afterwards, what it takes from
        these places, each one or several with a factor."""
        n = 1 + len(registers)
        taps = np.zeros((n, n))
        direct = np.zeros((n, 1))
        for row, source in enumerate((shows, *registers)):
            for place, factor in source if isinstance(source, tuple) else ((source, 1.0),):
                if place == SENT:
                    direct[row] += factor
                elif place != NOTHING:
                    taps[row, 0 if place == KEPT else 1 + place] += factor
        states = ("shown", *(f"message {i}" for i in range(1, n)))
        return Block(
            self.name, ("u",), ("y",), states, taps - np.eye(n), direct, taps[:1], direct[:1]
        )

    def tick(
        self, tick: int, arriving: tuple[int, ...], late: int | None
    ) -> tuple[tuple, tuple[int, ...]]:
        """What the channel takes from where in a tick, and the ticks until those messages arrive
        that are then under way.

        arriving: the same before, the oldest message first, which is the first to arrive as well:
        one that a newer message overtakes is dropped when that is sent. late: of the message that
        it sends, if it does.
        """
        sends = self.sends(tick)
        arrives = arriving[:1] == (0,)
        waiting = arriving[arrives:]
        if arrives:
            shows = 0
        elif sends and self.zero:
            shows = NOTHING
        else:
            shows = KEPT
        delivered = sends and late is not LOST
        if delivered:
            waiting = tuple(age for age in waiting if age < late)
        registers = [arrives + i for i in range(len(waiting))]
        if sends and late == 0:
            shows = SENT
        elif delivered:
            registers.append(SENT)
            waiting = (*waiting, late)
        registers += [NOTHING] * (self.registers - len(registers))
        return (shows, tuple(registers)), tuple(age - 1 for age in waiting)


@dataclass(frozen=True, slots=True)
class Sent:
    """What happens to the messages that channels send at a moment: ticks by which each is late,
    LOST of one that is lost.

    moment: the number of the moment in the frame, after which all channels are in step again.
    """

    moment: int
    late: tuple[tuple[str, int | None], ...]

    @staticmethod
    def by_channel(word: Sequence["Sent"]) -> dict[str, list[int | None]]:
        """Return what happens to the messages of each channel in a word, which is turned so that
        it begins with a frame."""
        first = next(i for i, letter in enumerate(word) if letter.moment == 0)
        ticks_by_channel: dict[str, list[int | None]] = {}
        for letter in (*word[first:], *word[:first]):
            for name, late in letter.late:
                ticks_by_channel.setdefault(name, []).append(late)
        return ticks_by_channel


def channels_of(drawing: Drawing, values: Mapping[str, object]) -> tuple[Channel, ...]:
    """Return the channels of a drawing with these numbers."""
    numbers = scalars(values)
    channels = []
    for block in drawing.channels:
        keys = dict(block.keys)
        ticks = [
            int(tree.value(numbers))
            for tree in (block.every, block.phase, keys["late"], keys["lost"])
        ]
        ticks[3] = ANY_NUMBER if block.loses_at_random else ticks[3]
        readers = readers_of(drawing, numbers, block.name)
        channels.append(Channel(block.name, *ticks, keys["missing"] == "zero", readers))
    return tuple(channels)


def readers_of(
    drawing: Drawing, numbers: Mapping[str, float], channel: str
) -> tuple[tuple[int, int], ...]:
    """Return when the blocks run that read a channel; plants and dead times read in every tick."""
    blocks = {block.name: block for block in drawing.blocks}
    readers = set()
    for port, terms in (*drawing.wires, *drawing.couplings):
        if not any(signal.rpartition(".")[0] == channel for signal, _ in terms):
            continue
        block = blocks[port.rpartition(".")[0]]
        if block.plant or block.dead_time:
            readers.add((1, 0))
            continue
        every = int(block.every.value(numbers))
        phases = block.phases or (int(block.phase.value(numbers)),)
        readers.update((every, phase) for phase in phases)
    return tuple(sorted(readers))


def frames_with_messages(
    drawing: Drawing,
    values: Mapping[str, object],
    number: str,
    most_steps: int = MOST_SYMBOLS,
) -> LoopFrames:
    """Return the family of a drawn loop with channels, along a number that one wire or gain reads.

    values: flat numbers. number: empty for the loop at these values alone. most_steps: matrices. Errors:
    UsageError for a number that the loop reads in several places; NotByWordsError for channels with
    too many things that may happen, or for messages that carry what drifts.
    """
    if number and not drawing.scalar_place(name_of(number)):
        raise UsageError(
            f"intervals along {number}: where messages may be late or lost, expected a number that one wire or gain reads "
            "linearly, found another; look along another one, and list values of this one in [sweep]: "
            f"{number.removeprefix('numbers.')} = [...]"
        )
    drawing, values, channels = _in_step(drawing, values)
    varied = {path_of(name_of(number)): TWO_VALUES} if number else {}
    pair = [all_in_time(twin, channels) for twin in Loops(drawing, values | varied).twins()]
    assembled_loop = Loops(drawing, values | dict.fromkeys(varied, 0.0)).drawn(
        name_of(number) if number else ""
    )
    steps = list(steps_of(channels, assembled_loop, most_steps))
    rows, places = places_of(assembled_loop, channels, (row for row, *_ in steps), pair[0].held())
    ticks = ticks_of(places, number)
    drift = MarginalModes.of(*pair)
    refuse_moved(ticks, drift)
    ticks, _ = drift.relative_ticks(ticks)
    follows = np.array(
        [[after in sources for _, _, _, sources in steps] for _, _, after, _ in steps]
    )
    symbols = tuple(symbol for _, symbol, *_ in steps)
    before = [row[:-1] for row in rows]
    samples = [row[-1] for row in rows]
    written = WrittenFrames(before, samples, symbols, follows)
    return LoopFrames.of(ticks, drift.remaining, written)


def messages_over(
    drawing: Drawing, values: Mapping[str, object], sides: Sequence[Side], box: np.ndarray
) -> FramesOver:
    """Return the family over the cells of a box of sides."""
    drawing, values, channels = _in_step(drawing, values)
    inside = inside_of(box)
    numbers = {side.path: side.number(inside[:, index]) for index, side in enumerate(sides)}
    pair = [all_in_time(twin, channels) for twin in Loops(drawing, values | numbers).twins()]
    drift = MarginalModes.of(*pair)
    loop = Loops(drawing, values | numbers).drawn()
    steps = list(steps_of(channels, loop))
    rows, places = places_of(loop, channels, (row for row, *_ in steps), pair[0].held())
    ticks = ticks_of(places)
    refuse_moved(ticks, drift)
    _, groups = drift.relative_ticks(ticks)
    enclosed = EnclosedLoop(drawing, values, sides, TOTAL_DEGREE)
    ahead = tuple(tuple(row[:-1]) for row in rows)
    last = tuple(row[-1] for row in rows)
    symbols = tuple(symbol for _, symbol, *_ in steps)
    copies = groups[len(drift.constant) :]
    return FramesOver([(enclosed, place) for place in places], drift, ahead, last, symbols, copies)


def members_with_messages(
    drawing: Drawing, values: Mapping[str, object], paths: Sequence[str], box: np.ndarray
) -> Members:
    """Return the steps of members of a box of numbers at these paths, in plain doubles."""
    drawing, values, channels = _in_step(drawing, values)

    def with_numbers(points):
        return values | {path: points[:, index].copy() for index, path in enumerate(paths)}

    pair = [
        all_in_time(twin, channels) for twin in Loops(drawing, with_numbers(inside_of(box))).twins()
    ]
    held_ports = pair[0].held()
    drift = MarginalModes.of(*pair)
    steps = list(steps_of(channels, Loops(drawing, values).drawn()))

    def frames_at(points):
        loop = Loops(drawing, with_numbers(points)).drawn()
        rows, places = places_of(loop, channels, (row for row, *_ in steps), held_ports)
        ticks, _ = drift.relative_ticks(ticks_of(places))
        return frames_of_ticks(ticks, drift, [row[:-1] for row in rows], [row[-1] for row in rows])

    follows = np.array([[after in sources for *_, sources in steps] for _, _, after, _ in steps])
    symbols = tuple(symbol for _, symbol, *_ in steps)
    return Members(frames_at, len(drift.remaining), symbols, follows)


def _in_step(
    drawing: Drawing, values: Mapping[str, object]
) -> tuple[Drawing, Mapping[str, object], tuple[Channel, ...]]:
    """The loop with its longest tick, if no message is late, and its channels."""
    if not any(channel.late for channel in channels_of(drawing, values)):
        drawing, values = Loops(drawing, values).in_common_tick()
    return drawing, values, channels_of(drawing, values)


def places_of(
    loop: MultirateLoop, channels: Sequence[Channel], rows: Iterable[Sequence[tuple]], held_ports
) -> tuple[list[list[int]], list[TickPlace]]:
    """Return the ticks of each row of kinds, as numbers, and the tick of each kind: the first tick
    in the frame in which the same blocks run, and what each channel takes from where in it."""
    names = frozenset(channel.name for channel in channels)
    index: dict[tuple, int] = {}
    numbers = [[index.setdefault(kind, len(index)) for kind in row] for row in rows]
    places = []
    for tick, taken in index:
        places.append(TickPlace(at_tick(loop, tick, channels, taken), 0, held_ports, names))
    return numbers, places


def ticks_of(places: Sequence[TickPlace], number: str = "") -> Ticks:
    """Return the maps of ticks, open at a number that is taken out if there is one."""
    maps = []
    for place in places:
        out = ((FACTOR,), True, PRODUCT) if number else ((), True)
        ticks = Ticks.of(place.loop, *out, held_ports=place.held, terms=True)
        maps.append(ticks.maps[ticks.kind[0]])
    return Ticks(tuple(maps), np.arange(len(maps)))


def _ticked(channels, tick, under_way, late):
    """What arrives in a tick by each channel, and what is under way after it."""
    ticked = []
    for channel, flight, lateness in zip(channels, under_way, late, strict=True):
        ticked.append(channel.tick(tick, flight, lateness))
    return zip(*ticked, strict=True)


def steps_of(
    channels: tuple[Channel, ...], loop: MultirateLoop, most_steps: int = MOST_SYMBOLS
) -> Iterator[tuple]:
    """Yield the kinds of the ticks of each step, what is sent, and the states of the channels after
    it and possible before it.

    A state is the moment's number, and for each channel how many messages in a row were lost and
    when those under way arrive. A kind of tick is the first tick in the frame in which the same
    blocks run, and what each channel takes from where in it.
    """
    frame = loop.ticks
    _, first_tick, same = np.unique(
        [block.runs(frame) for block in loop.placed], axis=1, return_index=True, return_inverse=True
    )
    alike = first_tick[same.reshape(-1)].tolist()
    moments = [tick for tick in range(frame) if any(channel.sends(tick) for channel in channels)]
    first = (0, tuple((0, ()) for _ in channels))
    steps = {}
    seen_states = {first}
    open_ = [first]
    while open_:
        state = open_.pop()
        moment, before = state
        tick = moments[moment]
        end = (*moments, moments[0] + frame)[moment + 1]
        choices = [
            _choices(channel, tick, lost)
            for channel, (lost, _) in zip(channels, before, strict=True)
        ]
        for late in product(*choices):
            row = []
            under_way = [flight for _, flight in before]
            for between in range(tick, end):
                arrivals, under_way = _ticked(channels, between, under_way, late)
                row.append((alike[between % frame], arrivals))
            sent = []
            in_a_row = []
            for channel, lateness, (lost, _) in zip(channels, late, before, strict=True):
                sends = channel.sends(tick)
                if sends:
                    sent.append((channel.name, lateness))
                if sends and channel.lost > 0:
                    in_a_row.append(lost + 1 if lateness is LOST else 0)
                else:
                    in_a_row.append(lost)
            after = (moment + 1) % len(moments), tuple(zip(in_a_row, under_way, strict=True))
            step = (tuple(row), after)
            steps.setdefault(step, (Sent(moment, tuple(sent)), set()))[1].add(state)
            if after not in seen_states:
                seen_states.add(after)
                open_.append(after)
            if len(steps) > most_steps:
                names = ", ".join(channel.name for channel in channels)
                raise NotByWordsError(
                    f"channels {names}: expected at most {most_steps} ways in which messages are late or lost, found more, as every tick "
                    "of `late` is one; write what every message takes as a delay (seconds) before the channel, choose longer "
                    "ticks, or list values in [sweep] in place of ranges of [for_all]"
                )
    for (row, after), (sent, sources) in steps.items():
        yield row, sent, after, sources


def _choices(channel, tick, lost):
    """What may happen to the message of a channel in a tick."""
    if not channel.sends(tick):
        return [LOST]
    return [
        *channel.different(tick),
        *([LOST] if lost < channel.lost or channel.lost == ANY_NUMBER else []),
    ]


def all_in_time(loop: MultirateLoop, channels: tuple[Channel, ...]) -> MultirateLoop:
    """The loop whose channels show in every tick what they read, with all of their states."""
    return in_every_tick(
        loop, channels, [(SENT, (NOTHING,) * channel.registers) for channel in channels]
    )


def in_every_tick(loop: MultirateLoop, channels, taken) -> MultirateLoop:
    """The loop whose channels take from these places in every tick."""
    blocks = {
        channel.name: channel.block(*places)
        for channel, places in zip(channels, taken, strict=True)
    }
    placed = []
    for scheduled in loop.placed:
        block = blocks.get(scheduled.block.name)
        placed.append(ScheduledBlock(block) if block else scheduled)
    return replace(loop, placed=tuple(placed))


def at_tick(
    loop: MultirateLoop, tick: int, channels: tuple[Channel, ...], taken: tuple
) -> MultirateLoop:
    """The loop of two ticks of which the first is a tick of a frame, in which channels take from
    these places; all run then."""
    channel_blocks = {
        channel.name: channel.block(*places)
        for channel, places in zip(channels, taken, strict=True)
    }
    unread = {
        f"{name}.u": {}
        for name, block in channel_blocks.items()
        if not (block.B.any() or block.D.any())
    }
    placed = []
    for scheduled in loop.placed:
        name = scheduled.block.name
        runs = name in channel_blocks or scheduled.runs(tick + 1)[tick]
        placed.append(
            ScheduledBlock(channel_blocks.get(name, scheduled.block), 2, (0, 1) if runs else 1)
        )
    return replace(loop, placed=tuple(placed), sums={**loop.sums, **unread})


def refuse_moved(ticks: Ticks, drift: MarginalModes) -> None:
    """Raise NotByWordsError if a drift moves what a channel carries, so that a message that is lost
    would change it."""
    for lead, trailing in (*drift.constant, *((lead, ()) for lead in drift.varying)):
        shift = np.zeros(len(drift.states))
        shift[lead] = 1.0
        shift[[state for state, _ in trailing]] = [factor for _, factor in trailing]
        for tick_map in ticks.maps:
            if (
                lead in drift.varying
                or (
                    np.abs(tick_map.E @ shift) > NO_DRIFT * (np.abs(tick_map.E) @ np.abs(shift))
                ).any()
            ):
                block, _, state = drift.states[lead].rpartition(".")
                spring = f", or hold it with a spring, block.{block}.stiffness" * (state == "x")
                raise NotByWordsError(
                    f"messages: expected channels that carry nothing of what drifts, found {drift.states[lead]}, which nothing "
                    f"holds in place; feed the position back{spring}"
                )
