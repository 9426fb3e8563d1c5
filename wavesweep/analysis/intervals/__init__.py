"""Stable intervals, with a certificate: exactly along the wall's parameters, through eigenvalues along any other number."""

from wavesweep.analysis.intervals.anywhere import stable_anywhere
from wavesweep.analysis.intervals.stable import Intervals, stable_intervals

__all__ = ["Intervals", "stable_anywhere", "stable_intervals"]
