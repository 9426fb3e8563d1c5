"""Columns of numbers from CSV files; a file that cannot be used is refused with one message."""

import csv
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.reading.reading import read_bytes

LEAST, MOST = 1e-30, 1e30  # sizes of numbers, whose squares and products are then doubles
MOST_COLUMNS = 10_000  # of a log, an export of everything has some hundreds
SHOWN = 60  # letters of a file that a message repeats


@dataclass(frozen=True, eq=False)
class Csv:
    """A CSV file: the names in its header, the text below it, its SHA-256, and the blank lines above the header."""

    path: str | Path
    names: list[str]
    body: str
    sha256: str
    above: int = 0

    @property
    def listed(self) -> str:
        """The names in the header, for a message."""
        return ", ".join(filter(None, self.names))[:SHOWN] or "nothing"

    def numbers(self, columns: Sequence[str], least: int = 1) -> np.ndarray:
        """The finite numbers of some columns, `(rows, columns)`; other columns may hold texts.

        Errors: UsageError that names the line and the column, or if there are fewer rows than `least`.
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
            _rows(self.path, self.body.splitlines()), start=self.above + 2
        ):
            line = f"{self.path}:{number}"
            if width + 1 < len(row) <= 2 * width and "." not in "".join(row):
                return f"{line}: expected points in numbers, found {','.join(row)[:SHOWN]}; are these decimal commas?"
            if row and len(row) != width:
                return f"{line}: expected {width} values as in the header, found {len(row)}"
            for name in columns if row else ():
                cell = row[self.names.index(name)].strip()
                try:
                    if not np.isfinite(float(cell)):
                        return f"{line}: {name}: expected a finite number, found {cell[:SHOWN]}"
                except ValueError:
                    return f"{line}: {name}: expected a number, found {cell[:SHOWN] or 'nothing'}"
        return ""


def _rows(path: str | Path, lines: Sequence[str]) -> Iterator[list[str]]:
    try:
        yield from csv.reader(lines)
    except csv.Error as error:
        raise UsageError(
            f"{path}: expected cells of at most {csv.field_size_limit()} letters ({error})"
        ) from None


_NONE = "expected rows of numbers below the header"


def read_csv(path: str | Path, most: int) -> Csv:
    """Read a CSV file of at most `most` bytes. Errors: UsageError that names the file."""
    data = read_bytes(path, most)
    text = data.decode("utf-8-sig", "replace")
    if "\0" in text or "\ufffd" in text:
        raise UsageError(
            f"{path}: expected a CSV file in UTF-8, found bytes that are not text; export it as CSV"
        )
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    above = len(text) - len(text.lstrip("\n"))
    header, _, body = text.lstrip("\n").partition("\n")
    for mark, word in ((";", "semicolons"), ("\t", "tabs"), (" ", "spaces")):
        if mark in header.strip() and "," not in header:
            expected = "expected commas between columns and points in numbers"
            raise UsageError(
                f"{path}:{above + 1}: {expected}, found {word}; export it again with commas"
            )
    if (columns := header.count(",") + 1) > MOST_COLUMNS:
        expected = f"expected at most {MOST_COLUMNS} columns, found {columns}"
        raise UsageError(f"{path}:{above + 1}: {expected}; export those that are needed")
    names = [name.strip() for name in next(_rows(path, [header]), [])]
    if names and all(name.replace(".", "").lstrip("-").isdigit() for name in names):
        raise UsageError(
            f"{path}:{above + 1}: expected a header with the names of the columns, found {header.strip()[:SHOWN]}"
        )
    return Csv(path, names, body, hashlib.sha256(data).hexdigest(), above)


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
    """The values of an option --scale as factors. Errors: UsageError for one that is no number, infinite, or 0."""
    found = {}
    for name, text in given.items():
        try:
            found[name] = float(text)
        except ValueError:
            raise UsageError(f"--scale {name}={text}: expected a number, found {text}") from None
        if not 0 < abs(found[name]) < float("inf"):
            raise UsageError(f"--scale {name}={text}: expected a finite number that is not 0")
    return found
