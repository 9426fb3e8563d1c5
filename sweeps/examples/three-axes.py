"""A log of a device of three axes, three-axes.csv: encoders of 0.02 mm in counts, under forces of noise, a tick late."""

from pathlib import Path

import numpy as np
from scipy.linalg import expm

MASS = np.array([[0.12, 0.02, -0.015], [0.02, 0.09, 0.01], [-0.015, 0.01, 0.15]])  # kg
DAMPING = np.array([[0.9, 0.1, 0.0], [0.1, 0.7, 0.05], [0.0, 0.05, 1.1]])  # N*s/m
PERIOD, STEP, ROWS = 1e-3, 2e-5, 800  # s, m

flow = np.zeros((9, 9))  # of positions, velocities and forces
flow[:3, 3:6] = np.eye(3)
flow[3:6, 3:] = np.linalg.solve(MASS, np.hstack([-DAMPING, np.eye(3)]))
tick = expm(PERIOD * flow)
source = np.random.default_rng(3)
force = np.round(1.5 * source.standard_normal((ROWS // 5, 3)).repeat(5, axis=0), 2)
state = np.zeros(9)
lines = ["time,x,y,z,fx,fy,fz"]
for k in range(ROWS):
    counts = np.round(state[:3] / STEP).astype(int)
    lines.append(",".join(map(str, [f"{k * PERIOD:.3f}", *counts, *force[k]])))
    state[6:] = force[max(k - 1, 0)]
    state = tick @ state
Path(__file__).with_suffix(".csv").write_text("\n".join([*lines, ""]))
