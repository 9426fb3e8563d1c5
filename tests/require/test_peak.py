"""[sweep] require = { peak = ... }: the gain of sines at their own frequency, up to half the rate of what is read."""

import numpy as np
import pytest
from meaning.reading import machine_of, with_numbers
from meaning.required import value_of

import wavesweep
from wavesweep.engine.frames import Bounded
from wavesweep.program.spec import load
from wavesweep.require.disc_panels import BAD, GOOD, HALF_RIM, OPEN
from wavesweep.require.sines import Panel
from wavesweep.simulation.experiment import simulation_of

T = 0.01  # s, a tick
SLOW = {  # an integrator under a gain that reads once in 4 ticks, and holds; `quick` reads in every other tick
    "rates": {"tick_hz": 1 / T},
    "numbers": {"K": 5.0},
    "block": {
        "p": {"type": "tf", "num": [1], "den": [1, 0]},
        "c": {"type": "gain", "every": 4, "phase": 1},
        "quick": {"type": "gain", "every": 2, "phase": 1},
    },
    "wire": {"c.u": "ref - p.y", "quick.u": "jerk", "p.u": "K*c.y + 3*quick.y + dist"},
    "ports": {"inputs": {"ref": "ref", "jerk": "jerk", "dist": "dist"}, "outputs": {"place": "p.y"}},
    "sweep": {"along": "K", "K": {"start": 0.0, "stop": 60.0}},
}


def peak_of(K, source):
    """The largest gain of sines of an input, by a march of the documents' own reading."""
    return value_of(machine_of(with_numbers(SLOW, {"K": K})), "peak", {"from": source, "to": "place"})


@pytest.mark.slow
@pytest.mark.parametrize(("source", "K"), [("ref", 35.0), ("jerk", 40.0), ("dist", 42.0)])
def test_a_peak_ends_where_a_march_says(source, K):
    level = peak_of(K, source)
    require = {"peak": {"from": source, "to": "place", "at_most": float(level)}}
    rows = wavesweep.compile(SLOW).stable_intervals(require=require)
    ends = [(row.high, row.high_set_by) for row in rows.itertuples()]
    assert rows["certified"].all()
    assert (pytest.approx(K, rel=1e-7), "peak") in ends
    for value in (1.5, 10.0, 20.0, 30.0, 45.0, 49.0):
        inside = any(row.low < value < row.high for row in rows.itertuples())
        assert inside == (peak_of(value, source) < level)


@pytest.mark.slow
def test_a_wall_may_begin_at_no_stiffness():
    """There nothing shows the position, which drifts, and the speed for the hand's force has a peak all the same."""
    wall = {
        "controller": {"kind": "dc-slow"},
        "rates": {"ratio": 4},
        "device": {"damping": 5.0},
        "sweep": {"K_VE": {"start": 0.0, "stop": 1400.0}},
    }
    require = {"peak": {"from": "f_h", "to": "v", "at_most": 0.3}}
    rows = wavesweep.compile(wall).stable_intervals(require=require)
    (row,) = rows.itertuples()
    assert (row.certified, row.low) == (True, 0)
    for K, within in ((row.high * (1 - 1e-4), True), (row.high * (1 + 1e-4), False)):
        machine = machine_of(wall | {"environment": {"K_VE": K}})
        assert (value_of(machine, "peak", {"from": "f_h", "to": "v"}) < 0.3) == within


def test_the_gain_and_the_peak_of_a_slow_input_say_what_is_read():
    def said(**table):
        spec = load(SLOW | {"sweep": SLOW["sweep"] | {"require": table}})
        return list(spec.require.bound.notices(wavesweep.program.sweep.grid.own_loop(spec), "numbers.K", "K", (1.0, 49.0)))

    ends = {"from": "ref", "to": "place"}
    assert said(gain={**ends, "at_most": 1.9}) == [
        "gain: ref is read once in 4 ticks: at least 2 whatever K is; peak has that of sines"
    ]
    assert said(gain={**ends, "at_most": 2.1}) == []
    assert said(peak={"from": "dist", "to": "place", "at_most": 1.0}) == []
    (line,) = said(peak={**ends, "at_most": 1.0})
    assert (
        line == "peak: ref is read once in 4 ticks, at 25 Hz: of sines of f up to 12.5 Hz, as which 25 Hz - f and + f are read"
    )


@pytest.mark.asks("designs")
def test_a_search_ranks_by_the_peak_that_is_proved(monkeypatch):
    from wavesweep.designs.family import scenarios_of
    from wavesweep.designs.wishes import evaluate

    wish = {"peak": {"at_most": 3.0, "from": "ref", "to": "place"}}
    spec = load(SLOW | {"design": {"vary": {"K": [35.0, 36.0]}, "wish": wish}})
    about = spec, spec.design.wishes, scenarios_of(spec), {"numbers.K": np.array([35.0])}, 1.0
    proved = evaluate(*about)["peak"]
    assert proved.certified.all()
    monkeypatch.setattr(Panel, "label", None)  # nothing is proved
    assert evaluate(*about, ranked=True)["peak"].value == proved.value


def test_a_peak_that_is_wished_is_the_largest_and_certified():
    wish = {"peak": {"at_most": 3.0, "from": "ref", "to": "place"}}
    (row,) = wavesweep.design(
        load(SLOW | {"design": {"population": 8, "generations": 1, "vary": {"K": [35.0, 36.0]}, "wish": wish}})
    ).itertuples()
    assert (row.K, row.certified) == (35.0, True)
    assert row.peak == pytest.approx(peak_of(35.0, "ref"), rel=2e-6)


DRIVE = """
[rates]
tick_hz = 8000
[numbers]
kv = 20.0
[block.motor]
type = "inertia"
inertia = 1e-4
damping = 2e-4
[block.load]
type = "inertia"
inertia = 3e-4
damping = 1e-4
[block.shaft]
type = "spring"
k = 40.0
d = 0.003
[block.current]
type = "tf"
num = [1]
den = [0.0003, 1]
[block.rate]
type = "difference"
every = 4
[block.filt]
type = "lowpass"
cutoff_hz = 600
every = 4
[block.speed]
type = "pi"
kp = 0.4
ki = 8.0
every = 4
phase = 1
[block.notch]
type = "notch"
frequency_hz = 116
q = 1.5
depth = 0.2
every = 4
phase = 1
[block.bus]
type = "delay"
every = 32
[block.pos]
type = "gain"
k = "kv"
every = 32
[wire]
"shaft.x1" = "motor.x"
"shaft.v1" = "motor.v"
"shaft.x2" = "load.x"
"shaft.v2" = "load.v"
"current.u" = "notch.y"
"motor.f" = "0.09*current.y + shaft.f1"
"load.f" = "shaft.f2"
"rate.u" = "motor.x"
"filt.u" = "rate.y"
"speed.u" = "bus.y - filt.y"
"notch.u" = "speed.y"
"pos.u" = "ref - motor.x"
"bus.u" = "pos.y"
[ports]
inputs = { ref = "ref" }
outputs = { angle = "load.x" }
[sweep]
along = "kv"
kv = { start = 0.5, stop = 150 }
require.peak = { from = "ref", to = "angle", at_most = 1.1 }
[simulate]
from = "ref"
"""


@pytest.mark.slow
def test_a_servo_follows_sines_of_its_slow_reference_up_to_the_peak(tmp_path):
    """17 states and 32 ticks a frame, against the amplitude of a run at the frequency of the peak."""
    path = tmp_path / "drive.toml"
    path.write_text(DRIVE)
    (row,) = wavesweep.stability_region(path).itertuples()
    assert (row.certified, row.high_set_by, round(row.high, 3)) == (True, "peak", 33.486)
    frames = 199  # six periods of the peak, 7.54 Hz
    turn = 2 * np.pi * 6 / (32 * frames)
    assert turn * 8000 == pytest.approx(row.high_omega, rel=1e-3)
    ticks = np.arange(4 * 32 * frames)
    for kv, beyond in ((row.high * (1 - 1e-4), False), (row.high * (1 + 1e-4), True)):
        run = simulation_of(load(path, [f"kv={kv!r}"]), np.cos(turn * ticks))
        last = run.signals["angle"][-32 * frames :]
        amplitude = 2 * abs(np.mean(last * np.exp(-1j * turn * ticks[: 32 * frames])))
        assert (amplitude > 1.1) == beyond
        assert amplitude == pytest.approx(1.1, rel=2e-4)


def resonance(half, level):
    """A panel about p = 0 of a frame of two ticks, with a peak of about 0.5 + 0.3 p whose angle moves from 0.9."""

    def maps(p):
        cos, sin = np.cos(0.9 + 0.3 * p), np.sin(0.9 + 0.3 * p)
        step, b, c = 0.98 * np.array([[cos, -sin], [sin, cos]]), np.array([[0.02 + 0.012 * p], [0]]), np.array([[1, 0]])
        direct = np.zeros((2, 2), complex)
        direct[1, 0] = (c @ b)[0, 0]
        parts = (step @ step - np.eye(2), np.hstack([step @ b, b]), np.vstack([c, c @ step]), direct)
        return [Bounded(part, 0 * np.abs(part)) for part in parts]

    points = [maps(p) for p in 2 * half * np.append(0.0, HALF_RIM)]
    pairs = [Bounded(*map(np.array, zip(*pair, strict=True))) for pair in zip(*points, strict=True)]
    return Panel(pairs, level, np.array([0, np.pi]), at_rest=False)


@pytest.mark.parametrize(
    ("half", "level", "label"), [(0.003, 0.6, GOOD), (0.2, 0.53, OPEN), (0.4, 0.48, OPEN), (0.003, 0.4, BAD)]
)
def test_a_peak_that_moves_with_the_number_is_seen_on_all_of_a_panel(half, level, label):
    assert resonance(half, level).label() == label


def test_a_peak_beside_the_middle_of_an_arc_is_seen():
    """The gain is 0.277 at 0.93 and 0.37 at the end of that arc; the last arc has an eigenvalue among the z^M of its circle."""
    arcs = np.array([(0.75, 0.02), (0.93, 0.0115), (0.75, 0.17)])
    assert resonance(1e-6, 0.3)._proved(*arcs.T).tolist() == [True, False, False]
