"""Every leaf of the tables is put under its key or its axis; a leaf without one is a mistake."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

from wavesweep.spec.checking import Mistakes, nearest, show
from wavesweep.spec.keys import AXIS_KEYS, BUILT_IN, DESIGN_KEYS, KEYS, MEASURED_KEYS, MESSAGES, SIMULATE_KEYS, Names
from wavesweep.spec.reading import Leaf, Place

STUDIES = ("sweep", "bode", "for_all")
# Keys in the tables of studies that are no axes. A number of a drawn loop may have the last name of some of them.
OF_STUDIES = ("sweep.along", "sweep.require", "bode.from", "bode.to", "for_all.lost")
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
        table = path[0]
        if table in (*STUDIES, "design") and len(path) == 1:
            if leaf.value != {}:
                mistakes.refuse(leaf, table, "a table", show(leaf.value), of_key=False)
        elif table in STUDIES:
            _sort_study(path, leaf, result, mistakes, names)
        elif ".".join(path[:2]) in SECTIONS:
            result.design[".".join(path)] = leaf
            _sort_section(path, leaf, result, mistakes, names)
        elif path[:2] == ("simulate", "frequency_hz"):
            _sort_part(FREQUENCIES, path[2:], leaf, result.axes["simulate"]["frequency_hz"], mistakes)
        elif names is BUILT_IN or table in FLAT:
            _sort_key(path, leaf, result, mistakes)
            if table == "design":
                result.design[".".join(path)] = leaf
    return result


def _sort_key(path: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes) -> None:
    """Put a leaf under its key."""
    for length in range(1, len(path) + 1):
        name, here = _join(path[:length]), leaf
        if length < len(path):
            here = Leaf({}, leaf.place.under(path[:length]))
        if name in FLAT_KEYS:
            result.keys[name if name != MESSAGES else ".".join(path)] = here if name != MESSAGES else leaf
            return
        if name not in TABLES and name not in FLAT:
            _refuse_unknown(path[:length], here, mistakes)
            return
    if leaf.value != {}:
        mistakes.refuse(leaf, _join(path), "a table", show(leaf.value), of_key=False)


def _refuse_unknown(path: Path, leaf: Leaf, mistakes: Mistakes) -> None:
    parent = _join(path[:-1])
    known = TOP_TABLES
    if parent:
        start = parent + "."
        names = (name[len(start) :] for name in (*SECTIONS[:3], *FLAT_KEYS) if name.startswith(start))
        known = tuple(dict.fromkeys(name.split(".")[0] for name in names))
    expected = ("one of " if parent else "one of the tables ") + ", ".join(known)
    suggestion = nearest(path[-1], known)
    suggestion = f"{parent}.{suggestion}" if parent and suggestion else suggestion or nearest(path[-1], FLAT_KEYS)
    found = "an unknown table" if isinstance(leaf.value, dict) else "an unknown key"
    mistakes.refuse(leaf, _join(path), expected, found, suggestion)


def _sort_study(path: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes, names: Names) -> None:
    """Put a leaf of [sweep], [bode] or [for_all] under its key, or with the parts of its axis."""
    study, *parts = path
    key = ".".join(path[:2])
    drawn = not key.startswith("bode.") or names is not BUILT_IN
    if key in OF_STUDIES and drawn and (key == "sweep.along" or not names.find(parts[0])):
        if len(parts) == 1 or key == "sweep.require":
            result.keys[".".join(path)] = leaf
        else:
            result.keys[key] = Leaf({}, leaf.place.under(path[:2]))
        return
    _sort_axis(study, parts, leaf, result, mistakes, names)


def _sort_section(path: Path, leaf: Leaf, result: Sorted, mistakes: Mistakes, names: Names) -> None:
    """Put a leaf of [design.vary], [design.wish] or [design.for_all] with the parts of its axis, wish, ratio or hand."""
    section, name, part = ".".join(path[:2]), ".".join(path[2:]), ".".join(path[3:])
    if not name:
        if leaf.value != {}:
            mistakes.refuse(leaf, section, "a table", show(leaf.value))
    elif section == WISHED:
        result.axes[WISHED][path[2]][part] = leaf
    elif section == FOR_DESIGNS and path[2] == "hand":
        result.axes[HANDS]["hand"][part] = leaf
    elif section == FOR_DESIGNS and "/" in name and all(map(names.find, name.split("/"))):
        result.axes[RATIOS][name][""] = leaf
    else:
        _sort_axis(section, path[2:], leaf, result, mistakes, names)


def _sort_axis(study: str, parts: Sequence[str], leaf: Leaf, result: Sorted, mistakes: Mistakes, names: Names) -> None:
    """Put a leaf with the parts of its axis. parts: of its path in the table of the study."""
    of_blocks = (path for path in names.keys if path.startswith("block."))
    own = {"numbers", "rates"} | {path.rsplit(".", n)[0] for path in of_blocks for n in (1, 2, 3)}
    tables = TABLES if names is BUILT_IN else own
    for length in range(1, len(parts) + 1):
        name = ".".join(parts[:length])
        if names.find(name) or (study == "bode" and name == "frequency_hz"):
            _sort_part(f"{study}.{name}", parts[length:], leaf, result.axes[study][name], mistakes)
            return
        if name not in tables:
            break
    else:
        if leaf.value == {}:
            return
    _refuse_axis(study, ".".join(parts[:3]) if parts[0] == "block" else name, leaf, mistakes, names)


def _sort_part(axis: str, rest: Path, leaf: Leaf, parts: dict[str, Leaf], mistakes: Mistakes) -> None:
    part = ".".join(rest)
    if rest:
        mistakes.is_known(part, RANGE_PARTS if axis.startswith("for_all.") else AXIS_KEYS, leaf, f"{axis}.{part}")
    parts[part] = leaf


def _refuse_axis(study: str, name: str, leaf: Leaf, mistakes: Mistakes, names: Names) -> None:
    if any(mistake.key == f"{study}.{name}" for mistake in mistakes):
        return  # start and stop are of one axis
    own = {"bode": ("frequency_hz",), "sweep": ("along", "require"), "for_all": ("lost",)}.get(study, ())
    paths = f" or the path of a {'numeric key' if names is BUILT_IN else 'number in a block'}"
    expected = ", ".join((*own, f"one of {', '.join(names.symbols) or 'no number'}{paths}"))
    suggestion = nearest(name, (*own, *names.symbols)) or nearest(name, names.numeric)
    found = "a number that follows from others" if name in names.following else "an unknown axis"
    mistakes.refuse(leaf, f"{study}.{name}", expected, found, suggestion)


def _join(path: Path) -> str:
    """Join a path, with quotes around every name that TOML would quote, so that a name with dots is no known path."""
    return ".".join(name if name.replace("-", "_").isidentifier() and name.isascii() else show(name) for name in path)
