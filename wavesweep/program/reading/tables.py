"""The tables of a spec that belong to capabilities: each says in its module `keys`, as `TABLE`,
what the core has to know."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import Any

from wavesweep.capabilities import TABLES, modules
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, Leaf, Mistakes, leaves_of, show
from wavesweep.program.reading.keys import AXIS_KEYS, KEYS, STUDY_KEYS, HapticDevice


class TableValue:
    """The value of a table. What a class does not say itself is so by default.

    files: that it names, relative to the spec's folder. given: paths of keys that a device could
    have given. hardware: what it gives of the numbers of a device that are not of the loop, by the
    last names of `HARDWARE_KEYS`. members: the name of a table that answers can hold for, beside
    the spec's own numbers. changing: axes of numbers that may change in every frame.
    """

    __slots__ = ()
    files: tuple[str, ...] = ()
    given: Collection[str] = ()
    hardware: Mapping[str, Any] = MappingProxyType({})
    members: str = ""
    changing: Collection[Any] = ()

    def on(self, device: HapticDevice | None) -> TableValue:
        """Return the value with the numbers of a device, except for those that are given
        themselves."""
        del device
        return self

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        raise NotImplementedError

    def refuse_stability_alone(self, name: str, what: str) -> None:
        """Raise UsageError if the table asks for more than stability, which is all that `what`
        is about. name: of the spec."""


class KeyValues(dict[str, Any], TableValue):
    """The values of keys by their names in the table; empty without the table."""

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        return nested(self)


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by names of keys as nested tables: those of `gain.from` and `gain.to` are in
    the table `gain`."""
    root: dict[str, Any] = {}
    for name, value in values.items():
        *parents, last = name.split(".")
        table = root
        for parent in parents:
            table = table.setdefault(parent, {})
        table[last] = list(value) if isinstance(value, tuple) else value
    return root


def several(leaves: Mapping[str, Leaf]) -> Iterator[Mapping[str, Leaf]]:
    """Yield the leaves of a table by their names in it, or of each table of a list of them."""
    itself = leaves.get("")
    listed = itself.value if itself and isinstance(itself.value, list) else []
    if not (listed and all(isinstance(table, dict) for table in listed)):
        yield leaves
        return
    for table in listed:
        leaves_of_table = {
            ".".join(path): Leaf(leaf.value, itself.place)
            for path, leaf in leaves_of(table, itself.place)
        }
        yield leaves_of_table or {"": itself}


@dataclass(frozen=True, slots=True)
class Section:
    """A table with axes by the names of numbers. own: keys beside the axes. parts: of an axis that
    is given as a table.

    takes: a function that puts a leaf elsewhere, and says whether it did; see `sort_leaves`.
    dotted: whether names may be written `"device.mass"` or `device.mass`.
    """

    own: tuple[str, ...] = ()
    parts: Collection[str] = tuple(AXIS_KEYS)
    takes: Callable[..., bool] | None = None
    dotted: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecTable:
    """A table of a spec.

    path: of the table, "design" or, in a table that holds axes, "sweep.require". keys: by path.
    build: from a `Request` to the value, adding all mistakes; None if the spec does not have the
    table; the values of its keys by default. sections: it itself or tables in it, which have axes. spans: keys that may be given as a
    span. named: keys that are tables with names of the user's own. signals: keys that name signals
    of a drawn loop. always: whether the table is part of every request; otherwise `demand` raises
    the mistakes that keep it from being part of one, see `Spec.asking`. starts: whether `init`
    shows its keys. described: its tables with names of the user's own, see `describing.named`.
    hint: a line about them. schema: from `schema.Shapes` to its JSON Schema, that of its keys by
    default. members: whether it has numbers for all of which answers can hold.
    """

    path: str
    keys: Mapping[str, Key] = field(default_factory=dict)
    build: Callable[[Any], TableValue | None] | None = None
    sections: Mapping[str, Section] = field(default_factory=dict)
    spans: tuple[str, ...] = ()
    named: tuple[str, ...] = ()
    signals: tuple[str, ...] = ()
    always: bool = False
    demand: Callable[[Any], None] | None = None
    starts: bool = False
    described: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    hint: str = ""
    schema: Callable[[Any], dict] | None = None
    members: bool = False

    @property
    def name(self) -> str:
        """The last name of its path, by which `Spec.asked` has its value."""
        return self.path.rpartition(".")[2]

    @property
    def keys_in_it(self) -> dict[str, Key]:
        """Its keys by their names in it."""
        return {path.removeprefix(f"{self.path}."): key for path, key in self.keys.items()}

    def value(self, request: Any) -> TableValue | None:
        """Return the value that a `Request` asks for, and add all mistakes."""
        if self.build:
            return self.build(request)
        return KeyValues(self.read(request.belongs.below(self.path), request.mistakes))

    def read(self, leaves: Mapping[str, Leaf], mistakes: Mistakes) -> dict[str, Any]:
        """Return the values of its keys, and add their mistakes. leaves: by their names in it."""
        named = dict(leaves)
        for name, leaf in leaves.items():
            inside = [key for key in self.keys_in_it if not name or key.startswith(f"{name}.")]
            if inside:  # a table, which has leaves of its own unless it is empty or no table
                del named[name]
                path = f"{self.path}.{name}" if name else self.path
                text_found = "an empty table" if leaf.value == {} else show(leaf.value)
                expected = f"a table with some of {', '.join(inside)}"
                mistakes.refuse(leaf, path, expected, text_found, of_key=False)
        return mistakes.read(self.keys_in_it, named, self.path)


@cache
def tables() -> Mapping[str, SpecTable]:
    """Return the tables of the capabilities that there are by path, in the order in which messages
    list them.

    One in a table of another capability is there if that is.
    """
    installed = {module.TABLE.path: module.TABLE for module in modules("keys")}
    holders = {"", "sweep", *installed}
    there = [path for path in installed if path.rpartition(".")[0] in holders]
    return {path: installed[path] for path in (*TABLES, *there) if path in there}


def missing() -> dict[str, str]:
    """Return the capabilities that are not installed by the paths of their tables."""
    return {path: capability for path, capability in TABLES.items() if path not in tables()}


def table_at(path: str) -> SpecTable:
    """Return the table of that path. Errors: UsageError that names its capability, if this is
    not installed."""
    if path not in tables():
        raise UsageError(
            f"[{path}]: expected a table of what is installed, found one of the capability {TABLES[path]}, which is not"
        )
    return tables()[path]


@cache
def top_tables() -> tuple[str, ...]:
    """Return the tables that the spec of a controller may have."""
    return (*dict.fromkeys(path.split(".")[0] for path in KEYS), *study_tables())


@cache
def study_tables() -> tuple[str, ...]:
    """Return the tables that any spec may have, a controller's or a drawn loop's."""
    return ("sweep", "bode", *(path for path in tables() if "." not in path))


@cache
def study_keys() -> Mapping[str, Key]:
    """Return the keys of these tables by path, which cannot be axes."""
    return STUDY_KEYS | _keys(tables().values())


@cache
def flat_keys() -> Mapping[str, Key]:
    """Return the keys of the loop, and those of tables of keys that any spec may have, by path."""
    return {**KEYS, **_keys(table for table in tables().values() if "." not in table.path)}


def _keys(some: Iterable[SpecTable]) -> dict[str, Key]:
    return {path: key for table in some for path, key in table.keys.items()}


@cache
def sections() -> Mapping[tuple[str, ...], Section]:
    """Return the tables with axes by path; [bode] of a drawn loop alone has keys beside the
    frequencies.

    Tables of capabilities in one of these are keys of it.
    """
    sections_by_path = {("sweep",): Section(("along",)), ("bode",): Section(("from", "to"))}
    for table in tables().values():
        sections_by_path |= {
            tuple(path.split(".")): section for path, section in table.sections.items()
        }
    for path in tables():
        parent, _, name = path.rpartition(".")
        if (parent,) in sections_by_path:
            section = sections_by_path[parent,]
            sections_by_path[parent,] = replace(section, own=(*section.own, name))
    return sections_by_path


def section_of(path: tuple[str, ...]) -> tuple[str, ...]:
    """Return the path of the section that a path is in, or is; empty if it is in none."""
    return next((path[:depth] for depth in (1, 2) if path[:depth] in sections()), ())
