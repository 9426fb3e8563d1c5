"""Growth in time on both sides of every reported end, for random specs: run as a program for as many as wanted.

    python tests/support/growth.py 200

The march knows nothing of lifting. Loops whose fastest mode grows or decays by less than 1e-7 a frame at the probe are left
out: no march of a few thousand frames could tell.
"""

import sys

import numpy as np

from wavesweep.analysis.intervals import stable_intervals
from wavesweep.analysis.march import growth_rate
from wavesweep.diagram import draw
from wavesweep.lifted import close, cut_at_wall

STEP = 1e-3  # relative, from an end to the probe
SLOWEST = 1e-7
FRAMES = 2000  # 600 leave two of 286 probes undecided: a slow mode beside a drift takes that long to stand out


def probes(values):
    """[(K_VE, whether the intervals say stable), ...] next to every inner end along K_VE in (0, 20000)."""
    found = stable_intervals(cut_at_wall(draw(values)).at(np.newaxis), "K_VE", (0, 20000.0), [[values["environment.B_VE"]]])
    inner = [*zip(found.low, found.low_omega, [1] * found.low.size, strict=True),
             *zip(found.high, found.high_omega, [-1] * found.high.size, strict=True)]
    ends = [(end, side) for end, omega, side in inner if end > 0 and not np.isnan(omega)]
    return [(end * (1 + way * side * STEP), way > 0) for end, side in ends for way in (1, -1)]


def disagreements(values):
    """Probes where the march says otherwise, and how many could be told."""
    wrong, told = [], 0
    for stiffness, stable in probes(values):
        at = values | {"environment.K_VE": stiffness}
        radius = np.abs(1 + np.linalg.eigvals(close(cut_at_wall(draw(at)), stiffness, at["environment.B_VE"]))).max()
        if abs(radius - 1) < SLOWEST:
            continue
        told += 1
        if (growth_rate(at, frames=FRAMES) < 1) != stable:
            wrong.append((stiffness, stable, radius - 1))
    return wrong, told


def main(count):
    """Print the tally over the first `count` random specs; leave with 1 where any disagrees."""
    from support.specs import random_values

    total, faults = 0, []
    for seed in range(count):
        wrong, told = disagreements(random_values(seed))
        total += told
        faults += [(seed, *fault) for fault in wrong]
    print(f"{count} specs, {total} probes told by the march, {len(faults)} disagree: {faults}")  # noqa: T201 - a program says what it found
    return 1 if faults else 0


if __name__ == "__main__":
    import pathlib

    sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
