"""Stable intervals along the wall's parameters, exactly and with a certificate."""

from wavesweep.analysis.intervals.stable import Intervals, stable_intervals

__all__ = ["Intervals", "stable_intervals"]
