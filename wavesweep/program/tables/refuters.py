"""The column `counterexample`: what refutes the values beyond the ends of an interval, as it is written and read again."""

import re
from itertools import groupby
from textwrap import shorten
from typing import NamedTuple

LONGEST_REFUTER_TEXT = 60  # letters of a pattern in a sentence; the table has all of it
_FRAME = r"\d+(?: \([^)]*\))?"  # ticks of a frame, and what else is said of it
BELOW, FROM = "below: ", "; from: "  # before what refutes each end, if both are refuted


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
    frames = re.match(rf"{_FRAME}(?:, {_FRAME})*", text)
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
