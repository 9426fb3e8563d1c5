"""What the hand feels: transmitted admittance and impedance, and the worst case over the aliases."""

from wavesweep.analysis.response.frame import Loop, prepare
from wavesweep.analysis.response.gain import worst_gain
from wavesweep.analysis.response.static import displacements, felt, felt_map, static_response
from wavesweep.analysis.response.steady import Response, respond, steady_state

__all__ = [
    "Loop",
    "Response",
    "displacements",
    "felt",
    "felt_map",
    "prepare",
    "respond",
    "static_response",
    "steady_state",
    "worst_gain",
]
