"""Intervals whose ends are known: in closed form, or to 40 digits."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.intervals import intervals_of, pairs
from support.specs import KINDS, values_of

import wavesweep
from wavesweep.engine._monodromy.cut import FIRST, SECOND
from wavesweep.engine._stability.stable import stable_intervals
from wavesweep.haptics.controller_page import wall_cut

EXPLICIT = {"integration": "explicit", "lp1_cutoff_hz": 8.57}

# Stable K_VE (N/m) up to 20000, from 40-digit arithmetic on the model's equations.
KNOWN = [
    ("dc-slow", {}, 0.0, [(0.0, 157.8822990995227)]),
    ("dc-slow", {}, 1.0, [(0.0, 263.1371651658711)]),
    ("dc-slow", {}, 5.0, [(0.0, 684.156629431265)]),
    ("dc-slow", {"delay": 20}, 0.5, [(0.0, 69.02118677975264)]),
    ("dc-slow", {"delay": 20}, 1.0, [(0.0, 82.5790189960284)]),
    ("dc-slow", {"ratio": 1, "velocity": "difference"}, 0.0, [(0.0, 3007.518768726479)]),
    ("dc-slow", {"ratio": 1, "velocity": "difference"}, 1.0, [(0.0, 4963.026327346007)]),
    ("dc-slow", {"ratio": 1, "velocity": "difference"}, 20.0, [(0.0, 20000.0)]),
    ("dc-lm", {"K_LM": 400.0}, 1.0, [(0.0, 646.3989263891893)]),
    ("pmw", EXPLICIT, 1.0, [(0.0, 799.7134000606709), (2523.335126265325, 4448.818804163079)]),
    ("pmw", {**EXPLICIT, "delay": 20, "lp1_cutoff_hz": 8.856}, 1.0, [(0.0, 632.2594742458579)]),
    ("pmw", {"lp1_order": 6, "lp1_cutoff_hz": 3.0}, 1.0, [(0.0, 20000.0)]),
    ("pmw-lm", {"integration": "explicit", "K_LM": 2000.0, "Kp": 20.0}, 1.0, [(0.0, 1046.064782614818)]),
]


@pytest.mark.parametrize(("kind", "changes", "B_VE", "wanted"), KNOWN)
def test_ends_are_those_of_40_digits(kind, changes, B_VE, wanted):
    """All intervals, not the first; good to 1e-12, certified, residual at rounding."""
    found = intervals_of(values_of(kind, **changes), fixed=B_VE)
    np.testing.assert_allclose(pairs(found), wanted, rtol=1e-12)
    assert found.certified.all()
    assert found.residual.max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_many_slices_are_the_slices_one_by_one(kind):
    """Loops of different impedance, mass and feedback in one batch, columns numbered slice by slice."""
    changes = {"b": np.array([20.0, 40.0, 60.0]), "mass": np.array([0.1, 0.2, 0.05]), "Kp": np.array([5.0, 20.0, 1.0])}
    B_VE = np.linspace(0, 15, 7)
    cut = wall_cut(values_of(kind, integration="explicit", delay=7, **changes))
    together = stable_intervals(cut, FIRST, (0, 2e4), np.tile(B_VE, (3, 1)))
    for i in range(3):
        alone = values_of(kind, integration="explicit", delay=7, **{name: array[i] for name, array in changes.items()})
        found = intervals_of(alone, fixed=B_VE)
        for column in range(7):
            np.testing.assert_allclose(pairs(together, 7 * i + column), pairs(found, column), rtol=1e-12)


@pytest.mark.parametrize("beta", [0.01, 0.3, 0.8, 1.3, 1.99])
def test_an_undamped_device_behind_an_encoder_has_the_published_limit(beta):
    """`K T^2/m = 2 beta (2 - beta)/(2 + beta)`, `beta = B T/m`.

    By Jury's test of `2 z^3 + (kappa + beta - 4) z^2 + (kappa + 2) z - beta`: held force on a double integrator, wall
    and backward difference at one rate, no delay.
    """
    mass, T = 0.1, 1e-3
    values = values_of("dc-slow", ratio=1, damping=0.0, velocity="difference", mass=mass)
    found = intervals_of(values, span=(0, 1e6), fixed=beta * mass / T)
    limit = 2 * beta * (2 - beta) / (2 + beta) * mass / T**2
    np.testing.assert_allclose(pairs(found), [(0, limit)], rtol=1e-9)


@pytest.mark.parametrize("beta", [0.01, 0.5, 1.9])
@pytest.mark.parametrize("ratio", [1, 4, 20])
def test_an_undamped_device_with_known_velocity_has_twice_the_damping_over_the_period(beta, ratio):
    """`K < 2 B/T_s` while `B < 2 m/T_s`: what the fast rate does in between is nothing, so only T_s counts."""
    T_s = ratio * 1e-3
    B = beta * 0.1 / T_s
    found = intervals_of(values_of("dc-slow", ratio=ratio, damping=0.0), span=(0, 1e6), fixed=B)
    np.testing.assert_allclose(pairs(found), [(0, 2 * B / T_s)], rtol=1e-9)


@pytest.mark.parametrize("beta", [0.01, 0.4, 0.8])
@pytest.mark.parametrize("ratio", [1, 20])
def test_a_period_of_delay_costs_what_jury_says(beta, ratio):
    """`K T^2/m = 2 beta - 3 + sqrt(9 - 8 beta)` from `z^3 - 2 z^2 + (1 + kappa/2 + beta) z + kappa/2 - beta`."""
    T_s = ratio * 1e-3
    values = values_of("dc-slow", ratio=ratio, delay=ratio, damping=0.0)
    found = intervals_of(values, span=(0, 1e6), fixed=beta * 0.1 / T_s)
    limit = (2 * beta - 3 + np.sqrt(9 - 8 * beta)) * 0.1 / T_s**2
    np.testing.assert_allclose(pairs(found), [(0, limit)], rtol=1e-9)


@pytest.mark.parametrize("damping", [0.1, 1.5, 20.0])
def test_a_spring_alone_is_carried_by_the_damping_of_the_device(damping):
    """`K = d (1 - a)/((1 - a) m/d - a T_s)`, `a = exp(-d T_s/m)`: the product of the two poles reaches 1."""
    m, T_s = 0.1, 0.02
    a = np.exp(-damping * T_s / m)
    limit = damping * (1 - a) / ((1 - a) * m / damping - a * T_s)
    alternating = 2 * (1 + a) * damping / ((1 + a) * T_s - 2 * (1 - a) * m / damping)  # a real pole reaches z = -1
    found = intervals_of(values_of("dc-slow", damping=damping), span=(0, 1e5), fixed=0.0)
    np.testing.assert_allclose(pairs(found), [(0, min(limit, alternating))], rtol=1e-10)
    assert found.high_omega[0] == pytest.approx(np.pi / T_s, rel=1e-12) or limit < alternating


def test_too_much_damping_alternates():
    """`B < 2 m/T_s` of the undamped device is an end at z = -1, at half the slow rate, whatever K is."""
    found = intervals_of(values_of("dc-slow", damping=0.0), "B_VE", span=(0, 100), fixed=10.0)
    np.testing.assert_allclose(pairs(found), [(10.0 * 0.02 / 2, 2 * 0.1 / 0.02)], rtol=1e-9)
    assert found.high_omega[0] == pytest.approx(np.pi / 0.02, rel=1e-12)


def test_negative_walls_end_at_zero_stiffness():
    """At K_VE = 0 a real eigenvalue passes z = 1: the reported frequency is 0."""
    found = intervals_of(values_of("dc-slow"), span=(-100, 1000), fixed=1.0)
    np.testing.assert_allclose(pairs(found), [(0, 263.1371651658711)], rtol=1e-12)
    assert found.low_omega[0] == 0
    assert found.certified.all()


def test_no_interval_is_a_row_without_ends():
    found = intervals_of(values_of("dc-slow"), span=(1000, 2000), fixed=[1.0, 2.0])
    assert found.column.tolist() == [0, 1]
    assert found.count.tolist() == [0, 0]
    assert found.index.tolist() == [-1, -1]
    assert np.isnan([found.low, found.high, found.low_omega, found.high_omega]).all()
    assert found.certified.all()


def test_an_end_of_the_range_has_no_frequency():
    found = intervals_of(values_of("dc-slow"), span=(50, 200), fixed=1.0)
    assert pairs(found) == [(50, 200)]
    assert np.isnan([found.low_omega[0], found.high_omega[0]]).all()


COLUMNS = tomllib.loads(Path(__file__).with_name("columns.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", COLUMNS)
def test_a_column_has_its_ends_where_the_radius_passes_1(name):
    tables = dict(COLUMNS[name])
    asked = tables.pop("asked")
    along, (low, high) = asked["along"], asked["span"]
    loop = wavesweep.compile(tables)
    rows = loop.stable_intervals(along, (low, high))
    ends = rows[rows.intervals > 0][["low", "high"]].to_numpy()
    assert len(ends) == asked["intervals"]
    assert rows.certified.all() or not asked.get("certified", True)
    values = np.concatenate([np.linspace(low, high, 50), *(end * (1 + 1e-6 * np.array([-1, 1])) for end in ends.ravel())])
    values = values[(low < values) & (values < high)]
    inside = ((ends[:, :1] < values) & (values < ends[:, 1:])).any(0)
    assert ((loop.spectral_radius(**{along: values}) < 1) == inside).all()
    if "low" in asked:
        assert ends[0, 0] == pytest.approx(asked["low"], rel=1e-9)


PI = {
    "rates": {"tick_hz": 1000},
    "numbers": {"p": 1.0, "share": 0.3},
    "block": {"m": {"type": "mass", "mass": 0.15, "damping": 1.0}, "i": {"type": "integrator"}},
    "wire": {"i.u": "m.x", "m.f": "hand - p*m.x - 2*m.v - share*p*i.y"},
    "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
}


@pytest.mark.parametrize("start", [0.0, 1e-9, -1.0, 1.0])
def test_a_gain_in_front_of_an_integrator_and_a_free_mass_is_certified_from_0(start):
    """Two eigenvalues meet z = 1 where the gain is 0. The end: the determinant of the marched frame in 256 bits."""
    loop = wavesweep.compile(PI)
    found = loop.stable_intervals("p", (start, 20000.0))
    assert (found.certified.all(), len(found)) == (True, 1)
    assert found.low[0] == pytest.approx(max(start, 0.0), abs=1e-12)
    assert found.high[0] == pytest.approx(5918.0351622651, rel=1e-12)


@pytest.mark.parametrize("share", [19.0, 21.0])
def test_beside_z_1_the_eigenvalues_go_where_they_go(share):
    """m s^3 + 3 s^2 + p s + share p: small gains are stable if 3 > share m, as Routh says of the continuous loop."""
    loop = wavesweep.compile(PI | {"numbers": {"p": 1.0, "share": share}})
    found = loop.stable_intervals("p", (-1.0, 100.0))
    assert found.certified.all()
    assert found["intervals"][0] == (share < 20)
    for p, stable in ((-1e-3, False), (1e-3, share < 20), (1.0, share < 20)):
        assert (loop.spectral_radius(p=p) < 1) == stable


@pytest.mark.parametrize(("method", "every"), [("trapezoidal", 1), ("explicit", 5)])
def test_a_chain_of_integrators_that_only_the_gain_reads_is_no_drift(every, method):
    """Unstable below, stable within a narrow range, unstable above, by the marched frame in 384 bits."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"p": 1.0},
        "block": {
            "m": {"type": "mass", "mass": 0.2},
            "i0": {"type": "integrator", "method": method},
            "i1": {"type": "integrator", "method": "implicit"},
            "lk": {"type": "tf", "discrete": True, "num": [0.0, 1.0], "den": [1.0, -0.999]},
            "q": {"type": "hold", "every": every},
        },
        "wire": {
            "i0.u": "m.x",
            "i1.u": "i0.y",
            "lk.u": "m.x",
            "q.u": "p*(m.x + 0.01*i0.y + 0.5*i1.y + 0.3*lk.y)",
            "m.f": "hand - q.y - 0.03*m.v",
        },
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}},
    }
    loop = wavesweep.compile(tables)
    found = loop.stable_intervals("p", (0.0, 100.0))
    assert found.certified.all()
    low, high = found.low[0], found.high[0]
    assert (low, high) == (pytest.approx(9.8e-5, rel=0.01), pytest.approx(1.145e-4, rel=0.01))
    sides = [loop.spectral_radius(p=p) < 1 for p in (low * 0.99, low * 1.01, high * 0.99, high * 1.01)]
    assert sides == [False, True, True, False]


@pytest.mark.slow
@pytest.mark.parametrize("mass", [0.05])
def test_a_crossing_between_unstable_regions_need_not_be_placed(mass):
    """Where b is twice the mass over a tick, the mode of the tick turns over; rounding hides where it crosses z = 1.

    The slow mode is unstable on both sides.
    """
    loop = wavesweep.compile(
        {
            "controller": {"kind": "pmw", "Kp": 0.0},
            "environment": {"integration": "explicit", "delay": 1},
            "device": {"mass": mass},
        }
    )
    found = loop.stable_intervals("b", (5.0, 250.0), K_VE=[3000.0, 20000.0])
    assert found.certified.all()
    assert found.intervals.tolist() == [1, 0]
    (low, high), turn = found.loc[0, ["low", "high"]], 2000 * mass
    grid = np.concatenate([np.linspace(5, 250, 400), turn * (1 + 1e-4 * np.linspace(-1, 3, 41))])
    for K, inside in ((3000.0, (low < grid) & (grid < high)), (20000.0, grid < 0)):
        assert ((loop.spectral_radius(b=grid, K_VE=K) < 1) == inside).all()
    # The same mode ends the stable range if nothing else is unstable.
    (soft,) = loop.stable_intervals("b", (5.0, 250.0), K_VE=10.0).itertuples()
    assert soft.certified
    assert soft.high == pytest.approx(turn, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("velocity", "kind"), [("exact", "dc-slow"), ("difference", "pmw-lm")])
def test_a_mass_that_nothing_brakes_crosses_twice_where_a_wall_without_damping_begins(kind, velocity):
    """Two poles are exactly 1 at K_VE = 0; slices with damping of the wall beside it do not change the one without."""
    tables = {"controller": {"kind": kind}, "device": {"damping": 0.0, "velocity": velocity}, "rates": {"ratio": 5}}
    for delay in (0, 1, 5):
        loop = wavesweep.compile(tables | {"environment": {"integration": "explicit", "delay": delay}})
        alone, both = loop.stable_intervals("K_VE", B_VE=0.0), loop.stable_intervals("K_VE", B_VE=[0.0, 1.0])
        assert both.certified.all()
        assert both[both.B_VE == 0].drop(columns="B_VE").equals(alone.drop(columns="B_VE", errors="ignore"))
        grid = np.geomspace(1e-3, 20000, 300)
        inside = ((alone.low.to_numpy()[:, None] < grid) & (grid < alone.high.to_numpy()[:, None])).any(0)
        assert ((loop.spectral_radius(K_VE=grid, B_VE=0.0) < 1) == inside).all()


@pytest.mark.asks("prove")
@pytest.mark.parametrize(("delay", "kind"), [(0, "dc-slow"), (1, "pmw"), (20, "pmw-lm")])
def test_a_damper_alone_before_a_mass_that_nothing_brakes_is_stable_from_0_on(kind, delay):
    loop = wavesweep.compile({
        "controller": {"kind": kind}, "device": {"damping": 0.0}, "environment": {"integration": "explicit", "delay": delay},
    })  # fmt: skip
    found = loop.stable_intervals("B_VE", (0.0, 3.0), K_VE=0.0)
    assert found.certified.all()
    assert found.low[0] == 0
    assert not found.low_omega[0] > 0  # a crossing, or the end of the range


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize(("b", "ratio", "delay"), [(44.4, 100, 0)])
def test_where_two_eigenvalues_meet_at_one_as_the_mode_of_the_tick_turns_over(b, ratio, delay):
    """`v' = -v` for the damper b against the device: `tanh(d T/2m) = d/b`. Neither filter nor position correction hides it."""
    loop = wavesweep.compile({
        "controller": {"kind": "pmw", "b": b, "Kp": 0.0}, "rates": {"fast_hz": 2000.0, "ratio": ratio},
        "device": {"damping": 1.5, "velocity": "exact"}, "filters": {"lp1": {"order": 0}},
        "environment": {"integration": "implicit", "delay": delay, "B_VE": 0.0},
    })  # fmt: skip
    turn = 1.5 / 2000 / (2 * np.arctanh(1.5 / b))
    found = loop.stable_intervals("device.mass", (0.005, 1.0), K_VE=[50.0, 300.0, 5000.0])
    assert found.certified.all()
    some = found[found.low_omega == 0]
    assert len(some)
    np.testing.assert_allclose(some.low, turn, rtol=1e-11)


@pytest.mark.whole
def test_a_slow_pair_that_meets_at_one_crosses_where_it_meets():
    """It is inside by 2e-5 of the distance to that place alone, and real beyond; Newton's method stops 2e-9 before."""
    loop = wavesweep.compile({
        "controller": {"kind": "pmw", "Kp": 0.0}, "device": {"mass": 0.455, "damping": 1.5}, "filters": {"lp1": {"order": 0}},
        "environment": {"integration": "explicit", "delay": 0, "K_VE": 50.0, "B_VE": 0.5},
    })  # fmt: skip
    (row,) = loop.stable_intervals("b", (2.0, 2275.0)).itertuples()
    assert (row.certified, row.low, row.high_omega) == (True, 2.0, 0.0)
    assert row.high == pytest.approx(1.5 / np.tanh(1.5 * 0.001 / (2 * 0.455)), rel=1e-11)


@pytest.mark.slow
@pytest.mark.whole
@pytest.mark.parametrize("along", ["b", "operator.mass"])
def test_without_a_wall_a_device_that_nothing_brakes_is_nowhere_stable(along):
    """Its velocity stays for ever, which is no drift of a position; a wall's damping brakes it."""
    loop = wavesweep.compile({
        "controller": {"kind": "pmw", "Kp": 0.0}, "device": {"damping": 0.0}, "environment": {"K_VE": 0.0, "B_VE": 0.0},
    })  # fmt: skip
    found = loop.stable_intervals(along, (2.0, 40.0), B_VE=[2.0, 0.0])
    assert found.B_VE.tolist() == [2.0, 0.0]
    assert found.certified.all()
    assert (found[found.B_VE == 0].intervals == 0).all()
    assert (found[found.B_VE > 0].intervals > 0).all()
    assert loop.stable_intervals(along, (2.0, 40.0), B_VE=0.0).drop(columns="B_VE").equals(
        found[found.B_VE == 0].drop(columns="B_VE").reset_index(drop=True)
    )  # fmt: skip


@pytest.mark.slow
def test_a_combination_that_the_wall_does_not_change_makes_no_loop_stable():
    """The impedance of the local model is zero and nothing filters behind it: an eigenvalue of 1 stays whatever b is."""
    loop = wavesweep.compile({
        "controller": {"kind": "pmw-lm", "b": 80.8, "Kp": 0.0}, "rates": {"fast_hz": 5000.0, "ratio": 2},
        "environment": {"integration": "explicit", "delay": 1, "K_VE": 5000.0, "B_VE": 0.5},
        "device": {"mass": 0.186, "damping": 0.0, "velocity": "difference"},
        "filters": {"lp1": {"order": 2, "cutoff_hz": 1668.16}, "hp": {"order": 1, "cutoff_hz": 0.5}, "lp2": {"order": 0}},
        "local_model": {"K_LM": 0.0, "B_LM": 0.0},
    })  # fmt: skip
    for along in ("b", "Kp"):
        assert (loop.stable_intervals(along, (2.0, 40.0)).intervals == 0).all()
    assert loop.spectral_radius(b=[5.0, 10.0, 20.0]) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(("first", "second"), [(8e-11, 8e-11), (8e-12, 2e-11)])
def test_an_island_between_a_pair_that_leaves_and_one_that_enters_is_not_certified_away(first, second):
    """Narrower than the distance at which two ends are one; pairs of squared size 1 + (p - first) and 1 - (p + second)."""
    tables = {
        "rates": {"tick_hz": 1},
        "numbers": {"p": 0.3},
        "block": {
            "a": {"type": "tf", "discrete": True, "num": [1], "den": [1, -1.08, f"1 - (p + {second})"]},
            "b": {"type": "tf", "discrete": True, "num": [1], "den": [1, 0.83, f"1 + (p - {first})"]},
            "c": {"type": "tf", "discrete": True, "num": [1], "den": [1, f"1 + 0.01*(p - {first / 2})"]},
        },
        "wire": {"a.u": "0*b.y", "b.u": "a.y", "c.u": "b.y"},
    }
    found = wavesweep.compile(tables).stable_intervals("p", (-1.0, 1.0))
    assert not found.certified.any() or found.intervals[0] == 1


def test_a_wall_that_reads_nothing_ends_no_interval():
    """Without a division by zero: stable throughout, or nowhere if a stiffness leaves the position's eigenvalue 1."""
    cut = wall_cut(values_of("pmw")).at(np.newaxis)
    blind = replace(cut, C=0 * cut.C, D=0 * cut.D)
    found = stable_intervals(blind, SECOND, (0.0, 300.0), np.array([[0.0, 20.0, 300.0]]))
    assert found.count.tolist() == [1, 0, 0]
    assert pairs(found)[:1] == [(0.0, 300.0)]
    assert np.isnan(found.high_omega).all()
