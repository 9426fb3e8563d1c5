"""Make `couplings.png`: six controllers whose hand feels the same stiffness at rest, and the stiffest each one renders.

Each wall is chosen so that the hand feels 200 N/m at rest. Left: the impedance that each transmits; right: the stiffest that is
felt at rest of walls that are stable, over the damping of the wall. An implicit wall, one tick late, velocity from differences.

python sweeps/examples/couplings.py sweeps/examples
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

import wavesweep

FELT, TRIED = 200.0, 2000.0  # N/m: at rest, and the stiffest wall that is tried
FREQUENCIES, DAMPINGS = np.geomspace(0.2, 50, 120), np.linspace(0, 10, 21)
KINDS = {  # the colour of each, and its line
    "dc": ("k", "-"),
    "dc-lm": ("C0", (0, (5, 1))),
    "dc-vc": ("C1", (0, (5, 1, 1, 1))),
    "dc-vc-lm": ("C2", (0, (2, 1))),
    "pmw": ("C3", (0, (5, 1, 1, 1, 1, 1))),
    "pmw-lm": ("C4", (0, (1, 1))),
}


def loop(kind, wall):
    """A controller at a wall, with a local model that knows half of it."""
    return wavesweep.compile(
        {
            "controller": {"kind": kind, "Kp": 20.0 if kind == "pmw-lm" else 0.0},
            "device": {"velocity": "difference"},
            "environment": {"K_VE": wall, "delay": 1},
            "local_model": {"K_LM": wall / 2},
        }
    )


def excess(kind, wall):
    """How much more than FELT the hand feels at rest of a wall."""
    return loop(kind, wall).response([0.0]).impedance_abs[0] - FELT


figure = Figure((7.2, 3.2), layout="constrained")
left, right = figure.subplots(1, 2)
for kind, (colour, line) in KINDS.items():
    wall = brentq(lambda each, kind=kind: excess(kind, each), FELT / 2, 1e5)
    rows = loop(kind, wall).response(FREQUENCIES)
    said = f"{kind}: wall of {wall:.0f} N/m" + ("" if rows.stable.all() else ", unstable")
    left.loglog(rows.frequency_hz, rows.impedance_abs, color=colour, label=said, linestyle=line)
    found = loop(kind, wall).stable_intervals("K_VE", (0.0, TRIED), B_VE=DAMPINGS)
    found = found[found.low == 0]
    right.plot(found.B_VE, found.felt_high, color=colour, linestyle=line)
left.set(xlabel="frequency (Hz)", ylabel="transmitted impedance (N/m)")
right.set(xlabel="damping of the wall (N·s/m)", ylabel=f"stiffest felt at rest (N/m),\nof walls to {TRIED:g} N/m", ylim=0)
figure.legend(loc="outside upper center", ncols=2, fontsize=7, handlelength=3)
figure.savefig(Path(sys.argv[1]) / "couplings.png", dpi=150)
