"""Reading the tables of a drawn loop: every mistake of a spec at once, each at its place."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from types import MappingProxyType

from wavesweep.errors import Mistake
from wavesweep.spec.block_types import COLUMNS, EVERY, PHASE, TICK_HZ, TYPES
from wavesweep.spec.checking import Rejected, check, expectation, nearest, show
from wavesweep.spec.drawing import RATE, Drawing, DrawnBlock, decides
from wavesweep.spec.expressions import RESERVED, Fault, Terms, Tree, linear, names_in, parse, unknown
from wavesweep.spec.keys import Key
from wavesweep.spec.reading import Leaf, Place

TABLES = ("rates", "numbers", "block", "wire", "ports")
NUMBER_PARTS = ("value", "unit", "description")
PORTS = MappingProxyType({"hand": ("force", "displacement", "reaction"), "wall": ("stiffness", "damping")})
OPTIONAL = ("reaction",)
LISTED = 8  # ports that a message lists

Path = tuple[str, ...]


def read_drawing(
    leaves: Mapping[Path, Leaf], source: Place
) -> tuple[Drawing | None, dict[str, float], dict[str, Leaf], list[Mistake]]:
    """Return the drawing, the values of its numbers, its leaves by path, and all mistakes; None if there are any.

    leaves: those of the whole spec, of which the studies are left to others. source: place of the spec.
    """
    reader = _Reader(source)
    tables = reader.grouped(leaves)
    drawing, values = reader.drawing(tables)
    for path, expected, found in drawing.faults(values):
        leaf = reader.leaf(path)
        text = f"{show(leaf.value)}: {found}" if isinstance(leaf.value, str) else found
        reader.mistakes.append(leaf.mistake(path, expected, text))
    return (None if reader.mistakes else drawing), values, reader.leaves, reader.mistakes


class _Reader:
    """One reading of a drawn spec, which collects the mistakes and the numbers that are read."""

    def __init__(self, source: Place) -> None:
        self.source = source
        self.mistakes: list[Mistake] = []
        self.leaves: dict[str, Leaf] = {}
        self.read: set[str] = set()  # names in trees
        self.numbers: tuple[str, ...] = ()

    def leaf(self, path: str) -> Leaf:
        return self.leaves.get(path) or Leaf(None, self.source.under(tuple(path.split("."))))

    def refuse(self, leaf: Leaf, key: str, expected: str, found: str, suggestion: str = "", of_key: bool = True) -> None:
        self.mistakes.append(leaf.mistake(key, expected, found, suggestion, of_key))

    def grouped(self, leaves: Mapping[Path, Leaf]) -> dict[str, dict]:
        """Sort the leaves into tables; a table that a drawn loop does not have is one mistake."""
        tables: dict[str, dict] = {name: {} for name in TABLES}
        unknown_tables: dict[str, Leaf] = {}
        for path, leaf in leaves.items():
            table, rest = path[0], path[1:]
            if table in ("sweep", "bode"):
                continue
            if table not in TABLES:
                unknown_tables.setdefault(table, Leaf({}, leaf.place.under(path[:1])))
            elif not rest:
                if leaf.value != {}:
                    self.refuse(leaf, table, "a table", show(leaf.value), of_key=False)
            elif table in ("rates", "wire"):
                tables[table][".".join(rest)] = leaf
            else:
                parts = tables[table].setdefault(rest[0], {})
                part = rest[1] if len(rest) > 1 else ""
                parts[part] = leaf if len(rest) < 3 else Leaf({}, leaf.place.under(path[:3]))
        for table, leaf in unknown_tables.items():
            if table == "controller":
                self.refuse(leaf, table, "either a controller or blocks", "both")
            else:
                known = (*TABLES, "sweep", "bode")
                self.refuse(leaf, table, "one of the tables " + ", ".join(known), "an unknown table", nearest(table, known))
        return tables

    def drawing(self, tables: Mapping[str, dict]) -> tuple[Drawing, dict[str, float]]:
        """Read every table; parts that have mistakes are left out."""
        self.numbers = tuple(tables["numbers"])
        force = tables["ports"].get("hand", {}).get("force")
        self.force = force.value if force else None
        numbers, values = self.read_numbers(tables["numbers"])
        tick = self.read_rate(tables["rates"], values)
        found = {name: self.read_block(name, keys) for name, keys in tables["block"].items()}
        self.broken = {name for name, block in found.items() if block is None}
        blocks = tuple(block for block in found.values() if block is not None)
        if not found:
            self.refuse(self.leaf("block"), "block", "at least one block, [block.NAME]", "none")
        self.inputs = [f"{block.name}.{port}" for block in blocks for port in block.ports[0]]
        self.signals = {f"{block.name}.{port}" for block in blocks for port in block.ports[1]}
        self.signals |= {self.force} if isinstance(self.force, str) else set()
        wires = tuple(
            (port, terms) for port, leaf in tables["wire"].items() if (terms := self.read_wire(port, leaf)) is not None
        )
        hand, wall = self.read_ports(tables["ports"])
        self.unconnected(tables["wire"])
        self.unread()
        tick = tick or ("name", RATE, 0)
        drawing = Drawing(tick, numbers, frozenset(), blocks, wires, hand, wall)
        deciding = {name for path, tree in drawing.trees() if decides(path) for name, _ in names_in(tree)}
        whole = frozenset(name for name in deciding if values.get(f"numbers.{name}", 0.5).is_integer())
        values |= {f"numbers.{name}": int(values[f"numbers.{name}"]) for name in whole}
        return dataclasses.replace(drawing, whole=whole), values

    def read_numbers(self, table: Mapping[str, dict[str, Leaf]]) -> tuple[tuple, dict[str, float]]:
        numbers, values = [], {}
        for name, parts in table.items():
            path, first = f"numbers.{name}", next(iter(parts.values()))
            place = Leaf(None, first.place if "" in parts else first.place.parent())
            if not _is_name(name) or name in RESERVED or name in COLUMNS or name in ("along", "frequency_hz"):
                expected = "a name of letters, digits and _ that is neither pi nor sqrt nor the name of a column"
                self.refuse(place, path, expected, show(name))
            for part, leaf in parts.items():
                if part and part not in NUMBER_PARTS:
                    self.refuse(
                        leaf,
                        f"{path}.{part}",
                        "one of " + ", ".join(NUMBER_PARTS),
                        "an unknown key",
                        nearest(part, NUMBER_PARTS),
                    )
            leaf = parts.get("") or parts.get("value")
            words = [self.word(f"{path}.{part}", parts.get(part)) for part in ("unit", "description")]
            if leaf is None or leaf.value == {}:
                self.refuse(place, path, "a number, or { value, unit, description }", "no value")
                continue
            try:
                value = check(Key(path, "number", None, "", ""), leaf.value)
            except Rejected as error:
                self.mistakes.append(leaf.mistake(path, error.expected, error.found))
                continue
            values[path] = value
            self.leaves[path] = leaf
            numbers.append((name, words[0], words[1] or f"number {name} of the drawing"))
        return tuple(numbers), values

    def word(self, path: str, leaf: Leaf | None) -> str:
        if leaf is None or isinstance(leaf.value, str):
            return leaf.value if leaf else ""
        self.refuse(leaf, path, "a string", show(leaf.value), of_key=False)
        return ""

    def read_rate(self, table: Mapping[str, Leaf], values: dict[str, float]) -> Tree | None:
        for name, leaf in table.items():
            if name != "tick_hz":
                self.refuse(
                    leaf, f"rates.{name}", "tick_hz, the rate that all others divide", "an unknown key", "rates.tick_hz"
                )
        leaf = table.get("tick_hz")
        if leaf is None:
            self.refuse(self.leaf(RATE), RATE, expectation(TICK_HZ), "nothing (it has no default)")
            return None
        tree = self.read_number(RATE, TICK_HZ, leaf)
        if tree is not None and tree[0] == "number":
            values[RATE] = tree[1]
            return ("name", RATE, 0)
        return tree

    def read_number(self, path: str, key: Key, leaf: Leaf) -> Tree | None:
        """Read a number or an expression in numbers."""
        self.leaves[path] = leaf
        if isinstance(leaf.value, str):
            return self.read_text(path, leaf)
        try:
            return ("number", float(check(key, leaf.value)), 0)
        except Rejected as error:
            self.mistakes.append(
                leaf.mistake(path, error.expected.replace("number", "number, or an expression,", 1), error.found)
            )
            return None

    def read_text(self, path: str, leaf: Leaf, signals: bool = False) -> Tree | None:
        """Parse an expression and check its names."""
        try:
            tree = parse(leaf.value)
        except Fault as fault:
            self.fault(path, leaf, fault)
            self.read.update(re.findall(r"\w+", leaf.value))
            return None
        self.read.update(name for name, _ in names_in(tree))
        known = {*self.numbers, *(self.signals if signals else ())}
        expected = "the output of a block, the hand's force or a number" if signals else "the name of a number in [numbers]"
        faults = [f for f in unknown(tree, known, expected) if not (signals and self.is_broken(leaf.value[f.offset :]))]
        for fault in faults:
            self.fault(path, leaf, fault)
        return None if faults else tree

    def is_broken(self, text: str) -> bool:
        """Whether a text begins with a port of a block that has a mistake itself."""
        return text.partition(".")[0] in self.broken

    def fault(self, path: str, leaf: Leaf, fault: Fault) -> None:
        self.mistakes.append(Mistake(leaf.place.inside(fault.offset), path, fault.expected, fault.found, fault.suggestion))

    def read_block(self, name: str, given: Mapping[str, Leaf]) -> DrawnBlock | None:
        path, before = f"block.{name}", len(self.mistakes)
        if "" in given and given[""].value != {}:
            self.refuse(given[""], path, "a table", show(given[""].value), of_key=False)
            return None
        if not _is_name(name):
            first = next(iter(given.values()))
            self.refuse(Leaf(None, first.place.parent()), path, "a name of letters, digits and _", show(name))
            return None
        kind = self.read_type(path, given.get("type"))
        if kind is None:  # its numbers are not known to be unread
            self.read.update(re.findall(r"\w+", " ".join(str(leaf.value) for leaf in given.values())))
            return None
        keys = {**TYPES[kind].keys, "every": EVERY, "phase": PHASE}
        for key, leaf in given.items():
            if key not in keys and key not in ("", "type"):
                known = ("type", *keys)
                self.refuse(leaf, f"{path}.{key}", "one of " + ", ".join(known), "an unknown key", nearest(key, known))
        found = {key: self.read_key(f"{path}.{key}", row, given.get(key)) for key, row in keys.items()}
        if len(self.mistakes) > before:
            return None
        every, phase = found.pop("every"), found.pop("phase")
        block = DrawnBlock(name, kind, tuple(found.items()), every, phase)
        wrong = _shape_fault(block)
        if wrong:
            self.refuse(self.leaf(f"{path}.{wrong[0]}"), f"{path}.{wrong[0]}", *wrong[1:], of_key=False)
            return None
        return block

    def read_type(self, path: str, leaf: Leaf | None) -> str | None:
        key = Key(f"{path}.type", "string", None, "", "", choices=tuple(TYPES))
        if leaf is None:
            self.refuse(self.leaf(path), key.path, expectation(key), "nothing (it has no default)")
            return None
        self.leaves[key.path] = leaf
        try:
            return check(key, leaf.value)
        except Rejected as error:
            self.mistakes.append(leaf.mistake(key.path, error.expected, error.found, error.suggestion))
            return None

    def read_key(self, path: str, key: Key, leaf: Leaf | None) -> object:
        if leaf is None:
            return self.default(path, key)
        self.leaves[path] = leaf
        if key.type in ("number", "integer"):
            return self.read_number(path, key, leaf)
        if key.type in ("list", "rows"):
            return self.read_numbers_of(path, key, leaf)
        if key.type != "string":
            return self.read_other(path, key, leaf)
        try:
            return check(key, leaf.value)
        except Rejected as error:
            self.mistakes.append(leaf.mistake(path, error.expected, error.found, error.suggestion))
            return None

    def default(self, path: str, key: Key) -> object:
        if key.required:
            named = {"list": "a list of numbers", "rows": "a list of rows"}.get(key.type) or expectation(key)
            self.refuse(self.leaf(path.rpartition(".")[0]), path, named, "nothing (it has no default)")
        elif key.type in ("number", "integer"):
            return ("number", float(key.default), 0)
        return key.default

    def read_other(self, path: str, key: Key, leaf: Leaf) -> object:
        """Read a boolean, or names of ports."""
        value = leaf.value
        if key.type == "boolean" and isinstance(value, bool):
            return value
        if key.type == "ports" and isinstance(value, list) and all(map(_is_name, value)) and len(set(value)) == len(value):
            return tuple(value)
        expected = "true or false" if key.type == "boolean" else "a list of different names"
        found = ", ".join(map(str, value)) if isinstance(value, list) else show(value)
        self.refuse(leaf, path, expected, found or "none", of_key=False)
        return None

    def read_numbers_of(self, path: str, key: Key, leaf: Leaf) -> tuple | None:
        """Read a list of numbers, or of rows of them."""
        deep = key.type == "rows"
        expected = "a list of rows, each a list of numbers" if deep else "a list of numbers"
        rows = leaf.value if deep else [leaf.value]
        if not isinstance(rows, list) or not all(isinstance(row, list) for row in rows) or (not deep and not rows[0]):
            self.refuse(leaf, path, expected, show(leaf.value), of_key=False)
            return None
        entry = Key(path, "number", None, "", "")
        trees = tuple(
            tuple(self.read_number(_at(path, i, j, deep), entry, Leaf(item, leaf.place)) for j, item in enumerate(row))
            for i, row in enumerate(rows)
        )
        self.leaves[path] = leaf
        return trees if deep else trees[0]

    def read_terms(self, path: str, leaf: Leaf) -> Terms | None:
        """Read an expression that is linear in signals."""
        self.leaves[path] = leaf
        if isinstance(leaf.value, (int, float)) and not isinstance(leaf.value, bool):
            leaf = Leaf(str(leaf.value), leaf.place)
        if not isinstance(leaf.value, str):
            self.refuse(leaf, path, "an expression in quotes", show(leaf.value), of_key=False)
            return None
        tree = self.read_text(path, leaf, signals=True)
        if tree is None:
            return None
        signals = self.signals | {name for name, _ in names_in(tree) if self.is_broken(name)}
        try:
            return linear(tree, signals)
        except Fault as fault:
            self.fault(path, leaf, fault)
            return None

    def read_wire(self, port: str, leaf: Leaf) -> Terms | None:
        path = f"wire.{port}"
        if port not in self.inputs and port.partition(".")[0] not in self.broken:
            found = "an output of a block" if port in self.signals else "an unknown port"
            expected = f"one of {', '.join(self.inputs)}" if len(self.inputs) <= LISTED else "an input port of a block"
            self.refuse(leaf, path, expected, found, nearest(port, self.inputs))
        return self.read_terms(path, leaf)

    def unconnected(self, wires: Mapping[str, Leaf]) -> None:
        for port in self.inputs:
            if port not in wires:
                block = self.leaf(f"block.{port.partition('.')[0]}")
                self.refuse(
                    block, f"block.{port}", f'a wire to this input, "{port}" = "..." in [wire]', "none (0 leaves it at rest)"
                )

    def read_ports(self, table: Mapping[str, dict[str, Leaf]]) -> tuple:
        for name, parts in table.items():
            first = next(iter(parts.values()))
            path = f"ports.{name}"
            if name not in PORTS:
                place = Leaf(None, first.place if "" in parts else first.place.parent())
                self.refuse(place, path, "hand or wall", "an unknown port", nearest(name, PORTS))
                continue
            for part, leaf in parts.items():
                if part not in PORTS[name]:
                    self.refuse(
                        leaf,
                        f"{path}.{part}" if part else path,
                        "{ " + ", ".join(PORTS[name]) + " }",
                        "another key" if part else show(leaf.value),
                        nearest(part, PORTS[name]) if part else "",
                    )
            missing = [part for part in PORTS[name] if part not in parts and part not in OPTIONAL]
            if missing and "" not in parts:
                self.refuse(
                    Leaf(None, first.place.parent()),
                    path,
                    "both " + " and ".join(PORTS[name][:2]),
                    f"no {' and no '.join(missing)}",
                )
        return self.read_hand(table.get("hand", {})), self.read_wall(table.get("wall", {}))

    def read_hand(self, parts: Mapping[str, Leaf]) -> tuple[str, Terms, Terms | None] | None:
        force = parts.get("force")
        if force:
            self.leaves["ports.hand.force"] = force
            if not (isinstance(force.value, str) and _is_name(force.value) and force.value not in RESERVED):
                self.refuse(
                    force,
                    "ports.hand.force",
                    "a name of letters, digits and _ for the hand's force",
                    show(force.value),
                    of_key=False,
                )
            elif force.value in self.numbers:
                self.refuse(force, "ports.hand.force", "a name that is no number", show(force.value), of_key=False)
            elif force.value not in self.read:
                self.refuse(
                    force,
                    "ports.hand.force",
                    "a signal that a wire reads",
                    f"{show(force.value)}, which none reads",
                    of_key=False,
                )
        position, reaction = (
            self.read_terms(f"ports.hand.{part}", parts[part]) if part in parts else None for part in PORTS["hand"][1:]
        )
        return (force.value, position, reaction) if force and position is not None else None

    def read_wall(self, parts: Mapping[str, Leaf]) -> tuple[str, ...] | None:
        found = []
        for part in PORTS["wall"]:
            leaf = parts.get(part)
            if leaf is None:
                continue
            self.leaves[f"ports.wall.{part}"] = leaf
            if leaf.value not in self.numbers:
                hint = nearest(leaf.value, self.numbers) if isinstance(leaf.value, str) else ""
                self.refuse(
                    leaf, f"ports.wall.{part}", "the name of a number in [numbers]", show(leaf.value), hint, of_key=False
                )
            found.append(leaf.value)
        return tuple(found) or None

    def unread(self) -> None:
        """Refuse numbers that no expression reads."""
        for name in self.numbers:
            if name not in self.read:
                self.refuse(
                    self.leaf(f"numbers.{name}"),
                    f"numbers.{name}",
                    "a number that an expression reads",
                    "one that nothing reads",
                )


def _is_name(name: object) -> bool:
    return isinstance(name, str) and name.isidentifier() and name.isascii()


def _at(path: str, i: int, j: int, deep: bool) -> str:
    return f"{path}[{i}][{j}]" if deep else f"{path}[{j}]"


def _shape_fault(block: DrawnBlock) -> tuple[str, str, str] | None:
    """Return key, expected and found text if the matrices or coefficients do not fit together."""
    keys = dict(block.keys)
    if block.type == "tf" and len(keys["num"]) > len(keys["den"]):
        return "num", f"at most {len(keys['den'])} coefficients, as many as den has", f"{len(keys['num'])}"
    if block.type != "ss":
        return None
    n, m, p = len(keys["A"]), len(keys["inputs"]), len(keys["outputs"])
    if not m or not p:
        return ("inputs" if not m else "outputs"), "at least one port", "none"
    for name, height, width in (("A", n, n), ("B", n, m), ("C", p if n else 0, n), ("D", p, m)):
        rows = keys[name]
        if name == "D" and not rows:
            continue
        if len(rows) != height or any(len(row) != width for row in rows):
            widths = ", ".join(dict.fromkeys(str(len(row)) for row in rows)) or "0"
            return (
                name,
                f"{height} rows of {width} numbers (states, inputs, outputs: {n}, {m}, {p})",
                f"{len(rows)} of {widths}",
            )
    return None
