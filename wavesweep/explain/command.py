"""`wavesweep explain`: words of the program, and what to do about them."""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from textwrap import wrap
from typing import NamedTuple

import click
from click.shell_completion import CompletionItem

from wavesweep.engine.drawing import TYPES
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import nearest
from wavesweep.explain.words import MESSAGES, TERMS
from wavesweep.program.cli.entry import COMMANDS, verbosity
from wavesweep.program.cli.messages import width
from wavesweep.program.reading.keys import SYMBOLS
from wavesweep.program.spec import find_key
from wavesweep.program.spec.describing import EVERY_KEY
from wavesweep.program.tables.fields import DOUBTS, OF_ALONG, OF_WALL, Field, all_columns

MOST_TABLES = 4  # tables that have a column
GROUPS = {
    "doubt": "Words of doubt",
    "term": "Ideas",
    "message": "Messages",
    "value": "Values in columns",
}


class Entry(NamedTuple):
    """One meaning of a word. group: one of `GROUPS`, or "column of ..."; its words are spelt as the user meets them."""

    word: str
    group: str
    meaning: str
    advice: str = ""


def _completed(
    context: click.Context, parameter: click.Parameter, incomplete: str
) -> list[CompletionItem]:
    """The words that begin with what is typed."""
    del context, parameter
    meanings = {entry.word: entry.meaning for entry in reversed(entries())}
    return [
        CompletionItem(word, help=meaning)
        for word, meaning in meanings.items()
        if word.startswith(incomplete)
    ]


@click.command("explain")
@click.argument("words", metavar="[WORD]...", nargs=-1, shell_complete=_completed)
def explain(words: tuple[str, ...]) -> None:
    """Explain a word of doubt, a column, a value in one, or a message: what it means, and what to do.

    Without a WORD all words are listed. A word may have several meanings, as certified in several
    tables; each is explained. Keys of a spec are explained by `wavesweep keys`. With --json the
    meanings are printed as one JSON object.

    \b
    Examples:
      wavesweep explain crowded
      wavesweep explain felt_low
      wavesweep explain swept range ends
    """
    matches = explained(" ".join(words)) if words else entries()
    if verbosity().as_json:
        listed: dict[str, list[dict[str, str]]] = {}
        for entry in matches:
            listed.setdefault(entry.word, []).append(entry._asdict())
        click.echo(json.dumps(listed, indent=2))
        return
    if not words:
        click.echo("\n".join(_list(matches)))
        return
    lines: list[str] = []
    for entry in matches:
        lines += _lines(entry)
    click.echo("\n".join(lines))


@cache
def entries() -> tuple[Entry, ...]:
    """All meanings of all words, those of one group together."""
    found = [Entry(word, "doubt", *doubt) for word, doubt in DOUBTS.items() if word]
    for names, meaning in TERMS.items():
        found += [Entry(word, "term", meaning) for word in names.split(", ")]
    for names, text in MESSAGES.items():
        found += [Entry(word, "message", *text) for word in names.split(", ")]
    values = {}  # a meaning that several columns have in common stands once
    for field, tables in _columns().items():
        found.append(Entry(field.name, f"column of {_some(tables)}", _meaning(field), field.advice))
        for word, meaning in field.values.items():
            said = f"in the column {field.name}: {meaning}"
            values[word, meaning] = Entry(word, "value", said, field.advice)
    return (*found, *values.values())


def _columns() -> dict[Field, list[str]]:
    """Each column with the tables that have it; the same column of several tables is one."""
    tables_of: dict[Field, list[str]] = {}
    for table, fields in all_columns().items():
        for field in fields:
            tables_of.setdefault(replace(field, optional=False), []).append(table)
    return tables_of


def _some(tables: list[str]) -> str:
    """The names of tables, of many the first."""
    if len(tables) <= MOST_TABLES:
        shown = tables
    else:
        shown = [*tables[: MOST_TABLES - 1], "..."]
    return ", ".join(shown)


def _meaning(field: Field) -> str:
    """The meaning of a column with its unit."""
    units = {
        OF_ALONG: "in the unit of the axis",
        OF_WALL: "in the unit of the wall's stiffness",
        "1": "",
        "": "",
    }
    kinds = {"boolean": "1 or 0", "integer": "a whole number"}
    kind_and_unit = ", ".join(
        filter(None, (kinds.get(field.kind, ""), units.get(field.unit, field.unit)))
    )
    if kind_and_unit:
        return f"{field.description} ({kind_and_unit})"
    return field.description


def explained(word: str) -> tuple[Entry, ...]:
    """All meanings of a word. Errors: UsageError for an unknown one, with the nearest."""
    for alike in (str, _plain):
        if matches := tuple(entry for entry in entries() if alike(entry.word) == alike(word)):
            return matches
    if word in COMMANDS:
        return (
            Entry(
                word, "command", COMMANDS[word], f"`wavesweep {word} --help` explains its options."
            ),
        )
    if key := find_key(word):
        return (
            Entry(
                word,
                "key of a spec",
                key.description,
                f"`wavesweep keys {word}` has its values and its default.",
            ),
        )
    if word in TYPES:
        return (
            Entry(
                word,
                "type of block",
                TYPES[word].description,
                f"`wavesweep keys block.{word}` has its ports and keys.",
            ),
        )
    meant = nearest(
        word, [*(entry.word for entry in entries()), *COMMANDS, *EVERY_KEY, *SYMBOLS, *TYPES]
    )
    if meant:
        hint = f"did you mean {meant}?"
    else:
        hint = "`wavesweep explain` lists all words, `wavesweep keys` those of a spec"
    raise UsageError(f"{word}: expected a word that is explained, found another one; {hint}")


def _plain(word: str) -> str:
    return word.casefold().replace("-", " ").replace("_", " ").strip("'\"`().")


def _lines(entry: Entry) -> Iterator[str]:
    """An entry in at most five lines."""
    of = {"doubt": "word of doubt", "term": "", "message": "in a message", "value": ""}.get(
        entry.group, entry.group
    )
    yield from _wrapped(f"{entry.word}{f' ({of})' if of else ''}: {entry.meaning}", "  ")
    if entry.advice:
        yield from _wrapped(f"  {entry.advice}", "  ")


def _wrapped(text: str, indent: str) -> list[str]:
    return wrap(
        text, width(), subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def _list(found: tuple[Entry, ...]) -> Iterator[str]:
    """All words in groups, each once; a column stands with the first table that has it."""
    groups: dict[str, list[str]] = {}
    for entry in found:
        name = GROUPS.get(entry.group) or entry.group.partition(",")[0].replace("column", "Columns")
        if entry.word not in (word for words in groups.values() for word in words):
            groups.setdefault(name, []).append(entry.word)
    for name, words in groups.items():
        yield from _wrapped(f"{name}: {', '.join(words)}", "  ")
    yield "`wavesweep explain WORD` explains one of them, `wavesweep keys KEY` a key of a spec."
