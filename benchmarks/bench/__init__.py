"""Run time against error, for this tool and for other methods that a user might write; and hard cases."""

from bench.errors_and_times import draw
from bench.measuring import FIELDS
from bench.report import lines, measure
from wavesweep.program import api

api.MOST_ANSWERS = 0  # a question is answered each time that it is timed

__all__ = ["FIELDS", "draw", "lines", "measure"]
