"""The damping that a device would have to have more for the hand's port to be passive."""

import numpy as np

from wavesweep.analysis.passivity.port import PortMargin, port_margin

MOST, LEAST = 1e4, 1e-4  # N*s/m: no device has more, and less makes no difference
CLOSE = 1e-3  # relative width of the bracket that is left
DAMPING = "device.damping"


def port_damping_needed(values, margin: PortMargin | None = None) -> np.ndarray:
    """Additional device damping (N*s/m) with which the hand's port is passive; 0 if it is, NaN if MOST is not enough.

    values: flat keys, numbers or arrays over a batch. margin: that of `values`, if it is known. The bracket is halved on a
    logarithmic scale, each time with the margin over all frequencies, and its upper end is given: the port is passive with
    it. That less damping is not enough holds for the lower end, and below it if passivity is not lost again with damping,
    which no random loop showed. A hand that also moves within the tick needs more: see `damping_needed`.
    Accuracy: CLOSE relative, from above.
    """
    margin = port_margin(values) if margin is None else margin
    shape = margin.margin.shape
    found = np.where(margin.passive, 0.0, np.nan).reshape(-1)

    def passive(index, more):
        chosen = {path: np.broadcast_to(v, shape).reshape(-1)[index] if np.ndim(v) else v for path, v in values.items()}
        return port_margin(chosen | {DAMPING: chosen[DAMPING] + more}).passive

    index = np.flatnonzero(np.isnan(found))
    if index.size:
        index = index[passive(index, np.full(index.size, MOST))]
    low, high = np.full(index.size, LEAST), np.full(index.size, MOST)
    while index.size and np.any(high > low * (1 + CLOSE)):
        middle = np.sqrt(low * high)
        enough = passive(index, middle)
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    found[index] = high
    return found.reshape(shape)
