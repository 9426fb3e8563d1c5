"""Blocks of blocks: a class `[type.NAME]` is drawn once, and each block of that type becomes its
blocks, with other names.

In `[block.left] type = "joint"` the block `motor` of the class is `left.motor`, its number `kp` is
`left_kp`, and its ports are signals `left.PORT`, which wires feed and read like those of any block.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.expressions import NOT_RESERVED, PERIOD, RESERVED
from wavesweep.engine._keys.checking import Mistakes, nearest, show
from wavesweep.engine._keys.key import Leaf

PARTS = ("numbers", "block", "signals", "wire", "ports")
PORTS = ("inputs", "outputs")
WORDS = ("type", "inputs", "outputs", "axes")  # keys of blocks that hold names and no expressions

MOST_PLACED = 10_000  # keys of all blocks, with those that classes put in

Path = tuple[str, ...]


def expanded(leaves: Mapping[Path, Leaf], mistakes: Mistakes) -> dict[Path, Leaf]:
    """Return the leaves with the blocks of its class in place of each block that has one; add
    the mistakes of both."""
    classes = _classes(leaves, mistakes)
    placed = {path: leaf for path, leaf in leaves.items() if path[0] != "type"}
    used = set()
    for path, leaf in leaves.items():
        is_type = path[0] == "block" and path[2:] == ("type",)
        if is_type and isinstance(leaf.value, str) and leaf.value in classes:
            used.add(leaf.value)
            placed = _Instance(path[1], classes[leaf.value], placed, mistakes).expanded(leaf)
    for path, leaf in list(placed.items()):
        kind = placed.get((*path[:2], "type"))
        if path[0] == "block" and path[2:] == ("taps",) and kind and kind.value == "delay":
            placed = _in_series(path[1], kind, leaf, placed, mistakes)
    _refuse_classes(classes, used, mistakes)
    return placed


def _classes(leaves: Mapping[Path, Leaf], mistakes: Mistakes) -> dict[str, dict[Path, Leaf]]:
    """Return the leaves of each class by their paths in it."""
    classes: dict[str, dict[Path, Leaf]] = {}
    for path, leaf in leaves.items():
        if path[0] == "type" and len(path) > 1:
            classes.setdefault(path[1], {})[path[2:]] = leaf
        elif path == ("type",) and leaf.value != {}:
            mistakes.refuse(leaf, "type", "a table", show(leaf.value), of_key=False)
    return classes


def _refuse_classes(
    classes: Mapping[str, Mapping[Path, Leaf]], used: set[str], mistakes: Mistakes
) -> None:
    """Add the mistakes of classes by themselves. used: names of those that a block has."""
    for name, leaves in classes.items():
        place = next(iter(leaves.values())).place.under(("type", name))
        if name in TYPES:
            mistakes.refuse(place, f"type.{name}", "a name that no type of block has", show(name))
        elif name not in used:
            mistakes.refuse(
                place, f"type.{name}", "a type that a block has", "one that no block has"
            )
        for path, leaf in leaves.items():
            _refuse_part(f"type.{name}", path, leaf, mistakes)
            named: Sequence[Any] = path[1:2] if path[:1] != ("wire",) else ()
            if path == ("ports", "inputs") and isinstance(leaf.value, list):
                named = leaf.value
            for word in (PERIOD, *RESERVED):
                if word in named:
                    key = ".".join(("type", name, *path))
                    mistakes.refuse(leaf, key, f"a name, {NOT_RESERVED}", show(word), of_key=False)


def _refuse_part(of_class: str, path: Path, leaf: Leaf, mistakes: Mistakes) -> None:
    """Add the mistake of a leaf that no class has. of_class: path of the class; path: in it."""
    key = ".".join((of_class, *path))
    if path == ("ports", "inputs"):
        if not (isinstance(leaf.value, list) and all(isinstance(port, str) for port in leaf.value)):
            mistakes.refuse(leaf, key, "a list of names", show(leaf.value), of_key=False)
    elif not path or path in {(table,) for table in PARTS} or path == ("ports", "outputs"):
        if leaf.value != {}:
            mistakes.refuse(leaf, key, "a table", show(leaf.value), of_key=False)
    elif path[0] == "ports":
        mistakes.is_known(path[1], PORTS, leaf, key)
    else:
        mistakes.is_known(path[0], PARTS, leaf, key)


def numbers_of_blocks(leaves: Mapping[Path, Leaf]) -> dict[str, str]:
    """Return the path at which a block gives each number of its class, by the name that the
    number has in the block."""
    numbers_of_class: dict[str, list[str]] = {}
    for path in leaves:
        if path[0] == "type" and path[2:3] == ("numbers",) and len(path) > 3:
            numbers_of_class.setdefault(path[1], []).append(path[3])
    paths = {}
    for path, leaf in leaves.items():
        if path[0] == "block" and path[2:] == ("type",) and isinstance(leaf.value, str):
            block = path[1]
            for name in numbers_of_class.get(leaf.value, ()):
                paths[f"{block}_{name}"] = f"block.{block}.{name}"
    return paths


def _ascending(runs: list[Any]) -> bool:
    """Whether there are runs, and those that are numbers are in ascending order."""
    numbers = [run for run in runs if isinstance(run, (int, float))]
    return bool(runs) and numbers == sorted(numbers)


def _in_series(
    name: str, kind: Leaf, taps: Leaf, leaves: Mapping[Path, Leaf], mistakes: Mistakes
) -> dict[Path, Leaf]:
    """Return the leaves with delays from tap to tap, tap1, tap2 and so on, in place of a delay
    that has taps."""
    of_block, placed = _parted(leaves, name)
    keys_of_delay = {
        path: leaf for path, leaf in of_block.items() if path not in (("type",), ("taps",))
    }
    runs = taps.value if isinstance(taps.value, list) else []
    place = taps.place
    ascending = _ascending(runs)
    if not ascending:
        expected = "a list of runs of the block in ascending order, such as [2, 5]"
        text_found = ", ".join(map(str, runs)) or show(taps.value)
        mistakes.refuse(taps, f"block.{name}.taps", expected, text_found, of_key=False)
    for key in keys_of_delay.keys() & {("steps",), ("seconds",)}:
        path_of_key = f"block.{name}.{key[0]}"
        text_found = f"taps and {key[0]}"
        leaf = keys_of_delay.pop(key)
        mistakes.refuse(leaf, path_of_key, "either steps, seconds or taps", text_found)
    series: dict[Path, Leaf] = {("ports", "inputs"): Leaf(["u"], place)}
    before = "u"
    last = 0
    for i, run in enumerate(runs, 1):
        tap = f"tap{i}"
        steps = f"({run}) - ({last})" if ascending and i > 1 else run
        keys = keys_of_delay | {("steps",): Leaf(steps, replace(place, exact=False))}
        for path, leaf in keys.items():
            placed["block", name, tap, *path] = leaf
        series["block", tap, "type"] = kind
        series["wire", f"{tap}.u"] = Leaf(before, place)
        series["ports", "outputs", f"y{i}"] = Leaf(f"{tap}.y", place)
        before = f"{tap}.y"
        last = run
    return _Instance(name, series, placed, mistakes).expanded(kind)


def _parted(leaves: Mapping[Path, Leaf], name: str) -> tuple[dict[Path, Leaf], dict[Path, Leaf]]:
    """The leaves of a block by their paths in it, and all others."""
    of_block = {}
    remaining = {}
    for path, leaf in leaves.items():
        if path[:2] == ("block", name):
            of_block[path[2:]] = leaf
        else:
            remaining[path] = leaf
    return of_block, remaining


class _Instance:
    """One block of a class, which takes its own leaves out of the others and puts those of its
    blocks in."""

    def __init__(
        self, name: str, parts: Mapping[Path, Leaf], leaves: dict[Path, Leaf], mistakes: Mistakes
    ) -> None:
        self.name = name
        self.parts = parts
        self.mistakes = mistakes
        self.own, self.rest = _parted(leaves, name)
        named: dict[str, set[str]] = {table: set() for table in PARTS}
        for path in parts:
            if path and path[0] in named:
                named[path[0]].update(path[1:2])
        self.numbers = named["numbers"]
        self.blocks = named["block"]
        self.signals = named["signals"]
        inputs = parts.get(("ports", "inputs"))
        self.inputs = inputs.value if inputs and isinstance(inputs.value, list) else []

    def expanded(self, kind: Leaf) -> dict[Path, Leaf]:
        if len(self.rest) + len(self.parts) > MOST_PLACED:
            expected = f"at most {MOST_PLACED} keys with those of all classes"
            self.mistakes.refuse(kind, f"block.{self.name}.type", expected, "more", of_key=False)
            return self.rest
        placed: dict[Path, Leaf] = {}
        for path, leaf in self.parts.items():
            placed.update(self.placed(path, leaf))
        for port in map(str, self.inputs):
            wire = self.rest.pop(("wire", *self.name.split("."), port), None)
            if wire is None:
                expected = f'a wire to this input, "{self.name}.{port}" = "..." in [wire]'
                text_found = "none (0 leaves it at rest)"
                path_of_port = f"block.{self.name}.{port}"
                self.mistakes.refuse(kind, path_of_port, expected, text_found, of_key=False)
            placed["signals", f"{self.name}.{port}"] = wire or Leaf("0", kind.place)
        keys = ("type", *sorted(self.numbers), *sorted(self.blocks))
        for path, leaf in self.own.items():
            if path[0] in self.blocks and len(path) > 1:  # a key that the class does not write
                placed["block", f"{self.name}.{path[0]}", *path[1:]] = leaf
            elif path != ("type",):
                expected = "one of " + ", ".join(keys)
                near = nearest(path[0], keys)
                path_of_key = ".".join(("block", self.name, *path))
                self.mistakes.refuse(leaf, path_of_key, expected, "an unknown key", near)
        for path in placed.keys() & self.rest.keys():
            expected = f"another name than that of a part of {self.name}"
            self.mistakes.refuse(
                self.rest[path], ".".join(path), expected, show(".".join(path[1:]))
            )
        return self.rest | placed

    def placed(self, path: Path, leaf: Leaf) -> Iterator[tuple[Path, Leaf]]:
        """Yield where a leaf of the class stands in this block, and the leaf, or that which the
        block itself gives for it."""
        if len(path) < 2:
            return
        table, name, *rest = path
        if table == "numbers":
            is_value = rest in ([], ["value"])
            value = self.own.pop((name,), None) if is_value else None
            yield ("numbers", f"{self.name}_{name}", *rest), value or self.renamed(leaf)
        elif table == "block":
            value = self.own.pop(path[1:], None)
            if not value:
                value = leaf if path[-1] in WORDS else self.renamed(leaf)
            yield ("block", f"{self.name}.{name}", *rest), value
        elif table in ("signals", "wire"):
            in_full = ".".join((self.name, name, *rest))
            yield (table, *in_full.split(".")), self.renamed(leaf)
        elif (table, name) == ("ports", "outputs") and rest:
            yield ("signals", f"{self.name}.{rest[0]}"), self.renamed(leaf)

    def renamed(self, leaf: Leaf) -> Leaf:
        """The leaf with the names of this block in place of those of the class."""
        value = self._renamed(leaf.value)
        if value == leaf.value:
            return leaf
        return replace(leaf, value=value, place=replace(leaf.place, exact=False))

    def _renamed(self, value: object) -> object:
        if isinstance(value, list):
            return [self._renamed(item) for item in value]
        if isinstance(value, str):
            return re.sub(r"(?<![\w.])[A-Za-z_][\w.]*", self._name, value)
        return value

    def _name(self, match: re.Match[str]) -> str:
        name: str = match[0]
        if name in self.numbers:
            return f"{self.name}_{name}"
        if name.partition(".")[0] in self.blocks or name in (*self.signals, *self.inputs):
            return f"{self.name}.{name}"
        return name
