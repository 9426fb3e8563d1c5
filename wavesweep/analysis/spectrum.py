"""Eigenvalues of the closed loop: spectral radius and verdict."""

import numpy as np

from wavesweep.lifted import Cut, close


def spectral_radius(cut: Cut, K_VE, B_VE) -> np.ndarray:
    """Largest modulus among the eigenvalues of the frame-to-frame matrix, drift set aside; infinite after overflow.

    cut: loops; K_VE (N/m), B_VE (N*s/m): numbers or arrays that broadcast with the batch.
    Accuracy: that of the eigenvalue, 1e-14 relative where it is well conditioned.
    """
    E = close(cut, K_VE, B_VE)
    finite = np.isfinite(E).all((-1, -2))
    values = np.linalg.eigvals(np.where(finite[..., None, None], E, 0.0))
    return np.where(finite, np.abs(1 + values).max(-1, initial=0.0), np.inf)
