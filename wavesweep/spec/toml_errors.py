"""Mistakes in the syntax of TOML, in plain words: the text found, and the text to write in its place.

tomllib stops at the first one, and its message says which part of the grammar it was reading. The line itself shows the rest.
"""

import re
from typing import NamedTuple

from wavesweep.errors import Mistake

_MESSAGE = r"(?s)(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)"
_NUMBER = r"[+-]?\d[\d_]*(?:\.\d+)?(?:[eE][+-]?\d+)?"
_KEY = r"(?:[A-Za-z0-9_.-]|\"[^\"\n]*\"|'[^'\n]*')+"
_UNIT = r"[A-Za-z%°µμΩ][^\s,\]}#]*"
VALUE = 'a value: a number, a text in quotes such as "pmw", true, false, a list or a table'
LONGEST_LINE = 1000  # longer lines are not examined
QUOTES = "\u201c\u201d\u201e\u2018\u2019"


class SyntaxMistake(NamedTuple):
    """Line and column of a mistake, from 1, the text expected and the text found."""

    line: int
    column: int
    expected: str
    found: str


def syntax_mistake(text: str, message: str, name: str) -> Mistake:
    """Return the mistake of a text in TOML's syntax. message: tomllib's; name: of the file."""
    match = re.fullmatch(_MESSAGE, message)
    if match is None:
        return Mistake(f"{name}:1:1", "", "a TOML file", _lower(message))
    end = (text.count("\n") + 1, len(text) - text.rfind("\n"))
    line, column = (int(match["line"]), int(match["column"])) if match["line"] else end
    what = _lower(match["what"]).removeprefix("found ")
    lines = text.split("\n")
    before, after = lines[line - 1][: column - 1], lines[line - 1][column - 1 :]
    plain = SyntaxMistake(line, column, "a TOML file", f"other text: {what}" if what.startswith("expected") else what)
    slip = plain
    if len(lines[line - 1]) <= LONGEST_LINE:
        slip = (
            _stray_comma(line, column, after, what)
            or _twice(lines, line, before, what)
            or _in_number(line, before, after, what)
            or _in_text(line, column, before, after, what)
            or _in_value(line, column, after, what)
            or _in_statement(line, column, before, after, what)
            or plain
        )
    found = slip.found if slip.found.isprintable() else ascii(slip.found)
    return Mistake(f"{name}:{slip.line}:{slip.column}", "", slip.expected, found if len(found) <= 60 else f"{found[:57]}...")


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def _stray_comma(line: int, column: int, after: str, what: str) -> SyntaxMistake | None:
    """A comma behind a value, as other formats have it between keys."""
    if what.startswith("expected newline") and re.fullmatch(r",\s*(#.*)?", after):
        return SyntaxMistake(line, column, "the end of the line behind the value", "a comma")
    return None


def _twice(lines: list[str], line: int, before: str, what: str) -> SyntaxMistake | None:
    """A key or a table that is given a second time."""
    here = lines[line - 1]
    if header := re.match(rf"\s*\[+\s*({_KEY})", here):
        if "twice" not in what and "overwrite" not in what:
            return None
        first = _line_of(lines[: line - 1], rf"\s*\[+\s*{re.escape(header[1])}\s*\]")
        found = f"[{header[1]}] a second time{first}"
        return SyntaxMistake(line, header.start(1) + 1, "each table once, with all of its keys under its name", found)
    if "overwrite" not in what and "duplicate" not in what:
        return None
    inner = re.search(r"'(.*)'", what)
    name = inner[1] if inner else re.match(rf"\s*({_KEY})", here)[1]
    table = max((at for at in range(line) if lines[at].lstrip().startswith("[")), default=0)
    first = "" if inner else _line_of(lines[: line - 1], rf"\s*{re.escape(name)}\s*=", table)
    column = before.rfind(name) if inner else here.index(name)
    return SyntaxMistake(line, column + 1, "each key once", f"{name} a second time{first}")


def _line_of(lines: list[str], pattern: str, start: int = 0) -> str:
    """Words for the line at which a pattern is found first; empty if it is not."""
    return next((f" (first in line {at + 1})" for at in range(start, len(lines)) if re.match(pattern, lines[at])), "")


def _in_number(line: int, before: str, after: str, what: str) -> SyntaxMistake | None:
    """A decimal comma, a unit or a sign of an expression behind a number that is read already."""
    token = re.search(r"[^\s=,\[{]*\s*$", before)[0]
    column = len(before) - len(token) + 1
    if comma := re.search(r"(?<![\w.,])([+-]?\d+,\d+)$", before):  # in a table: what follows is read as a key
        return _comma(line, comma.start() + 1, comma[1])
    if not re.fullmatch(_NUMBER, token.strip()):
        return None
    whole, alone = token + after, what.startswith("expected newline")  # not in a list, nor in a table in braces
    if comma := re.match(rf"{_NUMBER},\d[\d.,]*", whole):
        return _comma(line, column, comma[0])
    if alone and re.match(r"\s*\d", after):
        expected = "a number in digits without spaces and without zeros before it"
        return SyntaxMistake(line, column, expected, re.match(r"[-+\s\d.]*", whole)[0].strip())
    for pattern, expected in (
        (r"\S+\s*//.*", "a comment that begins with #"),
        (r"\S+\.(?!\d)\S*", f"a digit behind the point, {token.strip()}.0"),
        (r"\d+[eE](?=\s|$)", "a number with digits behind its e"),
        (rf"{_NUMBER}\s+{_KEY}\s*=", "one key in a line" if alone else "a comma between the keys of a table"),
        (rf"{_NUMBER}\s*{_UNIT}(?: *[*/^] *{_UNIT})*", f"a number without a unit, {token.strip()} (keys have fixed units)"),
        (rf"{_NUMBER}\s*[-+*/^(][^#\n]*", 'an expression in quotes, "2*a" for example, or a number'),
    ):
        if match := re.match(pattern, whole):
            return SyntaxMistake(line, column, expected, match[0].strip())
    return None


def _comma(line: int, column: int, found: str) -> SyntaxMistake:
    meant = f", {found.replace(',', '.')}" if re.fullmatch(r"[+-]?\d+,\d+", found) else ""
    return SyntaxMistake(line, column, f"a number with a point before its decimals{meant}", found)


def _in_text(line: int, column: int, before: str, after: str, what: str) -> SyntaxMistake | None:
    """A text that does not end, or that has a backslash."""
    if what == "illegal character '\\n'" or (what.startswith("unterminated") and not after):
        return SyntaxMistake(line, column, "quotes at the end of a text", "the end of the line")
    if what.startswith("unescaped"):
        expected = "a text in single quotes, in which \\ stands for itself, or \\\\"
        return SyntaxMistake(line, before.rfind("\\") + 1, expected, "a single \\")
    return None


def _in_value(line: int, column: int, after: str, what: str) -> SyntaxMistake | None:
    """A value that TOML does not have."""
    if what != "invalid value":
        return None
    value = re.match(r"[^,\]}#\n]*", after)[0].strip()
    for pattern, expected in (
        (r"(?i)(true|false)", f"{value.lower()} in small letters"),
        (r"(?!(?i:infinity|nan|inf)$)[A-Za-z_][\w.-]*", f'a text in quotes, "{value}", or a number'),
        (rf"[{QUOTES}].*", "straight quotes, \" or '"),
        ("\u2212.*", "the minus sign -"),
        (r"[+-]\s.*", "a sign next to its number"),
        (r"[+-]?\.\d.*", f"a digit before the point, {value.replace('.', '0.', 1)}"),
    ):
        if re.fullmatch(pattern, value):
            return SyntaxMistake(line, column, expected, value)
    return SyntaxMistake(line, column, VALUE, value or "nothing")


_STATEMENTS = (  # tomllib's words and the line before, and what was expected
    ("expected '='", "", "= behind a key"),
    ("expected newline", r"\s*\[", "nothing behind the name of a table; its keys stand in lines of their own"),
    ("expected ']'", "", "] behind the name of a table"),
    ("unclosed array", "", "a comma between the values of a list, or ] at its end"),
    ("unclosed inline table", "", "a comma between the keys of a table, or } at its end in the same line"),
)


def _in_statement(line: int, column: int, before: str, after: str, what: str) -> SyntaxMistake | None:
    """A mistake at a key, a table's name, or the end of a list."""
    rest = re.match(r"[^#]*", after)[0].strip() or "the end of the line"
    if what.startswith("expected '='") and not after[:1].isascii():
        word = re.search(r"\S*$", before)[0]
        return SyntaxMistake(line, column - len(word), "a key of the letters a to z, digits, _ and -", word + rest)
    if what.startswith("invalid initial character") and not after.strip():
        return SyntaxMistake(line, column, "a table in braces in one line", rest)
    expectations = (expected for words, start, expected in _STATEMENTS if what.startswith(words) and re.match(start, before))
    return next((SyntaxMistake(line, column, expected, rest) for expected in expectations), None)
