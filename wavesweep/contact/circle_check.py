"""The check of a proof: a given multiplier serves on the whole unit circle, whatever rounding does.

Nothing here depends on how the multiplier was found, and nothing is sampled: the circle is covered
by arcs, and on each the condition is a linear function of the angle with a bound on all that is
left out. See docs/proof.md, "A wall that pushes and never pulls".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wavesweep.contact.wall_loop import BOUNDS_OF_DOUBLES, WallLoop, shifted
from wavesweep.engine.doubles import EPS
from wavesweep.engine.frames import Bounded, sum_rounding

FIRST_ARCS = 64  # of half the circle


@dataclass(frozen=True, eq=False)
class Multiplier:
    """`M(z) = 1 - sum h_k z^-k` with h_k >= 0 for k = -N .. N without 0, whose sum is below 1.

    before `(N,)`: h_1 .. h_N; after `(N,)`: h_-1 .. h_-N.
    """

    before: np.ndarray
    after: np.ndarray

    @property
    def allowed(self) -> bool:
        """Whether the weights are those of a multiplier."""
        total = self.before.sum() + self.after.sum()
        rounded = sum_rounding(2 * self.before.size + 2) * total
        return bool((self.before >= 0).all() and (self.after >= 0).all() and total + rounded < 1)

    @cached_property
    def lags(self) -> np.ndarray:
        """k = 1 .. N."""
        return np.arange(1, self.before.size + 1)

    @property
    def bend(self) -> float:
        """A bound on the second derivative of M in the angle."""
        return float(self.lags**2 @ (self.before + self.after))

    def at(self, angles: np.ndarray) -> tuple[Bounded, Bounded]:
        """Return M and its derivative in the angle at `z = exp(j angle)`.

        In roundings u, an angle up to pi times k is off by pi k, a cosine or sine by 2, and of
        weights that add up to 1 the sums of 2 N complex products by `sqrt(2) 4 N`: at most `9 N +
        8`, of which `2 (N + 4)^2` is more for every N, and N times as much in the derivative.
        """
        back = np.exp(-1j * np.outer(angles, self.lags))
        on = back.conj()
        slope = back @ (1j * self.lags * self.before) - on @ (1j * self.lags * self.after)
        lost = EPS * (self.lags.size + 4) ** 2 * np.ones(angles.size)
        value = 1 - back @ self.before - on @ self.after
        return Bounded(value, lost), Bounded(slope, self.lags.size * lost)

    @cached_property
    def beside_pole(self) -> np.ndarray:
        """The coefficients q_0 .. q_N of `Re M/(z - 1) = sum q_i cos(i angle)` on the circle.

        `Re 1/(z - 1) = -1/2`, `z^-k/(z - 1) = 1/(z - 1) - sum_{i=1..k} z^-i`, and for positive
        powers `z^k/(z - 1) = 1/(z - 1) + sum_{i=0..k-1} z^i`.
        """
        back, on = (np.cumsum(each[::-1])[::-1] for each in (self.before, self.after))
        q = np.append(0.0, back) - np.append(on, 0.0)  # sums of h_i, h_i+1, ...
        q[0] -= (1 - self.before.sum() - self.after.sum()) / 2
        return q

    @property
    def pole_bend(self) -> float:
        """A bound on the second derivative of `Re M/(z - 1)` in the angle."""
        return float(np.arange(self.beside_pole.size) ** 2 @ np.abs(self.beside_pole))

    def pole_part(self, angles: np.ndarray) -> tuple[Bounded, Bounded]:
        """Return `Re M/(z - 1)` and its derivative in the angle.

        Coefficients q are up to 1, and off by 2 N roundings; of N + 1 products with cosines as in
        `at` all are off by at most `(N + 1)(7 N + 4)`, of which `2 (N + 4)^3` is more.
        """
        orders = np.arange(self.beside_pole.size)
        turned = np.outer(angles, orders)
        lost = EPS * (self.lags.size + 4) ** 3 * np.ones(angles.size)
        value = np.cos(turned) @ self.beside_pole
        slope = -np.sin(turned) @ (orders * self.beside_pole)
        return Bounded(value, lost), Bounded(slope, orders.size * lost)


def open_angles(loop: WallLoop, walls: np.ndarray, multiplier: Multiplier) -> np.ndarray:
    """Return angles at which `Re M (1 - K G_x - B G_v) > 0` is not proved.

    There are none if it is proved on the whole circle, for all loops within the bounds of `loop`.
    These have to be stable without a wall, but for a pole of `-K G_x` at z = 1, whose residue has
    to be positive. The one angle NaN says that this, or the multiplier, is not as it has to be.

    walls `(walls, 2)`: K and B of each. The condition is linear in both: what holds at all walls
    holds between them.
    """
    stiffness = walls[:, 0]
    residue, dResidue = loop.residue
    drifts = stiffness[(stiffness != 0) & (loop.residue.size != 0)]
    opposed = -drifts * residue > np.abs(drifts) * dResidue
    if not (loop.stable and multiplier.allowed and opposed.all()):
        return np.array([np.nan])
    width = np.pi / FIRST_ARCS
    middles = width * (np.arange(FIRST_ARCS) + 0.5)
    looked_at = 0
    while middles.size:
        looked_at += middles.size
        if looked_at > 8_000:  # arcs in one check
            return middles
        least, at_middle = _least(loop, walls, multiplier, middles, width / 2)
        if (at_middle < 0).any():
            return middles[at_middle < 0]
        doubtful = ~(least > 0)
        width /= 2
        halves = middles[doubtful] - width / 2, middles[doubtful] + width / 2
        middles = np.concatenate(halves)
    return middles


def _least(loop, walls, multiplier, middles, half):
    """Return what the condition's left side is at least on arcs of this half width, `(arcs,)`.

    It is the least over the walls, NaN where no bound is known. Returned too is its value at the
    middles, without bounds.

    On an arc, M differs by `rest_m` from `m + m1 s`, and `1 - K G_x - B G_v` without its pole by
    `rest_a` from `a + a1 s`, with s the angle from the middle.
    """
    # Neighbouring arcs overlap, as their middles are sums of some dozens of rounded halves.
    half = half + 2.0**-44
    curved = half**2 / 2
    about = _resolvents(loop, middles, half)
    m, m1 = multiplier.at(middles)
    q, q1 = multiplier.pole_part(middles)
    rest_m = curved * multiplier.bend
    least, at_middle = np.full(middles.size, np.inf), np.full(middles.size, np.inf)
    for wall in walls:
        a, a1, rest_a = _opened(loop, wall, about, curved)
        pole = loop.residue * -wall[0]
        value = (m * a).real + pole * q
        slope = (m * a1 + m1 * a).real + pole * q1
        rest = half**2 * m1.size * a1.size + curved * multiplier.pole_bend * pole.size
        rest = rest + rest_m * (a.size + half * a1.size + rest_a)
        rest = rest + rest_a * (m.size + half * m1.size)
        off = value.error + half * slope.size + rest * (1 + 64 * EPS)
        bound = value.value - off - 8 * EPS * (value.size + off)
        least = np.minimum(least, np.where(about.converges, bound, np.nan))
        at_middle = np.minimum(at_middle, value.value)
    return least, at_middle


def _opened(loop, wall, about, curved):
    """Return `1 - K G_x - B G_v` without its pole at middles of arcs, its slope, and the rest."""
    row = Bounded.exact(wall) @ loop.rows
    one = Bounded.exact(1.0)
    a = one - Bounded.exact(wall) @ loop.direct - about.X @ row
    a1 = (about.X1 @ row) * (one + about.w) * 1j
    return a, a1, curved * a1.size + row.size.sum() * about.rest


@dataclass(frozen=True, slots=True, eq=False)
class _Resolvents:
    """`X = (w - E)^-1 B` and `X1 = (w - E)^-1 X`, its derivative but for the sign, on arcs.

    w `(arcs,)`; X, X1 `(arcs, n)`, at the middles. rest `(arcs,)`: of every entry, what X may
    differ by from `X - (w - w0) X1` on the arc. converges: whether these bounds hold.
    """

    w: Bounded
    X: Bounded
    X1: Bounded
    rest: np.ndarray
    converges: np.ndarray


@np.errstate(all="ignore")  # an inverse that is none does not converge
def _resolvents(loop, middles, half):
    """The resolvents of E at the middles of arcs, with bounds, by the Neumann series
    `(w0 + d - E)^-1 = T - d T^2 + d^2 (1 + d T)^-1 T^3` with `T = (w0 - E)^-1`."""
    w = shifted(middles)
    w = Bounded(w, 2 * EPS * np.abs(w))  # as sines are known
    eye = np.eye(len(loop.B.value))
    T = (w.part(..., None, None) * eye - loop.E).inverse()
    X = T @ loop.B
    X1 = (T @ X.part(..., None)).part(..., 0)
    X2 = T @ X1.part(..., None)
    near = half * T.size.sum(-1).max(-1, initial=0.0)
    rest = BOUNDS_OF_DOUBLES * half**2 * X2.size.max((-1, -2), initial=0.0) / (1 - near)
    # Half an arc times the resolvent's norm, up to which its series converges well.
    return _Resolvents(w, X, X1, rest, near < 0.5)
