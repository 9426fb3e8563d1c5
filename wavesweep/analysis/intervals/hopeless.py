"""Columns that are unstable for every value of the wall, told from one number."""

import numpy as np

from wavesweep.analysis.intervals.curve import K_VE
from wavesweep.lifted.cut import ADVANCE, OFFSET, Cut, V


def surely_unstable(cut: Cut, owner, along: str, fixed, span):
    """Columns whose closed loop has a trace beyond the number of its eigenvalues all over the span: one lies outside.

    A tick that is unstable by itself grows so much within a frame that the frame's matrix keeps no digit of its small
    eigenvalues, and nothing finer can be said of it in double precision. The trace, the sum of the eigenvalues, is a
    quotient of linear functions of the wall parameter: without a pole in the span its extremes are at the ends.
    """
    with np.errstate(all="ignore"):
        base = cut.order + np.trace(cut.E, axis1=-2, axis2=-1)
        gain = (cut.C * np.swapaxes(cut.B, -1, -2)).sum(-1)
        x, v = gain[..., OFFSET] + (cut.D[..., ADVANCE, 0] if cut.integrates else 0), gain[..., V]
        through_x, through_v = cut.D[..., OFFSET, 0], cut.D[..., V, 0]
        traces, sizes, through = [], [], []
        for end in span:
            K, B = (end, fixed) if along == K_VE else (fixed, end)
            through.append(1 - K * through_x[owner] - B * through_v[owner])
            traces.append(base[owner] + (K * x[owner] + B * v[owner]) / through[-1])
            sizes.append(np.abs(base[owner]) + (np.abs(K * x[owner]) + np.abs(B * v[owner])) / np.abs(through[-1]))
        beyond = [np.abs(t) > np.maximum(1.001 * cut.order, 1e-8 * s) for t, s in zip(traces, sizes, strict=True)]
        return beyond[0] & beyond[1] & (traces[0] * np.sign(traces[1]) > 0) & (through[0] * through[1] > 0)
