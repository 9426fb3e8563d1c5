"""The margin of loops that are assembled tick by tick, against impulses of the hand's force in time, which share no lifting."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import wavesweep


def lightly_damped(frequency_hz, damping_ratio, K):
    """A spring whose position passes an ordinary second-order transfer function, read at 125 Hz."""
    w = 2 * np.pi * frequency_hz
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": K},
        "block": {
            "m": {"type": "mass", "mass": 0.4, "damping": 2.5, "stiffness": 346.0},
            "r": {"type": "tf", "num": [w**2], "den": [1, 2 * damping_ratio * w, w**2]},
            "s": {"type": "hold", "every": 8},
            "a": {"type": "hold", "every": 8, "phase": 3},
        },
        "wire": {"r.u": "m.x", "s.u": "r.y", "a.u": "K*s.y", "m.f": "h - a.y"},
        "ports": {"hand": {"force": "h", "displacement": "m.x"}},
    }


def lowest(loop, ticks, frames, near):
    """The smallest eigenvalue of the Hermitian part of the map from a frame's forces to its displacements, near an angle."""
    shown = np.empty((frames, ticks, ticks))
    for at in range(ticks):
        force = np.zeros((frames + 1) * ticks)
        force[at] = 1.0
        position = loop.simulate(force).x.to_numpy()
        shown[:, :, at] = np.diff(position)[: frames * ticks].reshape(frames, ticks)

    def smallest(theta):
        H = np.tensordot(np.exp(-1j * theta * np.arange(frames)), shown, 1)
        return np.linalg.eigvalsh(H + H.conj().T)[0] / 2

    some = np.unique(np.clip(near + np.linspace(-0.02, 0.02, 41), 0, np.pi))
    best = some[np.argmin([smallest(theta) for theta in some])]
    found = minimize_scalar(smallest, bounds=(max(best - 1e-3, 0), min(best + 1e-3, np.pi)), options={"xatol": 1e-10})
    return min(found.fun, smallest(best))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tables", "ticks", "frames", "passive"),
    [(lightly_damped(30.69, 0.0233, 83.8), 8, 1500, False)],
)
def test_the_margin_is_that_of_the_impulse_response(tables, ticks, frames, passive):
    loop = wavesweep.compile(tables)
    found = loop.passivity().iloc[0]
    assert (found.stable, found.port_passive) == (True, passive)
    theta = found.port_omega * ticks / 1000
    assert found.port_margin == pytest.approx(lowest(loop, ticks, frames, theta), rel=1e-6)
