"""Every leaf of the tables is put under its key or its axis; a leaf without one is a mistake."""

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

from wavesweep.core.reading.checking import Mistakes, nearest, show
from wavesweep.core.reading.keys import AXIS_KEYS, BUILT_IN, DESIGN_KEYS, KEYS, MEASURED_KEYS, MESSAGES, SIMULATE_KEYS, Names
from wavesweep.core.reading.reading import Leaf, Place

STUDIES = ("sweep", "bode", "for_all")
# Keys in the tables of studies that are no axes, those of [bode] of drawn loops alone.
OWN = {"sweep": ("along", "require"), "bode": ("from", "to"), "for_all": ("lost",)}
RANGE_PARTS = ("start", "stop", "values", "varying")  # of a number in [for_all]
TABLES = tuple(dict.fromkeys(path.rsplit(".", n)[0] for path in KEYS for n in (2, 1) if path.count(".") >= n))
FLAT = ("simulate", "measured", "design")  # tables of keys, in specs of all kinds
FLAT_KEYS = {**KEYS, **SIMULATE_KEYS, **MEASURED_KEYS, **DESIGN_KEYS}
TOP_TABLES = (*dict.fromkeys(path.split(".")[0] for path in KEYS), *STUDIES, *FLAT)
VARIED, FOR_DESIGNS, WISHED, RATIOS, HANDS = SECTIONS = tuple(
    f"design.{name}" for name in ("vary", "for_all", "wish", "for_all ratios", "for_all.hand")
)
FREQUENCIES = "simulate.frequency_hz"  # the one key of [simulate] that may have parts, as an axis has

Path = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Sorted:
    """Leaves by the keys and axes that they belong to.

    keys: by path. axes: parts of the axes by study and name ("" is a list), the simulation's frequencies among them, and the
    wishes, ratios and hands of [design]. design: all leaves of [design] by path.
    """

    keys: dict[str, Leaf] = field(default_factory=dict)
    axes: dict[str, dict[str, dict[str, Leaf]]] = field(default_factory=partial(defaultdict, partial(defaultdict, dict)))
    design: dict[str, Leaf] = field(default_factory=dict)

    def below(self, table: str) -> dict[str, Leaf]:
        """Return the leaves of a table of keys by their names in it; "" is the table itself, if it is no table of keys."""
        inside = {path: leaf for path, leaf in self.keys.items() if path == table or path.startswith(f"{table}.")}
        return {path[len(table) + 1 :]: leaf for path, leaf in inside.items()}


def names_in_list(leaf: Leaf) -> tuple[str, ...]:
    """Return the names of a text or of a list of texts; none of any other value."""
    names = leaf.value if isinstance(leaf.value, list) else [leaf.value]
    return tuple(names) if all(isinstance(name, str) for name in names) else ()


def leaves_of(tables: dict, place: Place, prefix: Path = ()) -> Iterator[tuple[Path, Leaf]]:
    """Yield path and leaf of every value that is not a table with something in it."""
    for name, value in tables.items():
        path = (*prefix, name)
        if isinstance(value, dict) and value:
            yield from leaves_of(value, place, path)
        else:
            yield normal_path(path), Leaf(value, place.under(path))


def normal_path(path: Path) -> Path:
    """Return the path of an axis or a wire, which may be written `"device.mass"` or `device.mass`."""
    if path[0] in (*STUDIES, "wire"):
        tables = 1
    elif path[0] == "design" and path[1:2] in (("vary",), ("for_all",)):
        tables = 2
    else:
        return path
    return (*path[:tables], *(part for name in path[tables:] for part in name.split(".")))


def sort_leaves(leaves: dict[Path, Leaf], mistakes: Mistakes, names: Names = BUILT_IN) -> Sorted:
    """Return every leaf under the key or axis that it belongs to; of a drawn loop those of the studies only."""
    result = Sorted()
    for path, leaf in leaves.items():
        depth = 1 if path[0] in STUDIES else 2 if ".".join(path[:2]) in SECTIONS else 0
        if len(path) == depth:
            if leaf.value != {}:
                mistakes.refuse(leaf, ".".join(path), "a table", show(leaf.value), of_key=False)
        elif depth:
            _sort_study(".".join(path[:depth]), path[depth:], leaf, result, mistakes, names)
        elif names is BUILT_IN or path[0] in FLAT:
            _sort_key(path, leaf, result, mistakes)
        if path[0] == "design":
            result.design[".".join(path)] = leaf
    return result


def _sort_key(path: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes) -> None:
    """Put a leaf under its key."""
    for length in range(1, len(path) + 1):
        name, rest = _join(path[:length]), path[length:]
        here = Leaf({}, leaf.place.under(path[:length])) if rest else leaf
        if name == FREQUENCIES:
            return _add_part(result, "simulate", path[1], rest, leaf, mistakes)
        if name in FLAT_KEYS:
            result.keys[".".join(path) if name == MESSAGES else name] = leaf if name == MESSAGES else here
            return None
        if name not in TABLES and name not in FLAT:
            break
    else:
        return None if leaf.value == {} else mistakes.refuse(leaf, name, "a table", show(leaf.value), of_key=False)
    table, known = _join(path[: length - 1]), TOP_TABLES
    if table:
        inside = (name.removeprefix(f"{table}.") for name in (*SECTIONS[:3], *FLAT_KEYS) if name.startswith(f"{table}."))
        known = tuple(dict.fromkeys(name.split(".")[0] for name in inside))
    near = nearest(path[length - 1], known)
    near = f"{table}.{near}" if table and near else near or nearest(path[length - 1], FLAT_KEYS)
    found = "an unknown table" if isinstance(here.value, dict) else "an unknown key"
    return mistakes.refuse(here, name, f"one of {'' if table else 'the tables '}{', '.join(known)}", found, near)


def _sort_study(table: str, rest: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes, names: Names) -> None:
    """Put a leaf of a study under its key, or with the parts of its axis, wish, ratio or hand. rest: its path in the table."""
    own = () if table == "bode" and names is BUILT_IN else OWN.get(table, ())
    first, whole = rest[0], ".".join(rest)
    if table == WISHED or (table == FOR_DESIGNS and first == "hand"):
        result.axes[WISHED if table == WISHED else HANDS][first][".".join(rest[1:])] = leaf
        return
    if table == FOR_DESIGNS and "/" in whole and all(map(names.find, whole.split("/"))):
        result.axes[RATIOS][whole][""] = leaf
        return
    if first in own and (first == "along" or not names.find(first)):  # a number of a drawn loop may have the name of a key
        alone = first == "require" or len(rest) == 1
        key, place = f"{table}.{whole if alone else first}", leaf.place
        result.keys[key] = leaf if alone else Leaf({}, place.under(place.path[: 1 - len(rest)]))
        return
    for length in range(1, len(rest) + 1):
        name = ".".join(rest[:length])
        if names.find(name) or (table == "bode" and name == "frequency_hz"):
            _add_part(result, table, name, rest[length:], leaf, mistakes)
            return
    name = ".".join(rest[:-1]) if len(rest) > 1 and rest[-1] in (*RANGE_PARTS, *AXIS_KEYS) else whole
    if any(mistake.key == f"{table}.{name}" for mistake in mistakes):
        return  # start and stop are of one axis
    known = ("frequency_hz",) if table == "bode" else OWN.get(table, ())
    paths = f" or the path of a {'numeric key' if names is BUILT_IN else 'number in a block'}"
    expected = ", ".join((*known, f"one of {', '.join(names.symbols) or 'no number'}{paths}"))
    found = "a number that follows from others" if name in names.following else "an unknown axis"
    near = nearest(name, (*known, *names.symbols)) or nearest(name, names.numeric)
    mistakes.refuse(leaf, f"{table}.{name}", expected, found, near)


def _add_part(result: Sorted, table: str, name: str, rest: Path, leaf: Leaf, mistakes: Mistakes) -> None:
    """Put a leaf with the parts of its axis."""
    part = ".".join(rest)
    if part:
        mistakes.is_known(part, RANGE_PARTS if table == "for_all" else AXIS_KEYS, leaf, f"{table}.{name}.{part}")
    result.axes[table][name][part] = leaf


def _join(path: Path) -> str:
    """Join a path, with quotes around every name that TOML would quote, so that a name with dots is no known path."""
    return ".".join(name if name.replace("-", "_").isidentifier() and name.isascii() else show(name) for name in path)
