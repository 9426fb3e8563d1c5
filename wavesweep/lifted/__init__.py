"""Conversion of a multirate diagram to one unirate system: discretise, connect, lift, cut at the wall."""

from wavesweep.lifted.cut import Cut, close, cut_at_wall, with_batch

__all__ = ["Cut", "close", "cut_at_wall", "with_batch"]
