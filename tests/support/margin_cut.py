"""A loop of a mass whose force comes a frame late, with factors at the cut of it: its matrix is written out here."""

import numpy as np
from scipy.linalg import expm

T, N, D, TD = 0.001, 5, 0.5, 0.3


def tables_with(margins, kp, **more):
    """A mass with friction, whose sampled position and velocity come back as a force a frame later."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"m": 1.0, "kp": 100.0},
        "block": {
            "plant": {"type": "mass", "mass": "m", "damping": D},
            "c": {"type": "hold", "every": N},
            "z": {"type": "delay", "steps": 1, "every": N},
        },
        "wire": {"c.u": f"-kp*(plant.x + {TD}*plant.v)", "z.u": "c.y", "plant.f": "z.y + push"},
        "ports": {"inputs": {"push": {"signal": "push"}}, "outputs": {"x": {"signal": "plant.x"}}},
        "sweep": {"along": "kp", "kp": {"start": kp[0], "stop": kp[1]}, "require": {"margins": margins}},
        **more,
    }


def largest(m, kp, factors):
    """The largest eigenvalue of frames with any of the factors: the force is that of the frame before, times one."""
    plant = expm(np.array([[0, 1, 0], [0, -D / m, 1 / m], [0, 0, 0]]) * N * T)
    frames = np.zeros((np.size(factors), 3, 3), complex)
    frames[:, :2] = plant[:2]
    frames[:, 2, :2] = -np.reshape(factors, (-1, 1)) * kp * np.array([1, TD])
    return np.abs(np.linalg.eigvals(frames)).max()


def factors_of(margin, size, many=241):
    """Many factors with which a loop of this margin is stable."""
    turns = np.exp(1j * np.linspace(-np.pi, np.pi, many))
    match margin:
        case "gain":
            return np.geomspace(1 / size, size, many // 6 + 1)
        case "phase_deg":
            return np.exp(1j * np.radians(np.linspace(-size, size, many // 6 + 1)))
        case "disk":
            return (1 + size / 2 * turns) / (1 - size / 2 * turns)
    return 1 / (1 - turns / size)
