"""Slices that differ in a number of the wire that the axis is in: they share a loop, and give what each alone gives."""

from pathlib import Path

import numpy as np
import pytest

import wavesweep
from wavesweep.errors import IllPosedLoopError
from wavesweep.monodromy.cut import with_batch
from wavesweep.spec import load
from wavesweep.sweep import open_loops

RECIPES = Path(__file__).parents[2] / "sweeps" / "recipes"
JOINT = {
    "rates": {"tick_hz": 1000},
    "numbers": {"kp": 40.0, "kd": 1.0, "m": 0.1, "d": 0.2},
    "block": {
        "arm": {"type": "mass", "mass": "m", "damping": "d"},
        "x": {"type": "hold", "every": 5},
        "v": {"type": "difference", "every": 5},
    },
    "wire": {"x.u": "arm.x", "v.u": "arm.x", "arm.f": "hand - kp*x.y - kd*v.y"},
    "ports": {"hand": {"force": "hand", "displacement": "arm.x"}},
}


def wave_line():
    return load(RECIPES / "controllers" / "pmw-lm.toml")


def alone(spec, along, span, other, value):
    """The intervals of a loop that has that value as its own, which no axis varies."""
    return wavesweep.compile(load(spec.tables(), [f"{other}={value!r}"])).stable_intervals(along, span)


@pytest.fixture
def opened(monkeypatch):
    """Of each frame of loops that are open at the axis, whether they are open at a number beside it as well."""
    made, frame = [], open_loops.open_frame
    monkeypatch.setattr(
        open_loops, "open_frame", lambda *given, **how: made.append(open_loops.BESIDE in given[3]) or frame(*given, **how)
    )
    open_loops.open_loop.cache_clear()
    return made


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("spec", "along", "span", "other", "values"),
    [
        (wave_line, "K", (0, 20000), "B", [0.0, 0.3, 4.0, 14.0, -0.5]),
        (wave_line, "B", (0, 100), "K", [0.0, 50.0, 3000.0, 18000.0]),
        (lambda: load(JOINT), "kp", (0, 400), "kd", [0.0, 0.2, 1.0, 30.0]),
        (lambda: load(JOINT), "kd", (-1, 60), "kp", [0.0, 5.0, 100.0, -2.0]),
    ],
)
def test_they_share_a_loop_and_each_has_what_it_has_alone(spec, along, span, other, values, opened):
    spec = spec()
    table = wavesweep.compile(spec).stable_intervals(along, span, **{other: values})
    assert sum(opened) == 1
    assert len(opened) <= 3  # others tell how long slices take, with the number and where it is 0
    for value in values:
        some, own = table[table[other] == value], alone(spec, along, span, other, value)
        assert some.certified.all()
        assert own.certified.all()
        names = ["intervals", "low", "high", "low_omega", "high_omega", "felt_low", "felt_high"]
        found, expected = (each[names].to_numpy(float) for each in (some, own))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_each_has_the_same_bits_whichever_others_there_are(opened):
    loop, values = wavesweep.compile(wave_line()), np.linspace(0.1, 14, 7).tolist()
    whole = loop.stable_intervals("K", (0, 20000), b=[15.0, 40.0], B=values)
    assert sum(opened) == 1
    for b, some in ((15.0, values[:2]), (40.0, values[3:4]), (15.0, values[2:])):
        part = loop.stable_intervals("K", (0, 20000), b=[b], B=some)
        mine = whole[(whole.b == b) & whole.B.isin(some)].reset_index(drop=True)
        for name in ("low", "high", "low_omega", "high_omega", "residual", "felt_low", "felt_high"):
            np.testing.assert_array_equal(part[name], mine[name])


def springs(reaction, **device):
    """A device and two gains of signals that are held for ten ticks."""
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0, "k2": 10.0},
        "block": {
            "dev": {"type": "mass", "mass": 0.1, "damping": 1.5, **device},
            "lp": {"type": "butterworth", "order": 1, "cutoff_hz": 20.0},
            "u": {"type": "hold", "every": 10},
        },
        "wire": {"lp.u": "dev.x", "u.u": "K*dev.x + 2*k2*lp.y", "dev.f": "hand - u.y"},
        "ports": {
            "hand": {"force": "hand", "displacement": "dev.x", "reaction": reaction},
            "wall": {"stiffness": "K", "damping": "k2"},
        },
    }


def test_what_is_felt_depends_on_a_second_spring(opened):
    """The position that it holds is not 0 at rest, as a velocity is."""
    loop = wavesweep.compile(springs("u.y", stiffness=30.0))
    table = loop.stable_intervals("K", (10, 200), k2=[5.0, 20.0])
    assert sum(opened) == 1
    assert table.certified.all()
    np.testing.assert_allclose(table.felt_low, [20.0, 50.0], rtol=1e-9)
    np.testing.assert_allclose(table.felt_high, table.high + 2 * table.k2, rtol=1e-9)


@pytest.mark.parametrize(("along", "other"), [("K", "B"), ("B", "K")])
def test_a_number_that_the_hand_feels_itself_counts_once_more(along, other, opened):
    tables = springs("u.y + B*dev.x")
    tables["numbers"] = {"K": 100.0, "B": 1.0}
    tables["wire"] |= {"u.u": "K*dev.x + B*dev.v"}
    tables["ports"]["wall"] = {"stiffness": "K", "damping": "B"}
    del tables["block"]["lp"], tables["wire"]["lp.u"]
    table = wavesweep.compile(tables).stable_intervals(along, (0.1, 2.0), **{other: [1.0, 1.5]})
    assert sum(opened) == 1
    assert table.certified.all()
    np.testing.assert_allclose(table.felt_low, table.low + table[other], rtol=1e-9)


def test_a_number_that_alone_holds_what_drifts_is_not_left_out():
    """Without the second one the slow mass is held by nothing, and its velocity by nothing as well."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"k": 10.0, "c": 1.0},
        "block": {"a": {"type": "mass", "mass": 0.5}, "late": {"type": "delay", "steps": 3}},
        "wire": {"late.u": "k*a.x + c*a.v", "a.f": "-late.y"},
    }
    table = wavesweep.compile(tables).stable_intervals("k", (0, 1000), c=[0.5, 2.0])
    assert table.certified.all()
    for row in table.itertuples():
        own = alone(load(tables), "k", (0, 1000), "c", row.c)
        np.testing.assert_allclose([row.low, row.high], own[["low", "high"]].to_numpy()[0], rtol=1e-9)


def test_a_number_in_a_term_with_the_axis_is_none_beside_it():
    """The product of two numbers is no sum of a part for each."""
    tables = {**JOINT, "wire": {**JOINT["wire"], "arm.f": "hand - kp*(x.y + kd*v.y)"}}
    table = wavesweep.compile(tables).stable_intervals("kp", (0, 400), kd=[0.01, 0.05])
    for row in table.itertuples():
        own = alone(load(tables), "kp", (0, 400), "kd", row.kd)
        assert row.high == pytest.approx(float(own.high[0]), rel=1e-9)


def sensed(force, damping=6.0, mass=10.0):
    """A mass whose acceleration is measured by differences."""
    return {
        "rates": {"tick_hz": 10000},
        "numbers": {"k": 40.0, "c": 0.01},
        "block": {
            "m": {"type": "mass", "mass": mass, "damping": damping},
            **{name: {"type": "difference"} for name in ("v", "acc")},
            "i": {"type": "integrator", "method": "implicit"},
            "u": {"type": "delay"},
        },
        "wire": {"v.u": "m.x", "acc.u": "v.y", "i.u": "m.x", "u.u": force, "m.f": "-u.y"},
    }


@pytest.mark.sample(2)
@pytest.mark.parametrize("span", [(-0.1, 1.0), (0.0, 1.0), (-100.0, 100.0), (0.0, 1e-7)])
def test_two_eigenvalues_1_that_the_axis_alone_moves_leave_the_end_at_0(span):
    """Of a second eigenvalue 1, as an integrator beside a position has, rounding leaves a trace in any other signal."""
    loop = wavesweep.compile(sensed("k*m.x + 0.001*k*v.y + 0.0015*k*i.y + c*acc.y"))
    table = loop.stable_intervals("k", span, c=[0.5, 2.0, 9.0])
    assert table.certified.all()
    assert table.low.tolist() == [0.0] * 3


@pytest.mark.xfail(strict=True, reason="a mode of the frame's own on the circle leaves these in doubt")
def test_a_mass_that_nothing_brakes_is_certified_beside_a_measured_acceleration():
    loop = wavesweep.compile(sensed("k*m.x + k/10*v.y + c*acc.y", damping=0.0, mass=0.1))
    assert loop.stable_intervals("k", (-10, 400), c=[0.0, 0.02, 0.05, -0.01]).certified.all()


def test_a_number_with_which_a_loop_of_direct_terms_has_no_solution_is_named():
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"p": 40.0, "q": 0.5},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 0.2}, "g": {"type": "gain"}},
        "wire": {"g.u": "p*m.x + q*g.y", "m.f": "-g.y"},
    }
    loop = wavesweep.compile(tables)
    assert loop.stable_intervals("p", (0, 400), q=[0.5, 2.0]).certified.all()
    with pytest.raises(IllPosedLoopError, match=r"q = 1\.0: the loop of direct terms through g has no solution"):
        loop.stable_intervals("p", (0, 400), q=[0.5, 1.0, 2.0])


def test_what_is_felt_where_the_other_number_is_0_is_known_from_that_loop_itself(opened):
    """Nothing determines the state of an integrator that nothing reads."""
    tables = wave_line().tables()
    del tables["sweep"]
    tables["numbers"] = {"p": 500.0, "q": 1.0}
    tables["block"] = {
        "dev": {"type": "mass", "mass": 0.1, "stiffness": 110.0},
        "w": {"type": "wave", "b": 8.6},
        "dv": {"type": "difference"},
        "lp": {"type": "butterworth", "order": 1, "cutoff_hz": 20},
        "av": {"type": "avatar", "b": 8.6, "integration": "trapezoidal", "every": 10},
        **{name: {"type": "delay", "steps": 3, "every": 10} for name in ("dn", "up")},
        "i": {"type": "integrator", "every": 10},
    }
    tables["wire"] = {"dv.u": "dev.x", "w.v": "dv.y", "lp.u": "w.out", "dn.u": "lp.y", "av.in": "dn.y", "up.u": "av.out"}
    tables["wire"] |= {"i.u": "av.x", "av.f": "p*av.x + q*i.y + av.v", "w.in": "up.y + 3.16*(av.x - dev.x)"}
    tables["wire"]["dev.f"] = "hand - w.force"
    tables["ports"] = {"hand": {"force": "hand", "displacement": "dev.x", "reaction": "w.force"}}
    tables["ports"]["wall"] = {"stiffness": "p", "damping": "q"}
    table = wavesweep.compile(tables).stable_intervals("p", (0, 20000), q=[0.0])
    assert True in opened
    assert table[["felt_low", "felt_high"]].to_numpy().tolist() == [[0.0, pytest.approx(20000, rel=1e-9)]]


def test_loops_with_other_numbers_of_slices_go_together(opened):
    """A chunk may end within the slices of a loop."""
    spec, b, B = wave_line(), np.array([11.0, 11.0, 13.0, 12.0]), np.array([1.0, 2.0, 1.0, 3.0])
    own = dict(spec.values)
    found = [
        open_loops.Opened.of(spec.drawing, own | {"numbers.b": b[some], "numbers.B": B[some]}, "K", len(some), felt=False)
        for some in ([0, 1, 2, 3], [0], [1], [2], [3])
    ]
    whole, *each = (part.intervals(with_batch(part.loops.cut, part.which.max() + 1), (0.0, 20000.0)) for part in found)
    assert opened == [True] * 5
    assert whole.column.tolist() == [0, 1, 2, 3]
    assert whole.high.tolist() == [float(part.high[0]) for part in each]
    assert whole.high.max() < 20000


def test_loops_in_which_the_other_number_is_0_go_with_the_others(opened):
    spec, axes = wave_line(), {"b": [20.0, 30.0], "B": [0.0, 2.0, 5.0]}
    table = wavesweep.compile(spec).stable_intervals("K", (0, 20000), **axes)
    assert table.certified.all()
    assert sum(opened) == 1
    for b in axes["b"]:
        mine = table[table.b == b]
        same = wavesweep.compile(load(spec.tables(), [f"b={b!r}"])).stable_intervals("K", (0, 20000), B=axes["B"])
        assert mine.high.to_numpy() == pytest.approx(same.high.to_numpy(), rel=1e-12)
        assert mine.felt_high.to_numpy() == pytest.approx(same.felt_high.to_numpy(), rel=1e-9)


def test_loops_that_fall_apart_where_the_other_number_is_0_are_right_beside_others():
    arm = {"type": "mass", "mass": 0.1, "damping": 0.2}
    spec = {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 40.0, "kc": 1.0},
        "block": {"left": arm, "right": arm, "x": {"type": "hold", "every": 5}, "y": {"type": "hold", "every": 5}},
        "wire": {
            "x.u": "left.x",
            "y.u": "right.x",
            "left.f": "-kp*x.y - kc*y.y",
            "right.f": "-40*y.y - 0.3*x.y",
        },
    }
    loop = wavesweep.compile(spec)
    table = loop.stable_intervals("kp", (0, 400), kc=[0.0, 0.5])
    assert table.certified.all()
    assert table.high[0] == loop.stable_intervals("kp", (0, 400), kc=[0.0]).high[0]
    for value, row in zip((0.0, 0.5), table.itertuples(), strict=True):
        assert row.high == pytest.approx(alone(load(spec), "kp", (0, 400), "kc", value).high[0], rel=1e-10)


def test_another_value_of_a_number_opens_one_loop_more(opened):
    """What a slice costs is known from the first one."""
    loop = wavesweep.compile(wave_line())
    loop.stable_intervals("K", (0, 20000), b=21.0)
    before = len(opened)
    loop.stable_intervals("K", (0, 20000), b=22.0)
    assert len(opened) == before + 1


@pytest.mark.parametrize(("along", "other"), [("B", "K"), ("K", "B")])
def test_what_is_felt_where_the_other_number_is_0_does_not_depend_on_the_others(along, other):
    """A direct coupling, whose hand feels the wall in every tick: the frame does not tell what is felt."""
    loop = wavesweep.compile(RECIPES / "controllers" / "dc.toml")
    table = loop.stable_intervals(along, (0, 100), **{other: [0.0, 100.0]})
    for value in (0.0, 100.0):
        mine, alone = table[table[other] == value], loop.stable_intervals(along, (0, 100), **{other: [value]})
        for name in ("felt_low", "felt_high"):
            assert mine[name].tolist() == alone[name].tolist()
            assert np.isfinite(mine[name]).all()
