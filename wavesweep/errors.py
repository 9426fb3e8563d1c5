"""What can go wrong, in words for users, and the exit code that goes with it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass


class WavesweepError(Exception):
    """A run failed for a reason that its text explains; base of every error raised on purpose."""

    exit_code = 1


class UsageError(WavesweepError):
    """What was asked for cannot be done: a wrong flag, file or number."""

    exit_code = 2


class IllPosedLoopError(WavesweepError):
    """An algebraic loop has no solution, or none that double precision can find."""


class CheckpointError(UsageError):
    """A half-finished run on disk is damaged or belongs to another spec."""


@dataclass(frozen=True, slots=True)
class Mistake:
    """One mistake of a spec: where it stands, which key it concerns, what was expected and what was found.

    `location` is `file:line:column`, `--set key=value`, or empty for a spec that is not text; `key` is empty where the
    text is not TOML at all; `suggestion` is the nearest name that would have been right, or empty.
    """

    location: str
    key: str
    expected: str
    found: str
    suggestion: str = ""

    def __str__(self) -> str:
        where = [part for part in (self.location, self.key) if part]
        problem = f"expected {self.expected}, found {self.found}"
        hint = f"; did you mean `{self.suggestion}`?" if self.suggestion else ""
        return ": ".join([*where, problem]) + hint


class SpecError(UsageError):
    """A spec with mistakes: all of them at once, a line each."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        return "\n".join(map(str, self.mistakes))
