"""The tables: their columns and units, written as CSV and Parquet beside a data package, and read back exactly."""

from wavesweep.results.existing import discard, refuse_other_spec, refuse_unusable
from wavesweep.results.reading import read
from wavesweep.results.schema import Field, fields, fields_of
from wavesweep.results.text import stream, stream_blocks
from wavesweep.results.writing import TableWriter, write

__all__ = [
    "Field",
    "TableWriter",
    "discard",
    "fields",
    "fields_of",
    "read",
    "refuse_other_spec",
    "refuse_unusable",
    "stream",
    "stream_blocks",
    "write",
]
