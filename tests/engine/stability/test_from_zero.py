"""Ranges from 0 of a number whose root or power a loop reads: there it may not be analytic, and poles leave z = 1 as any power.

A mass m on a spring K and a damper B that are read every T seconds is stable if `0 < K`, `B > K T/2` and `B < 2 m/T`.
"""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._stability.along_any import BENT, stable_along_any
from wavesweep.engine._stability.sampled_frames import ParametricFrames
from wavesweep.engine.errors import UsageError

T, M = 0.005, 0.1


def joint(force, **block):
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {name: value for name, value in {"K": 100.0, "z": 1.0, "m": M}.items() if name in f"{force} m"},
        "block": {"arm": {"type": "mass", "mass": "m", **block}, "h": {"type": "hold", "every": 5}},
        "wire": {"h.u": force, "arm.f": "hand - h.y"},
        "ports": {"hand": {"force": "hand", "displacement": "arm.x", "reaction": "h.y"}},
    }


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize(
    ("force", "limits"),
    [
        ("K*arm.x + 2*z*sqrt(K*m)*arm.v", lambda z: (16 * z**2 * M / T**2, M / (z * T) ** 2)),
        ("K**(z/z)*arm.x + 2*z*sqrt(K*m)*arm.v", lambda z: (16 * z**2 * M / T**2, M / (z * T) ** 2)),
        ("K*K*arm.x + z*arm.v", lambda z: (np.sqrt(2 * z / T),)),
    ],
)
def test_the_range_may_begin_where_the_root_or_power_vanishes(force, limits):
    z = [0.3, 0.6, 1.0, 3.0]
    found = wavesweep.compile(joint(force)).stable_intervals("K", (0, 2e4), z=z)
    assert found["certified"].all()
    assert (found["intervals"] == 1).all()
    assert (found[["low", "low_omega"]] == 0).all(axis=None)
    np.testing.assert_allclose(found["high"], [min(limits(each)) for each in z], rtol=1e-9)


@pytest.mark.parametrize("high", [1e9, 1e11, 1e13])
@pytest.mark.parametrize(
    ("force", "stable"),
    [
        ("K**2*arm.x + z*K*arm.v", (0.0, 2 * M / T)),
        ("100*z*arm.x + K*K*arm.v", (np.sqrt(50 * T), np.sqrt(2 * M / T))),
    ],
)
def test_ends_next_to_0_are_found_in_a_range_that_goes_far_beyond(force, stable, high):
    found = wavesweep.compile(joint(force)).stable_intervals("K", (0, high), z=[1.0])
    assert found["certified"].all()
    np.testing.assert_allclose(found[["low", "high"]], [stable], rtol=1e-9)


def crossing_at_0_6(column, p):
    """Frames with eigenvalues 0.7 + p/2, and 0.5 - p/2 + 0.3i with its conjugate: the first is outside from 0.6 on."""
    p = np.broadcast_arrays(column, p)[1].ravel()
    E = np.zeros((p.size, 3, 3), p.dtype)
    E[:, 0, 0], E[:, 1, 1], E[:, 2, 2] = p / 2 - 0.3, -0.5 - p / 2, -0.5 - p / 2
    E[:, 1, 2], E[:, 2, 1] = 0.3, -0.3
    return E


@pytest.mark.parametrize("high", [1e3, 1e9, 1e11])
def test_a_crossing_next_to_the_low_end_is_no_drift(high):
    found = stable_along_any(ParametricFrames(crossing_at_0_6, np.ones(1)), (0.0, high), variable=BENT)
    assert found.certified.all()
    assert found.low.tolist() == [0.0]
    np.testing.assert_allclose(found.high, 0.6, rtol=1e-9, atol=1e-14 * high)


def test_frames_that_are_not_known_next_to_the_low_end_leave_the_column_in_doubt():
    def frames(column, p):
        E = crossing_at_0_6(column, p)
        E[np.broadcast_arrays(column, p)[1].ravel().real < 5] = np.nan
        return E

    found = stable_along_any(ParametricFrames(frames, np.ones(1)), (0.0, 1e11), variable=BENT)
    assert not found.certified.any()
    assert found.low.tolist() == [0.0]  # of what is not known, where all that is stable lies


@pytest.mark.parametrize("force", ["arm.x/sqrt(K)", "K**-0.5*arm.x", "sqrt(K - 1)*arm.x", "sqrt(1 - K)*arm.x"])
def test_a_range_with_values_without_a_loop_is_refused(force):
    tables = joint(f"K*arm.x + {force}")
    tables["numbers"]["K"] = 1.0
    with pytest.raises(UsageError):
        wavesweep.stability_region(tables | {"sweep": {"K": {"start": 0, "stop": 100}}}, "K")


@pytest.mark.parametrize("from_crossing", [-1, 1])
@pytest.mark.parametrize(("unstable", "high"), [(1.5, 3.0), (1.5, 0.51), (1.0, 3.0)])
def test_a_range_that_begins_within_rounding_of_a_crossing_begins_with_its_mode(unstable, high, from_crossing):
    """`x+ = (a - g) x` meets 1 at g = a - 1, and -1 two further on; of a crossing at 0, rounding is of the span."""
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"a": unstable, "g": 1.0},
        "block": {"x": {"type": "delay"}},
        "wire": {"x.u": "(a - g)*x.y"},
    }
    crossing = unstable - 1
    low = crossing + from_crossing * (np.spacing(crossing) if crossing else 1e-15)
    (row,) = wavesweep.compile(tables).stable_intervals("g", (low, high)).itertuples()
    assert row.certified
    assert (row.low, row.low_omega) == (low, 0.0)
    assert row.high == pytest.approx(min(high, unstable + 1), rel=1e-12)


@pytest.mark.slow
@pytest.mark.asks("prove")
def test_a_free_mass_leaves_1_with_two_modes_as_a_spring_takes_hold_of_it():
    """They leave along the circle, as roots of the spring, and inwards as its square: at the end they are 1e-26 from it."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 100.0},
        "block": {
            "held": {"type": "mass", "mass": 0.17},
            "free": {"type": "mass", "mass": 1.3},
            "spring": {"type": "spring", "k": "k"},
            "drive": {"type": "hold"},
        },
        "wire": {
            "spring.x1": "held.x",
            "spring.x2": "free.x",
            "free.f": "spring.f2",
            "drive.u": "6*held.x + 0.9*held.v",
            "held.f": "spring.f1 - drive.y",
        },
    }
    loop = wavesweep.compile(tables)
    (row,) = loop.stable_intervals("k", (0, 2500)).itertuples()
    assert row.certified
    assert (row.low, row.high) == (0.0, 2500.0)
    assert (loop.spectral_radius(k=np.geomspace(1e-2, 2500, 20)) < 1).all()
