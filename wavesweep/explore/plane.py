"""The stability boundary in the plane of both wall parameters, as one explicit curve; fast, and
without a proof.

At `z = exp(j theta)` the characteristic equation `one = K_VE x + B_VE v` (see `boundary`) is
complex, and both parameters are real: two linear equations with the solution (Cramer)

    K_VE = Im(conj(one) v) / Im(conj(x) v),    B_VE = Im(conj(x) one) / Im(conj(x) v).

At z = 1 and z = -1 all three terms are real, and the boundary is a straight line (D-decomposition,
Neimark 1948).
"""

from typing import NamedTuple

import numpy as np

from wavesweep.engine.frames import LinearFractional, on_circle, solve
from wavesweep.engine.intervals import terms_at
from wavesweep.engine.poles import is_stable


def plane_curve(cut: LinearFractional, theta) -> np.ndarray:
    """Return the walls (K_VE in N/m, B_VE in N*s/m) with an eigenvalue at `exp(j theta)`, `(2,
    points)`.

    cut: one loop. theta: angles in (0, pi), rad per frame. Infinite or NaN at an angle at which no
    wall has one, or all on a line have. Accuracy: that of a solve, about 1e-12 relative; it falls
    with `Im(conj(x) v)`, towards z = 1 and z = -1.
    """
    t = _terms(cut, np.asarray(theta, float))
    with np.errstate(all="ignore"):
        common = (np.conj(t.x) * t.v).imag
        return np.stack([(np.conj(t.unit) * t.v).imag, (np.conj(t.x) * t.unit).imag]) / common


def plane_lines(cut: LinearFractional) -> np.ndarray:
    """Return the straight parts of the boundary, `unit = K_VE x + B_VE v` at z = 1 and at z = -1:
    rows (unit, x, v), `(2, 3)`.

    cut: one loop. A row with x = v = 0 is no line.
    """
    t = _terms(cut, np.array([0.0, np.pi]))
    return np.stack([t.unit.real, t.x.real, t.v.real], -1)


def _terms(cut, theta):
    w = on_circle(theta)
    with np.errstate(all="ignore"):
        A = w[:, None, None] * np.eye(cut.E.shape[-1]) - cut.E
        state = solve(A, cut.B + 0 * w[:, None, None])
        return terms_at(cut, w, state)


class WallCurve(NamedTuple):
    """The boundary as points: angles (rad per frame), and walls, `(n,)`, `(2, n)`."""

    angles: np.ndarray
    walls: np.ndarray


CURVE_ANGLES = 160  # angles of a curve at the start


def refined_curve(cut: LinearFractional, window) -> WallCurve:
    """Return points along the curve, with small steps inside a window.

    cut: one loop. window: ((lowest, highest K_VE), (lowest, highest B_VE)).
    """
    low, high = np.asarray(window, float).T[:, :, None]
    slow = np.geomspace(1e-4, 0.1, CURVE_ANGLES // 2)
    fast = np.linspace(0.1, np.pi - 1e-6, CURVE_ANGLES // 2 + 1)
    theta = np.concatenate([slow, fast[1:]])
    walls = plane_curve(cut, theta)
    for _ in range(4):  # halvings of steps longer than a hundredth of a window
        with np.errstate(all="ignore"):
            place = (walls - low) / (high - low)
            near = (np.abs(place - 0.5) < 1).all(0)
            long = (np.abs(np.diff(place)).max(0) > 0.01) & (near[1:] | near[:-1])
        if not long.any():
            break
        between = (theta[:-1][long] + theta[1:][long]) / 2
        order = np.argsort(np.concatenate([theta, between]), kind="stable")
        walls = np.concatenate([walls, plane_curve(cut, between)], -1)[:, order]
        theta = np.concatenate([theta, between])[order]
    return WallCurve(theta, walls)


def quick_columns(
    cut: LinearFractional, curve: WallCurve, solved: int, fixed: np.ndarray, span, rounds: int = 2
) -> list[list[tuple[float, float]]]:
    """Return the stable intervals of one wall parameter for each value of the other, from a curve:
    without a proof.

    cut: one loop. curve: its boundary, see `refined_curve`. solved: 0 for intervals of
    K_VE, 1 for B_VE. fixed: values of the other one, `(columns,)`. span: (low, high) of the
    intervals. rounds: of false position, by which the ends are improved. Eigenvalues in the middle
    decide which of the parts between two ends are stable.
    """
    column, value = _crossings(cut, *curve, solved, fixed, rounds)
    with np.errstate(all="ignore"):
        lines = plane_lines(cut)
        straight = (lines[:, :1] - lines[:, 2 - solved, None] * fixed) / lines[:, 1 + solved, None]
    column = np.concatenate([column, np.tile(np.arange(fixed.size), 2)])
    value = np.concatenate([value, straight.ravel()])
    inside = (value > span[0]) & (value < span[1])
    every = np.arange(fixed.size)
    column = np.concatenate([column[inside], every, every])
    value = np.concatenate(
        [value[inside], np.full(fixed.size, span[0]), np.full(fixed.size, span[1])]
    )
    order = np.lexsort((value, column))
    column, value = column[order], value[order]
    steps = np.flatnonzero(np.diff(column) == 0)
    middle = (value[steps] + value[steps + 1]) / 2
    other = fixed[column[steps]]
    K_VE, B_VE = (middle, other) if solved == 0 else (other, middle)
    stable = is_stable(cut.closed(K_VE, B_VE)) & (value[steps + 1] > value[steps])
    intervals: list[list[tuple[float, float]]] = [[] for _ in every]
    for at in steps[stable].tolist():
        of_column = intervals[column[at]]
        low = float(value[at])
        high = float(value[at + 1])
        if of_column and of_column[-1][1] == low:
            low, _ = of_column.pop()
        of_column.append((low, high))
    return intervals


def _crossings(cut, theta, walls, solved, fixed, rounds):
    """Return the points at which the curve meets the lines of a fixed parameter.

    They are given by the index of the line, and the other parameter there.
    """
    across = walls[1 - solved]
    line, step = _steps_across(across, fixed)
    # Rows: angle, distance from the line, and the other parameter at both ends of each step.
    left = np.stack([theta[step], across[step] - fixed[line], walls[solved][step]])
    right = np.stack([theta[step + 1], across[step + 1] - fixed[line], walls[solved][step + 1]])
    weight_of_left = np.ones(step.size)
    weight_of_right = np.ones(step.size)
    with np.errstate(all="ignore"):
        for _ in range(rounds if step.size else 0):
            f_left = weight_of_left * left[1]
            share = f_left / (f_left - weight_of_right * right[1])
            angle = left[0] + share * (right[0] - left[0])
            at = plane_curve(cut, angle)
            middle = np.stack([angle, at[1 - solved] - fixed[line], at[solved]])
            same = middle[1] * left[1] > 0  # the crossing is between the middle and the right end
            # Illinois: the end that stays counts half, so that it does not stay in every round.
            weight_of_left = np.where(same, 1.0, weight_of_left / 2)
            weight_of_right = np.where(same, weight_of_right / 2, 1.0)
            left = np.where(same, middle, left)
            right = np.where(same, right, middle)
        # The last piece is taken for straight: it often is, all over.
        share = left[1] / (left[1] - right[1])
        straight = left[2] + share * (right[2] - left[2])
        value = np.where(left[1] == right[1], left[2], straight)
    good = np.isfinite(value)
    return line[good], value[good]


def _steps_across(across, fixed):
    """Return each pair of a line `across = fixed` and a step of a curve that crosses it: two
    arrays of indices."""
    order = np.argsort(fixed)
    usable = np.isfinite(across)
    # How many lines lie below each point of the curve: a step crosses those between its ends.
    below = np.searchsorted(fixed[order], np.where(usable, across, 0.0))
    first = np.minimum(below[:-1], below[1:])
    count = np.abs(np.diff(below)) * (usable[1:] & usable[:-1])
    step = np.repeat(np.arange(count.size), count)
    before = np.cumsum(count) - count
    number = np.arange(step.size) - before[step]
    return order[first[step] + number], step
