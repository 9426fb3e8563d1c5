"""The peak of a frequency response, found by level sets: a level just above it is shown to be met at no frequency."""

from dataclasses import dataclass

import numpy as np

from wavesweep.lifted.circle import solve

# A weak integral or position feedback leaves a slow mode; eigenvalues of a level next to z = 1 are known to some 1e-6, and may
# miss its peak or take two crossings of a level for one at 0.
SOFT = np.pi * 10.0 ** np.arange(-9, -3, 0.5)
CLIMB = np.concatenate([10.0 ** (np.linspace(-1, 1, 21) * width) for width in (0.5, 0.05, 0.005, 5e-4)]).reshape(4, -1)
START = np.pi * np.array([0.0, 1e-3, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0])
RAISES = 30  # of the level; it converges after a few


@dataclass(frozen=True, slots=True, eq=False)
class Peak:
    """Per loop: the largest value, the angle (rad per frame) where it is taken, and whether no larger one can exist.

    certified: at every eigenvalue on the unit circle of the pencil of the level just above, and half-way between
    neighbouring ones, the response is below that level.
    """

    value: np.ndarray
    theta: np.ndarray
    certified: np.ndarray


def peak_by_levels(value_at, angles_at, loops: int, slack, more=()) -> Peak:
    """Maximise over the angle, for `loops` loops at once.

    value_at(owner, theta, floor): the response of the loops `owner` at `theta`, all `(points,)`; anything below the floor, the
    largest value so far, is as good as the response that is below it.
    angles_at(owner, level): angles at which a level may be met, `(owners, any)` with NaN for none.
    slack(owner, value): distance of the level that is shown to be out of reach above the value. more: further
    angles that are tried first; the largest value among low ones is then climbed to.
    Source: S. Boyd, V. Balakrishnan, Systems & Control Letters 15 (1990); N. Bruinsma, M. Steinbuch, ibid. 14 (1990):
    between two neighbouring angles at which a level is met the response is on one side of it, so their middle tells
    which, and the next level is what was found there. Quadratic convergence: 2 to 5 rounds.
    """
    value, theta = np.full(loops, -np.inf), np.zeros(loops)
    certified, active = np.zeros(loops, bool), np.arange(loops)
    for some in (START, more):
        _raise(value, theta, value_at, active, np.broadcast_to(some, (loops, len(some))))
    for factors in CLIMB if len(more) else ():
        slow = np.flatnonzero((theta > 0) & (theta <= START[2]))
        _raise(value, theta, value_at, slow, theta[slow, None] * factors)
    for _ in range(RAISES):
        level = value[active] + slack(active, value[active])
        _raise(value, theta, value_at, active, _with_middles(angles_at(active, level)))
        beaten = value[active] > level
        certified[active[~beaten]] = True
        active = active[beaten]
        if not active.size:
            break
    return Peak(value, theta, certified)


def _with_middles(found):
    """The angles found, 0 and pi, and the middles between neighbours; NaN if there are fewer."""
    ends = np.broadcast_to([0.0, np.pi], (*found.shape[:-1], 2))
    known = np.sort(np.concatenate([found, ends], axis=-1), axis=-1)  # NaN goes last
    return np.concatenate([known, (known[..., 1:] + known[..., :-1]) / 2], axis=-1)


def _raise(value, theta, value_at, owners, candidates):
    """Replace the value of each owner by that of its best candidate, if that is larger."""
    row, column = np.nonzero(np.isfinite(candidates))
    if not row.size:
        return
    at = np.full(candidates.shape, -np.inf)
    at[row, column] = value_at(owners[row], candidates[row, column], value[owners[row]])
    best = np.argmax(at, axis=-1)[:, None]
    found, where = (np.take_along_axis(part, best, -1)[:, 0] for part in (at, candidates))
    better = found > value[owners]
    value[owners[better]], theta[owners[better]] = found[better], where[better]


# Distance from the unit circle up to which an eigenvalue counts as on it. Two crossings of a level just below a peak nearly
# meet, and rounding moves them off the circle by its root: by 3e-3 in drawn loops with stiff devices and slow integrators.
NEAR = 0.05


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
    """Angles (rad per frame, in [0, pi]) at which the level may be met, `(loops, 2n)`; NaN for eigenvalues off the circle.

    They are the unit-circle eigenvalues of the symplectic pencil `[A 0; -Q I] - z [I G; 0 A^T]`, by QZ: on an inverted
    pencil slow filters of high order lose them, and A has no inverse if the loop has delays. Those that rounding may
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


ROUNDS = 60
DENSE = 40  # up to this size LAPACK is quicker
BISECTIONS = 52


def largest(diagonal, weight):
    """Largest eigenvalue of `diag(d) + l l*` with `weight = |l|^2`; arrays `(..., M)`, the result `(...)`.

    It is the root beyond max d of `sum weight/(x - d) = 1`. The reciprocal of the sum is concave and rises there
    (Bunch, Nielsen, Sorensen 1978), so Newton from max(d + weight), below the root, climbs to it without a guard.
    Accuracy: rounding.
    """
    x = (diagonal + weight).max(-1)
    for _ in range(ROUNDS):
        gap = x[..., None] - diagonal
        gap = np.where((gap > 0) & (weight > 0), gap, np.inf)  # an entry without weight is an eigenvalue of its own
        share = (weight / gap).sum(-1)
        slope = (weight / gap**2).sum(-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = np.where(slope > 0, share * (share - 1) / slope, 0.0)
        x = x + np.maximum(step, 0)
        if np.all(step <= 4 * np.finfo(float).eps * np.abs(x)):
            break
    return x


def smallest_hermitian(diagonal, left, right):
    """Smallest eigenvalue of the Hermitian part of `diag(d) + left right`.

    d `(..., M)`, left `(..., M, r)`, right `(..., r, M)`, complex.
    Small matrices go to LAPACK whole. Others are bisected: with `W = [left, right*]` the mixture's
    Hermitian part is `W K W*`, K = [0 I; I 0]/2, and the number of eigenvalues below x is that of the d below x, plus
    the positive ones of `K^-1 + W* (d - x)^-1 W`, less r (Haynsworth's inertia formula): O(M r^2) a step.
    Accuracy: rounding of the largest entry.
    """
    if diagonal.shape[-1] <= DENSE:
        matrix = left @ right
        index = np.arange(diagonal.shape[-1])
        matrix[..., index, index] += diagonal
        return np.linalg.eigvalsh((matrix + np.swapaxes(matrix.conj(), -1, -2)) / 2)[..., 0]
    return _bisect(diagonal.real, left, np.swapaxes(right.conj(), -1, -2))


def some_below(diagonal, left, right, level):
    """Whether the Hermitian part of `diag(d) + left right` has an eigenvalue below the level, `(...)`.

    See `smallest_hermitian`, of whose work on a large matrix this is one of BISECTIONS steps.
    """
    return _counter(diagonal.real, left, np.swapaxes(right.conj(), -1, -2))[0](level)


def _bisect(diagonal, left, right):
    below, reach = _counter(diagonal, left, right)
    low = diagonal.min(-1) - reach
    high = diagonal.min(-1) + reach
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        found = below(middle)
        low, high = np.where(found, low, middle), np.where(found, middle, high)
    return (low + high) / 2


def _counter(diagonal, left, right):
    """A function of x that tells whether there is an eigenvalue below it, and how far they are from the diagonal at most."""
    rank = left.shape[-1]
    balance = (_size(right) / np.where(_size(left) > 0, _size(left), 1))[..., None, :] ** 0.25
    balance = np.where(balance > 0, balance, 1)
    W = np.concatenate([left * balance, right / balance], axis=-1)
    pairs = W.conj()[..., :, None] * W[..., None, :]
    inverse = 2 * np.roll(np.eye(2 * rank), rank, axis=0)
    reach = np.sqrt(_size(left) * _size(right)).sum(-1)
    floor = np.finfo(float).eps * (np.abs(diagonal).max(-1) + reach)[..., None]

    def below(x):
        gap = diagonal - x[..., None]
        gap = np.where(np.abs(gap) < floor, floor, gap)  # too close to an entry to tell: within the accuracy stated
        small = inverse + (pairs / gap[..., None, None]).sum(-3)
        positive = (np.linalg.eigvalsh(small) > 0).sum(-1)
        return (gap < 0).sum(-1) + positive - rank > 0

    return below, reach


def _size(columns):
    return (np.abs(columns) ** 2).sum(-2)
