"""An eigenvalue of a frame that is exactly 1 where the span begins: on which side of the circle it
is from there on.

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

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.engine._monodromy.unit_circle import solve
from wavesweep.engine._stability.dominance import (
    DOMINANT_BY,
    ExactFrames,
    eigenbasis,
    expansions,
    rounding_of,
)
from wavesweep.engine._stability.entries import Panels

# in halves of a panel, how far the proof may reach: the first that succeeds is the farthest
REACHES = 0.25 ** np.arange(25)
# The hypotheses of the proof above, without unit:
MOST_TURNED = 0.1  # the most of |a|
MOST_SPREAD_OF_SLOPE = 0.3  # the most of |s/b - 1|, up to |w| = WITHIN h |b|
MOST_AWAY = 0.15  # the most of |h b|
WITHIN = 3.0


def proved_from_one(
    panels: Panels, panel: np.ndarray, errors: Callable[..., Any], low: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the value up to which, from `low` on, no eigenvalue is on the unit circle, and how
    many are outside there, `(panel.size,)` both.

    panel: indices into `panels`. low: the low end of these, where the frame has the eigenvalue 1
    exactly; it is returned where nothing is proved. errors: see `regions_along_any`.
    """
    reached = np.zeros(panel.size)  # in halves of a panel
    todo = np.arange(panel.size)
    with np.errstate(all="ignore"):
        beside = _BesideOne.of(panels, panel, errors, low)
        for h in REACHES:
            proved = beside.proved(todo, h)
            reached[todo[proved]] = h
            todo = todo[~proved]
            if not todo.size:
                break
    high = np.minimum(low + panels.half[panel] * reached, panels.high[panel])
    return np.where(reached > 0, high, low), beside.outside


@dataclass(frozen=True, slots=True)
class _BesideOne:
    """Bounds on M, S and their derivatives beside the low ends of panels.

    one, others: index of the eigenvalue next to 0, and of the others. far: of the others from the
    unit circle. speed: b, as it comes out, and unsure: by how much it may be another; both in
    halves of a panel. outside: number of eigenvalues outside. G: of ZX off the identity. e0, e1,
    e2: as in `DominanceTests`; B0, B1, B2, B3: sizes of `Z D0 X` off the diagonal, of `Z D1 X` and
    so on.
    """

    one: np.ndarray
    others: np.ndarray
    far: np.ndarray
    speed: np.ndarray
    unsure: np.ndarray
    outside: np.ndarray
    G: np.ndarray
    e0: np.ndarray
    e1: np.ndarray
    e2: np.ndarray
    B0: np.ndarray
    B1: np.ndarray
    B2: np.ndarray
    B3: np.ndarray

    @classmethod
    def of(
        cls, panels: Panels, panel: np.ndarray, errors: Callable[..., Any], low: float
    ) -> "_BesideOne":
        at_low = errors(panels.column[panel], np.full(panel.size, low))
        exact = ExactFrames(np.arange(panel.size), *at_low)
        x = (low - panels.middle[panel]) / panels.half[panel]
        n = panels.error.shape[-1]
        D, sizes, error, drift = expansions(panels, panel, x, np.zeros(panel.size), exact)
        X, Z, block = eigenbasis(D[:, 0])
        # Eigenvectors of a frame with uneven entries are known to a few digits before.
        for _ in range(2):
            X, Z = _refined(X, Z, D[:, 0])
        B = Z[:, None] @ D @ X[:, None]
        B0, B1, B2, B3 = np.abs(B).swapaxes(0, 1)
        B0[:, range(n), range(n)] = 0.0
        w = np.diagonal(B[:, 0], axis1=1, axis2=2)
        order = np.argsort(np.abs(w), 1)
        nearest = order[:, 0]
        remaining = np.take_along_axis(w, order[:, 1:], 1)
        speed = B[np.arange(panel.size), 1, nearest, nearest]
        size_X = np.abs(X)
        size_Z = np.abs(Z)
        rounding = rounding_of(n)
        return cls(
            one=nearest,
            others=order[:, 1:],
            far=np.where(block.any(1, keepdims=True), 0.0, np.abs(np.abs(1 + remaining) - 1)),
            speed=speed.real,
            unsure=np.abs(speed.imag),
            outside=(2 * remaining.real + np.abs(remaining) ** 2 > 0).sum(1) + (speed.real > 0),
            G=np.abs(Z @ X - np.eye(n)) + rounding * size_Z @ size_X,
            e0=size_Z @ (error + rounding * np.abs(D[:, 0])) @ size_X,
            e1=size_Z @ (drift + rounding * sizes[:, 1:].sum(1)) @ size_X,
            e2=size_Z @ panels.rest[panel] @ size_X,
            B0=B0,
            B1=B1,
            B2=B2,
            B3=B3,
        )

    def proved(self, index: np.ndarray, h: float) -> np.ndarray:
        """Whether it is proved up to h for the tests `index`."""
        size = np.abs(self.speed[index])  # of b
        e2 = self.e2[index]
        B2 = self.B2[index]
        B3 = self.B3[index]
        G = self.G[index]
        at_low = self.B0[index] + self.e0[index]
        slopes = self.B1[index] + self.e1[index]
        entries = at_low + h * slopes + h**2 * B2 + h**3 * B3 + h**4 * e2
        changes = 2 * h * B2 + 3 * h**2 * B3 + 4 * h**3 * e2  # of the slopes, up to h
        inverse, resolved = self._inverse_of_others(index, entries)
        a = np.pi / 2 * self._of_w(index, at_low, inverse)
        unsure = self.unsure[index] + self._parts(self.e1[index] + changes, index)[0][:, 0, 0]

        def off(w: np.ndarray) -> np.ndarray:
            """The most of `|s - b|` up to so large a w."""
            return unsure + self._of_h(
                index, entries + w[:, None, None] * G, slopes + changes, inverse
            )

        near = off(WITHIN * h * size)
        far = off(np.full(index.size, 2.0))
        apart = h * (size + far) < 2 * (1 - MOST_TURNED)
        return (
            resolved
            & (a < MOST_TURNED)
            & apart
            & (near < MOST_SPREAD_OF_SLOPE * size)
            & (h * size < MOST_AWAY)
        )

    def _inverse_of_others(
        self, index: np.ndarray, entries: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Bounds on the entries of the inverse of M_RR, and where there are any."""
        *_, rest = self._parts(entries + 2 * self.G[index], index)
        far = self.far[index]
        eye = np.eye(rest.shape[-1])
        over_far = np.nan_to_num(rest / far[:, :, None], nan=1.0, posinf=1.0)
        u = solve(eye - over_far, np.ones((index.size, len(eye), 1)))
        resolved = ((u > 0) & (over_far @ u < (1 - DOMINANT_BY) * u)).all((1, 2))
        over_far[~resolved] = 0.0
        return solve(eye - over_far, eye / far[:, None, :]), resolved

    def _of_w(self, index: np.ndarray, entries: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """The most of `dS/dw - 1` at h = 0."""
        G = self.G[index]
        G_ii, G_iR, G_Ri, G_RR = self._parts(G, index)
        _, M_iR, M_Ri, _ = self._parts(entries + 2 * G, index)
        row_factor = M_iR @ inverse
        right = inverse @ M_Ri
        return (
            G_ii
            + G_iR @ right
            + row_factor @ G_Ri
            + row_factor @ (np.eye(G_RR.shape[-1]) + G_RR) @ right
        )[:, 0, 0]

    def _of_h(
        self, index: np.ndarray, M: np.ndarray, slopes: np.ndarray, inverse: np.ndarray
    ) -> np.ndarray:
        """The most of `dS/dh` without the derivative of M_ii."""
        _, M_iR, M_Ri, _ = self._parts(M, index)
        _, d_iR, d_Ri, d_RR = self._parts(slopes, index)
        row_factor = M_iR @ inverse
        right = inverse @ M_Ri
        return (row_factor @ d_Ri + d_iR @ right + row_factor @ d_RR @ right)[:, 0, 0]

    def _parts(
        self, array: np.ndarray, index: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The entry of the eigenvalue, its row, its column, and the rest."""
        number = np.arange(index.size)[:, None, None]
        nearest = self.one[index, None, None]
        across = self.others[index][:, None, :]
        down = self.others[index][:, :, None]
        return (
            array[number, nearest, nearest],
            array[number, nearest, across],
            array[number, down, nearest],
            array[number, down, across],
        )


def _refined(X: np.ndarray, Z: np.ndarray, E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvectors that are turned by what is left of E between the one whose eigenvalue is next
    to 0 and the others."""
    B = Z @ E @ X
    order = np.argsort(np.abs(np.diagonal(B, axis1=1, axis2=2)), 1)
    number = np.arange(len(B))[:, None]
    nearest = order[:, :1]
    remaining = order[:, 1:]
    value = B[number, nearest, nearest][:, :, None]
    rest = B[number[:, :, None], remaining[:, :, None], remaining[:, None, :]] - value * np.eye(
        remaining.shape[1]
    )
    turn = np.zeros_like(B)
    turn[number, nearest, remaining] = solve(
        rest.swapaxes(1, 2), B[number, nearest, remaining][:, :, None]
    )[:, :, 0]
    turn[number, remaining, nearest] = -solve(rest, B[number, remaining, nearest][:, :, None])[
        :, :, 0
    ]
    turn = np.nan_to_num(turn, nan=0.0, posinf=0.0, neginf=0.0)
    return X + X @ turn, Z - turn @ Z
