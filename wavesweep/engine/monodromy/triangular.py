"""Loops in states in which they are diagonal, or triangular: what an input reaches, in few operations at each point."""

from dataclasses import dataclass

import numpy as np

from wavesweep.engine.monodromy.rounding import balance
from wavesweep.engine.monodromy.unit_circle import inverse, on_circle
from wavesweep.engine.state_space import StateSpace

CLOSE = 1e-9  # of a frame in its eigenvectors, the error up to which these serve


@dataclass(frozen=True, slots=True, eq=False)
class TriangularForm:
    """Frames less identity as `u V T V^-1 u^-1`, T diagonal or upper triangular, u units of the states.

    T, V, Z: `(loops, n, n)`, complex, Z being what is computed of V^-1. units: `(loops, n)`. error: `(loops,)`, of all solves
    with T: what they give is that of `T + X`, the Frobenius norm of X being at most so large. diagonal: whether T is.
    """

    T: np.ndarray
    V: np.ndarray
    Z: np.ndarray
    units: np.ndarray
    error: np.ndarray
    diagonal: bool

    @staticmethod
    def of(E) -> "TriangularForm":
        """Return the form of each of some loops, `(loops, n, n)`, by eigenvectors, or Schur's if these are nearly dependent.

        With `E V = V T + R` the frame is `V (T + V^-1 R) V^-1`. If the norm f of `1 - Z V` is below 1/2, that of V^-1 is at
        most twice that of Z. Z moves the states that are reached and read by f of themselves, and rounding of sums of n terms
        by as many roundings, times the condition of V.
        """
        balanced, units = balance(E)
        T, V, Z, error = _with_error(balanced, *_eigenvectors(balanced))
        diagonal = bool((error <= CLOSE).all())
        if not diagonal:
            T, V, Z, error = _with_error(balanced, *_schur(balanced))
        return TriangularForm(T, V, Z, units, error, diagonal)

    def system(self, system: StateSpace) -> StateSpace:
        """Return these loops in these states; of a diagonal E the diagonal alone, `(loops, 1, n)`."""
        B = system.B / self.units[:, :, None]
        C = system.C * self.units[:, None, :]
        return StateSpace(self.frames, self.Z @ B, C @ self.V, system.D)

    @property
    def frames(self) -> np.ndarray:
        """T, or of a diagonal one the diagonal alone, `(loops, 1, n)`."""
        return np.diagonal(self.T, axis1=-2, axis2=-1)[:, None] if self.diagonal else self.T

    def reached(self, E, B, theta):
        """Return `(w I - E)^-1 B` at `w = exp(j theta) - 1`, `(..., n)`; E, B: of `system`. See `DelayLines.reached`."""
        return self.solved(E, B[..., 0], on_circle(theta))

    def row(self, E, C, theta):
        """Return `C (w I - E)^-1`, `(..., n)`."""
        return self.read(E, C[..., 0, :], on_circle(theta))

    def solved(self, E, right, w):
        """Return `(w I - E)^-1 right`, `(..., n)`; E: of `frames`."""
        if self.diagonal:
            return right / (w[..., None] - E[..., 0, :])
        return _forward(E[..., ::-1, ::-1], right[..., ::-1], w)[..., ::-1]

    def read(self, E, left, w):
        """Return `left (w I - E)^-1`, `(..., n)`; E: of `frames`."""
        if self.diagonal:
            return left / (w[..., None] - E[..., 0, :])
        return _forward(np.swapaxes(E, -1, -2), left, w)


def _forward(T, right, w):
    """Return `(w I - T)^-1 right`, `(..., n)`; T: lower triangular, `(..., n, n)`."""
    n = T.shape[-1]
    T = np.moveaxis(T, (-2, -1), (0, 1))
    states = np.empty((n, *w.shape), complex)
    states[...] = np.moveaxis(np.broadcast_to(right, (*w.shape, n)), -1, 0)
    for k in range(n):
        states[k] /= w - T[k, k]
        states[k + 1 :] += T[k + 1 :, k] * states[k]
    return np.moveaxis(states, 0, -1)


@np.errstate(all="ignore")
def _with_error(E, T, V, Z):
    identity = np.eye(E.shape[-1])
    rounding = 2 * (len(identity) + 8) * np.finfo(float).eps
    of_T, of_V, of_Z = _norm(T), _norm(V), _norm(Z)
    off = _norm(identity - Z @ V) + rounding * of_Z * of_V
    missed = _norm(E @ V - V @ T) + rounding * of_V * (_norm(E) + of_T)
    error = 2 * of_Z * missed + 2 * (off + rounding * (1 + of_Z * of_V)) * (2 + of_T)
    return T, V, Z, np.where(off < 0.5, error, np.inf)


def _eigenvectors(E):
    values, V = np.linalg.eig(E)
    V = V.astype(complex)
    return values[:, :, None] * np.eye(E.shape[-1]), V, inverse(V)


def _schur(E):
    from scipy.linalg import schur

    T, V = np.empty((2, *E.shape), complex)
    for loop, matrix in enumerate(E):
        T[loop], V[loop] = schur(matrix, output="complex")
    return T, V, np.swapaxes(V.conj(), -1, -2)


def _norm(matrices):
    return np.linalg.norm(matrices, axis=(-1, -2))
