"""Reading the tables of a drawn loop: every mistake of a spec at once, each at its place."""

from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from wavesweep.engine._drawing.block_types import TICK_HZ, TYPES
from wavesweep.engine._drawing.conditions import NOT_FINITE, displaced, faults
from wavesweep.engine._drawing.continuous import Wires, parted, watching_held
from wavesweep.engine._drawing.drawing import RATE, Drawing, name_of, path_of, scalars
from wavesweep.engine._drawing.drawing_keys import NAME, is_dotted, is_name
from wavesweep.engine._drawing.drawing_ports import PORTS, TURNS, VOLTS, PortReader
from wavesweep.engine._drawing.drawn_block import DrawnBlock
from wavesweep.engine._drawing.expressions import (
    NOT_RESERVED,
    ONE,
    PERIOD,
    RESERVED,
    Fault,
    Terms,
    Tree,
)
from wavesweep.engine._drawing.parsing import parse
from wavesweep.engine._drawing.registers import with_registers
from wavesweep.engine._keys.checking import Mistakes, nearest, show
from wavesweep.engine._keys.key import Key, Leaf, Names, Place

NUMBER_PARTS = ("value", "unit", "description")
# the tables of a drawing, with the keys in those that have no names of their own
TABLES = MappingProxyType(
    {
        "rates": ("tick_hz",),
        "numbers": NUMBER_PARTS,
        "block": (),
        "signals": (),
        "wire": (),
        "ports": PORTS,
    }
)

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What stands beside a drawing and asks something of it.

    axes: paths of keys of blocks that are numbers too, since something varies them. signals: those
    that are outputs too, by name, with the leaf that asks for each. classes: names of types that
    blocks could have had in addition, for messages. taken: names that no number may have. free:
    what a name is that is none of these, in words.
    """

    axes: frozenset[str] = frozenset()
    signals: Mapping[str, Leaf] = field(default_factory=dict)
    classes: tuple[str, ...] = ()
    taken: frozenset[str] = frozenset()
    free: str = ""


class ReadDrawing(NamedTuple):
    """A drawing, None if it has mistakes, the values of its numbers, its leaves by path, and its
    names."""

    drawing: Drawing | None
    values: dict[str, float]
    leaves: dict[str, Leaf]
    names: Names


def read_drawing(
    leaves: Mapping[Path, Leaf],
    source: Place,
    mistakes: Mistakes,
    surroundings: Surroundings = Surroundings(),
) -> ReadDrawing:
    """Return what is drawn, and add its mistakes.

    leaves: other tables than those of a drawing are skipped. source: their place.
    """
    reader = _TableReader(source, surroundings.axes | {RATE}, surroundings.classes)
    grouped = reader.grouped(leaves)
    reader.asked = surroundings.signals
    reader.taken = surroundings.taken
    reader.free = surroundings.free
    drawing, values = reader.drawing(grouped)
    for path, expected, reason in (*faults(drawing, values), *displaced(drawing, values)):
        leaf = reader.leaf(path)
        text = f"{show(leaf.value)}: {reason}" if isinstance(leaf.value, str) else reason
        reader.mistakes.refuse(leaf, path, expected, text, of_key=False)
    mistakes += reader.mistakes
    names = names_of(leaves, surroundings.axes) if reader.mistakes else drawing.names
    following = frozenset(path[1] for path, leaf in leaves.items() if is_derived(path, leaf))
    names = replace(names, following=following)
    return ReadDrawing(None if reader.mistakes else drawing, values, reader.leaves, names)


def is_derived(path: Path, leaf: Leaf) -> bool:
    """Whether a leaf is one of [numbers] that is an expression, from which the number follows."""
    return (
        path[0] == "numbers"
        and isinstance(leaf.value, str)
        and len(path) > 1
        and path[2:] in ((), ("value",))
    )


def names_of(leaves: Mapping[Path, Leaf], axes: Iterable[str]) -> Names:
    """Return the names of a drawing that has mistakes, so that its axes can be checked too."""
    numbers = dict.fromkeys(path[1] for path in leaves if path[0] == "numbers" and len(path) > 1)
    keys = {RATE: TICK_HZ} | {
        path_of(name): Key(path_of(name), "number", None, "", "") for name in numbers
    }
    keys |= {path: Key(path, "number", None, "", "") for path in axes}
    return Names(keys, {name: path_of(name) for name in numbers})


def signals_from_outside(ports: Mapping[str, Mapping[str, Any]]) -> set[str]:
    """Return the signals of the hand's force and of the inputs. ports: leaves of [ports] by
    side."""
    leaves = [keys["signal"] for keys in ports["inputs"].values()]
    if "force" in ports["hand"]:
        leaves.append(ports["hand"]["force"])
    return {leaf.value for leaf in leaves if isinstance(leaf.value, str)}


def ports_at_rest(springs: Mapping[str, DrawnBlock | None], wires: Iterable[str]) -> list[str]:
    """Return the ports of springs that need no wire: velocities without damping, and the second
    end of those to the ground."""
    velocities = []
    at_ground = []
    for name, block in springs.items():
        if not block or dict(block.keys)["d"].is_number(0.0):
            velocities += [f"{name}.v1", f"{name}.v2"]
        second_end = [f"{name}.x2", f"{name}.v2"]
        if {*second_end}.isdisjoint(wires):
            at_ground += second_end
    return velocities + at_ground


def with_whole_numbers(
    drawing: Drawing, values: dict[str, float]
) -> tuple[Drawing, dict[str, float]]:
    """Return the drawing and the values with integers in place of those floats that are whole, of
    numbers that decide how the loop is built, such as the steps of a delay."""
    integers = {}
    for path in map(path_of, drawing.shaping):
        if path in values and float(values[path]).is_integer():
            integers[path] = int(values[path])
    whole = frozenset(map(name_of, integers))
    return replace(drawing, whole=whole), values | integers


Tables = dict[str, dict[Any, Any]]  # leaves, by the name of a table and what the table has


class _TableReader(PortReader):
    """A reading of all tables of a drawn loop."""

    def grouped(self, leaves: Mapping[Path, Leaf]) -> Tables:
        """Sort the leaves into tables."""
        tables: Tables = {name: {} for name in TABLES}
        for (table, *rest), leaf in leaves.items():
            if table not in TABLES:
                continue
            if not rest:
                if leaf.value != {}:
                    self.refuse(leaf, table, "a table", show(leaf.value), of_key=False)
            elif table in ("rates", "signals", "wire"):
                tables[table][".".join(rest)] = leaf
            elif table == "ports":
                tables[table][tuple(rest)] = leaf
            else:
                key = rest[1] if len(rest) > 1 else ""
                entry = leaf if len(rest) < 3 else Leaf({}, leaf.place.under((table, *rest[:2])))
                tables[table].setdefault(rest[0], {})[key] = entry
        return tables

    def drawing(self, tables: Tables) -> tuple[Drawing, dict[str, float]]:
        """Read every table; parts that have mistakes are left out."""
        self.numbers = tuple(tables["numbers"])
        ports = self.complete_ports(tables["ports"])
        self.outside = signals_from_outside(ports)
        numbers, values = self.read_numbers(tables["numbers"])
        self.tick_hz = self.read_rate(tables["rates"]) or Tree.name(RATE)
        blocks = self.read_blocks(tables)
        self.read_signals(tables["signals"])
        plants = {block.name: block.type for block in blocks if block.plant}
        wires, couplings = self.read_wires(tables["wire"], plants)
        hand = self.read_hand(ports["hand"])
        wall = self.read_wall(ports["wall"])
        inputs = self.read_inputs(ports)
        outputs = self.read_outputs(ports)
        outputs += tuple(self.read_asked(blocks, tables["wire"], numbers, ports))
        named = self.read_named(tables["signals"])
        self.refuse_names_of_others(ports, outputs, blocks, tables["wire"])
        shown = [*(hand or ())[1:], *(terms for _, terms, _ in outputs)]
        always = [*shown, *(terms for _, terms in named)]
        blocks, wires = with_registers(blocks, wires, always, self.registers)
        shown_terms: Terms = ()
        for terms in shown:
            shown_terms += terms or ()
        wires, couplings = watching_held(wires, couplings, shown_terms)
        self.refuse_loose_ends(tables)
        self.refuse_two_meanings(tables, plants, values | self.own)
        values |= self.own
        turns = bool(self.read_key(TURNS.path, TURNS, ports["hand"].get("turns")))
        volts = bool(self.read_key(VOLTS.path, VOLTS, ports["hand"].get("volts")))
        if turns and volts:
            self.refuse(ports["hand"]["volts"], VOLTS.path, "turns or volts", "both")
        around = (hand, wall, turns, volts, couplings, inputs, outputs, named)
        drawing = Drawing(self.tick_hz, numbers, frozenset(), blocks, wires, *around)
        return with_whole_numbers(drawing, values)

    def read_wires(
        self, table: Mapping[str, Leaf], plants: Mapping[str, str]
    ) -> tuple[Wires, Wires]:
        """Read the wires, and those of them that act continuously. plants: name and type of each
        one."""
        read = {port: self.read_wire(port, leaf, plants) for port, leaf in table.items()}
        read |= {port: ((), ()) for port in self.optional if port not in read}
        wires = []
        couplings = []
        for port, terms in read.items():
            if terms:
                held_terms, continuous = terms
                wires.append((port, held_terms))
                if continuous:
                    couplings.append((port, continuous))
        return tuple(wires), tuple(couplings)

    def read_numbers(
        self, table: Mapping[str, dict[str, Leaf]]
    ) -> tuple[tuple[tuple[str, str, str], ...], dict[str, float]]:
        numbers = []
        values = {}
        derived = {}
        for name, keys in table.items():
            path = path_of(name)
            first = next(iter(keys.values()))
            place = first.place if "" in keys else first.place.parent()
            self.check_names_of_number(name, keys, place)
            leaf = keys.get("") or keys.get("value")
            words = [self.word(f"{path}.{key}", keys.get(key)) for key in ("unit", "description")]
            if leaf is None or leaf.value == {}:
                self.refuse(place, path, "a number, or { value, unit, description }", "no value")
                continue
            self.leaves[path] = leaf
            if isinstance(leaf.value, str):
                derived[name] = path, leaf
                for key in ("unit", "description"):
                    if key in keys:
                        self.leaves[f"{path}.{key}"] = keys[key]
                continue
            value = self.mistakes.check(Key(path, "number", None, "", ""), leaf)
            if value is not None:
                values[path] = value
                numbers.append((name, words[0], words[1] or f"number {name} of the drawing"))
        self.define(derived)
        constants = scalars(values)
        for name, text in derived.items():
            tree = self.meanings.get(name, ONE)
            if constants.keys() >= set(tree.names) and tree.finite_value(constants) is None:
                self.fault(*text, Fault(tree.offset, "a finite number", NOT_FINITE))
                self.meanings.pop(name)  # so that the mistake is told here alone
        return tuple(numbers), values

    def check_names_of_number(self, name: str, keys: Mapping[str, Leaf], place: Place) -> None:
        """Refuse the name of a number, or of one of its keys, that is none. place: of the
        number."""
        path = path_of(name)
        if name in self.taken:
            self.refuse(place, path, self.free, f"{show(name)}, which one has")
        elif name == PERIOD:
            self.refuse(place, path, f"a name, {NOT_RESERVED}", show(name))
        elif not is_name(name) or name in RESERVED:
            self.refuse(place, path, f"{NAME}, and neither pi nor a function", show(name))
        for key, leaf in keys.items():
            if key:
                self.mistakes.is_known(key, NUMBER_PARTS, leaf, f"{path}.{key}")

    def read_blocks(self, tables: Tables) -> tuple[DrawnBlock, ...]:
        """Read the blocks, and what wires can read and have to feed."""
        read = {name: self.read_block(name, keys) for name, keys in tables["block"].items()}
        blocks = tuple(block for block in read.values() if block is not None)
        if not read:
            self.refuse(self.leaf("block"), "block", "at least one block, [block.NAME]", "none")
        self.inputs = []
        self.signals = {*self.outside}
        springs = {}
        for block, ports in self.ports.items():
            if not ports:
                continue
            inputs, outputs = ports
            self.inputs += [f"{block}.{port}" for port in inputs]
            self.signals |= {f"{block}.{port}" for port in outputs}
            kind = tables["block"][block]["type"].value
            if kind == "spring":
                springs[block] = read[block]
            for port, text in TYPES[kind].moments:  # expressions in outputs that are held
                name = f"{block}.{port}"
                self.meanings[name] = parse(text.format(name=block))
                self.extents[name] = self.meanings[name].extent({})
                self.signals.add(name)
        self.optional = ports_at_rest(springs, tables["wire"])
        return blocks

    def read_signals(self, table: Mapping[str, Leaf]) -> None:
        """Read the names of signals, each with the expression that it stands for."""
        texts = {}
        for name, leaf in table.items():
            path = f"signals.{name}"
            self.leaves[path] = leaf
            if name == PERIOD:
                self.refuse(leaf, path, f"a name, {NOT_RESERVED}", show(name))
            elif not is_dotted(name) or name in (*RESERVED, *self.numbers, *self.signals):
                self.refuse(
                    leaf,
                    path,
                    f"{NAME}, and no number, function, output or signal from outside either",
                    show(name),
                )
            elif not isinstance(leaf.value, str):
                self.refuse(leaf, path, "an expression in quotes", show(leaf.value), of_key=False)
            else:
                texts[name] = path, leaf
        self.signals |= table.keys() - {*self.numbers}
        self.define(texts, signals=True)

    def read_named(self, table: Mapping[str, Leaf]) -> tuple[tuple[str, Terms], ...]:
        """Read the terms of the names of signals, which are shown too."""
        meant = [(name, leaf) for name, leaf in table.items() if name in self.meanings]
        return tuple(
            (name, self.terms_of(f"signals.{name}", leaf, self.meanings[name]) or ())
            for name, leaf in meant
        )

    def read_rate(self, table: Mapping[str, Leaf]) -> Tree | None:
        for name, leaf in table.items():
            if name != "tick_hz":
                expected = "tick_hz, the rate that all others divide"
                self.refuse(leaf, f"rates.{name}", expected, "an unknown key", "rates.tick_hz")
        return self.read_key(RATE, TICK_HZ, table.get("tick_hz"))

    def read_wire(
        self, port: str, leaf: Leaf, plants: Mapping[str, str]
    ) -> tuple[Terms, Terms] | None:
        """Read a wire: its terms that are held, and those that act continuously; see `parted`."""
        path = f"wire.{port}"
        block = port.rpartition(".")[0]
        if port not in self.inputs and not self.is_hidden(block):
            text_found = "an output of a block" if port in self.signals else "an unknown port"
            expected = (
                f"one of {', '.join(self.inputs)}"
                if 0 < len(self.inputs) <= 8  # ports that a message lists
                else "an input port of a block"
            )
            self.refuse(leaf, path, expected, text_found, nearest(port, self.inputs))
        within = partial(parted, plant=block, plants=plants if block in plants else {})
        with self.in_period(self.periods.get(block, ONE)):
            return self.read_terms(path, leaf, within)

    def refuse_two_meanings(
        self, tables: Tables, plants: Mapping[str, str], values: Mapping[str, float]
    ) -> None:
        """Refuse names of [signals] of which a part acts continuously in the wire of one plant,
        or as one factor of a product, and is held in another or as a term of a sum."""
        if self.mistakes or not tables["signals"]:
            return
        texts = {name: parse(leaf.value) for name, leaf in tables["signals"].items()}
        built_in = {name: tree for name, tree in self.meanings.items() if name not in texts}
        constants = {name: value or 1.0 for name, value in scalars(values).items()}

        def expanded(tree: Tree, otherwise: Mapping[str, Tree]) -> Tree:
            """The tree with the meanings of names, or with others in their places."""
            meanings = dict(otherwise)
            for name in tree.names:
                if name in texts and name not in otherwise:
                    meanings[name] = expanded(texts[name], otherwise)
            return tree.with_trees(meanings).with_trees(built_in).remembered(self.signals)[0]

        into_plants = _wires_into(plants, tables)
        of_plants = self._outputs_of(plants)
        for name, text in texts.items():
            meant = expanded(text, {})
            read = of_plants & dict(meant.linear(self.signals)).keys()
            first: dict[str, tuple[float, str]] = {}  # of each signal, and the port
            for port, tree in into_plants.items():
                without = expanded(tree, {name: Tree.number(0.0)})
                for times in (meant, Tree("*", (ONE, meant))):
                    full = expanded(tree, {name: times})
                    shares = self._shares(port, (full, without), plants, constants)
                    for signal in read & shares.keys():
                        share = shares[signal]
                        share_before, port_before = first.setdefault(signal, (share, port))
                        # Wires of one that acts continuously differ by less through rounding.
                        if abs(share - share_before) > 1e-9:
                            ports = {share: port, share_before: port_before}
                            self._refuse_meanings(tables, name, ports)
                            return

    def _outputs_of(self, blocks: Iterable[str]) -> set[str]:
        """The signals that blocks give."""
        signals: set[str] = set()
        for name in blocks:
            _, outputs = self.ports[name] or ((), ())
            signals.update(f"{name}.{port}" for port in outputs)
        return signals

    def _refuse_meanings(self, tables: Tables, name: str, ports: Mapping[float, str]) -> None:
        """Refuse a name of which more is held in one port than in another. ports: by the share of
        a signal in it that acts continuously."""
        held_port = ports[min(ports)]
        continuous = ports[max(ports)]
        as_in = continuous if held_port != continuous else "a product"
        expected = (
            f"{name} as in {as_in}, where it acts continuously, or the output of a hold in both"
        )
        text_found = f"{name} held over a tick"
        self.refuse(
            tables["wire"][held_port], f"wire.{held_port}", expected, text_found, of_key=False
        )

    def _shares(
        self,
        port: str,
        trees: tuple[Tree, Tree],
        plants: Mapping[str, str],
        constants: Mapping[str, float],
    ) -> dict[str, float]:
        """The share of each signal that acts continuously in a wire, as far as a name adds it
        there; none if it cannot be told.

        trees: of the wire with the name and without it. constants: numbers by name.
        """
        block = port.rpartition(".")[0]
        constants = {**constants, PERIOD: 1.0}
        gains: dict[str, list[float]] = {}  # of the held part and the continuous one
        with suppress(Fault):  # without the name, the rest may be no spring
            for sign, tree in zip((1.0, -1.0), trees, strict=True):
                for part, terms in enumerate(parted(tree, self.signals, block, plants)):
                    for signal, gain in terms:
                        of_signal = gains.setdefault(signal, [0.0, 0.0])
                        of_signal[part] += sign * (gain.finite_value(constants) or 0.0)
            shares = {}
            for signal, (held_gain, continuous) in gains.items():
                size = abs(held_gain) + abs(continuous)
                if size > 0:
                    shares[signal] = abs(continuous) / size
            return shares
        return {}

    def refuse_loose_ends(self, tables: Tables) -> None:
        """Refuse inputs without a wire, and numbers and names of signals that no expression
        reads."""
        for port in self.inputs:
            if port not in tables["wire"] and port not in self.optional:
                expected = f'a wire to this input, "{port}" = "..." in [wire]'
                block = self.leaf(f"block.{port.rpartition('.')[0]}")
                self.refuse(block, f"block.{port}", expected, "none (0 leaves it at rest)")
        if self.mistakes:  # one may be why a number is not read
            return
        paths = {name: path_of(name) for name in self.numbers}
        paths |= {name: f"signals.{name}" for name in tables["signals"] if is_name(name)}
        for name, path in paths.items():
            if name not in self.read:
                kind = "number" if name in self.numbers else "signal"
                expected = f"a {kind} that an expression reads"
                self.refuse(self.leaf(path), path, expected, "one that nothing reads")


def _wires_into(blocks: Collection[str], tables: Tables) -> dict[str, Tree]:
    """The texts of the wires into ports of blocks, parsed, by port."""
    wires = {}
    for port, leaf in tables["wire"].items():
        if port.rpartition(".")[0] in blocks and isinstance(leaf.value, str):
            wires[port] = parse(leaf.value)
    return wires
