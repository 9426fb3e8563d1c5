"""Columns of numbers from CSV files; a file that cannot be used is refused with one message."""

import csv
import hashlib
import json
import re
import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from io import StringIO
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.reading.reading import read_bytes
from wavesweep.program.reading.units import is_unit

LEAST, MOST = 1e-30, 1e30  # sizes of numbers, whose squares and products are then doubles
MOST_COLUMNS = 10_000  # of a log, an export of everything has some hundreds
LETTERS_SHOWN = 60  # letters of a file, or of its name, that a message repeats
MOST_ABOVE = 400  # lines above a header: what a program writes of itself
ROWS_BELOW = 10  # rows of numbers by which a header is known
ANDROID = "---PROFILEDATA---"  # above and below the rows of framestats, of each window
MARKS = {";": "semicolons", "\t": "tabs", " ": "spaces"}
COMMENT = re.compile(r"^\s*#+(?=\s*\w)")  # before the first name, as numpy writes it
UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # that a file in UTF-16 begins with
TRACE = ["command", "time", "event", "trace"]  # columns of what `perf script` and ftrace write
# as in "wall-7 [001] d..2. 9.000120: sched:sched_switch: prev_comm=wall"
EVENT = re.compile(
    r"^ *(\S.*?)(?:\s+|-)\d+(?:/\d+)?\s+(?:\[\d+\]\s+)?(?:[\w.]{4,8}\s+)?(\d+\.\d+):\s+(?:\d+\s+)?(\S+?):(?: +(.*))?$",
    re.MULTILINE,
)
NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1f]")  # letters that no text has


@dataclass(frozen=True, eq=False)
class Csv:
    """A CSV file: the names in its header, the text below it with commas, its SHA-256, and the
    lines above the header."""

    path: str | Path
    names: list[str]
    body: str
    sha256: str
    above: int = 0

    @property
    def listed(self) -> str:
        """The names in the header, for a message."""
        return ", ".join(filter(None, self.names))[:LETTERS_SHOWN] or "nothing"

    def line(self, row: int) -> int:
        """The line of the file that has a row of numbers, counted from 0."""
        filled = (number for number, text in enumerate(self.body.split("\n")) if text.strip())
        return self.above + 2 + next(islice(filled, row, None))

    def cells(self, column: str) -> list[str]:
        """The text of a column in each line, empty where there is none."""
        place = self._place(column)
        rows = rows_of(self.path, self.body.split("\n"))
        return ["".join(row[place : place + 1]).strip() for row in rows]

    def only(self, column: str, value: str) -> "Csv":
        """The file with the lines that have this value in a column; all others are empty."""
        lines = zip(self.body.split("\n"), self.cells(column), strict=False)
        return replace(self, body="\n".join(line * (cell == value) for line, cell in lines))

    def numbers(self, columns: Sequence[str], least: int = 1) -> np.ndarray:
        """The finite numbers of some columns, `(rows, columns)`; other columns may hold texts.

        Errors: UsageError that names the line and the column, or if there are fewer rows than
        `least`.
        """
        places = [self._place(name) for name in columns]
        rows = np.empty((0, len(places)))
        if self.body.strip():
            try:
                rows = np.loadtxt(
                    StringIO(self.body),
                    delimiter=",",
                    ndmin=2,
                    comments=None,
                    usecols=places,
                    quotechar='"',
                )
            except ValueError:
                raise UsageError(
                    self._fault(columns) or f"{self.path}: {_NONE}, found none that can be read"
                ) from None
        # Commas show rows of another length, except where they are within quotes.
        suspect = (
            self.body.count(",") != (len(self.names) - 1) * len(rows) or not np.isfinite(rows).all()
        )
        if suspect and (fault := self._fault(columns)):
            raise UsageError(fault)
        if len(rows) < least:
            expected = "a row" if least == 1 else f"at least {least} rows"
            raise UsageError(
                f"{self.path}: expected {expected} of numbers below the header, found {len(rows) or 'none'}"
            )
        return rows

    def _place(self, name):
        if self.names.count(name) > 1:
            raise UsageError(
                f"{self.path}:{self.above + 1}: {name}: expected one column of this name, found {self.names.count(name)}"
            )
        return self.names.index(name)

    def _fault(self, columns):
        """The message about the first row that cannot be used; empty if there is none."""
        width = len(self.names)
        for number, row in enumerate(
            rows_of(self.path, self.body.split("\n")), start=self.above + 2
        ):
            line = f"{self.path}:{number}"
            if width + 1 < len(row) <= 2 * width and "." not in "".join(row):
                return f"{line}: expected points in numbers, found {','.join(row)[:LETTERS_SHOWN]}; are these decimal commas?"
            if row and len(row) != width:
                return f"{line}: expected {width} values as in the header, found {len(row)}"
            for name in columns if row else ():
                cell = row[self.names.index(name)].strip()
                try:
                    if not np.isfinite(float(cell)):
                        return f"{line}: {name}: expected a finite number, found {cell[:LETTERS_SHOWN]}"
                except ValueError:
                    return f"{line}: {name}: expected a number, found {cell[:LETTERS_SHOWN] or 'nothing'}"
        return ""


def rows_of(path: str | Path, lines: Sequence[str]) -> Iterator[list[str]]:
    """Yield the cells of each line. Errors: UsageError for one that is too long."""
    try:
        yield from csv.reader(lines)
    except csv.Error as error:
        raise _beyond_limit(path, error) from None


def _beyond_limit(path: str | Path, error: csv.Error) -> UsageError:
    return UsageError(
        f"{path}: expected cells of at most {csv.field_size_limit()} letters ({error})"
    )


_NONE = "expected rows of numbers below the header"


def _above_units(path: str | Path, over: list[str], mark: str, units: list[str]) -> list[str]:
    """The names above a row of units, with these behind them in brackets; the row itself without names.
    over: the lines above it."""
    filled = [line for line in over if line.strip()]
    line = COMMENT.sub("", _with_commas(filled[-1], mark)) if filled else ""
    names = [name.strip() for name in next(rows_of(path, [line]), [])]
    if len(names) != len(units):
        return units
    pairs = zip(names, units, strict=True)
    return [f"{name} ({unit.strip('[]()')})" if unit else name for name, unit in pairs]


def read_csv(path: str | Path, most_bytes: int) -> Csv:
    """Read columns of a file of at most `most_bytes` bytes, between commas, semicolons, tabs or spaces, or of JSON.

    The header is the first line whose next ten lines are rows of numbers, with other columns or
    without; what is above it is left out. Between semicolons and tabs a number may have a decimal
    comma. A # before the first name is left out, and a row of units below the names is put behind
    them in brackets.

    Errors: UsageError that names the file.
    """
    data = read_bytes(path, most_bytes)
    text = _decoded(path, data)
    sha256 = hashlib.sha256(data).hexdigest()
    if text.lstrip()[:1] in ("{", "["):
        return _of_json(path, text, sha256)
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if EVENT.search(text, 0, 10_000):  # within what stands at its beginning
        return _of_events(path, text, sha256)
    text = _without_facts(ANDROID.join(text.split(ANDROID)[:2]))
    try:
        above, mark, header = _header(text)
    except csv.Error as error:
        raise _beyond_limit(path, error) from None
    *over, rest = text.split("\n", above)
    line, _, body = rest.partition("\n")
    if line.strip() and body.rstrip("\n").endswith(f"\n{line}"):  # some write it at the end again
        body = body.rstrip("\n").removesuffix(line)
    if (columns := header.count(mark) + 1) > MOST_COLUMNS:
        expected = f"expected at most {MOST_COLUMNS} columns, found {columns}"
        raise UsageError(f"{path}:{above + 1}: {expected}; export those that are needed")
    header = _with_commas(header, mark)
    names = [name.strip() for name in next(rows_of(path, [header]), [])]
    if over and any(names) and all(map(is_unit, names)):
        names = _above_units(path, over, mark, names)
    if names and all(_is_number(name) for name in names):
        raise UsageError(
            f"{path}:{above + 1}: expected a header with the names of the columns, found {header.strip()[:LETTERS_SHOWN]}"
        )
    return Csv(path, names, _with_commas(body, mark), sha256, above)


def _without_facts(text: str) -> str:
    """A text without what stands behind the first row alone, facts of the machine, as OCAT writes
    them, and without their names."""
    lines = text.split("\n", 4)
    rows = [line.split(",") for line in lines[:4]]
    names, first, *later = [*map(len, rows), 0, 0][:4]
    if 1 < min(later) == max(later) < min(names, first):
        lines[:2] = (",".join(row[: later[0]]) for row in rows[:2])
    return "\n".join(lines)


def _of_events(path: str | Path, text: str, sha256: str) -> Csv:
    """The events of a trace as a table, a row for a line; what is no event is an empty line."""
    body = StringIO()
    matches = map(EVENT.match, text.split("\n"))
    csv.writer(body, lineterminator="\n").writerows(
        match.groups() if match else () for match in matches
    )
    return Csv(path, TRACE, body.getvalue(), sha256, above=-1)


def _decoded(path: str | Path, data: bytes) -> str:
    """The text of a file in UTF-8, in UTF-16 or, if it is neither, of Windows in western Europe.

    Errors: UsageError if it is no text.
    """
    code = "utf-16" if data.startswith(UTF_16) else "utf-8-sig"
    for encoding in (code, "cp1252"):
        try:
            text = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        if not NO_TEXT.search(text):
            return text
    raise UsageError(
        f"{path}: expected a CSV file in UTF-8, found bytes that are not text; export it as CSV"
    )


def _header(text: str) -> tuple[int, str, str]:
    """The number of lines above the header, the mark between columns, and the header.

    Of all lines that may be one it is the first of those without a number and with most columns,
    as settings above it have two; the first line with text if there is none.
    """
    lines = text.split("\n", MOST_ABOVE + ROWS_BELOW)
    headers = []
    for above, line in enumerate(lines[:MOST_ABOVE]):
        if not line.strip():
            continue
        below = [candidate for candidate in lines[above + 1 :] if candidate.strip()][:ROWS_BELOW]
        for header, mark in product((COMMENT.sub("", line), line), (",", *MARKS)):
            if _is_header(header, mark, below):
                names = _cells(header, mark)
                headers.append((not any(map(_is_number, names)), len(names), above, mark, header))
                break
    if headers:
        _, _, *best = max(headers, key=lambda candidate: candidate[:2])
        return tuple(best)
    first = next((number for number, line in enumerate(lines) if line.strip()), 0)
    # Without rows that are numbers, what is between the names of its columns.
    header = lines[first]
    marks = [mark for mark in MARKS if mark in header.strip()]
    return first, "," if "," in header or not marks else marks[0], header


def _is_header(line: str, mark: str, below: Sequence[str]) -> bool:
    """Whether a line has names between marks, and the lines below it are rows of numbers."""
    # Without one between names, a comma below a single name may be one between columns.
    if mark != "," and mark not in line.strip():
        return False
    names = _cells(line, mark)
    if mark != "," and len(names) == 1:  # a decimal comma of one column could be two columns
        return False
    if all(_is_number(name.replace(",", ".")) for name in names):
        return False
    rows = [_cells(each, mark) for each in below]
    return bool(rows) and all(_fits(row, names, mark) for row in rows)


def _cells(line: str, mark: str) -> list[str]:
    """The cells of a line; a comma within quotes is none between columns."""
    if mark == " ":
        return line.split()
    if '"' in line:
        return next(csv.reader([line], delimiter=mark), [])
    return line.split(mark)


def _fits(row: Sequence[str], names: Sequence[str], mark: str) -> bool:
    """Whether a row has as many cells as the header has names, and a number among them."""
    cells = row if mark == "," else [cell.replace(",", ".") for cell in row]
    return len(row) == len(names) and any(map(_is_number, cells))


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _with_commas(text: str, mark: str) -> str:
    """A text with commas between columns, and points in numbers."""
    if mark == ",":
        return text
    text = text.replace(",", ".")
    if mark == " ":
        return re.sub(r"(?<=\S)[ \t]+(?=\S)", ",", text)
    return text.replace(mark, ",")


def _of_json(path: str | Path, text: str, sha256: str) -> Csv:
    """The columns of a JSON file: the lists of numbers with names, or a list of objects with
    numbers, which may stand a line each; the part with most columns.

    Errors: UsageError for another file, and for one with several such parts, as of several runs.
    """
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    try:
        if len(lines) > 1 and all(line[0] + line[-1] == "{}" for line in lines[:2]):
            tree = [json.loads(line) for line in lines]  # an object a line
        else:
            tree = json.loads(text)
        tables = list(_tables(tree))
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: expected JSON or CSV, found neither ({error})") from None
    # Beside the columns of a run there may be lists of its sensors, of other lengths.
    widest = max(map(len, tables), default=0)
    tables = [columns for columns in tables if len(columns) == widest]
    if len(tables) != 1:
        expected = "expected JSON with lists of numbers that have names, of one run"
        raise UsageError(f"{path}: {expected}, found {len(tables) or 'none'}")
    names = list(tables[0])
    rows = zip(*tables[0].values(), strict=True)
    body = "\n".join(",".join(map(repr, row)) for row in rows)
    return Csv(path, names, body + "\n", sha256)


def _tables(tree: Any) -> Iterator[dict[str, list[float]]]:
    """Yield the columns of each part of a tree that has some: those of the length that most of
    its lists have."""
    if isinstance(tree, list):
        columns = _columns_of_objects(tree)
        parts = tree
    elif isinstance(tree, dict):
        columns = _columns_of_lists(tree)
        parts = list(tree.values())
    else:
        return
    if columns:
        yield columns
        return
    for part in parts:
        yield from _tables(part)


def _columns_of_objects(rows: list) -> dict[str, list[float]]:
    """The columns of a list of objects, which are its rows: numbers that all of them have."""
    if len(rows) < 2 or not all(isinstance(row, dict) for row in rows):
        return {}
    names = [name for name in rows[0] if all(_is_plain(row.get(name)) for row in rows)]
    return {name: [row[name] for row in rows] for name in names}


def _columns_of_lists(tree: dict[str, Any]) -> dict[str, list[float]]:
    """The lists of numbers of an object, of the length that most of them have."""
    lists = {}
    for name, values in tree.items():
        if isinstance(values, list) and len(values) > 1 and all(map(_is_plain, values)):
            lists[name] = values
    if not lists:
        return {}
    lengths = [len(values) for values in lists.values()]
    usual = max(set(lengths), key=lengths.count)
    return {name: values for name, values in lists.items() if len(values) == usual}


def _is_plain(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def option(name: str, value: str) -> str:
    """NAME=VALUE behind --column, as a shell takes it."""
    return f"--column {shlex.quote(f'{name}={value}')}"


def of_time(name: str, period: float) -> str:
    """What turns times of a column with this many between two rows into s, as a shell takes it."""
    units = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}
    # The first with which rows are as close to each other as in logs and recordings of frames.
    unit = next((unit for unit, factor in units.items() if period * factor < 0.2), "ns")
    return f"--scale {name}={units[unit]:g} if it is in {unit}"


def seconds(time: float) -> str:
    """A time (s) with the digits that tell its row, also if it is a stamp of a clock."""
    # s: times beyond it are stamps of a clock, whose last digits tell the row.
    if abs(time) < 1e6:
        return f"{time:.9g}"
    return f"{time:.6f}"


def pairs(given: Iterable[str], option: str) -> dict[str, str]:
    """The words NAME=VALUE of an option as a mapping. Errors: UsageError for another form."""
    pairs_read = {}
    for text in given:
        name, equals, value = (side.strip() for side in text.partition("="))
        if not (name and equals and value):
            raise UsageError(
                f"{option} {text}: expected NAME=VALUE, e.g. position={'2e-5' if option == '--scale' else 'enc'}"
            )
        pairs_read[name] = value
    return pairs_read


def factors(given: Mapping[str, str]) -> dict[str, float]:
    """The values of an option --scale as factors. Errors: UsageError for one that is no number,
    infinite, 0, or beyond sizes of numbers."""
    found = {}
    for name, text in given.items():
        try:
            found[name] = float(text)
        except ValueError:
            raise UsageError(f"--scale {name}={text}: expected a number, found {text}") from None
        if not LEAST <= abs(found[name]) <= MOST:
            raise UsageError(
                f"--scale {name}={text}: expected a number with a size of {LEAST:g} to {MOST:g}"
            )
    return found
