"""Stable intervals, with a certificate: exactly along the wall's parameters, through eigenvalues along any other number."""

from wavesweep.stability.along_any import stable_along_any
from wavesweep.stability.damped import damped_along_any
from wavesweep.stability.stable import Intervals, joined, stable_intervals

__all__ = ["Intervals", "damped_along_any", "joined", "stable_along_any", "stable_intervals"]
