"""Virtual coupling against closed forms at one rate, and what it tends to."""

import numpy as np
import pytest
from support.specs import nested, values_of

import wavesweep

VC = ("dc-vc", "dc-vc-lm")


def radius(kind, **changes):
    """The spectral radius per frame, as the package has it."""
    return float(wavesweep.compile(nested(values_of(kind, **changes))).spectral_radius())


@pytest.mark.parametrize(("velocity", "B_VC", "damping"), [("exact", 0.3, 1.5), ("exact", 5.0, 0.2), ("difference", 20.0, 3.0)])
def test_a_rigid_slow_wall_leaves_the_coupling_as_a_wall_at_the_fast_rate(velocity, B_VC, damping):
    shared = {"damping": damping, "velocity": velocity}
    loop = wavesweep.compile(nested(values_of("dc-vc", K_VE=1e12, ratio=20, delay=7, B_VC=B_VC, **shared)))
    (row,) = loop.stable_intervals("K_VC", (1.0, 1e5)).itertuples()
    (fast,) = wavesweep.compile(nested(values_of("dc", B_VE=B_VC, **shared))).stable_intervals("K_VE", (1.0, 1e5)).itertuples()
    assert row.high == pytest.approx(fast.high, rel=1e-4)


def test_at_one_rate_it_is_the_impedance_of_adams_and_hannaford():
    """Coupling and wall in series, 1/Z = 1/Z_VC + 1/Z_VE, each K T z/(z - 1) + B by backward differences: poles by hand."""
    m, d, T, K_VC, B_VC, K, B = 0.1, 1.5, 1e-3, 3000.0, 4.0, 900.0, 2.0
    e = np.exp(-d * T / m)
    a, g = (1 - e) * m / d, (1 - e) / d
    c, one = (T - a) / d, np.poly1d([1.0, -1.0])
    # From the force to x: (c z + a g - c e)/((z - 1)(z - e)); the difference of x over T is (z - 1)/(z T) times that.
    through, back = np.poly1d([c, a * g - c * e]), np.poly1d([1.0, -1 - e, e])
    Z = [np.poly1d([stiffness * T + damper, -damper]) for stiffness, damper in ((K_VC, B_VC), (K, B))]  # over (z - 1)
    series = Z[0] * Z[1], (Z[0] + Z[1]) * one
    wanted = (back * series[1] * np.poly1d([T, 0.0]) + through * one * series[0]).roots
    values = values_of("dc-vc", ratio=1, velocity="difference", K_VC=K_VC, B_VC=B_VC, K_VE=K, B_VE=B)
    poles = wavesweep.compile(nested(values)).to_control().poles()
    for z in wanted[np.abs(wanted) > 1e-3]:
        if abs(z - 1) > 1e-6:  # cancels, since all of it is of differences
            assert np.abs(poles - z).min() < 1e-9


def test_a_local_model_that_knows_the_wall_hides_the_slow_loop_and_a_rigid_coupling_is_none():
    shared = {"delay": 4, "K_VE": 300.0, "B_VE": 0.0, "K_LM": 80.0}
    assert radius("dc-vc-lm", K_VC=1e9, B_VC=1e-2, **shared) == pytest.approx(radius("dc-lm", **shared), rel=1e-5)
    knows = {"K_LM": 300.0, "B_LM": 1.5, "K_VE": 300.0, "B_VE": 1.5}
    felt = [wavesweep.compile(nested(values_of("dc-vc-lm", delay=delay, **knows))).response([3.0, 20.0]) for delay in (0, 20)]
    np.testing.assert_allclose(felt[0].admittance_abs, felt[1].admittance_abs, rtol=1e-9)


@pytest.mark.parametrize("kind", VC)
def test_what_is_felt_at_rest_is_both_springs_in_series(kind):
    loop = wavesweep.compile(nested(values_of(kind, K_VE=400.0, K_VC=1200.0, delay=3, K_LM=250.0)))
    (row,) = loop.response([0.0]).itertuples()
    assert row.impedance_abs == pytest.approx(400.0 * 1200.0 / 1600.0, rel=1e-12)


def test_an_explicit_avatar_at_a_device_that_hardly_moves_has_the_limit_of_its_own_step():
    values = values_of("dc-vc", integration="explicit", K_VC=100.0, B_VC=7.0, B_VE=1.0, mass=1e6, damping=1e6, delay=5)
    (row,) = wavesweep.compile(nested(values)).stable_intervals("K_VE", (1.0, 20000.0)).itertuples()
    assert row.high == pytest.approx(2 * 8.0 / 0.02 - 100.0, rel=1e-4)
