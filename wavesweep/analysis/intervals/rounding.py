"""How far rounding of the compiled loop can move a crossing."""

import numpy as np

from wavesweep.analysis.intervals.curve import K_VE
from wavesweep.lifted.circle import inverse, refined
from wavesweep.lifted.cut import ADVANCE, OFFSET, Cut, V

ORDINARY = 16.0  # condition of the algebraic loops up to which entries are good to a few roundings


def shift(cut: Cut, along: str, fixed, w, on_axis):
    """By how much the wall parameter at a crossing moves when every entry of the loop moves by a rounding, and by more
    where the algebraic loops behind these entries are ill-conditioned; and what that leaves of the characteristic equation,
    relative to its terms.

    cut: one loop per crossing. w: `exp(j theta) - 1` there. on_axis: whether the crossing is held at z = 1 or -1. To first
    order an entry's change reaches `G` as `C R dE R B`, R the resolvent, and `K = (one - fixed*other)/solved` with it; where K
    grazes the real axis, the angle gives way by `Im dK/Im K'`, which moves K by `Re K'` times as much.
    """
    G, error, slope = _transfer(cut, w)
    size = np.abs(w)
    if cut.integrates:
        x, v, one = G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., V], w
        of_x, of_v = error[..., ADVANCE] + size * error[..., OFFSET], size * error[..., V]
        dx, dv, d_one = slope[..., ADVANCE] + w * slope[..., OFFSET] + G[..., OFFSET], w * slope[..., V] + G[..., V], 1.0
    else:
        x, v, one, of_x, of_v = G[..., OFFSET], G[..., V], 1.0, error[..., OFFSET], error[..., V]
        dx, dv, d_one = slope[..., OFFSET], slope[..., V], 0.0
    if along != K_VE:
        x, v, of_x, of_v, dx, dv = v, x, of_v, of_x, dv, dx
    with np.errstate(all="ignore"):
        value = (one - fixed * v) / x
        moved = (np.abs(fixed) * of_v + np.abs(value) * of_x) / np.abs(x)
        turned = (d_one - fixed * dv - value * dx) / x * (1j * (1 + w))
        grazing = np.where(on_axis, 1.0, np.abs(turned) / np.abs(turned.imag))
        terms = np.abs(one) + np.abs(fixed * v) + np.abs(value * x)
        left_over = moved * np.abs(x) / np.where(terms > 0, terms, 1)  # at K_VE = 0 the equation is 0 = 0 by structure
        return np.maximum(1, cut.condition / ORDINARY) * moved * grazing, left_over


def _transfer(cut, w):
    """Rows V, ADVANCE, OFFSET of G at w, how far a rounding of every entry and the solve's own error move them, and their
    derivative by w."""
    A = np.asarray(w)[..., None, None] * np.eye(cut.E.shape[-1]) - cut.E
    B, back = cut.B + 0 * A[..., :1], inverse(A)
    state = refined(A, back, B)
    across = np.swapaxes(A, -1, -2)
    left = np.swapaxes(refined(across, np.swapaxes(back, -1, -2), np.swapaxes(cut.C, -1, -2) + 0 * A[..., :1]), -1, -2)
    far = np.abs(left) @ (np.abs(cut.E) @ np.abs(state) + np.abs(cut.B)) + np.abs(cut.C) @ np.abs(state) + np.abs(cut.D)
    missed = np.abs(left) @ np.abs(B - A @ state)
    return ((cut.C @ state + cut.D)[..., 0], (np.finfo(float).eps * far + missed)[..., 0], -(left @ state)[..., 0])
