"""A loop drawn in a spec: numbers, blocks, wires and ports."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Any, TypeVar

from wavesweep.engine._drawing import scalar_place
from wavesweep.engine._drawing.block_types import TICK_HZ
from wavesweep.engine._drawing.drawn_block import DrawnBlock, Plant, keys_of_block, signals_of
from wavesweep.engine._drawing.expressions import Terms, Tree
from wavesweep.engine._keys.key import Key, Names

RATE = "rates.tick_hz"
# Prefix of the paths of numbers, whose rest is the name in trees; other keys are named by their
# whole path.
OF_NUMBERS = "numbers."
AT = "@"  # before the name of a dead time, in the names of a plant's ports that serve it
# keys of a channel that say how often messages are lost
SHARES = ("loss", "burst", "burst_end", "burst_loss")

# types of blocks at the ends of a wave line: `in` is the wave that reaches one
WAVE_ENDS = ("wave", "avatar", "local_model")
# the input and the output that are a second port
ENVIRONMENT = ("environment.force", "environment.displacement")


# begin the names of inputs and outputs that are further axes of the hand
FURTHER = ("hand.force.", "hand.displacement.")


_Pairs = tuple[tuple[str, str], ...]
_Other = TypeVar("_Other")


def path_of_port(side: str, name: str) -> str:
    """Return the path of one of the inputs or outputs of [ports]."""
    if name.startswith(FURTHER):
        return f"ports.{name.rpartition('.')[0]}"
    return f"ports.{name}" if name in ENVIRONMENT else f"ports.{side}.{name}"


def _remembered(function: Callable[[Any], Any]) -> property:
    """Make a property of a drawing, computed once for all that are equal: a compiled loop is
    asked again and again."""
    return property(lru_cache(maxsize=64)(function))


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawn loop without the values of its numbers.

    numbers: name, unit and description of each. whole: those that have to be whole. wires: input
    port -> its signals and their gains, held over a tick at a plant. hand: the signal of the hand's
    force; the displacement, and the force against the hand if it is named, as signals and gains.
    wall: the numbers that are the stiffness and the damping of a wall. turns, volts: whether
    the hand's force and displacement are a torque and an angle, or a voltage and a charge. couplings: as wires, by which
    plants act on each other continuously. inputs: name, signal and unit of each signal from
    outside, without the hand's force. outputs: name, terms and unit of each. named: the names in
    [signals], which `simulate` shows too, and their terms.
    """

    tick_hz: Tree
    numbers: tuple[tuple[str, str, str], ...]
    whole: frozenset[str]
    blocks: tuple[DrawnBlock, ...]
    wires: tuple[tuple[str, Terms], ...]
    hand: tuple[str, Terms, Terms | None] | None = None
    wall: tuple[str, ...] | None = None
    turns: bool = False
    volts: bool = False
    couplings: tuple[tuple[str, Terms], ...] = ()
    inputs: tuple[tuple[str, str, str], ...] = ()
    outputs: tuple[tuple[str, Terms, str], ...] = ()
    named: tuple[tuple[str, Terms], ...] = ()
    hashed: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Hash the trees once, since a drawing is looked up again and again."""
        object.__setattr__(self, "hashed", hash(self._parts()))

    def __hash__(self) -> int:
        return self.hashed

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._parts()  # another process has other hashes

    def _parts(self) -> tuple[Any, ...]:
        return tuple(getattr(self, item.name) for item in fields(self) if item.init)

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield the path of the key and the tree for each number of the drawing."""
        yield RATE, self.tick_hz
        for block in self.blocks:
            yield from ((f"block.{block.name}.{name}", tree) for name, tree in block.trees())
        terms = [(f"wire.{port}", terms) for port, terms in (*self.wires, *self.couplings)]
        if self.hand:
            terms += [
                ("ports.hand.displacement", self.hand[1]),
                ("ports.hand.reaction", self.hand[2] or ()),
            ]
        terms += [(path_of_port("outputs", name), shown) for name, shown, _ in self.outputs]
        yield from ((path, gain) for path, summed in terms for _, gain in summed)

    def rate(self, values: Mapping[str, float]) -> float:
        """Return the rate of the tick in Hz."""
        return self.tick_hz.value(scalars(values))

    @property
    def has_waves(self) -> bool:
        """Whether the loop has ends of a wave line."""
        return any(block.type in WAVE_ENDS for block in self.blocks)

    @property
    def outside(self) -> tuple[str, ...]:
        """The signals from outside: the hand's force first, then those of the inputs."""
        return tuple(
            dict.fromkeys([*(self.hand or ())[:1], *(signal for _, signal, _ in self.inputs)])
        )

    @property
    def environment(self) -> tuple[str, Terms, None] | None:
        """The port of the environment, in the form of that of the hand."""
        forces = {name: signal for name, signal, _ in self.inputs}
        displacements = {name: terms for name, terms, _ in self.outputs}
        force, displacement = ENVIRONMENT
        if force in forces and displacement in displacements:
            return forces[force], displacements[displacement], None
        return None

    @property
    def further(self) -> tuple[tuple[str, str, Terms], ...]:
        """The further axes of the hand: name of the output, signal of the force, and
        displacement of each."""
        force, displacement = FURTHER
        forces = {}  # by the name of the displacement beside it
        for name, signal, _ in self.inputs:
            if name.startswith(force):
                forces[name.replace(force, displacement)] = signal
        axes = []
        for name, terms, _ in self.outputs:
            if name.startswith(displacement) and name in forces:
                axes.append((name, forces[name], terms))
        return tuple(axes)

    @property
    def signals(self) -> list[str]:
        """The signals that can be looked at: ports of blocks as BLOCK.PORT, outputs first, and
        the names in [signals]."""
        inputs, outputs = signals_of(self.blocks)
        return [*outputs, *inputs, *(name for name, _ in self.named)]

    @_remembered
    def plants(self) -> tuple[Plant, ...]:
        """The plants that are made of several blocks, which couplings connect, and those that a
        dead time acts on or reads."""
        arriving, sensed = _between_ticks(self)
        plants: list[set[str]] = []
        for port, terms in self.couplings:
            coupled = {_block_of(name) for name in (port, *dict(terms))}
            joined = coupled.union(*(names for names in plants if names & coupled))
            plants = [names for names in plants if not names & joined] + [joined]
        for name in dict.fromkeys(_block_of(name) for name, _ in (*arriving, *sensed)):
            plants += [] if any(name in names for names in plants) else [{name}]
        made = [self._plant(names, arriving, sensed) for names in plants]
        return tuple(sorted(made, key=lambda plant: self.blocks.index(plant.members[0])))

    def _plant(self, names: set[str], arriving: _Pairs, sensed: _Pairs) -> Plant:
        """The plant of the blocks with these names; arriving, sensed: see `_between_ticks`."""

        def own(pairs: tuple[tuple[str, _Other], ...]) -> tuple[tuple[str, _Other], ...]:
            return tuple(pair for pair in pairs if _block_of(pair[0]) in names)

        members = tuple(block for block in self.blocks if block.name in names)
        return Plant(members, own(self.couplings), own(arriving), own(sensed))

    @_remembered
    def dead_times(self) -> dict[str, Tree]:
        """The dead time (s) of each delay that has one."""
        return {block.name: block.dead_time for block in self.blocks if block.dead_time}

    @_remembered
    def building(self) -> dict[str, tuple[str, ...]]:
        """Paths of the whole numbers by which dead times decide how the loop is built, each with
        the dead times that it is of.

        Those of one are its number of ticks. Those of two say whether what the first one brings to
        a plant has arrived before the second one, or the same, reads the plant; see
        `wavesweep.engine._loops.dead_time`.
        """
        pairs = set()
        for plant in self.plants:
            for _, early in plant.arriving:
                pairs |= {(early, late) for _, late in plant.sensed}
        building: dict[str, tuple[str, ...]] = {}
        for name in self.dead_times:
            building[f"block.{name}.ticks"] = (name,)
        for early, late in sorted(pairs):
            building[f"block.{early}.before.{late}"] = early, late
        return building

    @property
    def channels(self) -> tuple[DrawnBlock, ...]:
        """The blocks whose messages may be late or lost."""
        return tuple(block for block in self.senders if not block.in_time)

    @property
    def senders(self) -> tuple[DrawnBlock, ...]:
        """The blocks that send messages, which a simulation may let come late or lose."""
        return tuple(block for block in self.blocks if block.type == "channel")

    @property
    def at_random(self) -> bool:
        """Whether messages are lost with a probability."""
        return any(block.loses_at_random for block in self.channels)

    @property
    def alone(self) -> list[DrawnBlock]:
        """The blocks outside all plants."""
        return self._outside(self.plants)

    @property
    def apart(self) -> list[DrawnBlock]:
        """The blocks on which no plant acts continuously, and at most one dead time between two
        ticks."""
        return self._outside(
            plant for plant in self.plants if plant.couplings or len(plant.arriving) > 1
        )

    def _outside(self, plants: Iterable[Plant]) -> list[DrawnBlock]:
        """The blocks that are in none of these plants."""
        members: set[DrawnBlock] = set()
        for plant in plants:
            members.update(plant.members)
        return [block for block in self.blocks if block not in members]

    @property
    def inside(self) -> dict[str, str]:
        """The signal of a plant for each port of its members."""
        signals: dict[str, str] = {}
        for plant in self.plants:
            signals |= plant.signals
        return signals

    @_remembered
    def shaping(self) -> frozenset[str]:
        """Names of the numbers on which the structure of the loop depends."""
        return _names_in(tree for path, tree in self.trees() if scalar_place.decides(path))

    @_remembered
    def cores(self) -> tuple[DrawnBlock, ...]:
        """The blocks, with its transfer function in place of each block of firmware."""
        return tuple(block.core(self.tick_hz) for block in self.blocks)

    @_remembered
    def reads(self) -> frozenset[str]:
        """Paths of the keys whose numbers the loop reads."""
        return _paths_in(tree for _, tree in self.trees())

    @_remembered
    def of_limits(self) -> frozenset[str]:
        """Paths of the keys that limits of blocks alone read, on which nothing depends within
        them."""
        trees = []
        for block in self.blocks:
            trees += [tree for _, tree in block.limit_trees()]
        return _paths_in(trees) - self.reads

    @_remembered
    def of_losses(self) -> frozenset[str]:
        """Paths of the keys that probabilities of channels alone read: with all messages in time
        nothing depends on them."""
        shares = {f"block.{block.name}.{key}" for block in self.channels for key in SHARES}
        return self.reads - _paths_in(tree for path, tree in self.trees() if path not in shares)

    @_remembered
    def posing(self) -> frozenset[str]:
        """Paths of the keys that say where a linkage is: those that the key `through` of a block
        reads."""
        trees = []
        for path, tree in self.trees():
            if path.startswith("block.") and path.endswith(".through"):
                trees.append(tree)
        return _paths_in(trees)

    @property
    def rating(self) -> frozenset[str]:
        """Names of the numbers that the rate of the tick follows from."""
        return frozenset(self.tick_hz.names)

    @_remembered
    def timing(self) -> frozenset[str]:
        """Names of the numbers that dead times, in ticks, follow from."""
        if not self.dead_times:
            return frozenset()
        return self.rating | _names_in(self.dead_times.values())

    def scalar_place(self, number: str) -> str:
        """Return the path of the wire, gain or word of firmware of which a number is one scalar
        factor, empty if it is none; see `scalar_place`."""
        return scalar_place.scalar_place(self, number)

    def shares_wire(self, number: str, second: str) -> bool:
        """Return whether another number is the factor of other terms in the same wire."""
        return scalar_place.shares_wire(self, number, second)

    def seen_by_hand(self, number: str) -> bool:
        """Return whether the signals at the hand's port read a number themselves."""
        return scalar_place.seen_by_hand(self, number)

    @_remembered
    def names(self) -> Names:
        """The keys that may be axes, and the short names of numbers."""
        keys = {RATE: replace(TICK_HZ, path=RATE, required=False)} if RATE in self.rating else {}
        for name, unit, description in self.numbers:
            kind = "integer" if name in self.whole else "number"
            keys[path_of(name)] = Key(
                path_of(name), kind, None, unit, description, shaping=name in self.shaping
            )
        for block in self.blocks:
            of_type = keys_of_block(block.type)
            for name, tree in (*block.trees(), *block.limit_trees()):
                path = f"block.{block.name}.{name}"
                if tree.reads(path):
                    keys[path] = replace(
                        of_type[name], path=path, required=False, shaping=path in self.shaping
                    )
        return Names(keys, {name: path_of(name) for name, _, _ in self.numbers})


def _names_in(trees: Iterable[Tree]) -> frozenset[str]:
    """The names in some trees."""
    return frozenset().union(*(tree.names for tree in trees))


def _paths_in(trees: Iterable[Tree]) -> frozenset[str]:
    """The paths of the keys that some trees read."""
    return frozenset(map(path_of, _names_in(trees)))


def _between_ticks(drawing: Drawing) -> tuple[_Pairs, _Pairs]:
    """Ports of plants with the dead times that arrive there, and outputs of plants with the dead
    times that read them."""
    plants = {block.name for block in drawing.blocks if block.plant}
    delays = drawing.dead_times
    arriving = []
    sensed = []
    for port, terms in drawing.wires:
        reader = _block_of(port)
        for signal, _ in terms:
            source = _block_of(signal)
            if reader in plants and source in delays:
                arriving.append((port, source))
            elif reader in delays and source in plants:
                sensed.append((signal, reader))
    return tuple(dict.fromkeys(arriving)), tuple(dict.fromkeys(sensed))


def _block_of(name: str) -> str:
    return name.rpartition(".")[0]


def path_of(name: str) -> str:
    """Return the path of the key that trees call by this name."""
    return name if "." in name else OF_NUMBERS + name


def name_of(path: str) -> str:
    """Return the name that trees have for the key at this path."""
    return path.removeprefix(OF_NUMBERS)


def scalars(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a drawn spec by the names that trees have for them."""
    return {
        path.removeprefix(OF_NUMBERS): value  # as `name_of`, which is called too often here
        for path, value in values.items()
        if not isinstance(value, str)
    }
