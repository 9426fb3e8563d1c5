"""Reported intervals against eigenvalues, column by column."""

import numpy as np

from wavesweep.engine._monodromy.cut import FIRST, SECOND
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.haptics.controller_page import wall_cut

NUMBER = {"K_VE": FIRST, "B_VE": SECOND}  # those of a wall, as a cut names them


def cut_of(values):
    """The loop of `values`, cut at the wall, as a batch of one slice."""
    cut = wall_cut(values)
    if cut is None:
        raise IllPosedLoopError("the wall is no scalar gain of this loop's frame")
    return cut.at(np.newaxis)


def intervals_of(values, along="K_VE", span=(0, 20000), fixed=None):
    """Stable intervals of one loop; `fixed` defaults to what the values say."""
    if fixed is None:
        fixed = values["environment.B_VE" if along == "K_VE" else "environment.K_VE"]
    return stable_intervals(cut_of(values), NUMBER[along], span, np.atleast_1d(fixed)[None])


def pairs(found, column=0):
    """[(low, high), ...] of one column."""
    mine = (found.column == column) & (found.index >= 0)
    return list(zip(found.low[mine].tolist(), found.high[mine].tolist(), strict=True))


def excess(cut, along, fixed, value):
    """Largest `|z|^2 - 1` of the closed loop, without cancellation for slow poles; arrays broadcast."""
    walls = (value, fixed) if along == "K_VE" else (fixed, value)
    delta = np.linalg.eigvals(cut.closed(*np.broadcast_arrays(*walls)))
    return (2 * delta.real + delta.real**2 + delta.imag**2).max(-1)


def mislabelled(cut, along, span, fixed, found, doubt=1e-10):
    """Points of a fine scan whose eigenvalues say otherwise than the intervals: [(fixed, value, excess), ...].

    doubt: points whose excess is smaller, which rounding of the eigenvalues could put on either side, do not count.
    """
    low, high = span
    value = low + (high - low) * np.sort(np.concatenate([np.linspace(0, 1, 202)[1:-1], np.geomspace(1e-7, 0.999, 150)]))
    grid = np.asarray(fixed, float)[:, None], value[None]
    over = excess(cut.at(np.zeros((grid[0].size, value.size), int)), along, *grid)
    claimed = np.zeros(over.shape, bool)
    for column, first, last in zip(found.column, found.low, found.high, strict=True):
        claimed[column] |= (value > first) & (value < last)  # false for the NaN of a column without interval
    wrong = (claimed != (over < 0)) & (np.abs(over) > doubt)
    return [(fixed[i], value[j], over[i, j]) for i, j in np.argwhere(wrong)]
