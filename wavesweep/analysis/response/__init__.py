"""What the hand feels: transmitted admittance and impedance, and the worst case over the aliases."""

from wavesweep.analysis.response.gain import worst_gain
from wavesweep.analysis.response.steady import Loop, prepare, steady_state

__all__ = ["Loop", "prepare", "steady_state", "worst_gain"]
