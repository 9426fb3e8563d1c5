"""How time and memory grow with slices, states, ticks of a frame and workers: a figure, and the numbers in it.

    OPENBLAS_NUM_THREADS=1 python benchmarks/how_cost_grows.py [--most 1000000] [--out benchmarks/how-cost-grows.png]

Times are of the processor, all processes together, the least of three up to a second; beside them that of D-decomposition by
hand at 180 angles. --most: slices of the largest run.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from panel_speed import chain

import wavesweep
from bench.problems import SPECS, Bundle, load_paper
from bench.rivals import _crossings, _labelled, decomposed
from wavesweep.engine.drawing.drawing import path_of
from wavesweep.engine.monodromy.cut import with_batch
from wavesweep.engine.search.open_loops import exact_cut
from wavesweep.program.sweep.grid import own_loop

STUDY = SPECS.parent / "design-study.toml"
ANGLES = np.pi * (np.arange(180) + 0.5) / 180
LOOPS = 20  # of a batch over states, or ticks
MASS = np.linspace(0.1, 0.3, LOOPS)  # of the first in the chain, kg
SLICES = (100, 1000, 10_000, 100_000, 1_000_000, 10_000_000)
MASSES, TICKS = (1, 2, 4, 8, 12, 16, 20, 25, 29), (1, 10, 100, 1000, 10_000, 100_000)
AT_HAND = 1000  # slices, up to which the rival is asked: its arrays take 0.2 MB a slice


def main():
    """Measure, print a table, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--most", type=int, default=1_000_000)
    parser.add_argument("--out", default=str(Path(__file__).with_name("how-cost-grows.png")))
    given = parser.parse_args()
    runs = [(jobs, n, *command(n, jobs)) for jobs in (1, 2) for n in SLICES if n <= given.most]
    slices = [[(n, seconds) for jobs, n, seconds, _ in runs if jobs == one] for one in (1, 2)]
    slices.append([(n, least(lambda n=n: decomposed(study(n), 180))) for n in SLICES if n <= AT_HAND])
    states = [[(2 * m + 1, each) for m in MASSES] for each in (ours, rival)]
    states = [[(n, of(chain(n // 2, 20))) for n, of in line] for line in states]
    ticks = [[(t, of(chain(2, t))) for t in TICKS] for of in (ours, rival)]
    memory = [[(n, mb) for jobs, n, _, mb in runs if jobs == one] for one in (1, 2)]
    ways, hand = ["zwidth with files, one process", "two workers, both together"], "D-decomposition, 180 angles, no files"
    panels = (
        ("slices", "processor time (s)", slices, [*ways, hand]),
        ("states", f"processor time (s), {LOOPS} loops", states, ["this tool", hand]),
        ("ticks of a frame", f"processor time (s), {LOOPS} loops", ticks, ["this tool", hand]),
        ("slices", "memory of the largest process (MB)", memory, ways),
    )
    for panel in panels:
        for name, line in zip(panel[3], panel[2], strict=True):
            print(f"{panel[0]}, {panel[1]}, {name}: " + ", ".join(f"{size:g}: {value:.3g}" for size, value in line))
    draw(panels, given.out)


def study(slices):
    """The five axes of the design study, 16 values of B_VE a loop, with so many slices or a few more."""
    return load_paper("../design-study", axes(slices))


def axes(slices):
    """Its settings: as many values of b, with 10 of K_LM and of Kp once there are enough."""
    loops = -(-slices // 16)
    few = 10 if loops >= 1000 else 1
    b = -(-loops // few**2)
    return (
        f"sweep.K_LM={{ start = 500, stop = 2000, num = {few} }}" if few > 1 else "sweep.K_LM=[500]",
        f"sweep.Kp={{ start = 5, stop = 49, num = {few} }}" if few > 1 else "sweep.Kp=[20]",
        f"sweep.b={{ start = 5, stop = 103, num = {b} }}",
    )


def command(slices, jobs):
    """Processor seconds of `zwidth` with its files and without a figure, and the peak memory of its largest process in MB."""
    settings = [word for axis in axes(slices) for word in ("--set", axis)]
    with tempfile.TemporaryDirectory() as out:
        call = ["zwidth", str(STUDY), "--quiet", "--no-plot", "--jobs", str(jobs), "--out", out, *settings]
        child = [sys.executable, __file__, "--child", *call]
        return tuple(map(float, subprocess.run(child, check=True, capture_output=True, text=True).stdout.split()))


def child(call):
    """Run a command in a process of its own, and print what it took."""
    subprocess.run([sys.executable, "-m", "wavesweep", *call], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)


def plain(tables):
    """A chain without the numbers that it does not read: that of one mass has no spring."""
    numbers = {name: value for name, value in tables["numbers"].items() if name != "k" or "m1" in tables["block"]}
    return tables | {"numbers": numbers}


def ours(tables):
    """Stable intervals of all loops of a batch, compiled anew."""
    return least(lambda: wavesweep.compile(plain(tables)).stable_intervals("K", (0, 1000), m=MASS))


def rival(tables):
    """The same by D-decomposition, from the same compiled loops."""
    loop = own_loop(wavesweep.compile(plain(tables)).spec)

    def solve():
        cut = with_batch(exact_cut(loop.changed({path_of("m"): MASS}), "K"), LOOPS)
        part = Bundle(np.arange(LOOPS), cut, np.arange(LOOPS), np.zeros(LOOPS))
        return _labelled(part, 1000.0, *_crossings(part, ANGLES))

    return least(solve)


def least(call):
    """Processor seconds of a call, the least of three unless it takes long."""
    times = []
    while len(times) < 4 and sum(times) < 1:
        started = time.process_time()
        call()
        times.append(time.process_time() - started)
    return min(times)


def draw(panels, path):
    """Write the figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(10, 7), layout="constrained")
    FigureCanvasAgg(figure)
    for place, (across, up, lines, names) in zip(figure.subplots(2, 2).flat, panels, strict=True):
        for name, line, style in zip(names, lines, ("o-", "s-", "^--") if len(lines) > 2 else ("o-", "s--"), strict=True):
            color = "0.4" if "D-decomposition" in name else "C0" if style == "o-" else "C1"
            place.loglog(*zip(*line, strict=True), style, color=color, label=name, markersize=4)
        low, high = place.get_ylim()
        place.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))
        place.set(xlabel=across, ylabel=up)
        if across == "states":
            place.set_xticks([3, 5, 10, 20, 40, 60], ["3", "5", "10", "20", "40", "60"])
        for axis in (place.xaxis, place.yaxis):
            axis.set_minor_formatter(NullFormatter())
        place.grid(which="major", alpha=0.3)
        place.legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    child(sys.argv[2:]) if sys.argv[1:2] == ["--child"] else main()
