"""How the program speaks: --quiet, --json and --debug, which belong to every command."""

from collections.abc import Sequence
from typing import NamedTuple

import click


class Verbosity(NamedTuple):
    """How the program speaks, whatever the command: options that may stand anywhere in the line.

    words: the whole line after the program's name.
    """

    words: Sequence[str] = ()
    quiet: bool = False
    as_json: bool = False
    debug: bool = False

    @classmethod
    def of(cls, words: Sequence[str]) -> tuple["Verbosity", list[str]]:
        """Take these options out of a line; the words that are left are those of the group and of the command."""
        end = words.index("--") if "--" in words else len(words)
        spelt = {"quiet": ("-q", "--quiet"), "as_json": ("--json",), "debug": ("--debug",)}
        wanted = {name: any(word in spellings for word in words[:end]) for name, spellings in spelt.items()}
        left = [word for word in words[:end] if not any(word in spellings for spellings in spelt.values())]
        return cls(tuple(words), **wanted), [*left, *words[end:]]


def verbosity() -> Verbosity:
    """How the running command speaks."""
    return click.get_current_context().find_root().obj or Verbosity()
