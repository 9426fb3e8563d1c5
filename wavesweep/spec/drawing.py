"""A loop drawn in a spec: numbers, blocks, wires and ports, read with all mistakes at once."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache, partial

from wavesweep.errors import Mistake
from wavesweep.spec.block_types import EVERY, LONGEST_DELAY, PHASE, TICK_HZ, TYPES
from wavesweep.spec.checking import Rejected, check, expectation
from wavesweep.spec.expressions import ONE, Terms, Tree, names_in, sum_of, value_of
from wavesweep.spec.firmware_blocks import stepwise, transfer_function
from wavesweep.spec.keys import AHEAD, LONGEST_FRAME, Key, Names
from wavesweep.spec.reading import Leaf

MARKS = ("numbers", "type", "block", "signals", "wire", "ports")  # a spec that has one of these draws its loop
RATE = "rates.tick_hz"
NUMBER_WORDS = (".unit", ".description")
# Prefix of the paths of numbers, whose rest is the name in trees; other keys are named by their whole path.
OF_NUMBERS = "numbers."
STRUCTURE = ("every", "phase", "steps", "order", "n", "late", "lost")  # keys that decide how a loop is built

Path = tuple[str, ...]

PORT = ":"  # between the name of a member and its port or state, in the names of a plant's
AT = "@"  # before the name of a dead time, in the names of a plant's ports that serve it
NOTHING = 1e-12  # relative to b: a local model does not divide by less
LEAST = 1e-300  # least size of a divisor
SHARES = ("loss", "burst", "burst_end", "burst_loss")  # keys of a channel that say how often messages are lost
OF_PLANT = "a position that a plant has in every tick, such as a mass's x"


def _remembered(function):
    """Make a property of a drawing, computed once for all that are equal: a compiled loop is asked again and again."""
    return property(lru_cache(maxsize=64)(function))


@dataclass(frozen=True, slots=True)
class DrawnBlock:
    """A block: its keys hold trees of numbers, tuples of these, or words.

    phases: the ticks in which it runs, if it does so several times in `every` ticks. limits: the keys that say what it does
    beyond limits, see `BlockType.limits`.
    """

    name: str
    type: str
    keys: tuple[tuple[str, object], ...]
    every: Tree
    phase: Tree
    phases: tuple[int, ...] = ()
    limits: tuple[tuple[str, object], ...] = ()

    @property
    def plant(self) -> bool:
        """Whether it runs in every tick in any case."""
        return TYPES[self.type].is_plant(dict(self.keys))

    @property
    def loses_at_random(self) -> bool:
        """Whether it is a channel whose messages are lost with a probability."""
        given = (dict(self.keys).get(key, ("number", 0.0)) for key in ("loss", "burst"))
        return any(tree[:2] != ("number", 0.0) for tree in given)

    @property
    def dead_time(self) -> Tree | None:
        """The dead time (s) of a delay that is given in seconds; None for any other block."""
        return dict(self.keys).get("seconds")

    @property
    def ports(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Its input and output ports."""
        return TYPES[self.type].ports_of(dict(self.keys))

    def divisor(self, tick_hz: Tree) -> Tree:
        """What a local model divides by, `b + B + K h`, h the time that its spring reads ahead."""
        keys = dict(self.keys)
        ahead = ("*", ("number", AHEAD[keys["integration"]], 0), ("/", self.every, tick_hz, 0), 0)
        return ("+", ("+", keys["b"], keys["B"], 0), ("*", keys["K"], ahead, 0), 0)

    def core(self, tick_hz: Tree, named: bool = False) -> DrawnBlock:
        """The block itself, or of a block of firmware its transfer function; named: in the names of its keys and of T."""
        if not TYPES[self.type].formula:
            return self
        keys, period = self.keys, ("/", self.every, tick_hz, 0)
        if named:
            keys, period = (
                tuple((name, value if isinstance(value, str) else ("name", name, 0)) for name, value in keys),
                ("name", "T", 0),
            )
        return replace(self, type="tf", keys=transfer_function(self.type, keys, period), limits=())

    def stepwise(self, tick_hz: Tree) -> DrawnBlock:
        """The block itself, or a state-space model of it if its states would mean something else at another period."""
        keys = stepwise(self.type, self.keys, self.ports, ("/", self.every, tick_hz, 0))
        return replace(self, type="ss", keys=keys, limits=()) if keys else self

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield the name of the key and the tree for each number in the keys, without those of `limits`."""
        yield from (("every", self.every), ("phase", self.phase))
        yield from self._trees(self.keys)

    def limit_trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield the same of `limits`."""
        yield from self._trees(self.limits)

    def _trees(self, keys):
        for name, value in keys:
            yield from ((name, tree) for tree in _trees(TYPES[self.type].keys[name].type, value))


def _trees(kind: str, value: object) -> Iterator[Tree]:
    if kind in ("number", "integer"):
        yield value
    elif kind == "list":
        yield from value
    elif kind == "rows":
        yield from (tree for row in value for tree in row)


class Condition:
    """What a number has to fulfil, also that it is finite.

    own, others: path and tree of the number, and of others that it depends on; names: in these trees. holds: whether their
    values, or arrays of these, fulfil it. expected: the text of what is expected, or a function of the values that gives it.
    """

    def __init__(self, holds, expected, own, *others):
        self.path, self.reads, self.holds, self.expected = own[0], (own, *others), holds, expected
        self.names = frozenset(name for _, tree in self.reads for name, _ in names_in(tree))


@dataclass(frozen=True, slots=True)
class Plant:
    """Blocks that act on each other continuously: their names and ports as those of one block, which runs in every tick.

    couplings: how they act on each other. arriving: ports, and the dead times whose output arrives there between two
    ticks. sensed: outputs, and the dead times that read them between two ticks. A single block is a plant too if it has any.
    """

    members: tuple[DrawnBlock, ...]
    couplings: tuple[tuple[str, Terms], ...]
    arriving: tuple[tuple[str, str], ...] = ()
    sensed: tuple[tuple[str, str], ...] = ()
    every, phase, phases = ONE, ("number", 0.0, 0), ()

    @property
    def name(self) -> str:
        """The name of the block that all members are together."""
        return "+".join(block.name for block in self.members)

    def start(self, member: str) -> str:
        """What the names of the ports and states of a member begin with."""
        return f"{self.name}.{member.replace('.', PORT)}{PORT}"

    @property
    def drawn_ports(self) -> tuple[list[str], list[str]]:
        """The input and output ports of its members, as they are drawn."""
        return tuple([f"{block.name}.{port}" for block in self.members for port in block.ports[side]] for side in (0, 1))

    @property
    def ports(self) -> tuple[list[str], list[str]]:
        """The same as ports of the plant."""
        return tuple([name.replace(".", PORT) for name in side] for side in self.drawn_ports)

    @property
    def signals(self) -> dict[str, str]:
        """The signal of the plant for each port of its members."""
        return {name: f"{self.name}.{name.replace('.', PORT)}" for side in self.drawn_ports for name in side}

    @property
    def acts_on_itself(self) -> bool:
        """Whether its couplings form a loop."""
        feeds = {(name.rpartition(".")[0], port.rpartition(".")[0]) for port, terms in self.couplings for name, _ in terms}
        names, before = {reader for _, reader in feeds}, None
        while names != before:
            before, names = names, {source for source, reader in feeds if reader in names}
        return bool(names)

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield a name and the tree for each number in its members' keys and in its couplings."""
        yield from (each for block in self.members for each in block.trees())
        yield from (term for _, terms in self.couplings for term in terms)


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawn loop without the values of its numbers.

    numbers: name, unit and description of each. whole: those that have to be whole. wires: input port -> its signals and their
    gains, held over a tick at a plant. hand: the signal of the hand's force; the displacement, and the force against the hand
    if it is named, as signals and gains. wall: the numbers that are the stiffness and the damping of a wall. turns: whether the
    hand turns, and its force and displacement are a torque and an angle. couplings: as wires, by which plants act on each other
    continuously. inputs: name, signal and unit of each signal from outside, without the hand's force. outputs: name, terms and
    unit of each. named: the names in [signals], which `simulate` shows too, and their terms.
    """

    tick_hz: Tree
    numbers: tuple[tuple[str, str, str], ...]
    whole: frozenset[str]
    blocks: tuple[DrawnBlock, ...]
    wires: tuple[tuple[str, Terms], ...]
    hand: tuple[str, Terms, Terms | None] | None = None
    wall: tuple[str, ...] | None = None
    turns: bool = False
    couplings: tuple[tuple[str, Terms], ...] = ()
    inputs: tuple[tuple[str, str, str], ...] = ()
    outputs: tuple[tuple[str, Terms, str], ...] = ()
    named: tuple[tuple[str, Terms], ...] = ()
    hashed: int = field(init=False, repr=False, compare=False)

    def __post_init__(self):
        """Hash the trees once, since a drawing is looked up again and again."""
        object.__setattr__(self, "hashed", hash(self._parts()))

    def __hash__(self) -> int:
        return self.hashed

    def __reduce__(self):
        return type(self), self._parts()  # another process has other hashes

    def _parts(self):
        return tuple(getattr(self, each.name) for each in fields(self) if each.init)

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield the path of the key and the tree for each number of the drawing."""
        yield RATE, self.tick_hz
        for block in self.blocks:
            yield from ((f"block.{block.name}.{name}", tree) for name, tree in block.trees())
        terms = [(f"wire.{port}", terms) for port, terms in (*self.wires, *self.couplings)]
        if self.hand:
            terms += [("ports.hand.displacement", self.hand[1]), ("ports.hand.reaction", self.hand[2] or ())]
        terms += [(f"ports.outputs.{name}", some) for name, some, _ in self.outputs]
        yield from ((path, gain) for path, some in terms for _, gain in some)

    def tied(self, along: str, paths: tuple[str, ...]) -> Drawing:
        """Return the drawing in which some numbers are multiples of another one: their values are the factors."""
        for name in map(name_of, paths):
            product = ("*", ("name", name, 0), ("name", name_of(along), 0), 0)
            parts = ("tick_hz", "blocks", "wires", "hand", "couplings", "outputs", "named")
            parts = {part: _replaced(getattr(self, part), ("name", name), product) for part in parts}
            self = replace(self, **parts)  # noqa: PLW0642 - the same drawing, with one number less of its own
        return self

    def rate(self, values: Mapping[str, float]) -> float:
        """Return the rate of the tick in Hz."""
        return value_of(self.tick_hz, scalars(values))

    @property
    def outside(self) -> tuple[str, ...]:
        """The signals from outside: the hand's force first, then those of the inputs."""
        return tuple(dict.fromkeys([*(self.hand or ())[:1], *(signal for _, signal, _ in self.inputs)]))

    @property
    def signals(self) -> list[str]:
        """The signals that can be looked at: ports of blocks as BLOCK.PORT, outputs first, and the names in [signals]."""
        ports = (f"{block.name}.{port}" for side in (1, 0) for block in self.blocks for port in block.ports[side])
        return [*ports, *(name for name, _ in self.named)]

    @_remembered
    def plants(self) -> tuple[Plant, ...]:
        """The plants that are made of several blocks, which couplings connect, and those that a dead time acts on or reads."""
        arriving, sensed = _between_ticks(self)
        plants: list[set[str]] = []
        for joined in ({_block_of(name) for name in (port, *dict(terms))} for port, terms in self.couplings):
            whole = joined.union(*(each for each in plants if each & joined))
            plants = [each for each in plants if not each & whole] + [whole]
        for name in dict.fromkeys(_block_of(name) for name, _ in (*arriving, *sensed)):
            plants += [] if any(name in whole for whole in plants) else [{name}]
        made = []
        for names in plants:
            parts = ([each for each in some if _block_of(each[0]) in names] for some in (self.couplings, arriving, sensed))
            made.append(Plant(tuple(block for block in self.blocks if block.name in names), *map(tuple, parts)))
        return tuple(sorted(made, key=lambda plant: self.blocks.index(plant.members[0])))

    @_remembered
    def dead_times(self) -> dict[str, Tree]:
        """The dead time (s) of each delay that has one."""
        return {block.name: block.dead_time for block in self.blocks if block.dead_time}

    @_remembered
    def building(self) -> dict[str, tuple[str, ...]]:
        """Paths of the whole numbers by which dead times decide how the loop is built, each with the dead times that it is of.

        Those of one are its number of ticks. Those of two say whether what the first one brings to a plant has arrived before
        the second one, or the same, reads the plant; see `wavesweep.loops.dead_time`.
        """
        pairs = {(one, other) for plant in self.plants for _, one in plant.arriving for _, other in plant.sensed}
        ticks = {f"block.{name}.ticks": (name,) for name in self.dead_times}
        return ticks | {f"block.{one}.before.{other}": (one, other) for one, other in sorted(pairs)}

    @property
    def channels(self) -> tuple[DrawnBlock, ...]:
        """The blocks whose messages may be late or lost."""
        return tuple(block for block in self.blocks if block.type == "channel")

    @property
    def at_random(self) -> bool:
        """Whether messages are lost with a probability."""
        return any(block.loses_at_random for block in self.channels)

    @property
    def alone(self) -> list[DrawnBlock]:
        """The blocks outside all plants."""
        members = {block for plant in self.plants for block in plant.members}
        return [block for block in self.blocks if block not in members]

    @property
    def inside(self) -> dict[str, str]:
        """The signal of a plant for each port of its members."""
        return {port: signal for plant in self.plants for port, signal in plant.signals.items()}

    @_remembered
    def shaping(self) -> frozenset[str]:
        """Names of the numbers on which the structure of the loop depends."""
        return frozenset(name for path, tree in self.trees() if decides(path) for name, _ in names_in(tree))

    @_remembered
    def cores(self) -> tuple[DrawnBlock, ...]:
        """The blocks, with its transfer function in place of each block of firmware."""
        return tuple(block.core(self.tick_hz) for block in self.blocks)

    @_remembered
    def reads(self) -> frozenset[str]:
        """Paths of the keys whose numbers the loop reads."""
        return frozenset(path_of(name) for _, tree in self.trees() for name, _ in names_in(tree))

    @_remembered
    def of_limits(self) -> frozenset[str]:
        """Paths of the keys that limits of blocks alone read, on which nothing depends within them."""
        trees = (tree for block in self.blocks for _, tree in block.limit_trees())
        return frozenset(path_of(name) for tree in trees for name, _ in names_in(tree)) - self.reads

    @_remembered
    def of_losses(self) -> frozenset[str]:
        """Paths of the keys that probabilities of channels alone read: with all messages in time nothing depends on them."""
        shares = {f"block.{block.name}.{key}" for block in self.channels for key in SHARES}
        others = (tree for path, tree in self.trees() if path not in shares)
        return self.reads - {path_of(name) for tree in others for name, _ in names_in(tree)}

    @property
    def rating(self) -> frozenset[str]:
        """Names of the numbers that the rate of the tick follows from."""
        return frozenset(name for name, _ in names_in(self.tick_hz))

    @_remembered
    def names(self) -> Names:
        """The keys that may be axes, and the short names of numbers."""
        keys = {RATE: replace(TICK_HZ, path=RATE, required=False)} if RATE in self.rating else {}
        for name, unit, description in self.numbers:
            kind = "integer" if name in self.whole else "number"
            keys[path_of(name)] = Key(path_of(name), kind, None, unit, description, shaping=name in self.shaping)
        for block in self.blocks:
            of_type = keys_of_block(block.type)
            for name, tree in (*block.trees(), *block.limit_trees()):
                path = f"block.{block.name}.{name}"
                if any(path == each for each, _ in names_in(tree)):
                    keys[path] = replace(of_type[name], path=path, required=False, shaping=path in self.shaping)
        return Names(keys, {name: path_of(name) for name, _, _ in self.numbers})

    @_remembered
    def conditions(self) -> tuple[Condition, ...]:
        """What its numbers have to fulfil, those of a key by itself first."""
        rate, *others = ((path, tree) for path, tree in self.trees() if not path.startswith("block."))
        found = [Condition(partial(_within, TICK_HZ), expectation(TICK_HZ), rate)]
        found += [Condition(lambda value: True, "", each) for each in others]  # noqa: ARG005 - any finite number will do
        return (*found, *(each for block in self.blocks for each in _conditions(block, *rate)))

    def faults(self, values: Mapping[str, float]) -> Iterator[tuple[str, str, str]]:
        """Yield path, expected and found text for each key that these values do not suit; keys without values are left out."""
        numbers, wrong, every = scalars(values), set(), {}
        for condition in self.conditions:
            path, expected = condition.path, condition.expected
            if not condition.names <= numbers.keys() or wrong & {each for each, _ in condition.reads}:
                continue  # a number that has a mistake itself
            known = [_value(tree, numbers) for _, tree in condition.reads]
            if known[0] is None:
                wrong.add(path)
                yield path, "a finite number", "a division by zero, a root or logarithm of a negative number or an overflow"
            elif None not in known and not condition.holds(*known):
                wrong.add(path)
                yield path, expected if isinstance(expected, str) else expected(*known), f"{known[0]:g}"
            elif path.startswith("block.") and path.endswith(".every"):
                every[path] = int(known[0])
        runs = {path: ticks for path, ticks in every.items() if path not in wrong}
        if (frame := math.lcm(*runs.values())) > LONGEST_FRAME:
            expected = f"ticks of a frame, after which all blocks are in step again, <= {LONGEST_FRAME}"
            listed = ", ".join(sorted(set(map(str, runs.values()))))
            yield max(runs, key=runs.get), expected, f"{frame} (the least common multiple of {listed})"

    def displaced(self, values: Mapping[str, float]) -> Iterator[tuple[str, str, str]]:
        """Yield path, expected and found text for each part of the hand's displacement that is known to be no such position."""
        force, terms, _ = self.hand or ("", (), None)
        every, numbers = {block.name: block.every for block in self.blocks if not block.plant}, scalars(values)
        velocities = [f"{block.name}.v" for block in self.blocks if TYPES[block.type].body]
        for signal, gain in terms:
            name = signal.rpartition(".")[0] or signal
            if not numbers.keys() >= {each for tree in (gain, every.get(name, ONE)) for each, _ in names_in(tree)}:
                continue  # a number that has a mistake itself
            runs = _value(every.get(name, ONE), numbers) or 1
            slow = f"{signal} changes every {runs:g} ticks only" if runs > 1 else ""
            found = "the force itself" if signal == force else f"{signal} is a velocity" if signal in velocities else slow
            if found and _value(gain, numbers):
                yield "ports.hand.displacement", OF_PLANT, found


def _replaced(part: object, leaf: tuple, tree: Tree) -> object:
    """Nested tuples and blocks with a tree in place of each leaf that begins so."""
    if isinstance(part, DrawnBlock):
        return replace(part, keys=_replaced(part.keys, leaf, tree))
    if not isinstance(part, tuple):
        return part
    return tree if part[:2] == leaf else tuple(_replaced(each, leaf, tree) for each in part)


def _between_ticks(drawing):
    """Ports of plants with the dead times that arrive there, and outputs of plants with the dead times that read them."""
    plants, delays, arriving, sensed = {block.name for block in drawing.blocks if block.plant}, drawing.dead_times, {}, {}
    for port, terms in drawing.wires if delays else ():
        own = _block_of(port)
        for source in (_block_of(signal) for signal, _ in terms) if own in plants else ():
            if source in delays:
                arriving[port, source] = None
        for signal, _ in terms if own in delays else ():
            if _block_of(signal) in plants:
                sensed[signal, own] = None
    return tuple(arriving), tuple(sensed)


def _block_of(name):
    return name.rpartition(".")[0]


def keys_of_block(kind: str) -> dict[str, Key]:
    """Return the keys of a block of this type, and those that every block has."""
    return {**TYPES[kind].keys, "every": EVERY, "phase": PHASE}


def path_of(name: str) -> str:
    """Return the path of the key that trees call by this name."""
    return name if "." in name else OF_NUMBERS + name


def name_of(path: str) -> str:
    """Return the name that trees have for the key at this path."""
    return path.removeprefix(OF_NUMBERS)


def scalars(values: Mapping[str, object]) -> dict[str, object]:
    """Return the values of a drawn spec by the names that trees have for them."""
    return {name_of(path): value for path, value in values.items() if not isinstance(value, str)}


def _value(tree: Tree, numbers: Mapping[str, float]) -> float | None:
    try:
        value = value_of(tree, numbers)
        return value if not isinstance(value, complex) and math.isfinite(value) else None
    except (ArithmeticError, ValueError, TypeError):  # a TypeError is that of the root of a complex number
        return None


def _conditions(block: DrawnBlock, rate: str, tick_hz: Tree) -> Iterator[Condition]:
    """Yield what the numbers of a block have to fulfil. rate, tick_hz: path and tree of the tick's rate."""
    kind, start, tick, keys = TYPES[block.type], f"block.{block.name}.", (rate, tick_hz), keys_of_block(block.type)
    numbers = [(name, (start + name, tree)) for name, tree in (*block.trees(), *block.limit_trees())]
    own = dict(reversed(numbers))  # of a list the first number
    for name, number in numbers:
        yield Condition(partial(_within, keys[name]), partial(expectation, keys[name]), number)
    if block.plant or block.dead_time:
        what = "a dead time" if block.dead_time else f"a {block.type} that is continuous"
        yield Condition(lambda ticks: ticks == 1, f"1, since {what} runs in every tick", own["every"])
    else:
        yield Condition(operator.lt, lambda _, every: f"a whole number < every = {every:g}", own["phase"], own["every"])
    for name in kind.below_half:
        reads = own[name], tick, own["every"], own.get("order", ("", ONE))
        yield Condition(lambda hz, rate, every, order: (hz < rate / every / 2) | (order == 0), _below_half, *reads)
    if "low" in own:
        yield Condition(operator.gt, lambda _, low: f"a number > low = {low:g}", own["high"], own["low"])
    elif "high" in own:
        yield Condition(lambda high: high > 0, "a number > 0, as low is -high", own["high"])
    for name in ("late", "lost") if block.loses_at_random else ():
        expected = "0 beside loss or burst, since messages are lost either at random or by any pattern"
        yield Condition(lambda number: number == 0, expected, own[name])
    if block.type == "tf":
        yield Condition(lambda first: abs(first) >= LEAST, "a first coefficient other than 0", own["den"])
    if block.dead_time:
        expected = f"at most {LONGEST_DELAY} ticks of the loop, {{:g}} s".format
        longest = lambda _, hz: expected(LONGEST_DELAY / hz)  # noqa: E731 - beside its text
        yield Condition(lambda seconds, hz: seconds * hz <= LONGEST_DELAY, longest, own["seconds"], tick)
    if block.type == "local_model":
        explicit = dict(block.keys)["integration"] == "explicit"
        total = "b + B is not 0" if explicit else "b + B + K h is not 0, h the time that its spring reads ahead"
        reads = own["B" if explicit else "K"], ("", block.divisor(tick_hz)), own["b"]
        yield Condition(lambda _, total, b: abs(total) > NOTHING * abs(b), f"a number with which {total}", *reads)


def _below_half(_, rate, every, __):
    return f"a number < {rate / every / 2:g} (half the block's own rate)"


def _within(key: Key, value):
    """Whether a value, or each of an array, is one that the key of a number accepts."""
    low, high = (-math.inf if key.low is None else key.low), (math.inf if key.high is None else key.high)
    above = value > low if key.above_low else value >= low
    return above & (value <= high) & ((value % 1 == 0) if key.type == "integer" else True)


def decides(path: str) -> bool:
    """Whether the key of a block decides how the loop is built."""
    return path.startswith("block.") and path.rpartition(".")[2] in STRUCTURE


def resolve_drawn(drawing: Drawing, before: Mapping[str, float], given) -> tuple[dict[str, float], list[Mistake]]:
    """Return the values of a drawing's numbers as they are given now, and all mistakes. given: a `Given`."""
    values, mistakes = dict(before), []
    for path, key in drawing.names.keys.items():
        leaf = given.leaves.get(path)
        try:
            values[path] = values[path] if leaf is None else check(key, leaf.value)
        except Rejected as error:
            mistakes.append(leaf.mistake(path, error.expected, error.found))
    if not mistakes:
        faults = drawing.faults(values)
        mistakes = [given.leaf(path).mistake(path, expected, found) for path, expected, found in faults]
    return values, mistakes


def written(drawing: Drawing, values: Mapping[str, float], given) -> dict[Path, object]:
    """Return the resolved tables by path, as a spec could give them. given: a `Given`."""
    tables: dict[Path, object] = {("rates", "tick_hz"): values.get(RATE) or given.leaves[RATE].value}
    for name, unit, description in drawing.numbers:
        tables["numbers", name] = {"value": values[path_of(name)], "unit": unit, "description": description}
    for block in (each for each in drawing.blocks if f"block.{each.name}.type" in given.leaves):  # others are of `prev(...)`
        tables |= _written_block(block, values, given)
    for path, leaf in given.leaves.items():
        table, _, rest = path.partition(".")
        if path.startswith(("ports.inputs.", "ports.outputs.")):
            if not path.endswith(".unit"):
                word, place = given.leaves.get(f"{path}.unit"), tuple(path.split(".", 2))
                tables[*place, "signal"], tables[*place, "unit"] = leaf.value, word.value if word else ""
        elif table in ("wire", "signals", "ports"):
            tables[tuple(path.split(".")) if table == "ports" else (table, rest)] = leaf.value
        elif table == "numbers" and path not in values and not path.endswith(NUMBER_WORDS):  # one that follows from others
            words = (given.leaves.get(path + each) for each in NUMBER_WORDS)
            unit, description = (word.value if word else "" for word in words)
            tables[table, rest] = {"value": leaf.value, "unit": unit, "description": description}
    asked = [each for each in drawing.outputs if f"ports.outputs.{each[0]}" not in given.leaves]
    for name, terms, unit in asked:  # by [bode] or [simulate], see `Drawing.signals`
        tables |= {("ports", "outputs", name, "signal"): sum_of(terms), ("ports", "outputs", name, "unit"): unit}
    return tables


def _written_block(block, values, given):
    """The keys of a block, as `written` gives them."""
    tables = {("block", block.name, "type"): block.type}
    for name, key in keys_of_block(block.type).items():
        path = f"block.{block.name}.{name}"
        leaf = given.leaves.get(path)
        value = values.get(path, leaf.value if leaf else key.default)
        if value is not None and not (name == "steps" and block.dead_time):
            tables["block", block.name, name] = list(value) if isinstance(value, tuple) else value
    return tables


def is_derived(path: Path, leaf: Leaf) -> bool:
    """Whether a leaf is one of [numbers] that is an expression, from which the number follows."""
    return path[0] == "numbers" and isinstance(leaf.value, str) and len(path) > 1 and path[2:] in ((), ("value",))


def names_of(leaves: Mapping[Path, Leaf]) -> Names:
    """Return the names of a drawing that has mistakes, so that its axes can be checked too."""
    numbers = dict.fromkeys(path[1] for path in leaves if path[0] == "numbers" and len(path) > 1)
    keys = {RATE: TICK_HZ} | {path_of(name): Key(path_of(name), "number", None, "", "") for name in numbers}
    keys |= {path: Key(path, "number", None, "", "") for path in own_axes(leaves)}
    return Names(keys, {name: path_of(name) for name in numbers})


def own_axes(leaves: Mapping[Path, Leaf]) -> frozenset[str]:
    """Return the paths of the keys of blocks that [sweep], [bode] and [design] take for axes."""
    blocks = {path[1] for path in leaves if path[0] == "block" and len(path) > 1}  # those of a class have two names
    named = [path[1:] for path in leaves if path[0] in ("sweep", "bode", "for_all")]
    named += [path[2:] for path in leaves if path[0] == "design"]
    along = leaves.get(("sweep", "along"))
    if along and isinstance(along.value, str):
        named.append(tuple(along.value.split(".")))
    return frozenset(
        ".".join(each[: 3 + (".".join(each[1:3]) in blocks)]) for each in named if len(each) > 2 and each[0] == "block"
    )
