"""The columns of a table: their order, kinds and units, against which rows are checked before they are written."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from wavesweep.engine.drawing import keys_of_block
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.keys import PORT_UNITS
from wavesweep.program.columns import age_column, run_column
from wavesweep.program.spec import KEYS, SYMBOLS
from wavesweep.program.spec.studies import K_VE_SPAN
from wavesweep.program.tables import kind_named, kinds
from wavesweep.program.tables.fields import OF_ALONG, Field, FieldKind

_DTYPES = {"number": np.float64, "integer": np.int64, "boolean": np.bool_, "string": np.object_}
_ACCEPTED = {"number": "fiu", "integer": "iu", "boolean": "b", "string": "OU"}


def fields(
    kind: str,
    axes: Iterable[str] = (),
    along: str = "K_VE",
    extra: Iterable[str] = (),
    facts: Mapping[str, Any] | None = None,
) -> tuple[Field, ...]:
    """Give the columns of a table in order: the swept axes and those of its kind.

    along: the axis that `low` and `high` are values of, which take its unit. extra: those of its
    optional columns that it has. facts: of the run, with the numbers of a drawn loop. Raises
    WavesweepError for a table or an axis that does not exist.
    """
    table_kind = kind_named(kind)
    numbers = numbers_of(facts) | signals_of(facts)
    unlike = unlike_units(facts)
    wanted = set(extra)
    columns = []
    for field in table_kind.fields:
        if field.optional and field.name not in wanted:
            continue
        if field.name in unlike:
            unit = ""
        elif field.unit == OF_ALONG:
            unit = _axis(along, numbers).unit
        else:
            unit = at_port(field.unit, facts)
        columns.append(replace(field, unit=unit))
    before = table_kind.before
    fields_of_axes = [_axis(axis, numbers) for axis in axes]
    return (*columns[:before], *fields_of_axes, *columns[before:])


def fields_of(
    kind: str, columns: Mapping[str, Any], facts: Mapping[str, Any] | None = None
) -> tuple[Field, ...]:
    """Give the columns of an existing table: those that are not columns of its kind are its axes.

    `facts` of the run describe the numbers of a drawn loop.
    """
    field_names = {field.name for field in kind_named(kind).fields}
    axes = [name for name in columns if name not in field_names]
    rows_along = columns.get("along", ())
    interval_axis = str(rows_along[0]) if len(rows_along) else "K_VE"
    table_fields = list(fields(kind, axes, interval_axis, columns, facts))
    for number, column in enumerate(table_fields):
        if column.name not in axes or column.kind != "integer":
            continue
        # A whole number that only some specs of a comparison have is missing in the others.
        if getattr(columns[column.name], "dtype", None) == np.float64:
            table_fields[number] = replace(column, kind="number")
    return tuple(table_fields)


def in_order(kind: str, columns: Mapping[str, Any], facts: Mapping[str, Any]) -> dict[str, Any]:
    """Give the columns of a table in the order of the program, without those that it does not have."""
    table_kind = kind_named(kind)
    if not table_kind.fields:
        return dict(columns)
    field_names = [field.name for field in table_kind.fields]
    axes = [name for name in [facts.get("over")] if name]  # a number that no table has to have
    for spec in specs_in(facts):
        if isinstance(spec, Mapping):
            axes += [name for name in spec.get(table_kind.study, {}) if name not in field_names]
    names = dict.fromkeys([*axes, *field_names, *signals_of(facts)])
    present = {name: columns[name] for name in names if name in columns}
    return dict(table_kind.ordered(present))


def specs_in(facts: Mapping[str, Any] | None) -> list[Any]:
    """The tables of all specs in the facts of a run, the first one also by itself."""
    if not facts:
        return []
    return [facts.get("spec", {}), *facts.get("specs", {}).values()]


def at_port(unit: str, facts: Mapping[str, Any] | None) -> str:
    """Give a unit at the hand's port, or its counterpart if all specs of a run turn, or all have volts."""
    hands = [spec.get("ports", {}).get("hand", {}) for spec in specs_in(facts) if spec]
    for key, units in PORT_UNITS.items():
        if hands and all(hand.get(key, False) for hand in hands):
            return units.get(unit, unit)
    return unit


def swept_range(facts: Mapping[str, Any] | None, along: str) -> tuple[float, float]:
    """Give both ends of the range in which stable intervals were wanted; infinite if they are not known."""
    axis = (facts or {}).get("spec", {}).get("sweep", {}).get(along)
    if axis is None:
        low, high = K_VE_SPAN if along == "K_VE" else (-np.inf, np.inf)
    elif isinstance(axis, Mapping):
        low, high = axis["start"], axis["stop"]
    else:
        low, high = np.min(axis), np.max(axis)
    return float(low), float(high)


def numbers_of(facts: Mapping[str, Any] | None) -> dict[str, Field]:
    """Give the fields of the numbers of a run's drawn loops, in [numbers] and in blocks, by their names as axes."""
    specs = specs_in(facts)
    numbers: dict[str, Field] = {}
    for read in (_numbers_of_blocks, _numbers_of_table):
        for spec in specs:
            for axis, number in read(spec).items():
                numbers.setdefault(axis, number)
    if not numbers:
        return {}
    for name in unlike_units(facts):
        if name in numbers:
            numbers[name] = replace(numbers[name], unit="")
    rate = Field("rates.tick_hz", "number", "Hz", "common tick of the blocks")
    return {**numbers, rate.name: rate}


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
    """Give the fields of what a simulation of a drawn loop shows: inputs, outputs, named signals, ages of messages, measurements."""
    spec = (facts or {}).get("spec", {})
    ports = spec.get("ports", {})
    inputs = _signals_of_ports("inputs", ports, "input, held over the tick")
    outputs = _signals_of_ports("outputs", ports, "output")
    environment = ports.get("environment")
    if environment is not None:
        at_its_port = (
            f"at the environment's port: {environment['force']}, {environment['displacement']}"
        )
        name = "environment.force"
        inputs[name] = Field(name, "number", "N", f"force, held over the tick, {at_its_port}")
        name = "environment.displacement"
        outputs[name] = Field(name, "number", "m", f"position {at_its_port}")
    hand = ports.get("hand", {})
    for quantity, unit, signals in (("force", "N", inputs), ("displacement", "m", outputs)):
        if not isinstance(hand.get(quantity), list):
            continue
        for number, signal in enumerate(hand[quantity], 1):
            name = f"hand.{quantity}.{number}"
            signals[name] = Field(
                name, "number", unit, f"{quantity} of the hand, axis {number}: {signal}"
            )
    named = {}
    for name, text in spec.get("signals", {}).items():
        column = run_column("signals", name)
        if column not in inputs:
            named[column] = Field(column, "number", "", f"{name}: {text}")
    aged = {}
    for name in (facts or {}).get("channels", ()):
        column = age_column(name)
        text = f"age of the message of {name} that is in place; missing where none is"
        aged[column] = Field(column, "number", "s", text)
    logged = {}
    for name, unit in (facts or {}).get("log", {}).get("units", {}).items():
        column = f"log_{name}"
        logged[column] = Field(column, "number", unit, f"{name} as the log has it, its newest row")
    return aged | inputs | named | outputs | logged


def _signals_of_ports(side: str, ports: Mapping[str, Any], meaning: str) -> dict[str, Field]:
    """The fields of the inputs or of the outputs of a drawn loop."""
    signals = {}
    for name, port in ports.get(side, {}).items():
        column = run_column(side, name)
        signals[column] = Field(column, "number", port["unit"], f"{meaning}: {port['signal']}")
    return signals


def unlike_units(facts: Mapping[str, Any] | None) -> Mapping[str, Mapping[str, list[str]]]:
    """Give the columns whose unit differs between the specs of a run, with the specs of each unit."""
    unlike: Mapping[str, Mapping[str, list[str]]] = (facts or {}).get("unlike_units", {})
    return unlike


def kind_of(names: Iterable[str], stem: str) -> str:
    """Give the kind of the table that has columns of these names; stem: the name of its file, if several kinds have them.

    Raises WavesweepError for columns of no known table.
    """
    names = list(names)
    known_kinds = kinds()
    fitting = [
        name for name, kind in known_kinds.items() if kind.fields and set(kind.names) <= set(names)
    ]
    if stem in fitting:
        return stem
    if fitting:
        return max(fitting, key=lambda name: len(known_kinds[name].names))
    if stem in known_kinds:
        return stem
    expected = f"the columns of a table with a figure ({', '.join(known_kinds)})"
    raise WavesweepError(f"expected {expected}, found {', '.join(names)}")


def kinds_by_name() -> dict[str, FieldKind]:
    """Give the kind of each column name; a name means the same in every table."""
    kinds_of_columns: dict[str, FieldKind] = {}
    for name in (*SYMBOLS, *KEYS):
        if KEYS[SYMBOLS.get(name, name)].numeric:
            kinds_of_columns[name] = _axis(name).kind
    for kind in kinds().values():
        for field in kind.fields:
            kinds_of_columns[field.name] = field.kind
    return kinds_of_columns


def _axis(name: str, own_fields: Mapping[str, Field] = MappingProxyType({})) -> Field:
    if name in own_fields:
        return own_fields[name]
    key = KEYS.get(SYMBOLS.get(name, name))
    if key is None or not key.numeric:
        raise WavesweepError(
            f"column {name}: neither a column of this table nor an axis that a spec can sweep"
        )
    return Field(name, "integer" if key.type == "integer" else "number", key.unit, key.description)


def checked(
    fields: tuple[Field, ...], columns: Mapping[str, Any], first_row: int = 0
) -> dict[str, np.ndarray]:
    """Give the columns in their fields' order as contiguous float64, int64, bool and object arrays.

    `first_row` is the number of rows of the table before these; it only makes the row numbers of
    errors right. Raises WavesweepError if columns are missing, unknown, of unequal length or of the
    wrong kind, and if a number is infinite: no table holds an infinity, several readers break on
    it.
    """
    expected = [field.name for field in fields]
    if sorted(columns) != sorted(expected):
        raise WavesweepError(
            f"the table's columns are {', '.join(columns)}; expected {', '.join(expected)}"
        )
    arrays = {field.name: _typed(field, np.asarray(columns[field.name])) for field in fields}
    lengths = {name: array.shape[0] for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise WavesweepError(f"the table's columns differ in length: {lengths}")
    for name, array in arrays.items():
        if array.dtype != np.float64:
            continue
        infinite = np.flatnonzero(np.isinf(array))
        if infinite.size:
            row = int(infinite[0])
            fault = f"column {name}, row {first_row + row + 1}: found {array[row]}"
            raise WavesweepError(
                f"{fault}, expected a finite number or a missing value; nothing was written"
            )
    return arrays


def _typed(field: Field, array: np.ndarray) -> np.ndarray:
    if array.ndim != 1 or (array.size and array.dtype.kind not in _ACCEPTED[field.kind]):
        fault = f"column {field.name}: found {array.ndim}-dimensional {array.dtype}"
        raise WavesweepError(f"{fault}, expected a column of kind {field.kind}")
    return np.ascontiguousarray(array, dtype=_DTYPES[field.kind])
