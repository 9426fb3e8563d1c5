"""The tables: their columns and units, written as CSV and Parquet beside a data package, and read back exactly."""

from typing import TYPE_CHECKING

from wavesweep.program.results.folder import (
    changes,
    discard,
    existing_facts,
    names_of,
    place_of,
    refuse_other_hands,
    refuse_other_spec,
    refuse_unusable,
)
from wavesweep.program.results.lock import at_work
from wavesweep.program.results.package import add_figures
from wavesweep.program.results.table_files import (
    NOT_OURS,
    read,
    read_table,
)
from wavesweep.program.results.table_writing import pictured, publish, save, stream
from wavesweep.program.tables.columns import fields, fields_of
from wavesweep.program.tables.fields import Field

if TYPE_CHECKING:
    from wavesweep.program.results.verification import Verification, verify

__all__ = [
    "NOT_OURS",
    "Field",
    "Verification",
    "add_figures",
    "at_work",
    "changes",
    "discard",
    "existing_facts",
    "fields",
    "fields_of",
    "names_of",
    "pictured",
    "place_of",
    "publish",
    "read",
    "read_table",
    "refuse_other_hands",
    "refuse_other_spec",
    "refuse_unusable",
    "save",
    "stream",
    "verify",
]


def __getattr__(name: str) -> object:
    if name not in ("Verification", "verify"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from wavesweep.program.results import verification  # which no other command needs

    return getattr(verification, name)
