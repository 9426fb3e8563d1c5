"""Assignment of every leaf of the tables to a key or an axis; a leaf that fits none is a mistake."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from wavesweep.errors import Mistake
from wavesweep.spec.checking import nearest, show
from wavesweep.spec.keys import BUILT_IN, KEYS, MEASURED_KEYS, SIMULATE_KEYS, Names
from wavesweep.spec.reading import Leaf, Place

STUDIES = ("sweep", "bode", "for_all")
SPAN_PARTS = ("start", "stop", "num", "scale")
RANGE_PARTS = ("start", "stop", "values", "varying")  # of a number in [for_all]
DEEPEST = 8  # a table this deep belongs to no key, whatever is in it
TABLES = tuple(dict.fromkeys(path.rsplit(".", n)[0] for path in KEYS for n in (2, 1) if path.count(".") >= n))
FLAT = ("simulate", "measured")  # tables of keys, in specs of all kinds
TOP_TABLES = (*dict.fromkeys(path.split(".")[0] for path in KEYS), *STUDIES, *FLAT, "design")
FREQUENCIES = "simulate.frequency_hz"  # the one key of [simulate] that may have parts, as an axis has

Path = tuple[str, ...]


@dataclass(slots=True)
class Sorted:
    """Leaves by the keys and axes that they belong to.

    Keys of the loop, of [simulate] and of [measured] by path, parts of the axes by study and name ("" is a list), and of the
    simulation's frequencies. Those of [design] and of [sweep] require by their paths below it. route: `from` and `to` of
    [bode].
    """

    loop: dict[str, Leaf] = field(default_factory=dict)
    along: Leaf | None = None
    lost: Leaf | None = None
    require: dict[str, Leaf] = field(default_factory=dict)
    route: dict[str, Leaf] = field(default_factory=dict)
    simulate: dict[str, Leaf] = field(default_factory=dict)
    measured: dict[str, Leaf] = field(default_factory=dict)
    frequencies: dict[str, Leaf] = field(default_factory=dict)
    axes: dict[str, dict[str, dict[str, Leaf]]] = field(default_factory=lambda: {study: {} for study in STUDIES})
    design: dict[Path, Leaf] = field(default_factory=dict)
    mistakes: dict[tuple[str, str], Mistake] = field(default_factory=dict)

    def refuse(self, leaf: Leaf, key: str, expected: str, found: str, suggestion: str = "") -> None:
        """Record a mistake about a key, once for any number of leaves under it."""
        # Where a table was expected, the value is at fault; otherwise the name.
        mistake = leaf.mistake(key, expected, found, suggestion, of_key=expected != "a table")
        self.mistakes.setdefault((key, mistake.location), mistake)


def leaves_of(tables: dict, place: Place, prefix: Path = ()) -> Iterator[tuple[Path, Leaf]]:
    """Yield path and leaf of every value that is not a table with something in it."""
    for name, value in tables.items():
        path = (*prefix, name)
        if isinstance(value, dict) and value and len(path) < DEEPEST:
            yield from leaves_of(value, place, path)
        else:
            yield normal_path(path), Leaf(value, place.under(path))


def normal_path(path: Path) -> Path:
    """Return the path of an axis or a wire, which may be written `"device.mass"` or `device.mass`."""
    if path[0] == "design" and len(path) > 2 and path[1] in ("vary", "for_all"):
        return (*path[:2], *(part for name in path[2:] for part in name.split(".")))
    if path[0] not in (*STUDIES, "wire"):
        return path
    return (path[0], *(part for name in path[1:] for part in name.split(".")))


def sort_leaves(leaves: dict[Path, Leaf], names: Names = BUILT_IN) -> Sorted:
    """Return every leaf under the key or axis that it belongs to; of a drawn loop those of the studies only."""
    result = Sorted()
    for path, leaf in leaves.items():
        if path[0] in STUDIES:
            _sort_study(path, leaf, result, names)
        elif path[0] == "design" and len(path) > 1:
            result.design[path[1:]] = leaf
        elif path[0] == "design":
            if leaf.value != {}:
                result.refuse(leaf, "design", "a table", show(leaf.value))
        elif path[:2] == ("simulate", "frequency_hz"):
            _sort_part(FREQUENCIES, path[2:], leaf, result.frequencies, result)
        elif names is BUILT_IN or path[0] in FLAT:
            _sort_key(path, leaf, result)
    return result


def _sort_key(path: Path, leaf: Leaf, result: Sorted) -> None:
    """Put a leaf under its key."""
    tables = ((KEYS, result.loop), (SIMULATE_KEYS, result.simulate), (MEASURED_KEYS, result.measured))
    for length in range(1, len(path) + 1):
        name, here = _join(path[:length]), leaf
        if length < len(path):
            here = Leaf({}, leaf.place.under(path[:length]))
        for keys, found in tables:
            if name in keys:
                found[name] = here
                return
        if name not in TABLES and name not in FLAT:
            _refuse_unknown(path[:length], here, result)
            return
    if leaf.value != {}:
        result.refuse(leaf, _join(path), "a table", show(leaf.value))


def _refuse_unknown(path: Path, leaf: Leaf, result: Sorted) -> None:
    parent, keys = _join(path[:-1]), (*KEYS, *SIMULATE_KEYS, *MEASURED_KEYS)
    known = TOP_TABLES
    if parent:
        start = parent + "."
        inside = (name[len(start) :].split(".")[0] for name in keys if name.startswith(start))
        known = tuple(dict.fromkeys(inside))
    expected = ("one of " if parent else "one of the tables ") + ", ".join(known)
    suggestion = nearest(path[-1], known)
    suggestion = f"{parent}.{suggestion}" if parent and suggestion else suggestion or nearest(path[-1], keys)
    found = "an unknown table" if isinstance(leaf.value, dict) else "an unknown key"
    result.refuse(leaf, _join(path), expected, found, suggestion)


def _sort_study(path: Path, leaf: Leaf, result: Sorted, names: Names) -> None:
    study, parts = path[0], path[1:]
    if not parts:
        if leaf.value != {}:
            result.refuse(leaf, study, "a table", show(leaf.value))
    elif path == ("sweep", "along"):
        result.along = leaf
    elif path == ("for_all", "lost") and not names.find("lost"):
        result.lost = leaf
    elif parts[0] == "require" and study == "sweep" and not names.find("require"):
        result.require[".".join(parts[1:])] = leaf
    elif study == "bode" and parts in (("from",), ("to",)) and names is not BUILT_IN and not names.find(parts[0]):
        result.route[parts[0]] = leaf
    else:
        _sort_axis(study, parts, leaf, result, names)


def _sort_axis(study: str, parts: Path, leaf: Leaf, result: Sorted, names: Names) -> None:
    tables = TABLES if names is BUILT_IN else _tables_of(names)
    for length in range(1, len(parts) + 1):
        name = ".".join(parts[:length])
        if names.find(name) or (study == "bode" and name == "frequency_hz"):
            of_axis = result.axes[study].setdefault(name, {})
            _sort_part(f"{study}.{name}", parts[length:], leaf, of_axis, result)
            return
        if name not in tables:
            break
    else:
        if leaf.value == {}:
            return
    _refuse_axis(study, ".".join(parts[:3]) if parts[0] == "block" else name, leaf, result, names)


def _tables_of(names: Names) -> set[str]:
    """The tables of a drawn loop in which keys are that may be axes."""
    of_numbers = {"numbers", "rates"}
    return of_numbers | {path.rsplit(".", n)[0] for path in names.keys for n in (1, 2, 3) if path.startswith("block.")}


def _sort_part(axis: str, rest: Path, leaf: Leaf, parts: dict[str, Leaf], result: Sorted) -> None:
    part, known = ".".join(rest), RANGE_PARTS if axis.startswith("for_all.") else SPAN_PARTS
    if rest and part not in known:
        suggestion = nearest(part, known)
        result.refuse(leaf, f"{axis}.{part}", "one of " + ", ".join(known), "an unknown key", suggestion)
    parts[part] = leaf


def _refuse_axis(study: str, name: str, leaf: Leaf, result: Sorted, names: Names) -> None:
    own = {"bode": ("frequency_hz",), "sweep": ("along", "require")}.get(study, ("lost",))
    paths = f" or the path of a {'numeric key' if names is BUILT_IN else 'number in a block'}"
    expected = f"{', '.join(own)}, one of {', '.join(names.symbols) or 'no number'}{paths}"
    suggestion = nearest(name, (*own, *names.symbols)) or nearest(name, names.numeric)
    if any(known == f"{study}.{name}" for known, _ in result.mistakes):
        return  # start and stop are of one axis
    found = "a number that follows from others" if name in names.following else "an unknown axis"
    result.refuse(leaf, f"{study}.{name}", expected, found, suggestion)


def _join(path: Path) -> str:
    """Join a path, with quotes around every name that TOML would quote, so that a name with dots is no known path."""
    return ".".join(name if name.replace("-", "_").isidentifier() and name.isascii() else show(name) for name in path)
