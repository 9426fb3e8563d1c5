"""Frames of a loop at values of a number, and whether they are analytic in it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.engine.doubles import EPS
from wavesweep.engine.rows import Rows

# relative: what entries of a frame may be off by if nothing is said of them, four roundings
FRAME_ROUNDING = 4 * EPS
STEEPEST = np.pi / 2  # turn between two points of a rim, beyond which it may be another turn
ZERO_LEVEL = 0.45  # half of what a zero on the segment adds to the mean of the logarithm on the rim


@dataclass(frozen=True, slots=True)
class Frames(Rows):
    """Frames at values of a number.

    E: `(n, order, order)`, less identity. pivots: `(n, k)`, functions of the number that are
    analytic if none has a zero: one is zero if an algebraic loop has no solution, others are
    divisors. Frames are analytic if none is zero. condition: `(n,)`, see `Block`.
    """

    E: np.ndarray
    pivots: np.ndarray
    condition: np.ndarray

    @staticmethod
    def of(frames: "Frames | np.ndarray") -> "Frames":
        """Return frames as they are, and matrices `(..., order, order)` as frames, flattened to one
        axis.

        The matrices have to be analytic everywhere.
        """
        if isinstance(frames, Frames):
            return frames
        E = frames.reshape(-1, *frames.shape[-2:])
        return Frames(E, np.ones((len(E), 1)), np.ones(len(E)))


@dataclass(frozen=True, slots=True, eq=False)
class ParametricFrames:
    """The frames of columns of loops as functions of a number p that may enter in any smooth way.

    frames(column, p): `Frames` of these columns at these values, real or complex, in this order; or
    matrices `(..., order, order)` without poles, analytic in p. p: `(n,)` as column, or `(m, k)` if
    column is `(m, 1)`. period: of the frame of each column, s, `(columns,)`. bounds: p beyond them
    has no loop, a number or `(columns,)` each. errors(column, p): frames less identity in the same
    states, and bounds on the errors of their entries; by default these are a few roundings.
    tight(column, p): what errors does, with bounds that are tighter and take longer, for windows
    that are too wide otherwise. resolved(column, low, high, offset, scale): whether frames have no
    narrow features for p = offset + scale exp(t), or p = t if scale is 0, with t from low to high,
    `(n,)` all; see `_loops.resolution`. By default they have none anywhere.
    """

    frames: Callable[..., Any]
    period: np.ndarray
    bounds: tuple[Any, Any] = (-np.inf, np.inf)
    errors: Callable[..., Any] | None = None
    tight: Callable[..., Any] | None = None
    resolved: Callable[..., Any] | None = None

    @property
    def columns(self) -> int:
        """The number of columns."""
        return int(self.period.size)

    def with_errors(self, column: Any, p: Any) -> Any:
        """What `errors` gives; of frames without it, with some roundings of their entries."""
        if self.errors is not None:
            return self.errors(column, p)
        E = Frames.of(self.frames(column, p)).E
        return E, FRAME_ROUNDING * np.abs(E)

    def with_tight_errors(self, column: Any, p: Any) -> Any:
        """What `tight` gives, or `with_errors`."""
        return self.with_errors(column, p) if self.tight is None else self.tight(column, p)


def level(pivots: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
    """Return the mean of the logarithm of each pivot's size, `(rims, k)`; pivots: `(rims,
    points, k)`."""
    with np.errstate(all="ignore"):
        return np.average(np.log(np.abs(pivots)), axis=1, weights=weights)


def pole_inside(pivots: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Return whether frames may have a pole inside of a rim.

    pivots: `(rims, points, k)` at points of the upper half of an ellipse about a segment, evenly in
    the angle of its Chebyshev polynomials; inner: their `level` at Chebyshev points of the segment.

    A pole of small weight is not visible in samples about it, but a pivot has a zero there, and by
    the argument principle it turns once about 0 along the rim. The values on the lower half are the
    conjugates. If there were as many zeros as points, the pivot would turn by whole turns from each
    point to the next; but the logarithm of a function without zeros is a Chebyshev series, so the
    mean of its real part on the rim is that on the segment, and zeros between raise it (as in
    Jensen's formula).
    """
    around = np.concatenate([pivots, np.conj(pivots[:, ::-1]), pivots[:, :1]], axis=1)
    with np.errstate(all="ignore"):
        turns = np.angle(around[:, 1:] / around[:, :-1])
        still = (np.abs(turns) < STEEPEST).all(1) & (np.abs(turns.sum(1)) < 1)
        return ~(still & (np.abs(level(pivots) - inner) < ZERO_LEVEL)).all(-1)
