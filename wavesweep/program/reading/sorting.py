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
    return tuple(names) if all(isinstance(name, str) for name in names) else ()


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
    result = Sorted()
    for path, leaf in leaves.items():
        section = section_of(path)
        result.leaves[".".join(path)] = leaf
        if section == path:
            if leaf.value != {}:
                mistakes.refuse(leaf, ".".join(path), "a table", show(leaf.value), of_key=False)
        elif section:
            _sort_section(section, path[len(section) :], leaf, result, mistakes, names)
        elif names is BUILT_IN or path[0] in study_tables():
            _sort_key(path, leaf, result, mistakes)
    return result


def _sort_key(path: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes) -> None:
    """Put a leaf under its key."""
    table_of_path = tables().get(path[0])
    for length in range(1, len(path) + 1):
        name = _join(path[:length])
        rest = path[length:]
        leaf_here = Leaf({}, leaf.place.under(path[:length])) if rest else leaf
        if table_of_path and name in table_of_path.spans:
            return _add_part(result, path[0], path[1], rest, leaf, mistakes)
        if table_of_path and name in table_of_path.named:
            result.keys[".".join(path)] = leaf
            return None
        if name in flat_keys():
            result.keys[name] = leaf_here
            return None
        if name not in TABLES and not (table_of_path and name == table_of_path.path):
            break
    else:
        return (
            None
            if leaf.value == {}
            else mistakes.refuse(leaf, name, "a table", show(leaf.value), of_key=False)
        )
    return _refuse_unknown_key(path[:length], leaf_here, mistakes)


def _refuse_unknown_key(path: Path, leaf: Leaf, mistakes: Mistakes) -> None:
    """Add the mistake of a key or table that is unknown, with the names that it could have been."""
    table_of_path = tables().get(path[0])
    table = _join(path[:-1])
    names_known = top_tables()
    if table:
        inside = (*(table_of_path.sections if table_of_path else ()), *flat_keys())
        inside = (name.removeprefix(f"{table}.") for name in inside if name.startswith(f"{table}."))
        names_known = tuple(dict.fromkeys(name.split(".")[0] for name in inside))
    near = nearest(path[-1], names_known)
    near = f"{table}.{near}" if table and near else near or nearest(path[-1], flat_keys())
    problem = "an unknown table" if isinstance(leaf.value, dict) else "an unknown key"
    expected = f"one of {'' if table else 'the tables '}{', '.join(names_known)}"
    mistakes.refuse(leaf, _join(path), expected, problem, near)


def _sort_section(
    path: Path, rest: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes, names: Names
) -> None:
    """Put a leaf of a section under its key, or with the parts of its axis. path: of the
    section; rest: the leaf's in it."""
    table = ".".join(path)
    section = sections()[path]
    first = rest[0]
    rest_of_path = ".".join(rest)
    if section.takes and section.takes(rest, leaf, result, names):
        return
    if _is_key(table, first, section, names):
        alone = f"{table}.{first}" in tables() or len(rest) == 1
        key = f"{table}.{rest_of_path if alone else first}"
        place = leaf.place
        result.keys[key] = leaf if alone else Leaf({}, place.under(place.path[: 1 - len(rest)]))
        return
    for length in range(1, len(rest) + 1):
        name = ".".join(rest[:length])
        if names.find(name) or (table == "bode" and name == "frequency_hz"):
            _add_part(result, table, name, rest[length:], leaf, mistakes, section)
            return
    _refuse_unknown_axis(path, rest, leaf, mistakes, names)


def _is_key(table: str, name: str, section: Section, names: Names) -> bool:
    """Whether a name in a section is that of a key: a number of a drawn loop may have the same
    name, and comes first."""
    if table == "bode" and names is BUILT_IN:
        return False
    return name in section.own and (name == "along" or not names.find(name))


def _refuse_unknown_axis(
    path: Path, rest: Path, leaf: Leaf, mistakes: Mistakes, names: Names
) -> None:
    """Add the mistake of an axis that is unknown, with the names that it could have been; path,
    rest: as in `_sort_section`."""
    table = ".".join(path)
    is_part = len(rest) > 1 and any(
        rest[-1] in a_section.parts for a_section in sections().values()
    )
    name = ".".join(rest[:-1] if is_part else rest)
    if any(mistake.key == f"{table}.{name}" for mistake in mistakes):
        return  # start and stop are of one axis
    keys_known = ("frequency_hz",) if table == "bode" else sections()[path].own
    any_path = f"the path of a {'numeric key' if names is BUILT_IN else 'number in a block'}"
    numbers = (
        f"one of {', '.join(names.symbols)} or {any_path}" if names.symbols else f"or {any_path}"
    )
    expected = ", ".join((*keys_known, numbers))
    problem = "a number that follows from others" if name in names.following else "an unknown axis"
    near = nearest(name, (*keys_known, *names.symbols)) or nearest(name, names.numeric)
    mistakes.refuse(leaf, f"{table}.{name}", expected, problem, near)


def _add_part(
    result: Sorted,
    table: str,
    name: str,
    rest: Path,
    leaf: Leaf,
    mistakes: Mistakes,
    section: Section = SPAN,
) -> None:
    """Put a leaf with the parts of its axis."""
    axis_part = ".".join(rest)
    if axis_part:
        mistakes.is_known(axis_part, section.parts, leaf, f"{table}.{name}.{axis_part}")
    result.axes[table][name][axis_part] = leaf


def _join(path: Path) -> str:
    """Join a path, with quotes around every name that TOML would quote, so that a name with dots
    is no known path."""
    return ".".join(
        name if name.replace("-", "_").isidentifier() and name.isascii() else show(name)
        for name in path
    )
