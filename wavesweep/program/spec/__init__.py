"""The user's request as values with units; all mistakes of a spec are reported at once."""

from wavesweep.engine.keys import Key
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.keys import KEYS, SYMBOLS, find_key
from wavesweep.program.spec.loading import load
from wavesweep.program.spec.spec import Spec, no_axis, sweep_axes

__all__ = ["KEYS", "SYMBOLS", "Axis", "Key", "Spec", "find_key", "load", "no_axis", "sweep_axes"]
