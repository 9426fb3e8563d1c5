"""A delay with taps: its outputs are its input some runs ago, in frames, simulation, balls and C."""

import shutil

import numpy as np
import pytest
from flint import arb
from support.exports import made, present, written

import wavesweep
from wavesweep.program.spec import load


def tables_of(line, feedback, n=5, **more):
    """A mass under a feedback from a delay line that runs every third tick."""
    return {
        "rates": {"tick_hz": 400},
        "numbers": {"K": 1.0, "n": n},
        "block": {"m": {"type": "mass", "mass": 2.0, "damping": 3.0}, "d": line | {"every": 3, "phase": 1}},
        "wire": {"d.u": "m.x", "m.f": f"push - K*({feedback})"},
        "ports": {"inputs": {"push": "push"}},
        "sweep": {"along": "K", "K": {"start": -500, "stop": 500}},
    } | more


TAPPED = {"type": "delay", "taps": [0, 2, "n", 7]}
SUM = "d.y1 + 0.5*d.y2 - 0.3*d.y3 + d.y4"


def plain(n):
    """The same feedback as a filter."""
    weights = np.zeros(8)
    np.add.at(weights, [0, 2, n, 7], [1.0, 0.5, -0.3, 1.0])
    return {"type": "fir", "coefficients": weights.tolist()}


@pytest.mark.parametrize("n", [2, 5, 7])
def test_a_feedback_of_taps_is_that_of_a_filter(n):
    found, expected = (
        wavesweep.compile(each).stable_intervals() for each in (tables_of(TAPPED, SUM, n), tables_of(plain(n), "d.y + 0*n", n))
    )
    assert found.certified.all()
    assert found[["low", "high"]].to_numpy() == pytest.approx(expected[["low", "high"]].to_numpy(), rel=1e-11)


def test_each_tap_shows_the_input_of_so_many_runs_ago():
    shown = {"input": "noise", "duration_s": 0.5, "show": ["d.u"]}
    outputs = {"inputs": {"push": "push"}, "outputs": {f"tap{i}": f"d.y{i}" for i in (1, 2, 3, 4)}}
    (table,) = wavesweep.simulate(tables_of(TAPPED, SUM, ports=outputs, simulate=shown))
    runs, u = table[1::3], table["d.u"].to_numpy()[1::3]
    for i, ago in enumerate((0, 2, 5, 7), 1):
        assert runs[f"tap{i}"].to_numpy() == pytest.approx(np.append(np.zeros(ago), u)[: len(u)], abs=0)


@pytest.mark.asks("prove")
def test_taps_have_the_frame_of_a_filter_in_balls():
    ticks = pytest.importorskip("wavesweep.prove.ticks")
    found = []
    for each in (tables_of(TAPPED, SUM), tables_of(plain(5), "d.y + 0*n")):
        spec = load(each)
        frame, _ = ticks.BallLoop(spec.drawing, spec.values, "numbers.K").frame(arb(0.8))
        found.append([(frame**power).trace() for power in (1, 2, 9)])
    for one, other in zip(*found, strict=True):
        assert float(one) == pytest.approx(float(other), rel=1e-14)


@pytest.mark.slow
@pytest.mark.asks("simulation")
def test_no_bit_of_taps_differs_between_the_simulation_and_c(tmp_path):
    if "gcc" not in present() or not shutil.which("make"):
        pytest.skip("no gcc")
    hand = {"hand": {"force": "push", "displacement": "m.x"}}
    written(tables_of(TAPPED, SUM, ports=hand, simulate={"input": "noise", "duration_s": 0.3}), tmp_path)
    code, said = made(tmp_path, "check", "gcc", "-O0")
    assert (code, said[-16:]) == (0, " no bit differs\n"), said
