"""A loop cut at its wall: what the wall reads once a frame, as its force moves it, with bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.frames import ADVANCE, OFFSET, VELOCITY, LinearFractional, balance
from wavesweep.engine.poles import count_outside

BOUNDS_OF_DOUBLES = 4.0  # times the bounds: they are computed in doubles as well
LEAST_SURE = 1e-2  # what inverse times matrix may be off the identity


@dataclass(frozen=True, slots=True, eq=False)
class Inverse:
    """An approximate inverse S of each of several matrices A, `(..., n, n)`.

    The true one is `(I - D)^-1 S` for some D with `|D| <= off`, entry by entry; alpha `(...)`: the
    largest row sum of `off`.
    """

    S: np.ndarray
    off: np.ndarray
    alpha: np.ndarray

    @staticmethod
    def of(A: np.ndarray, dA: np.ndarray) -> Inverse:
        """Invert matrices whose entries are known to within dA.

        Accuracy: alpha is about the condition of A times rounding; from LEAST_SURE on nothing is
        known.
        """
        n = A.shape[-1]
        S = np.linalg.inv(A)
        size = np.abs(S)
        off = np.abs(np.eye(n) - S @ A)
        rounded = EPS * (n + 4) * (size @ np.abs(A) + np.eye(n))
        off = off + BOUNDS_OF_DOUBLES * (rounded + size @ dA)
        return Inverse(S, off, off.sum(-1).max(-1))

    @property
    def size(self) -> np.ndarray:
        """A bound on the norms of the true inverses: their largest row sums, `(...)`."""
        return np.abs(self.S).sum(-1).max(-1) / (1 - self.alpha)

    def times(self, vector: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return `A^-1 vector`, `(..., n)`, and a bound on the errors of its entries, `(...)`.

        error `(...)`: of every entry of the vector.
        """
        n = vector.shape[-1]
        result = (self.S @ vector[..., None])[..., 0]
        products = (np.abs(self.S) @ np.abs(vector)[..., None])[..., 0].max(-1)
        rounded = EPS * (n + 4) * products
        off = (self.alpha * np.abs(result).max(-1) + rounded) / (1 - self.alpha)
        bound = off + self.size * error
        return result, BOUNDS_OF_DOUBLES * bound


@dataclass(frozen=True, slots=True, eq=False)
class WallLoop:
    """A loop without its wall, with `w = z - 1`:

        x = (R/w + p (w - E)^-1 B + d_x) F,   v = (c (w - E)^-1 B + d_v) F.

    x, v: what stiffness and damping of the wall multiply, once a frame; F: its force. E `(n, n)`,
    B `(n,)`, rows `(2, n)`: p and c; direct `(2,)`: d_x and d_v; residue: R, 0 if no position
    drifts. dE, dB, dRows, dDirect, dResidue: bounds on their errors. stable: whether all
    eigenvalues of `I + E`, and of what the wall does not act on, are proved to lie inside the unit
    circle; unstable: whether some are proved to lie outside.
    """

    E: np.ndarray
    B: np.ndarray
    rows: np.ndarray
    direct: np.ndarray
    residue: float
    dE: np.ndarray
    dB: np.ndarray
    dRows: np.ndarray
    dDirect: np.ndarray
    dResidue: float
    stable: bool
    unstable: bool

    @staticmethod
    def of(cut: LinearFractional) -> WallLoop | None:
        """Return the loop of a single cut at both numbers of its wall.

        With an integrator the cut has `G_x = G_a/w + G_o`. Since
        `w (w - E)^-1 E^-1 = (w - E)^-1 + E^-1`, its pole has the residue `R = d_a - c_a E^-1 B`,
        and what is left is `(c_o + c_a E^-1) (w - E)^-1 B + d_o`. None if E has no inverse that is
        known, or another pole at 1 by its pattern, as of a mass that nothing brakes.
        """
        if cut.poles_at_one:
            return None
        cut = _in_units(cut)
        B = cut.B[:, 0]
        dB = cut.dB[:, 0]
        direct = cut.D[:, 0]
        both = [OFFSET, VELOCITY]
        rows = cut.C[both]
        dRows = cut.dC[both]
        dDirect = cut.dD[both, 0]
        residue = 0.0
        dResidue = 0.0
        apart = [count_outside(block[None]) for block in cut.uncontrolled]
        counts = [count_outside(cut.E[None], cut.dE[None]), *apart]
        stable = all(count[0] == 0 and clear[0] for count, clear in counts)
        unstable = any(count[0] > 0 and clear[0] for count, clear in counts)
        if cut.integrates and cut.E.size:
            inverse = Inverse.of(cut.E, cut.dE)
            if not inverse.alpha < LEAST_SURE:
                return None
            row, error = _row_times(inverse, cut.C[ADVANCE], cut.dC[ADVANCE])
            rows = np.stack([rows[0] + row, rows[1]])
            dRows = np.stack([dRows[0] + error, dRows[1]]) + EPS * np.abs(rows)
            residue = float(direct[ADVANCE] - row @ B)
            lost = EPS * (B.size + 2) * (np.abs(row) @ np.abs(B) + abs(direct[ADVANCE]))
            of_products = error @ (np.abs(B) + dB) + np.abs(row) @ dB
            dResidue = float(BOUNDS_OF_DOUBLES * (of_products + cut.dD[ADVANCE, 0] + lost))
        elif cut.integrates:
            residue = float(direct[ADVANCE])
            dResidue = float(cut.dD[ADVANCE, 0])
        known = cut.E, B, rows, direct[both], residue
        errors = cut.dE, dB, dRows, dDirect, dResidue
        return WallLoop(*known, *errors, stable, unstable)

    def responses(self, angles: np.ndarray) -> np.ndarray:
        """Return `G_x` without its pole, and `G_v`, at angles of the unit circle, without bounds.

        angles `(angles,)`; the result is `(angles, 2)`.
        """
        w = shifted(angles)[:, None, None] * np.eye(self.B.size) - self.E
        B = np.broadcast_to(self.B.astype(complex), (angles.size, self.B.size))
        X = np.linalg.solve(w, B[..., None])[..., 0]
        return X @ self.rows.T + self.direct


@dataclass(frozen=True, slots=True, eq=False)
class WallsAlong:
    """Walls of a loop along one of their numbers: index 0 is K, with B `fixed`; 1 is B, K fixed."""

    loop: WallLoop
    index: int
    fixed: float

    def at(self, *values: float) -> np.ndarray:
        """The walls of these values, `(values, 2)`."""
        walls = np.full((len(values), 2), float(self.fixed))
        walls[:, self.index] = values
        return walls

    def opened(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return one and other, `(angles,)`, of which `1 + L` is `one + value other`."""
        responses = self.loop.responses(angles)
        responses[:, 0] += self.loop.residue / shifted(angles)
        return 1 - self.fixed * responses[:, 1 - self.index], -responses[:, self.index]


def shifted(angles: np.ndarray) -> np.ndarray:
    """Return `exp(j angle) - 1`, with all digits near 1."""
    return -2 * np.sin(angles / 2) ** 2 + 1j * np.sin(angles)


def _row_times(inverse, row, error):
    """The row times the true inverse, and a bound on the errors of its entries."""
    n, size = row.size, np.abs(inverse.S)
    alpha = inverse.alpha
    most = size + alpha / (1 - alpha) * size.max(0)
    rounded = EPS * (n + 4) * (np.abs(row) @ size)
    return row @ inverse.S, BOUNDS_OF_DOUBLES * (
        (np.abs(row) @ inverse.off + error) @ most + rounded
    )


def _in_units(cut):
    """The cut in units of the states, powers of two, that give rows and columns similar sizes."""
    _, units = balance(cut.E[None])
    units = units[0]
    scaled = {
        "E": cut.E * (units[None, :] / units[:, None]),
        "dE": cut.dE * (units[None, :] / units[:, None]),
        "B": cut.B / units[:, None],
        "dB": cut.dB / units[:, None],
        "C": cut.C * units[None, :],
        "dC": cut.dC * units[None, :],
    }
    return replace(cut, **scaled)
