"""Worst-case gain of loops that are assembled tick by tick: against impulses in time, and the lifting where rates divide."""

import mpmath
import numpy as np
import pytest
from support.drawn import random_tables

import wavesweep
from wavesweep.engine._response.steady import respond
from wavesweep.program.analyses.spec_loops import loop_at_hand
from wavesweep.program.spec import load

LOOP = {  # a frame of 12 ticks
    "rates": {"tick_hz": 1000},
    "numbers": {"k": 40.0},
    "block": {
        "device": {"type": "mass", "mass": 0.1, "damping": 5.0},
        "scene": {"type": "hold", "every": 4, "phase": 2},
        "net": {"type": "delay", "every": 6},
    },
    "wire": {"scene.u": "device.x", "net.u": "device.v", "device.f": "hand - k*scene.y - net.y"},
    "ports": {"hand": {"force": "hand", "displacement": "device.x"}},
}
FREQUENCY = np.array([0.0, 0.3, 5.0, 41.0, 125.0, 126.0, 300.0, 499.0])


def over_impulses(tables, frequency, ticks, frames):
    """Largest singular values of the map from a frame's forces to its positions, summed up from runs after one impulse each."""
    loop, runs = wavesweep.compile(tables), []
    for at in range(ticks):
        force = np.zeros(ticks * frames)
        force[at] = 1.0
        runs.append(loop.simulate(force)["x"].to_numpy().reshape(frames, ticks))
    shift = np.exp(-2j * np.pi * frequency[:, None] * ticks / tables["rates"]["tick_hz"] * np.arange(frames))
    return np.linalg.svd(np.einsum("pk,jki->pij", shift, np.array(runs)), compute_uv=False)[:, 0]


@pytest.mark.whole
def test_a_held_loop_has_the_gain_of_its_impulses_in_time():
    table = wavesweep.compile(LOOP).response(FREQUENCY)
    np.testing.assert_allclose(table.worst_gain, over_impulses(LOOP, FREQUENCY, 12, 300), rtol=1e-11)
    assert table.worst_gain_error.max() < 1e-10
    assert (table.doubt == "").all()


DRIFTING = {  # with a damping from differences of the velocity
    "rates": {"tick_hz": 3000.0},
    "block": {
        "device": {"type": "mass", "mass": 0.32038562470984466},
        "jerk": {"type": "difference"},
        "scene": {"type": "hold", "every": 4},
    },
    "wire": {
        "jerk.u": "device.v",
        "scene.u": "0.105*jerk.y",
        "device.f": "push - 0.31810297646987024*device.v - 0.31810297646987024*jerk.y",
    },
    "ports": {"hand": {"force": "push", "displacement": "device.x"}},
}


@pytest.mark.sample(5)
@pytest.mark.parametrize("frequency", [1e-3, 0.1, 3.0])
@pytest.mark.parametrize("tables", [DRIFTING, LOOP, *map(random_tables, range(12))])
def test_a_bound_covers_what_rounding_does_to_the_ticks(tables, frequency):
    """The response of the same ticks at 60 digits."""
    loop = loop_at_hand(load(tables))
    port = loop.port
    with mpmath.workdps(60):
        maps = [[mpmath.matrix(part.tolist()) for part in each] for each in port.maps]
        n, ticks, z = port.maps[0][0].shape[0], port.kind.size, mpmath.expjpi(2 * mpmath.mpf(frequency) * port.period)
        frame, force, shown, own = mpmath.eye(n), mpmath.zeros(n, 1), mpmath.zeros(1, n), mpmath.mpf(0)
        for tick, kind in enumerate(port.kind.tolist()):
            (E, B, C, D), turn = maps[kind], z**tick
            shown, own = shown + C[0, :] * frame / turn, own + ((C[0, :] * force)[0] + D[0, 0] * turn) / turn
            frame, force = frame + E * frame, force + E * force + B * turn
        state = mpmath.lu_solve(z**ticks * mpmath.eye(n) - frame, force)
        exact = ((shown * state)[0] + own) / ticks / (z - 1)
        found = respond(loop, [frequency])
        assert abs(mpmath.mpc(found.admittance[0]) / exact - 1) <= found.admittance_error[0]


@pytest.mark.parametrize("rate", [980, 12500, 1000])
def test_a_drift_is_unbounded_at_multiples_of_the_frame_at_any_rate(rate):
    """1/(1/rate) is not the rate for the first four. Beside a multiple the gain falls with the distance from it."""
    assert (1 / (1 / rate) == rate) == (rate == 1000)
    tables = {
        "rates": {"tick_hz": rate},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.5}, "h": {"type": "hold", "every": 20}},
        "wire": {"h.u": "3*m.v", "m.f": "hand - h.y"},
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
    }
    slow, loop = rate / 20, wavesweep.compile(tables)
    rows = loop.response([slow, 2 * slow, slow + slow * 2**-30, slow + slow * 2**-20])
    assert np.isnan(rows.worst_gain[:2]).all()
    assert (rows.doubt == "").all()
    np.testing.assert_allclose(rows.worst_gain[2], 2**10 * rows.worst_gain[3], rtol=1e-5)
