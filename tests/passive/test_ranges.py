"""Intervals with a passive port or channel, against a closed form at one rate, dense scans by python-control, and norms."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from support.held import held, passive_walls

from wavesweep.passive.over_ranges import port_maps
from wavesweep.passive.port_ranges import _OneMap, _Ranges

ENCODER = {"device.velocity": "difference", "environment.integration": "explicit"}
SLOW = ENCODER | {"environment.delay": 1, "B_VE": 0.3, "K_VE": 50.0}
WAVES = ENCODER | {"device.damping": 40.0, "Kp": 20.0}
CASES = {  # number, range, other numbers
    "wall": ("dc-slow", "environment.K_VE", (0.0, 400.0), SLOW),
    "device": ("dc-slow", "device.damping", (0.5, 5.0), SLOW),
    "impedance": ("pmw-lm", "controller.b", (1.0, 100.0), WAVES | {"rates.ratio": 5, "device.damping": 20.0}),
    "between": ("pmw", "filters.lp1.cutoff_hz", (1.0, 20.0), WAVES | {"filters.lp1.order": 2}),
}


def largest_wall(mass, damping, wall_damping, T):
    """The largest K_VE with a passive port at one rate, without delay, by the port's inverse `1/G + C` over x[k+1] - x[k].

    With `a = exp(-d T/m)` the device is `G = c/(z - a) + g`, and `He C = B cos(t)/T - K/2`.
    """
    a = np.exp(-damping * T / mass)
    g = T / damping - mass / damping**2 * (1 - a)

    def limit(t):
        G = mass / damping**2 * (1 - a) ** 2 / (np.exp(1j * t) - a) + g
        return 2 * ((1 / G).real + wall_damping * np.cos(t) / T)

    grid = np.linspace(0, np.pi, 4001)
    near = grid[np.argmin(limit(grid))]
    found = minimize_scalar(
        limit, bounds=(max(near - 1e-3, 0), min(near + 1e-3, np.pi)), method="bounded", options={"xatol": 1e-12}
    )
    return min(limit(near), found.fun)


@pytest.mark.slow
@pytest.mark.parametrize(("damping", "wall_damping"), [(1.5, 0.0)])
def test_the_largest_passive_wall_at_one_rate_is_that_of_a_closed_form(values, damping, wall_damping):
    v = values("dc", **ENCODER, B_VE=wall_damping, **{"device.damping": damping})
    found, wanted = passive_walls(v, (0.0, 20000.0)), largest_wall(0.1, damping, wall_damping, 1e-3)
    assert found.certified.tolist() == [True]
    assert found.complete
    assert found.low == [0.0]
    assert found.high[0] <= wanted * (1 + 1e-9)
    assert found.high[0] == pytest.approx(wanted, rel=1e-4)


def test_a_proof_refutes_a_finder_that_overlooks_a_hole(values):
    """The loop is passive between 17.4 and 19.1 Hz: of 1 to 20 Hz nothing is proved, and a value inside is found unasked."""
    kind, path, span, others = CASES["between"]
    loop = held(values(kind, **others), path)
    asked = _Ranges(loop, path, span, (_OneMap(port_maps(loop, path, span)),), [span], {})
    part, against = asked._proved(*span)
    assert part is None
    assert not 17.4 < against < 19.1
    known, within = asked._refuted(10.0, 19.5)
    assert not known
    assert 17.4 < within < 19.1
