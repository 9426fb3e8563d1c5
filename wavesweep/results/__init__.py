"""The tables: their columns and units, written as CSV and Parquet beside a data package, and read back exactly."""

from wavesweep.results.files import read
from wavesweep.results.folder import discard, refuse_other_spec, refuse_unusable
from wavesweep.results.schema import Field, fields, fields_of
from wavesweep.results.writing import publish, stream

__all__ = [
    "Field",
    "discard",
    "fields",
    "fields_of",
    "publish",
    "read",
    "refuse_other_spec",
    "refuse_unusable",
    "stream",
]
