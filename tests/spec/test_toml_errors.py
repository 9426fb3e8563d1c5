"""What is no TOML is refused in plain words: at its place, with what to write."""

import random
import tomllib

import pytest

from wavesweep.errors import SpecError
from wavesweep.spec import load

VALUE = 'a value: a number, a text in quotes such as "pmw", true, false, a list or a table'
BACKSLASH = "a text in single quotes, in which \\ stands for itself, or \\\\"
DIGITS = "a number in digits without spaces and without zeros before it"
SLIPS = [
    ("[controller]\nkind = pmw-lm # x", "2:8", 'a text in quotes, "pmw-lm", or a number', "pmw-lm"),
    ("[sweep]\nb = { start = 1, stop = 2, scale = log }", "2:36", 'a text in quotes, "log", or a number', "log"),
    ("[block.a]\ndiscrete = True", "2:12", "true in small letters", "True"),
    ("[controller]\nb = 0,5", "2:5", "a number with a point before its decimals, 0.5", "0,5"),
    ("[sweep]\nb = { start = -0,5, stop = 9 }", "2:15", "a number with a point before its decimals, -0.5", "-0,5"),
    ("[device]\nmass = 1,000.5", "2:8", "a number with a point before its decimals", "1,000.5"),
    ("[device]\nmass = 0.1 kg", "2:8", "a number without a unit, 0.1 (keys have fixed units)", "0.1 kg"),
    ("[device]\ndamping = 2N*s/m  # x", "2:11", "a number without a unit, 2 (keys have fixed units)", "2N*s/m"),
    ("[sweep]\nK_VE = { start = 0 N/m, stop = 9 }", "2:18", "a number without a unit, 0 (keys have fixed units)", "0 N/m"),
    ("[device]\nmass = 1\n\nmass = 2", "4:1", "each key once", "mass a second time (first in line 2)"),
    ("[device]\nmass = 1\n[operator]\nmass = 1\nmass = 2", "5:1", "each key once", "mass a second time (first in line 4)"),
    ("[sweep]\nb = { start = 0, start = 9 }", "2:18", "each key once", "start a second time"),
    (
        "[device]\nmass = 1\n[sweep]\n [device]\nmass = 2",
        "4:3",
        "each table once, with all of its keys under its name",
        "[device] a second time (first in line 1)",
    ),
    ("[device]\nmass 1", "2:6", "= behind a key", "1"),
    ("[device]\nmass: 1", "2:5", "= behind a key", ": 1"),
    ("[device]\nm\u00e4sse = 1", "2:1", "a key of the letters a to z, digits, _ and -", "m\u00e4sse = 1"),
    ("[device]\nmass =", "2:7", VALUE, "nothing"),
    ("[device]\nmass = Infinity", "2:8", VALUE, "Infinity"),
    ("[device]\nmass = .1", "2:8", "a digit before the point, 0.1", ".1"),
    ("[device]\nmass = 1.", "2:8", "a digit behind the point, 1.0", "1."),
    ("[device]\nmass = 1e", "2:8", "a number with digits behind its e", "1e"),
    ("[device]\nmass = 01", "2:8", DIGITS, "01"),
    ("[device]\nmass = 1 000", "2:8", DIGITS, "1 000"),
    ("[device]\nmass = - 1", "2:8", "a sign next to its number", "- 1"),
    ("[device]\nmass = \u22121", "2:8", "the minus sign -", "\u22121"),
    ("[controller]\nkind = \u201cpmw\u201d", "2:8", "straight quotes, \" or '", "\u201cpmw\u201d"),
    ("[device]\nmass = 1 // kg", "2:8", "a comment that begins with #", "1 // kg"),
    ("[block.a]\nk = 2*a", "2:5", 'an expression in quotes, "2*a" for example, or a number', "2*a"),
    ("[device]\nmass = 1 damping = 2", "2:8", "one key in a line", "1 damping ="),
    ("[device] mass = 1", "1:10", "nothing behind the name of a table; its keys stand in lines of their own", "mass = 1"),
    ("[device\nmass = 1", "1:8", "] behind the name of a table", "the end of the line"),
    ('[controller]\nkind = "pmw', "2:12", "quotes at the end of a text", "the end of the line"),
    ('[simulate]\nrecord = "C:\\data"', "2:13", BACKSLASH, "a single \\"),
    ("[sweep]\nb = [1; 2]", "2:7", "a comma between the values of a list, or ] at its end", "; 2]"),
    ("[sweep]\nb = [1 2]", "2:8", "a comma between the values of a list, or ] at its end", "2]"),
    ("[sweep]\nb = { start = 0 stop = 9 }", "2:15", "a comma between the keys of a table", "0 stop ="),
    ("[sweep]\nb = { start = 0,\nstop = 9 }", "2:17", "a table in braces in one line", "the end of the line"),
]


@pytest.mark.parametrize(("text", "place", "expected", "found"), SLIPS)
def test_a_slip_is_said_in_plain_words(text, place, expected, found, write):
    with pytest.raises(SpecError) as error:
        load(write(f"{text}\n"))
    assert str(error.value) == f"a.toml:{place}: expected {expected}, found {found}"


@pytest.mark.slow
def test_any_slip_is_one_line_with_a_place_in_the_text(write):
    """Texts with a character more, less or another."""
    whole = '[device]\nmass = 0.1 # kg\n[sweep]\nb = [1, 2.5]\nK_VE = { start = 0, stop = "x" }\n'
    dice, seen = random.Random(5), 0  # noqa: S311 - no secret
    for _ in range(1000):
        at = dice.randrange(len(whole))
        text = whole[:at] + dice.choice(["", *"[]{}=,.\"'#\\ \n\x01\u00e90a-"]) + whole[at + dice.randrange(2) :]
        try:
            tomllib.loads(text)
        except tomllib.TOMLDecodeError:
            with pytest.raises(SpecError) as error:
                load(write(text))
            (mistake,) = error.value.mistakes
            line, column = map(int, mistake.location.split(":")[1:])
            assert 1 <= column <= len(text.split("\n")[line - 1]) + 1
            assert str(error.value).isprintable()
            seen += 1
    assert seen > 250
