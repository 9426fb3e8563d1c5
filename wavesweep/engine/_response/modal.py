"""The resolvent of a frame through its modes."""

from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.bounded import sum_rounding
from wavesweep.engine._monodromy.unit_circle import solve

INVERSE_ERROR = 0.1  # relative error of an inverse up to which it bounds the error of what it gives
MODAL_NOISE = 1e-13  # of the sizes of the modes: rounding of an entry of their sum


class ModalSolution(NamedTuple):
    """X of `(w - E) X = b`, `(..., n, points)`, and three measures of its accuracy.

    unsure: the uncertainty of its equations. gain: the sizes of the modes' factors. off: a bound on
    the relative error of the inverse.
    """

    X: np.ndarray
    unsure: np.ndarray
    gain: np.ndarray
    off: np.ndarray


class Modal:
    """The resolvent `(w - E)^-1` through the modes of E, as an approximate inverse whose error is
    known.

    E `(..., n, n)`; error: bounds on the errors of its entries.
    """

    def __init__(self, E: np.ndarray, error: np.ndarray) -> None:
        self.E = E
        self.error = error
        self.poles, self.vectors = np.linalg.eig(E)
        self.vectors = self.vectors.astype(complex)
        eye = np.broadcast_to(np.eye(E.shape[-1]), E.shape)
        self.into = solve(self.vectors, eye)
        self.defect = np.abs(self.into @ E @ self.vectors - self.poles[..., None, :] * eye).sum(-1)

    def solve(self, w: np.ndarray, b: np.ndarray, db: np.ndarray) -> ModalSolution:
        """Return X of `(w - E) X = b` and how accurate it is; db: error of b."""
        factor = 1 / (w - self.poles[..., None])
        E = self.E + 0j
        X = self.vectors @ (factor * (self.into @ b))
        for _ in range(2):
            left = b - w * X + E @ X
            X = X + self.vectors @ (factor * (self.into @ left))
        left = b - w * X + E @ X
        size = np.abs(X)
        terms = np.abs(w) * size + np.abs(self.E) @ size + np.abs(b)
        rounding = sum_rounding(X.shape[-2] + 2, of_complex=True)
        unsure = np.abs(left) + rounding * terms + self.error @ size + db
        gain = np.abs(factor)
        off = (gain * self.defect[..., None]).max(-2, keepdims=True, initial=0)
        return ModalSolution(X, unsure, gain, off)

    def bound(self, unsure: np.ndarray, gain: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Return a bound on the error of X, from the sizes of the modes; unsure, gain, off: see
        `solve`."""
        bound = np.abs(self.vectors) @ (gain * (np.abs(self.into) @ unsure))
        return np.where(off <= INVERSE_ERROR, bound * (1 + 2 * off), np.inf)

    def careful_bound(
        self, w: np.ndarray, unsure: np.ndarray, gain: np.ndarray, off: np.ndarray
    ) -> np.ndarray:
        """Return a bound on the error of X from the inverse itself, in which modes cancel.

        w, unsure, gain, off: of the points, see `solve`.
        """
        factor = (1 / (w - self.poles[..., None])).mT[..., None, :]
        unsure = unsure.mT[..., None]
        gain = gain.mT[..., None]
        vectors = self.vectors[..., None, :, :]
        into = self.into[..., None, :, :]
        inverse = (vectors * factor) @ into
        noise = MODAL_NOISE * (np.abs(vectors) @ (gain * (np.abs(into) @ unsure)))
        bound = (np.abs(inverse) @ unsure + noise)[..., 0].mT
        return np.where(off <= INVERSE_ERROR, bound * (1 + 2 * off), np.inf)
