"""Loops run tick by tick, with the effects of hardware.

All blocks that run in a tick read each other's outputs of that tick, then they keep their states.
The device moves by a law of its own, which has friction and real lengths of ticks. Effects of the
device need one: a single block of type `mass` that the hand's force acts on. Results of slow
blocks, those with another `every` than 1, may come late to the blocks of every tick, and messages
of channels to all blocks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle, islice, repeat
from operator import itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine.drawing import AT, Drawing
from wavesweep.engine.errors import UsageError
from wavesweep.haptics.controller_page import loop_drawing
from wavesweep.simulation.body import Body, slide, zero_order_hold
from wavesweep.simulation.hardware import Effects, encoder, lateness, losses, tick_lengths
from wavesweep.simulation.record import Simulation, energies
from wavesweep.simulation.running_blocks import (
    DEPTH,
    FORCE,
    POSITION,
    REACTION,
    SEEN,
    SPEED,
    FrameClock,
    MarchedLoop,
    Rhythm,
    loop_of,
)
from wavesweep.simulation.tick_sums import TickSums, actual, arrived, besides, keep, run

Messages = Mapping[str, Sequence[int | None]]
SLOW_ALONE = MappingProxyType(
    {"rates.ratio": 2, "environment.delay": 0}
)  # draw a slow environment without its timing
FARTHEST_POSITION = 1e3  # m
STRONGEST = 1e6  # N
"""A simulation stops before the first tick in which the hand is farther away, or a force is
larger: it means nothing there."""


def simulate(
    values: Mapping[str, Any],
    force,
    effects: Effects | None = None,
    x: float = 0.0,
    drawing: Drawing | None = None,
    units: tuple[str, str] = ("m", "N"),
    entry: str = "",
    frames: FrameClock | None = None,
    messages: Messages | None = None,
    other_records: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> Simulation:
    """Run the experiment under a record of hand forces.

    values: flat numbers of a controller, or of the drawing. force: the hand's force (N) per tick,
    `(ticks,)`. effects: see `Effects`. x: the device's initial position (m), at rest. units: of
    position and force, for messages. entry: the signal from outside that the record is of, if not
    of the hand's force; all others are 0. frames: of the slow blocks, in place of the rate and the
    delay of the slow environment. messages: the ticks by which those of each channel are late in
    turn, repeated for ever, None for one that is lost; those of other channels are in time, or lost
    at random by their own probabilities. other_records: records of more inputs, by their signals.

    The simulation stops early if the position exceeds `FARTHEST_POSITION` or a force `STRONGEST`,
    as those of an unstable loop do; `Simulation.stopped` then gives the reason. Errors: UsageError
    for effects that the loop cannot have; IllPosedLoopError if what goes round within a tick has no
    solution.

    Accuracy: rounding, about 1e-15 of the largest signal per tick: contact, saturation and friction
    are solved within the tick, not iterated. An encoder, late results and jitter see the signal at
    the ticks, as their originals do.
    """
    effects = Effects() if effects is None else effects
    if frames and drawing is None:
        values = {**values, **SLOW_ALONE}
    loop = loop_of(loop_drawing(values) if drawing is None else drawing, values, frames)
    return March(
        loop, effects, entry=entry, drawn=drawing is not None, messages=messages or {}
    ).under(np.asarray(force, dtype=float), x, units, other_records)


class MarchedRows(NamedTuple):
    """A row of numbers per tick, whether the wall was touched in it, the last position, and why
    the rows ended early."""

    rows: list[tuple[float, ...]]
    touched: list[bool]
    last: float
    stopped: str


@dataclass
class Results:
    """Slow results that arrive together: their signals, and the blocks on their way.

    chain: when each block runs, and how many of its runs it is late, from the last one back to that
    which computes the result, behind all that only hold or delay it. late: of each result, in
    ticks, None if it is lost. waiting: the tick from which each of those under way is there, the
    numbers, and whether the wall was touched. channel: that they are the messages of; empty
    without. zero: whether they are zero from a run on in which none arrives.
    """

    chain: tuple[tuple[Rhythm, int], ...]
    touches: bool
    channel: str = ""
    zero: bool = False
    signals: list[str] = field(default_factory=list)
    late: list[int | None] = field(default_factory=list)
    waiting: list[tuple[int, list[float], bool]] = field(default_factory=list)

    def shown(self, k: int) -> bool:
        """Whether a result is shown in tick k."""
        return self.chain[0][0].runs(k)

    @property
    def origin(self) -> Rhythm:
        """When the results are computed."""
        return self.chain[-1][0]

    def number(self, k: int) -> int:
        """The number of the result that is shown in tick k, which counts from 0; negative if
        there is none yet."""
        for rhythm, runs in self.chain[:-1]:
            k = rhythm.last(k, runs)
        return self.origin.count(k) - 1 if k >= 0 else -1

    def due(self, k: int) -> tuple[list[float], bool] | None:
        """Take the result computed last of those that are there by tick k; one that was
        overtaken is never shown."""
        for place in reversed(range(len(self.waiting))):
            arrival, numbers, touched = self.waiting[place]
            if arrival <= k:
                self.waiting = self.waiting[place + 1 :]
                return numbers, touched
        return None

    def ages(self, times: np.ndarray) -> np.ndarray:
        """How long before each of these times (s), of the ticks, the result was computed that is in
        place then; NaN where none is."""
        arrivals: dict[int, float] = {}  # of the result that is computed last, for each tick
        newest = -np.inf
        shown = np.nan
        ages = []
        for k, time in enumerate(times.tolist()):
            runs = self.shown(k)
            late = self.late[self.number(k)] if runs else None
            if late is not None:
                arrivals[k + late] = time
            arrived = arrivals.get(k, -np.inf)
            if arrived > newest:
                newest = shown = arrived
            elif runs and self.zero:
                shown = np.nan
            ages.append(time - shown)
        return np.array(ages)


def results_of(loop: MarchedLoop) -> list[Results]:
    """The messages of channels, and the slow results that blocks of every tick read; the wall's
    force if no block is slow."""
    channels = loop.channels
    messages = []
    slow = {}
    for block in loop.blocks:
        if block.name in channels:
            becomes_zero = channels[block.name]["missing"] == "zero"
            messages.append(
                Results(((block.rhythm, 0),), False, block.name, becomes_zero, [f"{block.name}.y"])
            )
        if block.rhythm.slow:
            for port in block.outputs:
                slow[f"{block.name}.{port}"] = block
    if not slow and loop.wall:
        return [*messages, Results(((Rhythm(), 0),), touches=True, signals=[FORCE])]
    alone = {((1.0, name),): block for name, block in slow.items()}
    groups = {}
    for signal, block in slow.items():
        if block.name in channels or all(rhythm.slow for rhythm in loop.readers(signal)):
            continue
        chain = _chain(loop, block, alone)
        if chain not in groups:
            groups[chain] = Results(chain, touches=chain[-1][0] == loop.wall_rhythm)
        groups[chain].signals.append(signal)
    return [*messages, *groups.values()]


def _chain(loop, block, alone):
    """When the blocks from a slow one back to that which computes its result run, and how many runs
    each is late.

    alone: the slow blocks by the wires that read nothing but an output of theirs.
    """
    chain = []
    while block.runs_late is not None:
        terms = loop.wires.get(f"{block.name}.u")
        if not terms or terms not in alone:
            break
        chain.append((block.rhythm, block.runs_late))
        block = alone[terms]
    chain.append((block.rhythm, 0))
    return tuple(chain)


class March:
    """A loop with effects, ready to run once.

    watched: names of numbers of `TickSums` that are recorded besides its signals. entry, messages:
    see `simulate`. drawn: whether a spec draws the loop.
    """

    def __init__(
        self,
        loop: MarchedLoop,
        effects: Effects,
        watched: Sequence[str] = (),
        entry: str = "",
        *,
        drawn: bool = False,
        messages: Messages = MappingProxyType({}),
    ) -> None:
        refuse(loop, effects)
        if effects.wall is not None:
            loop = loop.behind(effects.wall, effects.pulls)
        self.loop = loop
        self.entry = entry or loop.hand
        self.drawn = drawn
        self.effects = effects
        self.watched = tuple(watched)
        self.results = results_of(loop)
        self.messages = messages
        self.late = bool(effects.late or effects.dropped or loop.waits or loop.channels)
        delayed = []
        if self.late:
            for result in self.results:
                delayed += result.signals
        moved_here = {loop.device} if loop.device else set()
        self.ticks = TickSums(loop, moved_here, delayed)

    def under(
        self,
        force: np.ndarray,
        x: float = 0.0,
        units: tuple[str, str] = ("m", "N"),
        other_records: Mapping[str, np.ndarray] = MappingProxyType({}),
    ) -> Simulation:
        """The experiment under the hand's force (N), or the record of another input, `(ticks,)`,
        from rest at x (m); other_records: records of more inputs, by their signals."""
        loop = self.loop
        lengths = tick_lengths(self.effects, loop.tick, len(force))
        late, results = self.draw_lateness(len(force))
        names = loop.shown | {name: name for name in self.watched}
        rows, touched, last, stopped = self._rows(
            names.values(), force.tolist(), lengths, x, units, other_records
        )
        count = len(rows)
        signals = {"time_s": np.concatenate([[0.0], np.cumsum(lengths)])}
        signals |= self._records(force, other_records)
        signals = {name: column[:count] for name, column in signals.items()}
        for name, column in zip(names, np.array(rows).reshape(count, len(names)).T, strict=True):
            signals[name] = column.copy()
        if "f_m" in signals:
            limit = np.inf if self.effects.max_force is None else self.effects.max_force
            signals["f_device"] = np.clip(signals["f_m"], -limit, limit)
        signals["touching"] = np.array(touched, dtype=bool)
        moved = np.diff(signals["x"], append=last) if loop.hand else np.zeros(count)
        of_results = np.array(late, int)
        signals["late"] = of_results[results[:count]]  # the last of all, 0, before the first
        late = of_results[: results[count - 1] + 1 if count else 0]
        for column in (*signals.values(), late):
            column.flags.writeable = False
        seen = [column for column, name in loop.shown.items() if name.startswith(SEEN)]
        shown = *dict(loop.entries), *seen
        starts = loop.frames.starts if loop.frames else (0,)
        energy = energies(loop, signals, moved)
        ages = {r.channel: r.ages(signals["time_s"]) for r in self.results if r.channel}
        lacking = self._lacking() if self.drawn else None  # a controller's table has all columns
        return Simulation(signals, energy, late, loop.frame, stopped, shown, lacking, starts, ages)

    def _lacking(self) -> frozenset[str]:
        """Columns that a drawn loop does not have."""
        return frozenset(["touching"] * (not self.loop.walled) + ["late"] * (not self.late))

    def _records(
        self, force: np.ndarray, others: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """What enters the loop at each of its inputs, by name, `(ticks,)`; 0 without a record."""
        entries = dict(self.loop.entries)
        if self.loop.hand:
            entries["f_h"] = self.loop.hand
        records = {}
        for name, signal in entries.items():
            record = others.get(signal, np.zeros(len(force)))
            records[name] = force if signal == self.entry else record
        return records

    def draw_lateness(self, count: int) -> tuple[list[int], np.ndarray]:
        """Draw the ticks by which each result is late; those of the first slow blocks, and which is
        last in each tick.

        What a frame's own delay is beyond the least one is among them. -1 is for a result that is lost. The last entry of
        all is for a result after the last tick.
        """
        drawn: dict[
            Rhythm, list[int | None]
        ] = {}  # of slow results; those of a loop are late together
        for result in self.results:
            origin = result.origin
            if result.channel:  # in turn, or lost at random
                count_of_results = origin.count(count) + 1
                pattern = cycle(self.messages.get(result.channel, ()))
                number = [*self.loop.channels].index(result.channel)
                keys = self.loop.channels[result.channel]
                in_turn = list(islice(pattern, count_of_results))
                result.late = in_turn or losses(self.effects, keys, count_of_results, number)
                continue
            if origin not in drawn:
                stream = (len(drawn),) if drawn else ()
                ticks_late = lateness(
                    self.effects, origin.count(count - 1) if count else 0, *stream
                )
                pairs = zip([*ticks_late, 0], cycle(self.loop.delays), strict=False)
                drawn[origin] = [None if delay is None else late for late, delay in pairs]
            pairs = zip(drawn[origin], cycle(self.loop.delays), strict=False)
            result.late = [None if late is None else late + delay for late, delay in pairs]
        first = next(iter(self.results), None)
        origin = first.origin if first else Rhythm(self.loop.frame)
        numbers = np.array([origin.count(k) - 1 for k in range(count)], int)
        if first is None:
            of_first = [0] * (origin.count(count) + 1)
        else:
            of_first = first.late if first.channel else drawn[origin]
        beyond = zip(of_first, cycle(self.loop.due), strict=False)
        return [-1 if late is None else late + delay for late, delay in beyond], numbers

    def _rows(
        self,
        names,
        force: list,
        lengths: np.ndarray,
        x: float,
        units: tuple[str, str],
        other_records: Mapping[str, np.ndarray],
    ) -> MarchedRows:
        """Run the ticks under these forces."""
        loop = self.loop
        ticks = self.ticks
        device_name = loop.device
        shown = itemgetter(*(ticks.place(name) for name in names), ticks.place(POSITION))
        hand = ticks.place(self.entry)
        records = [
            (ticks.place(signal), record.tolist()) for signal, record in other_records.items()
        ]
        position = ticks.place(POSITION)
        pull = ticks.place(REACTION)
        sensed_x = ticks.place(f"{device_name}.x")
        sensed_v = ticks.place(f"{device_name}.v")
        own_x = ticks.place(actual(f"{device_name}.x"))
        own_v = ticks.place(actual(f"{device_name}.v"))
        by_hand = self.entry == loop.hand
        measure = encoder(self.effects.resolution)
        device = _Device(loop, ticks, self.effects, lengths, by_hand=by_hand)
        running = Running(loop, ticks, self.results, self.effects.wall, self.late)
        z = running.z
        for name in loop.encoders:  # they have seen the position before the first tick
            z[running.place(f"{name}.before")] = measure(x)
        rows = []
        touched = []
        v = 0.0
        for k, f in enumerate(force):
            z[hand] = f
            for place, record in records:
                z[place] = record[k]
            z[sensed_x] = measure(x)
            z[sensed_v] = v
            z[own_x] = x
            z[own_v] = v
            running.tick(k)
            if not abs(z[position]) <= FARTHEST_POSITION:  # also if it is NaN
                stopped = f"the hand's position exceeds {FARTHEST_POSITION:g} {units[0]}"
                return MarchedRows(rows, touched, z[position], stopped)
            if not abs(z[pull]) <= STRONGEST or (by_hand and not abs(f) <= STRONGEST):
                stopped = f"a force exceeds {STRONGEST:g} {units[1]}"
                return MarchedRows(rows, touched, z[position], stopped)
            rows.append(shown(z)[:-1])
            touched.append(running.touching)
            if device_name:
                x, v = device.moved(z, f, x, v)
        if loop.hand and loop.wires[POSITION] != ((1.0, f"{device_name}.x"),) and force:
            z[hand] = 0.0
            z[own_x] = x
            running.tick(len(force))
            x = z[position]
        return MarchedRows(rows, touched, x, "")


class _Device:
    """The device of a run: how forces move it in a tick.

    share: of the input in the force on it. whole_ticks: length (s) and increments of each tick;
    parts: of a tick, before and after what the motors are late with arrives, if they are late.
    """

    def __init__(
        self,
        loop: MarchedLoop,
        ticks: TickSums,
        effects: Effects,
        lengths: np.ndarray,
        *,
        by_hand: bool,
    ) -> None:
        on_device = loop.wires.get(f"{loop.device}.f", ()) if by_hand else ()
        self.share = sum(factor for factor, name in on_device if name == loop.hand)
        self.max_force = effects.max_force or np.inf
        self.body = Body(*(loop.body or (1.0, 0.0, 0.0)), effects.friction)
        moving = self.body[:3]
        if effects.uneven:
            increments = zero_order_hold(*moving, lengths).tolist()
        else:
            increments = repeat(zero_order_hold(*moving, loop.tick).tolist())
        self.whole_ticks = zip(lengths.tolist(), increments, strict=False)
        late, gone_by = loop.late
        self.parts = []
        for part in (gone_by, 1.0 - gone_by) if late else ():
            seconds = part * loop.tick
            self.parts.append((seconds, zero_order_hold(*moving, seconds).tolist()))
        self.pull = ticks.place(REACTION)
        self.net = ticks.place(besides(f"{loop.device}.f"))
        self.change = ticks.place(besides(f"{loop.device}.f{AT}{late}"))
        self.of_motors = ticks.place(AT + late)

    def moved(self, z: list[float], f: float, x: float, v: float) -> tuple[float, float]:
        """Position and velocity a tick later; z: the numbers of the loop; f: the input."""
        pushed = self.share * f + z[self.net]
        f_m = z[self.pull]
        for part, (seconds, increments) in enumerate(self.parts or (next(self.whole_ticks),)):
            if part == 1:  # what the motors are late with has arrived
                pushed += z[self.change]
                f_m += z[self.of_motors]
            cut_off = f_m - min(max(f_m, -self.max_force), self.max_force)
            x, v = slide(self.body, x, v, pushed + cut_off, seconds, increments)
        return x, v


class Running:
    """The numbers of a loop as its ticks change them, slow results under way, and whether the wall
    in use is touched.

    wall: where it begins if it is one-sided. late: whether results may be late.
    """

    def __init__(
        self,
        loop: MarchedLoop,
        ticks: TickSums,
        results: Sequence[Results],
        wall: float | None,
        late: bool,
    ) -> None:
        one_sided = wall is not None
        self.ticks = ticks
        self.late = late
        self.z = [0.0] * len(ticks.places)
        self.results = results if one_sided or late else ()
        self.shown = [
            [result for result in self.results if result.shown(k)] for k in range(loop.frame)
        ]
        self.wall = [self.place(name) for name in (DEPTH, SPEED, FORCE)]
        self.places = {}
        if late:
            for result in results:
                for signal in result.signals:
                    self.places[signal] = (self.place(signal), self.place(arrived(signal)))
        begins_ahead = one_sided and wall >= 0.0
        self.touching = loop.walled and not begins_ahead
        self.gated = one_sided and loop.gated
        self.contacts: list[bool] = []  # of each force of the wall that was computed
        self.at_once = not any(result.touches for result in self.results)

    def place(self, name: str) -> int:
        """The place of a number, which is there from now on."""
        place = self.ticks.place(name)
        self.z.extend([0.0] * (len(self.ticks.places) - len(self.z)))
        return place

    def tick(self, k: int) -> None:
        """Run tick k on the numbers."""
        z = self.z
        shown = [(result, result.number(k)) for result in self.shown[k % len(self.shown)]]
        program = self.ticks.program(k, self._arriving(k, shown), self.touching or not self.gated)
        z.extend([0.0] * (len(self.ticks.places) - len(z)))
        run(program.first, z, program.limits)
        if program.wall:
            depth, speed, force = self.wall
            z[force], touched = program.wall.force(z[depth], z[speed])
            self.contacts.append(touched)
            if self.at_once:
                self.touching = touched
            run(program.second, z, program.limits)
        for result, number in shown:
            self._send(k, result, number)
        keep(program, z)

    def _arriving(self, k: int, shown: list[tuple[Results, int]]) -> frozenset[str]:
        """Put late results in place that are there by now; the signals that are shown in this
        tick and not late."""
        for result in self.results:
            self._receive(result, k)
        in_time = [
            (result, number) for result, number in shown if number < 0 or result.late[number] == 0
        ]
        for result, number in in_time:
            if result.touches and 0 <= number < len(self.contacts):  # computed in a tick before
                self.touching = self.contacts[number]
        return frozenset(signal for result, _ in in_time for signal in result.signals if self.late)

    def _receive(self, result: Results, k: int) -> None:
        """Put what arrives of a result by tick k in place."""
        arrived = result.due(k) if result.waiting else None
        if arrived is None and result.zero and result.shown(k):
            self.z[self.places[result.signals[0]][1]] = 0.0
        if arrived:
            numbers, touched = arrived
            for signal, number in zip(result.signals, numbers, strict=True):
                self.z[self.places[signal][1]] = number
            if result.touches:
                self.touching = touched

    def _send(self, k: int, results: Results, number: int) -> None:
        """A result that was computed by now: it is in use if it is not late, and overtakes those
        under way."""
        if results.touches and number >= 0:
            touched = self.contacts[number]
        else:
            touched = self.touching
        if number < 0 or results.late[number] == 0:
            self.touching = touched
            results.waiting = []
        elif results.late[number] is not None:
            numbers = [self.z[self.places[signal][0]] for signal in results.signals]
            results.waiting.append((k + results.late[number], numbers, touched))


def refuse(loop: MarchedLoop, effects: Effects) -> None:
    """Raise UsageError for an effect that the loop cannot have, with what it lacks."""
    effects_asked = [
        name
        for name in ("resolution", "max_force", "friction", "jitter", "ticks")
        if getattr(effects, name)
    ]
    wall = ["wall"] * (effects.wall is not None)
    late = [name for name in ("late", "dropped") if getattr(effects, name)]
    plants = [block.name for block in loop.blocks if block.plant and block.name != loop.device]
    slow = [result for result in results_of(loop) if not result.channel]
    uneven = ["jitter" if effects.jitter else "ticks"] * effects.uneven
    limited = effects_asked[:1] * bool(effects.max_force)
    pushes = ["pulls"] * (not effects.pulls)
    device = "a device, the only block of type mass that the hand's force acts on"
    linear = "a wall in [ports] whose numbers only multiply signals of wires"
    slow_blocks = "slow blocks (every > 1) that others read, or a wall"
    between = "none"
    if any(block.type == "dead time" for block in loop.blocks):
        between = "one that dead times read or move between ticks"
    for names, met, expected, problem in (
        (effects_asked, loop.device, device, between),
        (limited, REACTION in loop.wires, "ports.hand.reaction, the force of the motors", "none"),
        (uneven, not plants, "no plant besides the device", ", ".join(plants)),
        (uneven, not loop.late[0], "forces that change at ticks", f"the dead time {loop.late[0]}"),
        (wall, loop.wall, linear, "none"),
        (pushes, wall, "simulate.wall, where a one-sided wall begins", "none"),
        (late + ["frames"] * loop.waits, slow, slow_blocks, "none"),
    ):
        if names and not met:
            raise UsageError(f"option {', '.join(names)}: expected {expected}, found {problem}")
