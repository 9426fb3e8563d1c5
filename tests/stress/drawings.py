"""Random drawn loops: certified intervals against eigenvalues of the loop run block by block, which shares no lifting.

    PYTHONPATH=tests python -m stress.drawings 1000 0

looks at 1000 drawings from seed 0 on, along one of their numbers each: on both sides of every end, and at points between. Then
at as many with a held feedback, along one of two gains in the same wire, at several values of the other one; and at as many
along the rate of the tick, and along a number at several rates; and at as many with a bound on every mode.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from support.drawn import random_feedback, random_tables

import wavesweep
from wavesweep.program.sweep.grid import loops_of
from wavesweep.simulation.running_blocks import DEPTH, FORCE, SPEED, loop_of
from wavesweep.simulation.tick_sums import TickSums, keep, run

SPANS = {"k": (0, 300), "d": (-2, 400), "k0": (0, 3000), "g": (0.05, 2), "m0": (0.01, 3), "rates.tick_hz": (700.0, 5000.0)}
NUMBERS = [name for name in SPANS if "." not in name]
BESIDE, POINTS = 1e-4, 24
NEAR = 1e-7  # of the circle: a point this near to an end says nothing; of 1: an eigenvalue that may be drift
ROUNDED = 1e-12  # of 1: an eigenvalue that is drift but for rounding


@dataclass
class Tally:
    """What was looked at."""

    rows: int = 0
    certified: int = 0
    ends: int = 0
    points: int = 0
    wrong: int = 0


def monodromy(drawing, values):
    """The map of states and held outputs over a frame, from a run of the blocks on unit numbers."""
    ticks = TickSums(replace(loop_of(drawing, values), inputs=(), hand=""))
    programs = [ticks.program(k, frozenset(), touching=True) for k in range(ticks.loop.frame)]
    kept = [place for name, place in ticks.places.items() if name.partition(".")[0] in {part.name for part in ticks.blocks}]
    z = [np.zeros(len(kept)) for _ in ticks.places]
    for place, unit in zip(kept, np.eye(len(kept)), strict=True):
        z[place] = unit
    for program in programs:
        run(program.first, z, {})
        if program.wall:
            depth, speed, force = (ticks.place(name) for name in (DEPTH, SPEED, FORCE))
            z[force] = program.wall.force(z[depth], z[speed])[0]
            run(program.second, z, {})
        keep(program, z)
    return np.array([np.broadcast_to(z[place], len(kept)) for place in kept])


def verdict(spec, changes, radius=1.0):
    """1 if every mode of the loop is within the radius with these numbers, -1 if not, 0 if one is too near to tell."""
    values = dict(spec.values) | {path: float(value) for path, value in changes.items()}
    z = np.linalg.eigvals(monodromy(loops_of(spec, values).drawing, {key: v for key, v in values.items() if v is not None}))
    size = np.abs(z)
    # A drift is an eigenvalue of exactly 1; what rounding makes of several is no instability, nor what creeps a proof of it.
    distance = np.abs(z - 1)
    largest = size[distance > NEAR].max(initial=0.0)
    creeps = ((distance > ROUNDED) & (distance <= NEAR)).any()
    return 0 if abs(largest - radius) < NEAR or (creeps and largest < radius) else 1 if largest < radius else -1


def look(seed, tally):
    """One drawing, along one of its numbers."""
    loop = wavesweep.compile(random_tables(seed))
    r = np.random.default_rng(seed + 10**6)
    name = str(r.choice(NUMBERS))
    _compare(loop, name, {}, loop.stable_intervals(name, SPANS[name]), r, tally)


def look_beside(seed, tally):
    """One drawing, along a gain, at several values of another one in the same wire."""
    loop = wavesweep.compile(random_feedback(seed))
    r = np.random.default_rng(seed + 10**6)
    name, other = r.permutation(["k", "d"]).tolist()
    values = [0.0, *(r.uniform(0.1, 1, 3) * SPANS[other][1] * [0.01, 0.1, -0.01])]
    table = loop.stable_intervals(name, SPANS[name], **{other: values})
    for value in values:
        _compare(loop, name, {f"numbers.{other}": float(value)}, table[table[other] == value], r, tally)


def look_at_rates(seed, tally):
    """One drawing, along the rate of its tick, and along a number at three rates."""
    loop = wavesweep.compile(random_tables(seed))
    r = np.random.default_rng(seed + 10**6)
    rate, name = "rates.tick_hz", str(r.choice(NUMBERS))
    _compare(loop, rate, {}, loop.stable_intervals(rate, SPANS[rate]), r, tally)
    values = r.uniform(*SPANS[rate], 3).tolist()
    table = loop.stable_intervals(name, SPANS[name], **{rate: values})
    for value in values:
        _compare(loop, name, {rate: value}, table[table[rate] == value], r, tally)


def look_within(seed, tally):
    """Two drawings with a bound on every mode: along a number or the rate, and along a gain beside another in the same wire."""
    r = np.random.default_rng(seed + 10**6)
    for tables, names in ((random_tables(seed), [*NUMBERS, "rates.tick_hz"]), (random_feedback(seed), ["k", "d"])):
        loop, (name, other) = wavesweep.compile(tables), r.permutation(names)[:2].tolist()
        radius, others = float(1 - 10 ** r.uniform(-3, -0.5)), {other: float(r.uniform(0, 0.1)) * SPANS[other][1]}
        others = others if len(names) == 2 and r.random() < 0.7 else {other: 0.0} if len(names) == 2 else {}
        require = {"radius": radius}
        if r.random() < 0.5 and "." not in name:
            frame = loop_of(loop.spec.drawing, dict(loop.spec.values)).frame / loop.spec.tick_hz
            require = {"settling": frame * np.log(0.02) / np.log(radius)}
        table = loop.stable_intervals(name, SPANS[name], require=require, **others)
        paths = {loop.spec.names.find(each).path: value for each, value in others.items()}
        _compare(loop, name, paths, table, r, tally, radius)


def _compare(loop, name, others, table, r, tally, radius=1.0):
    """Count what is wrong of the intervals of one slice, in which these numbers have other values."""
    low, high = SPANS[name]
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
        found, inside = (
            verdict(loop.spec, {loop.spec.names.find(name).path: point, **others}, radius),
            any(a < point < b for a, b in spans),
        )
        if found and (found > 0) != inside:
            tally.wrong += 1
            says = f"within {radius}" if found > 0 else f"not within {radius}"
            print(f"{loop.spec.tables()}: {name} = {point!r}, {others} is {says}: the table says otherwise: {spans}")


def main(count, first, looking=look):
    """Look at so many drawings, and print the counts."""
    tally = Tally()
    for seed in range(first, first + count):
        looking(seed, tally)
    print(tally)
    return tally


if __name__ == "__main__":
    count, first = int(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 0
    sys.exit(sum(main(count, first, looking).wrong for looking in (look, look_beside, look_at_rates, look_within)) > 0)
