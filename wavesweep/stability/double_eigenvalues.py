"""Two eigenvalues that meet at z = 1 or z = -1: each is uncertain there, their sum and their product are not.

A tick's eigenvalue -1 is an eigenvalue 1 of a frame of an even number of ticks, and what is held over the frame sees no net
effect of it: the frame has another eigenvalue 1 then. This is the classical limit of a damper that is sampled once a tick.
"""

import numpy as np

from wavesweep.monodromy.circle import inverse
from wavesweep.monodromy.rounding import balance
from wavesweep.stability.guardian_maps import PAIR

ROUNDED = 4  # roundings of every entry that an end has to withstand
ALONE = 1e-2  # of the distance of the third eigenvalue: how near the two have to be
SHIFT, STEPS = 1e-3, 4  # of that distance, how far beside the place their vectors are looked for; steps of the iteration


def function_of_two(E, kind, place, dE=None) -> tuple[np.ndarray, np.ndarray]:
    """Return a critical function of the two eigenvalues next to a place on the circle, and its change by errors of the entries.

    E: `(matrices, n, n)`, less identity. kind: `(matrices,)`, PAIR, whose function is `z_1 z_2 - 1`, or else the product of the
    two distances from the place. place: `(matrices,)`, 0 for z = 1 and -2 for z = -1. dE: sizes of errors of the entries,
    ROUNDED roundings of each if it is missing. The change is infinite if the two are not alone there.

    Both functions are smooth where the eigenvalues are not: they follow from a matrix of two rows in a basis of what the two
    span (G. W. Stewart, J. Sun, Matrix Perturbation Theory, 1990, chapter V).
    """
    finite, n = np.isfinite(E).all((-1, -2)), E.shape[-1]
    E, units = balance(np.where(finite[:, None, None], E, 0.0))
    dE = ROUNDED * np.finfo(float).eps * np.abs(E) if dE is None else dE * (units[:, None, :] / units[:, :, None])
    near = np.sort(np.abs(np.linalg.eigvals(E) - place[:, None]), axis=-1)
    far = np.minimum(near[:, 2], 1.0) if n > 2 else np.ones(len(E))
    A, eye = E - place[:, None, None] * np.eye(n), np.eye(n)
    with np.errstate(all="ignore"):
        back = inverse(A - (SHIFT * far)[:, None, None] * eye)
        right = left = np.broadcast_to(np.cos(np.outer(np.arange(1, n + 1), (1.0, 2.0))), (len(E), n, 2))
        for _ in range(STEPS):
            right, left = _orthonormal(back @ right), _orthonormal(np.swapaxes(back, -1, -2) @ left)
        left = np.swapaxes(left, -1, -2)
        within = inverse(left @ right)
        S = within @ (left @ A @ right)
        dS = np.abs(within) @ (np.abs(left) @ dE @ np.abs(right))
        (a, b), (c, d) = ((S[:, i, 0], S[:, i, 1]) for i in (0, 1))
        (da, db), (dc, dd) = ((dS[:, i, 0], dS[:, i, 1]) for i in (0, 1))
        value, unsure = a * d - b * c, np.abs(a) * dd + np.abs(d) * da + np.abs(b) * dc + np.abs(c) * db
        sign = np.where(kind == PAIR, np.where(place == 0, 1.0, -1.0), 0.0)
        value, unsure = value + sign * (a + d), unsure + np.abs(sign) * (da + dd)
    known = finite & (near[:, 1] <= ALONE * far) & np.isfinite(unsure) & np.isfinite(value)
    return value, np.where(known, unsure, np.inf)


def _orthonormal(basis):
    finite = np.isfinite(basis).all((-1, -2), keepdims=True)
    return np.where(finite, np.linalg.qr(np.where(finite, basis, 0.0))[0], np.nan)
