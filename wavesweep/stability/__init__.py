"""Stable intervals, with a certificate: exactly along the wall's parameters, through eigenvalues along any other number."""

from wavesweep.stability.along_any import stable_along_any
from wavesweep.stability.by_discs import along_by_discs
from wavesweep.stability.discs import Circle, Spiral
from wavesweep.stability.intervals import Intervals, joined
from wavesweep.stability.stable import stable_intervals

__all__ = ["Circle", "Intervals", "Spiral", "along_by_discs", "joined", "stable_along_any", "stable_intervals"]
