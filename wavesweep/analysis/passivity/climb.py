"""The largest value of a frequency response, by levels: found at one frequency and shown to be passed at none."""

from dataclasses import dataclass

import numpy as np

START = np.pi * np.array([0.0, 1e-3, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0])
ROUNDS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Summit:
    """Per loop: the largest value, the angle (rad per frame) where it is taken, and whether no larger one can exist.

    certified: the pencil of the level just above has no eigenvalue on the unit circle but such where the response,
    looked at there and half-way between neighbours, is below that level.
    """

    value: np.ndarray
    theta: np.ndarray
    certified: np.ndarray


def climb(value_at, angles_at, loops: int, slack, start=START) -> Summit:
    """Maximise over the angle, for `loops` loops at once.

    value_at(owner, theta): the response of the loops `owner` at `theta`, both `(points,)`.
    angles_at(owner, level): angles at which a level may be met, `(owners, any)` with NaN for none.
    slack(owner, value): by how much the level that is shown to be out of reach lies above the value.
    Source: S. Boyd, V. Balakrishnan, Systems & Control Letters 15 (1990); N. Bruinsma, M. Steinbuch, ibid. 14 (1990):
    between two neighbouring angles at which a level is met the response is on one side of it, so their middle tells
    which, and the next level is what was found there. Quadratic convergence: 2 to 5 rounds.
    """
    value, theta = np.full(loops, -np.inf), np.zeros(loops)
    certified, active = np.zeros(loops, bool), np.arange(loops)
    _raise(value, theta, value_at, active, np.broadcast_to(start, (loops, len(start))))
    for _ in range(ROUNDS):
        level = value[active] + slack(active, value[active])
        _raise(value, theta, value_at, active, _with_middles(angles_at(active, level)))
        beaten = value[active] > level
        certified[active[~beaten]] = True
        active = active[beaten]
        if not active.size:
            break
    return Summit(value, theta, certified)


def _with_middles(found):
    """The angles found, 0 and pi, and the middles between neighbours; NaN where there are fewer."""
    ends = np.broadcast_to([0.0, np.pi], (*found.shape[:-1], 2))
    known = np.sort(np.concatenate([found, ends], axis=-1), axis=-1)  # NaN goes last
    return np.concatenate([known, (known[..., 1:] + known[..., :-1]) / 2], axis=-1)


def _raise(value, theta, value_at, owners, candidates):
    """Take for each of the owners the best of its candidates where that is better than what it has."""
    row, column = np.nonzero(np.isfinite(candidates))
    at = np.full(candidates.shape, -np.inf)
    at[row, column] = value_at(owners[row], candidates[row, column])
    best = np.argmax(at, axis=-1)[:, None]
    found, where = (np.take_along_axis(part, best, -1)[:, 0] for part in (at, candidates))
    better = found > value[owners]
    value[owners[better]], theta[owners[better]] = found[better], where[better]
