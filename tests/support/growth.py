"""Growth in time: the spectral radius of a frame, from nothing but marching, and beside every reported end for random specs.

Run as a program for as many specs as wanted:

    PYTHONPATH=tests python -m support.growth 200

The march knows nothing of lifting. Loops whose fastest mode grows or decays by less than 1e-7 a frame at the probe are left
out: no march of a few thousand frames could tell.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from support.controllers import Loop, compile_loop
from support.march import State, numbers_of, random_state, tick, with_numbers
from support.specs import random_values
from wavesweep.monodromy.cut import close
from wavesweep.stability import stable_intervals
from wavesweep.sweep.open_loops import wall_cut

STEP = 1e-3  # relative, from an end to the probe
SLOWEST = 1e-7
FRAMES = 2000  # 600 leave two of 286 probes undecided: a slow mode beside a drift takes that long to stand out
_SPAN = 8  # differences that the last fit looks at: room for the leading modes where several are of like size
_DRIFT = 1e-9  # of the state: motion this small beside drift has 7 digits left; no slower mode is told from drift
_NOISE = 1e-10  # singular values below this part of the largest are rounding, not motion


@dataclass(frozen=True)
class Growth:
    """Growth per frame (no unit), and the part (0 to 1) of the last motion that its modes leave unexplained."""

    per_frame: float
    residual: float


def growth_rate(values: Mapping, frames: int = 400, seed: int = 0) -> float:
    """The spectral radius of one frame without drift; above 1 the loop is unstable. See `growth`."""
    return growth(values, frames, seed).per_frame


def growth(values: Mapping, frames: int = 400, seed: int = 0) -> Growth:
    """How much the free motion from a random state grows per frame (per tick for `dc`, which has no frame).

    Drift is set aside by looking at differences ``s[j+1] - s[j]`` of the state: what stays for ever drops out of them.
    After every stretch the state is made of size 1, so that nothing overflows; where drift has come up again by
    rounding, the march goes on from a difference. The last differences span the modes that are left; the largest of the
    modes fitted to them is the answer. (The motion's plain norm would beat with the phase of an oscillation.)

    Parameters: `values` the flat values of a spec; `frames` to march; `seed` of the random state.

    Accuracy: about ``(r₉/r₁)^frames`` with the spectral radius ``r₁`` and the ninth largest mode ``r₉``, and rounding
    (1e-7 at worst, where the motion dies out beside a drift); the residual tells. A loop that overflows within a
    single frame has the growth ``inf``.
    """
    loop = compile_loop(values)
    state = _step(loop, random_state(loop, seed))
    rows, state = _stretch(loop, state, 1)
    state = with_numbers(state, rows[-1] - rows[-2])
    for _ in range(max(1, frames // _SPAN) - 1):
        rows, state = _stretch(loop, state, _SPAN)
        numbers = _drop_drift(rows)
        size = np.linalg.norm(numbers) if np.isfinite(numbers).all() else np.inf
        if size in {0.0, np.inf}:
            return Growth(float(size), 0.0)
        state = with_numbers(state, numbers / size)
    moved = np.diff(_stretch(loop, state, _SPAN + 1)[0], axis=0).T
    return _fit(moved) if np.isfinite(moved).all() else Growth(np.inf, 0.0)


def _drop_drift(rows: np.ndarray) -> np.ndarray:
    """The last state, or the last difference in its place once hardly anything but drift is left in the state.

    Not at every turn: a difference weighs a mode ``r`` by ``|r - 1|``, and would starve the slow modes that decide.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # a loop that overflows is seen by its infinities
        moved = rows[-1] - rows[-2]
        drifts = np.abs(moved).max() < _DRIFT * np.abs(rows[-1]).max()
    return moved if drifts else rows[-1]


def _fit(moved: np.ndarray) -> Growth:
    """Fit the modes of ``d[j+1] = A·d[j]`` to the columns ``d`` of `moved`, by least squares in their span."""
    before, after = moved[:, :-1], moved[:, 1:]
    scale = np.linalg.norm(moved, axis=0).max()
    if scale == 0.0:
        return Growth(0.0, 0.0)
    left, sizes, right = np.linalg.svd(before / scale, full_matrices=False)
    kept = sizes > _NOISE * sizes[0]
    left, to_modes = left[:, kept], (right[kept].T / sizes[kept])
    small = left.T @ (after / scale) @ to_modes
    missed = after / scale - left @ (left.T @ (after / scale))
    residual = np.linalg.norm(missed) / np.linalg.norm(after / scale)
    return Growth(float(np.abs(np.linalg.eigvals(small)).max()), float(residual))


def _stretch(loop: Loop, state: State, frames: int) -> tuple[np.ndarray, State]:
    """The state's numbers now and after each of the next frames, a row each, and the last state."""
    rows = [numbers_of(state)]
    for _ in range(frames):
        state = _step(loop, state)
        rows.append(numbers_of(state))
    return np.array(rows), state


def _step(loop: Loop, state: State) -> State:
    """One frame with the hand force at zero."""
    for _ in range(loop.frame):
        state = tick(loop, state, 0.0)[0]
    return state


def probes(values):
    """[(K_VE, whether the intervals say stable), ...] next to every inner end along K_VE in (0, 20000)."""
    found = stable_intervals(wall_cut(values).at(np.newaxis), "K_VE", (0, 20000.0), [[values["environment.B_VE"]]])
    inner = [
        *zip(found.low, found.low_omega, [1] * found.low.size, strict=True),
        *zip(found.high, found.high_omega, [-1] * found.high.size, strict=True),
    ]
    ends = [(end, side) for end, omega, side in inner if end > 0 and not np.isnan(omega)]
    return [(end * (1 + way * side * STEP), way > 0) for end, side in ends for way in (1, -1)]


def disagreements(values):
    """Probes where the march says otherwise, and how many could be told."""
    wrong, told = [], 0
    for stiffness, stable in probes(values):
        at = values | {"environment.K_VE": stiffness}
        radius = np.abs(1 + np.linalg.eigvals(close(wall_cut(at), stiffness, at["environment.B_VE"]))).max()
        if abs(radius - 1) < SLOWEST:
            continue
        told += 1
        if (growth_rate(at, frames=FRAMES) < 1) != stable:
            wrong.append((stiffness, stable, radius - 1))
    return wrong, told


def main(count):
    """Print the tally over the first `count` random specs; leave with 1 where any disagrees."""
    total, faults = 0, []
    for seed in range(count):
        wrong, told = disagreements(random_values(seed))
        total += told
        faults += [(seed, *fault) for fault in wrong]
    print(f"{count} specs, {total} probes told by the march, {len(faults)} disagree: {faults}")  # noqa: T201 - a program says what it found
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
