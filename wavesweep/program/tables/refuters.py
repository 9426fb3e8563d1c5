"""The column `counterexample`: what refutes the values beyond the ends of an interval, as it is written and read again."""

from textwrap import shorten
from typing import NamedTuple

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
    """A refuter for a sentence: messages of a pattern by what happens to them."""
    numbers, of_messages, messages = refuter.partition("messages ")
    if not of_messages:
        return refuter
    channels = [channel.partition(": ") for channel in messages.split("; ")]
    patterns = [
        f"{name}: {', '.join(map(_message, pattern.split(', ')))}" for name, _, pattern in channels
    ]
    return f"{numbers}this pattern of messages, repeated: {'; '.join(patterns)}"


def _message(late: str) -> str:
    if not late.isdigit():
        return late
    return f"{late} tick{'s' * (late != '1')} late" if int(late) else "in time"
