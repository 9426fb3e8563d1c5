"""Make `bench-walls.csv` and `bench-response.csv`: a device as it stands on a bench, measured by runs of `simulate`.

It is a little heavier and rubs less than its data sheet says, and its force comes two ticks late. For each damping, walls are
tried by halving, from a push of 1 N: those at which the motion has grown are not stable. The response is that to sines.

python sweeps/examples/bench.py sweeps/examples
"""

import sys
from pathlib import Path

import numpy as np

import wavesweep

DEVICE = {"mass": 0.09, "damping": 1.1, "velocity": "difference"}  # kg, N*s/m
LATE, RATIO = 2, 4  # fast ticks until the wall's force is there; in a frame of the wall
DAMPINGS, HIGHEST, TRIES = (0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0), 8000.0, 6  # N*s/m, N/m
PUSH, RUN = 100, 3000  # ticks of 1 ms
FREQUENCIES = np.geomspace(1.0, 60.0, 14).round(1).tolist()  # Hz


def loop(**simulate):
    """The tables of a spec of the true device; simulate: its run."""
    return {
        "rates": {"fast_hz": 1000.0, "ratio": RATIO},
        "device": DEVICE,
        "environment": {"K_VE": 400.0, "B_VE": 1.0, "delay": LATE},
        "controller": {"kind": "dc-slow"},
        "simulate": simulate,
    }


def holds(stiffness, damping):
    """Whether a wall is stable: the motion after a push is less in the last third of a run than in the second."""
    spec = wavesweep.load(loop(), [f"K_VE={stiffness!r}", f"B_VE={damping!r}"])
    force = np.where(np.arange(RUN) < PUSH, 1.0, 0.0)
    speed = np.abs(wavesweep.compile(spec).simulate(force)["v"].to_numpy())
    return len(speed) == RUN and speed[2 * RUN // 3 :].max() < speed[RUN // 3 : 2 * RUN // 3].max()


def walls():
    """Yield the rows of the walls that were tried, as texts."""
    yield "B_VE,K_VE,stable"
    for damping in DAMPINGS:
        low, high = 0.0, HIGHEST
        for _ in range(TRIES):
            stiffness = round((low + high) / 2)
            stable = holds(float(stiffness), damping)
            yield f"{damping:g},{stiffness},{int(stable)}"
            low, high = (stiffness, high) if stable else (low, stiffness)


def response():
    """Yield the rows of the response, as texts."""
    yield "frequency_hz,admittance_abs,admittance_deg"
    _, found = wavesweep.simulate(loop(input="stepped-sine", frequency_hz=FREQUENCIES))
    for row in found.itertuples():
        yield f"{row.frequency_hz:g},{row.admittance_abs:.4g},{row.admittance_deg:.2f}"


if __name__ == "__main__":
    for name, rows in (("bench-walls.csv", walls()), ("bench-response.csv", response())):
        Path(sys.argv[1], name).write_text("\n".join(rows) + "\n", encoding="utf-8")
