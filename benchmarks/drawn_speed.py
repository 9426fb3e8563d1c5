"""What a drawing costs: stable K_VE of a loop drawn in the spec against the same loop as a built-in kind, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/drawn_speed.py

The call of the library over wave impedances, over dampings of the wall and over both, certificate and DataFrame included, in
turn; minima of 9. Then a single slice of PD on a mass over a network whose delay has some hundred ticks, along a gain, and
along the mass; minima of 3.
"""

from functools import partial
from pathlib import Path

import numpy as np

import wavesweep
from bench.measuring import seconds
from wavesweep.program.platform_compat import keep_memory

DRAWN = Path(__file__).parents[1] / "sweeps" / "recipes" / "controllers"
KINDS = {"pmw-lm": {"b": 25.0, "Kp": 20.0}, "pmw": {"b": 25.0}}
COUNTS = ((100, 1), (1000, 1), (1, 31), (1, 100), (1, 1000), (31, 31))  # of impedances and dampings
SPAN = (0, 20000)
DELAYS = (20, 50, 100, 200)


def main():
    """Print a line per kind and number of slices."""
    keep_memory()  # as commands do
    print("| kind | b | B | drawn (ms a slice) | built in (ms a slice) | ratio | largest difference of the ends |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for kind, values in KINDS.items():
        drawn = wavesweep.compile(DRAWN / f"{kind}.toml")
        built_in = wavesweep.compile({"controller": {"kind": kind, **values}})
        for impedances, dampings in COUNTS:
            b, B = np.linspace(10, 60, impedances), np.linspace(0.5, 15, dampings)
            both = [{name: values for name, values in (("b", b), (damping, B)) if len(values) > 1} for damping in ("B", "B_VE")]
            sides = (
                partial(drawn.stable_intervals, "K", span=SPAN, **both[0]),
                partial(built_in.stable_intervals, "K_VE", span=SPAN, **both[1]),
            )
            ours, theirs = np.min([[seconds(side) for side in sides] for _ in range(9)], axis=0) * 1e3 / impedances / dampings
            tables = [side() for side in sides]
            assert all(table.certified.all() for table in tables)
            apart = np.abs(tables[0].high / tables[1].high - 1).max()
            print(
                f"| {kind} | {impedances:,} | {dampings:,} | {ours:.4f} | {theirs:.4f} | {ours / theirs:.2f} | {apart:.1e} |",
                flush=True,
            )
    print("| ticks of delay | along K (s) | along B (s) | along m (s) |\n| --- | --- | --- | --- |")
    for ticks in DELAYS:
        loop, times = wavesweep.compile(over_a_network(ticks)), []
        for along, span in (("K", (0, 200)), ("B", (0, 50)), ("m", (0.05, 5))):
            assert loop.stable_intervals(along, span).certified.all()
            times.append(min(seconds(partial(loop.stable_intervals, along, span)) for _ in range(3)))
        print(f"| {ticks} | {' | '.join(f'{time:.2f}' for time in times)} |", flush=True)


def over_a_network(ticks):
    """A mass under PD whose force arrives late."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 10.0, "B": 1.0, "m": 0.5},
        "block": {
            "arm": {"type": "mass", "mass": "m", "damping": 0.2},
            "net": {"type": "delay", "steps": ticks},
        },
        "wire": {"net.u": "K*arm.x + B*arm.v", "arm.f": "-net.y"},
    }


if __name__ == "__main__":
    main()
