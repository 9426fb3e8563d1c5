"""A drawing as the simulation runs it: blocks with their laws, wires as sums of products, and the wall's force as a number."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import accumulate, product
from math import lcm
from typing import Any

from wavesweep.engine.drawing.block_types import TYPES, without_rule
from wavesweep.engine.drawing.drawing import AT, Drawing, scalars
from wavesweep.engine.drawing.expressions import degree, names_in, value_of
from wavesweep.engine.errors import UsageError
from wavesweep.program.columns import run_column
from wavesweep.simulation.laws import LAWS, Law, Sum, continuous, dead_time, in_delta_form, local_model_away

FORCE = "wall force"  # the number that all wires read in which the wall's stiffness and damping stand
DEPTH, SPEED = "wall depth", "wall speed"  # what they multiply
REACTION, POSITION, VELOCITY = "reaction", "position", "velocity"  # at the hand
LOCAL_WAVE = "local wave"  # of the waves that come back to the device, that of the fast side
LOCAL = ("local_model.K_LM", "local_model.B_LM")  # of a controller's wires: a model of the contact, absent without one
SEEN = "seen "  # begins the numbers of outputs and named signals, which are shown and not read
ROUNDED = 1e-11  # of a number of ticks, how far from a whole one it may be: as a decimal of twelve digits
SAME = 1e-12  # relative, of the shares of the wall's two numbers in two wires


@dataclass(frozen=True, slots=True)
class FrameClock:
    """Frames of slow blocks, repeated for ever.

    ticks: of each. delays: ticks from a frame's beginning until its results are in place, None if they never are. nominal: the
    period of slow blocks in ticks if it is always the same, None if it is the time since they ran last.
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
        periods = (self.ticks[-1], *self.ticks[:-1]) if self.nominal is None else (self.nominal,)
        return Rhythm(sum(self.ticks), tuple(start + phase for start in self.starts), slow=True, periods=periods)


@dataclass(frozen=True, slots=True)
class Rhythm:
    """The ticks in which a block runs: some phases of each `every` ticks. slow: whether its results may be late.

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
        return k // self.every * len(self.phases) + bisect_right(self.phases, k % self.every)

    def last(self, k: int, back: int = 0) -> int:
        """The tick of the last run up to tick k, or of one so many runs before it; negative if there is none."""
        frames, index = divmod(self.count(k) - 1 - back, len(self.phases))
        return frames * self.every + self.phases[index]

    def lasting(self, tick: float) -> list[float]:
        """The periods of its runs in turn, in s; a single one if all are the same."""
        return [ticks * tick for ticks in self.periods] or [self.every * tick / len(self.phases)]


@dataclass(frozen=True, slots=True, eq=False)
class RunningBlock:
    """A block: its ports, when it runs, its law, and its law while the wall is not touched. plant: whether its inputs are held
    over each tick. runs: the block with the law of each of its runs in turn, if these are not the same."""

    name: str
    type: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    rhythm: Rhythm
    law: Law
    away: Law
    plant: bool = False
    runs: tuple[RunningBlock, ...] = ()

    def at(self, k: int) -> RunningBlock:
        """The block as it runs in tick k."""
        return self.runs[(self.rhythm.count(k) - 1) % len(self.runs)] if self.runs else self

    @property
    def runs_late(self) -> int | None:
        """The number of its runs by which it shows its input late, if that is all it does."""
        return {"hold": 0, "delay": sum(len(names) for _, names in self.law.moves)}.get(self.type)


@dataclass(frozen=True)
class Wall:
    """A wall `F = K depth + B speed`: its numbers (N/m, N s/m), and depth (m) and speed (m/s) as sums of signals.

    names: of its numbers in the drawing. position: above which it fills space if it is one-sided, otherwise None. pulls:
    whether it may pull inside, and does nothing outside; otherwise the force of both is cut off at 0.
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

    tick (s) and rate (Hz) of the common tick. wires: port or signal -> sum; away: the same while the wall is not touched. hand:
    the signal of its force. device: the block that it moves, empty if it moves several, or another thing than a mass. body: of
    the device, mass (kg), damping (N s/m) and stiffness (N/m). late: the name of a dead time after which forces reach the
    device, and the share of a tick that has gone by then, where it is not 0. wall: None if none is named, or if its numbers do
    more than multiply signals in wires. walled: whether one is named. entries: name and signal of each input besides the hand.
    frames: of its slow blocks, None if all are alike. channels: the keys of each channel.
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
    frame: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "frame", lcm(*(block.rhythm.every for block in self.blocks)))

    @property
    def delays(self) -> tuple[int | None, ...]:
        """The ticks until the results of each frame are in place, besides those of blocks; None if they never are."""
        return self.frames.delays if self.frames else (0,)

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
        """What is read besides input ports: the signals at the hand's port, outputs and named signals."""
        ports = self.ports
        return [name for name in self.wires if name not in ports]

    def only(self, kind: str, port: str = "") -> str:
        """The name of the only block of a type that has an output of this name; empty if there is none, or several."""
        names = [block.name for block in self.blocks if block.type == kind and (not port or port in block.outputs)]
        return names[0] if len(names) == 1 else ""

    def readers(self, signal: str) -> list[Rhythm]:
        """When the wires are read that a signal is in; a plant's and those at the hand's port in every tick.

        What only shows it reads nothing.
        """
        ports = self.ports
        wires = {port: terms for port, terms in self.wires.items() if not port.startswith(SEEN)}
        read = [port for port, terms in wires.items() if any(name == signal for _, name in terms)]
        return [ports[port].rhythm if port in ports else Rhythm() for port in read]

    def behind(self, position: float, pulls: bool) -> MarchedLoop:
        """The loop whose wall is one-sided and begins at a position (m)."""
        return replace(self, wall=replace(self.wall, position=position, pulls=pulls))

    @property
    def gated(self) -> bool:
        """Whether a part or a wire is another one while the wall is not touched; not beside one that only pushes."""
        if self.wall and not self.wall.pulls:
            return False
        return self.wires != self.away or any(block.law != block.away for block in self.blocks)

    @property
    def encoders(self) -> list[str]:
        """The blocks that give the change of the device's position."""
        sensed = ((1.0, f"{self.device}.x"),)
        return [block.name for block in self.blocks if block.type == "difference" and self.wires[f"{block.name}.u"] == sensed]

    @property
    def shown(self) -> dict[str, str]:
        """The columns of a simulation that the loop has, and the names of their numbers."""
        columns = {column: name for column, name in (("x", POSITION), ("v", VELOCITY), ("f_m", REACTION)) if name in self.wires}
        if self.device:
            columns |= {"x_hat": f"{self.device}.x", "v_hat": (*(f"{name}.y" for name in self.encoders), f"{self.device}.v")[0]}
        end, avatar, local = self.only("wave", "force"), self.only("avatar"), self.only("local_model")
        columns |= {"u_m": f"{end}.out", "v_m": f"{end}.in"} if end else {}
        if avatar:
            columns |= {"u_s": f"{avatar}.in", "v_s": f"{avatar}.out", "x_s": f"{avatar}.x", "x_dot_s": f"{avatar}.v"}
        columns |= {"F_s": FORCE} if self.wall else {}
        columns |= {name.removeprefix(SEEN): name for name in self.wires if name.startswith(SEEN)}
        return columns | ({"u_h": f"{local}.in", "v_l": f"{local}.out", "v_2": LOCAL_WAVE} if LOCAL_WAVE in self.wires else {})

    @property
    def wall_rhythm(self) -> Rhythm:
        """When the wall's force is computed."""
        rhythms = [rhythm for rhythm in self.readers(FORCE) if rhythm.slow] or [Rhythm()]
        return rhythms[0] if set(self.readers(FORCE)) == {rhythms[0]} else Rhythm()


def loop_of(drawing: Drawing, values: Mapping[str, Any], frames: FrameClock | None = None) -> MarchedLoop:
    """Return the loop that a drawing with these numbers (flat keys) is.

    frames: of all blocks that do not run in every tick. Errors: UsageError for frames that they cannot have.
    """
    numbers = scalars(values)
    if frames:
        _refuse(frames, [(block, *_schedule(block, numbers)) for block in drawing.alone])
    rate = float(value_of(drawing.tick_hz, numbers))
    waits = {name: divided(value_of(tree, numbers) * rate) for name, tree in drawing.dead_times.items()}
    blocks = tuple(_part(block, numbers, 1.0 / rate, frames) for block in drawing.alone if block.name not in waits)
    blocks += tuple(_plant(plant, drawing, numbers, 1.0 / rate, waits) for plant in drawing.plants)
    for name, (ticks, _) in waits.items():
        law = dead_time(ticks)
        blocks += (RunningBlock(name, "dead time", ("u", "sensed"), ("y", "next"), Rhythm(), law, law),)
    hand, *at_hand = drawing.hand or ("", None, None)
    terms = dict(drawing.wires)
    terms |= {name: sum_ for name, sum_ in zip((POSITION, REACTION), at_hand, strict=True) if sum_ is not None}
    wall, shares = _wall_of(drawing, terms, numbers) if drawing.wall else (None, {})
    without_wall = numbers | dict.fromkeys(wall.names if wall else (), 0.0)
    silent = without_wall | dict.fromkeys(numbers.keys() & {*LOCAL}, 0.0)
    shown = {SEEN + name: _valued(sum_, numbers) for name, sum_ in _shown_signals(drawing).items()}
    wires, away = (_wires(drawing, terms, values_of, shares, shown) for values_of in (without_wall, silent))
    for name, wiring in product(waits, (wires, away)):
        _within_ticks(name, drawing, wiring)
    loop = MarchedLoop(1.0 / rate, rate, blocks, wires, away)
    _add_local_wave(loop)
    _add_velocity(drawing, hand, loop)
    device = _device_of(drawing, hand, loop)
    arriving = [name for plant in drawing.plants if plant.name == device for _, name in plant.arriving if waits[name][1]]
    for name, wiring in product(arriving, (wires, away)):  # by how much the force of the motors is about to change
        wiring[AT + name] = tuple((gain, f"{name}.next") for gain, signal in wiring.get(REACTION, ()) if signal == f"{name}.y")
    late = next(((name, 1.0 - waits[name][1]) for name in arriving), ("", 1.0))
    body = next((tuple(_numbers(block, numbers).values()) for block in drawing.blocks if block.name == device), ())
    entries = tuple((run_column("inputs", name), signal) for name, signal, _ in drawing.inputs if signal != hand)
    channels = {block.name: _numbers(block, numbers) for block in drawing.senders}
    loop = replace(loop, inputs=(hand,) * bool(hand), hand=hand, entries=entries, channels=channels)
    return replace(loop, device=device, body=body, late=late, wall=wall, walled=bool(drawing.wall), frames=frames)


def _shown_signals(drawing):
    """The terms of named signals and outputs by their columns; those with the name of an input are left out."""
    named = {run_column("signals", name): terms for name, terms in drawing.named}
    named |= {run_column("outputs", name): terms for name, terms, _ in drawing.outputs}
    inputs = {run_column("inputs", name) for name, _, _ in drawing.inputs}
    return {name: terms for name, terms in named.items() if name not in inputs}


def _wires(drawing, terms, numbers, shares, shown):
    """The sums of wires with these numbers, the shares of the wall's force, and what is shown, by names inside of plants."""
    sums = {port: (*_valued(sum_, numbers), *shares.get(port, ())) for port, sum_ in terms.items()} | shown
    inside = drawing.inside
    return {inside.get(port, port): tuple((gain, inside.get(name, name)) for gain, name in sums[port]) for port in sums}


def _add_local_wave(loop):
    """Add what returns from the local model to the wires of a loop that has one at the end of a wave channel."""
    if (end := loop.only("wave", "force")) and loop.only("local_model"):
        fast = [block for block in loop.blocks if not (block.rhythm.slow or block.plant)]
        outputs = {f"{block.name}.{port}" for block in fast for port in block.outputs}
        loop.wires[LOCAL_WAVE] = loop.away[LOCAL_WAVE] = tuple(term for term in loop.wires[f"{end}.in"] if term[1] in outputs)


def _masses(drawing):
    return [block.name for block in drawing.blocks if TYPES[block.type].body]


def _add_velocity(drawing, hand, loop):
    """Add the velocity at the hand to the wires, if the position there is that of masses."""
    inside = drawing.inside
    speeds = {inside.get(f"{mass}.x", f"{mass}.x"): inside.get(f"{mass}.v", f"{mass}.v") for mass in _masses(drawing)}
    if hand and loop.wires[POSITION] and all(name in speeds for _, name in loop.wires[POSITION]):
        loop.wires[VELOCITY] = loop.away[VELOCITY] = tuple((gain, speeds[name]) for gain, name in loop.wires[POSITION])


def _device_of(drawing, hand, loop):
    """The mass that the hand's force moves, if it is a single one by itself; else empty."""
    plants = {f"{block.name}.{port}": block.name for block in loop.blocks if block.plant for port in block.inputs}
    moved = [plants[port] for port, sum_ in loop.wires.items() if port in plants and any(name == hand for _, name in sum_)]
    sensed = {plant.name for plant in drawing.plants if plant.sensed}
    movable = {block.name for block in drawing.apart}.intersection(_masses(drawing)) - sensed
    return moved[0] if len(moved) == 1 and moved[0] in movable else ""


def _refuse(frames, schedules):
    """Refuse blocks that cannot have frames of varying length."""
    slow = [schedule for schedule in schedules if schedule[1] > 1]
    for ticks, delay in zip(frames.ticks, frames.delays, strict=True):
        if (delay or 0) > ticks:
            raise UsageError(f"simulate.frames: expected at least {delay} ticks, environment.delay, found {ticks}")
    if not slow:
        raise UsageError("simulate.frames: expected a slow environment, or blocks with `every` above 1, found none")
    _, everys, phases = zip(*slow, strict=True)
    everys, latest = sorted(set(everys)), max(phase[-1] for phase in phases)
    if len(everys) > 1:
        raise UsageError(f"simulate.frames: expected slow blocks with the same `every`, found {', '.join(map(str, everys))}")
    if latest >= min(frames.ticks):
        raise UsageError(f"simulate.frames: expected more than {latest} ticks, a block's phase, found {min(frames.ticks)}")
    unruled = without_rule(block for block, *_ in slow if block.type != "channel")
    if unruled and len({*frames.rhythm(0).periods}) > 1:
        raise UsageError(
            "simulate.frames: expected slow blocks whose types have a rule for steps that vary (`wavesweep keys block`), found "
            f"{', '.join(unruled)}"
        )


def _schedule(block, known):
    return int(value_of(block.every, known)), block.phases or (int(value_of(block.phase, known)),)


def _numbers(block, known):
    """The keys of a block with their values, in the order of its type."""
    kinds = {
        "number": lambda tree: 1.0 * value_of(tree, known),  # unlike `float`, this leaves a number with a name as it is
        "integer": lambda tree: int(value_of(tree, known)),
        "list": lambda trees: [1.0 * value_of(tree, known) for tree in trees],
        "rows": lambda rows: [[1.0 * value_of(tree, known) for tree in row] for row in rows],
    }
    types = {name: key.type for name, key in TYPES[block.type].keys.items()}
    return {
        "passes" if name == "pass" else name: kinds[types[name]](value) if types[name] in kinds else value
        for name, value in (*block.keys, *block.limits)
    }


def _part(block, known, tick, frames):
    (every, phases), keys, kind = _schedule(block, known), _numbers(block, known), block.type
    rhythm = Rhythm(every, phases, slow=every > 1 or any(names_in(block.every)))
    if frames and every > 1:
        rhythm = frames.rhythm(*phases)
    runs, periods = {}, rhythm.lasting(tick)
    for period in periods:
        law = LAWS[kind](period, **keys)
        away = local_model_away(period, **keys) if kind == "local_model" else law
        runs.setdefault(period, RunningBlock(block.name, kind, *block.ports, rhythm, law, away, block.plant))
    first = runs[periods[0]]
    return replace(first, runs=tuple(runs[period] for period in periods)) if len(runs) > 1 else first


def divided(ticks: float) -> tuple[int, float]:
    """Return a time in ticks as whole ticks less a share of one."""
    near = round(ticks)
    whole_ticks = near if abs(ticks - near) <= ROUNDED * max(1.0, ticks) else math.ceil(ticks)
    return whole_ticks, max(0.0, whole_ticks - ticks)


def _within_ticks(name, drawing, wires):
    """Lead what a dead time reads of plants, and what it is about to bring to them, to the ports that are for that."""
    inside, sensed = drawing.inside, [pair for plant in drawing.plants for pair in plant.sensed if pair[1] == name]
    read = {inside[signal]: f"{inside[signal]}{AT}{name}" for signal, _ in sensed}
    terms = wires[f"{name}.u"]
    wires[f"{name}.u"] = tuple(term for term in terms if term[1] not in read)
    wires[f"{name}.sensed"] = tuple((gain, read[signal]) for gain, signal in terms if signal in read)
    for port, _ in (pair for plant in drawing.plants for pair in plant.arriving if pair[1] == name):
        soon = tuple((gain, f"{name}.next") for gain, signal in wires[inside[port]] if signal == f"{name}.y")
        wires[f"{inside[port]}{AT}{name}"] = soon


def _plant(plant, drawing, known, tick, waits):
    """A plant of several blocks; its inputs are those that a wire from outside leads to. waits: of dead times, in ticks."""
    members = [(block.name, block.type, _numbers(block, known), *block.ports) for block in plant.members]
    gains = {(port, name): gain for port, terms in plant.couplings for gain, name in _valued(terms, known)}
    wired = {port for port, terms in drawing.wires if terms}
    inputs, outputs = (dict(zip(*pair, strict=True)) for pair in zip(plant.drawn_ports, plant.ports, strict=True))
    inputs = {port: name for port, name in inputs.items() if port in wired}
    arriving = [(port, f"{inputs[port]}{AT}{name}", 1.0 - waits[name][1]) for port, name in plant.arriving if waits[name][0]]
    sensed = [(signal, f"{outputs[signal]}{AT}{name}", waits[name][1]) for signal, name in plant.sensed]
    law = continuous(tick, members, gains, inputs, outputs, arriving, sensed)
    into, out = (
        (*ports.values(), *(name for _, name, _ in further)) for ports, further in ((inputs, arriving), (outputs, sensed))
    )
    return RunningBlock(plant.name, "plant", into, out, Rhythm(), law, law, plant=True)


def _valued(terms, numbers) -> Sum:
    return tuple((1.0 * value_of(gain, numbers), name) for name, gain in terms)


def _positive(factors):
    """The factors with the sign that makes the first one positive."""
    lead = next(iter(factors.values()))
    return {place: value if lead > 0 else -value for place, value in factors.items()}


def _ratio(factors, first):
    """How many times the factors are the first ones; None if they are no multiple of them."""
    share = next(iter(factors.values())) / next(iter(first.values()))
    if [*factors] != [*first] or any(abs(factors[at] - share * first[at]) > SAME * abs(factors[at]) for at in factors):
        return None
    return share


def _wall_of(drawing, terms, known):
    """The wall, and the term of its force in each wire; None if its numbers do more than multiply signals in wires."""
    if _read_elsewhere(drawing):
        return None, {}
    names, first, shares = drawing.wall, None, {}
    for port, terms_of_port in terms.items():
        factors = _wall_factors(names, terms_of_port, known)
        if factors is None:
            return None, {}
        if not factors:
            continue
        first = first or _positive(factors)
        share = _ratio(factors, first)
        if share is None:
            return None, {}
        shares[port] = ((share, FORCE),)
    if first is None:
        return None, {}
    inside = drawing.inside
    depth, speed = (tuple((value, inside.get(name, name)) for (i, name), value in first.items() if i == at) for at in (0, 1))
    K, B = (*(float(known[name]) for name in names), 0.0)[:2]
    return Wall(names, K, B, depth, speed), shares


def _read_elsewhere(drawing):
    """Whether the wall's numbers stand anywhere but in wires that are held, the reaction and outputs."""
    wires = {f"wire.{port}" for port, _ in drawing.wires} | {"ports.hand.reaction"}
    wires |= {f"ports.outputs.{name}" for name, _, _ in drawing.outputs}
    trees = [tree for _, terms in drawing.couplings for _, tree in terms]
    trees += [tree for path, tree in drawing.trees() if path not in wires]
    return any(name in drawing.wall for tree in trees for name, _ in names_in(tree))


def _wall_factors(names, terms, known):
    """Of each of the wall's numbers and signal, the factor of their product in a wire; None if it is no such product."""
    none, factors = known | dict.fromkeys(names, 0.0), {}
    for signal, gain in terms:
        read = [name for name, _ in names_in(gain) if name in names]
        if not read:
            continue
        changes = ({}, *({name: 1.0} for name in names), dict.fromkeys(names, 1.0))
        rest, *ones, both = (value_of(gain, none | change) for change in changes)
        slopes = [with_one - rest for with_one in ones]
        if any(degree(gain, name) > 1 for name in read) or abs(both - sum(slopes) - rest) > SAME * abs(both):
            return None
        factors |= {(i, signal): factors.get((i, signal), 0.0) + slope for i, slope in enumerate(slopes) if slope}
    return dict(sorted(factors.items(), key=lambda item: item[0][0]))


def loop_of_blocks(drawn: Any, junctions: Iterable[str]) -> MarchedLoop:
    """Return the loop of blocks that are given by matrices, a `MultirateLoop`; junctions: signals that are looked at too."""
    blocks, tick = [], float(drawn.period)
    made = {f"{placed_block.block.name}.{port}" for placed_block in drawn.placed for port in placed_block.block.outputs} | {
        *drawn.inputs
    }

    def terms(signal: str, factor: float = 1.0) -> Sum:
        if signal in made:
            return ((factor, signal),)
        sources = drawn.sums.get(signal, {}).items()
        return tuple(term for source, gain in sources for term in terms(source, factor * float(gain)))

    for placed_block in drawn.placed:
        block, phases = (
            placed_block.block,
            placed_block.phase if isinstance(placed_block.phase, tuple) else (placed_block.phase,),
        )
        law = in_delta_form(block.E, block.B, block.C, block.D, block.states, block.inputs, block.outputs)
        blocks.append(RunningBlock(block.name, "", block.inputs, block.outputs, Rhythm(placed_block.every, phases), law, law))
    ports = [f"{block.name}.{port}" for block in blocks for port in block.inputs]
    wires = {port: terms(port) for port in (*ports, *(name for name in junctions if name not in made))}
    return MarchedLoop(tick, 1.0 / tick, tuple(blocks), wires, wires, tuple(drawn.inputs))
