"""What a loop costs along each axis that it grows on, on both sides of the places where another method takes over: one page.

    OPENBLAS_NUM_THREADS=1 python benchmarks/cliffs.py [--most 100000] [--out benchmarks/cliffs.png]
    OPENBLAS_NUM_THREADS=1 python benchmarks/cliffs.py --least

Rates that do not divide, states, ticks of a frame, ticks of delay, slices, and numbers in a box. Times are of the processor,
all processes together, the least of three up to a second; a cross is a size at which not every row is certified. Beside states
and ticks that of D-decomposition by hand at 180 angles. --most: slices of the largest run. --least: no figure, eight ratios of
two sizes alone; the exit code is 1 if one is above twice of what it was when these lines were written.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from panel_speed import chain

import wavesweep
from bench.problems import SPECS, Bundle
from bench.rivals import _crossings, _labelled
from wavesweep.engine._drawing.drawing import path_of
from wavesweep.engine._search.open_loops import open_loops
from wavesweep.engine.loop_sources import loop_from_drawing
from wavesweep.program.sweep.grid import own_loop

STUDY = SPECS.parent / "design-study.toml"
ANGLES = np.pi * (np.arange(180) + 0.5) / 180
LOOPS = 20  # of a batch over states, or ticks
MASS = np.linspace(0.1, 0.3, LOOPS)  # of the first in the chain, kg
DAMPING = np.linspace(0, 20, 41)
SLOW_HZ = (20, 25, 40, 45, 50, 55, 60, 65, 70, 72, 75, 80, 90, 100)
STATES = (3, 5, 9, 13, 17, 19, 21, 25, 33, 41, 51, 59, 67, 85, 101, 121)
TICKS = (1, 10, 100, 200, 300, 600, 1000, 2000, 5000, 10_000, 100_000)
NORM_TICKS = (10, 30, 60, 70, 100, 200, 300, 600, 1000)
DELAYS = (5, 20, 40, 60, 70, 100, 200, 400, 700, 1000)
TWO_DELAYS = (10, 20, 40, 70, 100, 200)
SLICES = (100, 1000, 5000, 10_000, 100_000, 1_000_000)
MASS_AND_HAND = {"device.mass": {"start": 0.08, "stop": 0.125}, "operator.stiffness": {"start": 0, "stop": 1000}}
OF_SPRING = {"m": {"start": 0.18, "stop": 0.22}, "c": {"start": 1.8, "stop": 2.2}, "k": {"start": 90, "stop": 110}}
MOST_STATES_BY_HAND = 85


class Cost(NamedTuple):
    """Processor seconds, and whether every row is certified."""

    seconds: float
    certified: bool


class Line(NamedTuple):
    """What is measured over sizes: a name, the sizes, what it costs at one of them, and what one call is."""

    name: str
    sizes: tuple[int, ...]
    cost: Callable[[int], Cost]


def least(call: Callable[[], Any]) -> tuple[float, Any]:
    """Processor seconds of a call, the least of three unless it takes long, and what it gives."""
    times, result = [], None
    while len(times) < 4 and sum(times) < 1:
        started = time.process_time()
        result = call()
        times.append(time.process_time() - started)
    return min(times), result


def of_table(call) -> Cost:
    """The cost of a call that gives a table."""
    seconds, table = least(call)
    return Cost(seconds, bool(table.certified.all()))


def rates(slow_hz: int) -> Cost:
    """The paper's loop with so many runs of the environment a second, and 1000 of the device."""
    tables = {"controller": {"kind": "pmw"}, "rates": {"slow_hz": slow_hz}}
    return of_table(lambda: wavesweep.compile(tables).stable_intervals("K_VE", (0, 20000), B_VE=DAMPING))


def plain(tables: dict) -> dict:
    """A chain without the numbers that it does not read: that of one mass has no spring."""
    numbers = {name: value for name, value in tables["numbers"].items() if name != "k" or "m1" in tables["block"]}
    return tables | {"numbers": numbers}


def filtered(tables: dict) -> dict:
    """A chain of which a filter of 2 ms is read, which forgets all within a frame of 20 ms."""
    fast = {"filter": {"type": "tf", "num": [1.0], "den": [0.002, 1.0]}}
    wires = {"filter.u": "m0.x", "h.u": "filter.y"}
    return tables | {"block": tables["block"] | fast, "wire": tables["wire"] | wires}


def chained(tables: dict) -> Cost:
    """Stable intervals of all loops of a batch, compiled anew."""
    return of_table(lambda: wavesweep.compile(plain(tables)).stable_intervals("K", (0, 1000), m=MASS))


def by_hand(tables: dict) -> Cost:
    """The same by D-decomposition, from the same compiled loops."""
    loop = own_loop(wavesweep.compile(plain(tables)).spec)

    def solve():
        cut = open_loops(loop.changed({path_of("m"): MASS}), "K").cut.as_batch(LOOPS)
        part = Bundle(np.arange(LOOPS), cut, np.arange(LOOPS), np.zeros(LOOPS))
        return _labelled(part, 1000.0, *_crossings(part, ANGLES))

    return Cost(least(solve)[0], certified=True)


def norm(ticks: int) -> Cost:
    """The H-infinity norm of two masses over a frame, from a force to a position."""
    tables = chain(2, ticks)
    tables["numbers"] |= {"K": 0.2}
    tables["wire"] |= {"m0.f": tables["wire"]["m0.f"] + " + F"}
    loop = loop_from_drawing(tables | {"ports": {"inputs": {"F": "F"}, "outputs": {"y": "m0.x"}}})
    seconds, gain = least(lambda: loop.hinf_norm("F", "y"))
    return Cost(seconds, bool(gain.certified))


def late(delay: int, further: int = 0) -> dict:
    """A mass on a spring that is read late, and on another one that is read later still."""
    blocks = {"mass": {"type": "mass", "mass": 0.2, "damping": "c"}, "d": {"type": "delay", "steps": delay}}
    wires = {"d.u": "mass.x", "mass.f": "-K*d.y"}
    if further:
        blocks |= {"e": {"type": "delay", "steps": further}}
        wires |= {"e.u": "d.y", "mass.f": "-K*d.y - 0.5*e.y"}
    return {"rates": {"tick_hz": 1000}, "numbers": {"K": 1.0, "c": 2.0}, "block": blocks, "wire": wires}


def one_delay(ticks: int) -> Cost:
    """Along the spring behind one delay, which is one gain of the frame."""
    return of_table(lambda: wavesweep.compile(late(ticks)).stable_intervals("K", (0, 100)))


def delay_on_itself(ticks: int) -> Cost:
    """Along the spring, beside a damping that is as late and no number of the wire: the ticks are states."""
    tables = late(ticks)
    tables["block"]["e"] = tables["block"]["d"]
    tables["wire"] |= {"e.u": "mass.v", "mass.f": "-K*d.y - 0.1*e.y"}
    return of_table(lambda: wavesweep.compile(tables).stable_intervals("K", (0, 100)))


def two_delays(ticks: int) -> Cost:
    """Along the damping, which is no gain, beside two delays, the second of two thirds of the ticks."""
    return of_table(lambda: wavesweep.compile(late(ticks, 2 * ticks // 3)).stable_intervals("c", (0.1, 10)))


def slices(count: int, jobs: int = 1) -> Cost:
    """`zwidth` of the design study with its files and without a figure."""
    settings = [word for axis in axes(count) for word in ("--set", axis)]
    with tempfile.TemporaryDirectory() as out:
        call = ["zwidth", str(STUDY), "--quiet", "--no-plot", "--jobs", str(jobs), "--out", out, *settings]
        done = subprocess.run([sys.executable, __file__, "--child", *call], check=True, capture_output=True, text=True)
    return Cost(float(done.stdout), certified=True)


def child(call: list[str]) -> None:
    """Run a command in a process of its own, and print what it and its workers took."""
    subprocess.run([sys.executable, "-m", "wavesweep", *call], check=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(used.ru_utime + used.ru_stime)


def axes(count: int) -> tuple[str, ...]:
    """Settings of so many slices or a few more: 16 values of B_VE a loop, and 10 of K_LM and of Kp once there are enough."""
    loops = -(-count // 16)
    few = 10 if loops >= 1000 else 1
    b = -(-loops // few**2)
    return (
        f"sweep.K_LM={{ start = 500, stop = 2000, num = {few} }}" if few > 1 else "sweep.K_LM=[500]",
        f"sweep.Kp={{ start = 5, stop = 49, num = {few} }}" if few > 1 else "sweep.Kp=[20]",
        f"sweep.b={{ start = 5, stop = 103, num = {b} }}",
    )


FIG4 = {
    "controller": {"kind": "pmw", "b": 10.0},
    "environment": {"integration": "explicit", "delay": 1, "B_VE": 1.0},
    "device": {"velocity": "difference"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}},
}
SPRING = {
    "rates": {"tick_hz": 100},
    "numbers": {"K": 1.0, "m": 0.2, "c": 2.0, "k": 100.0},
    "block": {"mass": {"type": "mass", "mass": "m", "damping": "c"}, "h": {"type": "hold", "every": 2}},
    "wire": {"h.u": "mass.x", "mass.f": "-k*mass.x - K*h.y"},
    "sweep": {"K": {"start": 0, "stop": 200}},
}


def box(tables: dict, along: str, members: dict) -> Cost:
    """The row for all values of the numbers of a box."""
    from wavesweep.program.spec import load
    from wavesweep.program.tables.interval_table import intervals

    spec = load(tables | {"for_all": members})
    seconds, table = least(lambda: intervals(spec, along=along, jobs=1).columns)
    return Cost(seconds, bool(np.all(table["settled"])))


def some_of(members: dict, count: int) -> dict:
    """The first members."""
    return dict([*members.items()][:count])


def panels(most: int) -> dict[str, tuple[str, list[Line]]]:
    """The panels of the figure: what grows, what a time is of, and the lines."""
    hand = "D-decomposition, 180 angles"
    counts = tuple(count for count in SLICES if count <= most)
    few = tuple(size for size in STATES if size <= MOST_STATES_BY_HAND)
    return {
        "runs of the environment (1/s), 1000 of the device": (
            f"{DAMPING.size} slices",
            [Line("pmw along K_VE", SLOW_HZ, rates)],
        ),
        "states": (
            f"{LOOPS} loops along one gain",
            [
                Line("this tool", STATES, lambda n: chained(chain(n // 2, 20))),
                Line("with a filter of 2 ms", STATES, lambda n: chained(filtered(chain(n // 2, 20)))),
                Line(hand, few, lambda n: by_hand(chain(n // 2, 20))),
            ],
        ),
        "ticks of a frame": (
            f"{LOOPS} loops, or one norm",
            [
                Line("along one gain", TICKS, lambda t: chained(chain(2, t))),
                Line(hand, TICKS, lambda t: by_hand(chain(2, t))),
                Line("H-infinity norm", NORM_TICKS, norm),
            ],
        ),
        "ticks of delay": (
            "one loop",
            [Line("along one gain", DELAYS, one_delay), Line("two delays, any number", TWO_DELAYS, two_delays)],
        ),
        "slices": (
            "zwidth with files",
            [Line("one process", counts, slices), Line("two workers together", counts, lambda n: slices(n, 2))],
        ),
        "numbers in a box": (
            "one row for all",
            [
                Line("a mass on a spring", (1, 2, 3), lambda n: box(SPRING, "K", some_of(OF_SPRING, n))),
                Line("the paper's Figure 4", (1, 2), lambda n: box(FIG4, "K_VE", some_of(MASS_AND_HAND, n))),
            ],
        ),
    }


class Ratio(NamedTuple):
    """A ratio of two costs, and what it was."""

    name: str
    upper: Callable[[], Cost]
    lower: Callable[[], Cost]
    was: float


RATIOS = (
    Ratio("60 Hz beside 50 Hz", lambda: rates(60), lambda: rates(50), 25.0),
    Ratio("25 states beside D-decomposition", lambda: chained(chain(12, 20)), lambda: by_hand(chain(12, 20)), 2.0),
    Ratio(
        "61 states and a filter of 2 ms beside none",
        lambda: chained(filtered(chain(30, 20))),
        lambda: chained(chain(30, 20)),
        1.0,
    ),
    Ratio("frames of 1000 ticks beside 100", lambda: chained(chain(2, 1000)), lambda: chained(chain(2, 100)), 1.2),
    Ratio("1000 ticks of delay beside 100", lambda: one_delay(1000), lambda: one_delay(100), 3.5),
    Ratio(
        "200 ticks of a delay that acts on itself beside 70",
        lambda: delay_on_itself(200),
        lambda: delay_on_itself(70),
        6.0,
    ),
    Ratio(
        "a box of two numbers beside one",
        lambda: box(SPRING, "K", some_of(OF_SPRING, 2)),
        lambda: box(SPRING, "K", some_of(OF_SPRING, 1)),
        2.0,
    ),
    Ratio("10,000 slices beside 1000", lambda: slices(10_000), lambda: slices(1000), 1.5),
)


def held() -> int:
    """Print the ratios, the median of three each; 1 if one is above twice of what it was, or a row is not certified."""
    failed = 0
    for ratio in RATIOS:
        pairs = [(ratio.upper(), ratio.lower()) for _ in range(3)]
        now = float(np.median([upper.seconds / lower.seconds for upper, lower in pairs]))
        certified = all(cost.certified for pair in pairs for cost in pair)
        note = "" if certified else "; not every row is certified"
        print(f"{ratio.name}: {now:.1f} times as long (at most {2 * ratio.was:g}){note}", flush=True)
        failed += now > 2 * ratio.was or not certified
    return int(failed > 0)


def main() -> int:
    """Measure, print, draw."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--most", type=int, default=100_000)
    parser.add_argument("--out", default=str(Path(__file__).with_name("cliffs.png")))
    parser.add_argument("--least", action="store_true")
    given = parser.parse_args()
    if given.least:
        return held()
    drawn = {}
    for across, (of, lines) in panels(given.most).items():
        drawn[across] = (of, [])
        for line in lines:
            costs = [line.cost(size) for size in line.sizes]
            drawn[across][1].append((line, costs))
            words = [f"{n}: {cost.seconds:.3g}" + "*" * (not cost.certified) for n, cost in zip(line.sizes, costs, strict=True)]
            print(f"{across}, {of}, {line.name}: {', '.join(words)}", flush=True)
    draw(drawn, given.out)
    return 0


def draw(drawn, path: str) -> None:
    """Write the figure."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import NullFormatter

    figure = Figure(figsize=(10, 10), layout="constrained")
    FigureCanvasAgg(figure)
    styles = (("o-", "C0"), ("s-", "C1"), ("D-", "C2"))
    for place, (across, (of, lines)) in zip(figure.subplots(3, 2).flat, drawn.items(), strict=True):
        for (line, costs), plain_style in zip(lines, styles, strict=False):
            style, color = ("^--", "0.4") if "D-decomposition" in line.name else plain_style
            seconds = [cost.seconds for cost in costs]
            place.loglog(line.sizes, seconds, style, color=color, label=line.name, markersize=4)
            doubted = [(n, cost.seconds) for n, cost in zip(line.sizes, costs, strict=True) if not cost.certified]
            if doubted:
                place.loglog(*zip(*doubted, strict=True), "x", color="k", markersize=9)
        low, high = place.get_ylim()
        place.set_ylim(10 ** np.floor(np.log10(low)), 10 ** np.ceil(np.log10(high)))
        place.set(xlabel=across, ylabel="processor time (s)")
        place.set_title(of, fontsize=10)
        ticks = {"states": (3, 5, 10, 20, 40, 100), "numbers in a box": (1, 2, 3)}.get(across)
        ticks = (20, 25, 40, 50, 60, 80, 100) if "runs" in across else ticks
        if ticks:
            place.set_xticks(ticks, [str(tick) for tick in ticks])
        for axis in (place.xaxis, place.yaxis):
            axis.set_minor_formatter(NullFormatter())
        place.grid(which="major", alpha=0.3)
        place.legend(frameon=False, fontsize=9)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    sys.exit(child(sys.argv[2:]) if sys.argv[1:2] == ["--child"] else main())
