"""Other methods that a user might write: grids, searches between points, and D-decomposition by hand.

None of them proves its answer. Two crossings between neighbouring points, or angles, are missed together, without a sign
of it in the answer.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.problems import Bundle, Intervals, bundles
from wavesweep import Spec
from wavesweep.engine._monodromy.cut import ADVANCE, FIRST, OFFSET, SECOND, VELOCITY, LinearFractional
from wavesweep.engine._monodromy.unit_circle import on_circle

_STEPS = 30  # of the secant at the most; six or seven are usual
_CLOSE = 1e-11  # relative: a step this short leaves nothing to do for another


def grid_of(spec: Spec, points: int) -> np.ndarray:
    """Equally spaced values of K_VE over the range, without its lower end, at which the position of the scene drifts."""
    stop = next(axis.stop for axis in spec.sweep if axis.name == "K_VE")
    return np.linspace(0, stop, points + 1)[1:]


def batched(spec: Spec, points: int) -> Intervals:
    """numpy: the eigenvalues of all points of a grid in one call."""
    K = grid_of(spec, points)
    return stable_runs(K, [(part, is_stable(_across(part).closed(K, part.B_VE[:, None]))) for part in bundles(spec)])


def is_stable(E: np.ndarray) -> np.ndarray:
    """Whether all eigenvalues of `I + E` are inside the unit circle."""
    return (np.abs(1 + np.linalg.eigvals(E)) < 1).all(-1)


def _across(part: Bundle):
    return part.cut.at((slice(None), None))


def looped(spec: Spec, points: int) -> Intervals:
    """numpy: a loop over the points, the wall closed by its rank-one formula."""
    return _one_by_one(spec, points, _numpy_test)


def feedback(spec: Spec, points: int) -> Intervals:
    """python-control: `feedback` per point on a plant that is made once."""
    return _one_by_one(spec, points, feedback_test)


def interconnected(spec: Spec, points: int) -> Intervals:
    """python-control: `interconnect` per point. It refuses algebraic loops: the damping is closed by hand, once a column."""
    return _one_by_one(spec, points, _interconnect_test)


def _one_by_one(spec, points, prepare):
    K = grid_of(spec, points)
    parts = []
    for part in bundles(spec):
        stable = np.zeros((part.column.size, K.size), bool)
        for row in range(part.column.size):
            test = prepare(part, row)
            stable[row] = [test(value) for value in K]
        parts.append((part, stable))
    return stable_runs(K, parts)


def _plant(part, row):
    """`(A, B, C, D)` from the wall's force to the displacement and the velocity that it reads, the position a state."""
    (E, B, x, through_x), (*_, v, through_v) = (part.cut.at(row).open_in(along, np.asarray(0.0)) for along in (FIRST, SECOND))
    return E + np.eye(len(E)), B, np.vstack([x, v]), np.vstack([through_x, through_v])


def _numpy_test(part, row):
    A, B, C, D = _plant(part, row)
    damping = part.B_VE[row]

    def test(K):
        wall = np.array([[K, damping]])
        closed = A + B @ (wall @ C) / (1 - (wall @ D).item())
        return np.abs(np.linalg.eigvals(closed)).max() < 1

    return test


def feedback_test(part: Bundle, row: int) -> Callable[[float], bool]:
    """python-control: whether a column is stable at one K_VE, by `feedback` on a plant that is made once."""
    import control

    plant = control.ss(*_plant(part, row), float(part.cut.at(row).period))
    damping = part.B_VE[row]

    def test(K):
        return np.abs(control.feedback(plant, np.array([[K, damping]]), sign=1).poles()).max() < 1

    return test


def _interconnect_test(part, row):
    import control

    one = part.cut.at(row)
    E, B, x, _ = one.open_in(FIRST, part.B_VE[row])
    period = float(one.period)
    plant = control.ss(E + np.eye(len(E)), B, x, 0, period, inputs=["F"], outputs=["x"], name="plant")

    wires = [["plant.F", "wall.F"], ["wall.x", "plant.x"]]

    def test(K):
        wall = control.ss([], [], [], [[K]], period, inputs=["x"], outputs=["F"], name="wall")
        whole = control.interconnect([plant, wall], wires, inplist=["plant.F"], outlist=["plant.x"])
        return np.abs(whole.poles()).max() < 1

    return test


def stable_runs(K: np.ndarray, parts) -> Intervals:
    """Stable runs of a grid; an end is in the middle between a stable point and its unstable neighbour.

    parts: (bundle, verdicts `(columns, points)`) pairs.
    """
    column = np.concatenate([part.column for part, _ in parts])
    stable = np.concatenate([verdict for _, verdict in parts])
    edges = np.concatenate([[0.0], (K[1:] + K[:-1]) / 2, K[-1:]])
    change = np.diff(np.pad(stable, ((0, 0), (1, 1))).astype(int), axis=-1)
    first, last = np.nonzero(change == 1), np.nonzero(change == -1)
    return Intervals(column[first[0]], edges[first[1]], edges[last[1]])


def bisected(spec: Spec, tolerance: float) -> Intervals:
    """Bisection for the largest stable K_VE, column by column; tolerance: relative to the range."""
    return _largest(spec, tolerance, one_by_one=True)


def bisected_together(spec: Spec, tolerance: float) -> Intervals:
    """Bisection for the largest stable K_VE, with the eigenvalues of all columns in one call."""
    return _largest(spec, tolerance, one_by_one=False)


def _largest(spec, tolerance, one_by_one):
    stop = grid_of(spec, 1)[-1]
    columns, ends = [], []
    for part in bundles(spec):
        rows = np.arange(part.column.size)
        for some in np.split(rows, rows.size) if one_by_one else [rows]:
            cut, B = part.cut.at(some), part.B_VE[some]
            low, high = np.zeros(some.size), np.full(some.size, stop)
            low = np.where(is_stable(cut.closed(high, B)), high, low)
            ends.append(_narrowed(cut, B, low, high, tolerance * stop))
            columns.append(part.column[some])
    high = np.concatenate(ends)
    return Intervals(np.concatenate(columns), np.zeros(high.size), high)


def _narrowed(cut, B, stable, unstable, width):
    """Halve the brackets down to the tolerance, and return their middles."""
    while np.abs(unstable - stable).max(initial=0) > width:
        middle = (stable + unstable) / 2
        inside = is_stable(cut.closed(middle, B))
        stable, unstable = np.where(inside, middle, stable), np.where(inside, unstable, middle)
    return (stable + unstable) / 2


def bisected_by_feedback(spec: Spec, tolerance: float) -> Intervals:
    """Bisection with python-control, by `feedback` and its poles in each step."""
    stop = grid_of(spec, 1)[-1]
    columns, ends = [], []
    for part in bundles(spec):
        for row in range(part.column.size):
            test = feedback_test(part, row)
            low, high = (stop, stop) if test(stop) else (0.0, stop)
            while high - low > tolerance * stop:
                middle = (low + high) / 2
                low, high = (middle, high) if test(middle) else (low, middle)
            columns.append(part.column[row])
            ends.append((low + high) / 2)
    return Intervals(np.array(columns), np.zeros(len(ends)), np.array(ends))


def refined(spec: Spec, setting: tuple[int, float]) -> Intervals:
    """A batched grid, then each change of verdict on it bisected, all together; setting: (points, relative tolerance)."""
    points, tolerance = setting
    K = grid_of(spec, points)
    answers = []
    for part in bundles(spec):
        stable = is_stable(part.cut.at((slice(None), None)).closed(K, part.B_VE[:, None]))
        row, at = np.nonzero(stable[:, 1:] != stable[:, :-1])
        inside, outside = np.where(stable[row, at], K[at], K[at + 1]), np.where(stable[row, at], K[at + 1], K[at])
        ends = _narrowed(part.cut.at(row), part.B_VE[row], inside, outside, tolerance * K[-1])
        answers.append(_with_ends(stable_runs(K, [(part, stable)]), K, (part.column[row], at, ends)))
    return Intervals(*(np.concatenate([getattr(answer, name) for answer in answers]) for name in ("column", "low", "high")))


def _with_ends(coarse, K, changes):
    """The coarse answer with refined ends in the places of the middles that they started from."""
    column, at, ends = changes
    middle = dict(zip(zip(column.tolist(), ((K[at] + K[at + 1]) / 2).tolist(), strict=True), ends.tolist(), strict=True))

    def better(end):
        return np.array([middle.get(key, key[1]) for key in zip(coarse.column.tolist(), end.tolist(), strict=True)])

    return Intervals(coarse.column, better(coarse.low), better(coarse.high))


def decomposed(spec: Spec, angles: int) -> Intervals:
    """D-decomposition: the boundary sampled over the unit circle, its crossings refined by a secant.

    The method of textbooks, and the nearest to that of this tool. angles: their number, over the upper half of the circle.
    """
    stop = next(axis.stop for axis in spec.sweep if axis.name == "K_VE")
    theta = np.pi * (np.arange(angles) + 0.5) / angles
    parts = [_labelled(part, stop, *_crossings(part, theta)) for part in bundles(spec)]
    return Intervals(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _terms(cut: LinearFractional, w) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(one, x, v) of `one = K_VE x + B_VE v` at `z = 1 + w`: 1, G_x and G_v, all times w in a loop that drifts."""
    state = np.linalg.solve(w[..., None, None] * np.eye(cut.E.shape[-1]) - cut.E, cut.B + 0 * w[..., None, None])
    G = (cut.C @ state + cut.D)[..., 0]
    if not cut.integrates:
        return np.ones(G.shape[:-1]), G[..., OFFSET], G[..., VELOCITY]
    return w + 0 * G[..., VELOCITY], G[..., ADVANCE] + w * G[..., OFFSET], w * G[..., VELOCITY]


def _crossings(part: Bundle, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(row, K_VE) with real `K = (one - B_VE v)/x`: refined changes of sign between angles, and z = 1 and z = -1."""
    one, x, v = (term[part.owner] for term in _terms(part.loops.at((slice(None), None)), on_circle(theta)[None]))
    apart = _imaginary(one - part.B_VE[:, None] * v, x)
    row, at = np.nonzero(np.signbit(apart[:, 1:]) != np.signbit(apart[:, :-1]))
    own, B = part.loops.at(part.owner[row]), part.B_VE[row]

    def wall(angle):
        one, x, v = _terms(own, on_circle(angle))
        return one - B * v, x

    angle = _secant(lambda angle: _imaginary(*wall(angle)), (theta[at], theta[at + 1]), (apart[row, at], apart[row, at + 1]))
    over, under = wall(angle)
    rows, values = [row], [(over / under).real]
    for w in (0.0, -2.0):
        one, x, v = (term[part.owner] for term in _terms(part.loops, np.full(part.loops.batch, w)))
        with np.errstate(divide="ignore", invalid="ignore"):
            values.append((one - part.B_VE * v) / x)
        rows.append(np.arange(part.column.size))
    return np.concatenate(rows), np.concatenate(values)


def _imaginary(over, under):
    """Imaginary part of the quotient times `|under|^2`, which has no pole if `under` vanishes."""
    return over.imag * under.real - over.real * under.imag


def _secant(function, ends, values):
    """Zeros within the brackets `ends`, all at once, by a secant that keeps its bracket (Anderson and Bjorck's)."""
    (a, b), (f_a, f_b) = ends, values
    for _ in range(_STEPS):
        c = np.where(f_b == 0, b, b - f_b * (b - a) / (f_b - f_a))
        moved, f_c = np.abs(c - b), function(c)
        past = np.signbit(f_c) != np.signbit(f_b)  # the zero lies between c and b
        left = 1 - f_c / np.where(f_b == 0, 1.0, f_b)
        a, f_a = np.where(past, b, a), np.where(past, f_b, f_a * np.where(left > 0, left, 0.5))
        b, f_b = c, f_c
        if not np.any(moved > _CLOSE * b):
            break
    return b


def _labelled(part: Bundle, stop: float, row, value) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(column, low, high) of the stable runs between the crossings, by one call for the eigenvalues in their middles."""
    inside = (value > 0) & (value < stop)
    every = np.arange(part.column.size)
    rows = np.concatenate([row[inside], every, every])
    marks = np.concatenate([value[inside], np.zeros(every.size), np.full(every.size, stop)])
    order = np.lexsort((marks, rows))
    rows, marks = rows[order], marks[order]
    of = rows[1:][np.diff(rows) == 0]
    low, high = marks[:-1][np.diff(rows) == 0], marks[1:][np.diff(rows) == 0]
    stable = is_stable(part.loops.at(part.owner[of]).closed((low + high) / 2, part.B_VE[of]))
    joined = stable[1:] & stable[:-1] & (np.diff(of) == 0)
    first, last = stable & ~np.append(False, joined), stable & ~np.append(joined, False)
    return part.column[of[first]], low[first], high[last]
