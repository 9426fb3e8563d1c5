"""Methods that look at points of a grid, one by one or all at once, as a user would write them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wavesweep.bench.problems import Bundle, bundles
from wavesweep.bench.scoring import Answer
from wavesweep.lifted import close
from wavesweep.lifted.cut import open_in
from wavesweep.spec import Spec


def grid_of(spec: Spec, points: int) -> np.ndarray:
    """So many values of K_VE over the range, its lower end left out: there the position of the scene drifts."""
    stop = next(axis.stop for axis in spec.sweep if axis.name == "K_VE")
    return np.linspace(0, stop, points + 1)[1:]


def batched(spec: Spec, points: int) -> Answer:
    """numpy: the eigenvalues of all points of a grid in one call."""
    K = grid_of(spec, points)
    return answer_of(K, [(part, is_stable(close(_across(part), K, part.B_VE[:, None]))) for part in bundles(spec)])


def is_stable(E: np.ndarray) -> np.ndarray:
    """Whether all eigenvalues of `I + E` are inside the unit circle."""
    return (np.abs(1 + np.linalg.eigvals(E)) < 1).all(-1)


def _across(part: Bundle):
    return part.cut.at((slice(None), None))


def looped(spec: Spec, points: int) -> Answer:
    """numpy: a loop over the points, the wall closed by its rank-one formula."""
    return _one_by_one(spec, points, _numpy_test)


def feedback(spec: Spec, points: int) -> Answer:
    """python-control: `feedback` per point on a plant that is made once."""
    return _one_by_one(spec, points, feedback_test)


def interconnected(spec: Spec, points: int) -> Answer:
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
    return answer_of(K, parts)


def _plant(part, row):
    """`(A, B, C, D)` from the wall's force to the displacement and the velocity that it reads, the position a state."""
    E, B, x = open_in(part.cut.at(row), "K_VE", np.asarray(0.0))
    _, _, v = open_in(part.cut.at(row), "B_VE", np.asarray(0.0))
    D = part.cut.at(row).D
    return E + np.eye(len(E)), B, np.vstack([x, v]), np.vstack([D[2], D[0]])


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
    E, B, x = open_in(one, "K_VE", part.B_VE[row])
    period = float(one.period)
    plant = control.ss(E + np.eye(len(E)), B, x, 0, period, inputs=["F"], outputs=["x"], name="plant")

    wires = [["plant.F", "wall.F"], ["wall.x", "plant.x"]]

    def test(K):
        wall = control.ss([], [], [], [[K]], period, inputs=["x"], outputs=["F"], name="wall")
        whole = control.interconnect([plant, wall], wires, inplist=["plant.F"], outlist=["plant.x"])
        return np.abs(whole.poles()).max() < 1

    return test


def answer_of(K: np.ndarray, parts) -> Answer:
    """Stable runs of a grid; an end is in the middle between a stable point and its unstable neighbour.

    parts: (bundle, verdicts `(columns, points)`) pairs.
    """
    column = np.concatenate([part.column for part, _ in parts])
    stable = np.concatenate([verdict for _, verdict in parts])
    edges = np.concatenate([[0.0], (K[1:] + K[:-1]) / 2, K[-1:]])
    change = np.diff(np.pad(stable, ((0, 0), (1, 1))).astype(int), axis=-1)
    first, last = np.nonzero(change == 1), np.nonzero(change == -1)
    return Answer(column[first[0]], edges[first[1]], edges[last[1]])
