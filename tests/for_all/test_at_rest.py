"""The stiffness felt at rest of all loops of [for_all], against marches and members of boxes."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine.drawing import name_of
from wavesweep.for_all.at_rest import OF_MOTION
from wavesweep.for_all.rows import felt_for_all
from wavesweep.for_all.varying import Rules
from wavesweep.haptics.felt import felt_along
from wavesweep.program.sweep.grid import loops_of

WAVES = {
    "device": {"velocity": "difference"},
    "environment": {"integration": "explicit", "B_VE": 1.0, "delay": 1, "K_VE": 100.0},
    "controller": {"kind": "pmw", "b": 10, "Kp": 20},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 10}},
    "for_all": {"rates": {"ratio": {"values": [16, 33], "varying": True}}},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}},
}


def felt(tables, *values):
    """What is felt of all loops, at values of the swept number."""
    spec = wavesweep.load(tables)
    along = spec.sweep[0].path
    return felt_for_all(Rules.of(spec), loops_of(spec, dict(spec.values), along), along, np.array(values, float))


@pytest.mark.slow
def test_a_push_comes_to_rest_as_far_in_whatever_frames_it_meets():
    march = {"input": "step", "amplitude": 1.0, "frames": [16, 33, 33], "duration_s": 6.0}
    (run,) = wavesweep.simulate({**WAVES, "simulate": march})
    moved = run["x"].iloc[-1] - run["x"].iloc[0]
    assert felt(WAVES, 100.0, 50.0) == pytest.approx([100.0, 50.0], rel=1e-9)
    assert 1 / moved == pytest.approx(100.0, rel=1e-5)


def test_where_the_place_of_rest_depends_on_the_frames_nothing_is_known():
    without_Kp = {**WAVES, "controller": {"kind": "pmw", "b": 10}}
    assert np.isnan(felt(without_Kp, 100.0)).all()
    listed = {"filters": {"lp1": {"cutoff_hz": {"values": [5, 10]}}}}
    slower = {**without_Kp, "filters": {"lp1": {"order": 1, "cutoff_hz": 5}}, "for_all": {"contact": True}}
    spec = wavesweep.load(slower)
    along = spec.sweep[0].path
    own = felt_along(loops_of(spec, dict(spec.values), along), along, np.array([100.0]))
    assert felt({**without_Kp, "for_all": listed}, 100.0) == pytest.approx(own, rel=1e-12)


def drawn(displacement="tool.x", **for_all):
    """A wall behind a filter and a gain k, with a load on a spring that k moves either way."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 50.0, "B": 0.0, "k": 1.0, "g": 10.0, "m": 0.2, "w": 20.0},
        "block": {
            "tool": {"type": "mass", "mass": "m", "damping": 8.0, "stiffness": "g"},
            "load": {"type": "mass", "mass": "m", "damping": 8.0, "stiffness": 30.0},
            "filter": {"type": "lowpass", "cutoff_hz": "w"},
            "inner": {"type": "gain", "k": "k"},
        },
        "wire": {
            "filter.u": "tool.x",
            "inner.u": "filter.y",
            "load.f": "prev(inner.y)",
            "tool.f": "hand - prev(K*(inner.y + tool.x) + B*tool.v)",
        },
        "ports": {"hand": {"force": "hand", "displacement": displacement}, "wall": {"stiffness": "K", "damping": "B"}},
        "sweep": {"K": {"start": 0, "stop": 500}},
        "for_all": for_all,
    }


def test_the_least_of_a_box_is_what_its_members_have():
    """At rest the hand feels `g + K (1 + k)`, whatever mass and filter are."""
    box = {
        name: {"start": low, "stop": high} for name, low, high in (("k", -0.5, 3), ("g", 5, 20), ("m", 0.1, 0.3), ("w", 10, 30))
    }
    spec = wavesweep.load(drawn(**box))
    along = spec.sweep[0].path
    loop = loops_of(spec, dict(spec.values), along)
    paths = {name_of(axis.path): axis.path for axis in spec.for_all.axes}
    source = np.random.default_rng(3)
    members = []
    for _ in range(8):
        numbers = {paths[name]: float(source.uniform(*each.values())) for name, each in box.items()}
        members.append(felt_along(loop.changed(numbers), along, np.array([40.0]))[0])
    (least,) = felt(drawn(**box), 40.0)
    assert least == pytest.approx(5 + 40 * 0.5, rel=1e-9)
    assert least < min(members) < 2 * least


def test_a_box_in_which_the_hand_is_not_moved_at_all_has_no_least():
    """The load moves by `k x/30`, so that what is felt of it has a pole where k is 0."""
    assert np.isnan(felt(drawn("load.x", k={"start": -0.5, "stop": 3}), 40.0)).all()
    assert felt(drawn("load.x", k={"start": 0.5, "stop": 3}), 40.0) == pytest.approx([30 * (10 + 40 * 4) / 3], rel=1e-9)


def test_a_number_that_counts_otherwise_leaves_the_stiffness_unknown():
    tables = drawn(k={"start": 1, "stop": 2})
    tables["block"]["inner"]["k"] = "k*k"
    assert np.isnan(felt(tables, 40.0)).all()


@pytest.mark.parametrize(("kind", "key"), [(kind, key) for kind, keys in OF_MOTION.items() for key in sorted(keys)])
def test_nothing_at_rest_depends_on_a_key_of_motion(kind, key):
    """A block between the tool and its wall, or one that moves, felt with two values of one of its keys."""
    own = {
        "mass": {"mass": 0.3, "damping": 4.0, "stiffness": 50.0},
        "inertia": {"inertia": 0.3, "damping": 4.0, "stiffness": 50.0},
        "spring": {"k": 70.0, "d": 2.0},
        "delay": {"seconds": 0.002},
        "channel": {"every": 2, "loss": 0.1, "burst": 0.1, "burst_end": 0.5, "burst_loss": 0.5},
        "butterworth": {"order": 2, "cutoff_hz": 30.0, "pass": "low"},
        "lowpass": {key: 0.3} if key == "a" else {"cutoff_hz": 30.0},
        "lead": {"zero_hz": 20.0, "pole_hz": 60.0},
        "notch": {"frequency_hz": 40.0, "q": 1.0, "depth": 0.2},
        "pid": {"kp": 2.0, "kd": 0.1, "tau": 0.01},
    }[kind]
    wires = {"mass": ("f", "x"), "inertia": ("f", "x"), "spring": ("x1", "f1")}
    into, out_of = wires.get(kind, ("u", "y"))
    found = []
    for factor in (1.0, 0.6):
        tables = drawn()
        del tables["for_all"]
        tables["block"]["extra"] = {"type": kind, **own, key: own[key] * factor}
        tables["wire"][f"extra.{into}"] = "inner.y"
        if kind == "spring":
            tables["wire"]["extra.v1"] = "tool.v"
            tables["wire"][f"extra.{into}"] = "tool.x"
        tables["wire"]["tool.f"] = f"hand - prev(K*extra.{out_of} + K*tool.x + B*tool.v)"
        spec = wavesweep.load(tables)
        along = spec.sweep[0].path
        found.append(felt_along(loops_of(spec, dict(spec.values), along), along, np.array([0.01])))
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert abs(found[0] - 10.01) > 1e-6  # what is felt without the block
