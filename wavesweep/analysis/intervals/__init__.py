"""Stable intervals, with a certificate: exactly along the wall's parameters, through eigenvalues along any other number.

`stable_intervals` is for a wall parameter. `stable_along_any` takes a function `evaluate(column, p)` that returns the frames of
these columns at these values, the number of `columns`, the `period` of each column's frame (s), and the `bounds` beyond which
the parameter has no loop.
"""

from wavesweep.analysis.intervals.any_parameter import stable_along_any
from wavesweep.analysis.intervals.stable import Intervals, stable_intervals

__all__ = ["Intervals", "stable_along_any", "stable_intervals"]
