"""Random drawn loops: certified intervals against eigenvalues of the loop run block by block, which shares no lifting.

    PYTHONPATH=tests python -m stress.drawings 1000 0

looks at 1000 drawings from seed 0 on, along one of their numbers each: on both sides of every end, and at points between.
"""

import sys
from dataclasses import dataclass

import numpy as np
from support.drawn import random_tables

import wavesweep
from wavesweep.analysis.simulation.drawn import Blocks, kinds_of
from wavesweep.diagram.assembly import assembled

SPANS = {"k": (0, 300), "d": (-2, 400), "k0": (0, 3000), "g": (0.05, 2), "m0": (0.01, 3)}
BESIDE, POINTS = 1e-4, 24
NEAR = 1e-7  # of the circle: a point this near to an end says nothing; of 1: an eigenvalue that is drift


@dataclass
class Tally:
    """What was looked at."""

    rows: int = 0
    certified: int = 0
    ends: int = 0
    points: int = 0
    wrong: int = 0


def monodromy(drawn):
    """The map of states and held outputs over a frame, from runs of the blocks on unit states."""
    kinds, sets = kinds_of(drawn, drawn.ticks)
    blocks = Blocks(drawn, (), ())
    n, size = blocks.summed, blocks.width
    steps = []
    for running in sets:
        tick, step = blocks.tick(running), np.zeros((size, size))
        step[tick.rows, tick.columns] = tick.factors
        step[:n, :n] += np.eye(n)
        steps.append(step)
    whole = np.eye(size)
    for kind in kinds:
        whole = steps[kind] @ whole
    return whole


def verdict(spec, path, value):
    """1 if the loop is stable at that value, -1 if it is not, 0 if it is too near to tell."""
    values = dict(spec.values) | {path: float(value)}
    drawing = spec.drawing
    z = np.linalg.eigvals(monodromy(assembled(drawing, {key: v for key, v in values.items() if v is not None})))
    size = np.abs(z)
    # A drift is an eigenvalue of exactly 1; what rounding makes of several is no instability.
    free = np.abs(z - 1) > NEAR
    largest = size[free].max(initial=0.0)
    return 0 if abs(largest - 1) < NEAR else 1 if largest < 1 else -1


def look(seed, tally):
    """One drawing, along one of its numbers."""
    loop = wavesweep.compile(random_tables(seed))
    r = np.random.default_rng(seed + 10**6)
    name = str(r.choice(list(SPANS)))
    low, high = SPANS[name]
    table = loop.stable_intervals(name, (low, high))
    tally.rows, tally.certified = tally.rows + len(table), tally.certified + int(table.certified.sum())
    if not table.certified.all():
        return
    spans = [(row.low, row.high) for row in table.itertuples() if row.intervals]
    pairs = [pair for row in table.itertuples() for pair in ((row.low, row.low_omega), (row.high, row.high_omega))]
    ends = sorted({end for end, omega in pairs if not np.isnan(omega) and low < end < high})  # missing if the range ends it
    step = min([BESIDE * (high - low), *(0.2 * np.diff([low, *ends, high]))])
    points = [end + side * step for end in ends for side in (-1, 1)] + r.uniform(low, high, POINTS).tolist()
    tally.ends, tally.points = tally.ends + len(ends), tally.points + len(points)
    for point in points:
        found, inside = verdict(loop.spec, f"numbers.{name}", point), any(a < point < b for a, b in spans)
        if found and (found > 0) != inside:
            tally.wrong += 1
            print(
                f"seed {seed}: {name} = {point!r} is {'stable' if found > 0 else 'unstable'}, the table says otherwise: {spans}"
            )


def main(count, first):
    """Look at so many drawings, and print the counts."""
    tally = Tally()
    for seed in range(first, first + count):
        look(seed, tally)
    print(tally)
    return tally


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0).wrong > 0)
