"""Passivity: of the wave channel, of the hand's port, and of what a hand may be."""

from wavesweep.analysis.passivity.channel import ChannelNorm, channel_norm

__all__ = ["ChannelNorm", "channel_norm"]
