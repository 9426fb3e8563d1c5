"""A table's rows as CSV and as Parquet, and back from both files to the same bits."""

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError, WavesweepError
from wavesweep.engine.rows import different
from wavesweep.program.atomic_files import open_file
from wavesweep.program.platform_compat import memory
from wavesweep.program.results.package import (
    packaged_facts,
    packaged_fault,
    packaged_kinds,
    parsed,
)
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.columns import checked, fields_of, in_order, kind_of, kinds_by_name
from wavesweep.program.tables.fields import Field, FieldKind

# Rows in a row group. A fixed number, so that a file's bytes do not depend on the blocks that its
# rows came in.
GROUP_ROWS = 131072
WHOLE = 1e10  # from which on Arrow writes an exponent
CSV_BLOCK = 1 << 24  # bytes that are read at once

# What computing with facts and columns raises that no run writes.
NOT_OURS = (AttributeError, LookupError, TypeError, ValueError, ArithmeticError)

_NUMPY = {"double": np.float64, "int64": np.int64, "bool": np.bool_}  # kinds of columns in a file


class ParquetFile:
    """A Parquet file that is being written, a row group a call."""

    def __init__(self, path: Path, fields: tuple[Field, ...], facts: Mapping[str, Any]) -> None:
        import pyarrow.parquet

        types = _types()
        columns = []
        for field in fields:
            about = {"unit": field.unit, "description": field.description}
            columns.append(pyarrow.field(field.name, types[field.kind], metadata=about))
        text = json.dumps(facts, allow_nan=False)
        units = json.dumps({"units": {field.name: field.unit for field in fields}})
        # pandas puts what it finds under its own key into `.attrs`.
        about_table = {"wavesweep": text, "PANDAS_ATTRS": units}
        self._schema = pyarrow.schema(columns, metadata=about_table)
        self._path = path
        self._writer: Any = None

    def append(self, columns: Mapping[str, np.ndarray]) -> None:
        """Write checked columns as one row group."""
        import pyarrow

        if self._writer is None:
            self._open(columns)
        arrays = [_array(column) for column in columns.values()]
        self._writer.write_table(
            pyarrow.Table.from_arrays(arrays, schema=self._schema), row_group_size=GROUP_ROWS
        )

    def _open(self, columns: Mapping[str, np.ndarray]) -> None:
        """Open the file for columns like those of the first group: numbers that repeat are kept once, in a dictionary."""
        import pyarrow.parquet

        many = [
            name
            for name, column in columns.items()
            if column.dtype == np.float64 and different(column).size > len(column) // 2
        ]
        few = [name for name in columns if name not in many]
        self._file = _opened(self._path, "wb")
        self._writer = pyarrow.parquet.ParquetWriter(
            self._file, self._schema, compression="zstd", use_dictionary=few
        )

    def close(self) -> None:
        """Write the footer; without it the file cannot be read."""
        if self._writer is None:
            self._open({})
        try:
            self._writer.close()
        finally:
            # if it failed, pyarrow would try again at some later time, and print a traceback
            self._writer.is_open = False
            self._file.close()


def _opened(path: Path, mode: str) -> Any:
    """A file of Arrow's, which takes a path for an address (s3:), and refuses one that is no UTF-8, unless it is bytes."""
    import pyarrow

    if mode == "rb":
        open_file(
            path
        ).close()  # or an error for a pipe, which would be waited for, and for a device, which has no end
    return pyarrow.OSFile(os.fsencode(path), mode)


def csv_header(fields: tuple[Field, ...]) -> bytes:
    """The header line, encoded; no name of a column needs quotes."""
    return (",".join(field.name for field in fields) + "\n").encode("utf-8")


def csv_rows(columns: Mapping[str, np.ndarray]) -> Any:
    """The rows of checked columns as a buffer; programs read the cells correctly without options.

    Numbers are the shortest decimals that read back to the same bits, always with a point or an
    exponent; booleans are 1 and 0; what is missing is an empty cell; texts have quotes if they need
    them. Arrow's own writer quotes all texts or none.
    """
    *before_last, last = (_cells(column) for column in columns.values())
    ends_of_rows = _joined([last, _text("")], "\n")
    return _joined([*before_last, ends_of_rows], ",").buffers()[2]


def _cells(column: np.ndarray) -> Any:
    """A column as texts; missing numbers are null. Repeated numbers, as those of axes, are written once."""
    import pyarrow

    if column.dtype == object:
        return _quoted(_array(column))
    if column.dtype != np.float64:
        return _array(column.astype(np.int64)).cast("string")
    array = _array(column)
    # Some 256 numbers are looked at, whether they repeat.
    sample = column[:: 1 + len(column) // 256]
    if different(sample).size > len(sample) // 2:
        return _decimals(array)
    bits = pyarrow.Array.from_buffers(pyarrow.int64(), len(array), array.buffers())  # 0 is not -0
    coded = bits.dictionary_encode()
    values = pyarrow.Array.from_buffers(
        pyarrow.float64(), len(coded.dictionary), coded.dictionary.buffers()
    )
    return _decimals(values).take(coded.indices)


def _decimals(array: Any) -> Any:
    """Doubles as decimals; Arrow writes whole numbers below WHOLE without a point."""
    from pyarrow import compute

    text = array.cast("string")
    values = np.frombuffer(array.buffers()[1], np.float64, len(array))
    integral = (values == np.trunc(values)) & (np.abs(values) < WHOLE)
    if not integral.any():
        return text
    mask = _array(integral)
    with_point = _joined([text.filter(mask), _text("0")], ".")
    return compute.replace_with_mask(text, mask, with_point)


def _quoted(texts: Any) -> Any:
    """Texts in quotes, if these have a comma, a quote or the end of a line in them."""
    from pyarrow import compute

    words = texts.buffers()[2].to_pybytes()
    if not any(mark in words for mark in (b",", b'"', b"\r", b"\n")):
        return texts
    marked = compute.match_substring_regex(texts, r'[,"\r\n]')
    doubled = compute.replace_substring(texts, '"', '""')
    quote = _text('"')
    return compute.if_else(marked, _joined([quote, doubled, quote], ""), texts)


def _text(value: str) -> Any:
    """A text of Arrow's, which makes one from a str by way of pandas."""
    return _array(np.array([value], object))[0]


def _joined(pieces: list[Any], between: str) -> Any:
    """Arrays of texts, and texts, joined row by row; what is missing is an empty text."""
    from pyarrow import compute

    return compute.binary_join_element_wise(
        *pieces, _text(between), null_handling="replace", null_replacement=""
    )


def read(path: str | Path) -> dict[str, np.ndarray]:
    """Give the columns of a CSV or Parquet table, or of a folder of Parquet parts, exactly as they were written.

    Parameters
    ----------
    path : str or Path
        The file, or the folder.

    Returns
    -------
    dict of str to ndarray
        Columns of shape (rows,): numbers are float64 with NaN if missing, whole numbers int64,
        booleans bool, names object arrays of str. The kind of a column of a CSV follows from its
        name, or from the data package beside it.

    Raises
    ------
    UsageError
        For a file of another kind, one that is no table, or one that is damaged.
    OSError
        If it cannot be read.
    """
    if not isinstance(path, (str, os.PathLike)):
        raise UsageError(f"expected the path of a CSV or Parquet file, found {path!r:.60}")
    path = Path(path)
    _refuse_other_suffix(path)
    if path.suffix == ".parquet":
        return _read_parquet(path)
    import pyarrow.csv

    with _as_table(path), _opened(path, "rb") as file:
        return _columns(pyarrow.csv.read_csv(file, **_csv_options(path)))


def _refuse_other_suffix(path: Path) -> None:
    if path.suffix not in (".csv", ".parquet"):
        raise UsageError(f"{path}: found the suffix {path.suffix!r}, expected .csv or .parquet")


@contextmanager
def _as_table(path: Path) -> Iterator[None]:
    """Have one error for all that Arrow raises for a damaged file: its own, ValueErrors, and OSErrors without a number."""
    from pyarrow import ArrowException

    try:
        yield
    except MemoryError:
        raise
    except (ArrowException, ValueError, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise
        said = str(error).strip().partition("\n")[0] or type(error).__name__
        raise UsageError(
            f"{path}: expected a whole table, found a file that cannot be read as one ({said})"
        ) from error


def read_table(path: str | Path) -> tuple[str, dict[str, np.ndarray], dict[str, Any]]:
    """Give the kind of a table, its columns, and the facts of the run that made it.

    Parameters
    ----------
    path : str or Path
        The CSV or Parquet file.

    Returns
    -------
    kind : str
        Of the table, e.g. "zwidth".
    columns : dict of str to ndarray
        As `read` gives them. Other programs may have added columns to a Parquet file, which are
        left out, or changed their order, which is that of the program again.
    facts : dict
        Those of a CSV are in the data package beside it, those of a Parquet file in its schema.

    Raises
    ------
    UsageError
        For a file that is torn or changed, or no table of this program, before its rows are read if
        its columns show it.
    OSError
        If it cannot be read.
    """
    path = Path(path)
    _refuse_other_paths(path)
    package = path.with_suffix(".datapackage.json")
    try:
        names, facts = _names_and_facts(path, package)
        kind = kind_of(names, path.stem)
        if missing := set(kind_named(kind).names) - set(names):
            raise UsageError(
                f"{path}: expected a whole table {kind}, found none with {', '.join(sorted(missing))}"
            )
        columns = in_order(kind, read(path), facts)
        if kind_named(kind).fields:  # the columns of a design study follow from its spec
            checked(fields_of(kind, columns, facts), columns)
    except (*NOT_OURS, WavesweepError) as error:
        if isinstance(error, UsageError):
            raise
        if isinstance(error, WavesweepError):
            said = str(error)
        else:
            said = f"{type(error).__name__}: {error}"
        raise UsageError(
            f"{path}: expected a whole table, found columns or facts of another form ({said})"
        ) from error
    if not len(next(iter(columns.values()), ())):
        raise UsageError(f"{path}: expected the rows of a table, found none")
    return kind, columns, facts


def _refuse_other_paths(path: Path) -> None:
    """Raise UsageError for a path that is no file."""
    if not path.is_file():
        tables = sorted(
            package.with_suffix("").with_suffix(".parquet").name
            for package in path.glob("*.datapackage.json")
        )
        if path.is_dir():
            problem = f"a folder, with {', '.join(tables) or 'no table'}"
        else:
            problem = "no such file"
        raise UsageError(f"{path}: expected the CSV or Parquet file of a table, found {problem}")


def _names_and_facts(path: Path, package: Path) -> tuple[list[str], dict[str, Any]]:
    """The names of a table's columns, and the facts of its run. Raises UsageError for facts that are missing or damaged."""
    fault = packaged_fault(path, package) if path.suffix == ".csv" else ""
    if fault:
        raise UsageError(f"{path}: {fault}")
    if path.suffix == ".csv":
        with open_file(path) as file:
            names = file.readline(CSV_BLOCK).decode().strip().split(",")
        facts = packaged_facts(package)
    else:
        schema = _schema(path)
        names, facts = schema.names, _facts_in(schema)
    if not facts:
        raise UsageError(
            f"{path}: expected a table of wavesweep, found no facts of a run in the file"
        )
    if not all(
        isinstance(facts.get(name, {}), Mapping)
        for name in ("spec", "linear_loop", "ticks", "unlike_units")
    ):
        raise UsageError(
            f"{path}: expected the facts of a run, found damaged ones; compute the table again"
        )
    return names, facts


def _schema(path: Path) -> Any:
    """The schema of a Parquet file, of which no row is read."""
    import pyarrow.parquet

    _refuse_other_suffix(path)
    with _as_table(path), _opened(path, "rb") as file:
        return pyarrow.parquet.read_schema(file)


def _facts_in(schema: Any) -> dict[str, Any]:
    """The facts in a schema; empty if it has none."""
    try:
        return dict(parsed((schema.metadata or {}).get(b"wavesweep", b"{}")))
    except (TypeError, ValueError):
        return {}


def schema_facts(path: Path) -> dict[str, Any]:
    """The facts in the schema of a Parquet file; empty if it has none."""
    try:
        return _facts_in(_schema(path))
    except (OSError, WavesweepError):
        return {}


def schema_fields(path: Path) -> tuple[Field, ...]:
    """The columns of a Parquet table with kind, unit and description, as its schema has them.

    Those of another program have neither unit nor description, and may be of a kind that counts as
    texts here.
    """
    kinds = {str(arrow): kind for kind, arrow in _types().items()}
    fields = []
    for column in _schema(path):
        texts = column.metadata or {}
        unit = texts.get(b"unit", b"").decode("utf-8", "replace")
        description = texts.get(b"description", b"").decode("utf-8", "replace")
        kind = kinds.get(str(column.type), "string")
        fields.append(Field(column.name, kind, unit, description))
    return tuple(fields)


def read_rows(
    path: Path, first: int = 0, end: int | None = None, columns: list[str] | None = None
) -> dict[str, np.ndarray]:
    """Give the rows from `first` to before `end` (None: the last) of a Parquet table, reading only their row groups.

    Raises UsageError for a group larger than this program writes: a file of some MB could hold any
    number of rows.
    """
    import pyarrow.parquet

    with (
        _as_table(path),
        _opened(path, "rb") as source,
        pyarrow.parquet.ParquetFile(source) as file,
    ):
        rows = file.metadata.num_rows
        stop = rows if end is None else min(end, rows)
        return _columns(_rows_of(file, first, max(first, stop), columns))


def _rows_of(file: Any, first: int, end: int, columns: list[str] | None) -> Any:
    """The same of an open Parquet file, as a table of Arrow."""
    sizes = [file.metadata.row_group(number).num_rows for number in range(file.num_row_groups)]
    if max(sizes, default=0) > GROUP_ROWS:
        raise UsageError(
            f"expected groups of at most {GROUP_ROWS} rows, found one of {max(sizes)}, of another program"
        )
    borders = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
    groups = [
        number
        for number in range(len(sizes))
        if borders[number] < end and borders[number + 1] > first
    ]
    table = file.read_row_groups(groups, columns=columns)
    return table.slice(first - (int(borders[groups[0]]) if groups else 0), end - first)


def rows_in(path: Path) -> int:
    """Give the number of rows of a Parquet table, which its metadata has."""
    import pyarrow.parquet

    with _as_table(path), _opened(path, "rb") as file:
        rows: int = pyarrow.parquet.ParquetFile(file).metadata.num_rows
    return rows


def _read_parquet(path: Path) -> dict[str, np.ndarray]:
    import pyarrow.parquet

    with _as_table(path), _opened(path, "rb") as file:  # `read_table` would import pandas
        opened = pyarrow.parquet.ParquetFile(file)
        rows = opened.metadata.num_rows
        if 8 * rows * opened.metadata.num_columns > memory():
            raise UsageError(f"{path}: expected a table that fits into memory, found {rows:,} rows")
        return _columns(opened.read())


def csv_blocks(path: Path) -> Iterator[dict[str, np.ndarray]]:
    """Yield the columns of a CSV in blocks of rows, as `read` gives them at once."""
    import pyarrow.csv

    with _as_table(path), _opened(path, "rb") as file:
        size = pyarrow.csv.ReadOptions(block_size=CSV_BLOCK)
        for block in pyarrow.csv.open_csv(file, read_options=size, **_csv_options(path)):
            yield _columns(pyarrow.Table.from_batches([block]))


def _csv_options(path: Path) -> dict[str, Any]:
    """Parse with the known kinds of the columns: 1 and 0 may be booleans or whole numbers."""
    import pyarrow.csv

    types, kinds = _types(), kinds_by_name() | packaged_kinds(path)
    convert = pyarrow.csv.ConvertOptions(
        column_types={name: types[kind] for name, kind in kinds.items()}, null_values=[""],
        strings_can_be_null=False, true_values=["1"], false_values=["0"],
    )  # fmt: skip
    return {
        "parse_options": pyarrow.csv.ParseOptions(newlines_in_values=True),
        "convert_options": convert,
    }


def _columns(table: Any) -> dict[str, np.ndarray]:
    """The columns of a table of Arrow's. Raises ValueError if two have one name."""
    twice = [name for name, count in Counter(table.column_names).items() if count > 1]
    if twice:
        raise ValueError(f"several columns are called {twice[0]!r:.60}")
    return {name: _numpy(table.column(name)) for name in table.column_names}


def _numpy(column: Any) -> np.ndarray:
    """The values of a column. Arrow's own way imports pandas, which takes long, and drops a Ctrl-C that comes meanwhile."""
    kind = str(column.type)
    if kind == "string":
        return np.concatenate([np.empty(0, object), *map(_words, column.chunks)])
    if kind not in _NUMPY or (
        kind != "double" and column.null_count
    ):  # of a file that another program wrote
        import pandas  # noqa: F401 - here a Ctrl-C is not dropped

        return np.asarray(column.to_numpy())
    if kind == "bool":
        column = column.cast("uint8")
    elif column.null_count:
        not_a_number = _made("float64", 1, None, np.array([np.nan]))[0]
        column = column.fill_null(not_a_number)
    kind_in_buffer: Any = np.uint8 if kind == "bool" else _NUMPY[kind]
    chunks: Any = (
        np.frombuffer(chunk.buffers()[1], kind_in_buffer, chunk.offset + len(chunk))[chunk.offset :]
        for chunk in column.chunks
        if chunk
    )
    return np.concatenate([np.empty(0, kind_in_buffer), *chunks]).astype(_NUMPY[kind], copy=False)


def _words(texts: Any) -> np.ndarray:
    """Texts as objects, each different one made once."""
    if texts.null_count:
        return np.array(texts.to_pylist(), dtype=object)
    coded = texts.dictionary_encode()
    indices = np.frombuffer(coded.indices.buffers()[1], np.int32, len(coded))
    return np.array(coded.dictionary.to_pylist(), dtype=object)[indices]


def _types() -> dict[FieldKind, Any]:
    import pyarrow

    return {
        "number": pyarrow.float64(),
        "integer": pyarrow.int64(),
        "boolean": pyarrow.bool_(),
        "string": pyarrow.string(),
    }


def _array(column: np.ndarray) -> Any:
    """Wrap a column's memory. `pyarrow.array` would do, but imports pandas, which costs more than a small run takes."""
    if column.dtype == np.float64:
        missing = np.isnan(column)
        return _made("float64", len(column), _bits(~missing) if missing.any() else None, column)
    if column.dtype == np.int64:
        return _made("int64", len(column), None, column)
    if column.dtype == np.bool_:
        return _made("bool_", len(column), None, _bits(column))
    return _made("string", len(column), None, *_encoded(column.tolist()))


def _made(kind: str, length: int, *buffers: Any) -> Any:
    import pyarrow

    wrapped = [None if buffer is None else pyarrow.py_buffer(buffer) for buffer in buffers]
    return pyarrow.Array.from_buffers(getattr(pyarrow, kind)(), length, wrapped)


def _encoded(values: list[Any]) -> tuple[np.ndarray, bytes]:
    """The offset of each text, and all texts in UTF-8 one behind the other; equal ones are encoded once."""
    try:
        texts = {value: str(value).encode("utf-8") for value in dict.fromkeys(values)}
    except UnicodeEncodeError as error:
        raise WavesweepError(
            f"a name in the table cannot be written as UTF-8 ({error}); rename the spec"
        ) from error
    if len(texts) == 1:  # the usual case, and several times faster
        (text,) = texts.values()
        return np.arange(len(values) + 1, dtype=np.int32) * np.int32(len(text)), text * len(values)
    rows = [texts[value] for value in values]
    offsets = np.zeros(len(rows) + 1, dtype=np.int32)
    np.cumsum(np.fromiter(map(len, rows), np.int32, len(rows)), out=offsets[1:])
    return offsets, b"".join(rows)


def _bits(flags: np.ndarray) -> np.ndarray:
    """Arrow keeps eight flags in a byte, the first one lowest."""
    return np.packbits(flags, bitorder="little")
