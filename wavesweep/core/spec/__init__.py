"""The user's request as values with units; all mistakes of a spec are reported at once."""

from wavesweep.core.reading.axes import Axis
from wavesweep.core.reading.keys import KEYS, SYMBOLS, Key, find_key
from wavesweep.core.spec.loading import load
from wavesweep.core.spec.spec import Spec
from wavesweep.core.spec.sweep_axes import no_axis, sweep_axes

__all__ = ["KEYS", "SYMBOLS", "Axis", "Key", "Spec", "find_key", "load", "no_axis", "sweep_axes"]
