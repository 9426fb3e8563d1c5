"""The largest output of a periodic loop under an input that is only known to be bounded: its
peak gain, the l1 norm."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wavesweep.engine._response.lifted import Stretch
from wavesweep.engine._response.port import Port
from wavesweep.engine._state_space import StateSpace


class PeakGain(NamedTuple):
    """gain: at least the largest output under any input between -1 and 1, and more by `excess`
    at most. step: the largest output, at any time, after an input that is 0 before some tick and
    1 from there on."""

    gain: float
    excess: float
    step: float


def l1_norm(port: Port) -> PeakGain | None:
    """Return the peak gain of one loop from the input to the first output of its port; see
    `Port.between`.

    With the frame `x' = A x + G u`, `y = O x + T u` the output in tick i of a frame is at most the
    sum over all ticks before of `|T|` and `|O A^q G|` in its row, and an input whose signs are
    those of the row comes as near as one likes (Dahleh and Diaz-Bobillo, Control of Uncertain
    Systems, 1995, chapter 3; lifted for a periodic loop). The frames that are not summed are
    bounded by powers of one that comes after those that are. None if the loop is not stable,
    settles too slowly for the work that is allowed, or has a drift that may move the output for
    good.

    Accuracy: rounding, and `excess`.
    """
    if not any(matrix.any() for tick in port.maps for matrix in (tick.B, tick.D)):
        return PeakGain(0.0, 0.0, 0.0)
    # Ticks of a frame whose map from tick to tick is kept as a matrix.
    if port.kind.size > 4096 or port.outputs > 1:
        return None
    with np.errstate(all="ignore"):
        frame = Stretch.of(port).showing(slice(0, 1))
        system = StateSpace(
            frame.E[0], frame.controllability[0], frame.observability[0][0], frame.impulse_map()
        )
        return _summed(*system) if all(np.isfinite(matrix).all() for matrix in system) else None


def _summed(E: np.ndarray, G: np.ndarray, O: np.ndarray, T: np.ndarray) -> PeakGain | None:
    n, ticks = G.shape
    row = np.abs(T).sum(-1)
    step = np.abs(_from_each(T)).max()
    before = T.sum(-1)
    if not (n and O.any() and G.any()):
        return PeakGain(float(row.max()), 0.0, float(step))
    if not (np.abs(1 + np.linalg.eigvals(E)) < 1).all():
        return None
    once = max(1, min(50_000 // ticks**2, 1024))  # frames that are summed together
    A = np.eye(n) + E
    powers = [O]
    for _ in range(once - 1):
        powers.append(powers[-1] @ A)
    rows = np.concatenate(powers)
    far = np.linalg.matrix_power(A, once)
    power = np.eye(n)
    shown = np.zeros_like(O)
    # Multiplications, up to which the sum goes on.
    for _ in range(max(1, int(2e9 / (rows.shape[0] * (n + 4) * ticks)))):
        later = rows @ power
        maps = (later @ G).reshape(once, ticks, ticks)
        row = row + np.abs(maps).sum((0, -1))
        shown = shown + np.abs(later).reshape(once, ticks, n).sum(0)
        sums = maps.sum(-1)
        earlier = np.concatenate([np.zeros((1, ticks)), np.cumsum(sums, 0)[:-1]])
        reached = before + earlier
        step = max(step, np.abs(_from_each(maps) + reached[..., None]).max())
        before = before + sums.sum(0)
        power = far @ power
        excess = _rest(shown, np.abs(power), np.abs(G))
        if excess <= 1e-6 * row.max():  # what is left of the sum of sizes when it is stopped
            break
    if not excess <= 1e-2 * row.max():  # share of the sum, for a result to be given at all
        return None
    step = max(step, np.abs(before).max() + excess)
    return PeakGain(float(row.max() + excess), float(excess), float(step))


def _rest(shown: np.ndarray, power: np.ndarray, into: np.ndarray) -> float:
    """The largest sum of all later frames: with `|A^(r + s Q)| <= |A^r| |A^Q|^s` they are a
    series of powers of `|A^Q|`."""
    try:
        series = np.linalg.inv(np.eye(len(power)) - power)
    except np.linalg.LinAlgError:
        return np.inf
    if not (series >= 0).all():
        return np.inf
    return (shown @ (power @ (series @ into))).sum(-1).max()


def _from_each(maps: np.ndarray) -> np.ndarray:
    """The sums over the ticks of the input from each one to the last."""
    return np.cumsum(maps[..., ::-1], -1)
