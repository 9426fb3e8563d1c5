"""What a drawing costs: stable K_VE of a loop drawn in the spec against the same loop as a built-in kind, in one run.

    OPENBLAS_NUM_THREADS=1 python tests/benchmarks/drawn_speed.py

The call of the library over wave impedances, certificate and DataFrame included, in turn; minima of 9.
"""

import time
from pathlib import Path

import numpy as np

import wavesweep

DRAWN = Path(__file__).parents[2] / "sweeps" / "recipes" / "controllers"
KINDS = {"pmw-lm": {"b": 25.0, "Kp": 20.0}, "pmw": {"b": 25.0}}
COUNTS = (100, 1000)
SPAN = (0, 20000)


def seconds(work):
    """Wall time of one call."""
    started = time.perf_counter()
    work()
    return time.perf_counter() - started


def main():
    """Print a line per kind and number of slices."""
    print("| kind | slices | drawn (ms a slice) | built in (ms a slice) | ratio | largest difference of the ends |")
    print("| --- | --- | --- | --- | --- | --- |")
    for kind, values in KINDS.items():
        drawn = wavesweep.compile(DRAWN / f"{kind}.toml")
        built_in = wavesweep.compile({"controller": {"kind": kind, **values}})
        for count in COUNTS:
            b = np.linspace(10, 60, count)
            sides = (
                lambda b=b, drawn=drawn: drawn.stable_intervals("K", span=SPAN, b=b),
                lambda b=b, built_in=built_in: built_in.stable_intervals("K_VE", span=SPAN, b=b),
            )
            ours, theirs = np.min([[seconds(side) for side in sides] for _ in range(9)], axis=0) * 1e3 / count
            tables = [side() for side in sides]
            assert all(table.certified.all() for table in tables)
            apart = np.abs(tables[0].high / tables[1].high - 1).max()
            print(f"| {kind} | {count:,} | {ours:.3f} | {theirs:.3f} | {ours / theirs:.2f} | {apart:.1e} |", flush=True)


if __name__ == "__main__":
    main()
