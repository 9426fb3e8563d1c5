"""From a file, a dict and `--set` arguments to tables, before anything in them is understood."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping

from wavesweep.errors import Mistake, SpecError, UsageError
from wavesweep.spec.keys import SYMBOLS
from wavesweep.spec.places import InFile, OnCommandLine, Place

_SYNTAX_ERROR = re.compile(
    r"(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)", re.DOTALL
)


def read_file(path: str) -> tuple[dict, Place]:
    """Return the tables of a TOML file and its place.

    Raises UsageError where the file cannot be read, SpecError where it is not TOML.
    """
    try:
        with open(path, "rb") as stream:  # noqa: PTH123 - pathlib would be half of the time that loading takes
            text = stream.read().decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise UsageError(
            f"{path}: expected UTF-8 text, found byte {error.object[error.start]:#04x} at offset {error.start}"
        ) from error
    except OSError as error:
        raise UsageError(f"{path}: cannot read the spec: {error.strerror or error}") from error
    except ValueError as error:  # a path that no file can have
        raise UsageError(f"{path!r}: cannot read the spec: {error}") from error
    return _parse(text, path), InFile(path, text)


def _parse(text: str, name: str) -> dict:
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise SpecError([Mistake(name, "", "a TOML file", "values nested too deeply")]) from error
    except ValueError as error:  # TOMLDecodeError, or what int() says of a number with thousands of digits
        raise SpecError([_syntax_mistake(str(error), text, name)]) from error


def _syntax_mistake(message: str, text: str, name: str) -> Mistake:
    match = _SYNTAX_ERROR.fullmatch(message)
    if match is None:
        return Mistake(f"{name}:1:1", "", "a TOML file", _lower(message))
    end = (text.count("\n") + 1, len(text) - text.rfind("\n"))
    line, column = (match["line"], match["column"]) if match["line"] else end
    return Mistake(f"{name}:{line}:{column}", "", "a TOML file", _lower(match["what"]))


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def read_dict(tables: Mapping) -> dict:
    """Return nested tables as plain dicts, lists and Python numbers (numpy's scalars and arrays know `tolist`)."""
    return {str(key): plain(value) for key, value in tables.items()}


def plain(value: object) -> object:
    """Return one value, or a table of them, without tuples, numpy types and other people's mappings."""
    if isinstance(value, Mapping):
        return read_dict(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value


def read_override(typed: str) -> tuple[tuple[str, ...], object, Place]:
    """Return path, value and place of `controller.b=40`, `b=40` or `sweep.b=[20, 40]`.

    The value is read as TOML; what is not TOML is a string, so that `controller.kind=pmw` needs no quotes.
    """
    place = OnCommandLine(typed)
    name, equals, value = typed.partition("=")
    path = _override_path(name.strip())
    if not equals or not path:
        raise SpecError([Mistake(place.location(), "", "key=value", "no key" if equals else "no `=`")])
    return path, _override_value(value.strip()), place


def _override_path(name: str) -> tuple[str, ...]:
    path, table = [], _loads_or_none(f"{name} = 0")
    while isinstance(table, dict) and len(table) == 1:
        segment, table = table.popitem()
        path.append(segment)
    if table != 0:  # no key that TOML could have; a later stage says so, with the names that it could have been
        path = name.split(".") if name else []
    return tuple(SYMBOLS.get(path[0], path[0]).split(".")) if len(path) == 1 else tuple(path)


def _override_value(value: str) -> object:
    table = _loads_or_none(f"value = {value}")
    return table["value"] if isinstance(table, dict) and set(table) == {"value"} else value


def _loads_or_none(text: str) -> dict | None:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError):
        return None


def file_stem(path: str) -> str:
    """Return the file's name without folder and suffix: the spec's name."""
    return os.path.splitext(os.path.basename(path))[0]  # noqa: PTH119, PTH122 - as above, without pathlib
