"""Kinds of rows of a table of stable intervals, the words in its columns `hand` and `guarantee`,
and how each is shown.

Those of single loops stand here; a capability offers more in the mapping `ROWS` of its module
`guarantee`.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from wavesweep.capabilities import modules

if TYPE_CHECKING:
    from wavesweep.program.columns import Columns


@dataclass(frozen=True, slots=True)
class RowKind:
    """Words and look of the rows of one kind.

    meaning: of its word in the column, `hand` or `guarantee`. title: of their line in a summary.
    legend, colour, line: in a figure; line: place in `style.LINES`. good: adjective of their
    intervals. nowhere: the sentence without any. largest: title of the largest value in a figure.
    proved: whether they are what is proved, with columns of what refutes more. searched: whether
    some are not proved, and no counterexample is found. checked: whether the bounds that they rest
    on are sampled, so that they are neither certified nor proved. of_operator: whether they are of
    the spec's own loop, which its operator holds. unsettled: the warning about rows of which some
    are not settled, with {rows} and the {words} of their kinds; settled: the line if all are.
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
    checked: bool = False
    of_operator: bool = False
    column: str = "hand"
    unsettled: str = ""
    settled: str = ""

    @property
    def guaranteed(self) -> bool:
        """Whether the rows hold for more than one loop and are proved or searched as such."""
        return self.proved or self.searched

    def vouched_for(self, columns: Collection[str]) -> str:
        """What its rows are in a table with these columns: "certified" or "checked".

        With what refutes more they are those of frames that vary, which are proved in balls.
        """
        return "checked" if self.checked and "fails_from" not in columns else "certified"

    def name_beside(self, kinds: Collection[str], rows: Columns) -> str:
        """The name of its rows in a legend beside rows of these kinds."""
        name = self.legend + " (operator)" * (self.of_operator and "operator" in kinds)
        if not (self.searched and "settled" in rows):
            return name
        return f"{name} ({'settled' if rows['settled'].all() else 'searched'})"

    def as_drawn(self, rows: Columns) -> Columns:
        """The rows as a figure takes them.

        What is searched for is as good as certified where it is settled. What is proved for all has
        an end wherever a counterexample or nothing is known beyond it.
        """
        import numpy as np

        if self.searched and "settled" in rows:
            return {**rows, "certified": rows["settled"]}
        if not self.proved:
            return rows
        ends = {
            omega: np.where(np.isfinite(rows[fails]) | ~rows["settled"], 0.0, np.nan)
            for omega, fails in (("low_omega", "fails_below"), ("high_omega", "fails_from"))
        }
        return {**rows, **ends}


COMPUTED: Mapping[str, RowKind] = {
    "free": RowKind("the device alone, without a hand", "free device", "free device"),
    "operator": RowKind(
        "the spec's own operator", "with the spec's operator", "operator", "#56B4E9", 1
    ),
    "spec": RowKind(
        "the spec's own numbers", "the spec's own numbers", "nominal numbers", column="guarantee"
    ),
}
"""Intervals of one loop; the others are searched for, at the swept values alone."""


@cache
def row_kinds() -> Mapping[str, RowKind]:
    """All kinds by their words, from the one that promises least to the one that promises most;
    "" of a table without words."""
    offered = {word: kind for module in modules("guarantee") for word, kind in module.ROWS.items()}
    return {"": RowKind(), **COMPUTED, **offered}


def row_kind(word: str) -> RowKind:
    """The kind of rows with a word; a plain one if the capability that makes them is not
    installed."""
    return row_kinds().get(word) or RowKind("", word, f"{word} (drawn plainly)", "#777777")


def words_of(column: str) -> dict[str, str]:
    """The words that a column, `hand` or `guarantee`, can have, with their meanings."""
    return {
        word: kind.meaning
        for word, kind in row_kinds().items()
        if kind.meaning and kind.column == column
    }


def hands_offered() -> dict[str, str]:
    """The words of --for-hands that the installed capabilities read, and what is guaranteed with
    each."""
    return {word: text for module in modules("guarantee") for word, text in module.HANDS.items()}
