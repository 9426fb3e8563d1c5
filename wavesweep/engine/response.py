"""Responses with bounds on their errors: of ports over frequency, at rest, after a step, and at worst."""

from typing import TYPE_CHECKING

from wavesweep.engine import on_demand

if TYPE_CHECKING:
    from wavesweep.engine._response.at_hand import (
        Route,
        port_of_loops,
        ports_by_rate,
        ports_of_batch,
    )
    from wavesweep.engine._response.gain import gain_of
    from wavesweep.engine._response.lifted import Lifted, held_over_frame, over_frame
    from wavesweep.engine._response.peak import PeakGain, l1_norm
    from wavesweep.engine._response.port import NoPositionError, Port
    from wavesweep.engine._response.static import Response
    from wavesweep.engine._response.steady import respond, static_response, transfer
    from wavesweep.engine._response.step import BAND, MOST_SAMPLED_STATES, Step
else:
    __getattr__ = on_demand(
        {
            "_response.at_hand": ("Route", "port_of_loops", "ports_by_rate", "ports_of_batch"),
            "_response.gain": ("gain_of",),
            "_response.lifted": ("Lifted", "held_over_frame", "over_frame"),
            "_response.peak": ("PeakGain", "l1_norm"),
            "_response.port": ("NoPositionError", "Port"),
            "_response.static": ("Response",),
            "_response.steady": ("respond", "static_response", "transfer"),
            "_response.step": ("BAND", "MOST_SAMPLED_STATES", "Step"),
        }
    )
