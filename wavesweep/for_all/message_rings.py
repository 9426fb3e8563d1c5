"""Messages tick by tick: whatever they do, a receiver holds one of the last few in each tick.

What is held stays until a newer message comes, and is at most so many sends back as `late` and
`lost` allow. Every such sequence can happen, as a message that is passed over may be lost, or come
later than a newer one and be dropped. So the loop has a matrix for each place in its period and
each choice of messages that are held there; places follow each other in a ring. A word of whole
messages has a matrix for each of the products of these choices over a period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import prod

import numpy as np

from wavesweep.engine.doubles import UNIT_ROUNDING
from wavesweep.engine.drawing import Drawing
from wavesweep.engine.errors import UsageError
from wavesweep.engine.sets import Side
from wavesweep.engine.switched import Graph, LoopFrames, inside_of
from wavesweep.for_all.channel_families import (
    Channel,
    NotByWordsError,
    channels_of,
    frames_with_messages,
)
from wavesweep.for_all.jitter_margin import SmallGain
from wavesweep.for_all.open_channels import OpenLoop, taken_from

MOST_WORDS = 50  # of whole messages: beyond it the norms of a ring are found ten times sooner
MOST_HELD = 3000  # matrices of a ring: beyond it a step of a search for norms takes minutes
# entries of these matrices; some 350 bytes each, in all that is made of them: 1 GB
MOST_ENTRIES = 3e6


@dataclass(frozen=True, slots=True)
class Held:
    """What receivers hold at a tick of the period: of each channel how many messages back,
    None where nothing reads it."""

    tick: int
    back: tuple[int | None, ...]


@dataclass(frozen=True, eq=False)
class RingFrames:
    """Frames at places that follow each other in a ring, as a `Family` of square matrices; each
    place has the states alone that are read after it.

    loop: what they are frames of; gain: its proof without them, which are made when they are asked
    for.
    """

    loop: OpenLoop
    gain: SmallGain
    drift = None

    @cached_property
    def few(self) -> bool:
        """Whether of what may be held there is only the newest and the oldest, as all are too many
        for norms."""
        choices_held = sum(prod(map(len, row)) for row in self.loop.choices)
        return choices_held > MOST_HELD or choices_held * self._states**2 > MOST_ENTRIES

    @property
    def _states(self) -> int:
        """The states of the loop, among them the messages that channels keep."""
        blocks = (scheduled.block for scheduled in self.loop.drawn.placed)
        return sum(len(block.states) for block in blocks) + sum(self.loop.counts)

    @cached_property
    def _held(self):
        """What may be held at each place, and the kinds of ticks from it to the next one."""
        choices = self.loop.choices
        if self.few:
            choices = [
                [[*dict.fromkeys((choice[0], choice[-1]))] for choice in row] for row in choices
            ]
            number_held = sum(prod(map(len, row)) for row in choices)
            if number_held * self._states**2 > MOST_ENTRIES:
                raise UsageError(
                    f"channels {', '.join(choice.name for choice in self.loop.channels)}: {self._states} states, most of them "
                    f"messages that are kept, expected at most {int((MOST_ENTRIES / number_held) ** 0.5)}; let fewer messages be under way"
                )
        return _places(self.loop, choices)

    @property
    def symbols(self) -> Sequence[Held]:
        """What is held with each matrix."""
        return self._held[0]

    @cached_property
    def place(self) -> np.ndarray:
        """The place of each matrix."""
        ticks = [symbol.tick for symbol in self.symbols]
        return np.unique(ticks, return_inverse=True)[1]

    @property
    def follows(self) -> np.ndarray:
        """See `Family`."""
        return (self.place[:, None] + 1) % (1 + self.place.max()) == self.place

    @cached_property
    def whole(self) -> LoopFrames:
        """The frames in all states."""
        symbols, kinds = self._held
        return self.loop.frames(kinds, tuple(symbols), self.follows)

    @cached_property
    def slots(self) -> np.ndarray:
        """The states of `whole` at each place, `(places, n)`, -1 where a place has fewer: these are
        zero."""
        states = self.whole.kept
        acts = [pattern[np.ix_(states, states)] for pattern in self.whole.patterns]
        return _slots(np.array(acts), self.place)

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
        on_diagonal = there & (rows == columns)
        diagonal = np.eye(self.slots.shape[1], dtype=bool)
        picked = np.where(there, E[..., symbol, rows, columns], 0.0)
        moved = picked + on_diagonal - diagonal
        rounding = np.where(on_diagonal == diagonal, 0.0, 2 * UNIT_ROUNDING * (1 + np.abs(moved)))
        return (
            np.where(on_diagonal == diagonal, picked, moved),
            np.where(there, dE[..., symbol, rows, columns], 0.0) + rounding,
        )


def frames_of_messages(
    drawing: Drawing, values: Mapping[str, object], number: str
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
    drawing: Drawing, values: Mapping[str, object], channels: Sequence[Channel], number: str
) -> RingFrames:
    """Return the ring of a drawn loop with channels, along a number that one wire or gain reads.

    values: flat numbers. number: empty for the loop at these values alone. Errors: UsageError for
    messages that carry what drifts and may be zero in place of it.
    """
    loop = OpenLoop.of(drawing, values, channels, number)
    return RingFrames(loop, SmallGain.of(loop))


def gain_over(
    drawing: Drawing, values: Mapping[str, object], sides: Sequence[Side], box: np.ndarray
) -> SmallGain:
    """Return the small gain of some loops of a box of sides, whose ticks it gives over the box."""
    inside = inside_of(box)
    numbers = {side.path: side.number(inside[:, index]) for index, side in enumerate(sides)}
    loop = OpenLoop.of(drawing, values | numbers, channels_of(drawing, values), "")
    return SmallGain.of(loop)


def _places(loop: OpenLoop, choices) -> tuple[list[Held], list[list[tuple]]]:
    """What may be held at each place, and the kinds of ticks from it up to the next place.

    A kind is the first tick of the period in which the same blocks run, and what each channel takes
    from where in it.
    """
    alike = loop.alike

    def kind(tick, back):
        taken = []
        for channel, count, count_back in zip(loop.channels, loop.counts, back, strict=True):
            taken.append(taken_from(channel.sends(tick), count, count_back))
        return alike[tick], tuple(taken)

    period = len(choices)
    places = [tick for tick, row in enumerate(choices) if prod(map(len, row)) > 1] or [0]
    symbols = []
    kinds = []
    for tick, later in zip(places, [*places[1:], places[0] + period], strict=True):
        rest = [
            kind(between % period, [count_back[0] for count_back in choices[between % period]])
            for between in range(tick + 1, later)
        ]
        for back in product(*choices[tick]):
            symbols.append(Held(tick, back))
            kinds.append([kind(tick, back), *rest])
    return symbols, kinds


def _slots(acts: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the states that are read after each place and not always zero there, `(places, n)`,
    each at the same index from place to place as far as can be.

    acts: entries of each matrix that may be nonzero.
    """
    places = place.max() + 1
    act = np.array([acts[place == place_number].any(0) for place_number in range(places)])
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
    for place_number in range(places):
        new = list(np.flatnonzero(live[place_number]))
        for index, state in enumerate(slots[place_number - 1]) if place_number else ():
            if state in new:
                slots[place_number, index] = state
                new.remove(state)
        slots[place_number, np.flatnonzero(slots[place_number] < 0)[: len(new)]] = new
    return slots
