"""Passivity: of the wave channel, of the hand's port, and of what a hand may be."""

from wavesweep.analysis.passivity.channel import ChannelNorm, channel_norm
from wavesweep.analysis.passivity.port import PortMargin, port_margin

__all__ = ["ChannelNorm", "PortMargin", "channel_norm", "port_margin"]
