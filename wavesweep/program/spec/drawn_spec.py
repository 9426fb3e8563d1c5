"""What a spec has beside a drawn loop: the names of its tables, and what these ask of the
drawing."""

from collections.abc import Iterable, Mapping

from wavesweep.engine.drawing import TABLES, Surroundings
from wavesweep.engine.keys import Leaf, Mistakes, Path, nearest
from wavesweep.program.columns import FREE, TAKEN
from wavesweep.program.reading.sorting import names_in_list, normal_path
from wavesweep.program.reading.tables import section_of, study_tables, tables
from wavesweep.program.spec.shipped_classes import shipped_classes


def beside_drawing(leaves: Mapping[Path, Leaf]) -> Surroundings:
    """Return what the other tables of a spec ask of its drawing."""
    signals = ("bode.to", *(path for table in tables().values() for path in table.signals))
    outputs = {}
    for asking in signals:
        leaf = leaves.get(tuple(asking.split(".")))
        if leaf is not None:
            outputs |= dict.fromkeys(names_in_list(leaf), leaf)
    return Surroundings(own_axes(leaves), outputs, tuple(shipped_classes()), TAKEN, FREE)


def with_corrected_names(leaves: Mapping[Path, Leaf], mistakes: Mistakes) -> dict[Path, Leaf]:
    """Return the leaves of tables that a drawn loop has, and add a mistake for each other table.

    An unknown table stands for the missing one whose name is nearest, so that what needs its
    entries brings no mistakes.
    """
    tables = ("type", *TABLES, *study_tables())
    tops = dict.fromkeys(path[0] for path in leaves)
    meant = {}
    expected = f"one of the tables {', '.join(tables)}"
    numbers = _names_under("numbers", leaves)
    for (name, *rest), leaf in leaves.items():
        if name in tables or name in meant:
            continue
        place = leaf.place.under((name,))
        near = nearest(name, tables)
        alone = not rest and leaf.value != {} and numbers
        meant[name] = near if near not in tops else ""
        if name == "controller":
            meant[name] = ""
            mistakes.refuse(place, name, "either a controller or blocks", "both")
        elif alone:  # of --set, which gives numbers by name
            or_number = f"{', '.join(numbers)} of [numbers], or {expected}"
            mistakes.refuse(
                place, name, or_number, "an unknown name", near or nearest(name, numbers)
            )
        else:
            blocks = _names_under("block", leaves)
            hint = f"block.{name}" if name in blocks else near
            mistakes.refuse(place, name, expected, "an unknown table", hint)
    # return the leaves with new names of their tables; a table whose new name is empty is left out
    named = {path: (meant.get(path[0], path[0]), *path[1:]) for path in leaves}
    return {
        path if path[0] == new[0] else normal_path(new): leaves[path]
        for path, new in named.items()
        if new[0]
    }


def _names_under(table: str, leaves: Iterable[Path]) -> list[str]:
    """The names in a table, in the order of the spec."""
    return list(dict.fromkeys(path[1] for path in leaves if path[0] == table and len(path) > 1))


def own_axes(leaves: Mapping[Path, Leaf]) -> frozenset[str]:
    """Return the paths of the keys of blocks that tables take for axes."""
    blocks = {
        path[1] for path in leaves if path[0] == "block" and len(path) > 1
    }  # those of a class have two names
    named = [path[len(section) :] for path in leaves if (section := section_of(path))]
    axis_leaf = leaves.get(("sweep", "along"))
    if axis_leaf and isinstance(axis_leaf.value, str):
        named.append(tuple(axis_leaf.value.split(".")))
    return frozenset(
        ".".join(names[: 3 + (".".join(names[1:3]) in blocks)])
        for names in named
        if len(names) > 2 and names[0] == "block"
    )
