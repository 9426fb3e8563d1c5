"""Where a level of energy gain is met: a frame as one small scattering element, and its unit-circle eigenvalues."""

from dataclasses import dataclass

import numpy as np

from wavesweep.lifted.circle import solve

NEAR = 1e-3  # distance from the unit circle up to which an eigenvalue is looked at; errors are far smaller


@dataclass(frozen=True, slots=True, eq=False)
class Element:
    """Stationarity of an energy balance over some ticks: `x+ = A x - G l+`, `l = Q x + A^T l+`, l the costate.

    Arrays `(..., n, n)`; G and Q symmetric. The inputs are gone: each was chosen to make the balance stationary.
    """

    A: np.ndarray
    G: np.ndarray
    Q: np.ndarray


def passage(A) -> Element:
    """An event that only moves the state."""
    return Element(A, np.zeros_like(A), np.zeros_like(A))


def tick(A, B, state_cost, cross_cost, input_cost) -> Element:
    """`x+ = A x + B u` with the balance `x^T P x + 2 x^T S u + R u^2`, for one input.

    A and P = state_cost `(..., n, n)`, B and S = cross_cost `(..., n, 1)`, R = input_cost `(..., 1, 1)`, not zero.
    """
    inverse = 1 / input_cost
    turn = np.swapaxes(cross_cost, -1, -2) * inverse
    return Element(A - B @ turn, B @ np.swapaxes(B, -1, -2) * inverse, state_cost - cross_cost @ turn)


def then(first: Element, second: Element) -> Element:
    """One element after the other (Redheffer's star product): no growing and decaying parts are ever multiplied out."""
    n = first.A.shape[-1]
    with np.errstate(over="ignore", invalid="ignore"):  # a loop whose tick is very unstable overflows: see `angles`
        return _joined(first, second, n)


def _joined(first, second, n):
    joint = solve(np.eye(n) + first.G @ second.Q, np.concatenate(np.broadcast_arrays(first.A, first.G), axis=-1))
    carried, spread = joint[..., :n], joint[..., n:]
    A_transposed = np.swapaxes(first.A, -1, -2)
    return Element(
        second.A @ carried,
        _symmetric(second.G + second.A @ spread @ np.swapaxes(second.A, -1, -2)),
        _symmetric(first.Q + A_transposed @ second.Q @ carried),
    )


def repeated(element: Element, count: int) -> Element:
    """The same element `count` times, by doubling (Anderson 1978; Chu, Fan, Lin, Wang 2004)."""
    total = passage(np.broadcast_to(np.eye(element.A.shape[-1]), element.A.shape))
    while count:
        if count % 2:
            total = then(total, element)
        count //= 2
        element = then(element, element) if count else element
    return total


def angles(frame: Element) -> np.ndarray:
    """Angles (rad per frame, in [0, pi]) at which the level may be met, `(loops, 2n)`; NaN for what is off the circle.

    They are the unit-circle eigenvalues of the symplectic pencil `[A 0; -Q I] - z [I G; 0 A^T]`, by QZ: on an inverted
    pencil slow filters of high order lose them, and A has no inverse where the loop has delays. Those that rounding may
    have moved off the circle, up to NEAR, are given too, so the list has more, not fewer, than there are. A frame that
    overflowed gives NaN alone.
    """
    from scipy.linalg.lapack import dggev

    A, G, Q = (np.asarray(part) for part in (frame.A, frame.G, frame.Q))
    loops, n = A.shape[0], A.shape[-1]
    found = np.full((loops, 2 * n), np.nan)
    left, right = np.zeros((loops, 2 * n, 2 * n)), np.zeros((loops, 2 * n, 2 * n))
    left[:, :n, :n], left[:, n:, :n], left[:, n:, n:] = A, -Q, np.eye(n)
    right[:, :n, :n], right[:, :n, n:], right[:, n:, n:] = np.eye(n), G, np.swapaxes(A, -1, -2)
    for loop in np.flatnonzero((np.isfinite(left) & np.isfinite(right)).all((-1, -2))) if n else ():
        real, imaginary, scale, *_ = dggev(left[loop], right[loop], compute_vl=0, compute_vr=0)
        size = np.hypot(real, imaginary)
        near = np.abs(size - np.abs(scale)) <= NEAR * size
        found[loop, near] = np.abs(np.arctan2(imaginary, real * np.sign(scale)))[near]
    return found


def _symmetric(matrix):
    return (matrix + np.swapaxes(matrix, -1, -2)) / 2
