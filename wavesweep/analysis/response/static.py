"""What is left without the drift: the limit of a response towards 0 Hz, and the lifted map to displacements."""

import numpy as np

from wavesweep.analysis.response.frame import Loop, prepare
from wavesweep.diagram.block import Block
from wavesweep.diagram.drawing import Diagram
from wavesweep.lifted.circle import solve
from wavesweep.lifted.frame import unrolled
from wavesweep.lifted.lift import prune

WALLS = (10.0, 100.0, 1000.0)  # N/m: three of them determine a Moebius map
STILL = 1e-9  # a displacement per tick of that share of its terms is rounding
NOTHING = 1e-12  # of the force of the hand: a control force of rounding


def static_response(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    """Admittance (m/N) and impedance (N/m) in the limit towards 0 Hz, real, `(...,)`; NaN: none, or not known.

    With w = z - 1 of the tick and M ticks in a frame, both sides of `(w_M - E) X = g` and of what the ticks show of X are
    expanded to first order: `E X_0 = -g_0`, `E X_1 = M X_0 - g_1`. The displacement in a tick vanishes with w, and its
    derivative is the position. If nothing holds the device it does not vanish: then the admittance has no limit, and the
    impedance is 0.
    Accuracy: 1e-9 relative against low frequencies and 50 digits in the tests; an error is not bounded.
    """
    M, i = loop.diagram.ratio, np.arange(loop.diagram.ratio)
    with np.errstate(all="ignore"):
        seen, impulse, left = (part[0] for part in (loop.shown.seen, loop.shown.impulse, loop.shown.left))
        own = impulse * (M - i)
        found = solve(loop.E, np.stack([-left.sum(-1), -(left * i).sum(-1)], -1))
        X, X_1 = found[..., 0], found[..., 1] + M * solve(loop.E, found[..., :1])[..., 0]
        rows, later = seen.sum(-2), -(seen * i[:, None]).sum(-2)
        value, slope = _seen(rows, X) + own.sum(-1), _seen(rows, X_1) + _seen(later, X) - (own * i).sum(-1)
        size = _seen(np.abs(rows), np.abs(X)) + np.abs(own).sum(-1)
        if loop.law is not None:
            law = loop.shown.law[0][..., 0, :]
            one, two = ((law * weight).sum(-1)[..., None] for weight in (i, i * (i - 1) / 2))
            value, slope = value + loop.still * one, slope + loop.still * (two + (1 - M) * one)
        position, force = slope[..., 0] / M, value[..., 1] / M
        force = np.where(np.abs(force) < NOTHING, 0.0, force)
        moves = np.abs(value[..., 0]) > STILL * size[..., 0]
        stiffness = np.where(moves, 0.0, force / position)
    unknown = loop.lost | ~np.isfinite(stiffness)
    return np.where(unknown | moves, np.nan, position), np.where(unknown, np.nan, stiffness)


def _seen(rows, X):
    return (rows * X[..., None, :]).sum(-1)


def felt_map(diagram: Diagram, batch: tuple[int, ...] = ()) -> np.ndarray:
    """Coefficients (a, b, c) of the stiffness that the hand feels at rest, `(a + b K)/(1 + c K)`, `(3, ...)`; see `felt`.

    The wall is one scalar of the loop, so what is felt is a Moebius map of its stiffness K (N/m); its damping is not felt at
    rest. Three walls determine the map. batch: shape of the drawing's batch. NaN: not known.
    """
    K = np.reshape(WALLS, (3, *(1,) * len(batch)))
    Z = np.broadcast_to(static_response(prepare(diagram, K, 0.0))[1], (3, *batch))
    rows = np.stack(np.broadcast_arrays(1.0, K / WALLS[1], -K / WALLS[1] * (Z / WALLS[1])), -1)
    known = np.isfinite(Z).all(0)
    rows = np.where(known[..., None, None], np.moveaxis(rows, 0, -2), np.eye(3))
    a, b, c = np.moveaxis(solve(rows, np.moveaxis(Z / WALLS[1], 0, -1)[..., None])[..., 0], -1, 0)
    a = np.where(np.abs(a) < NOTHING, 0.0, a)  # nothing is felt of no wall but rounding
    return np.where(known, np.stack([a * WALLS[1], b, c / WALLS[1]]), np.nan)


def felt(coefficients: np.ndarray, K_VE) -> np.ndarray:
    """Stiffness (N/m) that the hand feels at rest of walls `K_VE` (N/m); coefficients: `(3, ...)`, see `felt_map`."""
    a, b, c = coefficients
    with np.errstate(all="ignore"):
        found = (a + b * K_VE) / (1 + c * K_VE)
    return np.where(np.isfinite(found), found, np.nan)


def displacements(diagram: Diagram, ratio: int, K_VE, B_VE) -> Block:
    """The closed loop as one block per frame of `ratio` ticks: inputs `f_h[0..ratio-1]` (N), outputs `dx[0..ratio-1]` (m).

    A displacement is what the position changes by in a tick. No drift is among the states: a position that everything is
    counted from shows in no displacement, and neither does a combination of states that the loop conserves.
    """
    names = tuple(f"frame.dx[{i}]" for i in range(ratio)), tuple(f"{diagram.hand.force}[{i}]" for i in range(ratio))
    if diagram.ratio == 1 and ratio > 1:  # one tick is the loop's own frame: close it, then repeat it
        return unrolled(displacements(diagram, 1, K_VE, B_VE), np.eye(ratio)[:, None, :], names[1], names[0])
    loop = prepare(diagram, K_VE, B_VE, (diagram.hand.displacement,))
    impulse, lag = loop.shown.impulse[0][..., 0, :], np.subtract.outer(np.arange(ratio), np.arange(ratio))
    C, D = loop.shown.seen[0][..., 0, :, :], np.where(lag >= 0, impulse[..., lag], 0.0)
    return prune(Block("lifted", names[1], names[0], loop.states, loop.E, loop.shown.left[0], C, D))[0]
