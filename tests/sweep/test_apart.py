"""Loops in one spec that nothing connects are searched by themselves."""

import numpy as np
import pytest

import wavesweep
from wavesweep.errors import UsageError
from wavesweep.spec import load
from wavesweep.stability import Intervals
from wavesweep.sweep.apart import apart, common


def joints(first=(0.1, 0.5, 4), second=(0.1, 0.5, 4), gain="p*hb.y", **numbers):
    """Two joints under a proportional gain. first, second: mass, damping, and ticks between two commands."""
    blocks, wires = {}, {}
    for name, (mass, damping, every) in (("a", first), ("b", second)):
        blocks |= {name: {"type": "mass", "mass": mass, "damping": damping}, f"h{name}": {"type": "hold", "every": every}}
        wires |= {f"h{name}.u": f"{name}.x"}
    wires |= {"a.f": "hand - p*ha.y", "b.f": f"0.5*hand - {gain}"}
    ports = {"hand": {"force": "hand", "displacement": "a.x"}}
    return {"rates": {"tick_hz": 1000}, "numbers": {"p": 1.0, **numbers}, "block": blocks, "wire": wires, "ports": ports}


def test_two_equal_joints_have_the_limit_of_one():
    """Their crossings coincide, which alone cannot be told from one that touches the circle. The end: 250.836 in 256 bits."""
    found = wavesweep.compile(joints()).stable_intervals("p", (0.0, 2000.0))
    assert (len(found), found.certified.all(), found.low[0]) == (1, True, 0.0)
    assert found.high[0] == pytest.approx(250.8361148086, rel=1e-11)


def test_joints_that_are_stable_at_different_gains_are_never_both_stable():
    found = wavesweep.compile(joints(gain="(p - c)*hb.y", c=300.0)).stable_intervals("p", (0.0, 2000.0))
    assert (found.certified.all(), found["intervals"].tolist()) == (True, [0])


def test_parts_are_of_blocks_that_act_on_one_another():
    both = ["a", "ha"], ["b", "hb"]
    for gain in ("p*hb.y", "p*hb.y + 0.001*a.v"):
        one, other = apart(load(joints(gain=gain)).drawing)
        assert ([block.name for block in one.blocks], [block.name for block in other.blocks]) == both
        assert [signal for port, terms in other.wires for signal, _ in terms] == ["b.x", "hb.y"]
        assert (one.hand, other.hand) == (None, None)
    tables = joints(gain="p*hb.y + 0.001*a.v")
    tables["wire"]["a.f"] += " - 0.001*hb.y"
    assert len(apart(load(tables).drawing)) == 1


def test_blocks_that_come_to_rest_by_themselves_are_in_no_part():
    """But for those of a loop: a sum that reads what it gives does not come to rest."""
    tables = joints()
    tables["block"] |= {"seen": {"type": "butterworth", "order": 2, "cutoff_hz": 50.0}, "ring": {"type": "delay", "steps": 2}}
    tables["wire"] |= {"seen.u": "a.x", "ring.u": "0.5*ring.y + b.x"}
    names = [[block.name for block in part.blocks] for part in apart(load(tables).drawing)]
    assert names == [["a", "ha"], ["b", "hb"], ["ring"]]
    del tables["block"]["ring"], tables["wire"]["ring.u"]
    for name in ("a", "ha", "b", "hb"):
        del tables["block"][name]
    tables = {"rates": tables["rates"], "numbers": {"g": 2.0}, "block": tables["block"], "wire": {"seen.u": "g*hand"}}
    tables["ports"] = {"hand": {"force": "hand", "displacement": "seen.y"}}
    assert len(apart(load(tables).drawing)) == 1


def platoon(cars):
    """Equal cars, each of which keeps its distance to the one ahead by what it saw of it five ticks ago."""
    blocks, wires = {}, {}
    for n in range(cars):
        blocks |= {f"car{n}": {"type": "mass", "mass": "m", "damping": 0.2}, f"seen{n}": {"type": "hold", "every": 5}}
        blocks |= {f"speed{n}": {"type": "difference", "every": 5}, f"engine{n}": {"type": "delay", "steps": 1}}
        ahead = f" - K*seen{n - 1}.y" if n else ""
        wires |= {f"seen{n}.u": f"car{n}.x", f"speed{n}.u": f"car{n}.x", f"car{n}.f": f"-engine{n}.y"}
        wires |= {f"engine{n}.u": f"K*seen{n}.y + 2*speed{n}.y{ahead}"}
    return {"rates": {"tick_hz": 1000}, "numbers": {"K": 50.0, "m": 0.5}, "block": blocks, "wire": wires}


@pytest.mark.parametrize(("along", "span"), [("K", (0.0, 2000.0)), ("m", (0.004, 5.0))])
def test_equal_cars_behind_one_another_have_the_limit_of_one(along, span):
    """What is ahead acts on a car, and no car on what is ahead of it: all crossings coincide."""
    one, three = (wavesweep.compile(platoon(cars)).stable_intervals(along, span) for cars in (1, 3))
    assert (one.certified.tolist(), three.certified.tolist(), one["intervals"].tolist()) == ([True], [True], [1])
    assert three[["low", "high"]].to_numpy() == pytest.approx(one[["low", "high"]].to_numpy(), rel=1e-12)
    end, stable, unstable = (one.high[0], 0.999, 1.001) if along == "K" else (one.low[0], 1.001, 0.999)
    radius = wavesweep.compile(platoon(1)).spectral_radius(**{along: [end * stable, end * unstable]})
    assert radius[0] < 1 < radius[1]


def test_a_shift_that_is_read_and_adds_up_is_no_drift():
    """Each integrator by itself drifts, and one behind the other does not: its sum grows, and the mass behind it moves."""
    tables = joints()
    tables["block"] |= {"one": {"type": "integrator"}, "two": {"type": "integrator"}}
    tables["wire"] |= {"one.u": "a.x", "two.u": "one.y", "b.f": "two.y - p*hb.y"}
    found = wavesweep.compile(tables).stable_intervals("p", (0.0, 2000.0))
    assert not (found.certified & (found.intervals > 0)).any()


FREE = {"type": "mass", "mass": 0.3, "damping": 0}


@pytest.mark.sample(1)
@pytest.mark.parametrize(("block", "wires"), [
    (FREE, {"f.f": "b.v", "a.f": "hand - p*ha.y + f.x"}),
    (FREE, {"f.f": "0", "a.f": "hand - p*ha.y + f.v"}),
    (FREE, {"f.f": "hand"}),
    ({"type": "tf", "num": [1], "den": [1, 0, 0]}, {"f.u": "b.v", "a.f": "hand - p*ha.y + f.y"}),
])  # fmt: skip
def test_a_mode_that_grows_with_time_is_none_of_a_part_that_drifts(block, wires):
    """A free mass without damping moves on for ever if the hand or another loop pushes it, or if it pushes one."""
    tables = joints()
    tables["block"] |= {"f": block}
    tables["wire"] |= wires
    loop = wavesweep.compile(tables)
    found = loop.stable_intervals("p", (0.0, 2000.0))
    assert not (found.certified & (found.intervals > 0)).any()
    assert not float(loop.spectral_radius(p=100.0)) < 1


def test_a_mode_that_grows_with_time_is_left_out_of_no_cut():
    """The number is one gain of the frame, and sees nothing of a mass that the hand pushes."""
    tables = joints()
    tables["block"] = {name: tables["block"][name] for name in ("a", "ha")} | {"f": FREE}
    tables["wire"] = {"ha.u": "a.x", "a.f": "-p*ha.y", "f.f": "hand"}
    tables["ports"] = {"hand": {"force": "hand", "displacement": "f.x"}}
    loop = wavesweep.compile(tables)
    assert not loop.stable_intervals("p", (0.0, 2000.0)).certified.any()
    assert not float(loop.spectral_radius(p=100.0)) < 1


@pytest.mark.sample(2)
@pytest.mark.parametrize(("force", "back"), [("c*f.x", "-0.1*a.v"), ("c*(f.x - a.x)", "c*(a.x - f.x)"), ("c*c*f.x", "a.v")])
@pytest.mark.parametrize("along", ["p", "c"])
def test_a_coupling_of_gain_0_makes_no_free_mass_a_part_of_the_loop(force, back, along):
    """Behind it the mass moves on for ever. Its velocity is no drift, and a cut at the number does not see it."""
    tables = joints()
    tables["block"] = {name: tables["block"][name] for name in ("a", "ha")} | {"f": FREE}
    tables["numbers"] |= {"c": 0.0}
    tables["wire"] = {"ha.u": "a.x", "a.f": f"hand - p*ha.y + {force}", "f.f": back}
    loop = wavesweep.compile(tables)
    found = loop.stable_intervals("p", (0.1, 2000.0), c=[0.0] if along == "p" else [0.0, 1e-3])
    assert not (found.certified & (found.intervals > 0) & (found.c == 0)).any()
    assert not float(loop.spectral_radius(p=100.0)) < 1


@pytest.mark.parametrize("through", [{"type": "integrator"}, None])
def test_what_a_hand_moves_has_to_come_to_rest_behind_a_position_that_drifts(through):
    """The position may rest anywhere, so the sum of it grows, and with it the place of a mass that the hand holds."""
    held = (
        {"type": "mass", "mass": 1.0, "damping": 5.0, "stiffness": 30.0}
        if through
        else {"type": "mass", "mass": 1.0, "damping": 5.0}
    )
    tables = joints()
    tables["block"] = {name: tables["block"][name] for name in ("a", "ha")} | {"s": held}
    tables["wire"] = {"ha.u": "a.v", "a.f": "-p*ha.y", "s.f": "a.x + hand"}
    tables["ports"] = {"hand": {"force": "hand", "displacement": "s.x"}}
    if through:
        tables["block"] |= {"i": through}
        tables["wire"] |= {"i.u": "a.x", "s.f": "i.y + hand"}
    loop = wavesweep.compile(tables)
    assert not loop.stable_intervals("p", (0.1, 2000.0)).certified.any()
    assert not float(loop.spectral_radius(p=10.0)) < 1
    felt = wavesweep.compile(
        tables | {"wire": tables["wire"] | {"a.f": "hand - p*ha.y", "s.f": tables["wire"]["s.f"].replace("hand", "0*a.v")}}
    )
    assert not felt.stable_intervals("p", (0.1, 2000.0)).certified.any()  # and so if the hand only feels it


@pytest.mark.parametrize("gain", ["c", "2*c*c", "(c - 20 + sqrt((c - 20)**2))"])
def test_equal_joints_with_a_coupling_that_is_switched_off_are_parts(gain):
    tables = joints(first=(0.2, 0.1, 4), second=(0.2, 0.1, 4), c=0.0)
    tables["wire"] = {"ha.u": "p*a.x + 3*a.v", "hb.u": "p*b.x + 3*b.v"}
    tables["wire"] |= {"a.f": f"hand - ha.y + {gain}*(b.x - a.x)", "b.f": f"{gain}*(a.x - b.x) - hb.y"}
    loop = wavesweep.compile(tables)
    found = loop.stable_intervals("p", (1.0, 20000.0), c=[0.0, 30.0])
    assert found.certified.all()
    assert found.high[0] == pytest.approx(1550.516838911848, rel=1e-9)
    for row in found.itertuples():
        inside, outside = loop.spectral_radius(p=[row.high * (1 - 1e-7), row.high * (1 + 1e-7)], c=row.c).ravel()
        assert inside < 1 < outside


def test_a_part_without_a_solution_at_0_of_the_number_has_intervals_beyond():
    tables = joints()
    tables["block"] |= {"g": {"type": "gain", "k": 1}}
    tables["wire"] |= {"g.u": "(c - p)*g.y + a.x"}
    tables["numbers"] |= {"c": 1.0}
    found = wavesweep.compile(tables).stable_intervals("p", (10.0, 200.0), c=[0.5, 1.0, 2.0])
    assert (found.certified.tolist(), found.low.tolist(), found.high.tolist()) == ([True] * 3, [10.0] * 3, [200.0] * 3)


def test_a_part_in_doubt_leaves_no_doubt_where_others_are_never_stable():
    def intervals(low, high, doubt=0):
        known = np.isfinite(low)
        each = {"column": [0], "index": [0 if known else -1], "count": [int(known)], "low": [low], "high": [high]}
        each |= {"low_omega": [0.0], "high_omega": [0.0], "doubt": [doubt], "residual": [0.0]}
        return Intervals(**{name: np.array(value) for name, value in each.items()})

    none, one, two, unknown = intervals(np.nan, np.nan), intervals(0.0, 1.0), intervals(2.0, 3.0), intervals(0.5, 9.0, 4)
    within, seen = (0.5, 1.0), (0.5, 9.0)
    cases = [((none, unknown), 0, None), ((one, two, unknown), 0, None), ((one, unknown), 4, within), ((unknown,) * 2, 4, seen)]
    for parts, doubt, ends in cases:
        found = common(parts)
        assert (found.doubt.tolist(), found.count.tolist()) == ([doubt], [int(ends is not None)])
        assert ends is None or (found.low[0], found.high[0]) == ends


def test_a_delay_between_two_loops_hides_no_radius():
    """Its states are twenty eigenvalues 0, and all but one are known to the twentieth root of a rounding."""
    tables = joints(second=(0.2, 0.5, 4))
    tables["block"] |= {"line": {"type": "delay", "steps": 20}}
    tables["wire"] |= {"line.u": "a.x", "b.f": "line.y - p*hb.y"}
    without = wavesweep.compile(joints(second=(0.2, 0.5, 4))).spectral_radius(p=[50.0, 100.0, 400.0])
    assert wavesweep.compile(tables).spectral_radius(p=[50.0, 100.0, 400.0]) == pytest.approx(without, rel=1e-12)
    assert not np.isnan(without).any()


def test_values_at_which_nothing_leads_from_part_to_part_are_refused():
    tables = joints()
    tables["wire"]["b.f"] += " + a.v/(p - 100)"
    with pytest.raises(UsageError, match="a value without a loop"):
        wavesweep.compile(tables).stable_intervals("p", (0.0, 2000.0))


@pytest.mark.sample(2)
@pytest.mark.parametrize("seed", range(12))
def test_values_are_stable_if_all_parts_are(seed):
    """Random pairs, some with a gain of the second that falls, or does not depend on p, in batches over another number."""
    r = np.random.default_rng(seed)
    first, second = ((10 ** r.uniform(-1.5, 0), 10 ** r.uniform(-1, 0.5), int(r.choice([1, 2, 5, 10]))) for _ in range(2))
    gain = str(r.choice(["p*hb.y + 0*c*b.x", "(c - p)*hb.y", "c*hb.y", "sqrt(p)*hb.y + c*b.x"]))
    loop = wavesweep.compile(joints(first, second, gain, c=50.0))
    c, p = np.array([20.0, 300.0, 5000.0]), np.concatenate([np.geomspace(1e-2, 3000, 60)])
    table = loop.stable_intervals("p", (0.0, 3000.0), c=c)
    for value in c.tolist():
        rows = table[table.c == value]
        alone = loop.stable_intervals("p", (0.0, 3000.0), c=[value])
        assert rows[["low", "high"]].to_numpy().tolist() == alone[["low", "high"]].to_numpy().tolist() or rows.low.isna().all()
        if rows.certified.all():
            inside = np.array([any(low < each < high for low, high in zip(rows.low, rows.high, strict=True)) for each in p])
            near = np.array([np.min(np.abs(np.r_[rows.low, rows.high, 1e9] / each - 1)) < 1e-6 for each in p])
            stable = loop.spectral_radius(p=p, c=value) < 1
            assert (inside == stable)[~near].all()
    assert table.certified.any()
