"""A drawn loop with channels tick by tick: which of its last messages a receiver may hold, and
what the loop does in a tick in which it holds one of these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.blocks import MultirateLoop
from wavesweep.engine.drawing import Drawing, name_of, path_of, scalars
from wavesweep.engine.expressions import Tree
from wavesweep.engine.frames import MarginalModes
from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import EnclosedLoop, Side
from wavesweep.engine.switched import TOTAL_DEGREE, FramesOver, LoopFrames, WrittenFrames
from wavesweep.for_all.channel_families import (
    NOTHING,
    SENT,
    Channel,
    in_every_tick,
    places_of,
    readers_of,
    refuse_moved,
    ticks_of,
)
from wavesweep.for_all.plan import TWO_VALUES


@dataclass(frozen=True, slots=True)
class OpenLoop:
    """A loop with channels, open at a number if it is along one.

    drawing: with delays before the channels. values: at which it is drawn, several where numbers
    vary. channels: as they send here. earlier: how many messages later in the loop as it was drawn
    the first one of each in a period is sent. choices: of each tick of the period, how many messages
    back each channel may hold one, None where nothing reads it.
    """

    drawing: Drawing
    values: Mapping[str, object]
    number: str
    drawn: MultirateLoop
    channels: tuple[Channel, ...]
    earlier: tuple[int, ...]
    choices: list[list[list[int | None]]]

    @staticmethod
    def of(
        drawing: Drawing, values: Mapping[str, object], channels: Sequence[Channel], number: str
    ) -> OpenLoop:
        """See `ring_of_messages`."""
        varied = {path_of(name_of(number)): TWO_VALUES} if number else {}
        delays = _delays_behind(Loops(drawing, values).drawn(), drawing, channels)
        before = []
        earlier = []
        for channel in channels:
            reader, steps = delays.get(channel.name, (channel.name, 0))
            sends = channel.phase + steps
            readers = readers_of(drawing, scalars(values), reader)
            before.append(replace(channel, phase=sends % channel.every, readers=readers))
            earlier.append(sends // channel.every)
        drawing = _swapped(drawing, delays)
        loop = Loops(drawing, values | dict.fromkeys(varied, 0.0)).drawn(
            name_of(number) if number else ""
        )
        choices = [[_choices(back, tick) for back in before] for tick in range(loop.ticks)]
        return OpenLoop(
            drawing, values | varied, number, loop, tuple(before), tuple(earlier), choices
        )

    @property
    def counts(self) -> list[int]:
        """The messages that each channel keeps, of which any may be held."""
        return [_count([row[index] for row in self.choices]) for index in range(len(self.channels))]

    @property
    def alike(self) -> list[int]:
        """Of each tick of the period the first one in which the same blocks run."""
        runs = [block.runs(self.drawn.ticks) for block in self.drawn.placed]
        _, first, same = np.unique(runs, axis=1, return_index=True, return_inverse=True)
        return first[same.reshape(-1)].tolist()

    def frames(
        self, kinds: Sequence[Sequence[tuple]], symbols, follows, more: int = 0
    ) -> LoopFrames:
        """The frames that consist of these kinds of ticks, of several loops those of the first;
        more: registers beside messages, which are free: none may be relative to what it copies."""
        held_ports, drift = self._drift(more)
        rows, places = places_of(self.drawn, self.channels, kinds, held_ports)
        ticks = ticks_of(places, self.number)
        refuse_moved(ticks, drift)
        ticks, _ = drift.relative_ticks(ticks, copied=not more)
        if not self.number:
            ticks = ticks.of_loop(0)
        written = WrittenFrames(
            [tuple(row[:-1]) for row in rows], [row[-1] for row in rows], symbols, follows
        )
        return LoopFrames.of(ticks, drift.remaining, written)

    def over(
        self, kinds: Sequence[tuple], symbols, sides: Sequence[Side], states_kept: np.ndarray
    ) -> FramesOver:
        """The ticks of these kinds over the cells of a box of sides, with a register beside messages;
        the values are those of some of its loops. states_kept: the states that remain."""
        held_ports, drift = self._drift(1)
        (samples,), places = places_of(self.drawn, self.channels, [kinds], held_ports)
        enclosed = EnclosedLoop(self.drawing, self.values, sides, TOTAL_DEGREE)
        states = [drift.remaining.index(state) for state in states_kept.tolist()]
        ticks = [(enclosed, place) for place in places]
        return FramesOver(ticks, drift, ((),) * len(kinds), tuple(samples), symbols, kept=states)

    def _drift(self, more):
        """What blocks hold, and what drifts in the loop; more: registers beside messages."""
        through = [(SENT, (SENT, *range(count - 1), *[NOTHING] * more)) for count in self.counts]
        pair = []
        for twin in Loops(self.drawing, self.values).twins():
            pair.append(in_every_tick(twin, self.channels, through))
        drift = MarginalModes.of(*pair)
        # What a channel shows is in its registers too, and nothing reads it from the last tick.
        shown = [drift.states.index(f"{channel.name}.shown") for channel in self.channels]
        return pair[0].held(), replace(drift, unobserved=(*drift.unobserved, *shown))


def _choices(channel: Channel, tick: int) -> list[int | None]:
    """How many messages back a receiver may hold one in a tick; None if nothing reads it."""
    since = (tick - channel.phase) % channel.every
    if not any((tick - phase) % every == 0 for every, phase in channel.readers):
        return [None]
    return list(range(channel.oldest(since) + 1))


def _count(choices) -> int:
    """The messages that a channel keeps, of which any may be held."""
    return 1 + max(choice for row in choices for choice in (0, *row) if isinstance(choice, int))


def taken_from(sends: bool, count: int, back: int | None) -> tuple[object, tuple]:
    """What a channel shows, and what its registers, of the last messages, take from where."""
    registers: list[object] = [SENT, *range(count - 1)] if sends else list(range(count))
    return registers[back or 0], tuple(registers)


def _delays_behind(
    loop: MultirateLoop, drawing: Drawing, channels: Sequence[Channel]
) -> dict[str, tuple[str, int]]:
    """The delay in every tick that alone reads a channel, and its ticks, by the channel's name."""
    delays = {}
    for channel in channels:
        signal = f"{channel.name}.y"
        readers = [port for port, terms in loop.sums.items() if signal in terms]
        for scheduled in loop.placed:
            block = scheduled.block
            alone = block.name not in drawing.dead_times and readers == [f"{block.name}.u"]
            if alone and loop.sums[readers[0]] == {signal: 1.0}:
                steps = len(block.states)
                shifts = np.eye(steps, k=-1) - np.eye(steps)
                last = np.eye(steps)[-1:]
                in_line = scheduled.every == 1 and steps > 0 and not block.D.any()
                if in_line and np.array_equal(block.E, shifts) and np.array_equal(block.C, last):
                    delays[channel.name] = block.name, steps
    return delays


def _swapped(drawing: Drawing, delays: Mapping[str, tuple[str, int]]) -> Drawing:
    """The drawing with these delays before their channels, which then send later by as much."""
    renamed = {f"{delay}.y": f"{channel}.y" for channel, (delay, _) in delays.items()}
    wires = dict(drawing.wires)
    for port, terms in drawing.wires:
        wires[port] = tuple((renamed.get(signal, signal), gain) for signal, gain in terms)
    for channel, (delay, _) in delays.items():
        wires[f"{delay}.u"] = wires[f"{channel}.u"]
        wires[f"{channel}.u"] = ((f"{delay}.y", Tree.number(1.0)),)
    return replace(drawing, wires=tuple(wires.items()))
