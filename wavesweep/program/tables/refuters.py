"""The column `counterexample`: what refutes the values beyond the ends of an interval. Here alone it is written, and read from a table."""

import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from textwrap import shorten
from types import MappingProxyType
from typing import Any, NamedTuple

LONGEST_REFUTER_TEXT = 60  # letters of a pattern in a sentence; the table has all of it
_FRAME = r"\d+(?: \([^)]*\))?"  # ticks of a frame, and what else is said of it
_FRAMES = rf"{_FRAME}(?:, {_FRAME})*"
_FATE = r"\d+|(?:\d+ )?lost"  # of a message, or of some that are lost in a row
_PATTERN = re.compile(r"(?:^|, )(frames|messages|ticks of) (.*)")
_INNER = re.compile(r"\(([^()]*)\)(?: x (\d+))?")  # of a pattern with its repetitions counted
NOTHING: Mapping[str, Any] = MappingProxyType({})
LINEAR_WALL = "the linear wall"  # which is one of those that push
BELOW, FROM = "below: ", "; from: "  # before what refutes each end, if both are refuted


class Refuter(NamedTuple):
    """What refutes a value: a member of a set, and a pattern that is repeated in it for ever.

    numbers: of the member, by name, as texts. frames: their ticks, and what becomes of their results, "" if that
    is not said. messages: of each channel, by how many ticks they are late, None of one that is lost.
    ticks: their times (ms), as texts. wall: the wall of which it is, in words.
    """

    numbers: Mapping[str, str] = NOTHING
    frames: Sequence[tuple[int, str]] = ()
    messages: Mapping[str, Sequence[int | None]] = NOTHING
    ticks: Sequence[str] = ()
    wall: str = ""

    @classmethod
    def read(cls, text: str) -> "Refuter":
        """What a text says. Errors: ValueError for one that is no member and no whole pattern."""
        if text.startswith(f"{LINEAR_WALL}, "):
            return cls.read(text.removeprefix(f"{LINEAR_WALL}, "))._replace(wall=LINEAR_WALL)
        pattern = _PATTERN.search(text)
        before = text[: pattern.start()] if pattern else text
        equations = [part.partition(" = ") for part in before.split(", ") if part]
        numbers = {name: value for name, _, value in equations}
        if not all(equals for _, equals, _ in equations):
            raise ValueError(text)
        kind, said = pattern.groups() if pattern else ("", "")
        if kind == "frames" and (frames := re.match(_FRAMES, said)) and not said.endswith("..."):
            pairs = re.findall(r"(\d+)(?: \(([^)]*)\))?", frames[0])
            return cls(numbers, frames=[(int(ticks), result) for ticks, result in pairs])
        if kind == "messages":
            channels = (channel.partition(": ") for channel in said.split("; "))
            return cls(numbers, messages={name: _messages_in(late) for name, _, late in channels})
        if kind == "ticks of":
            return cls(numbers, ticks=_ticks_in(said.removesuffix(" ms")))
        if pattern or not numbers:
            raise ValueError(text)
        return cls(numbers)

    def __str__(self) -> str:
        parts = [self.wall] if self.wall else []
        parts += [f"{name} = {value}" for name, value in self.numbers.items()]
        if self.frames:
            frames = (
                f"{ticks} ({result})" if result else f"{ticks}" for ticks, result in self.frames
            )
            parts.append(f"frames {', '.join(frames)}")
        if self.messages:
            channels = (
                f"{name}: {', '.join(_fates(late))}" for name, late in self.messages.items()
            )
            parts.append(f"messages {'; '.join(channels)}")
        if self.ticks:
            parts.append(f"ticks of {repeated([*self.ticks])} ms")
        return ", ".join(parts)


def _messages_in(told: str) -> list[int | None]:
    """By how many ticks the messages of a channel are late. Errors: ValueError."""
    late: list[int | None] = []
    for fate in told.split(", "):
        if not re.fullmatch(_FATE, fate):
            raise ValueError(told)
        count = int(fate.removesuffix("lost") or 1)
        late += [count] if fate.isdigit() else [None] * count
    return late


def _fates(late: Sequence[int | None]) -> Iterator[str]:
    """Yield what happens to the messages of a channel, as [simulate] takes it: those that are lost in a row are counted."""
    for ticks, run in groupby(late):
        count = len(list(run))
        if ticks is not None:
            yield from [f"{ticks}"] * count
        else:
            yield f"{count} lost" if count > 1 else "lost"


def _ticks_in(pattern: str) -> list[str]:
    """The times of a pattern whose repetitions are counted, each tick by itself. Errors: ValueError."""

    def written_out(inner: re.Match[str]) -> str:
        return ", ".join(_ticks_in(inner[1]) * int(inner[2] or 1))

    while _INNER.search(pattern):
        pattern = _INNER.sub(written_out, pattern)
    ticks = []
    for run in pattern.split(", "):
        time, _, count = run.partition(" x ")
        float(time)
        ticks += [time] * int(count or 1)
    return ticks


class Refuters(NamedTuple):
    """What refutes the values beyond the low and the high end of an interval, in words; empty where nothing does."""

    low: str
    high: str

    def written(self, longest: int) -> str:
        """The text of the column, with so many letters at most."""
        if not (self.low and self.high):
            return shorten(self.low or self.high, longest, placeholder=" ...")
        half = longest // 2 - len(f"; {BELOW}")
        low, high = (shorten(text, half, placeholder=" ...") for text in self)
        return f"{BELOW}{low}{FROM}{high}"

    @classmethod
    def read(cls, text: str) -> "Refuters":
        """What a text of the column says. A single refuter is given for both ends; other columns say for which it is."""
        if not text.startswith(BELOW):
            return cls(text, text)
        low, _, high = text.removeprefix(BELOW).partition(FROM)
        return cls(low, high)


def in_a_sentence(refuter: str) -> str:
    """A refuter for a sentence: of a pattern that is repeated the runs, and no more letters than LONGEST_REFUTER_TEXT;
    of a wall the frames of the motion, one for each point of its curve."""
    wall, of_curve, curve = refuter.partition(" through (")
    if of_curve:
        return f"{wall} and a motion of {curve.count(')')} frames"
    before, _, text = refuter.partition("frames ")
    frames = re.match(_FRAMES, text)
    if frames:
        pattern = re.findall(_FRAME, frames[0])
        return f"{before}frames {_shown(pattern)}{text[frames.end() :]}"
    numbers, of_messages, messages = refuter.partition("messages ")
    if not of_messages:
        return refuter
    patterns = []
    for channel in messages.split("; "):
        name, _, told = channel.partition(": ")
        patterns.append(f"{name}: {_shown([_message(message) for message in told.split(', ')])}")
    return f"{numbers}messages of {'; of '.join(patterns)}"


def _shown(pattern: list[str]) -> str:
    """A pattern with the repetitions in it counted; the first of many, and their number."""
    said = repeated(pattern)
    if len(said) <= LONGEST_REFUTER_TEXT:
        return said
    shown = pattern
    while len(said) > LONGEST_REFUTER_TEXT:
        shown = shown[:-1]
        said = f"{repeated(shown)}, ... ({len(pattern)} in all)"
    return said


def repeated(pattern: list[str]) -> str:
    """A pattern with its repetitions counted: `16, 16, 16, 33` is `16 x 3, 33`, and `16, 33, 33, 33`
    is `16, (33 x 3)`, since `16, 33 x 3` would be read as `(16, 33) x 3`."""
    for length in range(1, len(pattern) // 2 + 1):
        times, rest = divmod(len(pattern), length)
        if not rest and pattern[:length] * times == pattern:
            said = repeated(pattern[:length])
            if length > 1:
                return f"({said}) x {times}"
            return f"{said} x {times}"
    parts: list[str] = []
    for symbol, run in groupby(pattern):
        count = len(list(run))
        # Three equal frames in a row are counted; two are written.
        if count < 3:
            parts += [symbol] * count
        else:
            parts.append(f"({symbol} x {count})" if parts else f"{symbol} x {count}")
    return ", ".join(parts)


def _message(late: str) -> str:
    if not late.isdigit():
        return late
    if int(late):
        return f"{late} tick{'s' * (late != '1')} late"
    return "in time"
