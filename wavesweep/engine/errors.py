"""Errors with texts for users, and their exit codes."""

import re
from collections.abc import Iterable
from typing import NamedTuple

LETTERS_OF_WORD = 400  # letters of what was given, as a message repeats it
LETTERS_OF_MESSAGE = 2000  # letters of a message, as a screen has them

MOST_LINES = 50  # of the mistakes of a spec


def shortened(text: str) -> str:
    """The text with the middle of each word and line left out that is too long to be read."""
    for pattern, limit in ((r"\S", LETTERS_OF_WORD), (".", LETTERS_OF_MESSAGE)):
        text = re.sub(
            f"({pattern}{{{limit // 4}}}){pattern}{{{limit // 2},}}({pattern}{{{limit // 4}}})",
            r"\1...\2",
            text,
        )
    return text


class WavesweepError(Exception):
    """A run failed for the reason in the text; base class of all errors that are raised on purpose."""

    exit_code = 1

    def __str__(self) -> str:
        return shortened(super().__str__())


class UsageError(WavesweepError):
    """A request is not possible: a wrong option, file or number."""

    exit_code = 2


class IllPosedLoopError(WavesweepError):
    """An algebraic loop has no solution, or none that double precision can find.

    chunk: number of the part of a run in which there is such a loop, None if it is no part of one.
    """

    chunk: int | None = None


class Mistake(NamedTuple):
    """One mistake of a spec: its place, its key, the expected value and the value found.

    `location` is `file:line:column`, the place of a value in words, or empty if the spec is not
    text. `key` is empty if the text is not TOML at all. `suggestion` is the nearest correct name,
    or empty.
    """

    location: str
    key: str
    expected: str
    found: str
    suggestion: str = ""

    def __str__(self) -> str:
        where = [text for text in (self.location, self.key) if text]
        problem = f"expected {self.expected}, found {self.found}"
        hint = f"; did you mean `{self.suggestion}`?" if self.suggestion else ""
        return ": ".join([*where, problem]) + hint


class SpecError(UsageError):
    """A spec with mistakes: all of them in `mistakes`, and one line each, up to MOST_LINES, as the text."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        unlisted = len(self.mistakes) - MOST_LINES
        lines = [
            *map(str, self.mistakes[:MOST_LINES]),
            *([f"and {unlisted} more mistakes"] if unlisted > 0 else []),
        ]
        return shortened("\n".join(lines))
