"""Reading the tables of a drawn loop: every mistake of a spec at once, each at its place."""

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from types import MappingProxyType

from wavesweep.spec.block_types import COLUMNS, RUN_COLUMNS, TICK_HZ, TYPES
from wavesweep.spec.checking import Mistakes, nearest, show
from wavesweep.spec.continuous import parted, watching_held
from wavesweep.spec.drawing import RATE, Drawing, DrawnBlock, Plant, decides, is_derived, names_of, own_axes, path_of
from wavesweep.spec.drawing_keys import NAME, KeyReader, is_dotted, is_name
from wavesweep.spec.expressions import ONE, RESERVED, Terms, Tree, extent, names_in, parse
from wavesweep.spec.keys import TURNED, Key, Names
from wavesweep.spec.reading import Leaf, Place
from wavesweep.spec.sorting import names_in_list, normal_path

TABLES = ("rates", "numbers", "block", "signals", "wire", "ports")
STUDIES = ("sweep", "bode", "for_all", "simulate", "measured", "design")  # tables that are left to others
KNOWN = ("type", *TABLES, *STUDIES)
TABLE, UNKNOWN = "one of the tables " + ", ".join(KNOWN), "an unknown table"
NUMBER_PARTS = ("value", "unit", "description")
PORTS = MappingProxyType({"hand": ("force", "displacement", "reaction", "turns"), "wall": ("stiffness", "damping")})
OPTIONAL = ("reaction", "turns")
TURNS = Key("ports.hand.turns", "boolean", False, "", "whether force and displacement of the hand are a torque and an angle")
NAMED = MappingProxyType({"inputs": "a signal from outside", "outputs": "an expression linear in signals"})
PORT_PARTS = ("signal", "unit")
NAMED_PARTS = (".signal", ".unit")
LISTED = 8  # ports that a message lists
WITHOUT = " (of a wall without one a number that is 0 and multiplies the velocity in the wall's wire, K*x + B*v)"

Path = tuple[str, ...]


def as_meant(leaves: Mapping[Path, Leaf], mistakes: Mistakes) -> dict[Path, Leaf]:
    """Return the leaves, those of an unknown table under the missing one whose name is nearest, and add the mistakes.

    So its entries, and what needs them, bring no further mistakes.
    """
    given = dict.fromkeys(path[0] for path in leaves)
    meant = {name: near for name in given if name not in KNOWN and (near := nearest(name, KNOWN)) and near not in given}
    for name, near in meant.items():
        place = next(leaf.place for path, leaf in leaves.items() if path[0] == name).under((name,))
        mistakes.refuse(place, name, TABLE, UNKNOWN, near)
    return {normal_path((meant[path[0]], *path[1:])) if path[0] in meant else path: leaf for path, leaf in leaves.items()}


def read_drawing(
    leaves: Mapping[Path, Leaf], source: Place, mistakes: Mistakes
) -> tuple[Drawing | None, dict[str, float], dict[str, Leaf], Names]:
    """Return the drawing, the values of its numbers, its leaves by path, and its names; None if it has mistakes, which it adds.

    leaves: those of the whole spec; tables of studies are skipped. source: place of the spec.
    """
    reader = _TableReader(source, own_axes(leaves) | {RATE})
    tables = reader.grouped(leaves)
    asked = (leaves[path] for path in (("bode", "to"), ("simulate", "show")) if path in leaves)
    reader.asked = {name: leaf for leaf in asked for name in names_in_list(leaf)}
    drawing, values = reader.drawing(tables)
    for path, expected, found in (*drawing.faults(values), *drawing.displaced(values)):
        leaf = reader.leaf(path)
        text = f"{show(leaf.value)}: {found}" if isinstance(leaf.value, str) else found
        reader.mistakes.refuse(leaf, path, expected, text, of_key=False)
    mistakes += reader.mistakes
    following = frozenset(path[1] for path, leaf in leaves.items() if is_derived(path, leaf))
    names = dataclasses.replace(names_of(leaves) if reader.mistakes else drawing.names, following=following)
    return (None if reader.mistakes else drawing), values, reader.leaves, names


class _TableReader(KeyReader):
    """A reading of all tables of a drawn loop."""

    def grouped(self, leaves: Mapping[Path, Leaf]) -> dict[str, dict]:
        """Sort the leaves into tables; a table that a drawn loop does not have is one mistake."""
        tables: dict[str, dict] = {name: {} for name in TABLES}
        unknown_tables: dict[str, Leaf] = {}
        for path, leaf in leaves.items():
            table, rest = path[0], path[1:]
            if table in STUDIES:
                continue
            if table not in TABLES:
                unknown_tables.setdefault(table, Leaf({} if rest else leaf.value, leaf.place.under(path[:1])))
            elif not rest:
                if leaf.value != {}:
                    self.refuse(leaf, table, "a table", show(leaf.value), of_key=False)
            elif table in ("rates", "signals", "wire"):
                tables[table][".".join(rest)] = leaf
            elif table == "ports" and rest[0] in NAMED:
                tables[table].setdefault(rest[0], {})[".".join(rest[1:])] = leaf
            else:
                parts = tables[table].setdefault(rest[0], {})
                part = rest[1] if len(rest) > 1 else ""
                parts[part] = leaf if len(rest) < 3 else Leaf({}, leaf.place.under(path[:3]))
        for table, leaf in unknown_tables.items():
            if table == "controller":
                self.refuse(leaf, table, "either a controller or blocks", "both")
            else:
                near = nearest(table, KNOWN) or nearest(table, tables["numbers"])  # of --set, which gives numbers by name
                number = leaf.value != {} and tables["numbers"]
                expected = f"{', '.join(number)} of [numbers], or {TABLE}" if number else TABLE
                found = "an unknown name" if number else UNKNOWN
                self.refuse(leaf, table, expected, found, f"block.{table}" if table in tables["block"] else near)
        return tables

    def drawing(self, tables: Mapping[str, dict]) -> tuple[Drawing, dict[str, float]]:
        """Read every table; parts that have mistakes are left out."""
        self.numbers = tuple(tables["numbers"])
        force = tables["ports"].get("hand", {}).get("force")
        self.force = force.value if force else None
        given = {side: self.named_ports(side, tables["ports"].pop(side, {})) for side in NAMED}
        outside = [parts["signal"].value for parts in given["inputs"].values()]
        self.outside = {each for each in (self.force, *outside) if isinstance(each, str)}
        numbers, values = self.read_numbers(tables["numbers"])
        self.tick_hz = tick = self.read_rate(tables["rates"]) or ("name", RATE, 0)
        read_blocks = {name: self.read_block(name, keys) for name, keys in tables["block"].items()}
        self.broken = {name for name, block in read_blocks.items() if block is None}
        blocks = tuple(block for block in read_blocks.values() if block is not None)
        if not read_blocks:
            self.refuse(self.leaf("block"), "block", "at least one block, [block.NAME]", "none")
        self.inputs = [f"{block.name}.{port}" for block in blocks for port in block.ports[0]]
        bare = [block.name for block in blocks if block.type == "spring" and dict(block.keys)["d"][:2] == ("number", 0.0)]
        self.optional = [f"{name}.{port}" for name in bare for port in ("v1", "v2")]
        for name in (block.name for block in blocks if block.type == "spring"):  # to the ground
            second = [f"{name}.{port}" for port in ("x2", "v2")]
            self.optional += [] if {*second} & {*tables["wire"]} else second
        self.signals = {f"{block.name}.{port}" for block in blocks for port in block.ports[1]}
        self.signals |= self.outside
        self.define_moments(blocks)
        self.read_signals(tables["signals"])
        plants = {block.name: block.type for block in blocks if block.plant}
        periods = {block.name: ("/", block.every, tick, 0) for block in blocks}
        read = {port: self.read_wire(port, leaf, plants, periods) for port, leaf in tables["wire"].items()}
        read |= {port: ((), ()) for port in self.optional if port not in read}
        wires, couplings = (tuple((port, terms[i]) for port, terms in read.items() if terms) for i in (0, 1))
        hand, wall = self.read_ports(tables["ports"])
        inputs = self.read_inputs(given["inputs"])
        outputs = self.read_outputs(given["outputs"], given["inputs"])
        outputs += tuple(self.read_asked(blocks, tables["wire"], numbers, given))
        named = [(name, self.meanings[name], leaf) for name, leaf in tables["signals"].items() if name in self.meanings]
        named = tuple((name, self.terms_of(f"signals.{name}", leaf, tree) or ()) for name, tree, leaf in named)
        shown = [*(hand or ())[1:], *(terms for _, terms, _ in outputs)]
        registers = self.made_registers(blocks, wires, [*shown, *(terms for _, terms in named)])
        blocks += registers
        wires += tuple((f"{each.name}.u", ((self.registers[f"{each.name}.y"], ONE),)) for each in registers)
        seen = [term for terms in shown for term in terms or ()]
        wires, couplings = watching_held(wires, tuple(each for each in couplings if each[1]), seen)
        self.unconnected(tables["wire"])
        if not self.mistakes:  # a mistake may be why a number is not read
            self.unread(tables["signals"])
        values |= self.own
        turns = bool(self.read_key(TURNS.path, TURNS, tables["ports"].get("hand", {}).get("turns")))
        ports = (hand, wall, turns, couplings, inputs, outputs, named)
        drawing = Drawing(tick, numbers, frozenset(), blocks, wires, *ports)
        deciding = {name for path, tree in drawing.trees() if decides(path) for name, _ in names_in(tree)}
        whole = frozenset(name for name in deciding if float(values.get(path_of(name), 0.5)).is_integer())
        values |= {path_of(name): int(values[path_of(name)]) for name in whole}
        return dataclasses.replace(drawing, whole=whole), values

    def read_numbers(self, table: Mapping[str, dict[str, Leaf]]) -> tuple[tuple, dict[str, float]]:
        numbers, values, derived = [], {}, {}
        for name, parts in table.items():
            path, first = path_of(name), next(iter(parts.values()))
            place = first.place if "" in parts else first.place.parent()
            if name in COLUMNS:
                self.refuse(place, path, *_column("numbers", name))
            elif not is_name(name) or name in RESERVED:
                self.refuse(place, path, f"{NAME}, and neither pi nor a function", show(name))
            for part, leaf in parts.items():
                if part:
                    self.mistakes.is_known(part, NUMBER_PARTS, leaf, f"{path}.{part}")
            leaf = parts.get("") or parts.get("value")
            words = [self.word(f"{path}.{part}", parts.get(part)) for part in ("unit", "description")]
            if leaf is None or leaf.value == {}:
                self.refuse(place, path, "a number, or { value, unit, description }", "no value")
                continue
            self.leaves[path] = leaf
            if isinstance(leaf.value, str):
                derived[name] = path, leaf
                self.leaves |= {f"{path}.{part}": parts[part] for part in ("unit", "description") if part in parts}
                continue
            value = self.mistakes.check(Key(path, "number", None, "", ""), leaf)
            if value is not None:
                values[path] = value
                numbers.append((name, words[0], words[1] or f"number {name} of the drawing"))
        self.define(derived)
        return tuple(numbers), values

    def define_moments(self, blocks: Iterable[DrawnBlock]) -> None:
        """Outputs that are not held stand for expressions in those that are, see `BlockType.moments`."""
        for block in blocks:
            for port, text in TYPES[block.type].moments:
                name = f"{block.name}.{port}"
                self.meanings[name] = parse(text.format(name=block.name))
                self.extents[name] = extent(self.meanings[name], {})
                self.signals.add(name)

    def read_signals(self, table: Mapping[str, Leaf]) -> None:
        """Read the names of signals, each with the expression that it stands for."""
        texts = {}
        for name, leaf in table.items():
            path = f"signals.{name}"
            self.leaves[path] = leaf
            if not is_dotted(name) or name in (*RESERVED, *self.numbers, *self.outside):
                self.refuse(leaf, path, f"{NAME}, and no number, function or signal from outside either", show(name))
            elif not isinstance(leaf.value, str):
                self.refuse(leaf, path, "an expression in quotes", show(leaf.value), of_key=False)
            else:
                texts[name] = path, leaf
        self.signals |= table.keys() - {*self.numbers}
        self.define(texts, signals=True)

    def read_rate(self, table: Mapping[str, Leaf]) -> Tree | None:
        for name, leaf in table.items():
            if name != "tick_hz":
                expected = "tick_hz, the rate that all others divide"
                self.refuse(leaf, f"rates.{name}", expected, "an unknown key", "rates.tick_hz")
        return self.read_key(RATE, TICK_HZ, table.get("tick_hz"))

    def read_wire(
        self, port: str, leaf: Leaf, plants: Mapping[str, str], periods: Mapping[str, Tree]
    ) -> tuple[Terms, Terms] | None:
        """Read a wire: its terms that are held, and those that act continuously; see `parted`."""
        path = f"wire.{port}"
        if port not in self.inputs and port.rpartition(".")[0] not in self.broken:
            terms = "an output of a block" if port in self.signals else "an unknown port"
            expected = f"one of {', '.join(self.inputs)}" if 0 < len(self.inputs) <= LISTED else "an input port of a block"
            self.refuse(leaf, path, expected, terms, nearest(port, self.inputs))
        own = port.rpartition(".")[0]
        self.period = periods.get(own)
        terms = self.read_terms(path, leaf, partial(parted, own=own, plants=plants if own in plants else {}))
        self.period = None
        return terms

    def made_registers(
        self, blocks: Iterable[DrawnBlock], wires: Iterable[tuple[str, Terms]], shown: Iterable[Terms | None]
    ) -> tuple[DrawnBlock, ...]:
        """A delay of a tick for each signal that `prev(...)` reads; of a run, if its block runs with all that read it.

        shown: terms that are read in every tick, in addition to the ports of blocks.
        """
        runs = {block.name: (block.every[:2], block.phase[:2]) for block in blocks}
        registers = []
        for register, signal in self.registers.items():
            source = next((block for block in blocks if block.name == signal.rpartition(".")[0]), None)
            readers = {runs.get(port.rpartition(".")[0]) for port, terms in wires if register in dict(terms)}
            readers |= {None for terms in shown if register in dict(terms or ())}
            every, phase = (source.every, source.phase) if source and readers == {runs[source.name]} else (ONE, Plant.phase)
            registers.append(DrawnBlock(register.rpartition(".")[0], "delay", (("steps", ONE),), every, phase))
        return tuple(registers)

    def unconnected(self, wires: Mapping[str, Leaf]) -> None:
        for port in (*self.inputs, *self.needed):
            if port not in wires and port not in self.optional:
                block, expected = (
                    self.leaf(f"block.{port.rpartition('.')[0]}"),
                    f'a wire to this input, "{port}" = "..." in [wire]',
                )
                self.refuse(block, f"block.{port}", expected, "none (0 leaves it at rest)")

    def read_ports(self, table: Mapping[str, dict[str, Leaf]]) -> tuple:
        """Read the hand and the wall."""
        for name, parts in table.items():
            path, first = f"ports.{name}", next(iter(parts.values()))
            if name not in PORTS:
                place = first.place if "" in parts else first.place.parent()
                self.refuse(place, path, "hand, wall, inputs or outputs", "an unknown port", nearest(name, (*PORTS, *NAMED)))
                continue
            expected = "{ " + ", ".join(PORTS[name]) + " }"
            for part, leaf in parts.items():
                if part:
                    self.mistakes.is_known(part, PORTS[name], leaf, f"{path}.{part}")
                else:
                    self.refuse(leaf, path, expected, show(leaf.value))
            missing = [part for part in PORTS[name] if part not in parts and part not in OPTIONAL]
            if missing and "" not in parts:
                expected = f"both {' and '.join(PORTS[name][:2])}{WITHOUT * (missing == ['damping'])}"
                self.refuse(first.place.parent(), path, expected, f"no {' and no '.join(missing)}")
        return self.read_hand(table.get("hand", {})), self.read_wall(table.get("wall", {}))

    def named_ports(self, side: str, table: Mapping[str, Leaf]) -> dict[str, dict[str, Leaf]]:
        """Sort leaves of inputs or outputs: for each name `signal`, and perhaps `unit`; those without a signal are left out."""
        ports: dict[str, dict[str, Leaf]] = {}
        for key, leaf in table.items():
            name, _, part = key.rpartition(".") if key.endswith(NAMED_PARTS) else key.partition(".")
            path = f"ports.{side}.{name}".rstrip(".")
            if name and not part:
                ports.setdefault(name, {})["signal"] = leaf
            elif part and self.mistakes.is_known(part, PORT_PARTS, leaf, f"{path}.{part}"):
                ports.setdefault(name, {})[part] = leaf
            elif not name and leaf.value != {}:
                self.refuse(leaf, path, f"a table, NAME = {NAMED[side]}", show(leaf.value))
        for name, parts in ports.items():
            path, first = f"ports.{side}.{name}", next(iter(parts.values()))
            self.leaves |= {path if part == "signal" else f"{path}.unit": leaf for part, leaf in parts.items()}
            if name in (*COLUMNS, *RUN_COLUMNS):
                self.refuse(first, path, *_column("ports", name))
            elif not (is_dotted if side == "outputs" else is_name)(name) or name in (*RESERVED, *self.numbers):
                self.refuse(first, path, f"{NAME}, and neither pi nor a function nor a number", show(name))
            if "signal" not in parts:
                self.refuse(first.place.parent(), path, f"a signal, {NAMED[side]}", "none")
        return {name: parts for name, parts in ports.items() if "signal" in parts}

    def read_inputs(self, table: Mapping[str, dict[str, Leaf]]) -> tuple[tuple[str, str, str], ...]:
        """Read name, signal and unit of each input."""
        inputs = []
        for name, parts in table.items():
            path, leaf = f"ports.inputs.{name}", parts["signal"]
            fault = self.fault_from_outside(leaf.value)
            if fault or leaf.value in [signal for _, signal, _ in inputs]:
                self.refuse(leaf, path, *(fault or ("a signal of its own", f"{show(leaf.value)} again")), of_key=False)
            else:
                inputs.append((name, leaf.value, self.word(f"{path}.unit", parts.get("unit"))))
        return tuple(inputs)

    def fault_from_outside(self, signal: object, what: str = "a signal from outside") -> tuple[str, str] | None:
        """Return expected and found text of a value that is not a signal from outside that a wire reads. what: it should be."""
        if not (isinstance(signal, str) and is_name(signal) and signal not in RESERVED):
            return f"{NAME}, for {what}", show(signal)
        if signal in self.numbers:
            return "a name that is no number", show(signal)
        return None if signal in self.read else ("a signal that a wire reads", f"{show(signal)}, which no wire reads")

    def read_outputs(
        self, table: Mapping[str, dict[str, Leaf]], inputs: Mapping[str, object]
    ) -> tuple[tuple[str, Terms, str], ...]:
        """Read name, terms and unit of each output."""
        outputs = []
        for name, parts in table.items():
            path = f"ports.outputs.{name}"
            if name in inputs:
                self.refuse(parts["signal"], path, "another name than that of an input", show(name))
            terms = self.read_terms(path, parts["signal"])
            if terms is not None:
                outputs.append((name, terms, self.word(f"{path}.unit", parts.get("unit"))))
        return tuple(outputs)

    def read_asked(
        self, blocks: Iterable[DrawnBlock], wires: Mapping[str, Leaf], numbers: Iterable[tuple], given: Mapping[str, dict]
    ) -> Iterator[tuple[str, Terms, str]]:
        """Yield an output for each signal that [bode] or [simulate] names and [ports] does not declare; see `Drawing.signals`.

        Its unit is that of a port with the same signal. Names of no signal are left to `unknown_ends`.
        """
        ports = {f"{block.name}.{port}": block for block in blocks for side in block.ports for port in side}
        units = {name: unit for name, unit, _ in numbers}
        declared = (parts for side in NAMED for parts in given[side].values() if "unit" in parts)
        units |= {str(parts["signal"].value): str(parts["unit"].value) for parts in declared}
        for name, leaf in self.asked.items():
            terms, block = None, ports.get(name)
            if name in given["outputs"]:
                continue
            if block and name in wires:
                self.period = ("/", block.every, self.tick_hz, 0)
                terms = self.read_terms(f"wire.{name}", wires[name])
                self.period = None
            elif block and name in self.signals:
                terms = ((name, ONE),)
            elif name in self.meanings and name in self.signals:
                self.read.add(name)
                terms = self.terms_of(f"signals.{name}", leaf, self.meanings[name])
            if terms is not None:
                yield name, terms, units.get(name) or (_unit_of(name, block, units) if block else "")

    def read_hand(self, parts: Mapping[str, Leaf]) -> tuple[str, Terms, Terms | None] | None:
        force = parts.get("force")
        if force:
            self.leaves["ports.hand.force"] = force
            if fault := self.fault_from_outside(force.value, "the hand's force"):
                self.refuse(force, "ports.hand.force", *fault, of_key=False)
        position, reaction = (
            self.read_terms(f"ports.hand.{part}", parts[part]) if part in parts else None for part in PORTS["hand"][1:3]
        )
        return (force.value, position, reaction) if force and isinstance(force.value, str) and position is not None else None

    def read_wall(self, parts: Mapping[str, Leaf]) -> tuple[str, ...] | None:
        numbers = []
        for part, leaf in ((part, parts[part]) for part in PORTS["wall"] if part in parts):
            path, name = f"ports.wall.{part}", leaf.value
            self.leaves[path] = leaf
            if name not in self.numbers or name in self.meanings:
                hint = nearest(name, self.numbers) if isinstance(name, str) else ""
                self.refuse(leaf, path, "the name of a number in [numbers]", show(name), hint, of_key=False)
            elif name in numbers:
                self.refuse(leaf, path, "another number than the stiffness", show(name), of_key=False)
            numbers.append(str(name))
        return tuple(numbers) or None

    def unread(self, signals: Iterable[str]) -> None:
        """Refuse numbers and names of signals that no expression reads."""
        paths = {name: path_of(name) for name in self.numbers} | {name: f"signals.{name}" for name in signals if is_name(name)}
        for name, path in paths.items():
            if name not in self.read:
                kind = "number" if name in self.numbers else "signal"
                self.refuse(self.leaf(path), path, f"a {kind} that an expression reads", "one that nothing reads")


def _unit_of(signal: str, block: DrawnBlock, units: Mapping[str, str]) -> str:
    """Return the unit of a port of a body, empty if it is not known: a `mass` may turn, which the unit of its number shows."""
    mass = dict(block.keys).get("mass", ONE)
    known = "kg*m^2" if block.type == "inertia" else units.get(mass[1]) if mass[0] == "name" else ""
    unit = {"f": "N", "x": "m", "v": "m/s"}.get(signal.rpartition(".")[2], "") if known in ("kg", "kg*m^2") else ""
    return TURNED[unit] if unit and known == "kg*m^2" else unit


def _column(table: str, name: str) -> tuple[str, str]:
    """Return expected and found text of the name of a column."""
    return f"a name that no column of a table has; `wavesweep keys {table}` lists those", f"{show(name)}, which one has"
