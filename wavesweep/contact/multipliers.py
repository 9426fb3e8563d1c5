"""Multipliers by linear programmes on angles of the circle: the finder, whose finds are checked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wavesweep.contact.wall_loop import WallLoop, WallsAlong, shifted

LAGS = 12  # frames before and after; 40 find no more
LEAST_SHARE = 1e-7  # share of |1 + L| by which the condition has to hold at every angle


@dataclass(frozen=True, slots=True, eq=False)
class Multiplier:
    """`M(z) = 1 - sum h_k z^-k` with h_k >= 0 for k = -N .. N without 0, whose sum is below 1.

    before `(N,)`: h_1 .. h_N; after `(N,)`: h_-1 .. h_-N.
    """

    before: np.ndarray
    after: np.ndarray

    def at(self, angles: np.ndarray) -> np.ndarray:
        """Return M at `z = exp(j angle)`."""
        back = np.exp(-1j * np.outer(angles, np.arange(1, self.before.size + 1)))
        return 1 - back @ self.before - back.conj() @ self.after


@dataclass(frozen=True, slots=True, eq=False)
class Sampled:
    """A loop at some angles: G_x without its pole, and G_v, `(angles, 2)`; the pole's residue."""

    angles: np.ndarray
    responses: np.ndarray
    residue: float

    @staticmethod
    def of(loop: WallLoop, more: np.ndarray) -> Sampled:
        """Sample at angles that crowd towards z = 1 and towards the poles, and at more of them."""
        slow = np.geomspace(1e-4, 0.05, 24)
        poles = np.linalg.eigvals(loop.E.value)
        near = np.abs(np.angle(1 + poles[poles.imag > 0]))
        width = np.abs(1 - np.abs(1 + poles[poles.imag > 0]))
        steps = np.array([-4, -2, -1, -0.5, 0, 0.5, 1, 2, 4])
        about = (near[:, None] + np.maximum(width, 1e-6)[:, None] * steps).ravel()
        angles = np.concatenate([slow, np.linspace(0.05, np.pi, 90), about, more])
        angles = np.unique(angles[(angles > 0) & (angles <= np.pi)])
        return Sampled(angles, loop.responses(angles), float(loop.residue.value))

    def opened(self, wall) -> np.ndarray:
        """`1 + L` at the angles, of a wall (K, B); with its pole."""
        pole = wall[0] * self.residue / shifted(self.angles)
        return 1 - self.responses @ np.asarray(wall) - pole

    def multiplier(self, walls: np.ndarray, lags: int = LAGS) -> tuple[Multiplier, float]:
        """Return the multiplier that serves all these walls best, and by how much.

        walls: `(walls, 2)`. The margin is negative if none serves: the largest of the smallest
        `Re M (1 + L)` over walls and angles, relative to |1 + L| or, near a pole at z = 1, to the
        sizes of what this is made of without the pole.
        """
        from scipy.optimize import linprog

        back = np.exp(-1j * np.outer(self.angles, np.arange(1, lags + 1)))
        turns = np.concatenate([back, back.conj()], axis=1)
        directions = []
        for wall in walls:
            opened = self.opened(wall)
            sizes = 1 + np.abs(self.responses) @ np.abs(wall) + abs(wall[0] * self.residue)
            scale = np.minimum(np.abs(opened), sizes)
            directions.append(opened / np.maximum(scale, LEAST_SHARE * sizes))
        direction = np.concatenate(directions)
        rows = (np.tile(turns, (len(walls), 1)) * direction[:, None]).real
        limits = direction.real
        above = np.concatenate([rows, np.ones((len(rows), 1))], axis=1)
        of_sum = np.append(np.ones(2 * lags), 0.0)
        cost = np.append(np.zeros(2 * lags), -1.0)
        # The weights add up to less than 1.
        found = linprog(
            cost,
            A_ub=np.concatenate([above, of_sum[None]]),
            b_ub=np.append(limits, 1 - 1e-6),
            bounds=[*[(0, None)] * (2 * lags), (None, 1)],
            method="highs",
        )
        if found.status != 0:
            return Multiplier(np.zeros(lags), np.zeros(lags)), -1.0
        weights = np.maximum(found.x[:-1], 0.0)
        multiplier = Multiplier(weights[:lags], weights[lags:])
        return multiplier, float(-found.fun)

    def reach(self, multiplier: Multiplier, walls: WallsAlong) -> tuple[float, float]:
        """Return between which values a multiplier serves at all sampled angles."""
        M = multiplier.at(self.angles)
        one, other = walls.opened(self.angles)
        offset, slope = (M * one).real, (M * other).real
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -offset / slope
        low = np.max(np.where(slope > 0, zero, -np.inf))
        high = np.min(np.where(slope < 0, zero, np.inf))
        return float(low), float(high)

    def missed(self, multiplier: Multiplier, loop: WallLoop, walls: np.ndarray) -> np.ndarray:
        """Return angles between those sampled at which a multiplier does not serve all these walls."""
        number = np.arange(self.angles.size)
        angles = np.interp(np.arange(0, number[-1], 1 / 8), number, self.angles)
        between = Sampled(angles, loop.responses(angles), self.residue)
        M = multiplier.at(angles)
        fails = [(M * between.opened(wall)).real <= 0 for wall in walls]
        return angles[np.any(fails, axis=0)][:20]
