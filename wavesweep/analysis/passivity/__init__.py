"""Passivity: of the wave channel, of the hand's port, and of what a hand may be."""

from wavesweep.analysis.passivity.any_hand import DampingNeeded, colgate_schenkel, damping_needed
from wavesweep.analysis.passivity.channel import ChannelNorm, channel_norm
from wavesweep.analysis.passivity.filter_table import filter_table, sufficient_order
from wavesweep.analysis.passivity.hand import HOLDING_A_DEVICE, HandBox, swing_with_hand
from wavesweep.analysis.passivity.held import HeldIntervals, box_intervals
from wavesweep.analysis.passivity.passive_walls import PassiveWalls, any_hand_walls, port_passive_walls
from wavesweep.analysis.passivity.port import PortMargin, port_margin
from wavesweep.analysis.passivity.worst_hand import WorstHand, worst_hand

__all__ = [
    "HOLDING_A_DEVICE",
    "ChannelNorm",
    "DampingNeeded",
    "HandBox",
    "HeldIntervals",
    "PassiveWalls",
    "PortMargin",
    "WorstHand",
    "any_hand_walls",
    "box_intervals",
    "channel_norm",
    "colgate_schenkel",
    "damping_needed",
    "filter_table",
    "port_margin",
    "port_passive_walls",
    "sufficient_order",
    "swing_with_hand",
    "worst_hand",
]
