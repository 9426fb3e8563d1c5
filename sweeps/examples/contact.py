"""Draw `contact.png`: a wall that is proved through contact, and one beyond it that bounces for ever.

python sweeps/examples/contact.py sweeps/examples

The wall beyond is the counterexample of the table: a curve through points (reading, force), whose forces repeat. It is marched
here by equations of its own: a mass with damping, whose force is held over a frame of the slow wall.
"""

import math
import re
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import wavesweep

SPEC = Path(__file__).with_name("contact.toml")
DAMPING, FRAMES = 5.0, 100
MASS, FRICTION, PERIOD = 0.1, 1.5, 0.02  # kg, N*s/m, s
DECAY = math.exp(-FRICTION / MASS * PERIOD)
GAIN = (1 - DECAY) / FRICTION  # of the force, for the speed after a frame


def counterexample(row):
    """The readings and the forces of a wall, frame by frame, and the push with which they repeat."""
    points = re.findall(r"\(([-0-9.e]+), ([-0-9.e]+)\)", row.counterexample)
    readings, forces = np.array(points, float).T
    return readings, forces, float(row.counterexample.rpartition(" ")[2])


def curve(readings, forces):
    """The wall that is level about each point and rises with slope 1 between two."""
    order = np.argsort(readings)
    y, f = readings[order], forces[order]
    room = np.maximum(np.diff(y) - np.diff(f), 0) / 2
    return np.sort(np.concatenate([y[:-1] + room, y[1:] - room])), np.repeat(f, 2)[1:-1]


def after_a_frame(x, v, net):
    """Position and speed after a frame under a constant net force."""
    moved = (v - net / FRICTION) * (1 - DECAY) * MASS / FRICTION + net / FRICTION * PERIOD
    return x + moved, v * DECAY + net * GAIN


def begin(stiffness, readings, forces, push):
    """Position and speed in the first frame of a motion whose forces repeat."""
    x = v = 0.0
    for _ in range(50):
        for force in forces:
            x, v = after_a_frame(x, v, push - force)
    return (readings[0] - DAMPING * v) / stiffness, v


def march(stiffness, wall, push, x, v):
    """The forces of a wall, a curve of K x + B v, under a constant push, frame by frame."""
    found = []
    for _ in range(FRAMES):
        found.append(float(np.interp(stiffness * x + DAMPING * v, *wall)))
        x, v = after_a_frame(x, v, push - found[-1])
    return found


def main(folder):
    """March both walls and draw their forces."""
    rows = wavesweep.compile(SPEC).stable_intervals(along="K_VE", span=(0, 2000), B_VE=[DAMPING])
    linear, contact = (rows[rows["guarantee"] == word].iloc[0] for word in ("spec", "contact"))
    readings, forces, push = counterexample(contact)
    beyond, inside = contact.fails_from, 0.95 * contact.high
    bouncing, clip = curve(readings, forces), (np.array([0, 1e3]), np.array([0, 1e3]))
    start = begin(beyond, readings, forces, push)
    figure = Figure((7.1, 2.8), layout="constrained")
    walls, runs = figure.subplots(1, 2, width_ratios=[1, 2])
    reach = 1.15 * readings.max()
    walls.plot([-1, 0, reach], [0, 0, reach], label="max(0, y)", color="C0")
    walls.plot(
        [-1, *bouncing[0], reach], [0, *bouncing[1], bouncing[1][-1]], label="the one of the table", color="C1", linestyle="--"
    )
    walls.set(xlabel="y = K x + B v (N)", ylabel="force (N)", ylim=(-0.1, 1.3 * forces.max()))
    time = np.arange(FRAMES) * PERIOD
    for stiffness, wall, look, name in (
        (beyond, bouncing, "C1--", f"{beyond:.0f} N/m, the one of the table"),
        (inside, bouncing, "C2:", f"{inside:.0f} N/m, the one of the table"),
        (inside, clip, "C0-", f"{inside:.0f} N/m, max(0, y)"),
    ):
        runs.step(time, march(stiffness, wall, push, *start), look, where="post", label=name, linewidth=1.1)
    runs.set(
        xlabel="time (s)", ylabel="force (N)", title=f"proved to {contact.high:.0f} N/m; linear limit {linear.high:.0f} N/m"
    )
    for axes in (walls, runs):
        axes.legend(fontsize=7, frameon=False)
    figure.savefig(Path(folder) / "contact.png", dpi=150)


if __name__ == "__main__":
    main(*sys.argv[1:])
