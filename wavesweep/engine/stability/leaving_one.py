"""An eigenvalue of a frame that is exactly 1 where the span begins: on which side of the circle it is from there on.

A drift that the number alone stops is such an eigenvalue: without the number nothing opposes it.
Within the errors of entries it may be on either side of 1 next to there, so no test by entries
tells.

Let E(h) be the frame less identity, h >= 0 the distance from the low end, X nearly its eigenvectors
at 0, Z nearly their inverse and `M(w, h) = w ZX - Z E(h) X`, which is singular where w is an
eigenvalue of E(h). With i for the eigenvalue next to 0 and R for the others, and M_RR nonsingular,
that is where

    S(w, h) = M_ii - M_iR M_RR^-1 M_Ri

is 0. S(0, 0) = 0 exactly, whatever the errors are. If M_RR is nonsingular for all |1 + w| = 1 and h
up to some h1, S is the integral of its derivatives, first along the circle at h = 0, then along h:

    S(w, h) = (1 + a) w - h s,   |a| <= pi/2 max |dS/dw - 1|,   |s - b| <= max |dS/dh + b|,

b being the derivative of the eigenvalue at 0. The bound on s - b is convex in |w|. With |a| <= 0.1,
and |s - b| <= 0.3 |b| up to |w| = 3 h |b|, S is not 0 from there on if it is not at |w| = 2, the
farthest; and up to there S = 0 asks for an angle of w that is within 0.41 of 0 or pi, while on the
circle it is next to pi/2. So none is on the circle for 0 < h <= h1. At h = 0 it is S = (1 + a) w,
so all but one are where those of M_RR are, and that one leaves 1 outwards if b > 0.
"""

import numpy as np

from wavesweep.engine.monodromy.unit_circle import solve
from wavesweep.engine.stability.dominance import SURELY, ExactFrames, eigenbasis, expansions, rounding_of
from wavesweep.engine.stability.entries import Panels

SHARES = 0.25 ** np.arange(25)  # of half a panel, how far the proof may reach: the first that succeeds
REFINED = 2  # times, eigenvectors, of which those of a frame with uneven entries are known to a few digits
TURNED, SPREAD, AWAY, NEAR = 0.1, 0.3, 0.15, 3.0  # the most of |a|, of |s/b - 1| and of |h b|; up to which |w| over |h b|


def proved_from_one(panels: Panels, at, errors, low: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how far from `low` on no eigenvalue is on the unit circle, and how many are outside, of each panel of `at`.

    low: the low end of these panels, where the frame has the eigenvalue 1 exactly; it is returned
    where nothing is proved. errors: see `regions_along_any`.
    """
    half, reached, todo = panels.half[at], np.zeros(at.size), np.arange(at.size)
    with np.errstate(all="ignore"):
        beside = _BesideOne(panels, at, errors, low)
        for h in SHARES:
            proved = beside.proved(todo, h)
            reached[todo[proved]] = h
            todo = todo[~proved]
            if not todo.size:
                break
    return np.where(reached > 0, np.minimum(low + half * reached, panels.high[at]), low), beside.outside


class _BesideOne:
    """Bounds on M, S and their derivatives beside the low ends of panels.

    one, others: index of the eigenvalue next to 0, and of the others. far: of the others from the
    unit circle. speed: b, as it comes out, and unsure: by how much it may be another; both in
    halves of a panel. G: of ZX off the identity. e0, e1, e2, B: as in `DominanceTests`, B being
    sizes.
    """

    def __init__(self, panels: Panels, at, errors, low):
        exact = ExactFrames(np.arange(at.size), *errors(panels.column[at], np.full(at.size, low)))
        x, n = (low - panels.middle[at]) / panels.half[at], panels.error.shape[-1]
        D, sizes, error, drift = expansions(panels, at, x, np.zeros(at.size), exact)
        X, Z, block = eigenbasis(D[:, 0])
        for _ in range(REFINED):
            X, Z = _refined(X, Z, D[:, 0])
        B = Z[:, None] @ D @ X[:, None]
        w, slopes = (np.diagonal(terms, axis1=1, axis2=2) for terms in (B[:, 0], B[:, 1]))
        order, number = np.argsort(np.abs(w), 1), np.arange(at.size)
        self.one, self.others = order[:, 0], order[:, 1:]
        others = np.take_along_axis(w, self.others, 1)
        self.far = np.where(block.any(1, keepdims=True), 0.0, np.abs(np.abs(1 + others) - 1))
        speed, aZ, aX, rounding = slopes[number, self.one], np.abs(Z), np.abs(X), rounding_of(n)
        self.speed, self.unsure = speed.real, np.abs(speed.imag)
        self.outside = (2 * others.real + np.abs(others) ** 2 > 0).sum(1) + (self.speed > 0)
        self.e0 = aZ @ (error + rounding * np.abs(D[:, 0])) @ aX
        self.e1 = aZ @ (drift + rounding * sizes[:, 1:].sum(1)) @ aX
        self.e2, self.G = aZ @ panels.rest[at] @ aX, np.abs(Z @ X - np.eye(n)) + rounding * aZ @ aX
        self.B0, self.B1, self.B2, self.B3 = np.abs(B).swapaxes(0, 1)
        self.B0[:, range(n), range(n)] = 0.0

    def proved(self, index, h) -> np.ndarray:
        """Whether it is proved up to h for the tests `index`."""
        size = np.abs(self.speed[index])
        entries, slopes = self.B0[index] + self.e0[index], self.B1[index] + self.e1[index]
        moved = entries + h * slopes + h**2 * self.B2[index] + h**3 * self.B3[index] + h**4 * self.e2[index]
        changes = 2 * h * self.B2[index] + 3 * h**2 * self.B3[index] + 4 * h**3 * self.e2[index]
        inverse, resolved = self._inverse_of_others(index, moved)
        of_w = self._of_w(index, entries, inverse)
        unsure = self.unsure[index] + self._parts(self.e1[index] + changes, index)[0][:, 0, 0]
        near, far = (
            unsure + self._of_h(index, moved + w[:, None, None] * self.G[index], slopes + changes, inverse)
            for w in (NEAR * h * size, np.full(index.size, 2.0))
        )
        turned, apart = np.pi / 2 * of_w < TURNED, h * (size + far) < 2 * (1 - TURNED)
        return resolved & turned & apart & (near < SPREAD * size) & (h * size < AWAY)

    def _inverse_of_others(self, index, moved):
        """Bounds on the entries of the inverse of M_RR, and where there are any."""
        *_, rest = self._parts(moved + 2 * self.G[index], index)
        far, eye = self.far[index], np.eye(rest.shape[-1])
        over_far = np.nan_to_num(rest / far[:, :, None], nan=1.0, posinf=1.0)
        u = solve(eye - over_far, np.ones((index.size, len(eye), 1)))
        resolved = ((u > 0) & (over_far @ u < (1 - SURELY) * u)).all((1, 2))
        over_far[~resolved] = 0.0
        return solve(eye - over_far, eye / far[:, None, :]), resolved

    def _of_w(self, index, entries, inverse):
        """The most of `dS/dw - 1` at h = 0."""
        G = self.G[index]
        G_ii, G_iR, G_Ri, G_RR = self._parts(G, index)
        _, M_iR, M_Ri, _ = self._parts(entries + 2 * G, index)
        left, right = M_iR @ inverse, inverse @ M_Ri
        return (G_ii + G_iR @ right + left @ G_Ri + left @ (np.eye(G_RR.shape[-1]) + G_RR) @ right)[:, 0, 0]

    def _of_h(self, index, M, slopes, inverse):
        """The most of `dS/dh` without the derivative of M_ii."""
        _, M_iR, M_Ri, _ = self._parts(M, index)
        _, d_iR, d_Ri, d_RR = self._parts(slopes, index)
        left, right = M_iR @ inverse, inverse @ M_Ri
        return (left @ d_Ri + d_iR @ right + left @ d_RR @ right)[:, 0, 0]

    def _parts(self, array, index):
        """The entry of the eigenvalue, its row, its column, and the rest."""
        one, others = self.one[index, None, None], self.others[index]
        number, row, column = np.arange(index.size)[:, None, None], others[:, None, :], others[:, :, None]
        return array[number, one, one], array[number, one, row], array[number, column, one], array[number, column, row]


def _refined(X, Z, E):
    """Eigenvectors that are turned by what is left of E between the one whose eigenvalue is next to 0 and the others."""
    B = Z @ E @ X
    order = np.argsort(np.abs(np.diagonal(B, axis1=1, axis2=2)), 1)
    number, one, others = np.arange(len(B))[:, None], order[:, :1], order[:, 1:]
    rest = B[number[:, :, None], others[:, :, None], others[:, None, :]] - B[number, one, one][:, :, None] * np.eye(
        len(B[0]) - 1
    )
    turn = np.zeros_like(B)
    turn[number, one, others] = solve(rest.swapaxes(1, 2), B[number, one, others][:, :, None])[:, :, 0]
    turn[number, others, one] = -solve(rest, B[number, others, one][:, :, None])[:, :, 0]
    turn = np.nan_to_num(turn, nan=0.0, posinf=0.0, neginf=0.0)
    return X + X @ turn, Z - turn @ Z
