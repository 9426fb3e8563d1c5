"""Passivity of the wave channel and of the hand's port, and stability for all passive hands and for a box of hands."""

from wavesweep.analysis.passivity.channel import ChannelNorm, channel_norm, filter_table, sufficient_order
from wavesweep.analysis.passivity.damping import port_damping_needed
from wavesweep.analysis.passivity.hand import HOLDING_A_DEVICE, HandBox, swing_with_hand
from wavesweep.analysis.passivity.hand_box import BoxIntervals, box_intervals
from wavesweep.analysis.passivity.passive_hand import (
    DampingNeeded,
    PassiveWalls,
    any_hand_walls,
    damping_needed,
    port_passive_walls,
)
from wavesweep.analysis.passivity.port import PortMargin, port_margin

__all__ = [
    "HOLDING_A_DEVICE",
    "BoxIntervals",
    "ChannelNorm",
    "DampingNeeded",
    "HandBox",
    "PassiveWalls",
    "PortMargin",
    "any_hand_walls",
    "box_intervals",
    "channel_norm",
    "damping_needed",
    "filter_table",
    "port_damping_needed",
    "port_margin",
    "port_passive_walls",
    "sufficient_order",
    "swing_with_hand",
]
