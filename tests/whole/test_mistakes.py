"""All mistakes of a spec are said at once, each with place, key, expectation, finding and the nearest right name.

The tables in `mistakes/` hold specs and what is said of each. A case is a paragraph: a line `OLD => NEW` changes the text of
the base that the last line `base NAME` has chosen, `--set` gives an override, `> ` begins a line that is said, and all other
lines are added to the text. With `WAVESWEEP_UPDATE=1` in the environment, the tables are written anew.
"""

import math
import os
import pathlib
import random
import tomllib

import pytest
from support.drawn import ARM, DRIVE, PD, WALL

from wavesweep.designs.wish_keys import WISHES
from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._keys.checking import show
from wavesweep.engine.errors import SpecError
from wavesweep.haptics.controllers import CONTROLLERS
from wavesweep.program.spec import KEYS, load
from wavesweep.program.spec.shipped_classes import shipped_classes

FOLDER = pathlib.Path(__file__).parent / "mistakes"
BASES = {path.stem: path.read_text(encoding="utf-8") for path in FOLDER.glob("*.toml")}
BASES |= {kind: f'[controller]\nkind = "{kind}"\n' for kind in ("pmw", "pmw-lm")} | {"nothing": ""}
BASES |= {"ARM": ARM, "DRIVE": DRIVE, "PD": PD, "WALL": WALL}
LISTS = {  # so that a new controller, type or wish changes no table
    ", ".join(map(show, CONTROLLERS)): "(controllers)",
    ", ".join(map(show, (*TYPES, *shipped_classes()))): "(types of blocks)",
    ", ".join(WISHES): "(wishes)",
    ", ".join(name for name, kind in WISHES.items() if kind.ports is not None): "(wishes of drawn loops)",
}


def said(base, case, write):
    """The lines that are said of a case."""
    text, added, overrides = BASES[base], [], []
    for line in case:
        old, arrow, new = f"{line} ".partition(" => ")
        if arrow:
            old, new = (part.replace("\\n", "\n") for part in (old, new[:-1]))
            assert old in text
            text = text.replace(old, new)
        elif line.startswith("--set "):
            overrides.append(line.removeprefix("--set ").replace("\\n", "\n"))
        else:
            added.append(line)
    with pytest.raises(SpecError) as error:
        load(write("\n".join([text, *added] if added and not text.endswith("\n") else [text + "\n".join(added)])), overrides)
    lines = str(error.value)
    for names, short in LISTS.items():
        lines = lines.replace(names, short)
    return [f"> {line}" for line in lines.splitlines()]


def cases():
    """File, base and lines of each case, with the number of its line."""
    for path in sorted(FOLDER.glob("*.txt")):
        base, number = "", 1
        for paragraph in path.read_text(encoding="utf-8").rstrip("\n").split("\n\n"):
            if paragraph.startswith("base "):
                base = paragraph.removeprefix("base ")
            else:
                yield pytest.param(base, paragraph.split("\n"), id=f"{path.stem}-{number}")
            number += paragraph.count("\n") + 2


@pytest.mark.parametrize(("base", "lines"), list(cases()))
def test_each_mistake_is_said_at_its_place(base, lines, write):
    given = [line for line in lines if not line.startswith("> ")]
    assert said(base, given, write) == lines[len(given) :]


@pytest.mark.skipif("WAVESWEEP_UPDATE" not in os.environ, reason="writes the tables of mistakes anew")
def test_update(write):
    for path in FOLDER.glob("*.txt"):
        base, paragraphs = "", []
        for paragraph in path.read_text(encoding="utf-8").rstrip("\n").split("\n\n"):
            given = [line for line in paragraph.split("\n") if not line.startswith("> ")]
            if paragraph.startswith("base "):
                base = paragraph.removeprefix("base ")
            else:
                given += said(base, given, write)
            paragraphs.append("\n".join(given))
        path.write_text("\n\n".join(paragraphs) + "\n", encoding="utf-8")


@pytest.mark.parametrize("value", [math.nan, 10**400, True, None, [], {"a": 1}, object()])
def test_hostile_values_are_refused_for_every_key(value):
    for path in KEYS:
        *parents, last = path.split(".")
        tables = {"controller": {"kind": "pmw"}}
        inner = tables
        for parent in parents:
            inner = inner.setdefault(parent, {})
        inner[last] = value
        with pytest.raises(SpecError) as error:
            load(tables)
        assert any(mistake.key in (path, ".".join(parents)) for mistake in error.value.mistakes)
        assert all(mistake.location == "" for mistake in error.value.mistakes)


@pytest.mark.slow
def test_any_slip_of_syntax_is_one_line_with_a_place_in_the_text(write):
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
