"""The stiffness felt at the ends of intervals, against the static response of the loop there."""

import numpy as np
import pytest
from support.responses import loop_of
from support.specs import nested, values_of

import wavesweep
from wavesweep.engine._response.steady import static_response
from wavesweep.program.tables.interval_table import intervals

KEYS = {"K_VE": "environment.K_VE", "B_VE": "environment.B_VE", "b": "controller.b"}


def felt_at(values, **changes):
    changed = values | {KEYS[name]: value for name, value in changes.items()}
    return float(static_response(loop_of(changed))[1].real)


@pytest.mark.slow
@pytest.mark.parametrize(("along", "span"), [("K_VE", (10, 20000)), ("b", (2, 100))])
def test_it_is_the_static_impedance_at_that_end(along, span):
    values = values_of("pmw", integration="explicit", delay=20, velocity="difference", K_VE=150.0)
    others = {name: axis for name, axis in {"b": [10.0, 25.0], "B_VE": [0.5, 2.0]}.items() if name != along}
    table = wavesweep.compile(nested(values)).stable_intervals(along, span, **others)
    assert (table["intervals"] > 0).all()
    for _, row in table.iterrows():
        place = {name: row[name] for name in others}
        for end in ("low", "high"):
            assert row[f"felt_{end}"] == pytest.approx(felt_at(values, **(place | {along: row[end]})), rel=1e-9)


def test_a_wave_line_is_ranked_otherwise_than_its_walls():
    """The largest wall is rendered at a small wave impedance, where little of it is felt."""
    spec = wavesweep.load({
        "controller": {"kind": "pmw"}, "rates": {"ratio": 33},
        "device": {"mass": 0.045, "damping": 0.5}, "environment": {"integration": "explicit"},
        "sweep": {"K_VE": {"start": 0, "stop": 20000}, "b": [2.3, 25.0, 60.0]},
    })  # fmt: skip
    columns = intervals(spec, along="K_VE").columns
    first = columns["interval"] == 0
    assert np.argsort(columns["high"][first]).tolist() == [2, 1, 0]
    assert np.argsort(columns["felt_high"][first]).tolist() == [0, 1, 2]
    assert (columns["felt_high"][first] < columns["high"][first]).all()


@pytest.mark.slow
@pytest.mark.parametrize(("along", "stop"), [("Kp", 50), ("K_LM", 5000)])
def test_at_an_end_of_0_a_branch_is_out_of_the_loop(along, stop):
    tables = {"controller": {"kind": "pmw-lm"}, "rates": {"slow_hz": 60.0}}
    table = wavesweep.compile(tables).stable_intervals(along, (0, stop), K_VE=[100.0, 500.0])
    spec = wavesweep.load(tables)
    for _, row in table.iterrows():
        rest = wavesweep.compile(spec.with_values({along: 0.0, "K_VE": row.K_VE})).response([0.0])
        assert row.low == 0
        assert row.felt_low == pytest.approx(rest.impedance_re[0], rel=1e-9)


@pytest.mark.parametrize("K", [100.0, 3000.0])
def test_where_a_tick_alternates_the_stiffness_goes_on_smoothly(K):
    """The device's mode reaches -1 a tick at b = 200.00375, and the frame of 20 ticks has an eigenvalue 1 for it."""
    loop = wavesweep.compile({"controller": {"kind": "pmw"}})
    row = loop.stable_intervals("b", (5, 1000), K_VE=[K]).iloc[0]
    assert row.high_omega == 0
    beside = [felt_at(values_of("pmw"), K_VE=K, B_VE=1.0, b=row.high * (1 + share)) for share in (-3e-3, 3e-3)]
    assert row.felt_high == pytest.approx(np.mean(beside), rel=1e-5)


@pytest.mark.parametrize("slow_hz", [60.0, 48.0])
def test_of_rates_that_do_not_divide_it_is_the_impedance_towards_0_hz(slow_hz):
    tables = {"controller": {"kind": "pmw"}, "rates": {"slow_hz": slow_hz}, "environment": {"K_VE": 500.0}}
    loop = wavesweep.compile(tables)
    row = loop.stable_intervals("K_VE", (0, 500), B_VE=[1.0]).iloc[0]
    responses = loop.response([0.0, 1e-4])
    assert row.felt_low == 0
    assert row.felt_high == pytest.approx(responses.impedance_re[1], rel=1e-8)
    assert responses.impedance_re[0] == pytest.approx(row.felt_high, rel=1e-12)
    assert list(responses.doubt) == ["", ""]


def beside_a_tilted_wall(angle, n):
    """A mass in a plane, pushed along z against a flat wall whose normal is at an angle to x."""
    return {
        "rates": {"tick_hz": 1000}, "numbers": {"phi": angle, "K": 50.0, "B": 1.0, "n": {"value": n, "unit": "ticks"}},
        "block": {
            "device": {"type": "mass_matrix", "axes": ["x", "z"], "mass": [[0.2, 0], [0, 0.2]], "damping": [[2, 0], [0, 2]]},
            "wall": {"type": "wall", "nx": "cos(phi)", "ny": "sin(phi)", "K": "K", "B": "B", "every": "n", "late": "n"},
        },
        "wire": {"wall.x": "device.x", "wall.y": "device.z", "device.fx": "-wall.fx", "device.fz": "hand - wall.fy"},
        "ports": {"hand": {"force": "hand", "displacement": "device.z"}, "wall": {"stiffness": "K", "damping": "B"}},
    }  # fmt: skip


@pytest.mark.asks("axes")
@pytest.mark.parametrize("n", [1, 11])
def test_a_hand_that_slides_along_a_wall_feels_nothing_at_rest(n):
    """At rest `K n n' u` is the hand's force (0, 1), which for a normal n beside the axis is so for no u."""
    angles = {np.pi / 2: 50.0, 1.5707963: 0.0, 1.5708: 0.0, 1.0: 0.0}
    together = wavesweep.compile(beside_a_tilted_wall(1.0, n)).stable_intervals("K", (0.0, 50.0), phi=[*angles])
    for (angle, felt), in_batch in zip(angles.items(), together.felt_high, strict=True):
        loop = wavesweep.compile(beside_a_tilted_wall(angle, n))
        alone = loop.stable_intervals("K", (0.0, 50.0)).felt_high[0]
        assert [in_batch, alone, loop.response([0.0]).impedance_re[0]] == pytest.approx([felt] * 3, rel=1e-9)


@pytest.mark.slow
@pytest.mark.whole
def test_what_is_felt_over_a_band_is_what_the_wall_adds_to_free_motion():
    tables = nested(values_of("pmw", b=80.0, K_VE=300.0, damping=3.0))
    loop, felt = wavesweep.compile(tables), wavesweep.verdict(tables)["felt"]
    free, band, rest = loop.with_(K_VE=0.0, B_VE=0.0), felt["over_band"], felt["stiffness"]

    def sizes(hertz):
        found, without = (each.response(hertz)[["impedance_re", "impedance_im"]].to_numpy() @ [1, 1j] for each in (loop, free))
        return np.abs(found - without), np.abs(without)

    assert band["hz"] == [1.0, 3.0, 10.0]
    for name, size in zip(("impedance", "free"), sizes(band["hz"]), strict=True):
        assert band[name] == pytest.approx(size, rel=1e-9)
    holds, outweighed = band["holds_to_hz"], band["outweighed_bands_hz"]
    below, above = (np.abs(sizes(np.geomspace(1e-4, factor * holds, 500))[0] / rest - 1).max() for factor in (1.0, 1.01))
    assert below <= 0.1 < above
    ((at, nowhere),) = outweighed
    assert nowhere is None
    below, above = ((np.subtract(*sizes(np.geomspace(1e-4, end, 500)))).min() for end in (at * 0.999, at))
    assert above < 0 < below


def braked(brake, stiffness=0.0, **design):
    """A mass whose controller has a wall and a brake, all forces held over a tick."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0, "B": 0.0, "brake": brake},
        "block": {"m": {"type": "mass", "mass": 0.2, "damping": 1.0, "stiffness": stiffness}},
        "wire": {"m.f": "hand - K*m.x - B*m.v - brake*m.v"},
        "ports": {"hand": {"force": "hand", "displacement": "m.x"}, "wall": {"stiffness": "K", "damping": "B"}},
    } | design


@pytest.mark.whole
@pytest.mark.parametrize("brake", [0.0, 20.0])
def test_neither_a_brake_nor_a_mass_is_felt_as_a_wall(brake):
    """Forces and position at the same ticks: the wall adds K at every frequency."""
    band = wavesweep.verdict(braked(brake))["felt"]["over_band"]
    assert band["impedance"] == pytest.approx([100.0] * 3, rel=1e-9)
    assert band["holds_to_hz"] is None
    # By hand: of x' = v, v' = (f - d v)/m over a tick with a held force f - brake*v.
    T, d, m, z = 1e-3, 1.0, 0.2, np.exp(2e-3j * np.pi * np.array(band["hz"]))
    decay = np.exp(-d / m * T)
    velocity = (1 - decay) / d / (z - decay + brake * (1 - decay) / d)
    moved = m / d * (1 - decay) * velocity + (T - m / d * (1 - decay)) / d * (1 - brake * velocity)
    assert band["free"] == pytest.approx(np.abs((z - 1) / moved), rel=1e-8)
