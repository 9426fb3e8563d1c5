"""Kinds of rows of a table of stable intervals, the words in its columns `hand` and `guarantee`, and how each is shown.

Those of single loops stand here; a capability offers more in the mapping `ROWS` of its module `guarantee`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from wavesweep.capabilities import modules


@dataclass(frozen=True, slots=True)
class RowKind:
    """Words and look of the rows of one kind.

    meaning: of its word in the column, `hand` or `guarantee`. title: of their line in a summary. legend, colour, line: in a
    figure; line: place in `style.LINES`. good: adjective of their intervals. nowhere: the sentence without any. largest: title
    of the largest value in a figure. proved: whether they are what is proved, with columns of what refutes more. searched:
    whether some are not proved, and no counterexample is found. of_operator: whether they are of the spec's own loop, which its
    operator holds.
    """

    meaning: str = ""
    title: str = ""
    legend: str = ""
    colour: str = "#0072B2"
    line: int = 0
    good: str = "stable"
    nowhere: str = "no {such} anywhere"
    largest: str = "largest"
    proved: bool = False
    searched: bool = False
    of_operator: bool = False
    column: str = "hand"


COMPUTED: Mapping[str, RowKind] = {
    "free": RowKind("the device alone, without a hand", "free device", "free device"),
    "operator": RowKind("the spec's own operator", "with the spec's operator", "operator", "#56B4E9", 1),
    "spec": RowKind("the spec's own numbers", "the spec's own numbers", "nominal numbers", column="guarantee"),
}
"""Intervals of one loop; the others are searched for, at the swept values alone."""


@cache
def row_kinds() -> Mapping[str, RowKind]:
    """All kinds by their words, from the one that promises least to the one that promises most; "" of a table without words."""
    offered = {word: kind for module in modules("guarantee") for word, kind in module.ROWS.items()}
    return {"": RowKind(), **COMPUTED, **offered}


def counterexample_in_words(text: str) -> str:
    """What a column `counterexample` has, for a sentence: messages of a pattern by what happens to them."""
    numbers, found, messages = text.partition("messages ")
    if not found:
        return text
    channels = [channel.partition(": ") for channel in messages.split("; ")]
    said = [f"{name}: {', '.join(map(_message, pattern.split(', ')))}" for name, _, pattern in channels]
    return f"{numbers}this pattern of messages, repeated: {'; '.join(said)}"


def _message(late: str) -> str:
    if not late.isdigit():
        return late
    return f"{late} tick{'s' * (late != '1')} late" if int(late) else "in time"


def words_of(column: str) -> dict[str, str]:
    """The words that a column, `hand` or `guarantee`, can have, with their meanings."""
    return {word: kind.meaning for word, kind in row_kinds().items() if kind.meaning and kind.column == column}


def proved_kinds() -> tuple[str, ...]:
    """The words of rows that are what is proved."""
    return tuple(word for word, kind in row_kinds().items() if kind.proved)
