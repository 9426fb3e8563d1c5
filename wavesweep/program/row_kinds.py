"""Kinds of rows of a table of stable intervals, the words in its columns `hand` and `guarantee`,
and how each is shown.

Those of single loops stand here; a capability offers more in the mapping `ROWS` of its module
`guarantee`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

from wavesweep.capabilities import modules


@dataclass(frozen=True, slots=True)
class RowKind:
    """Name and look of the rows of one kind; what they say of which loops their claim has.

    meaning: of its word in the column, `hand` or `guarantee`. legend, colour, line: in a figure;
    line: place in `style.LINES`. unsettled: the warning about rows with settled 0,
    with {rows} and the {words} of their kinds.
    """

    meaning: str = ""
    legend: str = ""
    colour: str = "#0072B2"
    line: int = 0
    column: str = "hand"
    unsettled: str = ""


TEXT = 2000  # characters of a refuter in a table, whose pattern is whole so that it can be run
LEFT_OPEN = 160  # characters about what is left open
OPEN_BETWEEN = "more than 1 % between what is proved and what is refuted at an end is not known in {rows} of {words}"
COMPUTED: Mapping[str, RowKind] = {
    "free": RowKind("the device alone, without a hand", "free device"),
    "operator": RowKind("the spec's own operator", "operator", "#56B4E9", 1),
    "spec": RowKind("the spec's own numbers", "nominal numbers", column="guarantee"),
}
"""Intervals of one loop; the others are searched for, at the swept values alone."""
ARGUMENTS: Mapping[str, str] = {
    "": "a row that is not certified, or is proved by forms, or of hands",
    "enclosed": "all bounds by which no crossing can be missed are enclosures",
    "first order": "some of these bounds hold to first order in a rounding",
    "sampled": "some of these bounds are sampled, with a margin",
}
"""The words of the column `argument`, by the numbers of `Intervals.argument`."""


@cache
def row_kinds() -> Mapping[str, RowKind]:
    """All kinds by their words, from the one that promises least to the one that promises most;
    "" of a table without words."""
    return {"": RowKind(), **COMPUTED, **_offered("ROWS")}


def words_of(column: str) -> dict[str, str]:
    """The words that a column, `hand` or `guarantee`, can have, with their meanings."""
    return {
        word: kind.meaning
        for word, kind in row_kinds().items()
        if kind.meaning and kind.column == column
    }


def hands_offered() -> dict[str, str]:
    """The words of --for-hands that the installed capabilities read, and what is stable with
    each."""
    return _offered("HANDS")


def _offered(name):
    """The words of all modules `guarantee` that have a mapping of this name."""
    return {
        word: offer
        for module in modules("guarantee")
        for word, offer in getattr(module, name, {}).items()
    }
