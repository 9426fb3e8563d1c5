"""A drawing as the simulation runs it: blocks with their laws, wires as sums of products, and
the wall's force as a number."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from math import lcm
from typing import Any

from wavesweep.engine.drawing import AT, TYPES, Drawing, scalars, without_rule
from wavesweep.engine.errors import UsageError
from wavesweep.program.columns import run_column
from wavesweep.simulation.laws import (
    LAWS,
    Law,
    Sum,
    continuous,
    dead_time,
    local_model_away,
)

# the number that all wires read in which the wall's stiffness and damping stand
FORCE = "wall force"
DEPTH, SPEED = "wall depth", "wall speed"  # what they multiply
REACTION, POSITION, VELOCITY = "reaction", "position", "velocity"  # at the hand
LOCAL_WAVE = "local wave"  # of the waves that come back to the device, that of the fast side
# of a controller's wires: a model of the contact, absent without one
LOCAL = ("local_model.K_LM", "local_model.B_LM")
SEEN = "seen "  # begins the numbers of outputs and named signals, which are shown and not read
SAME_SHARE = 1e-12  # relative, of the shares of the wall's two numbers in two wires


@dataclass(frozen=True, slots=True)
class FrameClock:
    """Frames of slow blocks, repeated for ever.

    ticks: of each. delays: ticks from a frame's beginning until its results are in place, None if
    they never are. nominal: the period of slow blocks in ticks if it is always the same, None if it
    is the time since they ran last.
    """

    ticks: tuple[int, ...]
    delays: tuple[int | None, ...]
    nominal: float | None = None

    @property
    def starts(self) -> tuple[int, ...]:
        """The ticks in which they begin."""
        return tuple(accumulate(self.ticks[:-1], initial=0))

    def rhythm(self, phase: int) -> Rhythm:
        """When a block runs that has this phase in every frame."""
        phases = tuple(start + phase for start in self.starts)
        if self.nominal is None:
            periods = (self.ticks[-1], *self.ticks[:-1])
        else:
            periods = (self.nominal,)
        return Rhythm(sum(self.ticks), phases, slow=True, periods=periods)


@dataclass(frozen=True, slots=True)
class Rhythm:
    """The ticks in which a block runs: some phases of each `every` ticks. slow: whether its results
    may be late.

    periods: of its runs in turn, in ticks; empty if all have the mean period.
    """

    every: int = 1
    phases: tuple[int, ...] = (0,)
    slow: bool = False
    periods: tuple[float, ...] = ()

    def runs(self, k: int) -> bool:
        """Whether it runs in tick k."""
        return self.last(k) == k

    def count(self, k: int) -> int:
        """The number of runs up to tick k, with that in it."""
        frames, tick = divmod(k, self.every)
        return frames * len(self.phases) + bisect_right(self.phases, tick)

    def last(self, k: int, back: int = 0) -> int:
        """The tick of the last run up to tick k, or of one so many runs before it; negative if
        there is none."""
        frames, index = divmod(self.count(k) - 1 - back, len(self.phases))
        return frames * self.every + self.phases[index]

    def lasting(self, tick: float) -> list[float]:
        """The periods of its runs in turn, in s; a single one if all are the same."""
        if not self.periods:
            return [self.every * tick / len(self.phases)]
        return [ticks * tick for ticks in self.periods]


@dataclass(frozen=True, slots=True, eq=False)
class RunningBlock:
    """A block: its ports, when it runs, its law, and its law while the wall is not touched.

    plant: whether its inputs are held over each tick. runs: the block with the law of each of its
    runs in turn, if these are not the same.
    """

    name: str
    type: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rhythm: Rhythm
    law: Law
    away: Law
    plant: bool = False
    runs: tuple[RunningBlock, ...] = ()

    def in_tick(self, k: int) -> RunningBlock:
        """The block as it runs in tick k."""
        if not self.runs:
            return self
        number = self.rhythm.count(k) - 1
        return self.runs[number % len(self.runs)]

    @property
    def runs_late(self) -> int | None:
        """The number of its runs by which it shows its input late, if that is all it does."""
        if self.type == "hold":
            return 0
        if self.type == "delay":
            return sum(len(names) for _, names in self.law.moves)
        return None


@dataclass(frozen=True)
class Wall:
    """A wall `F = K depth + B speed`: its numbers (N/m, N s/m), and depth (m) and speed (m/s) as
    sums of signals.

    names: of its numbers in the drawing. position: above which it fills space if it is one-sided,
    otherwise None. pulls: whether it may pull inside, and does nothing outside; otherwise the force
    of both is cut off at 0.
    """

    names: tuple[str, ...]
    K: float
    B: float
    depth: Sum
    speed: Sum
    position: float | None = None
    pulls: bool = True


@dataclass(frozen=True)
class MarchedLoop:
    """Blocks, and the sums that their input ports and the signals at the hand's port read.

    tick (s) and rate (Hz) of the common tick. wires: port or signal -> sum; away: the same while
    the wall is not touched. hand: the signal of its force. device: the block that it moves, empty
    if it moves several, or another thing than a mass. body: of the device, mass (kg), damping (N
    s/m) and stiffness (N/m). late: the name of a dead time after which forces reach the device, and
    the share of a tick that has gone by then, where it is not 0. wall: None if none is named, or if
    its numbers do more than multiply signals in wires. walled: whether one is named. entries: name
    and signal of each input besides the hand. frames: of its slow blocks, None if all are alike.
    channels: the keys of each channel.
    """

    tick: float
    rate: float
    blocks: tuple[RunningBlock, ...]
    wires: Mapping[str, Sum]
    away: Mapping[str, Sum]
    inputs: tuple[str, ...] = ()
    hand: str = ""
    device: str = ""
    body: tuple[float, ...] = ()
    late: tuple[str, float] = ("", 1.0)
    wall: Wall | None = None
    walled: bool = False
    entries: tuple[tuple[str, str], ...] = ()
    frames: FrameClock | None = None
    channels: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @cached_property
    def frame(self) -> int:
        """The ticks after which all blocks run in the same way again."""
        return lcm(*(block.rhythm.every for block in self.blocks))

    @property
    def delays(self) -> tuple[int | None, ...]:
        """The ticks until the results of each frame are in place, besides those of blocks; None
        if they never are."""
        if self.frames is None:
            return (0,)
        return self.frames.delays

    @property
    def due(self) -> tuple[int, ...]:
        """How much later than the earliest the results of each frame are in place; 0 of those that
        never are, and of those that are with the next frame."""
        delays = [delay for delay in self.delays if delay is not None]
        if self.frames is None or self.frames.delays == self.frames.ticks or not delays:
            return (0,)
        return tuple(0 if delay is None else delay - min(delays) for delay in self.delays)

    @property
    def waits(self) -> bool:
        """Whether results of some frame are not in place at once."""
        return any(delay != 0 for delay in self.delays)

    @property
    def ports(self) -> dict[str, RunningBlock]:
        """The block of each input port."""
        return {f"{block.name}.{port}": block for block in self.blocks for port in block.inputs}

    @property
    def signals(self) -> list[str]:
        """What is read besides input ports: the signals at the hand's port, outputs and named
        signals."""
        ports = self.ports
        return [name for name in self.wires if name not in ports]

    def only(self, kind: str, port: str = "") -> str:
        """The name of the only block of a type that has an output of this name; empty if there
        is none, or several."""
        return _only(self.blocks, kind, port)

    def readers(self, signal: str) -> list[Rhythm]:
        """When the wires are read that a signal is in; a plant's and those at the hand's port in
        every tick.

        What only shows it reads nothing.
        """
        ports = self.ports
        rhythms = []
        for port, terms in self.wires.items():
            if port.startswith(SEEN) or all(name != signal for _, name in terms):
                continue
            rhythms.append(ports[port].rhythm if port in ports else Rhythm())
        return rhythms

    def behind(self, position: float, pulls: bool) -> MarchedLoop:
        """The loop whose wall is one-sided and begins at a position (m)."""
        return replace(self, wall=replace(self.wall, position=position, pulls=pulls))

    @property
    def gated(self) -> bool:
        """Whether a part or a wire is another one while the wall is not touched; not beside one
        that only pushes."""
        if self.wall and not self.wall.pulls:
            return False
        return self.wires != self.away or any(block.law != block.away for block in self.blocks)

    @property
    def encoders(self) -> list[str]:
        """The blocks that give the change of the device's position."""
        sensed = ((1.0, f"{self.device}.x"),)
        names = []
        for block in self.blocks:
            if block.type == "difference" and self.wires[f"{block.name}.u"] == sensed:
                names.append(block.name)
        return names

    @property
    def shown(self) -> dict[str, str]:
        """The columns of a simulation that the loop has, and the names of their numbers."""
        columns = {}
        for column, name in (("x", POSITION), ("v", VELOCITY), ("f_m", REACTION)):
            if name in self.wires:
                columns[column] = name
        if self.device:
            columns["x_hat"] = f"{self.device}.x"
            encoders = self.encoders
            columns["v_hat"] = f"{encoders[0]}.y" if encoders else f"{self.device}.v"
        channel_end = self.only("wave", "force")
        if channel_end:
            columns["u_m"] = f"{channel_end}.out"
            columns["v_m"] = f"{channel_end}.in"
        avatar = self.only("avatar")
        if avatar:
            columns["u_s"] = f"{avatar}.in"
            columns["v_s"] = f"{avatar}.out"
            columns["x_s"] = f"{avatar}.x"
            columns["x_dot_s"] = f"{avatar}.v"
        if self.wall:
            columns["F_s"] = FORCE
        for name in self.wires:
            if name.startswith(SEEN):
                columns[name.removeprefix(SEEN)] = name
        if LOCAL_WAVE in self.wires:
            local = self.only("local_model")
            columns["u_h"] = f"{local}.in"
            columns["v_l"] = f"{local}.out"
            columns["v_2"] = LOCAL_WAVE
        return columns

    @property
    def wall_rhythm(self) -> Rhythm:
        """When the wall's force is computed: as its slow readers run, if it has no other
        readers."""
        readers = self.readers(FORCE)
        slow = [rhythm for rhythm in readers if rhythm.slow]
        if slow and set(readers) == {slow[0]}:
            return slow[0]
        return Rhythm()


def _only(blocks, kind, port=""):
    """The name of the only block of a type that has an output of this name; empty if there is
    none, or several."""
    names = [
        block.name for block in blocks if block.type == kind and (not port or port in block.outputs)
    ]
    return names[0] if len(names) == 1 else ""


def loop_of(
    drawing: Drawing, values: Mapping[str, Any], frames: FrameClock | None = None
) -> MarchedLoop:
    """Return the loop that a drawing with these numbers (flat keys) is.

    frames: of all blocks that do not run in every tick. Errors: UsageError for frames that they
    cannot have.
    """
    numbers = scalars(values)
    if frames:
        _refuse(frames, [(block, *_schedule(block, numbers)) for block in drawing.alone])
    rate = float(drawing.tick_hz.value(numbers))
    tick = 1.0 / rate
    waits = {name: divided(tree.value(numbers) * rate) for name, tree in drawing.dead_times.items()}
    blocks = _blocks(drawing, numbers, tick, frames, waits)
    terms = _terms(drawing)
    wall = None
    shares = {}
    if drawing.wall:
        wall, shares = _wall_of(drawing, terms, numbers)
    touching = dict(numbers)
    if wall:
        touching |= dict.fromkeys(wall.names, 0.0)  # the wall acts by its force, see `FORCE`
    not_touching = touching | dict.fromkeys(numbers.keys() & {*LOCAL}, 0.0)
    shown = {SEEN + name: _valued(sum_, numbers) for name, sum_ in _shown_signals(drawing).items()}
    wires = _wires(drawing, terms, touching, shares, shown)
    away = _wires(drawing, terms, not_touching, shares, shown)
    for name in waits:
        _within_ticks(name, drawing, wires)
        _within_ticks(name, drawing, away)
    hand = drawing.hand[0] if drawing.hand else ""
    beside = {LOCAL_WAVE: _local_wave(blocks, wires), VELOCITY: _velocity(drawing, hand, wires)}
    for name, terms_beside in beside.items():
        if terms_beside is not None:
            wires[name] = terms_beside
            away[name] = terms_beside
    device = _device_of(drawing, hand, blocks, wires)
    within_tick = [name for name in _arriving_at(drawing, device) if waits[name][1]]
    for name in within_tick:
        wires[AT + name] = _about_to_change(wires, name)
        away[AT + name] = _about_to_change(away, name)
    late = ("", 1.0)
    if within_tick:
        late = (within_tick[0], 1.0 - waits[within_tick[0]][1])
    body = ()
    for block in drawing.blocks:
        if block.name == device:
            body = tuple(_numbers(block, numbers).values())
    entries = []
    for name, signal, _ in drawing.inputs:
        if signal != hand:
            entries.append((run_column("inputs", name), signal))
    return MarchedLoop(
        tick,
        rate,
        blocks,
        wires,
        away,
        inputs=(hand,) if hand else (),
        hand=hand,
        device=device,
        body=body,
        late=late,
        wall=wall,
        walled=bool(drawing.wall),
        entries=tuple(entries),
        frames=frames,
        channels={block.name: _numbers(block, numbers) for block in drawing.senders},
    )


def _blocks(drawing, numbers, tick, frames, waits):
    """The blocks of a drawing with their laws: those by themselves, plants, and dead times.
    waits: of the last, in ticks."""
    blocks = [
        _part(block, numbers, tick, frames) for block in drawing.alone if block.name not in waits
    ]
    blocks += [_plant(plant, drawing, numbers, tick, waits) for plant in drawing.plants]
    for name, (ticks, _) in waits.items():
        law = dead_time(ticks)
        blocks.append(
            RunningBlock(name, "dead time", ("u", "sensed"), ("y", "next"), Rhythm(), law, law)
        )
    return tuple(blocks)


def _terms(drawing):
    """What the wires of a drawing add up, and the position and the reaction at its hand."""
    terms = dict(drawing.wires)
    if drawing.hand:
        _, position, reaction = drawing.hand
        if position is not None:
            terms[POSITION] = position
        if reaction is not None:
            terms[REACTION] = reaction
    return terms


def _shown_signals(drawing):
    """The terms of named signals and outputs by their columns; those with the name of an input
    are left out."""
    named = {run_column("signals", name): terms for name, terms in drawing.named}
    named |= {run_column("outputs", name): terms for name, terms, _ in drawing.outputs}
    inputs = {run_column("inputs", name) for name, _, _ in drawing.inputs}
    return {name: terms for name, terms in named.items() if name not in inputs}


def _wires(drawing, terms, numbers, shares, shown):
    """The sums of wires with these numbers, the shares of the wall's force, and what is shown,
    by names inside of plants."""
    sums = {}
    for port, terms_of_port in terms.items():
        sums[port] = (*_valued(terms_of_port, numbers), *shares.get(port, ()))
    sums |= shown
    inside = drawing.inside
    wires = {}
    for port, sum_ in sums.items():
        wires[inside.get(port, port)] = tuple((gain, inside.get(name, name)) for gain, name in sum_)
    return wires


def _local_wave(blocks, wires):
    """What returns from the local model of a loop that has one at the end of a wave channel;
    else None."""
    channel_end = _only(blocks, "wave", "force")
    if not (channel_end and _only(blocks, "local_model")):
        return None
    fast = set()
    for block in blocks:
        if not (block.rhythm.slow or block.plant):
            fast.update(f"{block.name}.{port}" for port in block.outputs)
    return tuple(term for term in wires[f"{channel_end}.in"] if term[1] in fast)


def _masses(drawing):
    return [block.name for block in drawing.blocks if TYPES[block.type].body]


def _velocity(drawing, hand, wires):
    """The velocity at the hand, if the position there is that of masses; else None."""
    if not (hand and wires[POSITION]):
        return None
    inside = drawing.inside
    speeds = {}
    for mass in _masses(drawing):
        place = f"{mass}.x"
        speed = f"{mass}.v"
        speeds[inside.get(place, place)] = inside.get(speed, speed)
    if any(name not in speeds for _, name in wires[POSITION]):
        return None
    return tuple((gain, speeds[name]) for gain, name in wires[POSITION])


def _device_of(drawing, hand, blocks, wires):
    """The mass that the hand's force moves, if it is a single one by itself; else empty."""
    moved = []
    plants = {
        f"{block.name}.{port}": block.name
        for block in blocks
        if block.plant
        for port in block.inputs
    }
    for port, sum_ in wires.items():
        if port in plants and any(name == hand for _, name in sum_):
            moved.append(plants[port])
    sensed = {plant.name for plant in drawing.plants if plant.sensed}
    movable = {block.name for block in drawing.apart}.intersection(_masses(drawing)) - sensed
    if len(moved) == 1 and moved[0] in movable:
        return moved[0]
    return ""


def _arriving_at(drawing, device):
    """The dead times through which a device is driven."""
    names = []
    for plant in drawing.plants:
        if plant.name == device:
            names += [name for _, name in plant.arriving]
    return names


def _about_to_change(wires, name):
    """What a dead time is about to bring to the reaction of the motors."""
    return tuple(
        (gain, f"{name}.next") for gain, signal in wires.get(REACTION, ()) if signal == f"{name}.y"
    )


def _refuse(frames, schedules):
    """Refuse blocks that cannot have frames of varying length."""
    slow = [schedule for schedule in schedules if schedule[1] > 1]
    for ticks, delay in zip(frames.ticks, frames.delays, strict=True):
        if (delay or 0) > ticks:
            raise UsageError(
                f"simulate.frames: expected at least {delay} ticks, environment.delay, found {ticks}"
            )
    if not slow:
        raise UsageError(
            "simulate.frames: expected a slow environment, or blocks with `every` above 1, found none"
        )
    everys = sorted({every for _, every, _ in slow})
    latest = max(phases[-1] for _, _, phases in slow)
    if len(everys) > 1:
        raise UsageError(
            f"simulate.frames: expected slow blocks with the same `every`, found {', '.join(map(str, everys))}"
        )
    if latest >= min(frames.ticks):
        raise UsageError(
            f"simulate.frames: expected more than {latest} ticks, a block's phase, found {min(frames.ticks)}"
        )
    unruled = without_rule(block for block, *_ in slow if block.type != "channel")
    if unruled and len({*frames.rhythm(0).periods}) > 1:
        raise UsageError(
            "simulate.frames: expected slow blocks whose types have a rule for steps that vary (`wavesweep keys block`), found "
            f"{', '.join(unruled)}"
        )


def _schedule(block, constants):
    """Every how many ticks a block runs, and in which of them."""
    every = int(block.every.value(constants))
    phases = block.phases or (int(block.phase.value(constants)),)
    return every, phases


def _numbers(block, constants):
    """The keys of a block with their values, in the order of its type."""
    types = TYPES[block.type].keys
    numbers = {}
    for name, value in (*block.keys, *block.limits):
        argument = "passes" if name == "pass" else name
        numbers[argument] = _read_key(types[name].type, value, constants)
    return numbers


def _read_key(kind, value, constants):
    """The value of a key of a type: of expressions, and of lists and rows of them."""
    if kind == "number":
        return 1.0 * value.value(
            constants
        )  # unlike `float`, this leaves a number with a name as it is
    if kind == "integer":
        return int(value.value(constants))
    if kind == "list":
        return [1.0 * tree.value(constants) for tree in value]
    if kind == "rows":
        return [[1.0 * tree.value(constants) for tree in row] for row in value]
    return value


def _part(block, constants, tick, frames):
    """A block by itself as it runs; with frames of several lengths it has a law for each."""
    every, phases = _schedule(block, constants)
    keys = _numbers(block, constants)
    if frames and every > 1:
        rhythm = frames.rhythm(*phases)
    else:
        rhythm = Rhythm(every, phases, slow=every > 1 or bool(block.every.names))
    periods = rhythm.lasting(tick)
    by_period = {}
    for period in periods:
        if period in by_period:
            continue
        law = LAWS[block.type](period, **keys)
        away = local_model_away(period, **keys) if block.type == "local_model" else law
        by_period[period] = RunningBlock(
            block.name, block.type, *block.ports, rhythm, law, away, block.plant
        )
    first = by_period[periods[0]]
    if len(by_period) == 1:
        return first
    return replace(first, runs=tuple(by_period[period] for period in periods))


def divided(ticks: float) -> tuple[int, float]:
    """Return a time in ticks as whole ticks less a share of one."""
    whole_ticks = round(ticks)
    # A decimal of twelve digits that is meant to be a whole number is one.
    if abs(ticks - whole_ticks) > 1e-11 * max(1.0, ticks):
        whole_ticks = math.ceil(ticks)
    return whole_ticks, max(0.0, whole_ticks - ticks)


def _within_ticks(name, drawing, wires):
    """Lead what a dead time reads of plants, and what it is about to bring to them, to the ports
    that are for that."""
    inside = drawing.inside
    read = {}
    for plant in drawing.plants:
        for signal, dead_time_name in plant.sensed:
            if dead_time_name == name:
                read[inside[signal]] = f"{inside[signal]}{AT}{name}"
    terms = wires[f"{name}.u"]
    wires[f"{name}.u"] = tuple(term for term in terms if term[1] not in read)
    wires[f"{name}.sensed"] = tuple(
        (gain, read[signal]) for gain, signal in terms if signal in read
    )
    for plant in drawing.plants:
        for port, dead_time_name in plant.arriving:
            if dead_time_name != name:
                continue
            arrives = wires[inside[port]]
            soon = tuple(
                (gain, f"{name}.next") for gain, signal in arrives if signal == f"{name}.y"
            )
            wires[f"{inside[port]}{AT}{name}"] = soon


def _plant(plant, drawing, constants, tick, waits):
    """A plant of several blocks; its inputs are those that a wire from outside leads to. waits:
    of dead times, in ticks."""
    members = [
        (block.name, block.type, _numbers(block, constants), *block.ports)
        for block in plant.members
    ]
    gains = {}
    for port, terms in plant.couplings:
        for gain, name in _valued(terms, constants):
            gains[port, name] = gain
    wired = {port for port, terms in drawing.wires if terms}
    drawn_inputs, drawn_outputs = plant.drawn_ports
    input_names, output_names = plant.ports
    outputs = dict(zip(drawn_outputs, output_names, strict=True))
    inputs = {}
    for port, name in zip(drawn_inputs, input_names, strict=True):
        if port in wired:
            inputs[port] = name
    arriving = []
    for port, name in plant.arriving:
        whole_ticks, share = waits[name]
        if whole_ticks:
            arriving.append((port, f"{inputs[port]}{AT}{name}", 1.0 - share))
    sensed = [
        (signal, f"{outputs[signal]}{AT}{name}", waits[name][1]) for signal, name in plant.sensed
    ]
    law = continuous(tick, members, gains, inputs, outputs, arriving, sensed)
    into = (*inputs.values(), *(name for _, name, _ in arriving))
    out = (*outputs.values(), *(name for _, name, _ in sensed))
    return RunningBlock(plant.name, "plant", into, out, Rhythm(), law, law, plant=True)


def _valued(terms, numbers) -> Sum:
    return tuple((1.0 * gain.value(numbers), name) for name, gain in terms)


def _wall_of(drawing, terms, constants):
    """The wall, and the term of its force in each wire; None if its numbers do more than multiply
    signals in wires.

    In all wires they have to multiply the same two sums of signals, depth and speed, up to a share.
    """
    if _read_elsewhere(drawing):
        return None, {}
    names = drawing.wall
    factors_of_wall = None
    shares = {}
    for port, terms_of_port in terms.items():
        factors = _wall_factors(names, terms_of_port, constants)
        if factors is None:
            return None, {}
        if not factors:
            continue
        lead = next(iter(factors.values()))
        if factors_of_wall is None:
            factors_of_wall = {
                place: value if lead > 0 else -value for place, value in factors.items()
            }
        share = lead / next(iter(factors_of_wall.values()))
        if not _is_multiple(factors, share, factors_of_wall):
            return None, {}
        shares[port] = ((share, FORCE),)
    if factors_of_wall is None:
        return None, {}
    inside = drawing.inside
    depth = []
    speed = []
    for (number, name), factor in factors_of_wall.items():
        sum_ = depth if number == 0 else speed
        sum_.append((factor, inside.get(name, name)))
    K = float(constants[names[0]])
    B = float(constants[names[1]]) if len(names) > 1 else 0.0
    return Wall(names, K, B, tuple(depth), tuple(speed)), shares


def _is_multiple(factors, share, reference):
    """Whether factors are a share of others, in the same order, up to rounding."""
    if [*factors] != [*reference]:
        return False
    return all(
        abs(factors[name] - share * reference[name]) <= SAME_SHARE * abs(factors[name])
        for name in factors
    )


def _read_elsewhere(drawing):
    """Whether the wall's numbers stand anywhere but in wires that are held, the reaction and
    outputs."""
    wires = {f"wire.{port}" for port, _ in drawing.wires} | {"ports.hand.reaction"}
    wires |= {f"ports.outputs.{name}" for name, _, _ in drawing.outputs}
    trees = [tree for _, terms in drawing.couplings for _, tree in terms]
    trees += [tree for path, tree in drawing.trees() if path not in wires]
    return any(name in drawing.wall for tree in trees for name in tree.names)


def _wall_factors(names, terms, constants):
    """Of each of the wall's numbers and signal, the factor of their product in a wire; None if
    it is no such product."""
    none = constants | dict.fromkeys(names, 0.0)
    factors = {}
    for signal, gain in terms:
        read = [name for name in gain.names if name in names]
        if not read:
            continue
        rest = gain.value(none)
        slopes = [gain.value(none | {name: 1.0}) - rest for name in names]
        both = gain.value(none | dict.fromkeys(names, 1.0))
        if any(gain.degree(name) > 1 for name in read) or abs(
            both - sum(slopes) - rest
        ) > SAME_SHARE * abs(both):
            return None
        for number, slope in enumerate(slopes):
            if slope:
                factors[number, signal] = factors.get((number, signal), 0.0) + slope
    return dict(sorted(factors.items(), key=lambda item: item[0][0]))
