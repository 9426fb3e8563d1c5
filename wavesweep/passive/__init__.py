"""Passivity of the wave channel and of the hand's port, and stability for all passive hands."""

from wavesweep.passive.any_hand import (
    DampingNeeded,
    PassiveWalls,
    any_hand_walls,
    damping_needed,
    port_passive_walls,
    reads_velocity,
)
from wavesweep.passive.channel import (
    ChannelNorm,
    channel_norm,
    filter_table,
    has_waves,
    sufficient_order,
)
from wavesweep.passive.hand import HOLDING_A_DEVICE, HandBox
from wavesweep.passive.held_loop import HAND, HeldLoop
from wavesweep.passive.lifted_margins import LiftedLoop, margins_of
from wavesweep.passive.loop_margins import BrokenLoop, Margin
from wavesweep.passive.margin import PortMargin, more_damping, port_margin

__all__ = [
    "HAND",
    "HOLDING_A_DEVICE",
    "BrokenLoop",
    "ChannelNorm",
    "DampingNeeded",
    "HandBox",
    "HeldLoop",
    "LiftedLoop",
    "Margin",
    "PassiveWalls",
    "PortMargin",
    "any_hand_walls",
    "channel_norm",
    "damping_needed",
    "filter_table",
    "has_waves",
    "margins_of",
    "more_damping",
    "port_margin",
    "port_passive_walls",
    "reads_velocity",
    "sufficient_order",
]
