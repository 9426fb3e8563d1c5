"""What the user asked for, as values with units; every mistake of a spec at once."""

from wavesweep.spec.axes import Axis
from wavesweep.spec.keys import KEYS, STUDY_KEYS, SYMBOLS, Key, find_key
from wavesweep.spec.loading import load
from wavesweep.spec.spec import Spec, sweep_axes

__all__ = ["KEYS", "STUDY_KEYS", "SYMBOLS", "Axis", "Key", "Spec", "find_key", "load", "sweep_axes"]
