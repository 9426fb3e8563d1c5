"""`prev(...)` in a wire: the signal as it was before the tick, against programs that run in an order of their own."""

import numpy as np
import pytest
from support.exports import LEVELS, made, present, written

import wavesweep
from wavesweep.engine.errors import SpecError
from wavesweep.engine.loop import Loops

A, T, I = 0.2, 0.002, 0.025
DECAY = np.exp(-1.0 / 0.1 * T)
# The next output of the filter y += a (u - y): its shares of the output before, the position, and that of the tick before.
WIRES = {
    "0.5*prev(limit.y) + m.x": (1 - A / 2, A, 0),
    "prev(m.x - 2*limit.y) + 3*prev(m.x)": (1 - 3 * A, 0, 4 * A),
    "prev(e) + m.x": (1 - 2 * A, A, A),
    "0.5*limit.y + m.x": ((1 - A) / (1 - A / 2), A / (1 - A / 2), 0),
}


def tables(wire, every=1):
    """A mass on a low-pass filter of its position, which reads its own output."""
    limit = {"type": "lowpass", "a": "a", "every": every}
    ports = {"hand": {"force": "push", "displacement": "m.x", "reaction": "20*limit.y"}}
    return {
        "rates": {"tick_hz": 1 / T},
        "numbers": {"a": A},
        "block": {"limit": limit, "m": {"type": "mass", "mass": 0.1, "damping": 1.0}},
        "signals": {"e": "m.x - limit.y"} if "(e)" in wire else {},
        "wire": {"limit.u": wire, "m.f": "push - 20*limit.y"},
        "ports": ports,
        "simulate": {"input": "noise", "duration_s": 0.3},
    }


def tick(state, runs, shares, force=0.0):
    """A tick of the same loop: of position, velocity, the filter's output, and the position of the tick before."""
    x, v, y, before = state
    y = shares[0] * y + shares[1] * x + shares[2] * before if runs else y
    steady = force - 20 * y
    return x + 0.1 * (v - steady) * (1 - DECAY) + steady * T, steady + (v - steady) * DECAY, y, x


@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize("wire", WIRES)
def test_a_loop_is_that_of_its_program(wire, every):
    loop, force, state = wavesweep.compile(tables(wire, every)), np.random.default_rng(3).normal(size=60), (0.0,) * 4
    found = loop.simulate(force)
    for k, row in enumerate(zip(found["x"], found["f_m"], strict=True)):
        following = tick(state, k % every == 0, WIRES[wire], force[k])
        assert row == pytest.approx((state[0], 20 * following[2]), rel=1e-9, abs=1e-15)
        state = following
    frame = tuple(np.eye(4))
    for k in range(every):
        frame = tick(frame, k == 0, WIRES[wire])
    expected = np.abs(np.linalg.eigvals(np.array(frame))).max()
    assert loop.spectral_radius() == pytest.approx(expected, rel=1e-9)


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
    spec, limit = wavesweep.load(joint(torque)), (4 * I + sign * 2 * T * 0.5) / T**2
    from wavesweep.engine.frames import MarginalModes
    from wavesweep.prove import columns as prove

    nothing_drifts = MarginalModes((), (), (), ())
    ((low, high, *_),) = prove.prove_column(
        Loops(spec.drawing, spec.values), "numbers.kp", (0.0, 1e6), nothing_drifts
    ).intervals
    found = wavesweep.compile(joint(torque)).stable_intervals("kp", (0.0, 1e6))
    assert found.certified.all()
    assert (low, high) == pytest.approx((0.0, limit), rel=1e-12)
    assert (found.low[0], found.high[0]) == pytest.approx((0.0, limit), rel=1e-12)


def test_registers_run_as_seldom_as_all_that_reads_them():
    """One that a block of another rate reads, or an output shows, runs in every tick."""
    same, other = tables("prev(limit.y)", 3), tables("prev(m.x)", 3)
    shown = tables("prev(limit.y)", 3)
    shown["ports"]["outputs"] = {"before": "prev(limit.y)"}
    alike = tables("m.x", "n*two") | {"numbers": {"a": A, "n": 1, "two": 2, "three": 3}}
    alike["block"] |= {"late": {"type": "gain", "k": 0.1, "every": "n*three"}}
    alike["wire"] |= {"late.u": "prev(limit.y)"}
    runs = [wavesweep.load(each).drawing.blocks[-1].every.leaf for each in (same, other, shown, alike)]
    assert runs == [3, 1, 1, 1]


@pytest.mark.parametrize(
    ("wire", "found"),
    [
        ("prev(2)", "limit.u: expected a signal"),
        ("prev(nothing.y)", "nothing.y"),
        ("previous(m.x)", "expected one of the functions"),
        ("prev(m.x)*limit.y", "linear"),
        ("prev m.x", "end"),
    ],
)
def test_what_is_no_signal_is_refused_where_it_stands(wire, found):
    with pytest.raises(SpecError, match=found):
        wavesweep.load(tables(wire))
