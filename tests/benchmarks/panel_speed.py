"""What a slice costs along numbers that are no single gain of a frame, in batches of a hundred with certificate and DataFrame.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/panel_speed.py

Beside each, in turn: eigenvalues at 100 values of the number, which know nothing of what lies between. Medians of 5.
"""

import time
from pathlib import Path

import numpy as np

import wavesweep

RECIPES = Path(__file__).parents[2] / "sweeps" / "recipes"
BANK = {"controller": {"kind": "pmw-lm", "b": 25.0, "Kp": 20.0}}
IMPEDANCES, MASSES = {"b": np.linspace(10, 60, 100)}, {"device.mass": np.linspace(0.1, 0.5, 100)}
LONG = {  # a frame of 1,000 ticks
    "rates": {"tick_hz": 1000},
    "numbers": {"K": 0.5, "m": 0.2, "c": 2.0},
    "block": {
        "device": {"type": "mass", "mass": "m", "damping": "c"},
        "scene": {"type": "hold", "every": 1000},
        "force": {"type": "hold", "every": 1000},
    },
    "wire": {"device.f": "force.y", "scene.u": "device.x", "force.u": "-K*scene.y"},
}
CASES = (
    ("pmw-lm, 9 states", BANK, "b", (5, 200), {"K_VE": np.linspace(100, 3000, 100)}),
    ("pmw-lm, 9 states", BANK, "b", (5, 200), MASSES),
    ("pmw-lm, 9 states", BANK, "Kp", (1, 100), IMPEDANCES),
    ("pmw-lm, 9 states", BANK, "K_LM", (0, 3000), IMPEDANCES),
    ("pmw-lm, 9 states", BANK, "device.mass", (0.05, 1), IMPEDANCES),
    ("pmw-lm, 9 states", BANK, "filters.lp1.cutoff_hz", (2, 60), IMPEDANCES),
    ("pmw-lm at 60 Hz, 50 ticks", BANK | {"rates": {"slow_hz": 60}}, "K_VE", (0, 20000), IMPEDANCES),
    ("teleoperation.toml, 13 states", RECIPES / "teleoperation.toml", "c", (0.1, 10), {"kp": np.linspace(40, 60, 100)}),
    ("policy.toml, 5 states", RECIPES / "policy.toml", "f", (0.1, 60), {"zeta": np.linspace(0.5, 2, 100)}),
    ("two-rate-wall.toml, 4 states", RECIPES / "two-rate-wall.toml", "K", (0, 3000), {"B": np.linspace(1, 10, 100)}),
    ("1,000 ticks, 4 states", LONG, "m", (0.01, 1), {"K": np.linspace(0.1, 2, 100)}),
)


def seconds(work):
    """Wall time of one call."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def main():
    """Print a line per case."""
    print("| loop | along | over | ms a slice | eigenvalues at 100 values (ms) | ratio | certified | intervals |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, source, along, span, axes in CASES:
        loop = wavesweep.compile(source)
        values = np.geomspace(*span, 100) if span[0] > 0 else np.linspace(*span, 101)[1:]

        def exact(loop=loop, along=along, span=span, axes=axes):
            return loop.stable_intervals(along, span, **axes)

        def scan(loop=loop, along=along, values=values, axes=axes):
            return loop.spectral_radius(**axes, **{along: values})

        times = np.array([(seconds(exact), seconds(scan)) for _ in range(6)][1:]) * 1e3 / 100
        (ours, theirs), ratio, table = np.median(times, axis=0), np.median(times[:, 1] / times[:, 0]), exact()
        print(
            f"| {name} | {along} | {', '.join(axes)} | {ours:.2f} | {theirs:.2f} | {ratio:.2f} | "
            f"{table.certified.mean():.0%} | {int((table.intervals > 0).sum())} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
