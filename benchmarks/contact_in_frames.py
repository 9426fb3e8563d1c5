"""Walls that push and never pull while frames vary: proved, as a share of the linear wall, and refuted.

python benchmarks/contact_in_frames.py [NAME ...]
"""

import sys
import time

import wavesweep
from wavesweep.program.tables.frame import framed
from wavesweep.program.tables.interval_table import intervals

LENGTHS = ([19, 20, 21], [16, 20, 25, 33])
NAMES = ("dc-slow", "pmw", "fig4", "pmw-lm")


def figures(name, lengths, damping):
    """A line of the table: linear, proved through contact, refuted, CPU s of the contact rows."""
    spec = wavesweep.load(
        f"sweeps/for-all/{name}.toml",
        (
            f"for_all.rates.ratio={{values={lengths},varying=true}}",
            "for_all.contact=true",
            f"B_VE={damping}",
            "sweep.K_VE={start=0,stop=5000}",
            *(() if name == "dc-slow" else ("sweep.b=[10]",)),
        ),
    )
    began = time.process_time()
    frame = framed(intervals(spec))
    took = time.process_time() - began
    rows = {word: frame[frame["guarantee"] == word] for word in ("for_all", "contact")}
    linear = rows["for_all"]["high"].max()
    contact = rows["contact"]
    proved = contact["high"].max()
    refuted = contact["fails_from"].min()
    print(
        f"| {name} | {', '.join(map(str, lengths))} | {damping:g} | {linear:.1f} | {proved:.1f} | "
        f"{100 * proved / linear:.0f} % | {refuted:.1f} | {took:.1f} |",
        flush=True,
    )


if __name__ == "__main__":
    for each in sys.argv[1:] or NAMES:
        for some in LENGTHS:
            for B_VE in (0, 1, 5):
                figures(each, some, B_VE)
