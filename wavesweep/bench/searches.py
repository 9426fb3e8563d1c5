"""Methods that search: bisection for "the" largest stiffness, and a grid whose changes of verdict are refined."""

from __future__ import annotations

import numpy as np

from wavesweep.bench.points import answer_of, feedback_test, grid_of, is_stable
from wavesweep.bench.problems import bundles
from wavesweep.bench.scoring import Answer
from wavesweep.lifted import close
from wavesweep.spec import Spec


def bisected(spec: Spec, tolerance: float) -> Answer:
    """Bisection for the largest stable K_VE, column by column; tolerance: relative to the range."""
    return _largest(spec, tolerance, one_by_one=True)


def bisected_together(spec: Spec, tolerance: float) -> Answer:
    """The same, the eigenvalues of all columns in one call."""
    return _largest(spec, tolerance, one_by_one=False)


def _largest(spec, tolerance, one_by_one):
    stop = grid_of(spec, 1)[-1]
    columns, ends = [], []
    for part in bundles(spec):
        rows = np.arange(part.column.size)
        for some in np.split(rows, rows.size) if one_by_one else [rows]:
            cut, B = part.cut.at(some), part.B_VE[some]
            low, high = np.zeros(some.size), np.full(some.size, stop)
            low = np.where(is_stable(close(cut, high, B)), high, low)
            ends.append(_narrowed(cut, B, low, high, tolerance * stop))
            columns.append(part.column[some])
    high = np.concatenate(ends)
    return Answer(np.concatenate(columns), np.zeros(high.size), high)


def _narrowed(cut, B, stable, unstable, width):
    """Halve the brackets until they are that narrow, and give their middles."""
    while np.abs(unstable - stable).max(initial=0) > width:
        middle = (stable + unstable) / 2
        inside = is_stable(close(cut, middle, B))
        stable, unstable = np.where(inside, middle, stable), np.where(inside, unstable, middle)
    return (stable + unstable) / 2


def bisected_by_feedback(spec: Spec, tolerance: float) -> Answer:
    """The same with python-control, a `feedback` and its poles per step."""
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
    return Answer(np.array(columns), np.zeros(len(ends)), np.array(ends))


def refined(spec: Spec, setting: tuple[int, float]) -> Answer:
    """A batched grid, then each change of verdict on it bisected, all together; setting: (points, relative tolerance)."""
    points, tolerance = setting
    K = grid_of(spec, points)
    answers = []
    for part in bundles(spec):
        stable = is_stable(close(part.cut.at((slice(None), None)), K, part.B_VE[:, None]))
        row, at = np.nonzero(stable[:, 1:] != stable[:, :-1])
        inside, outside = np.where(stable[row, at], K[at], K[at + 1]), np.where(stable[row, at], K[at + 1], K[at])
        ends = _narrowed(part.cut.at(row), part.B_VE[row], inside, outside, tolerance * K[-1])
        answers.append(_with_ends(answer_of(K, [(part, stable)]), K, (part.column[row], at, ends)))
    return Answer(*(np.concatenate([getattr(answer, name) for answer in answers]) for name in ("column", "low", "high")))


def _with_ends(coarse, K, changes):
    """The coarse answer with refined ends in the places of the middles that they started from."""
    column, at, ends = changes
    middle = dict(zip(zip(column.tolist(), ((K[at] + K[at + 1]) / 2).tolist(), strict=True), ends.tolist(), strict=True))

    def better(end):
        return np.array([middle.get(key, key[1]) for key in zip(coarse.column.tolist(), end.tolist(), strict=True)])

    return Answer(coarse.column, better(coarse.low), better(coarse.high))
