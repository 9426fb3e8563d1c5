"""Tables as DataFrames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavesweep.program.columns import Columns
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.columns import fields_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from wavesweep.program.tables.table import Table


class Shared(dict[str, Any]):
    """A dict for the `.attrs` of a DataFrame, which pandas copies at every access to a column: its copies are itself."""

    def __deepcopy__(self, memo: Any) -> Shared:
        return self

    def __reduce__(self) -> tuple[type[dict[str, Any]], tuple[dict[str, Any]]]:
        return dict, (dict(self),)  # who reads a pickled DataFrame needs no part of this package


def frame(
    columns: Columns, units: Mapping[str, str], claims: Mapping[str, Mapping[str, Any]]
) -> DataFrame:
    """Columns as a DataFrame, whose `.attrs` has their `units` and the `claims` of the rows: what
    these say of which loops, by the word of their kind, see `claim_words.fact_of`.
    """
    import pandas

    data = pandas.DataFrame(dict(columns))
    data.attrs |= {"units": Shared(units), "claims": Shared(claims)}
    return data


def framed(table: Table) -> DataFrame:
    """A table as a DataFrame, whose `.attrs` has the `units` of the columns, the `facts` of the run, its `claims`, and the `summary`.

    The summary has the numbers that the command of the table prints, such as the largest stable
    value and its place.
    """
    tally = kind_named(table.kind).tally(table)
    columns = table.watched(tally.add).columns
    fields = table.fields or fields_of(table.kind, columns, table.facts)
    units = {field.name: field.unit for field in fields}
    data = frame(columns, units, table.facts.get("claims", {}))
    data.attrs |= {"facts": Shared(table.facts), "summary": Shared(tally.numbers(table.facts))}
    return data
