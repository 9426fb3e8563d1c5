"""The columns of a table: their order, kinds and units, against which rows are checked before they are written."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from wavesweep.capabilities import home_of
from wavesweep.engine.drawing.drawn_block import keys_of_block
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.keys.key import TURNED
from wavesweep.program.columns import Columns, whose_column
from wavesweep.program.row_kinds import row_kinds
from wavesweep.program.spec import KEYS, SYMBOLS
from wavesweep.program.spec.drawn_spec import run_column
from wavesweep.program.spec.studies import K_VE_SPAN
from wavesweep.program.tables import HOMES, kind_named, kinds
from wavesweep.program.tables.fields import OF_ALONG, OF_WALL, Field, FieldKind

_DTYPES = {"number": np.float64, "integer": np.int64, "boolean": np.bool_, "string": np.object_}
_ACCEPTED = {"number": "fiu", "integer": "iu", "boolean": "b", "string": "OU"}
OTHERS = ("bench",)  # tables with a figure that do not come from a spec


def fields(
    kind: str, axes: Iterable[str] = (), along: str = "K_VE", extra: Iterable[str] = (), facts: Mapping[str, Any] | None = None
) -> tuple[Field, ...]:
    """Give the columns of a table in order: the swept axes and those of its kind.

    along: the axis that `low` and `high` are values of, which take its unit. extra: those of its optional columns that it has.
    facts: of the run, with the numbers of a drawn loop. Raises WavesweepError for a table or an axis that does not exist.
    """
    table_kind = kind_named(kind)
    numbers, wanted = numbers_of(facts) | signals_of(facts), set(extra)
    units = {OF_ALONG: _axis(along, numbers).unit, OF_WALL: felt_unit(facts)}
    unlike, present = unlike_units(facts), [field for field in table_kind.fields if not field.optional or field.name in wanted]
    units |= {field.unit: at_port(field.unit, facts) for field in present if field.unit not in units}
    columns = [replace(field, unit="" if field.name in unlike else units[field.unit]) for field in present]
    return (*columns[: table_kind.before], *(_axis(axis, numbers) for axis in axes), *columns[table_kind.before :])


def fields_of(kind: str, columns: Mapping[str, Any], facts: Mapping[str, Any] | None = None) -> tuple[Field, ...]:
    """Give the columns of an existing table: those that are not columns of its kind are its axes.

    `facts` of the run describe the numbers of a drawn loop.
    """
    field_names = {field.name for field in kind_named(kind).fields}
    along = columns.get("along", ())
    axes = [name for name in columns if name not in field_names]
    table_fields = fields(kind, axes, str(along[0]) if len(along) else "K_VE", columns, facts)
    # A whole number that only some specs of a comparison have is missing in the others.
    rough = {name for name in axes if getattr(columns[name], "dtype", np.dtype(object)) == np.float64}
    inexact = {column.name for column in table_fields if column.name in rough and column.kind == "integer"}
    return tuple(replace(column, kind="number") if column.name in inexact else column for column in table_fields)


def in_order(kind: str, columns: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Give the columns of a table in the order of the program, without those that it does not have."""
    table_kind = kind_named(kind) if kind in HOMES else None
    if table_kind is None or not table_kind.fields:
        return dict(columns)
    specs = [spec for spec in (facts.get("spec"), *facts.get("specs", {}).values()) if isinstance(spec, Mapping)]
    field_names = [field.name for field in table_kind.fields]
    axes = [name for spec in specs for name in spec.get(table_kind.study, {}) if name not in field_names]
    names = dict.fromkeys([*axes, *field_names, *signals_of(facts)])
    return dict(table_kind.ordered({name: columns[name] for name in names if name in columns}))


def felt_unit(facts: Mapping[str, Any] | None) -> str:
    """Give the unit of the stiffness that is felt: that of the wall of a drawn loop, which may turn and not slide."""
    wall = (facts or {}).get("spec", {}).get("ports", {}).get("wall", {})
    number = numbers_of(facts).get(wall.get("stiffness", ""))
    return (number and number.unit) or at_port("N/m", facts)


def at_port(unit: str, facts: Mapping[str, Any] | None) -> str:
    """Give a unit at the hand's port, or its rotational counterpart if the hands of all specs of a run turn."""
    specs = [spec for spec in ((facts or {}).get("spec"), *(facts or {}).get("specs", {}).values()) if spec]
    turns = [spec.get("ports", {}).get("hand", {}).get("turns", False) for spec in specs]
    return TURNED.get(unit, unit) if turns and all(turns) else unit


def swept_range(facts: Mapping[str, Any] | None, along: str) -> tuple[float, float]:
    """Give both ends of the range in which stable intervals were wanted; infinite if they are not known."""
    default = K_VE_SPAN if along == "K_VE" else (-np.inf, np.inf)
    axis = (facts or {}).get("spec", {}).get("sweep", {}).get(along, dict(zip(("start", "stop"), default, strict=True)))
    ends = (axis["start"], axis["stop"]) if isinstance(axis, Mapping) else (np.min(axis), np.max(axis))
    return float(ends[0]), float(ends[1])


def numbers_of(facts: Mapping[str, Any] | None) -> dict[str, Field]:
    """Give the fields of the numbers of a run's drawn loops, in [numbers] and in blocks, by their names as axes."""
    numbers: dict[str, Field] = {}
    specs = [(facts or {}).get("spec", {}), *(facts or {}).get("specs", {}).values()]
    for read in (_numbers_of_blocks, _numbers_of_table):
        for axis, number in (pair for spec in specs for pair in read(spec).items()):
            numbers.setdefault(axis, number)
    rate = Field("rates.tick_hz", "number", "Hz", "common tick of the blocks")
    numbers |= {name: replace(numbers[name], unit="") for name in unlike_units(facts) if name in numbers}
    return numbers | {rate.name: rate} if numbers else numbers


def _numbers_of_blocks(spec: Mapping[str, Any]) -> dict[str, Field]:
    numbers = {}
    for name, block in spec.get("block", {}).items():
        for key in keys_of_block(block["type"]).values():
            axis = f"block.{name}.{key.path}"
            if key.type in ("number", "integer"):
                kind: FieldKind = "integer" if key.type == "integer" else "number"
                numbers[axis] = Field(axis, kind, key.unit, f"{key.description}, of {name}")
    return numbers


def _numbers_of_table(spec: Mapping[str, Any]) -> dict[str, Field]:
    numbers = {}
    for name, number in spec.get("numbers", {}).items():
        kind: FieldKind = "integer" if isinstance(number["value"], int) else "number"
        for axis in (name, f"numbers.{name}"):
            numbers[axis] = Field(axis, kind, number["unit"], number["description"])
    return numbers


def signals_of(facts: Mapping[str, Any] | None) -> dict[str, Field]:
    """Give the fields of the inputs, outputs and named signals that a simulation of a drawn loop shows."""
    spec = (facts or {}).get("spec", {})
    named = {
        run_column("signals", name): Field(run_column("signals", name), "number", "", f"{name}: {text}")
        for name, text in spec.get("signals", {}).items()
    }
    inputs, outputs = (
        {
            run_column(side, name): Field(run_column(side, name), "number", port["unit"], f"{meaning}: {port['signal']}")
            for name, port in spec.get("ports", {}).get(side, {}).items()
        }
        for side, meaning in (("inputs", "input, held over the tick"), ("outputs", "output"))
    )
    if (port := spec.get("ports", {}).get("environment")) is not None:
        text = f"{{}} at the environment's port: {port['force']}, {port['displacement']}"
        inputs["environment.force"] = Field("environment.force", "number", "N", text.format("force, held over the tick,"))
        outputs["environment.displacement"] = Field("environment.displacement", "number", "m", text.format("position"))
    hand = spec.get("ports", {}).get("hand", {})
    for quantity, unit, signals in (("force", "N", inputs), ("displacement", "m", outputs)):
        for number, signal in enumerate(hand[quantity] if isinstance(hand.get(quantity), list) else (), 1):
            name = f"hand.{quantity}.{number}"
            signals[name] = Field(name, "number", unit, f"{quantity} of the hand, axis {number}: {signal}")
    return inputs | {name: field for name, field in named.items() if name not in inputs} | outputs


def unlike_units(facts: Mapping[str, Any] | None) -> Mapping[str, Mapping[str, list[str]]]:
    """Give the columns whose unit differs between the specs of a run, with the specs of each unit."""
    return (facts or {}).get("unlike_units", {})


def missing_command(kind: str, facts: Mapping[str, Any]) -> str:
    """Give the command that made a table of a kind that is not known here, from the facts of its run; otherwise an empty text.

    It is empty too if the command is there: then the table is damaged.
    """
    words = [word for word in str(facts.get("command", "")).split()[1:] if not word.startswith("-")]
    return words[0] if kind not in HOMES and words and words[0] not in HOMES and not home_of(words[0]) else ""


def missing_for(kind: str, columns: Columns, facts: Mapping[str, Any]) -> str:
    """What no installed capability makes of a table, in words: all of it, or some of its rows; empty if there is nothing."""
    if command := missing_command(kind, facts):
        return f"tables of wavesweep {command}"
    whose = whose_column(columns)
    words = set(columns[whose].tolist()) - {*row_kinds()} if whose in ("guarantee", "hand") else ()
    return f"rows of {', '.join(sorted(words))}" if words else ""


def kind_of(names: Iterable[str], stem: str, facts: Mapping[str, Any]) -> str:
    """Give the kind of the table that has columns of these names; stem: the name of its file, if several kinds have them.

    facts: of the run. Without the capability that made the table, the kind is that name. Raises WavesweepError for columns of
    no known table.
    """
    names, known_kinds = list(names), kinds()
    fitting = [name for name, kind in known_kinds.items() if kind.fields and set(kind.names) <= set(names)]
    if stem in fitting or (not fitting and (stem in (*OTHERS, *known_kinds) or missing_command(stem, facts))):
        return stem
    if not fitting:
        raise WavesweepError(
            f"expected the columns of a table with a figure ({', '.join((*known_kinds, *OTHERS))}), found {', '.join(names)}"
        )
    return max(fitting, key=lambda name: len(known_kinds[name].names))


def kinds_by_name() -> dict[str, FieldKind]:
    """Give the kind of each column name; a name means the same in every table."""
    axes = {name: _axis(name).kind for name in (*SYMBOLS, *KEYS) if KEYS[SYMBOLS.get(name, name)].numeric}
    return {**axes, **{field.name: field.kind for kind in kinds().values() for field in kind.fields}}


def _axis(name: str, own: Mapping[str, Field] = MappingProxyType({})) -> Field:
    if name in own:
        return own[name]
    key = KEYS.get(SYMBOLS.get(name, name))
    if key is None or not key.numeric:
        raise WavesweepError(f"column {name}: neither a column of this table nor an axis that a spec can sweep")
    return Field(name, "integer" if key.type == "integer" else "number", key.unit, key.description)


def checked(fields: tuple[Field, ...], columns: Mapping[str, Any], first_row: int = 0) -> dict[str, np.ndarray]:
    """Give the columns in their fields' order as contiguous float64, int64, bool and object arrays.

    `first_row` is the number of rows of the table before these; it only makes the row numbers of errors right.
    Raises WavesweepError if columns are missing, unknown, of unequal length or of the wrong kind, and if a
    number is infinite: no table holds an infinity, several readers break on it.
    """
    expected = [field.name for field in fields]
    if sorted(columns) != sorted(expected):
        raise WavesweepError(f"the table's columns are {', '.join(columns)}; expected {', '.join(expected)}")
    arrays = {field.name: _typed(field, np.asarray(columns[field.name])) for field in fields}
    lengths = {name: array.shape[0] for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise WavesweepError(f"the table's columns differ in length: {lengths}")
    for name, array in arrays.items():
        for row in np.flatnonzero(np.isinf(array))[:1].tolist() if array.dtype == np.float64 else ():
            fault = f"column {name}, row {first_row + row + 1}: found {array[row]}"
            raise WavesweepError(f"{fault}, expected a finite number or a missing value; nothing was written")
    return arrays


def _typed(field: Field, array: np.ndarray) -> np.ndarray:
    if array.ndim != 1 or (array.size and array.dtype.kind not in _ACCEPTED[field.kind]):
        raise WavesweepError(
            f"column {field.name}: found {array.ndim}-dimensional {array.dtype}, expected a column of kind {field.kind}"
        )
    return np.ascontiguousarray(array, dtype=_DTYPES[field.kind])
