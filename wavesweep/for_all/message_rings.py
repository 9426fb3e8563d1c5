"""Messages tick by tick: whatever they do, a receiver holds one of the last few in each tick.

What is held stays until a newer message comes, and is at most so many sends back as `late` and
`lost` allow. Every such sequence can happen, as a message that is passed over may be lost, or come
later than a newer one and be dropped. So the loop has a matrix for each place in its period and
each choice of messages that are held there; places follow each other in a ring. A word of whole
messages has a matrix for each of the products of these choices over a period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from wavesweep.engine.blocks import FACTOR, PRODUCT, MultirateLoop, ScheduledBlock
from wavesweep.engine.doubles import UNIT_ROUNDING
from wavesweep.engine.drawing import Drawing, name_of, path_of, scalars
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import MarginalModes, Ticks
from wavesweep.engine.loop import Loops
from wavesweep.for_all.channel_families import (
    SENT,
    Channel,
    NotByWordsError,
    at_tick,
    channels_of,
    frames_with_messages,
    readers_of,
    refuse_moved,
)
from wavesweep.for_all.graph import Graph
from wavesweep.for_all.loop_frames import LoopFrames, WrittenFrames
from wavesweep.for_all.plan import TWO_VALUES

MOST_WORDS = 50  # of whole messages: beyond it the norms of a ring are found ten times sooner
MOST_HELD = 3000  # matrices of a ring: beyond it a step of a search takes minutes


@dataclass(frozen=True, slots=True)
class Held:
    """What receivers hold at a tick of the period: of each channel how many messages back,
    None where nothing reads it."""

    tick: int
    back: tuple[int | None, ...]


@dataclass(frozen=True, slots=True, eq=False)
class RingFrames:
    """Frames at places that follow each other in a ring, as a `Family` of square matrices; each
    place has the states alone that are read after it.

    whole: the frames in all states. place: of each symbol. slots: the states of `whole` at each
    place, `(places, n)`, -1 where a place has fewer: these are zero. channels: as they send here. earlier:
    how many messages later in the loop as it is drawn the first one of each in a period is sent.
    """

    whole: LoopFrames
    place: np.ndarray
    period: int
    slots: np.ndarray
    channels: tuple[Channel, ...]
    earlier: tuple[int, ...]
    drift = None

    @property
    def symbols(self) -> Sequence[Held]:
        """What is held with each matrix."""
        return self.whole.symbols

    @property
    def follows(self) -> np.ndarray:
        """See `Family`."""
        return self.whole.follows

    @property
    def graph(self) -> Graph:
        """The ring: a node for each place."""
        places = len(self.slots)
        return Graph(self.place, np.arange(len(self.place)), (self.place + 1) % places)

    @property
    def _picked(self):
        """The states that each matrix goes to and comes from, and which entries there are."""
        rows = self.slots[(self.place + 1) % len(self.slots)][:, :, None]
        columns = self.slots[self.place][:, None]
        return rows, columns, (rows >= 0) & (columns >= 0)

    def at(self, x: float) -> np.ndarray:
        """See `Family`."""
        rows, columns, there = self._picked
        symbol = np.arange(len(self.place))[:, None, None]
        return np.where(there, self.whole.at(x)[symbol, rows, columns], 0.0)

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """See `Family`."""
        return self._of_places(*self.whole.enclosed(x))

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """See `Family`."""
        points = self.whole.hull(low, high)
        return points and self._of_places(*points)

    def _of_places(self, E, dE):
        """Changes `(..., symbols, n, n)` in the states of each place, with bounds on their errors."""
        rows, columns, there = self._picked
        symbol = np.arange(len(self.place))[:, None, None]
        own = there & (rows == columns)
        diagonal = np.eye(self.slots.shape[1], dtype=bool)
        picked = np.where(there, E[..., symbol, rows, columns], 0.0)
        moved = picked + own - diagonal
        rounding = np.where(own == diagonal, 0.0, 2 * UNIT_ROUNDING * (1 + np.abs(moved)))
        return (
            np.where(own == diagonal, picked, moved),
            np.where(there, dE[..., symbol, rows, columns], 0.0) + rounding,
        )


def frames_of_messages(
    drawing: Drawing, values: Mapping[str, object], number: str = ""
) -> LoopFrames | RingFrames:
    """Return the family of a drawn loop with channels: by words of whole messages if these are few,
    otherwise tick by tick; see `frames_with_messages`."""
    channels = channels_of(drawing, values)
    late = any(channel.late for channel in channels)
    if not late or any(channel.zero for channel in channels):
        return frames_with_messages(drawing, values, number)
    try:
        return frames_with_messages(drawing, values, number, MOST_WORDS)
    except NotByWordsError:
        return ring_of_messages(drawing, values, channels, number)


def ring_of_messages(
    drawing: Drawing, values: Mapping[str, object], channels: Sequence[Channel], number: str = ""
) -> RingFrames:
    """Return the ring of a drawn loop with channels, along a number that one wire or gain reads.

    values: flat numbers. number: empty for the loop at these values alone. Errors: UsageError for too
    many choices, and for messages that carry what drifts and may be zero in place of it.
    """
    varied = {path_of(name_of(number)): TWO_VALUES} if number else {}
    opened = Loops(drawing, values | dict.fromkeys(varied, 0.0)).drawn(
        name_of(number) if number else ""
    )
    delays = _delays_behind(opened, channels)
    loop = _swapped(opened, delays)
    before = []
    for channel in channels:
        reader, steps = delays.get(channel.name, (channel.name, 0))
        phase = (channel.phase + steps) % channel.every
        readers = readers_of(drawing, scalars(values), reader)
        before.append(replace(channel, phase=phase, readers=readers))
    choices = [[_choices(each, tick) for each in before] for tick in range(loop.ticks)]
    counts = [_count([row[at] for row in choices]) for at in range(len(before))]
    pair = []
    for twin in Loops(drawing, values | varied).twins():
        pair.append(_in_every_tick(_swapped(twin, delays), before, counts))
    symbols, kinds = _places(loop, before, choices, counts)
    number_of_kind = {
        kind: at for at, kind in enumerate(dict.fromkeys(k for row in kinds for k in row))
    }
    maps = []
    held = pair[0].held()
    for tick, taken in number_of_kind:
        ticks = Ticks.of(
            at_tick(loop, tick, before, taken),
            (FACTOR,) if number else (),
            True,
            PRODUCT if number else "",
            held,
            terms=True,
        )
        maps.append(ticks.maps[ticks.kind[0]])
    ticks = Ticks(tuple(maps), np.arange(len(maps)))
    drift = MarginalModes.of(*pair)
    refuse_moved(ticks, drift)
    ticks, _ = drift.relative_ticks(ticks)
    rows = [tuple(number_of_kind[kind] for kind in row) for row in kinds]
    of_place = list(dict.fromkeys(each.tick for each in symbols))
    place = np.array([of_place.index(each.tick) for each in symbols])
    written = WrittenFrames(
        [row[:-1] for row in rows],
        [row[-1] for row in rows],
        tuple(symbols),
        (place[:, None] + 1) % (1 + place.max()) == place,
    )
    whole = LoopFrames.of(ticks, drift.remaining, written)
    acts = [each[np.ix_(whole.kept, whole.kept)] for each in whole.patterns]
    earlier = tuple(
        (each.phase + delays.get(each.name, ("", 0))[1]) // each.every for each in channels
    )
    return RingFrames(
        whole, place, loop.ticks, _slots(np.array(acts), place), tuple(before), earlier
    )


def _choices(channel: Channel, tick: int) -> list[int | None]:
    """How many messages back a receiver may hold one in a tick; None if nothing reads it."""
    since = (tick - channel.phase) % channel.every
    if not any((tick - phase) % every == 0 for every, phase in channel.readers):
        return [None]
    return list(range(channel.oldest(since) + 1))


def _count(choices) -> int:
    """The messages that a channel keeps, of which any may be held."""
    return 1 + max(each for row in choices for each in (0, *row) if isinstance(each, int))


def _places(loop: MultirateLoop, channels, choices, counts) -> tuple[list[Held], list[list[tuple]]]:
    """What may be held at each place, and the kinds of ticks from it up to the next place.

    A kind is the first tick of the period in which the same blocks run, and what each channel takes
    from where in it.
    """
    runs = [block.runs(loop.ticks) for block in loop.placed]
    _, first, same = np.unique(runs, axis=1, return_index=True, return_inverse=True)
    alike = first[same.reshape(-1)].tolist()

    def kind(tick, back):
        taken = []
        for channel, count, each in zip(channels, counts, back, strict=True):
            taken.append(_taken(channel.sends(tick), count, each))
        return alike[tick], tuple(taken)

    ways = [int(np.prod([len(each) for each in row])) for row in choices]
    places = [tick for tick in range(loop.ticks) if ways[tick] > 1] or [0]
    if sum(ways[tick] for tick in places) > MOST_HELD:
        names = ", ".join(channel.name for channel in channels)
        raise UsageError(
            f"channels {names}: expected at most {MOST_HELD} ways in which receivers hold one of the last messages in a tick of "
            "their period, found more; choose longer ticks, or less `late` and `lost`"
        )
    symbols = []
    kinds = []
    for tick, later in zip(places, [*places[1:], places[0] + loop.ticks], strict=True):
        rest = [
            kind(at % loop.ticks, [each[0] for each in choices[at % loop.ticks]])
            for at in range(tick + 1, later)
        ]
        for back in product(*choices[tick]):
            symbols.append(Held(tick, back))
            kinds.append([kind(tick, back), *rest])
    return symbols, kinds


def _taken(sends: bool, count: int, back: int | None) -> tuple[object, tuple]:
    """What a channel shows, and what its registers, of the last messages, take from where."""
    registers: list[object] = [SENT, *range(count - 1)] if sends else list(range(count))
    return registers[back or 0], tuple(registers)


def _slots(acts: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the states that are read after each place and not always zero there, `(places, n)`,
    each at the same index from place to place as far as can be.

    acts: entries of each matrix that may be nonzero.
    """
    places = place.max() + 1
    act = np.array([acts[place == at].any(0) for at in range(places)])
    live = np.ones(act.shape[:2], bool)
    while True:
        after = np.roll(live, -1, 0)
        read = (act & after[:, :, None]).any(1)
        set_ = np.roll((act & live[:, None]).any(2), 1, 0)
        less = live & read & set_
        if (less == live).all():
            break
        live = less
    slots = np.full((places, max(1, live.sum(1).max())), -1)
    for at in range(places):
        new = list(np.flatnonzero(live[at]))
        for index, state in enumerate(slots[at - 1]) if at else ():
            if state in new:
                slots[at, index] = state
                new.remove(state)
        slots[at, np.flatnonzero(slots[at] < 0)[: len(new)]] = new
    return slots


def _delays_behind(loop: MultirateLoop, channels) -> dict[str, tuple[str, int]]:
    """The delay in every tick that alone reads a channel, and its ticks, by the channel's name."""
    found = {}
    for channel in channels:
        signal = f"{channel.name}.y"
        readers = [port for port, terms in loop.sums.items() if signal in terms]
        for scheduled in loop.placed:
            block = scheduled.block
            if readers == [f"{block.name}.u"] and loop.sums[readers[0]] == {signal: 1.0}:
                steps = len(block.states)
                shifts = np.eye(steps, k=-1) - np.eye(steps)
                last = np.eye(steps)[-1:]
                in_line = scheduled.every == 1 and steps > 0 and not block.D.any()
                if in_line and np.array_equal(block.E, shifts) and np.array_equal(block.C, last):
                    found[channel.name] = block.name, steps
    return found


def _swapped(loop: MultirateLoop, delays: Mapping[str, tuple[str, int]]) -> MultirateLoop:
    """The loop with these delays before their channels, which then send later by as much."""
    sums = {}
    own = {f"{delay}.y": f"{channel}.y" for channel, (delay, _) in delays.items()}
    for port, terms in loop.sums.items():
        sums[port] = {own.get(signal, signal): gain for signal, gain in terms.items()}
    for channel, (delay, _) in delays.items():
        sums[f"{delay}.u"] = sums[f"{channel}.u"]
        sums[f"{channel}.u"] = {f"{delay}.y": 1.0}
    return replace(loop, sums=sums)


def _in_every_tick(loop: MultirateLoop, channels, counts) -> MultirateLoop:
    """The loop whose channels send in every tick, with all messages that they keep."""
    blocks = {}
    for channel, count in zip(channels, counts, strict=True):
        blocks[channel.name] = channel.block(*_taken(True, count, 0))
    placed = []
    for scheduled in loop.placed:
        name = scheduled.block.name
        placed.append(ScheduledBlock(blocks[name]) if name in blocks else scheduled)
    return replace(loop, placed=tuple(placed))
