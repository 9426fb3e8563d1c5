"""The response that the hand feels: transmitted admittance and impedance, and the worst case over the aliases."""

from wavesweep.analysis.response.circle import circle
from wavesweep.analysis.response.frame import Loop, prepare
from wavesweep.analysis.response.gain import gain_of, worst_gain
from wavesweep.analysis.response.static import displacements, felt, felt_map, static_response
from wavesweep.analysis.response.steady import Modal, Response, respond, steady_state

__all__ = [
    "Loop",
    "Modal",
    "Response",
    "circle",
    "displacements",
    "felt",
    "felt_map",
    "gain_of",
    "prepare",
    "respond",
    "static_response",
    "steady_state",
    "worst_gain",
]
