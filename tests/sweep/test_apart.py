"""Loops in one spec that nothing connects are searched by themselves."""

import numpy as np
import pytest

import wavesweep
from wavesweep.spec import load
from wavesweep.sweep.apart import apart


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


def test_parts_keep_the_hand_where_it_moves_something():
    one, other = apart(load(joints()).drawing)
    assert ([block.name for block in one.blocks], [block.name for block in other.blocks]) == (["a", "ha"], ["b", "hb"])
    assert (one.hand[0], other.hand) == ("hand", None)
    assert [signal for port, terms in other.wires for signal, _ in terms] == ["b.x", "hb.y"]
    assert len(apart(load(joints(gain="p*hb.y + 0.001*a.v")).drawing)) == 1


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
            stable = np.array([float(loop.spectral_radius(p=each, c=value)) < 1 for each in p])
            assert (inside == stable)[~near].all()
    assert table.certified.any()
