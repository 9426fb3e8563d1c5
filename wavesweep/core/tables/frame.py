"""Tables as DataFrames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavesweep.core.columns import Columns
from wavesweep.core.tables import kind_named
from wavesweep.core.tables.columns import fields_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from wavesweep.core.tables.table import Table


class Shared(dict):
    """A dict for the `.attrs` of a DataFrame, which pandas copies at every access to a column: its copies are itself."""

    def __deepcopy__(self, memo: Any) -> Shared:
        return self

    def __reduce__(self) -> tuple[type[dict], tuple[dict[str, Any]]]:
        return dict, (dict(self),)  # who reads a pickled DataFrame needs no part of this package


OWN = "the spec's own numbers alone, and not all of [for_all]"  # what a table without a column `guarantee` is of


def frame(columns: Columns, units: Mapping[str, str], for_all: object = None) -> DataFrame:
    """Columns as a DataFrame, whose `.attrs` has their `units`.

    for_all: what the spec says of [for_all]; if it does and the rows are of its own numbers, `guarantee` in `.attrs` says so.
    """
    import pandas

    found = pandas.DataFrame(dict(columns))
    found.attrs["units"] = Shared(units)
    if for_all and "guarantee" not in columns:
        found.attrs["guarantee"] = OWN
    return found


def framed(table: Table) -> DataFrame:
    """A table as a DataFrame, whose `.attrs` has the `units` of the columns, the `facts` of the run, and the `summary`.

    The summary has the numbers that the command of the table prints, such as the largest stable value and its place.
    """
    tally = kind_named(table.kind).tally(table)
    columns = table.watched(tally.add).columns
    fields = table.fields or fields_of(table.kind, columns, table.facts)
    specs = (table.facts.get("specs") or {"": table.facts.get("spec") or {}}).values()
    of_own = table.kind != "design" and any("for_all" in each for each in specs)
    found = frame(columns, {field.name: field.unit for field in fields}, of_own)
    found.attrs |= {"facts": Shared(table.facts), "summary": Shared(tally.numbers(table.facts))}
    return found
