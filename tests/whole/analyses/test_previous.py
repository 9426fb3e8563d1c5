"""`prev(...)` in a wire: the signal as it was before the tick, against the interpreter of the documents and limits by hand."""

import pytest
from meaning.judge import compiled, judge
from meaning.specs import toml
from support.exports import LEVELS, made, present, written

import wavesweep
from wavesweep.engine.frames import MarginalModes
from wavesweep.engine.loop import Loops

T, I = 0.002, 0.025


def tables(wire, every=1):
    """A mass on a low-pass filter of its position, which reads its own output."""
    limit = {"type": "lowpass", "a": "a", "every": every}
    ports = {"hand": {"force": "push", "displacement": "m.x", "reaction": "20*limit.y"}}
    return {
        "rates": {"tick_hz": 1 / T},
        "numbers": {"a": 0.2},
        "block": {"limit": limit, "m": {"type": "mass", "mass": 0.1, "damping": 1.0}},
        "signals": {"e": "m.x - limit.y"} if "(e)" in wire else {},
        "wire": {"limit.u": wire, "m.f": "push - 20*limit.y"},
        "ports": ports,
        "simulate": {"input": "noise", "duration_s": 0.3},
    }


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("wire", ["0.5*prev(limit.y) + m.x", "prev(m.x - 2*limit.y) + 3*prev(m.x)", "prev(e) + m.x"])
def test_a_loop_is_that_of_the_documents(wire, every, tmp_path):
    text = toml(tables(wire, every) | {"sweep": {"along": "a", "a": {"start": 0.01, "stop": 1}}})
    assert [one for one in judge(text, compiled(text, tmp_path), required=False) if not one.same] == []


@pytest.mark.slow
@pytest.mark.parametrize("compiler", present()[:1])
def test_a_controller_in_c_keeps_it(tmp_path, compiler):
    written(tables("prev(m.x - 2*limit.y) + 3*prev(m.x)", 3), tmp_path)
    code, said = made(tmp_path, "check", compiler, LEVELS[0])
    assert code == 0, said


def joint(torque):
    """A joint in a physics engine: the velocity goes first, and the position by the new velocity."""
    blocks = {name: {"type": "integrator", "method": method} for name, method in (("v", "implicit"), ("x", "explicit"))}
    return {
        "rates": {"tick_hz": 1 / T},
        "numbers": {"kp": 10.0, "kd": 0.5},
        "block": blocks | {"torque": {"type": "hold"}},
        "wire": {"torque.u": torque, "v.u": f"torque.y/{I}", "x.u": "v.y"},
    }


@pytest.mark.parametrize(("torque", "sign"), [("-kp*x.y - kd*v.y", 1), ("-kp*x.y - kd*prev(v.y)", -1)])
def test_a_torque_with_the_velocity_before_the_step_is_explicit(torque, sign):
    """kp < (4 I + 2 h kd)/h^2 if the damping is implicit, and with the other sign if it is explicit."""
    prove = pytest.importorskip("wavesweep.prove.columns")
    spec, limit = wavesweep.load(joint(torque)), (4 * I + sign * 2 * T * 0.5) / T**2
    loops, nothing_drifts = Loops(spec.drawing, spec.values), MarginalModes((), (), (), ())
    ((low, high, *_),) = prove.prove_column(loops, "numbers.kp", (0.0, 1e6), nothing_drifts).intervals
    found = wavesweep.compile(joint(torque)).stable_intervals("kp", (0.0, 1e6))
    assert found.certified.all()
    assert (low, high) == pytest.approx((0.0, limit), rel=1e-12)
    assert (found.low[0], found.high[0]) == pytest.approx((0.0, limit), rel=1e-12)


def test_registers_run_as_seldom_as_all_that_reads_them():
    """One that a block of another rate reads, or an output shows, runs in every tick."""
    same, other = tables("prev(limit.y)", 3), tables("prev(m.x)", 3)
    shown = tables("prev(limit.y)", 3)
    shown["ports"]["outputs"] = {"before": "prev(limit.y)"}
    alike = tables("m.x", "n*two") | {"numbers": {"a": 0.2, "n": 1, "two": 2, "three": 3}}
    alike["block"] |= {"late": {"type": "gain", "k": 0.1, "every": "n*three"}}
    alike["wire"] |= {"late.u": "prev(limit.y)"}
    runs = [wavesweep.load(each).drawing.blocks[-1].every.leaf for each in (same, other, shown, alike)]
    assert runs == [3, 1, 1, 1]
