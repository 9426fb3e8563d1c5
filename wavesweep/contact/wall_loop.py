"""A loop cut at its wall: what the wall reads once a frame, as its force moves it, with bounds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.engine.frames import ADVANCE, OFFSET, VELOCITY, Bounded, LinearFractional, balance
from wavesweep.engine.poles import count_outside
from wavesweep.program.analyses.free_space import without_wall_in_words

BOUNDS_OF_DOUBLES = 4.0  # times the bounds: they are computed in doubles as well


@dataclass(frozen=True, slots=True, eq=False)
class WallLoop:
    """A loop without its wall, with `w = z - 1`:

        x = (R/w + p (w - E)^-1 B + d_x) F,   v = (c (w - E)^-1 B + d_v) F.

    x, v: what stiffness and damping of the wall multiply, once a frame; F: its force. E `(n, n)`,
    B `(n,)`, rows `(2, n)`: p and c; direct `(2,)`: d_x and d_v; residue: R, 0 if no position
    drifts. stable: whether all eigenvalues of `I + E`, and of what the wall does not act on, are
    proved to lie inside the unit circle; unstable: whether some are proved to lie outside.
    """

    E: Bounded
    B: Bounded
    rows: Bounded
    direct: Bounded
    residue: Bounded
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
        E = Bounded(cut.E, cut.dE)
        B = Bounded(cut.B, cut.dB).part(slice(None), 0)
        C = Bounded(cut.C, cut.dC)
        direct = Bounded(cut.D, cut.dD).part(slice(None), 0)
        both = [OFFSET, VELOCITY]
        rows = C.part(both)
        residue = Bounded.exact(0.0)
        apart = [count_outside(block[None]) for block in cut.uncontrolled]
        counts = [count_outside(cut.E[None], cut.dE[None]), *apart]
        stable = all(count[0] == 0 and clear[0] for count, clear in counts)
        unstable = any(count[0] > 0 and clear[0] for count, clear in counts)
        if cut.integrates:
            residue = direct.part(ADVANCE)
        if cut.integrates and cut.E.size:
            row = C.part([ADVANCE]) @ E.inverse()
            if not np.isfinite(row.error).all():
                return None
            rows = Bounded.joined([rows.part([0]) + row, rows.part([1])], -2)
            residue = residue - (row @ B).part(0)
        return WallLoop(E, B, rows, direct.part(both), residue, stable, unstable)

    @property
    def without_wall(self) -> str:
        """That the loop is unstable where its wall is not touched, in words."""
        modes = 1 + np.linalg.eigvals(self.E.value)
        return without_wall_in_words(float(np.abs(modes).max()))

    def responses(self, angles: np.ndarray) -> np.ndarray:
        """Return `G_x` without its pole, and `G_v`, at angles of the unit circle, without bounds.

        angles `(angles,)`; the result is `(angles, 2)`.
        """
        B = self.B.value.astype(complex)
        w = shifted(angles)[:, None, None] * np.eye(B.size) - self.E.value
        X = np.linalg.solve(w, np.broadcast_to(B, (angles.size, B.size))[..., None])[..., 0]
        return X @ self.rows.value.T + self.direct.value


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
        responses[:, 0] += self.loop.residue.value / shifted(angles)
        return 1 - self.fixed * responses[:, 1 - self.index], -responses[:, self.index]


def shifted(angles: np.ndarray) -> np.ndarray:
    """Return `exp(j angle) - 1`, with all digits near 1."""
    return -2 * np.sin(angles / 2) ** 2 + 1j * np.sin(angles)


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
