"""Run time against error, for this tool and for other methods that a user might write; and hard cases."""

from wavesweep.bench.measuring import FIELDS
from wavesweep.bench.report import lines, measure

__all__ = ["FIELDS", "lines", "measure"]
