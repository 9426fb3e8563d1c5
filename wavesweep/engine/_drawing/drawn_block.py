"""The blocks of a drawn loop, and the plants that blocks make that act on each other continuously.

Blocks of firmware are transfer functions of their own keys, by the formulas of their types, one for
each coefficient. Next to z = 1, where the poles of slow filters are, coefficients in powers of z
cancel; those in powers of z - 1 do not. The simulation has laws of its own for the same blocks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from wavesweep.engine._drawing.block_types import EVERY, PHASE, TYPES
from wavesweep.engine._drawing.expressions import ONE, Terms, Tree
from wavesweep.engine._drawing.parsing import parse
from wavesweep.engine._keys.key import AHEAD, Key

# in place of true as `discrete` of a transfer function: its powers are those of z - 1
DELTA = "delta"
# What names in the formulas of `BlockType` stand for, unless they are keys that are given.
DEFINED = MappingProxyType(
    {
        "K": "tan(pi*frequency_hz*T)",
        "a": "2*pi*cutoff_hz*T/(1 + 2*pi*cutoff_hz*T)",
        "r": "sqrt(2*b)",
        "g": "1/(b + B + K*T/2)",
    }
)
_ABSENT = {
    name: Tree.number(value)
    for name, value in (("kp", 0.0), ("ki", 1.0), ("kd", 0.0), ("tau", 0.0))
}
TRAPEZIA = "trapezoidal"
PORT = ":"  # between the name of a member and its port or state, in the names of a plant's


@dataclass(frozen=True, slots=True)
class DrawnBlock:
    """A block: its keys hold trees of numbers, tuples of these, or words.

    phases: the ticks in which it runs, if it does so several times in `every` ticks. limits: the
    keys that say what it does beyond limits, see `BlockType.limits`.
    """

    name: str
    type: str
    keys: tuple[tuple[str, Any], ...]
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
        keys = dict(self.keys)
        return any(not keys[key].is_number(0.0) for key in ("loss", "burst") if key in keys)

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
        ahead = AHEAD[keys["integration"]] * (self.every / tick_hz)
        return keys["b"] + keys["B"] + keys["K"] * ahead

    @property
    def in_time(self) -> bool:
        """Whether it is a channel whose messages are all in time by its own keys, which is a
        hold."""
        keys = dict(self.keys)
        may_fail = ("late", "lost", "loss", "burst")
        return self.type == "channel" and all(keys[name].is_number(0.0) for name in may_fail)

    def core(self, tick_hz: Tree, named: bool = False) -> DrawnBlock:
        """The block itself, or of a block of firmware, a fir or one whose type has a formula, its
        transfer function; named: in the names of its keys, which are numbers or words, and of T."""
        if self.type == "fir":  # of any length, so that it has no formula
            num = dict(self.keys)["coefficients"]
            den = (ONE, *(Tree.number(0.0),) * (len(num) - 1))
            return replace(self, type="tf", keys=(("num", num), ("den", den), ("discrete", True)))
        if not TYPES[self.type].formula:
            return self
        keys = self.keys
        period = self.every / tick_hz
        if named:
            keys = tuple(
                (name, value if isinstance(value, str) else Tree.name(name)) for name, value in keys
            )
            period = Tree.name("T")
        return replace(self, type="tf", keys=transfer_function(self.type, keys, period), limits=())

    def stepwise(self, tick_hz: Tree) -> DrawnBlock:
        """The block itself, or a state-space model of it if its states would mean something else
        at another period."""
        keys = stepwise(self.type, self.keys, self.ports, self.every / tick_hz)
        return replace(self, type="ss", keys=keys, limits=()) if keys else self

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield the name of the key and the tree for each number in the keys, without those of
        `limits`."""
        yield from (("every", self.every), ("phase", self.phase))
        yield from self._trees(self.keys)

    def limit_trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield the same of `limits`."""
        yield from self._trees(self.limits)

    def _trees(self, keys: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Tree]]:
        for name, value in keys:
            yield from ((name, tree) for tree in _trees(TYPES[self.type].keys[name].type, value))


def _trees(kind: str, value: Any) -> Iterator[Tree]:
    if kind in ("number", "integer"):
        yield value
    elif kind == "list":
        yield from value
    elif kind == "rows":
        yield from (tree for row in value for tree in row)


@dataclass(frozen=True, slots=True)
class Plant:
    """Blocks that act on each other continuously: their names and ports as those of one block,
    which runs in every tick.

    couplings: how they act on each other. arriving: ports, and the dead times whose output arrives
    there between two ticks. sensed: outputs, and the dead times that read them between two ticks. A
    single block is a plant too if it has any.
    """

    members: tuple[DrawnBlock, ...]
    couplings: tuple[tuple[str, Terms], ...]
    arriving: tuple[tuple[str, str], ...] = ()
    sensed: tuple[tuple[str, str], ...] = ()
    every, phase, phases = ONE, Tree.number(0.0), ()

    @property
    def name(self) -> str:
        """The name of the block that all members are together."""
        return "+".join(block.name for block in self.members)

    def own(self, name: str) -> str:
        """The name that the port or state MEMBER.NAME has in the plant: the same, without the
        member if it is the only one."""
        return name.replace(".", PORT) if len(self.members) > 1 else name.rpartition(".")[2]

    def start(self, member: str) -> str:
        """What the names of the ports and states of a member begin with."""
        return f"{self.name}.{self.own(member + '.')}"

    @property
    def drawn_ports(self) -> tuple[list[str], list[str]]:
        """The input and output ports of its members, as they are drawn."""
        return signals_of(self.members)

    @property
    def ports(self) -> tuple[list[str], list[str]]:
        """The same as ports of the plant."""
        inputs, outputs = self.drawn_ports
        return [*map(self.own, inputs)], [*map(self.own, outputs)]

    @property
    def signals(self) -> dict[str, str]:
        """The signal of the plant for each port of its members."""
        inputs, outputs = self.drawn_ports
        return {name: f"{self.name}.{self.own(name)}" for name in (*inputs, *outputs)}

    @property
    def acts_on_itself(self) -> bool:
        """Whether its couplings form a loop."""
        feeds = set()
        for port, terms in self.couplings:
            for name, _ in terms:
                feeds.add((name.rpartition(".")[0], port.rpartition(".")[0]))
        names = {reader for _, reader in feeds}
        before = None
        while names != before:
            before = names
            names = {source for source, reader in feeds if reader in names}
        return bool(names)

    def trees(self) -> Iterator[tuple[str, Tree]]:
        """Yield a name and the tree for each number in its members' keys and in its couplings."""
        yield from (key for block in self.members for key in block.trees())
        yield from (term for _, terms in self.couplings for term in terms)


def keys_of_block(kind: str) -> dict[str, Key]:
    """Return the keys of a block of this type, and those that every block has."""
    return {**TYPES[kind].keys, "every": EVERY, "phase": PHASE}


@lru_cache(maxsize=1024)
def transfer_function(
    kind: str, keys: tuple[tuple[str, Any], ...], period: Tree
) -> tuple[tuple[str, Any], ...]:
    """Return the keys of the block of type `tf` that a block of firmware is; keys: its own;
    period: of the block, s."""
    meanings = _meanings(keys, period)
    num, den = (_in_full(texts, meanings) for texts in TYPES[kind].formula)
    return ("num", num), ("den", den), ("discrete", True if kind == "biquad" else DELTA)


@lru_cache(maxsize=1024)
def stepwise(
    kind: str,
    keys: tuple[tuple[str, Any], ...],
    ports: tuple[tuple[str, ...], tuple[str, ...]],
    period: Tree,
) -> tuple[tuple[str, Any], ...]:
    """Return the keys of a block as one of type `ss` whose states mean the same at every period;
    none if its own states do.

    A trapezium over a step of its own needs the last velocity, which the one state of steps that
    are all alike has in it.
    """
    inputs, outputs = ports
    by_trapezia = TRAPEZIA in dict(keys).values()
    if not TYPES[kind].stepwise or not (TYPES[kind].formula or by_trapezia):
        return ()
    meanings = _ABSENT | _meanings(keys, period) | {"late": Tree.number(0.5 * by_trapezia)}
    rows = [_in_full(row.split(";"), meanings) for row in TYPES[kind].stepwise]
    n = len(rows) - len(outputs)
    of_states = rows[:n]
    of_outputs = rows[n:]
    return (
        ("A", tuple(row[:n] for row in of_states)),
        ("B", tuple(row[n:] for row in of_states)),
        ("C", tuple(row[:n] for row in of_outputs)),
        ("D", tuple(row[n:] for row in of_outputs)),
        ("inputs", inputs),
        ("outputs", outputs),
        ("discrete", True),
    )


def _in_full(texts: Iterable[str], meanings: dict[str, Tree]) -> tuple[Tree, ...]:
    """The trees of formulas with what their names stand for."""
    return tuple(parse(text).with_trees(meanings) for text in texts)


def _meanings(keys: tuple[tuple[str, Any], ...], period: Tree) -> dict[str, Tree]:
    """What names in a formula stand for."""
    meanings = {name: tree for name, tree in keys if isinstance(tree, Tree)} | {"T": period}
    meanings["ahead"] = Tree.number(AHEAD.get(dict(keys).get("method", ""), 0.0))
    return {name: parse(text).with_trees(meanings) for name, text in DEFINED.items()} | meanings


def signals_of(blocks: Iterable[DrawnBlock]) -> tuple[list[str], list[str]]:
    """The input and output ports of blocks, as BLOCK.PORT."""
    inputs = []
    outputs = []
    for block in blocks:
        into, out_of = block.ports
        inputs += [f"{block.name}.{port}" for port in into]
        outputs += [f"{block.name}.{port}" for port in out_of]
    return inputs, outputs
