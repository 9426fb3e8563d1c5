"""What is not proved of late ticks, measured: nothing here is a proof.

python benchmarks/late_ticks_beyond.py measured   patterns that refute, of differences over the nominal and the measured tick
python benchmarks/late_ticks_beyond.py mass       norms for two masses at once, as if the mass changed from tick to tick
python benchmarks/late_ticks_beyond.py memory     nodes that remember up to four ticks, beside those that remember one
"""

import sys
import time

import late_ticks
import numpy as np
from scipy.linalg import expm

from wavesweep.late_ticks import bracket
from wavesweep.late_ticks.tick_curves import DEGREE, LateTicks, _curves, _family, _point
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

MASS, DAMPING, TICK, TICKS, WALL_DAMPING = 0.1, 1.5, 1e-3, 20, 1.0
SLOW = "direct coupling at the slow rate, a frame late"


def marched(stiffness, length, delay, measured):
    """The matrices of ticks of a length at each place of a frame, of a march of its own.

    States: x, v, the velocity that the program reads, the force shown, the force to come.
    """
    A = np.array([[0, 1, 0], [0, -DAMPING / MASS, -1 / MASS], [0, 0, 0]])
    moved = np.eye(5)
    moved[:2] = 0
    moved[:2, [0, 1, 3]] = expm(A * length)[:2]
    moved[2] = (moved[0] - np.eye(5)[0]) / (length if measured else TICK)
    matrices = []
    for place in range(TICKS):
        program = np.eye(5)
        if place == delay % TICKS:
            program[3] = program[4]
        if place == 0:
            program[4] = [stiffness, 0, WALL_DAMPING, 0, 0]
        matrices.append(moved @ program)
    return np.array(matrices)


def growth(matrices, pattern):
    """The spectral radius of a pattern of ticks, 0 for short and 1 for long ones."""
    product = np.eye(5)
    for k, tick in enumerate(pattern):
        product = matrices[tick][k % TICKS] @ product
    return np.abs(np.linalg.eigvals(product)).max()


def climbed(matrices, rng):
    """The largest growth per frame of patterns that are changed tick by tick."""
    best = 0.0
    for frames in (1, 2):
        length = frames * TICKS
        for start in (np.zeros(length, int), np.ones(length, int), rng.integers(0, 2, length)):
            pattern = start
            largest = growth(matrices, pattern)
            better = True
            while better:
                better = False
                for k in range(length):
                    changed = pattern.copy()
                    changed[k] = 1 - changed[k]
                    rate = growth(matrices, changed)
                    if rate > largest * (1 + 1e-12):
                        pattern = changed
                        largest = rate
                        better = True
            best = max(best, largest ** (1 / frames))
    return best


def measured():
    """Refuted stiffness with both kinds of differences."""
    rng = np.random.default_rng(0)
    for delay, stable, unstable in ((20, 30.0, 110.0), (1, 100.0, 320.0)):
        for late in late_ticks.LATE:
            ends = []
            for by_measured in (False, True):
                low, high = stable, unstable
                for _ in range(10):
                    middle = (low + high) / 2
                    pair = [marched(middle, length, delay, by_measured) for length in (TICK, TICK + late)]
                    low, high = (low, middle) if climbed(pair, rng) >= 1 else (middle, high)
                ends.append(high)
            print(f"delay {delay}, late {late:g} s: nominal {ends[0]:.2f}, measured {ends[1]:.2f}", flush=True)


def of_masses(masses, interval):
    """Ticks whose control points are those of several masses."""
    points = []
    for mass in masses:
        tables = late_ticks.LOOPS[SLOW]
        own = own_loop(load({**tables, "device": {**tables["device"], "mass": mass}}), late_ticks.WALL)
        curves = _curves(own, *interval)
        for j in range(DEGREE + 1):
            points.append({name: _point(both, j) for name, both in curves.items()})
    family, places = _family(own, late_ticks.WALL, points)
    lengths = np.array([*interval] * len(masses))
    return LateTicks(family, lengths, places, len(masses))


def mass():
    """What is left of a wall with norms for all masses between two at once."""
    for share in (0.0, 0.02, 0.05, 0.1):
        began = time.process_time()
        masses = [MASS * (1 - share), MASS * (1 + share)]
        search = bracket.Search(of_masses(masses, (TICK, 1.1 * TICK)))
        reached = search.alike(20.0).opened().walked(80.0).x
        print(f"mass within {share:.0%}: {reached:.2f} N/m, {time.process_time() - began:.1f} s", flush=True)


def memory():
    """Proved and refuted ends of waves a frame late, with nodes that remember one tick at most, or more."""
    for late in late_ticks.LATE:
        for name in list(late_ticks.LOOPS)[1:3]:
            for most in (1, 4):
                bracket.MOST_REMEMBERED = most
                proved, refuted, _, took = late_ticks.bracketed(late_ticks.LOOPS[name], late)
                print(f"{name}, {late:g} s, {most}: {proved:.1f}, {refuted:.1f}, {took:.1f} s", flush=True)


if __name__ == "__main__":
    {"measured": measured, "mass": mass, "memory": memory}[sys.argv[1]]()
