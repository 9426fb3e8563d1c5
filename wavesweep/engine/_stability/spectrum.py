"""Eigenvalues of the closed loop relative to the unit circle: spectral radius, verdict, and
their number outside."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wavesweep.engine._monodromy.rounding import TELLING, at_angles_of, balance, may_have
from wavesweep.engine._monodromy.unit_circle import inverse, on_circle
from wavesweep.engine.components import strong_components
from wavesweep.engine.doubles import EPS

# An eigenvalue is neither inside nor outside that is nearer to the circle than so many roundings of
# the largest entry.
CIRCLE_ROUNDINGS = 256
# The computed eigenvalues of a balanced matrix are exact for entries that are off by so many
# roundings of the largest one.
BACKWARD = 16
NEIGHBOURHOOD = 1e-3  # from the circle, where the digits that an eigenvalue may have lost matter
# times the largest entry of a balanced matrix: a larger one hides eigenvalues that are known
HIDING_ENTRY = 1e3
BOUNDED_STATES = 100  # states, from which on a bound on a singular value stands for it
# states, from which on delays are left out of singular values, if they are most of them
STATES_WITHOUT_DELAYS = 40
# of the largest entry, or of 1, errors of entries that are no more than roundings
ROUNDED_ENTRIES = 1e-12
# states, up to which a matrix with a single block of several is taken whole
FEW_WITHOUT_BLOCKS = 200


def eigenvalues(E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues less 1 of `I + E`, complex `(..., n)`, zeros if E is not finite, and
    whether it is.

    If the states are of several loops of which one acts on another, but none on itself by way of
    others, the eigenvalues are those of each loop by itself (see `diagonal_blocks`): equal loops in
    a row would lose nearly all of their digits.
    """
    finite = np.isfinite(E).all((-1, -2))
    E = np.where(finite[..., None, None], E, 0.0)
    groups = diagonal_blocks(E, fewest=2 if E.shape[-1] <= FEW_WITHOUT_BLOCKS else 0)
    if not groups:
        return np.linalg.eigvals(E).astype(complex), finite
    delta = np.empty((finite.size, E.shape[-1]), complex)
    for group in groups:
        of_blocks = [np.linalg.eigvals(block) for block in group.blocks]
        of_alone = group.alone.diagonal(axis1=-2, axis2=-1)
        delta[group.which] = np.concatenate([*of_blocks, of_alone], axis=-1)
    return delta.reshape(E.shape[:-1]), finite


class AlikeBlocks(NamedTuple):
    """Matrices with the same diagonal blocks in some order of the states.

    which: of the matrices (flat). blocks: of several states, which all act on one another,
    `(matrices, k, k)` each. alone: that of all other states, `(matrices, others, others)`:
    triangular in some order, so its eigenvalues are on its diagonal.
    """

    which: np.ndarray
    blocks: list[np.ndarray]
    alone: np.ndarray


def diagonal_blocks(E: np.ndarray, fewest: int = 2) -> list[AlikeBlocks]:
    """Return groups of the matrices `(..., n, n)` by their diagonal blocks; none if all have fewer
    than `fewest` of several states."""
    n = E.shape[-1]
    if n < 2 or not E.size:
        return []
    pattern = E.reshape(-1, n, n) != 0
    if (pattern == pattern[0]).all():
        kinds = pattern[:1]
        kind = np.zeros(len(pattern), int)
    else:
        numbers: dict[bytes, int] = {}
        names = np.packbits(pattern.reshape(len(pattern), -1), axis=-1)
        kind = np.array([numbers.setdefault(name.tobytes(), len(numbers)) for name in names])
        kinds = pattern[np.unique(kind, return_index=True)[1]]
    groups = [_blocks_of_pattern(n, pattern.tobytes()) for pattern in kinds]
    if max(len(several) for several, _ in groups) < fewest:
        return []
    blocks = []
    for number, (several, alone) in enumerate(groups):
        index = np.flatnonzero(kind == number)
        matrices = E.reshape(-1, n, n)[index]
        of_several = [matrices[:, states[:, None], states] for states in several]
        blocks.append(AlikeBlocks(index, of_several, matrices[:, alone[:, None], alone]))
    return blocks


def states_of_blocks(E: np.ndarray) -> list[np.ndarray]:
    """Return the states of each diagonal block of one matrix (see `diagonal_blocks`), also of
    those of a single state."""
    if not E.size:
        return []
    several, alone = _blocks_of_pattern(E.shape[-1], (E != 0).tobytes())
    return [*several, *(np.array([state]) for state in alone)]


@lru_cache(maxsize=32)
def _blocks_of_pattern(n: int, pattern: bytes) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
    """The states of every diagonal block of several, and those of no such block; of few states a
    single block has all."""
    blocks = sorted(strong_components(np.frombuffer(pattern, bool).reshape(n, n)))
    several = [np.array(block) for block in blocks if len(block) > 1]
    if len(several) < 2 and n <= FEW_WITHOUT_BLOCKS:
        return (np.arange(n),), np.zeros(0, int)
    return tuple(several), np.array([block[0] for block in blocks if len(block) == 1], int)


def excess(delta: np.ndarray) -> np.ndarray:
    """Return `|z|^2 - 1` of `z = 1 + delta`, without cancellation for slow poles."""
    with np.errstate(over="ignore"):
        return 2 * delta.real + delta.real**2 + delta.imag**2


# share of a mode below which it is over within a clock of its spec, and its damping ratio says
# nothing
GONE = 0.1
# the same within a frame, however many clocks it has: what is left of a smaller one is rounding
LOST_EIGENVALUE = 1e-6


def damping_ratio(delta: np.ndarray, turns: np.ndarray | None = None) -> np.ndarray:
    """Return the damping ratio `-Re s/|s|` of eigenvalues `1 + delta = exp(s T)`, -1 to 1; NaN for
    the eigenvalues 1 and 0.

    turns: `Im s T` of the mode's line in the spectrum, of which the eigenvalue has an image; by
    default its angle.
    """
    with np.errstate(all="ignore"):
        s = np.log1p(delta)
        s = s if turns is None else s.real + 1j * turns
        ratio = -s.real / np.abs(s)
    return np.where(np.isfinite(ratio), ratio, np.nan)


def size_gone(period: np.ndarray | float, seconds: float, clocks: float) -> np.ndarray:
    """The size of an eigenvalue below which a mode is gone: it falls to 1/e in less than so many
    seconds, to GONE in a clock of its spec, or to LOST_EIGENVALUE in a frame.

    period: of the frame (s), which takes so many clocks.
    """
    over = max(GONE ** max(clocks, 1.0), LOST_EIGENVALUE)
    if not seconds:
        return np.full(np.shape(period), over)
    return np.maximum(over, np.exp(-np.asarray(period, float) / seconds))


def least_damping(
    E: np.ndarray,
    gone: np.ndarray | float = GONE,
    *,
    pairs: bool = False,
    turns: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least damping ratio of the eigenvalues of `I + E`, `(matrices,)`, and whether
    rounding leaves it as it is.

    turns: of each of the `eigenvalues` what its mode turns in a frame (rad), by its line in the
    spectrum; by default its angle.

    One below `gone` in size counts as 1; so does, of `pairs` alone, a real one within the unit
    circle. The ratio is known if no rounding of E lowers it by more than TELLING, by the smallest
    singular values on the spiral of that lower ratio, at the angle of each eigenvalue, and if none
    makes a pair of real eigenvalues that are left out.
    """
    delta, finite = eigenvalues(E)
    size = np.abs(1 + delta)
    left_out = size < np.reshape(gone, (-1, 1))
    real_left_out = np.zeros(left_out.shape, bool)
    if pairs:
        real_left_out = (delta.imag == 0) & (size < 1) & ~left_out
    angle = np.abs(np.angle(1 + delta))
    turns = angle if turns is None else turns
    ratio = damping_ratio(delta, turns)
    ratios = np.where(left_out | real_left_out, 1.0, np.nan_to_num(ratio))
    least = ratios.min(-1, initial=1.0)
    balanced, _ = balance(np.where(finite[..., None, None], E, 0.0))
    lower = np.clip(least - TELLING, -1 + TELLING, None)
    size_there = -turns * (lower / np.sqrt(1 - lower**2))[:, None]
    spiral = np.maximum(size_there, np.log(np.reshape(gone, (-1, 1)))) + 1j * angle
    rounding = BACKWARD * EPS * np.abs(balanced).max((-1, -2), initial=0)
    far = _smallest(balanced, np.expm1(spiral)) > rounding[:, None]
    if pairs:
        far = np.where(real_left_out, _is_alone(balanced, delta, rounding), far)
    return np.where(finite, least, np.nan), finite & far.all(-1)


def _is_alone(balanced: np.ndarray, delta: np.ndarray, rounding: np.ndarray) -> np.ndarray:
    """Whether an eigenvalue of `I + E` below 0 has no other one near it that rounding could join to
    it; all above 0 have not.

    Near is TELLING of its size; rounding does not reach so far if the smallest singular values say
    so on the rim.
    """
    near = TELLING * np.abs(1 + delta)
    distances = np.abs(delta[:, :, None] - delta[:, None, :])
    no_other = np.count_nonzero(distances <= 2 * near[:, :, None], -1) == 1
    for direction in (1.0, -1.0, 1j):
        no_other &= _smallest(balanced, delta + direction * near) > rounding[:, None]
    return no_other | (1 + delta.real > 0)


def radius_of(E: np.ndarray, hidden: np.ndarray | bool = False) -> np.ndarray:
    """Return the spectral radius of `I + E`; infinite if E is not finite, NaN if rounding could
    move it by a thousandth of itself or of 1, and 1 if it differs from 1 by rounding alone.

    hidden: which are so uncertain, if the caller knows (see
    `MarginalModes.frame_with_reliability`). Otherwise only eigenvalues that nearly meet are. Then
    the radius counts as known if no rounding of E makes one that is that much larger, by the
    smallest singular value there at the angle of each of them (see `count_outside`).
    """
    delta, finite = eigenvalues(E)
    E = np.where(finite[..., None, None], E, 0.0)
    radius = np.abs(1 + delta).max(-1, initial=0.0)
    groups = diagonal_blocks(E)
    radii = np.array(radius if groups or not E.size else _sure_radius(E, radius, delta))
    for group in groups:
        of_group = np.reshape(radius, -1)[group.which]
        for block in group.blocks:  # each of which may hide that it exceeds the whole
            sure = _sure_radius(block, of_group, eigenvalues(block)[0])
            radii.reshape(-1)[group.which] += 0 * sure
    radii = np.where(finite, radii, np.inf)
    radii = np.where(_is_rounding(np.abs(1 - radii), E), 1.0, radii)
    return np.where(hidden, np.nan, radii)


def _is_rounding(distance: np.ndarray | float, E: np.ndarray) -> np.ndarray:
    """Whether eigenvalues of `I + E` are beside the circle by that distance through rounding
    alone; NaN is not."""
    n = E.shape[-1]
    distance = np.asarray(distance)
    tolerance = BACKWARD * EPS
    size = np.maximum(1, np.abs(E).max((-1, -2), initial=0))
    rounding = np.array((distance > 0) & (distance <= tolerance * size))
    index = np.flatnonzero(rounding)
    if index.size:
        balanced, _ = balance(E.reshape(-1, n, n)[index])  # whose entries are often much smaller
        size = np.maximum(1, np.abs(balanced).max((-1, -2)))
        rounding.reshape(-1)[index] = distance.reshape(-1)[index] <= tolerance * size
    return rounding


def _sure_radius(
    E: np.ndarray, radius: np.ndarray | float, delta: np.ndarray
) -> np.ndarray | float:
    """The radius, and NaN where rounding may move it."""
    n = E.shape[-1]
    sure = np.array(radius).ravel()
    E = E.reshape(-1, n, n)
    delta = delta.reshape(-1, n)
    index = np.flatnonzero(_outgrows(delta, np.abs(E).max((-1, -2), initial=0), sure).any(-1))
    if not index.size:
        return radius
    E = E[index]
    delta = delta[index]
    balanced, units = balance(E)  # whose entries are often much smaller
    size = np.abs(balanced).max((-1, -2))
    matrix, eigenvalue = np.nonzero(_outgrows(delta, size, sure[index]))
    spectral = sure[index[matrix]]
    further = spectral + TELLING * np.maximum(spectral, 1)
    angle = np.abs(np.angle(1 + delta[matrix, eigenvalue]))  # E is real
    points = further * np.exp(1j * angle) - 1
    rounding = BACKWARD * EPS * size
    if n < STATES_WITHOUT_DELAYS:
        reached = _smallest(balanced[matrix], points[:, None])[:, 0] <= rounding[matrix]
        sure[index[matrix[reached]]] = np.nan
        return sure.reshape(np.shape(radius))
    for i in np.unique(matrix):
        w = np.unique(points[matrix == i])
        if _may_reach(E[i], balanced[i], units[i], w, rounding[i]):
            sure[index[i]] = np.nan
    return sure.reshape(np.shape(radius))


def _may_reach(
    E: np.ndarray, balanced: np.ndarray, units: np.ndarray, w: np.ndarray, rounding: float
) -> bool:
    """Whether a rounding of that size may make one of w `(points,)` an eigenvalue of E, of many
    states: the cheap bounds come first, and few points are left for the others."""
    w = w[_at_least(E, units, w) <= rounding]
    if w.size:
        w = w[_by_eigenvectors(balanced, w) <= rounding]
    return any(_smallest(balanced[None], point[None, None]) <= rounding for point in w)


@np.errstate(all="ignore")
def _by_eigenvectors(E: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return bounds from below on the smallest singular value of `w - E` at w `(points,)`, in
    O(n^3) for all of them.

    0 if there is none. With `E V = V L + R` the matrix is `V (w - L - V^-1 R) V^-1` (F. L. Bauer,
    C. T. Fike, Numer. Math. 2, 1960). The norm of V^-1 is at most twice that of its computed value
    Z if `1 - Z V` has a norm below 1/2, and rounding of R and of that product is added.
    """
    values, V = np.linalg.eig(E)
    Z = inverse(V)
    of_V = np.linalg.norm(V)
    of_Z = np.linalg.norm(Z)
    # of a sum of that many complex products, and of a norm
    rounding = 2 * (len(E) + 4) * EPS
    off = np.linalg.norm(np.eye(len(E)) - Z @ V) + rounding * of_Z * of_V
    EV = E @ V.real + 1j * (E @ V.imag)  # E is real, which saves half of the products
    missed = np.linalg.norm(EV - V * values)
    missed += rounding * of_V * (np.linalg.norm(E) + np.abs(values).max(initial=0.0))
    apart = np.abs(w[:, None] - values).min(-1) - 2 * of_Z * missed
    bound = apart / (2 * of_V * of_Z)
    return np.where((off < 0.5) & (bound > 0), bound, 0.0)


def _at_least(E: np.ndarray, units: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Return bounds from below on the smallest singular value of `w - E` in these units, at w
    `(points,)`; 0 if there is none.

    They are 1 over a bound on the Frobenius norm of the inverse, from those of its parts: of the
    delays that E has, if these are most of its states, of the remaining states as their Schur
    complement, and of the ways between these.
    """
    from wavesweep.engine._monodromy.resolvent import DelayLines

    lines = DelayLines.of(E)
    k = lines.solved
    d = lines.delayed
    w = w[:, None, None]
    if k.size > d.size:
        return np.zeros(len(w))

    def norm(block: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        return np.linalg.norm(block * (units[columns] / units[rows, None]), axis=(-1, -2))

    with np.errstate(all="ignore"):
        into = lines.along(E[np.ix_(d, k)] + 0 * w, 1 + w)
        out = lines.read(E[np.ix_(k, d)] + 0 * w, 1 + w)
        remaining = inverse(w * np.eye(k.size) - E[np.ix_(k, k)] - E[np.ix_(k, d)] @ into)
        lines_alone = lines.along(np.eye(d.size)[None], np.abs(1 + w).min(0, keepdims=True))
        of_out = norm(remaining @ out, k, d)
        size = norm(remaining, k, k) + of_out + norm(into @ remaining, d, k)
        size += norm(lines_alone, d, d)
        size += norm(into, d, k) * of_out
        return np.where(
            np.isfinite(size) & (size > 0), 1 / (2 * size), 0.0
        )  # half of it, since it is rounded


def _outgrows(delta: np.ndarray, size: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Whether rounding might move an eigenvalue beyond the radius by more than it may be off,
    `(matrices, n)`.

    delta: eigenvalues less 1, `(matrices, n)`; size: of the largest entry. If m of them are as near
    to one of them as a relative rounding of e may move it, by the size times e^(1/m), it may move
    so far, as it does for a Jordan block.
    """
    n = delta.shape[-1]
    allowed = (radius + TELLING * np.maximum(radius, 1))[:, None]
    beyond = np.abs(1 + delta) - allowed
    move = np.asarray(size)[:, None, None] * (CIRCLE_ROUNDINGS * EPS) ** (1 / np.arange(2, n + 1))
    with np.errstate(invalid="ignore"):  # a matrix that is not finite
        if not (beyond + move.max(-1, initial=0.0) > 0).any():
            return np.zeros(delta.shape, bool)
        apart = np.sort(np.abs(delta[:, None, :] - delta[:, :, None]), axis=-1)[..., 1:]
        return ((apart <= 2 * move) & (beyond[..., None] + move > 0)).any(-1)


def is_stable(E: np.ndarray) -> np.ndarray:
    """Return whether every eigenvalue of `I + E` is inside the unit circle by more than
    rounding; false if E is not finite."""
    delta, finite = eigenvalues(E)
    distance = -excess(delta).max(-1, initial=-1.0) / 2
    return (
        finite & (distance > 0) & ~_is_rounding(distance, np.where(finite[..., None, None], E, 0.0))
    )


def count_outside(E: np.ndarray, dE: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of eigenvalues of `I + E` outside the unit circle, and whether no error of
    E can change it.

    E, dE: `(matrices, n, n)`, matrices less identity and bounds on the errors of their entries, by
    default of a rounding each. The count is -1 if E is not finite. See `_count_outside`; where
    errors are larger than roundings, or an eigenvalue is near the circle, no matrix within dE of E
    may have the nearest eigenvalues on the circle (see `may_have`).
    """
    count, clear = _count_outside(E)
    if dE is None or not E.size:
        return count, clear
    size = np.maximum(1, np.abs(E).max((-1, -2), initial=0))
    index = np.flatnonzero(clear & ~(dE.max((-1, -2), initial=0) <= ROUNDED_ENTRIES * size))
    if index.size:
        delta = eigenvalues(E[index])[0]
        clear[index] = ~may_have(
            E[index], dE[index], at_angles_of(delta, 1.0, np.abs(excess(delta)))
        )
    return count, clear


@np.errstate(over="ignore", invalid="ignore")
def _count_outside(E: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of eigenvalues of `I + E` outside the unit circle, and whether none lies
    within rounding of it.

    The count is -1 if E is not finite. An eigenvalue is within rounding of the circle if its
    computed distance from it is that small. Eigenvalues that nearly meet keep only a root of the
    digits, and others may lose many. So if one is near the circle, or if some are so near to each
    other that this could bring them there (`may_cross`), those nearest to it also count as within
    rounding of it if a rounding of E could move them onto it: if the smallest singular value of `z
    I - (I + E)` at the nearest z of the circle is that small (L. N. Trefethen, M. Embree, Spectra
    and Pseudospectra, 2005, Theorem 2.1).
    """
    groups = diagonal_blocks(E)
    if groups:
        return _count_of_blocks(E, groups)
    delta, finite = eigenvalues(E)
    outside = excess(delta)
    size = np.abs(E).max((-1, -2), initial=0)
    tolerance = CIRCLE_ROUNDINGS * EPS * np.maximum(1, size)
    count = np.where(finite, (outside > 0).sum(-1), -1)
    distance = np.abs(outside)
    clear = finite & (distance.min(-1, initial=np.inf) > tolerance)
    again = np.flatnonzero(finite & ~clear & (size > HIDING_ENTRY))
    if again.size:  # in units in which its entries are much smaller
        even = balance(E[again])[0]
        better = size[again] > HIDING_ENTRY * np.abs(even).max((-1, -2), initial=0)
        if better.any():
            count[again[better]], clear[again[better]] = _count_outside(even[better])
    near = clear & (distance.min(-1, initial=np.inf) < NEIGHBOURHOOD)
    index = np.flatnonzero(clear & ~near & may_cross(delta, size))
    if index.size:
        even = np.abs(balance(E[index])[0]).max((-1, -2), initial=0)
        near[index] = may_cross(delta[index], even)
    near = np.flatnonzero(near)
    if near.size:
        clear[near] = ~_may_touch_circle(E[near], delta[near], distance[near])
    return count, clear


def _count_of_blocks(E: np.ndarray, groups: list[AlikeBlocks]) -> tuple[np.ndarray, np.ndarray]:
    """`_count_outside` of matrices in diagonal blocks, block by block."""
    count = np.zeros(len(E), int)
    clear = np.ones(len(E), bool)
    for group in groups:
        of_alone = group.alone.diagonal(axis1=-2, axis2=-1)
        alone = _count_outside(of_alone.reshape(-1, 1, 1))
        outside_alone, clear_alone = (facts.reshape(of_alone.shape) for facts in alone)
        count[group.which] += outside_alone.sum(-1)
        clear[group.which] &= clear_alone.all(-1)
        for block in group.blocks:
            outside_block, clear_block = _count_outside(block)
            count[group.which] += outside_block
            clear[group.which] &= clear_block
    finite = np.isfinite(E).all((-1, -2))
    return np.where(finite, count, -1), clear & finite


def _may_touch_circle(E: np.ndarray, delta: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Whether a rounding of E could move one of the eigenvalues nearest to the circle onto it,
    `(matrices,)`; delta: eigenvalues less 1; distance: of these from the circle."""
    order = np.argsort(distance, axis=-1)
    closest = np.take_along_axis(delta, order, axis=-1)
    far = np.take_along_axis(distance >= NEIGHBOURHOOD, order, axis=-1)
    # Of the nearest ones four are examined, and all others in the neighbourhood.
    far[:, :4] = False
    examined = (~far).sum(-1).max()
    far = far[:, :examined]
    balanced, units = balance(E)
    rounding = BACKWARD * EPS * np.abs(balanced).max((-1, -2))
    points = on_circle(np.abs(np.angle(1 + closest[:, :examined])))
    if E.shape[-1] < BOUNDED_STATES:
        smallest = _smallest(balanced, points)
        return ~(np.where(far, np.inf, smallest).min(-1) > rounding)
    reached = np.zeros(len(E), bool)
    for matrix in range(len(E)):
        w = np.unique(points[matrix, ~far[matrix]])
        bounds = balanced[matrix], units[matrix], w, rounding[matrix]
        reached[matrix] = _may_reach(E[matrix], *bounds)
    return reached


def may_cross(delta: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return whether rounding might move eigenvalues onto the circle that are nearer to each other
    than to it.

    delta: eigenvalues less 1, `(matrices, n)`; size: of the largest entry, `(matrices,)`. If m of
    them are within four times the distance of one of them from the circle, a relative rounding of e
    moves that one by up to the size times e^(1/m), as it does for a Jordan block, which becomes m
    eigenvalues around a circle.
    """
    far = np.abs(np.abs(1 + delta) - 1)
    apart = np.abs(delta[..., None, :] - delta[..., :, None])
    m = (apart <= 4 * far[..., :, None]).sum(-1)
    moved = np.asarray(size)[..., None] * (CIRCLE_ROUNDINGS * EPS) ** (1 / m)
    return ((m > 1) & (far < moved)).any(-1)


def _smallest(E: np.ndarray, delta: np.ndarray) -> np.ndarray:
    """Smallest singular values of `delta I - E` at the points delta = z - 1, `(matrices, points)`.

    Of many states it is a lower bound, which takes an eighth of the time: 1 over the Frobenius norm
    of the inverse, nearly the value itself if that is small beside the others.
    """
    A = delta[..., None, None] * np.eye(E.shape[-1]) - E[:, None]
    if E.shape[-1] < BOUNDED_STATES:
        return np.linalg.svd(A, compute_uv=False)[..., -1]
    with np.errstate(all="ignore"):
        bound = 1 / np.sqrt((np.abs(inverse(A)) ** 2).sum((-1, -2)))
    return np.where(np.isfinite(bound), bound, 0.0)
