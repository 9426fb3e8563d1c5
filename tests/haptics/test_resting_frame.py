"""The stiffness felt of a number that is one gain of a frame, against responses at 0 Hz, which are computed another way."""

import numpy as np
import pytest

import wavesweep
from wavesweep.engine._search import open_loops
from wavesweep.haptics import felt as haptics
from wavesweep.program.sweep.grid import own_loop

TABLES = {
    "rates": {"tick_hz": 1000},
    "numbers": {"K": 500.0, "B": 0.5, "b": 25.0},
    "ports": {
        "hand": {"force": "hand", "displacement": "device.x", "reaction": "force"},
        "wall": {"stiffness": "K", "damping": "B"},
    },
    "sweep": {"along": "K", "K": {"start": 0, "stop": 20000}},
}
DEVICE = {"type": "mass", "mass": 0.1, "damping": 1.5}


def wave_line(rng):
    """A wave line to an avatar, with filters, delays and a damper at the device now and then."""
    ticks, filtered, late, back, held = int(rng.choice([2, 5, 20, 50])), *rng.random(4)
    blocks = {"end": {"type": "wave", "b": "b"}}
    ways = ["implicit", "explicit"]
    blocks["avatar"] = {
        "type": "avatar",
        "b": "b",
        "every": ticks,
        "phase": int(rng.integers(ticks)),
        "integration": rng.choice(ways),
    }
    wires, out, wave = {"avatar.f": "K*avatar.x_spring + B*avatar.v", "end.v": "device.v"}, "end.out", "avatar.out"
    if filtered < 0.6:
        blocks["lp"], wires["lp.u"], out = (
            {"type": "butterworth", "order": int(rng.integers(1, 4)), "cutoff_hz": 15},
            out,
            "lp.y",
        )
    if late < 0.4:
        blocks["to"], wires["to.u"], out = {"type": "delay", "steps": int(rng.integers(1, 2 * ticks))}, out, "to.y"
    if back < 0.4:
        blocks["from"], wires["from.u"], wave = {"type": "delay", "steps": int(rng.integers(1, 4))}, wave, "from.y"
    more = " + 0.3*device.v" if held < 0.4 else ""
    return blocks, wires | {"avatar.in": out, "end.in": wave}, f"end.force{more}"


def sampled_wall(rng):
    """A wall that is read by a slower rate from the device."""
    blocks = {"h": {"type": "hold", "every": int(rng.choice([2, 5, 20]))}, "wall": {"type": "gain", "k": "K"}}
    return blocks, {"h.u": "device.x", "wall.u": "h.y"}, "wall.y + B*device.v + b*device.v"


@pytest.mark.parametrize(
    ("seed", "drawn"), [pytest.param(0, wave_line, marks=pytest.mark.slow), (4, wave_line), (8, sampled_wall)]
)
def test_what_is_felt_at_an_end_is_the_response_at_0_hz(drawn, seed, monkeypatch):
    blocks, wires, force = drawn(np.random.default_rng(seed))
    tables = TABLES | {"block": {"device": DEVICE, **blocks}}
    device = "hand - (" + force + ")" if drawn is not wave_line else " - ".join(["hand", *force.split(" + ")])
    loop = wavesweep.compile(tables | {"wire": {**wires, "device.f": device}, "ports": _ports(force)})
    used, asked = [], haptics.frame_dcgain
    monkeypatch.setattr(haptics, "frame_dcgain", lambda *given: used.append(asked(*given)) or used[-1])
    waves = [10.0, 25.0, 60.0]
    table = loop.stable_intervals("K", b=waves)
    assert [each is not None for each in used] == [True]
    some = table[table.intervals > 0]
    assert len(some) > 0
    assert np.isfinite(some[["felt_low", "felt_high"]].to_numpy()).all()
    for b, high, felt in zip(some.b, some.high, some.felt_high, strict=True):
        at = float(high) * (1 - 1e-4)  # beside the end, where the response exists
        response = loop.response([0.0], K=at, b=b)
        found = used[0].stiffness(np.array([waves.index(b)]), np.array([at]))
        np.testing.assert_allclose(found, response.impedance_re, rtol=1e-9)
        assert felt == pytest.approx(float(response.impedance_re[0]), rel=1e-2)


def _ports(force):
    hand, wall = TABLES["ports"]["hand"], TABLES["ports"]["wall"]
    return {"hand": hand | {"reaction": force}, "wall": wall}


def test_a_loop_that_nothing_holds_is_not_told_by_its_frame():
    """The wall reads a velocity: every force moves the device without end."""
    blocks = {"device": DEVICE, "h": {"type": "hold", "every": 10}, "wall": {"type": "gain", "k": "K"}}
    wires = {"h.u": "device.v", "wall.u": "h.y", "device.f": "hand - wall.y - B*device.v - b*device.v"}
    loop = wavesweep.compile(TABLES | {"block": blocks, "wire": wires, "ports": _ports("wall.y")})
    opened = open_loops.open_loops(own_loop(loop.spec), "K", find_port=haptics.hand_in_frame)
    at_rest = haptics.frame_dcgain(opened.drawn, opened.port, opened.frame, opened.drift)
    assert np.isnan(at_rest.stiffness(np.zeros(3, int), np.array([0.0, 1.0, 20.0]))).all()
    assert loop.stable_intervals("K", (0, 100)).felt_high.tolist() == [0.0]
