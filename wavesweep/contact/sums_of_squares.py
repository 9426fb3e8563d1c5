"""The proof that a multiplier serves at walls: a sum of squares, found by Riccati's equation and decided by
the inequality of a proof file, (2) of `checker/contact.py`."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from wavesweep.checker import balls, contact, file, form
from wavesweep.contact.multipliers import Multiplier
from wavesweep.contact.wall_loop import WallLoop
from wavesweep.engine.frames import Bounded

LEFT_OVER = 10.0 ** -np.arange(
    1, 13
)  # of the sum of squares, in units of forces: the most that is found


def serves(loop: WallLoop, walls: np.ndarray, multiplier: Multiplier) -> bool:
    """Return whether every motion of all loops within the bounds of `loop` is proved to come to rest at these
    walls `(walls, 2)`, K and B of each, and so at all between them.

    The loops have to be stable without a wall, but for a pole of `-K G_x` at z = 1, whose residue has to be
    positive.
    """
    e, h = (list(map(Fraction, weights)) for weights in (multiplier.after, multiplier.before))
    if not loop.stable or min(e + h) < 0 or sum(e + h) >= 1:
        return False
    for wall in walls:
        opened = _opened(loop, wall)
        radius, turns = opened.turns
        outwards = radius + turns >= 0 and opened.turns != (0, 0)
        if outwards or sum_of_squares(opened, e, h) is None:
            return False
    return True


def _opened(loop: WallLoop, wall: np.ndarray) -> contact.Opened:
    """The loop in a frame as the inequality has it, at a wall (K, B)."""
    read = Bounded.exact(wall) @ loop.rows
    direct = Bounded.exact(wall) @ loop.direct - Bounded.exact(1.0)
    moved = [[*row, b] for row, b in zip(balls_of(loop.E), balls_of(loop.B), strict=True)]
    for i, row in enumerate(moved):
        row[i] = balls.add(row[i], (0, balls.ONE))
    return contact.Opened(
        moved, [*balls_of(read), balls_of(direct)], balls_of(loop.residue * wall[0])
    )


def balls_of(bounded: Bounded) -> Any:
    """Entries as balls of the checker, in lists as the array has them."""
    if np.ndim(bounded.value):
        return [balls_of(bounded.part(i)) for i in range(len(bounded.value))]
    rounded, middle = balls.ball(Fraction(float(bounded.value)))
    short, radius = balls.ball(Fraction(float(bounded.error)))
    return rounded + short + radius, middle


def doubles_of(rows: list, width: int) -> np.ndarray:
    """The middles of rows of balls, `(rows, width)`."""
    middles = [middle / balls.ONE for row in rows for _, middle in row]
    return np.array(middles).reshape(len(rows), width)


def sum_of_squares(
    loop: contact.Opened, e: list[Fraction], h: list[Fraction]
) -> list[list[str]] | None:
    """A form P with which the checker accepts (2) of its `contact.py`: with X = -P Riccati's equation

        S' X S - X + Q - (S' X s + q)(r + s' X s)^-1 (S' X s + q)' = 0

    leaves nothing of (2), whose part without P is Q, q, r, but a square. None if none is found.
    """
    n = len(loop.moved)
    size = n + len(e)
    zero = [[0] * size for _ in range(size)]
    rest = contact.left_over(loop, e, h, zero).parts[()]
    whole = np.array([[x / balls.ONE for x in row] for row in rest])
    whole = (whole + whole.T) / 2
    S = np.eye(size, size + 1, 1)
    S[:n] = np.pad(doubles_of(loop.moved, n + 1), ((0, 0), (0, len(e))))
    # In units in which forces of size 1 in any order give states of size 1, if they move them at all.
    spread = np.diag(solve_discrete_lyapunov(S[:, :-1], S[:, -1:] @ S[:, -1:].T))
    units = np.append(np.sqrt(np.where(spread > 0, spread, 1.0)), 1.0)
    S *= units / units[:-1, None]
    whole *= np.outer(units, units)
    for least in LEFT_OVER:
        F = whole - least * np.eye(size + 1)
        try:
            X = solve_discrete_are(S[:, :-1], S[:, -1:], F[:-1, :-1], F[-1:, -1:], s=F[:-1, -1:])
        except np.linalg.LinAlgError:
            continue
        P = -(X + X.T) / 2 / np.outer(units[:-1], units[:-1])
        rows = [[repr(x) for x in row] for row in P.tolist()]
        if form.positive(contact.left_over(loop, e, h, file.rows_of(rows, size))):
            return rows
    return None
