"""Mistakes in the syntax of TOML, in plain words: the text found, and the text to write in its
place.

tomllib stops at the first one, and its message says which part of the grammar it was reading. The
line itself shows the rest.
"""

import re

from wavesweep.engine.errors import Mistake

_MESSAGE = r"(?s)(?P<what>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end of document)\)"
_NUMBER = r"(?<![\w.])[+-]?\d[\d_]*(?:\.\d+)?(?:[eE][+-]?\d+)?"
_UNIT = r"(?!e\b)[A-Za-z%°µμΩ][^\s,\]}#=]*+(?!\s*=)"
VALUE = 'a value: a number, a text in quotes such as "pmw", true, false, a list or a table'
# Slips, each a pattern of the line about the place at which tomllib stops, and what is expected in
# place of it.
_SLIPS = (
    (r"(?<![\w.,])[+-]?\d+,\d(?:[\d.,]*\d)?", "a number with a point before its decimals"),
    (
        rf"{_NUMBER}\s*{_UNIT}(?: *[*/^] *{_UNIT})*",
        "a number without a unit (keys have fixed units)",
    ),
    (rf"{_NUMBER}\s*[-+*/^(][^#\n]*", 'a number, or an expression in quotes, "2*a" for example'),
    (r"=\s*(True|False|TRUE|FALSE)\b", "true or false in small letters"),
    (r"=\s*((?!inf\b|nan\b)[A-Za-z_][\w.-]*)", "a number, or a text in quotes"),
    (r"=\s*([-+.\d\u2212][^,\]}#=\n]*+)(?!=)", "a number in digits, as 0.5 or 1e-3"),
)
# The beginning of tomllib's words, and what is expected.
_WORDS = (
    ("invalid value", VALUE),
    ("expected '='", "= behind a key of the letters a to z, digits, _ and -"),
    ("expected newline", "the end of the line behind a value or the name of a table"),
    ("expected ']'", "] behind the name of a table"),
    ("unclosed array", "a comma between the values of a list, or ] at its end"),
    (
        "unclosed inline table",
        "a comma between the keys of a table, or } at its end in the same line",
    ),
    ("invalid initial", "a key; a table in braces stands in one line"),
    ("unescaped", "a text in single quotes, in which \\ stands for itself, or \\\\"),
    ("illegal character '\\n'", "quotes at the end of a text"),
    ("unterminated string", "quotes at the end of a text"),
)


def syntax_mistake(text: str, message: str, name: str) -> Mistake:
    """Return the mistake of a text in TOML's syntax. message: tomllib's; name: of the file."""
    match = re.fullmatch(_MESSAGE, message)
    if not match:  # but what int() says of a number
        start = re.search(r"[\d_]{4300,}", text).start()
        line = text.count("\n", 0, start) + 1
        column = start - text.rfind("\n", 0, start)
        expected = "a number of at most 4300 digits"
        return Mistake(f"{name}:{line}:{column}", "", expected, "more")
    reading = match["what"].removeprefix("Found ")
    reading = reading[:1].lower() + reading[1:]
    line = text.count("\n") + 1
    column = len(text) - text.rfind("\n")
    if match["line"]:
        line = int(match["line"])
        column = int(match["column"])
    here = text.split("\n")[line - 1]
    rest = re.match(r"[^#]*", here[column - 1 :])[0].strip() or "the end of the line"
    expected = next((expected for words, expected in _WORDS if reading.startswith(words)), "")
    if any(word in reading for word in ("overwrite", "duplicate", "twice", "mutate")):
        inner = re.search(r"'([^']+)'", reading)
        twice = inner[1] if inner else here.partition("=")[0].strip()
        column = here.rfind(twice, 0, column) + 1 or column
        expected = "each key and each table once"
        rest = f"{twice} a second time"
    elif len(here) <= 1000 and (slip := _slip_at(here, column)):  # longer lines are not examined
        column, expected, rest = slip
    problem = _shortened(rest if expected else reading)
    return Mistake(f"{name}:{line}:{column}", "", expected or "a TOML file", problem)


def _slip_at(line: str, column: int) -> tuple[int, str, str] | None:
    """The first usual slip that reaches a column of a line: its own column, what was expected,
    and its text."""
    for pattern, expected in _SLIPS:
        for slip in re.finditer(pattern, line):
            start, stop = slip.span(slip.lastindex or 0)
            if start < column <= stop + 1:
                return start + 1, expected, line[start:stop].strip()
    return None


def _shortened(text: str) -> str:
    """The text in at most 60 printable characters."""
    text = text if text.isprintable() else ascii(text)
    if len(text) <= 60:
        return text
    return f"{text[:57]}..."
