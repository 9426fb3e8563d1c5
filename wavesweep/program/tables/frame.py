"""Tables as DataFrames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from wavesweep.program.columns import Columns
from wavesweep.program.reading.tables import members_of
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.columns import fields_of

if TYPE_CHECKING:
    from pandas import DataFrame

    from wavesweep.program.tables.table import Table


class Shared(dict):
    """A dict for the `.attrs` of a DataFrame, which pandas copies at every access to a column: its copies are itself."""

    def __deepcopy__(self, memo: Any) -> Shared:
        return self

    def __reduce__(self) -> tuple[type[dict], tuple[dict[str, Any]]]:
        return dict, (dict(self),)  # who reads a pickled DataFrame needs no part of this package


def frame(columns: Columns, units: Mapping[str, str], members: str = "") -> DataFrame:
    """Columns as a DataFrame, whose `.attrs` has their `units`.

    members: see `Spec`; if there are any and the rows are of the spec's own numbers, `guarantee` in
    `.attrs` says so.
    """
    import pandas

    data = pandas.DataFrame(dict(columns))
    data.attrs["units"] = Shared(units)
    if members and "guarantee" not in columns:
        data.attrs["guarantee"] = f"the spec's own numbers alone, and not all of {members}"
    return data


def framed(table: Table) -> DataFrame:
    """A table as a DataFrame, whose `.attrs` has the `units` of the columns, the `facts` of the run, and the `summary`.

    The summary has the numbers that the command of the table prints, such as the largest stable
    value and its place.
    """
    tally = kind_named(table.kind).tally(table)
    columns = table.watched(tally.add).columns
    fields = table.fields or fields_of(table.kind, columns, table.facts)
    specs = (table.facts.get("specs") or {"": table.facts.get("spec") or {}}).values()
    members = "" if table.kind == "design" else next(filter(None, map(members_of, specs)), "")
    data = frame(columns, {field.name: field.unit for field in fields}, members)
    data.attrs |= {"facts": Shared(table.facts), "summary": Shared(tally.numbers(table.facts))}
    return data
