"""The pairs of docs/in-place-of.md: what others ask, computed by hand in numpy, and the same question asked here.

OPENBLAS_NUM_THREADS=1 python benchmarks/in_place_of.py
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import wavesweep
from wavesweep.haptics.controller_page import wall_cut

SWEEPS = Path(__file__).parents[1] / "sweeps"
DAMPINGS, STIFFNESSES = np.linspace(0, 15, 1501), np.linspace(0, 20000, 101)[1:]
LOSS, TICK = 0.01, 1e-3  # of a message; s
INERTIA, KD = 0.0251, 2.0  # of random-loss.toml


def timed(ask: Callable) -> tuple[Any, float]:
    """What a call gives, and its processor time."""
    started = time.process_time()
    return ask(), time.process_time() - started


def grid() -> tuple[int, float, float, float]:
    """Dampings at which a grid of eigenvalues has another number of stable intervals, and how far (N/m) its largest stable
    stiffness is off at others; seconds of the grid, and of all intervals."""
    loop = wavesweep.compile(SWEEPS / "paper/fig4-b25.toml")
    closed = wall_cut(loop.spec.values).at((None, None)).closed
    loop.stable_intervals(span=(0, 20000), B_VE=DAMPINGS[:2])
    stable, by_hand = timed(lambda: np.abs(1 + np.linalg.eigvals(closed(STIFFNESSES[:, None], DAMPINGS))).max(-1) < 1)
    table, here = timed(lambda: loop.stable_intervals(span=(0, 20000), B_VE=DAMPINGS))
    begun = stable & ~np.vstack([np.zeros_like(stable[:1]), stable[:-1]])
    columns = table.groupby("B_VE")
    other = begun.sum(0) != columns.intervals.first().to_numpy()
    off = columns.high.max().to_numpy() - STIFFNESSES[len(STIFFNESSES) - 1 - stable[::-1].argmax(0)]
    return int(other.sum()), float(off[~other].max()), by_hand, here


def grows(kp: float) -> bool:
    """Whether the second moments of an arm grow whose torque is lost with probability LOSS, and held then."""
    decay = np.array([[1, TICK, TICK**2 / 2 / INERTIA], [0, 1, TICK / INERTIA], [0, 0, 1]])
    sent = decay @ np.array([[1, 0, 0], [0, 1, 0], [-kp, -KD, 0]])
    moments = (1 - LOSS) * np.kron(sent, sent) + LOSS * np.kron(decay, decay)
    return bool(np.abs(np.linalg.eigvals(moments)).max() >= 1)


def largest() -> float:
    """The kp from which the second moments grow, by halving, if they do so from there on."""
    low, high = 300.0, 5000.0
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (low, middle) if grows(middle) else (middle, high)
    return high


def moments() -> tuple[float, float, float, float, float]:
    """The kp from which second moments grow, that which is proved and that which is refuted; seconds of both."""
    found, by_hand = timed(largest)
    spec = wavesweep.load(SWEEPS / "recipes/random-loss.toml", ["sweep.p=[0.01]", "sweep.b=[0]"])
    table, here = timed(lambda: wavesweep.stability_region(spec))
    row = table[table.guarantee == "mean_square"].iloc[0]
    return found, row.high, row.fails_from, by_hand, here


def main() -> None:
    """Print a line for each pair."""
    missed, off, by_hand, here = grid()
    print(f"eigenvalues at {len(STIFFNESSES)} stiffnesses, {len(DAMPINGS)} dampings: {by_hand:.2g} s")
    print(f"  another number of intervals at {missed} of these, the largest wall up to {off:.0f} N/m too low at others")
    print(f"stable_intervals, certified: {here:.2g} s")
    found, proved, refuted, by_hand, here = moments()
    print(f"second moments by hand: grow from {found:.6g} N*m/rad, {by_hand:.2g} s")
    print(f"stability_region: proved to {proved:.6g}, refuted at {refuted:.6g} N*m/rad, {here:.2g} s")


if __name__ == "__main__":
    main()
