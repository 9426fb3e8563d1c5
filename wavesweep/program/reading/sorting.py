"""Every leaf of the tables is put under its key or its axis; a leaf without one is a mistake."""

from collections import defaultdict
from dataclasses import dataclass, field
from functools import partial

from wavesweep.engine.keys import Leaf, Mistakes, Names, Path, nearest, show, split_names
from wavesweep.program.reading.keys import BUILT_IN, KEYS
from wavesweep.program.reading.tables import (
    Section,
    flat_keys,
    section_of,
    sections,
    study_tables,
    tables,
    top_tables,
)

TABLES = tuple(
    dict.fromkeys(path.rsplit(".", n)[0] for path in KEYS for n in (2, 1) if path.count(".") >= n)
)

GONE = {  # keys that specs had, and what does the same
    "simulate.record": "no file of a force: in Python, loop.simulate(force) takes one",
    "design.for_all": 'what designs hold for in [for_all], as all else does: "operator.damping" = [0, 5] for '
    "hand = { damping = [0, 5] }; a ratio of numbers is an expression of a drawn loop",
}

SPAN = Section()  # of a key that may be given as an axis is


@dataclass(frozen=True, slots=True)
class Sorted:
    """Leaves by the keys and axes that they belong to.

    keys: by path. axes: parts of the axes by table and name ("" is a list), spans of keys among
    them, and what sections put elsewhere. leaves: all of them by path.
    """

    keys: dict[str, Leaf] = field(default_factory=dict)
    axes: dict[str, dict[str, dict[str, Leaf]]] = field(
        default_factory=partial(defaultdict, partial(defaultdict, dict))
    )
    leaves: dict[str, Leaf] = field(default_factory=dict)

    def below(self, table: str) -> dict[str, Leaf]:
        """Return the leaves of a table of keys by their names in it; "" is the table itself, if
        it is no table of keys."""
        inside = {
            path: leaf
            for path, leaf in self.keys.items()
            if path == table or path.startswith(f"{table}.")
        }
        return {path[len(table) + 1 :]: leaf for path, leaf in inside.items()}


def names_in_list(leaf: Leaf) -> tuple[str, ...]:
    """Return the names of a text or of a list of texts; none of any other value."""
    names = leaf.value if isinstance(leaf.value, list) else [leaf.value]
    if all(isinstance(name, str) for name in names):
        return tuple(names)
    return ()


def normal_path(path: Path) -> Path:
    """Return the path of an axis or a wire, which may be written `"device.mass"` or
    `device.mass`."""
    section = section_of(path) or (path[:1] if path[0] == "wire" else ())
    if not section or (section in sections() and not sections()[section].dotted):
        return path
    return split_names(path, len(section))


def sort_leaves(leaves: dict[Path, Leaf], mistakes: Mistakes, names: Names = BUILT_IN) -> Sorted:
    """Return every leaf under the key or axis that it belongs to; of a drawn loop those of the
    studies only."""
    sorter = _Sorter(names, mistakes)
    for path, leaf in leaves.items():
        sorter.put(path, leaf)
    return sorter.result


@dataclass(frozen=True, slots=True)
class _Sorter:
    """What puts leaves under their keys and axes. names: of the loop's keys."""

    names: Names
    mistakes: Mistakes
    result: Sorted = field(default_factory=Sorted)

    def put(self, path: Path, leaf: Leaf) -> None:
        """Put a leaf under the key or axis that it belongs to, or add its mistake."""
        section = section_of(path)
        self.result.leaves[".".join(path)] = leaf
        if section == path:
            self._refuse_filled(leaf, ".".join(path))
        elif section:
            self._put_in_section(section, path[len(section) :], leaf)
        elif self.names is BUILT_IN or path[0] in study_tables():
            self._put_under_key(path, leaf)

    def _refuse_filled(self, leaf: Leaf, name: str) -> None:
        """Add the mistake of a value where a table is expected; an empty table is none."""
        if leaf.value != {}:
            self.mistakes.refuse(leaf, name, "a table", show(leaf.value), of_key=False)

    def _put_under_key(self, path: Path, leaf: Leaf) -> None:
        """Put a leaf under its key."""
        table = tables().get(path[0])
        for length in range(1, len(path) + 1):
            name = joined_path(path[:length])
            rest = path[length:]
            leaf_here = Leaf({}, leaf.place.under(path[:length])) if rest else leaf
            if table and name in table.spans:
                self._put_part(path[0], path[1], rest, leaf, SPAN)
                return
            if table and name in table.named:
                self.result.keys[".".join(path)] = leaf
                return
            if name in flat_keys():
                self.result.keys[name] = leaf_here
                return
            if name not in TABLES and not (table and name == table.path):
                self._refuse_unknown_key(path[:length], leaf_here)
                return
        self._refuse_filled(leaf, name)

    def _refuse_unknown_key(self, path: Path, leaf: Leaf) -> None:
        """Add the mistake of a key or table that is unknown, with the names that it could have
        been."""
        outer = tables().get(path[0])
        table = joined_path(path[:-1])
        names = top_tables()
        if table:
            paths = (*(outer.sections if outer else ()), *flat_keys())
            inside = [
                known_path.removeprefix(f"{table}.")
                for known_path in paths
                if known_path.startswith(f"{table}.")
            ]
            names = tuple(dict.fromkeys(name.split(".")[0] for name in inside))
        near = nearest(path[-1], names)
        if table and near:
            near = f"{table}.{near}"
        near = near or nearest(path[-1], flat_keys())
        if isinstance(leaf.value, dict):
            problem = "an unknown table"
        else:
            problem = "an unknown key"
        name = joined_path(path)
        usual = f"one of {'' if table else 'the tables '}{', '.join(names)}"
        self.mistakes.refuse(
            leaf, name, GONE.get(name, usual), problem, "" if name in GONE else near
        )

    def _put_in_section(self, path: Path, rest: Path, leaf: Leaf) -> None:
        """Put a leaf of a section under its key, or with the parts of its axis. path: of the
        section; rest: the leaf's in it."""
        table = ".".join(path)
        section = sections()[path]
        if section.takes and section.takes(rest, leaf, self.result, self.names):
            return
        if self._is_key(table, rest[0], section):
            self._put_under_key_of_section(table, rest, leaf)
            return
        for length in range(len(rest), 0, -1):  # `numbers` may be a number's name too
            name = ".".join(rest[:length])
            if self.names.find(name) or (table == "bode" and name == "frequency_hz"):
                self._put_part(table, name, rest[length:], leaf, section)
                return
        self._refuse_unknown_axis(path, rest, leaf)

    def _is_key(self, table: str, name: str, section: Section) -> bool:
        """Whether a name in a section is that of a key: a number of a drawn loop may have the
        same name, and comes first."""
        if table == "bode" and self.names is BUILT_IN:
            return False
        return name in section.own and (name == "along" or not self.names.find(name))

    def _put_under_key_of_section(self, table: str, rest: Path, leaf: Leaf) -> None:
        """Put a leaf under its key in a section, which may be a table of keys by itself; of any
        other key that is given as a table, the table."""
        first = f"{table}.{rest[0]}"
        if first in tables() or len(rest) == 1:
            self.result.keys[f"{table}.{'.'.join(rest)}"] = leaf
        else:
            place = leaf.place
            self.result.keys[first] = Leaf({}, place.under(place.path[: 1 - len(rest)]))

    def _refuse_unknown_axis(self, path: Path, rest: Path, leaf: Leaf) -> None:
        """Add the mistake of an axis that is unknown, with the names that it could have been;
        path, rest: as in `_put_in_section`."""
        table = ".".join(path)
        names = self.names
        parts = {part for section in sections().values() for part in section.parts}
        is_part = len(rest) > 1 and rest[-1] in parts
        name = ".".join(rest[:-1] if is_part else rest)
        if any(mistake.key == f"{table}.{name}" for mistake in self.mistakes):
            return  # start and stop are of one axis
        axis_names = ("frequency_hz",) if table == "bode" else sections()[path].own
        numbers = f"the path of a {'numeric key' if names is BUILT_IN else 'number in a block'}"
        symbols = f"one of {', '.join(names.symbols)} " if names.symbols else ""
        expected = ", ".join((*axis_names, f"{symbols}or {numbers}"))
        problem = "an unknown axis"
        if name in names.following:
            problem = "a number that follows from others"
        near = nearest(name, (*axis_names, *names.symbols)) or nearest(name, names.numeric)
        self.mistakes.refuse(leaf, f"{table}.{name}", expected, problem, near)

    def _put_part(self, table: str, name: str, rest: Path, leaf: Leaf, section: Section) -> None:
        """Put a leaf with the parts of its axis."""
        part = ".".join(rest)
        parts = self.result.axes[table][name]
        if part:
            self.mistakes.is_known(part, section.parts, leaf, f"{table}.{name}.{part}")
        if parts and ("" in parts or not part):  # both as "device.mass" and as device.mass
            self.mistakes.refuse(leaf, f"{table}.{name}", "each key once", "the same key again")
        parts[part] = leaf


def joined_path(path: Path) -> str:
    """Join a path, with quotes around every name that TOML would quote, so that a name with dots
    is no known path."""
    return ".".join(
        name if name.replace("-", "_").isidentifier() and name.isascii() else show(name)
        for name in path
    )
