"""The controller of a spec as C, with vectors of `simulate` that prove that it is the same
controller."""

from wavesweep.simulation.export.float_rounding import floats_in_words
from wavesweep.simulation.export.source import dead_times_of, exported, terms_of

__all__ = ["dead_times_of", "exported", "floats_in_words", "terms_of"]
