"""Reading the keys of blocks and the expressions of wires; all mistakes are collected, each at
its place."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, TypeVar

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import RATE
from wavesweep.engine._drawing.drawn_block import DrawnBlock, keys_of_block
from wavesweep.engine._drawing.expressions import (
    ONE,
    PERIOD,
    Fault,
    Tree,
)
from wavesweep.engine._drawing.mass_matrix import shape_fault
from wavesweep.engine._drawing.parsing import parse
from wavesweep.engine._keys.checking import Mistakes, Rejected, check, expectation, nearest, show
from wavesweep.engine._keys.key import FORMULA, VALUE_WORDS, Key, Leaf, Place
from wavesweep.engine.errors import Mistake

# names of keys for the same thing: each type has one of each group
ALIKE = (("mass", "inertia", "m", "I", "J"), ("stiffness", "k"), ("damping", "d", "c"))
# parts of names of keys with which people limit controllers
LIMITS = ("windup", "limit", "sat", "clamp", "max", "min")
# and of those with which they say how often a block runs
RATES = ("period", "rate", "hz", "sample", "Ts")
NAMES_OF = (
    "the name of a number in [numbers]",
    "the output of a block, a number, or a signal from outside that [ports] names",
)
_Found = TypeVar("_Found")
NAME = "a name of letters, digits and _ that is no value, as nan, inf, none, null, na, true and false are"


class KeyReader:
    """A reading of keys and expressions, which collects the mistakes, the leaves by path, and the
    names that are read.

    axes: paths of keys other than numbers that are axes; those that are written as a number are
    names in trees, and have a value in `own`. numbers: the names in [numbers]. signals: outputs of
    blocks, those from outside and the names in [signals]. meanings, extents: of names that stand
    for expressions, the trees and their extents. ports: inputs and outputs of each block, also of
    one that has mistakes, unless these hide them; None then. registers: the outputs of those that
    `prev(...)` reads, and the signal that each remembers. tick_hz: the rate of the tick. periods:
    of blocks, s. period: what `dt` stands for in the expressions of a block, its own period (s).
    classes: types that a message lists in addition.
    """

    def __init__(self, source: Place, axes: frozenset[str], classes: tuple[str, ...] = ()) -> None:
        self.source = source
        self.classes = classes
        self.taken: frozenset[str] = frozenset()  # see `Surroundings`
        self.free = ""  # likewise
        self.axes = axes
        self.own: dict[str, float | int] = {}
        self.mistakes = Mistakes()
        self.leaves: dict[str, Leaf] = {}
        self.lists: dict[str, Leaf] = {}  # of the hand's axes, as they are given
        self.read: set[str] = set()  # names in trees
        self.numbers: tuple[str, ...] = ()
        self.signals: set[str] = set()
        self.meanings: dict[str, Tree] = {}
        self.extents: dict[str, tuple[int, int]] = {}
        self.ports: dict[str, tuple[tuple[str, ...], tuple[str, ...]] | None] = {}
        self.registers: dict[str, str] = {}
        self.tick_hz: Tree = Tree.name(RATE)
        self.periods: dict[str, Tree] = {}
        self.period: Tree | None = None
        self.refuse = self.mistakes.refuse

    @contextmanager
    def in_period(self, period: Tree) -> Iterator[None]:
        """Read expressions in which `period` is that of a block (s)."""
        self.period = period
        yield
        self.period = None

    def leaf(self, path: str) -> Leaf:
        return self.leaves.get(path) or Leaf(None, self.source.under(tuple(path.split("."))))

    def fault(self, path: str, leaf: Leaf, fault: Fault) -> None:
        """Add the mistake in an expression, at its place in the text."""
        self.mistakes.append(
            Mistake(
                leaf.place.inside(fault.offset), path, fault.expected, fault.found, fault.suggestion
            )
        )

    def word(self, path: str, leaf: Leaf | None) -> str:
        if leaf is None:
            return ""
        if (
            isinstance(leaf.value, str)
            and leaf.value.isprintable()
            and not leaf.value[:-1].startswith(FORMULA)
        ):
            return leaf.value
        expected = "a string that is printable and does not begin with = + - @, which spreadsheets run as formulas"
        return self.refuse(leaf, path, expected, show(leaf.value), of_key=False) or ""

    def read_number(self, path: str, key: Key, leaf: Leaf) -> Tree | None:
        """Read a number or an expression in numbers."""
        self.leaves[path] = leaf
        if isinstance(leaf.value, str):
            return self.read_text(path, leaf)
        try:
            return self.number(path, check(key, leaf.value))  # type: ignore[arg-type]  # no word
        except Rejected as error:
            expected = error.expected.replace("number", "number, or an expression,", 1).rstrip(",")
            if key.unit == "tick" and isinstance(leaf.value, float):
                expected += ", of ticks (a faster rates.tick_hz has a whole number in each period)"
            return self.refuse(leaf, path, expected, error.found, of_key=False)

    def number(self, path: str, value: float) -> Tree:
        """The tree of a key that is a number and no expression."""
        if path not in self.axes:
            return Tree.number(value)
        self.own[path] = value
        return Tree.name(path)

    def read_text(self, path: str, leaf: Leaf, signals: bool = False) -> Tree | None:
        """Return the tree of an expression, with the trees that its names stand for in their
        places."""
        text = str(leaf.value)
        try:
            tree = parse(text)
            tree.check_extent(self.extents)
        except Fault as fault:
            self.read.update(re.findall(r"\w+", text))
            self.fault(path, leaf, fault)
            return None
        self.read.update(tree.names)
        names = {*self.numbers}
        if signals:
            names |= self.signals
        meanings = self.meanings
        if self.period:
            meanings = {**meanings, PERIOD: self.period}
            names.add(PERIOD)
        if unknown := list(self.unknown_names(tree, names, signals)):
            for mistake in unknown:
                self.fault(path, leaf, mistake)
            return None
        tree = tree.with_trees(meanings)
        if not signals:
            try:
                tree.remembered(set())
            except Fault as fault:
                self.fault(path, leaf, fault)
                return None
        return tree

    def unknown_names(self, tree: Tree, names: set[str], signals: bool) -> Iterator[Fault]:
        """Yield the fault of each name in a tree that is not among these names; signals: whether
        they may be signals."""
        for name, offset in tree.places_of_names():
            block = name.rpartition(".")[0]
            if name in names or (signals and self.is_hidden(block)):
                continue
            expected = NAMES_OF[signals]
            choices = sorted(names)
            outputs = [signal for signal in sorted(self.signals) if signal.startswith(f"{block}.")]
            if outputs and block and signals:
                expected = f"an output of {block}: {' or '.join(outputs)}"
                choices = outputs
            yield Fault(offset, expected, f"an unknown name {show(name)}", nearest(name, choices))

    def is_hidden(self, block: str) -> bool:
        """Whether a block has mistakes that hide its ports."""
        return self.ports.get(block, ()) is None

    def signals_of(self, tree: Tree) -> set[str]:
        """The signals, among them those in the tree of blocks whose ports are not known."""
        hidden = {name for name in tree.names if self.is_hidden(name.rpartition(".")[0])}
        return self.signals | hidden

    def _define_name(self, name: str, tree: Tree, text: tuple[str, Leaf], signals: bool) -> bool:
        """Read what one name stands for; False after a mistake in the extents of its expression."""
        try:
            tree.check_extent(self.extents)
        except Fault as fault:
            self.fault(*text, fault)
            return False
        self.extents[name] = tree.extent(self.extents)
        self.meanings[name] = tree.with_trees(self.meanings)
        if signals and self.terms_of(*text, self.meanings[name]) is None:
            del self.meanings[name]  # it is a signal like any other, so that its mistake is one
        return True

    def define(self, texts: Mapping[str, tuple[str, Leaf]], signals: bool = False) -> None:
        """Read what names stand for: expressions that may read each other, but not in a circle.

        texts: path and leaf of each name. signals: whether they are linear in signals; otherwise
        they are numbers.
        """
        undefined: dict[str, Tree] = {}  # of names that stand for nothing yet
        for name, (path, leaf) in texts.items():
            tree = self.read_text(path, leaf, signals)
            if tree is not None:
                undefined[name] = tree
        mistaken: set[str] = set()
        while ready := [
            name for name, tree in undefined.items() if undefined.keys().isdisjoint(tree.names)
        ]:
            for name in ready:
                tree = undefined.pop(name)
                # A mistake is told once, and not again for each name that reads it.
                reads_mistake = not mistaken.isdisjoint(tree.names)
                if reads_mistake or not self._define_name(name, tree, texts[name], signals):
                    mistaken.add(name)
        for name in undefined:  # each reads another one of them
            path, leaf = texts[name]
            expected = "an expression whose names do not stand for each other in a circle"
            self.refuse(leaf, path, expected, show(leaf.value), of_key=False)

    def read_terms(
        self,
        path: str,
        leaf: Leaf,
        within: Callable[[Tree, set[str]], _Found] = Tree.linear,  # type: ignore[assignment]  # it is then Terms
    ) -> _Found | None:
        """Read an expression that is linear in signals. within: makes the result of its tree and
        the signals."""
        self.leaves[path] = leaf
        if isinstance(leaf.value, (int, float)) and not isinstance(leaf.value, bool):
            leaf = Leaf(str(leaf.value), leaf.place)
        if not isinstance(leaf.value, str):
            return self.refuse(
                leaf, path, "an expression in quotes", show(leaf.value), of_key=False
            )
        tree = self.read_text(path, leaf, signals=True)
        return None if tree is None else self.terms_of(path, leaf, tree, within)

    def terms_of(
        self,
        path: str,
        leaf: Leaf,
        tree: Tree,
        within: Callable[[Tree, set[str]], _Found] = Tree.linear,  # type: ignore[assignment]  # it is then Terms
    ) -> _Found | None:
        """Return the terms of a tree, see `read_terms`, with registers in place of `prev(...)`;
        one that is not linear in signals is a mistake."""
        try:
            tree, registers = tree.remembered(self.signals_of(tree))
            self.registers |= registers
            self.signals |= {*registers}
            return within(tree, self.signals_of(tree))
        except Fault as fault:
            self.fault(path, leaf, fault)
            return None

    def read_type(self, name: str, leaves: Mapping[str, Leaf]) -> str | None:
        """Return the type of a block; leaves: of its keys."""
        path = f"block.{name}"
        if "" in leaves and leaves[""].value != {}:
            return self.refuse(leaves[""], path, "a table", show(leaves[""].value), of_key=False)
        if not is_dotted(name):
            return self.refuse(next(iter(leaves.values())).place.parent(), path, NAME, show(name))
        is_type = "type" in leaves and leaves["type"].value in [
            *TYPES
        ]  # otherwise its message lists all
        choices = tuple(TYPES) if is_type else (*TYPES, *self.classes)
        key = Key(f"{path}.type", "string", None, "", "", choices=choices, required=True)
        kind = self.read_key(key.path, key, leaves.get("type"))
        if kind is None:  # which of its numbers are read is not known
            self.read.update(
                re.findall(r"\w+", " ".join(str(leaf.value) for leaf in leaves.values()))
            )
        return kind

    def read_block(self, name: str, leaves: Mapping[str, Leaf]) -> DrawnBlock | None:
        path = f"block.{name}"
        before = len(self.mistakes)
        self.ports[name] = None
        kind = self.read_type(name, leaves)
        if kind is None:
            return None
        keys = keys_of_block(kind)
        leaves = self.with_corrected_names(path, leaves, keys)
        every = self.read_key(f"{path}.every", keys.pop("every"), leaves.get("every"))
        self.periods[name] = (every or ONE) / self.tick_hz
        if kind == "delay" and "seconds" in leaves and "steps" not in leaves:
            del keys["steps"]  # whose default is for a delay of steps
        read = {}
        with self.in_period(self.periods[name]):
            for key, row in keys.items():
                read[key] = self.read_key(f"{path}.{key}", row, leaves.get(key))
        if None not in [read.get(key, "") for key in (TYPES[kind].by, "inputs", "outputs", "axes")]:
            self.ports[name] = TYPES[kind].ports_of(read)
        if len(self.mistakes) > before:
            return None
        return self.made_block(name, kind, every, read)

    def made_block(
        self, name: str, kind: str, every: Tree, read: dict[str, Any]
    ) -> DrawnBlock | None:
        """Return a block of keys without mistakes; that they do not fit together is one. read:
        values of the other keys."""
        phase = read.pop("phase")
        if read.get("inputs") == ():  # nothing comes in: a recursion by itself
            read["B"] = read["B"] or ((),) * len(read["A"])
        keys: dict[str, Any] = {}
        limits: dict[str, Any] = {}
        for key, value in read.items():
            if value is not None:
                (limits if key in TYPES[kind].limits else keys)[key] = value
        limit_items = tuple(limits.items())
        block = DrawnBlock(name, kind, tuple(keys.items()), every, phase, limits=limit_items)
        wrong = _limit_fault(limits) or _shape_fault(block)
        if wrong:
            key, expected, text_found = wrong
            path = f"block.{name}.{key}"
            return self.refuse(self.leaf(path), path, expected, text_found, of_key=False)
        return block

    def with_corrected_names(
        self, path: str, leaves: Mapping[str, Leaf], keys: Mapping[str, Key]
    ) -> dict[str, Leaf]:
        """Return the leaves; an unknown key is a mistake and stands for the key that is meant,
        which then is not missing."""
        choices = "type", *keys
        meant = dict(leaves)
        for key, leaf in leaves.items():
            if key in keys or key in ("", "type"):
                continue
            is_limit = any(word in key for word in LIMITS)
            if is_limit and "high" not in keys:
                near = ""
                text_found = "a limit, which a block of type saturation has"
            else:
                near = _synonym(key, keys) or nearest(key, choices) or "high" * is_limit
                text_found = "an unknown key"
                if not near and any(word in key for word in RATES):
                    text_found = "a rate or a period, which `every` has in ticks of rates.tick_hz"
            self.refuse(leaf, f"{path}.{key}", "one of " + ", ".join(choices), text_found, near)
            meant.setdefault(near, leaf)
        return meant

    def read_key(self, path: str, key: Key, leaf: Leaf | None) -> Any:
        """Read the value of a key by its type: trees of numbers, a word, true or false, or names
        of ports."""
        if leaf is None:
            return self.default_of(path, key)
        self.leaves[path] = leaf
        value = leaf.value
        if key.numeric:
            return self.read_number(path, key, leaf)
        if key.type in ("list", "rows"):
            return self.read_numbers_of(path, leaf, deep=key.type == "rows")
        if key.type != "ports":
            return self.mistakes.check(key, leaf, path)
        if isinstance(value, list) and all(map(is_name, value)) and len(set(value)) == len(value):
            return tuple(value)
        names = ", ".join(map(str, value)) if isinstance(value, list) else show(value)
        return self.refuse(leaf, path, "a list of different names", names or "none", of_key=False)

    def default_of(self, path: str, key: Key) -> Any:
        """Return the default of a key that is not given, as `read_key` does; if there has to be
        one, it is a mistake."""
        if key.required:
            lists = {"list": "a list of numbers", "rows": "a list of rows"}
            expected = lists.get(key.type) or expectation(key)
            block = self.leaf(path.rpartition(".")[0])
            self.refuse(block, path, expected, "nothing (it has no default)")
        if key.numeric and key.default is not None:
            return self.number(path, key.default)  # type: ignore[arg-type]  # no word
        return key.default

    def read_numbers_of(self, path: str, leaf: Leaf, deep: bool) -> tuple[Any, ...] | None:
        """Read a list of numbers, or of rows of them."""
        rows = leaf.value if deep else [leaf.value]
        if (
            not isinstance(rows, list)
            or not all(isinstance(row, list) for row in rows)
            or (not deep and not rows[0])
        ):
            expected = "a list of rows, each a list of numbers" if deep else "a list of numbers"
            return self.refuse(leaf, path, expected, show(leaf.value), of_key=False)
        entry = Key(path, "number", None, "", "")
        trees = []
        for i, row in enumerate(rows):
            place = f"{path}[{i}]" if deep else path
            read = []
            for j, number in enumerate(row):
                read.append(self.read_number(f"{place}[{j}]", entry, replace(leaf, value=number)))
            trees.append(tuple(read))
        self.leaves[path] = leaf
        return tuple(trees) if deep else trees[0]


def is_name(name: object) -> bool:
    """Return whether a value is a name of ASCII letters, digits and _ that no program takes for
    a value."""
    return (
        isinstance(name, str)
        and name.isidentifier()
        and name.isascii()
        and name.lower() not in VALUE_WORDS
    )


def is_dotted(name: str) -> bool:
    """Return whether a name is one, or that of a part of a block, `block.part`."""
    return all(map(is_name, name.split(".")))


def _synonym(key: str, keys: Mapping[str, Key]) -> str:
    """A key that is called so elsewhere; empty if there is none."""
    for names in ALIKE:
        if key in names:
            for name in names:
                if name in keys:
                    return name
    return ""


def _limit_fault(limits: Mapping[str, object]) -> tuple[str, str, str] | None:
    """Return key, expected and found text if the limits of a block and what it does at them do
    not fit together."""
    acts = limits.get("anti_windup", "none")
    need_high = [name for name in ("low", "tracking_s") if name in limits]
    if acts != "none":
        need_high.append("anti_windup")
    if need_high and "high" not in limits:
        return "high", "a number, the upper limit", f"{need_high[0]} without it"
    needs_time = acts == "back-calculation"
    if needs_time == ("tracking_s" in limits):
        return None
    text_found = "no time constant" if needs_time else f"one with anti_windup = {acts!r}"
    return "tracking_s", "a time constant (s) with back-calculation, and none without", text_found


def _shape_fault(block: DrawnBlock) -> tuple[str, str, str] | None:
    """Return key, expected and found text if the matrices or coefficients do not fit together."""
    keys = dict(block.keys)
    if block.type == "tf" and len(keys["num"]) > len(keys["den"]):
        expected = f"no more coefficients than den has ({len(keys['den'])})"
        return "num", expected, f"{len(keys['num'])}"
    if TYPES[block.type].either and len(keys) != 1:
        first, second = TYPES[block.type].either
        return second, f"either {first} or {second}", "both" if keys else "neither"
    if block.type == "mass_matrix":
        return shape_fault(keys)
    return _matrix_fault(keys) if block.type == "ss" else None


def _matrix_fault(keys: Mapping[str, Any]) -> tuple[str, str, str] | None:
    """`_shape_fault` of a state-space model."""
    n = len(keys["A"])
    m = len(keys["inputs"])
    p = len(keys["outputs"])
    if not p:
        return "outputs", "at least one port", "none"
    for name, height, width in (("A", n, n), ("B", n, m), ("C", p if n else 0, n), ("D", p, m)):
        rows = keys[name]
        if (name == "D" or not m) and not rows:
            continue
        if len(rows) != height or any(len(row) != width for row in rows):
            widths = ", ".join(dict.fromkeys(str(len(row)) for row in rows)) or "0"
            expected = f"a matrix of {height} x {width} numbers, in a list of rows (states, inputs, outputs: {n}, {m}, {p})"
            return name, expected, f"{len(rows)} x {widths}"
    return None
