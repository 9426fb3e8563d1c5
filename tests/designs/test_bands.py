"""Resonances and dips that are far narrower than the frequencies that are tried are seen over a band."""

import numpy as np
import pytest
from scipy.linalg import eigvals, expm

from wavesweep.designs.family import scenarios_of
from wavesweep.designs.wishes import evaluate
from wavesweep.program.spec import load

DAMPING, RING = 2.0, 20.0  # N s/m of the device, and the rad/s at which a block beside it rings


def wished(ratio, gain, every=1, **wish):
    """A mass on a virtual spring of 300 N/m, and a block that is hardly damped between its position and its force."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"d": DAMPING, "g": gain, "K": 0.0, "B": 0.0},
        "block": {
            "dev": {"type": "mass", "mass": 0.1, "damping": "d"},
            "ring": {"type": "tf", "num": [f"g*{RING**2}"], "den": [1.0, 2 * ratio * RING, RING**2]},
            "hold": {"type": "hold", "every": every},
        },
        "wire": {
            "ring.u": "dev.x",
            "hold.u": "300*dev.x + K*dev.x + B*dev.v",
            "dev.f": "push - hold.y + ring.y",
        },
        "ports": {"hand": {"force": "push", "displacement": "dev.x"}, "wall": {"stiffness": "K", "damping": "B"}},
        "design": {"vary": {"d": {"start": 1, "stop": 10}}, "wish": wish},
    }
    spec = load(tables)
    return evaluate(spec, spec.design.wishes, scenarios_of(spec), {"numbers.d": np.array([DAMPING])}, 100.0)


def impedance(ratio, gain, band=(0.1, 10.0)):
    """The force over the position that it moves at many frequencies of a band (Hz), the finer the nearer to a resonance.

    The force is held over a tick. Resonances are the zeros of the position.
    """
    A, B, C = np.zeros((4, 4)), np.zeros((4, 1)), np.zeros((1, 4))
    A[0, 1] = A[2, 3] = 1.0
    A[1, 1:3], A[3], B[1], C[0, 0] = [-DAMPING / 0.1, 10.0], [gain * RING**2, 0, -(RING**2), -2 * ratio * RING], 10.0, 1.0
    whole = expm(np.block([[A, B], [np.zeros((1, 5))]]) * 1e-3)
    A, B = whole[:4, :4] - 300 * whole[:4, 4:] @ C, whole[:4, 4:]
    zeros = eigvals(np.block([[A, B], [C, np.zeros((1, 1))]]), np.diag([1.0, 1, 1, 1, 0]))
    with np.errstate(divide="ignore", invalid="ignore"):
        zeros = np.log(zeros.astype(complex)) * 1e3
    lowest, highest = 2 * np.pi * np.array(band)
    omega = [np.geomspace(lowest, highest, 2000)]
    for zero in zeros[np.isfinite(zeros) & (zeros.imag > 1)]:
        away = -zero.real * np.geomspace(1e-2, 1e3, 100)
        omega.append(zero.imag + np.concatenate([-away, [0.0], away]))
    omega = np.concatenate(omega)
    z = np.exp(1j * omega[(omega >= lowest) & (omega <= highest)] * 1e-3)
    return 1 / (C @ np.linalg.solve(z[:, None, None] * np.eye(4) - A, B))[:, 0, 0]


@pytest.mark.parametrize(("ratio", "gain"), [(1e-7, 4e-4), (1e-8, 4e-5), (1e-5, -0.02), (1e-3, 10.0)])
def test_free_motion_is_that_at_a_resonance_which_hardly_decays(ratio, gain):
    found = wished(ratio, gain, free_motion={"at_most": 1000})["free_motion"]
    assert found.certified[0]
    assert found.value[0] == pytest.approx(np.abs(impedance(ratio, gain)).max(), rel=1e-4)


@pytest.mark.parametrize("band", [(3.3, 6.0), (1.0, 3.0)])
def test_free_motion_is_that_of_its_own_band(band):
    """Above the resonance it is largest at the low end of the band, and below it at the high end."""
    found = wished(1e-3, 10.0, free_motion={"at_most": 1000, "band_hz": [*band]})["free_motion"]
    assert found.certified[0]
    sizes = np.abs(impedance(1e-3, 10.0, band))
    assert found.value[0] == pytest.approx(sizes.max(), rel=1e-4)


def test_over_a_band_unstable_designs_alone_have_no_value():
    tables = {"controller": {"kind": "pmw-lm", "Kp": 1e5}, "environment": {"integration": "explicit", "delay": 1}}
    over = {"transparency": {"band_hz": [0.1, 10], "walls": [100]}, "felt": {"B_VE": [1], "band_hz": [0.1, 3]}}
    spec = load(tables | {"design": {"vary": {"b": {"start": 5, "stop": 60}}, "wish": over}})
    found = evaluate(spec, spec.design.wishes, scenarios_of(spec), {"controller.b": np.array([10.0, 20.0])}, 2000.0)
    assert np.isnan(found["transparency"].value).all()
    assert (found["felt"].value == 0).all()
