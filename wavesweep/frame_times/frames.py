"""What `identify --frames` and `check --frames` ask for."""

from wavesweep.frame_times.table import identified, spec_text
from wavesweep.frame_times.within import lines, number_of, within

__all__ = ["identified", "lines", "number_of", "spec_text", "within"]
