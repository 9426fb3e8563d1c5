"""The peak of a frequency response, found by level sets: a level just above it is shown to be
met at no frequency."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from wavesweep.engine._energy.lapack import lapack
from wavesweep.engine._monodromy.unit_circle import inverse, solve

# A weak integral or position feedback leaves a slow mode; eigenvalues of a level next to z = 1 are
# known to some 1e-6, and may miss its peak or take two crossings of a level for one at 0.
SOFT = np.pi * 10.0 ** np.arange(-9, -3, 0.5)
# factors of an angle about a low peak, each time ten times as near
CLIMB = 10.0 ** (np.array([0.5, 0.05, 0.005, 5e-4])[:, None] * np.linspace(-1, 1, 21))
START = np.pi * np.array([0.0, 1e-3, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0])
NORM_TOLERANCE = 1e-10  # relative, of a norm, a margin or a damping
RAISES = 30  # of the level; it converges after a few


@dataclass(frozen=True, slots=True, eq=False)
class Peak:
    """Per loop: the largest value, the angle (rad per frame) where it is taken, and whether no
    larger one can exist.

    certified: at every eigenvalue on the unit circle of the pencil of the level just above, and
    half-way between neighbouring ones, the response is below that level, but for angles at which it
    is not known.
    """

    value: np.ndarray
    theta: np.ndarray
    certified: np.ndarray


def hinf_norm(
    value_at: Callable[..., np.ndarray],
    angles_at: Callable[..., np.ndarray],
    loops: int,
    slack: Callable[..., np.ndarray],
    further: Sequence[float] | np.ndarray = (),
    enough: np.ndarray | float = np.inf,
) -> Peak:
    """Maximise over the angle, for `loops` loops at once.

    value_at(owner, theta, floor): the response of the loops `owner` at `theta`, all `(points,)`;
    anything below the floor, the largest value so far, is as good as the response that is below it.
    angles_at(owner, level): angles at which a level may be met, `(owners, any)` with NaN for none.
    slack(owner, value): distance of the level that is shown to be out of reach above the value.
    further: angles that are tried first, the same or others for each loop; the largest value among
    low ones is then climbed to. enough: values, beyond which the search ends, without a
    certificate. Source: S. Boyd, V. Balakrishnan, Systems & Control Letters 15 (1990); N. Bruinsma,
    M. Steinbuch, ibid. 14 (1990): between two neighbouring angles at which a level is met the
    response is on one side of it; that in their middle is the next level. 2 to 5 rounds.
    """
    value = np.full(loops, -np.inf)
    theta = np.zeros(loops)
    certified = np.zeros(loops, bool)
    active = np.arange(loops)
    further = np.broadcast_to(further, (loops, np.shape(further)[-1]))
    _raise(value, theta, value_at, active, np.broadcast_to(START, (loops, START.size)))
    _raise(value, theta, value_at, active, further)
    _climb(value, theta, value_at, np.isfinite(further).any(-1))
    for _ in range(RAISES):
        active = active[value[active] <= np.broadcast_to(enough, (loops,))[active]]
        if not active.size:
            break
        level = value[active] + slack(active, value[active])
        _raise(value, theta, value_at, active, with_middles(angles_at(active, level)))
        beaten = value[active] > level
        certified[active[~beaten]] = np.isfinite(value[active[~beaten]])
        active = active[beaten]
    return Peak(value, theta, certified)


def with_middles(theta: np.ndarray) -> np.ndarray:
    """The angles, 0 and pi, and the middles between neighbours; NaN if there are fewer."""
    ends = np.broadcast_to([0.0, np.pi], (*theta.shape[:-1], 2))
    edges = np.sort(np.concatenate([theta, ends], axis=-1), axis=-1)  # NaN goes last
    return np.concatenate([edges, (edges[..., 1:] + edges[..., :-1]) / 2], axis=-1)


def _raise(
    value: np.ndarray,
    theta: np.ndarray,
    value_at: Callable[..., Any],
    owners: np.ndarray,
    candidates: np.ndarray,
) -> None:
    """Replace the value of each owner by that of its best candidate, if that is larger."""
    row, column = np.nonzero(np.isfinite(candidates))
    if not row.size:
        return
    by_candidate = np.full(candidates.shape, -np.inf)
    sampled = value_at(owners[row], candidates[row, column], value[owners[row]])
    by_candidate[row, column] = np.where(np.isnan(sampled), -np.inf, sampled)
    best = np.argmax(by_candidate, axis=-1)[:, None]
    largest = np.take_along_axis(by_candidate, best, -1)[:, 0]
    where = np.take_along_axis(candidates, best, -1)[:, 0]
    better = largest > value[owners]
    value[owners[better]] = largest[better]
    theta[owners[better]] = where[better]


# Distance from the unit circle up to which an eigenvalue counts as on it. Two crossings of a level
# just below a peak nearly meet, and rounding moves them off the circle by its root: by 3e-3 in
# drawn loops with stiff devices and slow integrators.
NEAR_CIRCLE = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """Stationarity of an energy balance over some ticks: `x+ = A x - G l+`, `l = Q x + A^T l+`, l
    the costate.

    Arrays `(..., n, n)`; G and Q symmetric. The inputs are gone: each was chosen to make the
    balance stationary.
    """

    A: np.ndarray
    G: np.ndarray
    Q: np.ndarray

    @staticmethod
    def of(
        A: np.ndarray,
        B: np.ndarray,
        state_cost: np.ndarray,
        cross_cost: np.ndarray,
        input_cost: np.ndarray,
    ) -> Element:
        """Return a tick `x+ = A x + B u` with the balance `x^T P x + 2 x^T S u + u^T R u`.

        A and P = state_cost `(..., n, n)`, B and S = cross_cost `(..., n, m)`, R = input_cost `(..., m,
        m)`, regular.
        """
        R = 1 / input_cost if input_cost.shape[-1] == 1 else inverse(input_cost)
        turn = R @ cross_cost.mT
        return Element(A - B @ turn, B @ R @ B.mT, state_cost - cross_cost @ turn)

    def then(self, second: Element) -> Element:
        """Return this element and another one after it (Redheffer's star product): no growing and decaying parts are
        ever multiplied out."""
        n = self.A.shape[-1]
        both = np.concatenate(np.broadcast_arrays(self.A, self.G), axis=-1)
        # A loop whose tick is very unstable overflows: see `angles`.
        with np.errstate(over="ignore", invalid="ignore"):
            joint = solve(np.eye(n) + self.G @ second.Q, both)
            carried = joint[..., :n]
            spread = joint[..., n:]
            A = second.A @ carried
            G = second.G + second.A @ spread @ second.A.mT
            Q = self.Q + self.A.mT @ second.Q @ carried
            return Element(A, _symmetric(G), _symmetric(Q))

    def angles(self) -> np.ndarray:
        """Return the angles (rad per frame, in [0, pi]) at which the level may be met, `(loops, 2n)`; NaN for
        eigenvalues off the circle.

        They are the unit-circle eigenvalues of the symplectic pencil `[A 0; -Q I] - z [I G; 0 A^T]`, by
        QZ: on an inverted pencil slow filters of high order lose them, and A has no inverse if the loop
        has delays. Those that rounding may have moved off the circle, up to NEAR_CIRCLE, are given too,
        so the list has more, not fewer, than there are. A frame that overflowed gives NaN alone.
        """
        dggev = lapack().dggev
        A = np.asarray(self.A)
        loops, n, _ = A.shape
        result = np.full((loops, 2 * n), np.nan)
        pencil = np.zeros((loops, 2 * n, 2 * n))
        pencil[:, :n, :n] = A
        pencil[:, n:, :n] = -self.Q
        pencil[:, n:, n:] = np.eye(n)
        right = np.zeros((loops, 2 * n, 2 * n))
        right[:, :n, :n] = np.eye(n)
        right[:, :n, n:] = self.G
        right[:, n:, n:] = A.mT
        if not n:
            return result
        for loop in np.flatnonzero((np.isfinite(pencil) & np.isfinite(right)).all((-1, -2))):
            real, imaginary, scale, *_ = dggev(
                pencil[loop], right[loop], compute_vl=0, compute_vr=0
            )
            size = np.hypot(real, imaginary)
            near = np.abs(size - np.abs(scale)) <= NEAR_CIRCLE * size
            result[loop, near] = np.abs(np.arctan2(imaginary, real * np.sign(scale)))[near]
        return result


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return (matrix + matrix.mT) / 2


def _climb(
    value: np.ndarray, theta: np.ndarray, value_at: Callable[..., np.ndarray], soft: np.ndarray
) -> None:
    """Raise the values of the loops `soft` whose largest is at a low angle, step by step about it."""
    for factors in CLIMB if soft.any() else ():
        slow = np.flatnonzero((theta > 0) & (theta <= START[2]) & soft)
        _raise(value, theta, value_at, slow, theta[slow, None] * factors)
