"""Kinds of tables: the columns of each, its summary, its figure, and how its rows are computed again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

from wavesweep.program.tables.fields import Field, columns_of

if TYPE_CHECKING:
    import numpy as np

    from wavesweep.program.columns import Columns

Line = tuple[str, bool]  # a line of a summary, and whether it is a warning
Numbers = Mapping[str, Any]  # of a summary, JSON-able


class Summary(Protocol):
    """The summary of a table, counted while its rows are written."""

    def add(self, columns: Columns) -> None:
        """Count a block of rows."""

    def numbers(self, facts: Mapping[str, Any]) -> Numbers:
        """The summary as numbers and words that JSON can hold."""


@dataclass(frozen=True)
class Recompute:
    """Digest of the spec of a table, and how to compute rows again: all in blocks, or those of some combinations.

    rows: their expected number, 0 if it is known only once they are computed.
    """

    sha256: str
    all_blocks: Callable[[], Iterable[Columns]] = tuple
    rows: int = 0
    combinations: int = 0
    of_combinations: Callable[[Iterable[int]], Iterator[Columns]] | None = None


@dataclass(frozen=True)
class Kind:
    """One kind of table.

    name: of the table and its files. tally: of a `Table`, makes its summary as numbers. lines: the
    same numbers in words, each line with a flag that is true for a warning. figure: the function
    that draws it, as "package.module.function". again: a function of the facts of a table, and of
    one that gives the name of its spec, that says how to compute its rows again; None if that is
    impossible. study: the table of the spec that has its axes. before: number of its own columns
    that stand before those of the axes. vouched: the columns without which no row is certified; a
    row of intervals may have none.
    """

    name: str
    tally: Callable[..., Summary]
    lines: Callable[[Numbers], Iterator[Line]]
    figure: str
    again: Callable[[Mapping[str, Any], Callable[[], str]], Recompute | None] = field(
        default=lambda *_: None, repr=False
    )
    study: Literal["sweep", "bode"] = "sweep"
    before: int = 0
    vouched: tuple[str, ...] = ()

    @property
    def fields(self) -> tuple[Field, ...]:
        """Its columns behind those of the axes, in order; none if they follow from a spec."""
        return columns_of(self.name)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns that every table of the kind has."""
        return tuple(field.name for field in self.fields if not field.optional)

    def lawful(self, columns: Columns) -> Columns:
        """The columns; a row that is certified without one of its values is in doubt."""
        import numpy as np

        if not self.vouched or "certified" not in columns:
            return columns
        missing = np.logical_or.reduce([np.isnan(columns[name]) for name in self.vouched])
        broken = columns["certified"] & missing
        if not broken.any():
            return columns
        lawful = dict(columns)
        for name in ("certified", "settled"):
            if name in columns:
                lawful[name] = columns[name] & ~broken
        if "doubt" in columns:
            lawful["doubt"] = np.where(broken, "search", columns["doubt"]).astype(object)
        return lawful

    def ordered(self, columns: Mapping[str, Any]) -> dict[str, Any]:
        """The columns in the order of the table; any column that its kind does not have is an axis."""
        names = [field.name for field in self.fields if field.name in columns]
        axes = [name for name in columns if name not in names]
        return {
            name: columns[name] for name in (*names[: self.before], *axes, *names[self.before :])
        }


class SingleBlockSummary:
    """The summary of a table whose rows come in one block. measure: gives its numbers."""

    def __init__(self, measure: Callable[[Columns, Numbers], Numbers]) -> None:
        self._measure = measure
        self._columns: Columns = {}

    def add(self, columns: Columns) -> None:
        """Take the only block."""
        self._columns = columns

    def numbers(self, facts: Mapping[str, Any]) -> Numbers:
        return self._measure(self._columns, facts)


def whole_kind(
    name: str,
    measure: Callable[[Columns, Numbers], Numbers],
    lines: Callable[..., Iterator[Line]],
    figure: str,
    **more: Any,
) -> Kind:
    """A kind of table whose rows come in one block; see `SingleBlockSummary` and `Kind`."""
    return Kind(name, lambda _: SingleBlockSummary(measure), lines, figure, **more)


def from_spec(
    make: Callable[..., Any], *fact_names: str, rows: Callable[[Any], int] = lambda _: 0
) -> Callable[[Mapping[str, Any], Callable[[], str]], Recompute]:
    """A way to compute rows again: by `make`, of the spec and these facts of its `Table`; rows: their number, of a spec."""

    def again(facts: Mapping[str, Any], _: Callable[[], str]) -> Recompute:
        from wavesweep.program.spec import load

        spec = load(facts["spec"])
        return Recompute(
            spec.sha256,
            lambda: make(spec, *(facts[name] for name in fact_names)).blocks(),
            rows(spec),
        )

    return again


def plain(value: Any) -> Any:
    """A number or a word of an array as JSON can hold it, None if it is missing."""
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and value != value else value  # noqa: PLR0124 - NaN


def counted_doubts(words: np.ndarray) -> dict[str, int]:
    """How many rows have each word of a column `doubt`, without those that have none, the most frequent first."""
    return dict(Counter(word for word in words.tolist() if word).most_common())


def in_doubt(
    doubts: Mapping[str, int], rows: int, affected: str, noun: str = "row"
) -> Iterator[Line]:
    """Yield the warning about rows in doubt, if there are any.

    doubts: how many have each word. affected: is not so of them. noun: what is in a row.
    """
    if doubts:
        words = ", ".join(f"{word} {number}" for word, number in doubts.items())
        yield f"{sum(doubts.values())} of {count(rows, noun)} {affected} ({words})", True


def count(number: int, noun: str) -> str:
    """A number and its noun."""
    return f"{number} {noun}{'' if number == 1 else 's'}"
