"""Reading: from a file, a dict or `--set` arguments to tables, with the place of each value.

tomllib keeps no positions. They are searched for only if a mistake is reported, in a text that is known to be valid TOML,
so only as much of the grammar is read as is needed to skip strings, comments and nested values. Arrays are skipped as a
whole: their elements have the position of the array.
"""

from __future__ import annotations

import codecs
import os
import re
import stat
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from wavesweep.errors import Mistake, SpecError, UsageError
from wavesweep.platform_compat import READ
from wavesweep.spec.keys import SYMBOLS
from wavesweep.spec.toml_errors import syntax_mistake

# Compiled where they are used: most runs report no mistake.
DEEPEST = 16  # inline tables nested deeper than any key are stepped over
MOST_BYTES = 2_000_000  # of a spec: a hundred thousand numbers or more, read in about a second
UTF_8 = "text in UTF-8 (save the file in this encoding)"
MOST_NAMES = 64  # in a dotted key; tomllib takes quadratic time and memory for more

PASSED = r"-|/dev/stdin|/dev/fd/(\d+)"  # files that are open already
VALUE_WORDS = ("nan", "inf", "infinity", "none", "null", "na", "true", "false")  # in any case of letters
FORMULA = ("=", "+", "-", "@")
_BLANK = r"(?:[ \t\n]|#[^\n]*)*"
_STRING = (
    r'"""(?:\\.|[^\\])*?"""(?:"{0,2})'
    r"|'''.*?'''(?:'{0,2})"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
)
_SEGMENT = rf"(?s)[ \t]*({_STRING}|[A-Za-z0-9_-]+)[ \t]*(\.?)"
_SCALAR = rf"(?s){_STRING}|[^,\]}}#\n]+"
# Each text is walked once, valid or not: a string that is not closed ends with its line, or with the text.
_ANY_STRING = r'"""(?:\\.|[^\\"]|"(?!""))*+(?:"{3,5})?|"(?:\\.|[^"\\\n])*+"?' + r"|'''(?:[^']|'(?!''))*+(?:'{3,5})?|'[^'\n]*+'?"
_NAME = rf"(?:{_ANY_STRING}|[A-Za-z0-9_-]++)"
_MORE = rf"[ \t]*+\.[ \t]*+{_NAME}"
_LONG_KEY = rf"(?s)#[^\n]*+|{_NAME}(?:{_MORE}){{0,{MOST_NAMES - 1}}}+(?P<more>{_MORE})?"
_IN_BRACKETS = rf"(?s){_STRING}|#[^\n]*|[^\[\]{{}}\"'#]+|[\[\]{{}}]"


@dataclass(frozen=True, slots=True)
class Place:
    """Place of a value: at a path of a TOML text, whose line is searched for only if it is needed, or in an override.

    name: of the file, or the override as it was typed; empty for a dict, which has no lines. text: of the file, None without
    one. exact: whether the value is as it stands in the text, so that offsets in it are those of the file.
    """

    name: str = ""
    text: str | None = None
    path: tuple[str, ...] = ()
    exact: bool = True

    def location(self, of_key: bool = False) -> str:
        """Return the prefix of a mistake's line, for the value here or for its key; empty without a text."""
        if self.text is None:
            return self.name
        line, column = locate(self.text, self.path, of_key)
        return f"{self.name}:{line}:{column}"

    def inside(self, offset: int) -> str:
        """Return the prefix of a mistake's line, for the character at that offset of the text that is the value here."""
        if self.text is None or not self.exact:
            return self.location()
        line, column = locate(self.text, self.path)
        rest = self.text.split("\n")[line - 1][column - 1 :]
        one_line = rest[:1] in ("'", '"') and rest[:3] not in ("'''", '"""')
        return f"{self.name}:{line}:{column + 1 + offset if one_line else column}"

    def under(self, path: tuple[str, ...]) -> Place:
        """Return the place of another path of the same source."""
        return Place(self.name, self.text, path, self.exact)

    def parent(self) -> Place:
        """Return the place of the table around this value."""
        return self.under(self.path[:-1])


@dataclass(frozen=True, slots=True)
class Leaf:
    """A value as given, with its place."""

    value: object
    place: Place

    def mistake(self, key: str, expected: str, found: str, suggestion: str = "", of_key: bool = False) -> Mistake:
        """Return the mistake made by this value or, if `of_key`, by its key."""
        return Mistake(self.place.location(of_key), key, expected, found, suggestion)


def read_file(path: str) -> tuple[dict, Place]:
    """Return the tables of a TOML file and its place.

    Errors: UsageError if the file cannot be read or is too large, SpecError if it is not text in UTF-8 or not TOML.
    """
    content = read_bytes(path, MOST_BYTES)
    try:
        text = content.removeprefix(codecs.BOM_UTF8).decode().replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        before = error.object[: error.start]
        line, column = before.count(b"\n") + 1, len(before[before.rfind(b"\n") + 1 :].decode()) + 1
        wide = content.startswith((codecs.BOM_UTF16_BE, codecs.BOM_UTF16_LE))
        found = "UTF-16" if wide else f"byte {error.object[error.start]:#04x}"
        raise SpecError([Mistake(f"{path}:{line}:{column}", "", UTF_8, found)]) from error
    return _parse(text, path), Place(path, text)


def read_bytes(path: str | os.PathLike, most: int) -> bytes:
    """Return the content of a file of at most `most` bytes; never wait for a pipe, and never read a device.

    Errors: UsageError naming the path.
    """
    try:
        if passed := re.fullmatch(PASSED, os.fspath(path)):
            return _within(_passed(int(passed[1] or 0), most), path, most)
        # Without blocking: to open a named pipe waits for somebody who writes to it.
        descriptor = os.open(path, READ)
        try:
            mode = os.fstat(descriptor).st_mode
            if not stat.S_ISREG(mode):
                raise UsageError(f"{path}: expected a file, found a {'folder' if stat.S_ISDIR(mode) else 'pipe or a device'}")
            # Not by the size that the system names, which is 0 for files of /proc.
            with os.fdopen(descriptor, "rb", closefd=False) as stream:
                content = stream.read(most + 1)
        finally:
            os.close(descriptor)
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:  # a path that no file can have
        raise UsageError(f"{path!r}: cannot be read: {error}") from error
    return _within(content, path, most)


def _within(content: bytes, path: str | os.PathLike, most: int) -> bytes:
    if len(content) > most:
        raise UsageError(f"{path}: expected at most {most / 1e6:g} MB, found more")
    return content


@cache
def _passed(number: int, most: int) -> bytes:
    """Return the content of a file that is open already, stdin or what a shell passes for `<(...)`; it can be read once."""
    with os.fdopen(number, "rb", closefd=False) as stream:
        return stream.read(most + 1)


def _parse(text: str, name: str) -> dict:
    for match in re.finditer(_LONG_KEY, text):
        if match["more"]:
            line = text.count("\n", 0, match.start()) + 1
            raise SpecError([Mistake(f"{name}:{line}:1", "", f"at most {MOST_NAMES} names in a key", "more")])
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise SpecError([Mistake(name, "", "a TOML file", "values nested too deeply")]) from error
    except ValueError as error:  # TOMLDecodeError, or what int() says of a number with thousands of digits
        raise SpecError([_unlike_text(text, name) or syntax_mistake(text, str(error), name)]) from error


def _unlike_text(text: str, name: str) -> Mistake | None:
    """Return the mistake of a file with bytes of 0, as UTF-16 has, or with a number of too many digits; None for any other."""
    for pattern, expected in (("\0", UTF_8), (r"\d{4301,}", "a number of fewer digits")):
        if match := re.search(pattern, text):
            before = text[: match.start()]
            line, column = before.count("\n") + 1, match.start() - before.rfind("\n")
            found = "a byte of 0, as in UTF-16" if pattern == "\0" else f"{len(match[0])} digits"
            return Mistake(f"{name}:{line}:{column}", "", expected, found)
    return None


def read_dict(tables: Mapping) -> dict:
    """Return nested tables as plain dicts, lists and Python numbers."""
    return {str(key): plain(value) for key, value in tables.items()}


def plain(value: object) -> object:
    """Return one value, or a table of them, as plain Python types, without tuples, ranges, numpy types and other mappings."""
    if isinstance(value, Mapping):
        return read_dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, range) and len(value[: MOST_BYTES + 1]) <= MOST_BYTES:  # a longer one is no list of a spec
        return list(value)
    return value


def read_override(typed: str, symbols: Mapping[str, str] = SYMBOLS) -> tuple[tuple[str, ...], object, Place]:
    """Return path, value and place of `controller.b=40`, `b=40` or `sweep.b=[20, 40]`.

    The value is read as TOML. If it is not TOML it is a string, so that `controller.kind=pmw` needs no quotes. symbols: short
    names of paths.
    """
    place = Place("--set " + " ".join(typed.split()))
    name, equals, value = typed.partition("=")
    path = _override_path(name.strip(), symbols)
    if not equals or not path:
        raise SpecError([Mistake(place.location(), "", "key=value", "no key" if equals else "no `=`")])
    table = _loads_or_none(f"value = {value.strip()}")
    return path, table["value"] if isinstance(table, dict) and set(table) == {"value"} else value.strip(), place


def _override_path(name: str, symbols: Mapping[str, str]) -> tuple[str, ...]:
    path, table = [], None if "\n" in name else _loads_or_none(f"{name} = 0")
    while isinstance(table, dict) and len(table) == 1:
        segment, table = table.popitem()
        path.append(segment)
    if table != 0:  # no key that TOML could have; a later stage says so, with the names that it could have been
        path = name.split(".") if name else []
    return tuple(symbols.get(path[0], path[0]).split(".")) if len(path) == 1 else tuple(path)


def _loads_or_none(text: str) -> dict | None:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return None


def file_stem(path: str) -> str:
    """Return the file's name without folder and suffix: the spec's name, which is a label in tables and folders.

    Errors: UsageError for a name that a spreadsheet would run as a formula, that readers of tables take for a missing number or
    another value, or that cannot be printed.
    """
    if passed := re.fullmatch(PASSED, path):
        return f"fd{passed[1]}" if passed[1] else "stdin"
    stem = os.path.splitext(os.path.basename(path))[0]  # noqa: PTH119, PTH122 - pathlib takes half of the time of loading
    if stem.startswith(FORMULA) or not stem.isprintable():
        found = ascii(stem)
        expected = "a name that is printable and does not begin with = + - @, which spreadsheets run as formulas"
        raise UsageError(f"the spec's file name: expected {expected}, found {found}; rename the file")
    if stem.lower() in VALUE_WORDS:
        expected = "a name that is no value, as nan, inf, none, null, na, true and false are to readers of tables"
        raise UsageError(f'the spec\'s file name: expected {expected}, found "{stem}"; rename the file')
    return stem


@dataclass(frozen=True, slots=True)
class Position:
    """Offsets of a key and of its value; a table's value is its own name."""

    key: int
    value: int


@lru_cache(maxsize=1)
def scan(text: str) -> dict[tuple[str, ...], Position]:
    """Return the first position of every table, key and inline key of a valid TOML text, by path."""
    positions: dict[tuple[str, ...], Position] = {}
    table: tuple[str, ...] = ()
    at = _skip_blank(text, 0)
    while at < len(text):
        if text[at] == "[":
            at = _skip_blank(text, at + (2 if text.startswith("[[", at) else 1))
            table, end = _read_key(text, at)
            _record(positions, (), table, at, at)
            at = text.find("\n", end) + 1 or len(text)
        else:
            at = _read_pair(text, at, table, positions)
        at = _skip_blank(text, at)
    return positions


def locate(text: str, path: tuple[str, ...], of_key: bool = False) -> tuple[int, int]:
    """Return line and column, both from 1, of the value at `path` (or of its key), or of the nearest table above it."""
    positions = scan(text)
    for length in range(len(path), 0, -1):
        position = positions.get(path[:length])
        if position is not None:
            offset = position.key if of_key or length < len(path) else position.value
            return text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
    return 1, 1


def _skip_blank(text: str, at: int) -> int:
    return re.compile(_BLANK).match(text, at).end()


def _record(positions: dict, table: tuple, keys: tuple, key_at: int, value_at: int) -> None:
    for length in range(1, len(keys)):  # the tables that a dotted key makes on its way
        positions.setdefault(table + keys[:length], Position(key_at, key_at))
    positions.setdefault(table + keys, Position(key_at, value_at))


def _read_key(text: str, at: int) -> tuple[tuple[str, ...], int]:
    """Return the names of a dotted key, and the offset behind it."""
    names, more = [], True
    while more and (match := re.compile(_SEGMENT).match(text, at)):
        name = match[1]
        names.append(tomllib.loads(f"key = {name}")["key"] if name[0] in "\"'" else name)
        at, more = match.end(), bool(match[2])
    return tuple(names), at


def _read_pair(text: str, at: int, table: tuple, positions: dict) -> int:
    """Record a key and those of its inline table, and return the offset behind the value."""
    keys, end = _read_key(text, at)
    value_at = _skip_blank(text, text.index("=", end) + 1)
    _record(positions, table, keys, at, value_at)
    if text[value_at] not in "[{":
        return re.compile(_SCALAR).match(text, value_at).end()
    if text[value_at] == "[" or len(table + keys) >= DEEPEST:
        depth = 0
        for match in re.compile(_IN_BRACKETS).finditer(text, value_at):
            depth += (match[0] in ("[", "{")) - (match[0] in ("]", "}"))
            if depth == 0:
                return match.end()
        return len(text)
    inner = _skip_blank(text, value_at + 1)
    while text[inner] != "}":
        inner = _skip_blank(text, _read_pair(text, inner, table + keys, positions))
        if text[inner] == ",":
            inner = _skip_blank(text, inner + 1)
    return inner + 1
