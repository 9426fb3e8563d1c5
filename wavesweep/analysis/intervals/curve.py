"""The stability boundary as a curve on the unit circle: the wall's characteristic equation, point by point."""

from dataclasses import dataclass

import numpy as np

from wavesweep.lifted.circle import inverse, refined
from wavesweep.lifted.cut import ADVANCE, OFFSET, Cut, V

K_VE, B_VE = "K_VE", "B_VE"


@dataclass(frozen=True, slots=True)
class Terms:
    """`one = K_VE*x + B_VE*v` at points of the circle, scaled alike; each an array over the points."""

    one: np.ndarray
    x: np.ndarray
    v: np.ndarray

    def along(self, name: str):
        """(term of the parameter that is solved for, term of the one that is fixed)."""
        return (self.x, self.v) if name == K_VE else (self.v, self.x)


def terms(cut: Cut, w) -> Terms:
    """Characteristic equation `1 = K_VE G_x + B_VE G_v` at `w = z - 1`, times w where the loop integrates.

    cut: one loop per point (leading axes as `w`). Accuracy: a backward stable solve in delta form, so relative to the
    distance of the nearest pole, however many poles crowd at z = 1.
    """
    G = transfer(cut, w)
    if not cut.integrates:
        return Terms(np.ones_like(G[..., V]), G[..., OFFSET], G[..., V])
    return Terms(w + 0 * G[..., V], G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., V])


def transfer(cut: Cut, w) -> np.ndarray:
    """`C (w I - E)^-1 B + D` for the rows V, ADVANCE, OFFSET: `(..., 3)`."""
    _, _, state = _states(cut, w)
    return read(cut.C, state) + cut.D[..., 0]


def transfer_and_slope(cut: Cut, w) -> tuple[np.ndarray, np.ndarray]:
    """The same and its derivative by w."""
    _, back, state = _states(cut, w)
    return read(cut.C, state) + cut.D[..., 0], -read(cut.C, back @ state)


def _states(cut, w):
    """`w I - E`, its inverse, and the states for a unit force."""
    A = np.asarray(w)[..., None, None] * np.eye(cut.E.shape[-1]) - cut.E
    back = inverse(A)
    return A, back, refined(A, back, cut.B + 0 * A[..., :1])


def read(C, state):
    """`C state`, `(..., 3)`, added up state by state: BLAS, and numpy's own sums, round differently in a batch of another
    size, and a sweep's bytes must not depend on its chunks."""
    total = C[..., :, 0] * state[..., 0, :]
    for k in range(1, C.shape[-1]):
        total = total + C[..., :, k] * state[..., k, :]
    return total


def residual(t: Terms, K, B):
    """Relative residual of the characteristic equation: 0 exact, 1 meaningless."""
    parts = np.abs(t.one) + np.abs(K * t.x) + np.abs(B * t.v)
    return np.abs(t.one - K * t.x - B * t.v) / parts
