"""Loading: from a path or nested tables, and overrides, to a `Spec`."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from functools import lru_cache
from itertools import islice

from wavesweep.engine.drawing import RATE, path_of
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.keys import (
    PORT_UNITS,
    Leaf,
    Mistakes,
    Path,
    Place,
    leaves_of,
    plain,
)
from wavesweep.program.reading.keys import BUILT_IN, KEYS, SYMBOLS
from wavesweep.program.reading.reading import file_stem, read_file, read_override
from wavesweep.program.reading.sorting import joined_path, normal_path, sort_leaves
from wavesweep.program.reading.tables import flat_keys, missing, section_of, study_keys
from wavesweep.program.reading.units import WITH_UNIT, has_unit, named_unit, number_in
from wavesweep.program.spec.resolving import TWINS, Given, resolve
from wavesweep.program.spec.spec import Spec
from wavesweep.program.spec.studies import Request, Studies, build_studies

# a spec that has one of these draws its loop
MARKS = ("numbers", "type", "block", "signals", "wire", "ports")

MOST_KEYS = 1000  # that a spec gives; each one that is wrong takes a millisecond


def load(source: str | os.PathLike | Mapping, overrides: Iterable[str] = ()) -> Spec:
    """Return the spec of a TOML file, or of the same nested tables as a dict.

    Parameters
    ----------
    source : str, Path or dict
        A path or the tables. In these a block may also be a `StateSpaceBlock`, or a system of
        python-control or scipy.signal, see `wavesweep.engine.loop_from_blocks`.
    overrides : iterable of str, optional
        Texts `key=value` as for `--set`, e.g. `controller.b=40`, `b=40`, `sweep.B_VE.num=20`. They
        replace values of the source, under any name, before anything is checked; `rates.ratio`
        also replaces the source's `rates.slow_hz`, and the other way round.

    Returns
    -------
    Spec
        With all its values.

    Raises
    ------
    UsageError
        If a file cannot be read, or for a system that is no block.
    SpecError
        With all mistakes of source and overrides at once.
    """
    if isinstance(source, Mapping):
        try:
            name = "spec"
            path = None
            tables = plain(_with_systems(source))
            place = Place()
        except RecursionError:
            raise UsageError(
                "a spec: expected nested tables, found one that contains itself"
            ) from None
    else:
        try:
            path = os.fsdecode(os.fspath(source))
        except TypeError:
            raise UsageError(
                f"a spec: expected a path, or nested tables as a dict, found {source!r:.60}"
            ) from None
        tables, place = read_file(path)
        name = file_stem(path)
    mistakes = Mistakes()
    leaves = _collect(tables, place, overrides, mistakes)
    return _build(name, path, leaves, place, mistakes)


def _with_systems(tables: Mapping) -> Mapping:
    """The tables, with a table of a block in place of each object that is a system."""
    blocks = tables.get("block")
    if not isinstance(blocks, Mapping):
        return tables
    in_toml = (Mapping, list, tuple, str, int, float)
    systems = {name: block for name, block in blocks.items() if not isinstance(block, in_toml)}
    if not systems:
        return tables
    from wavesweep.engine.loop_sources import block_tables

    rates = tables.get("rates")
    tick_hz = rates.get("tick_hz") if isinstance(rates, Mapping) else None
    if not isinstance(tick_hz, (int, float)):
        expected = "a number beside blocks that are systems, whose sample times are so many ticks"
        raise UsageError(f"rates.tick_hz: expected {expected}, found {tick_hz!r:.60}")
    return {**tables, "block": {**blocks, **block_tables(systems, tick_hz)}}


def naming(spec: Spec, names: Iterable[object], signal: str | None = None) -> Spec:
    """Return the spec in which these keys of blocks (`block.m.mass`) are numbers too, as those are
    that [sweep] names.

    signal: of a drawn loop, which is an output too, as the one is that [bode] names. Other names,
    and keys that are not written as a number, are left to the caller.
    """
    if spec.drawing is None:
        return spec
    of_blocks = (
        name
        for name in names
        if isinstance(name, str) and name.startswith("block.") and not spec.names.find(name)
    )
    return _naming(spec, tuple(of_blocks), signal if signal in spec.drawing.signals else None)


@lru_cache(maxsize=64)
def _naming(spec, names, signal):
    if not names and signal is None:
        return spec
    tables = spec.tables()
    written = {}
    for block, keys in tables["block"].items():
        for key, value in keys.items():
            written[f"block.{block}.{key}"] = value
    new = {name: [written[name]] for name in names if isinstance(written.get(name), (int, float))}
    tables |= {
        "sweep": tables["sweep"] | new,
        "bode": tables["bode"] | ({} if signal is None else {"to": signal}),
    }
    try:
        return replace(load(tables), name=spec.name, source=spec.source)
    except SpecError:  # a key that has a number and takes none that varies
        return spec


def _collect(
    tables: dict, place: Place, overrides: Iterable[str], mistakes: Mistakes
) -> dict[Path, Leaf]:
    """Return the leaves of a source by path, with those of the overrides in their places."""
    leaves: dict[Path, Leaf] = {}
    read_leaves = [
        (normal_path(path), leaf) for path, leaf in islice(leaves_of(tables, place), MOST_KEYS + 1)
    ]
    if len(read_leaves) > MOST_KEYS:
        mistakes.refuse(read_leaves[-1][1], "", f"at most {MOST_KEYS} keys", "more")
        return leaves
    for path, leaf in read_leaves:
        if "" in path[1:]:  # it would pass for the table that it is in
            mistakes.refuse(leaf, joined_path(path), "names of keys", "an empty name")
            continue
        if path in leaves:  # an axis written both as "device.mass" and as device.mass
            mistakes.refuse(leaf, ".".join(path), "each key once", "the same key again")
        leaves[path] = leaf
    symbols = {
        name: path_of(name)
        for path in leaves
        if (name := path[1:] and path[1]) and path[0] == "numbers"
    }
    if any(path[0] == "block" for path in leaves):
        from wavesweep.engine.drawing import numbers_of_blocks
        from wavesweep.program.spec.shipped_classes import with_classes

        leaves = with_classes(leaves)
        symbols |= numbers_of_blocks(leaves)
    return _overridden(leaves, overrides, symbols, mistakes)


def _overridden(
    leaves: dict[Path, Leaf],
    overrides: Iterable[str],
    symbols: Mapping[str, str],
    mistakes: Mistakes,
) -> dict[Path, Leaf]:
    """Return the leaves with those of --set in their places. symbols: the short names of a drawn
    loop's numbers."""
    source = dict(leaves)
    symbols = symbols if any(path[0] in MARKS for path in leaves) else SYMBOLS
    for typed in overrides:
        try:
            path, value, where = read_override(typed, symbols)
        except SpecError as error:
            mistakes += error.mistakes
        else:
            if path[0] == "numbers" and path[1:2] and path[1] in symbols:  # also that of a class
                path = (*symbols[path[1]].split("."), *path[2:])
            # A number that has a unit keeps it.
            path = normal_path((*path, "value") if (*path, "value") in leaves else path)
            path = _as_written(path, leaves, symbols)
            if value == "" and not any(
                _alike(path, known_path) for known_path in (*source, *leaves)
            ):
                mistakes.refuse(
                    where, ".".join(path), "a value, or a key of the spec to leave out", "neither"
                )
            unit = _unit_at(path, source, symbols) if has_unit(value) else None
            if unit is not None:
                number = number_in(value, unit)
                if number is None:
                    expected = f"a number in {unit}" if unit else "a number without a unit"
                    mistakes.refuse(where, ".".join(path), expected, named_unit(value))
                    continue
                value = number
            leaves = _override(leaves, path, value, where)
            if value != "":
                leaves = _without_other_names(path, leaves, source, symbols)
    return leaves


def _in_full(path: Path, depth: int, symbols: Mapping[str, str]) -> Path:
    """Return a path with that of the number for its short name, which is in a table of axes at this depth."""
    name = path[depth]
    if name not in symbols:
        return path
    number = symbols[name] if symbols is SYMBOLS else path_of(name)
    return (*path[:depth], *number.split("."), *path[depth + 1 :])


def _as_written(path: Path, leaves: Mapping[Path, Leaf], symbols: Mapping[str, str]) -> Path:
    """Return the path of --set with the name by which a table has the number already, if it is in a table of axes.
    symbols: short names of paths."""
    section = section_of(path)
    depth = len(section)
    if not section or path == section:
        return path
    full = _in_full(path, depth, symbols)
    number = _in_full(path[: depth + 1], depth, symbols)
    for source_path in leaves:
        if source_path[:depth] == section != source_path:
            name = _in_full(source_path[: depth + 1], depth, symbols)
            if name != source_path[: depth + 1] and full[: len(name)] == name:
                return (*source_path[: depth + 1], *full[len(name) :])
            if source_path[: len(number)] == number or _alike(full, source_path):
                return full
    return path


def _without_other_names(
    path: Path, leaves: dict[Path, Leaf], source: Mapping[Path, Leaf], symbols: Mapping[str, str]
) -> dict[Path, Leaf]:
    """Return the leaves without what the source has of a quantity of --set by other names and keys in the same table.

    path: of --set; symbols: short names of paths.
    """
    section = section_of(path)
    depth = len(section)
    twin = (*section, *TWINS.get(".".join(path[depth:][:2]), "").split("."))
    is_axis = section and path != section
    result = {}
    for other, leaf in leaves.items():
        named = False
        if is_axis and other[:depth] == section != other and not _alike(other, path):
            named = _alike(_in_full(other, depth, symbols), _in_full(path, depth, symbols))
        if source.get(other) is not leaf or not (named or other[: len(twin)] == twin):
            result[other] = leaf
    return result


def _unit_at(path: Path, leaves: Mapping[Path, Leaf], symbols: Mapping[str, str]) -> str | None:
    """Return the unit of the number at a path, empty if it has none; None if there is no number.
    symbols: short names of paths."""
    section = section_of(path)
    key = {**flat_keys(), **study_keys()}.get(".".join(path))
    if key is None and ".".join(path) == RATE:
        return "Hz"
    leaf = None
    if key is None and section:
        name = ".".join(path[len(section) :][: -1 if path[-1] in ("start", "stop") else None])
        return _unit_at(tuple(symbols.get(name, name).split(".")), leaves, symbols)
    if path[0] == "numbers":
        leaf = leaves.get((*path[:2], "unit"), Leaf("", Place()))
    elif path[0] == "block" and len(path) == 3 and (*path[:2], "type") in leaves:
        from wavesweep.engine.drawing import TYPES, keys_of_block

        kind = leaves[*path[:2], "type"].value
        leaf = leaves.get(("type", kind, "numbers", path[2], "unit"))
        key = keys_of_block(kind).get(path[2]) if kind in TYPES else None
    if leaf is not None:
        return str(leaf.value)
    if not key or not key.numeric or key.instead == WITH_UNIT:
        return None
    unit = key.unit.removesuffix("1")
    for name, units in PORT_UNITS.items() if path[0] == "simulate" else ():
        if leaves.get(("ports", "hand", name), Leaf(False, Place())).value is True:
            return units.get(unit, unit)
    return unit


def _alike(first: Path, second: Path) -> bool:
    """Whether one path is at, above or below the other."""
    return all(a == b for a, b in zip(first, second, strict=False))


def _override(
    leaves: dict[Path, Leaf], replaced: Path, value: object, where: Place
) -> dict[Path, Leaf]:
    """Replace everything at, above or below one path, in the same position, so that the order of
    axes is kept."""
    new = (
        {}
        if value == ""
        else {
            normal_path(path): leaf
            for path, leaf in leaves_of({replaced[-1]: value}, where, replaced[:-1])
        }
    )  # without a text it is left out
    result: dict[Path, Leaf] = {}
    for path, leaf in leaves.items():
        if _alike(path, replaced):
            result.update(new)
        else:
            result[path] = leaf
    return {**result, **new}


def _without_missing_tables(leaves: dict[Path, Leaf], mistakes: Mistakes) -> dict[Path, Leaf]:
    """Return the leaves without the tables of capabilities that are not installed, and add a
    mistake for each of these."""
    for table, capability in missing().items():
        path_of_table = tuple(table.split("."))
        if inside := [
            path_below for path_below in leaves if path_below[: len(path_of_table)] == path_of_table
        ]:
            reason = f"a table of the capability {capability}, which is not installed"
            place_of_table = leaves[inside[0]].place.under(path_of_table)
            mistakes.refuse(
                place_of_table, f"[{table}]", "only tables of what is installed", reason
            )
            leaves = {
                path_below: leaf for path_below, leaf in leaves.items() if path_below not in inside
            }
    return leaves


def _build(
    name: str, path: str | None, leaves: dict[Path, Leaf], place: Place, mistakes: Mistakes
) -> Spec:
    tables = {table_field[0] for table_field in leaves}
    drawn = tables & {*MARKS} or ("controller" not in tables and tuple(RATE.split(".")) in leaves)
    names = BUILT_IN
    drawing = None
    wrong = True
    leaves = _without_missing_tables(leaves, mistakes)
    if drawn:
        from wavesweep.engine.drawing import expanded, read_drawing
        from wavesweep.program.spec.drawn_spec import beside_drawing, with_corrected_names

        if any(leaf_path[-1] == "file" for leaf_path in leaves):
            from wavesweep.program.reading.matrix_files import with_matrices

            leaves = with_matrices(leaves, path, mistakes)
        leaves = expanded(with_corrected_names(leaves, mistakes), mistakes)
        beside = beside_drawing(leaves)
        drawing, values, of_loop, names = read_drawing(leaves, place, mistakes, beside)
        given = Given(of_loop, place)
        belongs = sort_leaves(leaves, mistakes, names)
        hz = drawing.rate(values) if drawing else values.get(RATE)
    else:
        belongs = sort_leaves(leaves, mistakes)
        given = Given({key: leaf for key, leaf in belongs.keys.items() if key in KEYS}, place)
        values, wrong = resolve(given)
        mistakes += wrong
        wrong_rate = any(mistake.key.startswith("rates.") for mistake in wrong)
        hz = None if wrong_rate else values["rates.fast_hz"]
    facts = {"names": names, "drawing": drawing, "hz": hz, "values": None if wrong else values}
    studies = build_studies(Request(belongs=belongs, given=given, mistakes=mistakes, **facts))
    if mistakes:
        raise SpecError(mistakes.in_order())
    tables_read = {field.name: getattr(studies, field.name) for field in fields(Studies)}
    return Spec(
        name=name, source=path, _values=values, _given=given, drawing=drawing, **tables_read
    )
