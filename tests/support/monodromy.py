"""A drawn loop run block by block, which shares no lifting with the engine: the eigenvalues of its frame."""

from dataclasses import replace

import numpy as np

from wavesweep.program.sweep.grid import loops_of
from wavesweep.simulation.running_blocks import DEPTH, FORCE, SPEED, loop_of
from wavesweep.simulation.tick_sums import TickSums, keep, run

SPANS = {"k": (0, 300), "d": (-2, 400), "k0": (0, 3000), "g": (0.05, 2), "m0": (0.01, 3), "rates.tick_hz": (700.0, 5000.0)}
NUMBERS = [name for name in SPANS if "." not in name]
NEAR = 1e-7  # of the circle: a point this near to an end says nothing; of 1: an eigenvalue that may be drift
ROUNDED = 1e-12  # of 1: an eigenvalue that is drift but for rounding


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
