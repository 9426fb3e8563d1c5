"""What a block corrects once a run, against the interpreter of the documents."""

import numpy as np
import pytest
from meaning.judge import compiled, judge
from meaning.specs import toml
from support.exports import made, present, put

import wavesweep
from wavesweep import load
from wavesweep.simulation.export.source import exported

DECAY = 1 - 2 * 1e-3  # of the observer's speed in a tick


def observer(n, phase=0, **more):
    """An arm behind an observer that predicts in every tick and is corrected in each n-th one."""
    blocks = {
        "arm": {"type": "mass", "mass": 0.1, "damping": 0.2},
        "fix": {"type": "impulse", "every": n, "phase": phase},
        "model": {
            "type": "ss",
            "discrete": True,
            "A": [[1, "dt"], [0, DECAY]],
            "B": [[0, 1, 0], [0.01, 0, 1]],
            "C": [[1, 0], [0, 1]],
            "inputs": ["f", "cx", "cv"],
            "outputs": ["x", "v"],
        },
    }
    force = "-kp*model.x - 2*model.v"
    wires = {"fix.u": "arm.x - model.x", "model.cx": "l*fix.y", "model.cv": "8*l*fix.y", "model.f": force}
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 60.0, "l": 0.5},
        "block": blocks,
        "wire": wires | {"arm.f": f"{force} + push"},
        "ports": {"hand": {"force": "push", "displacement": "arm.x"}, "outputs": {"fixed": "fix.y"}},
        "sweep": {"along": "l", "l": {"start": 0, "stop": 4}},
        **more,
    }


# A body on a rail in a physics engine: Baumgarte's spring in every step, and once in five a share s of the error is taken out.
PROJECTION = {
    "rates": {"tick_hz": 100},
    "numbers": {"s": 0.3},
    "block": {
        "body": {"type": "mass", "mass": 1.0, "damping": 4.0},
        "v": {"type": "integrator", "method": "implicit"},
        "x": {"type": "integrator", "method": "implicit"},
        "project": {"type": "impulse", "every": 5},
    },
    "wire": {"v.u": "-900*prev(x.y)", "project.u": "prev(x.y)", "x.u": "v.y - s*project.y/dt", "body.f": "push - body.x"},
    "ports": {"hand": {"force": "push", "displacement": "body.x"}, "outputs": {"error": "x.y"}},
    "sweep": {"along": "s", "s": {"start": -1, "stop": 4}},
}
LAST = {
    "rates": {"tick_hz": 100},
    "numbers": {"K": 5.0},
    "block": {
        "m": {"type": "mass", "mass": 1.0, "damping": 4.0},
        "i": {"type": "impulse", "every": 4},
        "b": {"type": "hold", "every": 4},
    },
    "wire": {"i.u": "m.x", "b.u": "K*(i.y + prev(i.y))", "m.f": "push - b.y"},
    "ports": {"hand": {"force": "push", "displacement": "m.x"}},
    "sweep": {"along": "K", "K": {"start": 0, "stop": 1000}},
}
A_CLASS = {
    "block": {"b": {"type": "hold", "every": 4}},
    "wire": {"b.u": "u"},
    "ports": {"inputs": ["u"], "outputs": {"y": "b.y"}},
}


def last(**more):
    return LAST | {table: LAST.get(table, {}) | keys for table, keys in more.items()}


@pytest.mark.parametrize(
    "tables",
    {
        "in each tick": observer(1),
        "once in four": observer(4),
        "once in ten": observer(10, 3),
        "a projection": PROJECTION,
        "as it is": LAST,
        "a number": last(numbers={"n": 4}, block={"b": {"type": "hold", "every": "n"}}),
        "in other ticks": last(numbers={"n": 2}, block={"b": {"type": "hold", "every": "n"}}),
        "an expression": last(block={"b": {"type": "hold", "every": "2*2"}}),
        "seen": last(ports={"outputs": {"seen": "i.y"}}),
        "seen before": last(ports={"outputs": {"seen": "prev(i.y)"}}),
        "names": last(signals={"e": "i.y", "before": "prev(e)"}, wire={"b.u": "K*(e + before)"}),
        "watched in each tick": last(block={"watch": {"type": "hold"}}, wire={"watch.u": "prev(i.y)"}),
        "a class": last(type={"one": A_CLASS}, block={"b": {"type": "one"}}),
    }.items(),
    ids=lambda item: item[0],
)
def test_what_is_corrected_once_a_run_is_so_however_the_loop_is_written(tables, tmp_path):
    text = toml(tables[1])
    found = judge(text, compiled(text, tmp_path), required=False)
    assert [one for one in found if not one.same] == []
    assert {"radius", "high end"} <= {one.what for one in found}


def test_what_shows_an_impulse_is_0_between_its_runs_and_an_axis_says_whether_both_run_together():
    for n in (2, 4):
        tables = last(numbers={"n": 4}, block={"b": {"type": "hold", "every": "n"}})
        alone = wavesweep.compile(tables | {"numbers": {"K": 5.0, "n": n}}).stable_intervals()
        assert wavesweep.compile(tables).stable_intervals(n=[n]).high[0] == pytest.approx(alone.high[0], rel=1e-9)
    run = wavesweep.compile(LAST | {"simulate": {"show": ["i.y"]}}).simulate(np.ones(40))
    assert (run["i.y"] != 0).tolist() == [k > 0 and k % 4 == 0 for k in range(40)]


@pytest.mark.slow
def test_no_bit_of_c_differs(tmp_path):
    if "gcc" not in present():
        pytest.skip("no gcc")
    put(exported(load(observer(4, simulate={"input": "noise", "duration_s": 0.2}))), tmp_path)
    code, said = made(tmp_path, "check", "gcc", "-O0")
    assert (code, said[-16:]) == (0, " no bit differs\n"), said
