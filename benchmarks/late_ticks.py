"""What late fast ticks cost a wall: proved and refuted ends for 0.05, 0.1 and 0.2 ms, and CPU seconds a slice.

python benchmarks/late_ticks.py            the table of docs/timing.md
python benchmarks/late_ticks.py fig4       all walls of the paper's Fig. 4, a line for each damping
python benchmarks/late_ticks.py devices    how late the ticks of the specs that `init` writes may be, the second table
"""

import sys
import time
import tomllib
from contextlib import redirect_stdout
from io import StringIO

import numpy as np

from wavesweep.late_ticks.rows import claim, records_for_ticks
from wavesweep.program.analyses.claims import Status
from wavesweep.program.cli import main as command_line
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop

WALL = "environment.K_VE"
SHIPPED = (
    ("pmw", "paper"),
    ("pmw", "touch"),
    ("pmw", "omni"),
    ("pmw", "falcon"),
    ("dc-slow", "paper"),
    ("dc-slow", "falcon"),
    ("dc-lm", ""),
    ("dc-vc", ""),
    ("drive", ""),
    ("position-loop", ""),
)
LATE = (5e-5, 1e-4, 2e-4)
SPAN = (0.0, 20000.0)
ENGINE = {"B_VE": 1.0, "integration": "explicit", "delay": "frame"}
DEVICE = {"mass": 0.1, "damping": 1.5, "velocity": "difference"}
LOOPS = {
    "Fig. 4 of the paper, waves, a result one tick late": {
        "device": DEVICE,
        "environment": {**ENGINE, "delay": 1},
        "controller": {"kind": "pmw", "b": 10.0},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 10.0}},
    },
    "the same, a result a frame late": {
        "device": DEVICE,
        "environment": ENGINE,
        "controller": {"kind": "pmw", "b": 10.0},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 10.0}},
    },
    "waves of `init pmw`, b = 25, a result a frame late": {
        "device": DEVICE,
        "environment": ENGINE,
        "controller": {"kind": "pmw", "b": 25.0},
        "filters": {"lp1": {"order": 1, "cutoff_hz": 10.0}},
    },
    "direct coupling at the slow rate, a frame late": {
        "device": DEVICE,
        "environment": ENGINE,
        "controller": {"kind": "dc-slow"},
    },
    "the same, one tick late": {
        "device": DEVICE,
        "environment": {**ENGINE, "delay": 1},
        "controller": {"kind": "dc-slow"},
    },
    "direct coupling at 1 kHz": {
        "device": DEVICE,
        "environment": ENGINE,
        "controller": {"kind": "dc"},
    },
}


def bracketed(tables, late):
    """What is proved, what is refuted, by what, and the CPU seconds."""
    loop = own_loop(load(tables), WALL)
    begin = time.process_time()
    rows = records_for_ticks(loop, WALL, SPAN, (1e-3, 1e-3 + late))
    row = rows[0]
    return row["high"], row["fails_from"], row["counterexample"], time.process_time() - begin


def on_time(tables, tick=None):
    """The largest stable wall with ticks that are all alike; tick: their true length, by patterns of it alone."""
    from wavesweep.engine.intervals import Search
    from wavesweep.late_ticks.tick_curves import late_ticks

    loop = own_loop(load(tables), WALL)
    if tick is None:
        search = Search(WALL, SPAN, ((np.zeros(1, int), loop),), lines=False, checked=True)
        return float(search.records()["high"][0])
    ticks = late_ticks(loop, WALL, (1e-3, tick))
    low, high = 0.0, SPAN[1]
    for _ in range(40):
        middle = (low + high) / 2
        A = ticks.at_lengths(middle)[:, -1]
        product = np.eye(A.shape[-1])
        for each in A:
            product = each @ product
        stable = np.abs(np.linalg.eigvals(product)).max() < 1
        low, high = (middle, high) if stable else (low, middle)
    return low


def written(template, device=""):
    """The tables of a spec as `wavesweep init TEMPLATE --device DEVICE` writes it."""
    words = ["init", template, "--out", "-", *(["--device", device] if device else [])]
    with redirect_stdout(StringIO()) as text:
        command_line(words)
    return tomllib.loads(text.getvalue())


def lateness_borne(tables):
    """The largest lateness (s) that is proved and the least that is refuted, in steps of a tenth; and CPU seconds."""
    begin = time.process_time()
    tick = 1 / load(tables).tick_hz
    shares = np.geomspace(1e-3, 1.0, 73)  # of a tick

    def status(index):
        late = {"tick": {"late": float(shares[index] * tick)}}
        return claim(load(tables | {"for_all": late})).status

    def last(holds):
        """The last share of which it holds, -1 if of none."""
        low, high = -1, shares.size
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if holds(status(middle)) else (low, middle)
        return low

    proved = last(lambda found: found is Status.PROVED)
    refuted = last(lambda found: found is not Status.REFUTED) + 1
    most = shares[proved] * tick if proved >= 0 else 0.0
    least = shares[refuted] * tick if refuted < shares.size else np.inf
    return most, least, time.process_time() - begin


def main():
    """Print the table."""
    if "devices" in sys.argv:
        for template, device in SHIPPED:
            most, least, seconds = lateness_borne(written(template, device))
            name = f"`{template}`" + f", {device}" * bool(device)
            print(f"| {name} | {1e3 * most:.3g} | {1e3 * least:.3g} | {seconds:.2g} |", flush=True)
        return
    if "fig4" in sys.argv:
        tables = LOOPS["Fig. 4 of the paper, waves, a result one tick late"]
        for damping in range(16):
            environment = {**tables["environment"], "B_VE": float(damping)}
            for late in LATE:
                proved, refuted, by, seconds = bracketed({**tables, "environment": environment}, late)
                print(f"{damping} {1e3 * late:g} ms: {proved:.6g}, {refuted:.6g}, {by}, {seconds:.2g} s", flush=True)
        return
    for name, tables in LOOPS.items():
        found = [bracketed(tables, late) for late in LATE]
        proved = ", ".join(f"{each[0]:.4g}" for each in found)
        refuted = ", ".join(f"{each[1]:.4g}" for each in found)
        seconds = ", ".join(f"{each[3]:.2g}" for each in found)
        both = f"{on_time(tables):.4g} | {on_time(tables, 1.2e-3):.4g}"
        print(f"| {name} | {both} | {proved} | {refuted} | {found[-1][2]} | {seconds} |", flush=True)


if __name__ == "__main__":
    main()
