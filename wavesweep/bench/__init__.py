"""Run time against error, this tool beside what a user would write instead; and where digits are lost."""

from wavesweep.bench.run import measure
from wavesweep.bench.table import FIELDS
from wavesweep.bench.verdict import lines

__all__ = ["FIELDS", "lines", "measure"]
