"""What `identify --frames`, `check --frames` and `simulate` ask for."""

from wavesweep.frame_times.table import identified, spec_text
from wavesweep.frame_times.times import read_run
from wavesweep.frame_times.within import lines, number_of, within

__all__ = ["identified", "lines", "number_of", "read_run", "spec_text", "within"]
