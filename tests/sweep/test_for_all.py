"""[for_all]: what is proved for all values of numbers that are not known, and what refutes more."""

import numpy as np
import pytest

import wavesweep
from wavesweep import SpecError, UsageError
from wavesweep.spec import load
from wavesweep.sweep.drawn_loops import radii_of
from wavesweep.sweep.grid import distinct, drawing_for, read_by, selected
from wavesweep.tables.intervals import intervals

PD = {
    "rates": {"tick_hz": 1000},
    "numbers": {"kp": 200.0, "kd": 4.0, "n": 5},
    "block": {"arm": {"type": "mass", "mass": 0.2}, "pd": {"type": "hold", "every": "n"}},
    "wire": {"pd.u": "-kp*arm.x - kd*arm.v", "arm.f": "pd.y"},
    "sweep": {"along": "kp", "kp": {"start": 0, "stop": 5000}},
}
FIG4 = {
    "controller": {"kind": "pmw", "b": 10.0},
    "environment": {"integration": "explicit", "delay": 1, "B_VE": 1.0},
    "device": {"velocity": "difference"},
    "filters": {"lp1": {"order": 1, "cutoff_hz": 8.57}},
    "sweep": {"K_VE": {"start": 0, "stop": 2000}},
}


def for_all(spec, **ranges):
    """The rows of the spec's own numbers, and those for all."""
    table = intervals(load(spec | {"for_all": ranges}), jobs=1, along=None if "block" in spec else "K_VE").columns
    rows = [{name: column[row] for name, column in table.items()} for row in range(len(table["along"]))]
    return [row for row in rows if row["guarantee"] == "spec"], [row for row in rows if row["guarantee"] == "for_all"]


def test_pd_held_over_a_period_that_is_not_known_has_the_limit_of_the_longest():
    """`kp < 2 kd/T` for ideal samples on a free mass, whatever the mass, if `kd < 2 m/T`."""
    ranges = {"block.arm.mass": {"start": 0.15, "stop": 0.25}, "kd": {"start": 3, "stop": 5}, "n": {"values": [2, 5, 10]}}
    (own,), (row,) = for_all(PD, **ranges)
    assert own["high"] == pytest.approx(2 * 4 / 0.005, rel=1e-9)
    assert row["fails_from"] == pytest.approx(2 * 3 / 0.010, rel=1e-9)
    assert row["settled"]
    assert row["certified"]
    assert 0.99 * row["fails_from"] < row["high"] < row["fails_from"]
    assert "n = 10" in row["counterexample"]
    assert "kd = 3" in row["counterexample"]


def test_a_single_value_is_the_interval_of_the_spec():
    (own,), (row,) = for_all(PD, n={"values": [5]})
    assert row["fails_from"] == pytest.approx(own["high"], rel=1e-12)
    assert row["high"] == pytest.approx(own["high"], rel=1e-2)


@pytest.mark.slow
def test_the_worst_device_under_a_hand_that_may_let_go():
    ranges = {"device.mass": {"start": 0.08, "stop": 0.125}, "operator.stiffness": {"start": 0, "stop": 1000}}
    (_,), (row,) = for_all(FIG4, **ranges)
    worst = wavesweep.compile(FIG4).with_(**{"device.mass": 0.125}).stable_intervals().high[0]
    assert row["fails_from"] == pytest.approx(worst, rel=1e-9)
    assert row["settled"]
    assert row["counterexample"] == "device.mass = 0.125, operator.stiffness = 0"


def random_box(seed):
    rng = np.random.default_rng(seed)
    kind, ratio = rng.choice(["pmw", "dc-slow", "dc"]), int(rng.choice([4, 10, 20]))
    spec = {
        "controller": {"kind": str(kind), "b": float(rng.uniform(3, 40))},
        "rates": {"ratio": ratio},
        "environment": {
            "integration": "explicit",
            "delay": int(rng.integers(0, ratio + 1)),
            "B_VE": float(rng.choice([0.5, 2])),
        },
        "device": {"velocity": "difference"},
        "sweep": {"K_VE": {"start": 0, "stop": 5000}},
    }
    pool = {
        "device.mass": (0.07, 0.2),
        "device.damping": (0.5, 2.0),
        "controller.b": (spec["controller"]["b"] / 1.2, spec["controller"]["b"] * 1.2),
        "operator.stiffness": (0.0, 500.0),
        "operator.damping": (1.0, 6.0),
    }
    names = rng.choice(list(pool), size=2, replace=False)
    return rng, spec, {str(name): dict(zip(("start", "stop"), pool[name], strict=True)) for name in names}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [pytest.param(seed, marks=[pytest.mark.thorough] * (seed > 1)) for seed in range(200)])
def test_no_numbers_of_the_box_break_what_is_proved(seed):
    rng, spec, ranges = random_box(seed)
    points, loaded = 2000, load(spec)
    for row in for_all(spec, **ranges)[1]:
        if not row["intervals"]:
            continue
        p = np.where(rng.random(points) < 0.5, row["high"], rng.uniform(row["low"], row["high"], points))
        arrays = {"environment.K_VE": p}
        for name, span in ranges.items():
            inside, side = rng.uniform(span["start"], span["stop"], points), rng.random(points)
            arrays[name] = np.where(side < 0.3, span["start"], np.where(side > 0.7, span["stop"], inside))
        drawing = drawing_for(loaded, dict(loaded.values), "environment.K_VE")
        values = read_by(drawing, loaded.values) | {name: each for name, each in arrays.items() if name in drawing.reads}
        for part in distinct([each == 0 for each in values.values() if np.ndim(each)], points):
            assert (radii_of(drawing, selected(values, part), part.size) < 1).all()


def test_check_says_whether_the_design_holds_for_all():
    good = wavesweep.verdict(PD | {"for_all": {"kd": {"start": 3, "stop": 5}}})["for_all"]
    assert good == {"verdict": "proved", "counterexample": ""}
    bad = wavesweep.verdict(PD | {"for_all": {"kd": {"start": 0.2, "stop": 5}}})["for_all"]
    assert (bad["verdict"], bad["counterexample"]) == ("refuted", "kd = 0.2")


@pytest.mark.parametrize(
    ("ranges", "expected"),
    [
        ({"kp": {"start": 0, "stop": 1}}, "expected a number that \\[sweep\\] does not have as well"),
        ({"kd": {"start": 3, "stop": 1}}, "expected a number > start"),
        ({"kd": {"values": [3], "start": 1}}, "expected either start and stop or values"),
        ({"kd": {"start": 1, "stop": 2, "vary": True}}, "one of start, stop, values, varying"),
        ({"kd": {"start": 1, "stop": 2, "varying": 1}}, "expected true or false"),
        ({"kdd": {"start": 1, "stop": 2}}, "an unknown axis"),
        ({"lost": -1}, "expected a whole number >= 0"),
    ],
)
def test_a_range_that_is_none_is_said(ranges, expected):
    with pytest.raises(SpecError, match=expected):
        load(PD | {"for_all": ranges})


def test_a_spec_keeps_its_ranges():
    ranges = {"kd": {"start": 3.0, "stop": 5.0}, "n": {"values": [2, 5]}}
    spec = load(PD | {"for_all": ranges})
    assert spec.tables()["for_all"] == ranges
    assert load(spec.tables()).sha256 == spec.sha256 != load(PD).sha256


def test_hands_are_not_asked_for_beside_ranges():
    with pytest.raises(UsageError, match="without \\[for_all\\]"):
        intervals(load(FIG4 | {"for_all": {"device.mass": {"start": 0.08, "stop": 0.12}}}), "K_VE", wavesweep_hands(), jobs=1)


def wavesweep_hands():
    from wavesweep.sweep.hands import hands_of

    return hands_of("port")
