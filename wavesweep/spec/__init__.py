"""The user's request as values with units; all mistakes of a spec are reported at once."""

from wavesweep.spec.axes import Axis
from wavesweep.spec.keys import KEYS, STUDY_KEYS, SYMBOLS, Key, find_key
from wavesweep.spec.loading import load
from wavesweep.spec.require import Require
from wavesweep.spec.spec import Spec
from wavesweep.spec.sweep_axes import no_axis, sweep_axes

__all__ = ["KEYS", "STUDY_KEYS", "SYMBOLS", "Axis", "Key", "Require", "Spec", "find_key", "load", "no_axis", "sweep_axes"]
