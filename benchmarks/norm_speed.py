"""What an H-infinity norm over a long frame costs: proved by stored energy, and by eigenvalues at each angle, in one run.

    OPENBLAS_NUM_THREADS=1 python benchmarks/norm_speed.py [--ticks 300]

Two masses on a spring that is read once in a frame, from a force to a position, at shares of the largest stable gain; in turn,
processor time.
"""

import argparse

from panel_speed import chain

from bench.measuring import QUICK, interleaved
from wavesweep.engine import loop_from_drawing
from wavesweep.engine._energy import norms
from wavesweep.program.platform_compat import keep_memory

SHARES = (0.01, 0.1, 0.5, 0.9, 0.99)


def main():
    """Print a line per gain."""
    keep_memory()  # as commands do
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=300, help="of the frame; the eigenvalues of 1000 take half a minute")
    ticks = parser.parse_args().ticks
    tables = chain(2, ticks)
    tables["wire"]["m0.f"] += " + F"
    loop = loop_from_drawing(tables | {"ports": {"inputs": {"F": "F"}, "outputs": {"y": "m0.x"}}})
    limit = float(loop.stable_intervals("K", (0.0, 1000.0)).high[0])
    few = norms.MOST_DENSE_SIGNALS
    loop.hinf_norm("F", "y", {"K": limit / 2})  # imports what the first call needs
    print("| share of the limit | stored energy (s) | eigenvalues (s) | ratio | certified | difference |")
    print("| --- | --- | --- | --- | --- | --- |")
    for share in SHARES:
        found = {}

        def norm(many, share=share, found=found):
            norms.MOST_DENSE_SIGNALS = many
            found[many] = loop.hinf_norm("F", "y", {"K": share * limit})

        pair = interleaved(lambda: norm(few), lambda: norm(ticks), QUICK)
        difference = abs(float(found[few].value) / float(found[ticks].value) - 1)
        print(
            f"| {share} | {pair.first:.3f} | {pair.second:.2f} | {pair.ratio:.3f} | "
            f"{bool(found[few].certified)} | {difference:.0e} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
