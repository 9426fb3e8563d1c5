"""All stable K_VE for 100 values of B_VE against a 100 x 100 grid of eigenvalues of the same compiled loop, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/grid_ratio.py [--least]

The call of the library, certificate and DataFrame included, and numpy's batched eigenvalues, in turn; medians of 15, in
processor time. With --least the exit code is 1 if a ratio is below a third of what it was when these lines were written.
"""

import sys
from pathlib import Path

import numpy as np

import wavesweep
from bench.measuring import Patience, interleaved
from wavesweep.haptics.controller_page import wall_cut

PAPER = Path(__file__).parents[1] / "sweeps" / "paper"
CASES = {  # loop, and the least ratio
    "pmw": ({"controller": {"kind": "pmw"}}, 1.6),
    "dc-slow": ({"controller": {"kind": "dc-slow"}}, 0.5),
    "fig4": (PAPER / "fig4.toml", 2.5),
    "pmw-lm": (PAPER / "fig5-explicit.toml", 3.3),
}
DAMPING, STIFFNESS = np.linspace(0, 15, 100), np.linspace(0, 20000, 101)[1:]


def main() -> int:
    """Print a line per loop."""
    slow = []
    for name, (source, least) in CASES.items():
        loop = wavesweep.compile(source)
        cut = wall_cut(loop.spec.values)

        def exact(loop=loop):
            return loop.stable_intervals(span=(0, 20000), B_VE=DAMPING)

        def grid(cut=cut):
            return np.abs(1 + np.linalg.eigvals(cut.at((None, None)).closed(STIFFNESS[:, None], DAMPING))).max(-1) < 1

        table, _ = exact(), grid()
        pair = interleaved(grid, exact, Patience(0.0, 15, 15))
        certified = f"{int(table.certified.sum())} of {len(table)} rows certified"
        print(
            f"{name}, {cut.order} states: {1e3 * pair.second:.2f} ms, {certified}; "
            f"grid {1e3 * pair.first:.1f} ms; {pair.ratio:.1f} times as fast (at least {least})"
        )
        slow += [name] * (pair.ratio < least)
    return int(bool(slow) and "--least" in sys.argv)


if __name__ == "__main__":
    sys.exit(main())
