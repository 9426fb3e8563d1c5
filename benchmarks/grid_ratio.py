"""All stable K_VE for 100 values of B_VE against a 100 x 100 grid of eigenvalues of the same compiled loop, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/grid_ratio.py

The call of the library, certificate and DataFrame included, and numpy's batched eigenvalues, in turn; medians of 15.
"""

from pathlib import Path

import numpy as np

import wavesweep
from bench.measuring import seconds
from wavesweep.core.analyses.open_loops import wall_cut
from wavesweep.core.monodromy.cut import close

SPECS = Path(__file__).parents[1] / "sweeps" / "paper"
DAMPING, STIFFNESS = np.linspace(0, 15, 100), np.linspace(0, 20000, 101)[1:]


def main():
    """Print a line per spec."""
    for name in ("fig4", "fig4-b25", "fig6", "fig5-explicit"):
        loop = wavesweep.compile(SPECS / f"{name}.toml")
        cut = wall_cut(loop.spec.values)

        def exact(loop=loop):
            return loop.stable_intervals(span=(0, 20000), B_VE=DAMPING)

        def grid(cut=cut):
            return np.abs(1 + np.linalg.eigvals(close(cut.at((None, None)), STIFFNESS[:, None], DAMPING))).max(-1) < 1

        pairs = np.array([(seconds(exact), seconds(grid)) for _ in range(16)][1:])
        ours, theirs = np.median(pairs, axis=0)
        ratio, table = np.median(pairs[:, 1] / pairs[:, 0]), exact()
        print(
            f"{name} ({loop.spec.values['controller.kind']}), {cut.order} states: {1e3 * ours:.2f} ms, "
            f"{int(table.certified.sum())} of {len(table)} rows certified; grid {1e3 * theirs:.1f} ms; "
            f"{ratio:.1f} times as fast"
        )


if __name__ == "__main__":
    main()
