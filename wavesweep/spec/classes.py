"""Blocks of blocks: a class `[type.NAME]` is drawn once, and each block of that type becomes its blocks, with other names.

In `[block.left] type = "joint"` the block `motor` of the class is `left.motor`, its number `kp` is `left_kp`, and its ports are
signals `left.PORT`, which wires feed and read like those of any block.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from wavesweep.errors import Mistake
from wavesweep.spec.block_types import TYPES
from wavesweep.spec.checking import nearest, show
from wavesweep.spec.reading import Leaf, Place

PARTS = ("numbers", "block", "signals", "wire", "ports")
PORTS = ("inputs", "outputs")
UNKNOWN = "an unknown key"
WORDS = ("type", "inputs", "outputs")  # keys of blocks whose words are no expressions

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Renamed(Place):
    """The place of a text in which names have been changed: offsets in it are no longer those of the file."""

    place: Place

    def location(self, of_key: bool = False) -> str:
        return self.place.location(of_key)

    def under(self, path: tuple[str, ...]) -> Place:
        return self.place.under(path)

    def parent(self) -> Place:
        return self.place.parent()


def expanded(leaves: Mapping[Path, Leaf]) -> tuple[dict[Path, Leaf], list[Mistake]]:
    """Return the leaves with the blocks of its class in place of each block that has one, and the mistakes of both."""
    classes: dict[str, dict[Path, Leaf]] = {}
    for path, leaf in leaves.items():
        if path[0] == "type" and len(path) > 1:
            classes.setdefault(path[1], {})[path[2:]] = leaf
    found = {path: leaf for path, leaf in leaves.items() if path[0] != "type"}
    mistakes, used = [], set()
    if (whole := leaves.get(("type",))) and whole.value != {}:
        mistakes.append(whole.mistake("type", "a table", show(whole.value)))
    for path, leaf in leaves.items():
        if path[0] == "block" and path[2:] == ("type",) and isinstance(leaf.value, str) and leaf.value in classes:
            used.add(leaf.value)
            found = _Instance(path[1], classes[leaf.value], found, mistakes).expanded(leaf)
    for name, parts in classes.items():
        place = Leaf(None, next(iter(parts.values())).place.under(("type", name)))
        if name in TYPES:
            mistakes.append(place.mistake(f"type.{name}", "a name that no type of block has", show(name), of_key=True))
        elif name not in used:
            mistakes.append(place.mistake(f"type.{name}", "a type that a block has", "one that none has", of_key=True))
        mistakes += [
            leaf.mistake(".".join(("type", name, *path)), *fault, of_key=fault[1] == UNKNOWN)
            for path, leaf in parts.items()
            if (fault := _fault(path, leaf.value))
        ]
    return found, mistakes


def _fault(path: Path, value: object) -> tuple[str, str, str] | None:
    """Return expected and found text, and the nearest name, of a leaf that no class has."""
    if not path or path in {(part,) for part in PARTS} or path == ("ports", "outputs"):
        return None if value == {} else ("a table", show(value), "")
    if path == ("ports", "inputs"):
        named = isinstance(value, list) and all(isinstance(each, str) for each in value)
        return None if named else ("a list of names", show(value), "")
    known, part = (PORTS, path[1]) if path[0] == "ports" else (PARTS, path[0])
    return None if part in known else ("one of " + ", ".join(known), UNKNOWN, nearest(part, known))


def numbers_of_blocks(leaves: Mapping[Path, Leaf]) -> dict[str, str]:
    """Return the path at which a block gives each number of its class, by the name that the number has in the block."""
    numbers = [(path[1], path[3]) for path in leaves if path[0] == "type" and path[2:3] == ("numbers",) and len(path) > 3]
    blocks = [(path[1], leaf.value) for path, leaf in leaves.items() if path[0] == "block" and path[2:] == ("type",)]
    return {f"{block}_{name}": f"block.{block}.{name}" for block, kind in blocks for each, name in numbers if each == kind}


class _Instance:
    """One block of a class, which takes its own leaves out of the others and puts those of its blocks in."""

    def __init__(self, name: str, parts: Mapping[Path, Leaf], leaves: dict[Path, Leaf], mistakes: list[Mistake]) -> None:
        self.name, self.parts, self.mistakes = name, parts, mistakes
        self.own = {path[2:]: leaf for path, leaf in leaves.items() if path[:2] == ("block", name)}
        self.rest = {path: leaf for path, leaf in leaves.items() if path[:2] != ("block", name)}
        named = {part: {path[1] for path in parts if path[:1] == (part,) and len(path) > 1} for part in PARTS}
        self.numbers, self.blocks, self.signals = named["numbers"], named["block"], named["signals"]
        inputs = parts.get(("ports", "inputs"))
        self.inputs = inputs.value if inputs and isinstance(inputs.value, list) else []

    def expanded(self, kind: Leaf) -> dict[Path, Leaf]:
        found = {new: each for path, leaf in self.parts.items() for new, each in self.placed(path, leaf)}
        for port in map(str, self.inputs):
            wire = self.rest.pop(("wire", self.name, port), None)
            if wire is None:
                expected = f'a wire to this input, "{self.name}.{port}" = "..." in [wire]'
                self.mistakes.append(kind.mistake(f"block.{self.name}.{port}", expected, "none (0 leaves it at rest)"))
            found["signals", f"{self.name}.{port}"] = wire or Leaf("0", kind.place)
        known = ("type", *sorted(self.numbers), *sorted(self.blocks))
        for path, leaf in self.own.items():
            if path[0] in self.blocks and len(path) > 1:  # a key that the class does not write
                found["block", f"{self.name}.{path[0]}", *path[1:]] = leaf
            elif path != ("type",):
                key, expected = ".".join(("block", self.name, *path)), "one of " + ", ".join(known)
                self.mistakes.append(leaf.mistake(key, expected, UNKNOWN, nearest(path[0], known), of_key=True))
        for path in found.keys() & self.rest.keys():
            expected = f"another name than that of a part of {self.name}"
            self.mistakes.append(self.rest[path].mistake(".".join(path), expected, show(path[1]), of_key=True))
        return self.rest | found

    def placed(self, path: Path, leaf: Leaf) -> Iterator[tuple[Path, Leaf]]:
        """Yield where a leaf of the class stands in this block, and the leaf, or that which the block itself gives for it."""
        table, rest = path[0] if path else "", path[1:]
        if table == "numbers" and rest:
            given = self.own.pop(rest[:1], None) if rest[1:] in ((), ("value",)) else None
            yield ("numbers", f"{self.name}_{rest[0]}", *rest[1:]), given or self.renamed(leaf)
        elif table == "block" and rest:
            given = self.own.pop(rest, None)
            yield ("block", f"{self.name}.{rest[0]}", *rest[1:]), given or (leaf if rest[-1] in WORDS else self.renamed(leaf))
        elif table in ("signals", "wire") and rest:
            yield (table, f"{self.name}.{'.'.join(rest)}"), self.renamed(leaf)
        elif path[:2] == ("ports", "outputs") and len(path) > 2:
            yield ("signals", f"{self.name}.{path[2]}"), self.renamed(leaf)

    def renamed(self, leaf: Leaf) -> Leaf:
        """The leaf with the names of this block in place of those of the class."""
        value = self._renamed(leaf.value)
        return leaf if value == leaf.value else replace(leaf, value=value, place=Renamed(leaf.place))

    def _renamed(self, value):
        if isinstance(value, list):
            return [self._renamed(each) for each in value]
        return re.sub(r"(?<![\w.])[A-Za-z_][\w.]*", self._name, value) if isinstance(value, str) else value

    def _name(self, match):
        name = match[0]
        inside = name.partition(".")[0] in self.blocks or name in self.signals or name in self.inputs
        return f"{self.name}_{name}" if name in self.numbers else f"{self.name}.{name}" if inside else name
