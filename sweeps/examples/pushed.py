"""Make `pushed.csv`: half a second of a device with dry friction, pushed by a chirp and read by an encoder of 0.02 mm.

python sweeps/examples/pushed.py > sweeps/examples/pushed.csv
"""

import math

import wavesweep

RATE, TICKS = 1000.0, 1000  # Hz, samples
DEVICE = {"mass": 0.08, "damping": 0.6}  # kg, N*s/m
FRICTION, RESOLUTION = 0.15, 2e-5  # N, m
LATE = 2  # ticks between the command and the motors


def rows():
    """Yield time (s), force (N) and position (m) of each sample, as texts."""
    force = [0.8 * math.sin(2 * math.pi * (2.0 + 6.0 * k / RATE) * k / RATE) for k in range(TICKS)]
    late = [0.0] * LATE + force[:-LATE]
    rates = {"rates": {"fast_hz": RATE}, "environment": {"K_VE": 0.0, "B_VE": 0.0}}
    loop = wavesweep.compile({"controller": {"kind": "dc"}, "device": DEVICE, **rates})
    found = loop.simulate(late, friction=FRICTION, resolution=RESOLUTION)["x_hat"]
    yield "time,force,position"
    yield from (f"{k / RATE:.3f},{force[k]:.5f},{found[k]:.5f}" for k in range(TICKS))


if __name__ == "__main__":
    print("\n".join(rows()))  # noqa: T201 - the file
