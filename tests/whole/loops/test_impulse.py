"""What a block corrects once a run, against programs that do so in a line of code."""

import numpy as np
import pytest
from support.exports import made, present, put

import wavesweep
from wavesweep import load
from wavesweep.simulation.export.source import exported

T, M, D, KD = 1e-3, 0.1, 0.2, 2.0
DECAY = np.exp(-D / M * T)


def observer(n, phase=0, **more):
    """An arm behind an observer that predicts in every tick and is corrected in each n-th one."""
    blocks = {
        "arm": {"type": "mass", "mass": M, "damping": D},
        "fix": {"type": "impulse", "every": n, "phase": phase},
        "model": {
            "type": "ss",
            "discrete": True,
            "A": [[1, "dt"], [0, 1 - D / M * T]],
            "B": [[0, 1, 0], [T / M, 0, 1]],
            "C": [[1, 0], [0, 1]],
            "inputs": ["f", "cx", "cv"],
            "outputs": ["x", "v"],
        },
    }
    force = f"-kp*model.x - {KD}*model.v"
    wires = {
        "fix.u": "arm.x - model.x",
        "model.cx": "l*fix.y",
        "model.cv": "8*l*fix.y",
        "model.f": force,
        "arm.f": f"{force} + push",
    }
    return {
        "rates": {"tick_hz": 1 / T},
        "numbers": {"kp": 60.0, "l": 0.5},
        "block": blocks,
        "wire": wires,
        "ports": {"hand": {"force": "push", "displacement": "arm.x"}, "outputs": {"fixed": "fix.y"}},
        "sweep": {"along": "l", "l": {"start": 0, "stop": 4}},
        **more,
    }


def marched(state, push, n, phase, kp, l):
    """States (x, v, and those of the model) after ticks, the positions and the corrections."""
    x, v, xh, vh = state
    rows = []
    for k, f in enumerate(push):
        off = x - xh if k % n == phase else 0.0
        u = -kp * xh - KD * vh
        rows.append((x, off))
        xh, vh = xh + T * vh + l * off, (1 - D / M * T) * vh + T / M * u + 8 * l * off
        a = (f + u) / D
        x, v = x + a * T + (v - a) * (1 - DECAY) * M / D, a + (v - a) * DECAY
    return np.array([x, v, xh, vh]), np.array(rows)


def radius(n, phase, kp, l):
    A = np.stack([marched(unit, np.zeros(n), n, phase, kp, l)[0] for unit in np.eye(4)], -1)
    return np.abs(np.linalg.eigvals(A)).max()


@pytest.mark.parametrize(("n", "phase"), [(1, 0), (4, 0), (10, 3)])
def test_an_observer_that_is_corrected_once_a_run(n, phase):
    loop = wavesweep.compile(observer(n, phase))
    assert loop.spectral_radius() == pytest.approx(radius(n, phase, 60.0, 0.5), rel=1e-9)
    found = loop.stable_intervals()
    assert found.certified.all()
    grid = np.linspace(0, 4, 201)[1:]
    inside = ((grid[:, None] > found.low.to_numpy()) & (grid[:, None] < found.high.to_numpy())).any(1)
    truth = np.array([radius(n, phase, 60.0, l) for l in grid])
    sure = np.abs(truth - 1) > 1e-6
    np.testing.assert_array_equal(inside[sure], truth[sure] < 1)
    push = np.random.default_rng(n).normal(size=300)
    _, expected = marched(np.zeros(4), push, n, phase, 60.0, 0.5)
    np.testing.assert_allclose(loop.simulate(push)[["x", "fixed"]], expected, rtol=0, atol=1e-12)


def test_at_rest_the_mean_of_a_frame_is_felt():
    """A constant push leaves a correction in each frame: the response at 0 Hz is the mean of the march."""
    found = wavesweep.compile(observer(10)).response([0.0])
    _, rows = marched(np.zeros(4), np.ones(20000), 10, 0, 60.0, 0.5)
    assert found.admittance_re[0] == pytest.approx(rows[-10:, 0].mean(), rel=1e-9)
    assert rows[-10, 1] > 1e-4


def test_a_projection_of_a_physics_engine():
    """A body on a rail: Baumgarte's spring in every step, and once in n steps a share s of the error is taken out."""
    n, h, k = 5, 0.01, 900.0
    tables = {
        "rates": {"tick_hz": 100},
        "numbers": {"s": 0.3},
        "block": {
            "v": {"type": "integrator", "method": "implicit"},
            "x": {"type": "integrator", "method": "implicit"},
            "project": {"type": "impulse", "every": n},
        },
        "wire": {"v.u": f"-{k}*prev(x.y)", "project.u": "prev(x.y)", "x.u": "v.y - s*project.y/dt"},
        "sweep": {"along": "s", "s": {"start": -1, "stop": 4}},
    }

    def radius(s):
        A = np.eye(2)
        for i in range(n):
            off = s if i == 0 else 0.0
            step = np.array([[1 - off - h * h * k, h], [-h * k, 1.0]])  # of x and v
            A = step @ A
        return np.abs(np.linalg.eigvals(A)).max()

    found = wavesweep.compile(tables).stable_intervals()
    assert found.certified.all()
    for end in {*found.low, *found.high} - {-1.0, 4.0}:
        assert radius(end) == pytest.approx(1, abs=1e-9)
    middles = (found.low + found.high) / 2
    assert all(radius(s) < 1 for s in middles[found.intervals > 0])


LAST = {
    "rates": {"tick_hz": 100},
    "numbers": {"K": 5.0},
    "block": {
        "m": {"type": "mass", "mass": 1.0, "damping": 4.0},
        "i": {"type": "impulse", "every": 4},
        "b": {"type": "hold", "every": 4},
    },
    "wire": {"i.u": "m.x", "b.u": "K*(i.y + prev(i.y))", "m.f": "push - b.y"},
    "ports": {"inputs": {"push": "push"}, "outputs": {"x": "m.x"}},
    "sweep": {"along": "K", "K": {"start": 0, "stop": 1000}},
}
A_CLASS = {
    "block": {"b": {"type": "hold", "every": 4}},
    "wire": {"b.u": "u"},
    "ports": {"inputs": ["u"], "outputs": {"y": "b.y"}},
}


@pytest.mark.parametrize(
    "more",
    [
        {},
        {"numbers": {"n": 4}, "block": {"b": {"type": "hold", "every": "n"}}},
        {"block": {"b": {"type": "hold", "every": "2*2"}}},
        {"ports": {"outputs": {"seen": "i.y", "x": "m.x"}}},
        {"ports": {"outputs": {"seen": "prev(i.y)", "x": "m.x"}}},
        {"signals": {"e": "i.y", "before": "prev(e)"}, "wire": {"b.u": "K*(e + before)"}},
        {"block": {"watch": {"type": "hold"}}, "wire": {"watch.u": "prev(i.y)"}},
        {"type": {"one": A_CLASS}, "block": {"b": {"type": "one"}}},
    ],
    ids=["as it is", "a number", "an expression", "seen", "seen before", "names", "watched in each tick", "a class"],
)
def test_what_runs_with_an_impulse_reads_its_last_run_however_the_loop_is_written(more):
    tables = dict(LAST)
    for table, keys in more.items():
        tables[table] = LAST.get(table, {}) | keys
    loop = wavesweep.compile(tables)
    e = np.exp(-0.16)  # of the speed, in a frame of 40 ms

    def radius(K):
        """Of position, speed and the last position, held for a frame."""
        moved, force = np.array([1, (1 - e) / 4, 0]), (0.04 - (1 - e) / 4) / 4
        pushed = np.array([force, (1 - e) / 4, 0])
        A = np.array([moved, [0, e, 0], [1, 0, 0]]) - np.outer(pushed, [K, 0, K])
        return abs(np.linalg.eigvals(A)).max()

    assert loop.spectral_radius() == pytest.approx(radius(5.0), rel=1e-9)
    (row,) = loop.stable_intervals().to_dict("records")
    assert (row["low"], row["certified"]) == (0.0, True)
    assert radius(row["high"]) == pytest.approx(1, abs=1e-12)


def test_what_runs_in_other_ticks_reads_what_an_impulse_gave_in_the_tick_before():
    """Also where an axis says whether both run together; and what shows it is 0 between."""
    for n in (2, 4):
        wires = {"b.u": f"K*{'(i.y + prev(i.y))' if n == 4 else 'i.y'}"}
        alone = wavesweep.compile(
            LAST | {"block": LAST["block"] | {"b": {"type": "hold", "every": n}}, "wire": LAST["wire"] | wires}
        )
        tables = LAST | {"numbers": {"K": 5.0, "n": 4}, "block": LAST["block"] | {"b": {"type": "hold", "every": "n"}}}
        found = wavesweep.compile(tables).stable_intervals(n=[n])
        assert found.high[0] == pytest.approx(alone.stable_intervals().high[0], rel=1e-9)
    run = wavesweep.compile(LAST | {"simulate": {"show": ["i.y"]}}).simulate(np.ones(40))
    assert (run["i.y"] != 0).tolist() == [k > 0 and k % 4 == 0 for k in range(40)]


@pytest.mark.slow
def test_no_bit_of_c_differs(tmp_path):
    if "gcc" not in present():
        pytest.skip("no gcc")
    put(exported(load(observer(4, simulate={"input": "noise", "duration_s": 0.2}))), tmp_path)
    code, said = made(tmp_path, "check", "gcc", "-O0")
    assert (code, said[-16:]) == (0, " no bit differs\n"), said
