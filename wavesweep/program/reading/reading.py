"""Reading: from a file, a dict or `--set` arguments to tables, with the place of each value.

tomllib keeps no positions. They are searched for only if a mistake is reported, in a text that is
known to be valid TOML. Lists are skipped as a whole: their elements have the position of the list.
"""

from __future__ import annotations

import codecs
import os
import re
import stat
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache

from wavesweep.engine.errors import Mistake, SpecError, UsageError
from wavesweep.engine.keys import FORMULA, VALUE_WORDS, Place
from wavesweep.program.platform_compat import READ
from wavesweep.program.reading.keys import SYMBOLS
from wavesweep.program.reading.toml_errors import syntax_mistake

UTF_8 = "text in UTF-8 (save the file in this encoding)"
MOST_NAMES = 64  # in a dotted key; tomllib takes quadratic time and memory for more

# Patterns are compiled where they are used: most runs report no mistake.
PASSED = r"-|/dev/stdin|/dev/fd/(\d+)"  # files that are open already
_STRING = (
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
)
_TOKEN = rf"(?s)(?P<name>{_STRING}|[A-Za-z0-9_-]+)|#[^\n]*|[ \t]+|."
_LONG_KEY = rf"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){{{MOST_NAMES}}}"


@dataclass(frozen=True, slots=True)
class TomlPlace(Place):
    """Place in a TOML text, whose line is searched for only if it is needed; name: of the file."""

    def location(self, of_key: bool = False) -> str:
        """Return `file:line:column` of the value here or of its key."""
        line, column = locate(self.text, self.path, of_key)
        return f"{self.name}:{line}:{column}"

    def inside(self, offset: int) -> str:
        """Return `file:line:column` of the character at that offset of the text that is the
        value here."""
        if not self.exact:
            return self.location()
        line, column = locate(self.text, self.path)
        rest = self.text.split("\n")[line - 1][column - 1 :]
        one_line = rest[:1] in ("'", '"') and rest[:3] not in ("'''", '"""')
        return f"{self.name}:{line}:{column + 1 + offset if one_line else column}"


def read_file(path: str) -> tuple[dict, Place]:
    """Return the tables of a TOML file and its place.

    Errors: UsageError if the file cannot be read or is too large, SpecError if it is not text in
    UTF-8 or not TOML.
    """
    # A hundred thousand numbers or more, read in about a second.
    content = read_bytes(path, 2_000_000)
    try:
        text = content.removeprefix(codecs.BOM_UTF8).decode().replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        before = error.object[: error.start]
        line = before.count(b"\n") + 1
        column = len(before[before.rfind(b"\n") + 1 :].decode()) + 1
        text_found = f"byte {error.object[error.start]:#04x}"
        raise SpecError([Mistake(f"{path}:{line}:{column}", "", UTF_8, text_found)]) from error
    long_key = re.search(_LONG_KEY, text)
    if long_key:
        line = text.count("\n", 0, long_key.start()) + 1
        expected = f"at most {MOST_NAMES} names in a key"
        raise SpecError([Mistake(f"{path}:{line}:1", "", expected, "more")])
    try:
        return tomllib.loads(text), TomlPlace(path, text=text)
    except RecursionError as error:
        raise SpecError([Mistake(path, "", "a TOML file", "values nested too deeply")]) from error
    except ValueError as error:
        # TOMLDecodeError, or what int() says of a number with thousands of digits
        raise SpecError([syntax_mistake(text, str(error), path)]) from error


def read_bytes(path: str | os.PathLike, most_bytes: int) -> bytes:
    """Return the content of a file of at most `most_bytes` bytes; never wait for a pipe, and never read a
    device.

    Errors: UsageError naming the path.
    """
    try:
        if passed := re.fullmatch(PASSED, os.fspath(path)):
            content = _passed(int(passed[1] or 0), most_bytes)
        else:
            # Without blocking: to open a named pipe waits for somebody who writes to it.
            descriptor = os.open(path, READ)
            try:
                mode = os.fstat(descriptor).st_mode
                if not stat.S_ISREG(mode):
                    kind = "folder" if stat.S_ISDIR(mode) else "pipe or a device"
                    raise UsageError(f"{path}: expected a file, found a {kind}")
                # Not by the size that the system names, which is 0 for files of /proc.
                with os.fdopen(descriptor, "rb", closefd=False) as stream:
                    content = stream.read(most_bytes + 1)
            finally:
                os.close(descriptor)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # a path that no file can have
        raise UsageError(f"{path!r}: cannot be read: {error}") from error
    if len(content) > most_bytes:
        raise UsageError(f"{path}: expected at most {most_bytes / 1e6:g} MB, found more")
    return content


@cache
def _passed(number: int, most_bytes: int) -> bytes:
    """Return the content of a file that is open already, stdin or what a shell passes for
    `<(...)`; it can be read once."""
    with os.fdopen(number, "rb", closefd=False) as stream:
        return stream.read(most_bytes + 1)


def read_override(
    typed: str, symbols: Mapping[str, str] = SYMBOLS
) -> tuple[tuple[str, ...], object, Place]:
    """Return path, value and place of `controller.b=40`, `b=40` or `sweep.b=[20, 40]`.

    The value is read as TOML. If it is not TOML it is a string, so that `controller.kind=pmw` needs
    no quotes. symbols: short names of paths.
    """
    place = Place("--set " + " ".join(typed.split()))
    name, equals, value = (side.strip() for side in typed.partition("="))
    path = _key_path(name)
    if not equals or not path:
        text_found = "no key" if equals else "no `=`"
        raise SpecError([Mistake(place.location(), "", "key=value", text_found)])
    if len(path) == 1:
        path = symbols.get(path[0], path[0]).split(".")
    table = _loads_or_none(f"value = {value}")
    is_value = isinstance(table, dict) and set(table) == {"value"}
    return tuple(path), table["value"] if is_value else value, place


def _key_path(name: str) -> list[str]:
    """Return the parts of a dotted key of TOML."""
    table = None if "\n" in name else _loads_or_none(f"{name} = 0")
    path = []
    while isinstance(table, dict) and len(table) == 1:
        segment, table = table.popitem()
        path.append(segment)
    if table == 0:
        return path
    # no key that TOML could have; a later stage says so, with the names that it could have been
    return name.split(".") if name else []


def _loads_or_none(text: str) -> dict | None:
    """The tables of a text; None if it is not TOML."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return None


def file_stem(path: str) -> str:
    """Return the file's name without folder and suffix: the spec's name, which is a label in tables
    and folders.

    Errors: UsageError for a name that a spreadsheet would run as a formula, that readers of tables
    take for a missing number or another value, or that cannot be printed.
    """
    passed = re.fullmatch(PASSED, path)
    if passed:
        return f"fd{passed[1]}" if passed[1] else "stdin"
    stem = os.path.splitext(os.path.basename(path))[0]  # noqa: PTH119, PTH122 - pathlib takes half of the time of loading
    if stem.startswith(FORMULA) or not stem.isprintable() or stem.lower() in VALUE_WORDS:
        expected = (
            "a name that is printable, does not begin with = + - @, which spreadsheets run as formulas, and is no value, as "
            "nan, inf, none, null, na, true and false are to readers of tables"
        )
        raise UsageError(
            f"the spec's file name: expected {expected}, found {stem!a}; rename the file"
        )
    return stem


KEY, EQUALS, VALUE = "key", "=", "value"  # what is read of a pair: EQUALS comes before its value


@dataclass(slots=True)
class _Scanner:
    """What is found in a valid TOML text, token after token.

    positions: offsets of keys and of their values, by path. table: path of the table that is read;
    around: those of the tables around it, if it is an inline one. names: of the key that is read,
    from the offset `start` on. lists: how deep the token is in lists, which are passed over.
    """

    positions: dict[tuple[str, ...], tuple[int, int]] = field(default_factory=dict)
    table: tuple[str, ...] = ()
    around: list[tuple[str, ...]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)
    start: int = 0
    lists: int = 0
    part: str = KEY

    def read(self, word: str, offset: int, is_name: bool) -> None:
        """Read a token that is neither a space nor a comment."""
        if self.lists:
            self.lists += (word == "[") - (word == "]")
        elif self.part == EQUALS:
            if word != "\n":
                self._read_value(word, offset)
        elif self.part == KEY:
            self._read_key(word, offset, is_name)
        else:
            self._read_end(word)

    def _read_key(self, word: str, offset: int, is_name: bool) -> None:
        """Read a part of a key, or of the name of a table in brackets."""
        if is_name:
            if not self.names:
                self.start = offset
            quoted = word[0] in "\"'"
            self.names.append(tomllib.loads(f"key = {word}")["key"] if quoted else word)
        elif word == "[":
            self.table = ()
        elif word == "]" and self.names:
            self._record(self.start)
            self.table = tuple(self.names)
            self.names = []
        elif word == "=":
            self.part = EQUALS
        else:
            self._read_end(word)

    def _read_value(self, word: str, offset: int) -> None:
        """Read the first token of a value; that of an inline table begins another key."""
        self._record(offset)
        self.part = VALUE
        if word == "[":
            self.lists = 1
        elif word == "{":
            self.around.append(self.table)
            self.table = (*self.table, *self.names)
            self.names = []
            self.part = KEY

    def _read_end(self, word: str) -> None:
        """Read what may end a pair, or an inline table."""
        if word == "}" and self.around:
            self.table = self.around.pop()
            self.part = VALUE
        elif word == ("," if self.around else "\n"):
            self.names = []
            self.part = KEY

    def _record(self, value: int) -> None:
        """Keep the offset of the key and of its value; also of the tables that a dotted key makes
        on its way, of which the value is the key."""
        if len(self.table) >= 16:  # tables nested deeper than any key are stepped over
            return
        for length in range(1, len(self.names)):
            path = (*self.table, *self.names[:length])
            self.positions.setdefault(path, (self.start, self.start))
        self.positions.setdefault((*self.table, *self.names), (self.start, value))


@lru_cache(maxsize=1)
def scan(text: str) -> dict[tuple[str, ...], tuple[int, int]]:
    """Return the offsets of every table, key and inline key of a valid TOML text, and of its value,
    by path.

    The value of a table is its own name. Of a table that is written several times the first place
    counts.
    """
    scanner = _Scanner()
    for token in re.finditer(_TOKEN, text):
        word = token[0]
        is_space = word.isspace() and word != "\n"
        if not is_space and word[0] != "#":
            scanner.read(word, token.start(), bool(token["name"]))
    return scanner.positions


def locate(text: str, path: tuple[str, ...], of_key: bool = False) -> tuple[int, int]:
    """Return line and column, both from 1, of the value at `path` (or of its key), or of the
    nearest table above it."""
    positions = scan(text)
    for length in range(len(path), 0, -1):
        if path[:length] in positions:
            key, value = positions[path[:length]]
            offset = key if of_key or length < len(path) else value
            return text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
    return 1, 1
