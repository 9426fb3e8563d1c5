"""Delays in series with a gain, a factor on the circle: against closed forms, and against the same delays as states."""

import numpy as np
import pytest
import scipy

import wavesweep
from wavesweep.engine._drawing import delays_in_series
from wavesweep.engine._drawing.delays_in_series import without_whole_frames
from wavesweep.engine._search import open_loops
from wavesweep.program.sweep.grid import own_loop


def drawn(blocks, wires):
    return {"rates": {"tick_hz": 1000}, "numbers": {"K": 1.0}, "block": blocks, "wire": wires}


def delay(steps, **keys):
    return {"type": "delay", "steps": steps, **keys}


MASS = {"type": "mass", "mass": 0.2, "damping": 2.0}
SPRUNG = {"type": "mass", "mass": 0.3, "damping": 2.0, "stiffness": 40.0}
SUM = {"type": "tf", "num": [1.0], "den": [1.0, -1.0], "discrete": True}
LOW_PASS = {"type": "butterworth", "order": 3, "cutoff_hz": 30.0}
HOLD = {"type": "hold", "every": 6}
FORCE = {"mass.f": "-K*d.y"}


@pytest.mark.parametrize("steps", [21, 64, 333, 1000])
def test_a_sum_behind_a_delay_is_stable_as_levin_and_may_say(steps):
    """y[k+1] = y[k] - K y[k-d] is stable for 0 < K < 2 sin(pi/(2 (2 d + 1))) (S. A. Levin, R. M. May, 1976)."""
    loop = wavesweep.compile(drawn({"s": SUM, "d": delay(steps)}, {"d.u": "s.y", "s.u": "-K*d.y"}))
    table = loop.stable_intervals("K", (-0.5, 1))
    assert table.certified.all()
    assert table.low.tolist() == [0.0]
    np.testing.assert_allclose(table.high, 2 * np.sin(np.pi / (2 * (2 * steps + 1))), rtol=1e-13)


def edge_behind_ticks(ticks, hold, rate):
    """The end of K of `x' = -K x` behind so many ticks and a hold of `hold` ticks, ticks = q hold + r:

    (z - 1) z^(q+1) + K T ((hold - r) z + r) = 0, of which K is real first where the angles add up to half a turn.
    """
    q, r = divmod(ticks, hold)

    def over(theta):
        return (np.pi + theta) / 2 + (q + 1) * theta - np.angle((hold - r) * np.exp(1j * theta) + r) - np.pi

    theta = scipy.optimize.brentq(over, 0, np.pi / (2 * q + 1), xtol=1e-16, rtol=1e-15)
    return rate * 2 * np.sin(theta / 2) / abs((hold - r) * np.exp(1j * theta) + r)


@pytest.mark.parametrize(("ticks", "hold"), [(100, 3), (401, 2), (997, 7)])
def test_a_delay_may_stand_on_either_side_of_a_slower_hold(ticks, hold):
    """Before it, behind it, and 31 ticks behind and the rest before: but for a shift of time all three are the loop of
    `edge_behind_ticks`. Certified from 0 on."""
    wires = [{"d.u": "x.y", "h.u": "d.y", "x.u": "-K*h.y"}, {"h.u": "x.y", "d.u": "h.y", "x.u": "-K*d.y"}]
    wires.append({"d.u": "x.y", "h.u": "d.y", "e.u": "h.y", "x.u": "-K*e.y"})
    for way in wires:
        split = 31 if "e.u" in way else 0
        blocks = {"x": {"type": "tf", "num": [1.0], "den": [1.0, 0.0]}, "d": delay(ticks - split)}
        blocks["h"] = {"type": "hold", "every": hold, "phase": 1}
        if split:
            blocks["e"] = delay(split)
        table = wavesweep.compile(drawn(blocks, way)).stable_intervals("K", (0, 100))
        assert table.certified.all()
        assert table.low.tolist() == [0.0]
        np.testing.assert_allclose(table.high, edge_behind_ticks(ticks, hold, 1000), rtol=1e-11)


IN_SERIES = {
    "behind a mass": drawn({"mass": MASS, "d": delay(45)}, {"d.u": "mass.x", **FORCE}),
    "before a mass": drawn({"mass": SPRUNG, "d": delay(30)}, {"d.u": "K*mass.v + K*mass.x", "mass.f": "-d.y"}),
    "two": drawn(
        {"mass": MASS, "f": LOW_PASS, "d": delay(25), "e": delay(9)}, {"d.u": "f.y", "f.u": "e.y", "e.u": "mass.x", **FORCE}
    ),
    "before a hold": drawn(
        {"mass": MASS, "d": delay(130), "h": {"type": "hold", "every": 4}}, {"d.u": "mass.x", "h.u": "d.y", "mass.f": "-K*h.y"}
    ),
    "in uneven phases": drawn(
        {"mass": SPRUNG, "h": HOLD | {"every": 2, "phase": 1}, "d": delay(300), "e": delay(9, every=3, phase=2), "s": HOLD},
        {"h.u": "mass.x", "d.u": "h.y", "e.u": "d.y", "s.u": "e.y", "mass.f": "-K*s.y"},
    ),
    "in slower ticks": drawn(
        {"mass": SPRUNG, "f": LOW_PASS, "h": {"type": "hold", "every": 6}, "d": delay(48, every=3)},
        {"f.u": "mass.x", "d.u": "f.y", "h.u": "d.y", "mass.f": "-K*h.y"},
    ),
    "a gain": drawn(
        {"mass": MASS, "d": delay(40), "g": {"type": "gain", "k": "K"}}, {"d.u": "mass.x", "g.u": "d.y", "mass.f": "-g.y"}
    ),
    "a dead time": drawn({"mass": MASS, "d": {"type": "delay", "seconds": 0.0324}}, {"d.u": "K*mass.x", "mass.f": "-d.y"}),
    "an unstable loop": drawn({"mass": {**MASS, "stiffness": -3.0}, "d": delay(50)}, {"d.u": "mass.x", **FORCE}),
}


def both_ways(monkeypatch, tables, along, span, **asked):
    """The table of intervals with the delay on the circle, and with the delay as states."""
    shapes = []
    of_cut = open_loops.cut_of
    monkeypatch.setattr(
        open_loops, "cut_of", lambda frame, *rest, **more: shapes.append(frame.E.shape) or of_cut(frame, *rest, **more)
    )
    found = []
    for few in (delays_in_series.FEW_FRAMES, np.inf):
        monkeypatch.setattr(delays_in_series, "FEW_FRAMES", few)
        open_loops.remembered_loops.cache_clear()
        open_loops.remembered_slices.cache_clear()
        found.append(wavesweep.compile(tables).stable_intervals(along, span, **asked))
    open_loops.remembered_loops.cache_clear()
    open_loops.remembered_slices.cache_clear()
    assert shapes[0][-1] < 20 < shapes[-1][-1]
    return found


def assert_same(found, whole):
    assert found.certified.all()
    assert whole.certified.all()
    assert len(found) == len(whole)
    for column in ("low", "high", "low_omega", "high_omega"):
        np.testing.assert_allclose(found[column], whole[column], rtol=1e-12, atol=1e-12)


SMALLER = {"radius": 0.9997}
ON_SMALLER = ("before a hold", "a dead time", "an unstable loop")


@pytest.mark.parametrize(
    ("name", "require"),
    [
        *((name, None) for name in IN_SERIES),
        *(pytest.param(name, SMALLER, marks=pytest.mark.asks("require")) for name in ON_SMALLER),
    ],
)
def test_intervals_are_those_of_the_delay_as_states(monkeypatch, name, require):
    """Also on a smaller circle, and along negative values."""
    assert_same(*both_ways(monkeypatch, IN_SERIES[name], "K", (-20, 80), require=require))


BEFORE_BOTH = {"d.u": "K*mass.x + B*mass.v", "mass.f": "-d.y"}
BEHIND_BOTH = {"d.u": "mass.x", "v.u": "d.y", "mass.f": "-K*d.y - B*v.y"}


@pytest.mark.parametrize(
    ("plant", "wires"), [(MASS, BEFORE_BOTH), (SPRUNG, BEFORE_BOTH), (MASS, BEHIND_BOTH)], ids=["mass", "spring", "difference"]
)
@pytest.mark.parametrize(
    ("along", "span", "axes"),
    [("K", (0, 60), {}), ("K", (-20, 60), {"B": [0.0, 1.0, 30.0]}), ("B", (-3, 5), {"K": [0.0, 2.0, 300.0]})],
)
def test_two_numbers_of_a_wire_are_late_together(monkeypatch, plant, wires, along, span, axes):
    """Where the one that is fixed acts through the delay as well, and is stable without the other, or is not."""
    blocks = {"mass": plant, "d": delay(40)} | ({"v": {"type": "difference"}} if wires is BEHIND_BOTH else {})
    tables = drawn(blocks, wires)
    tables["numbers"] |= {"B": 0.5}
    axes = {name: np.array(values) for name, values in axes.items()}
    assert_same(*both_ways(monkeypatch, tables, along, span, **axes))


def frames_taken(tables, number="K"):
    loops = own_loop(wavesweep.compile(tables).spec, f"numbers.{number}")
    return without_whole_frames(loops.drawing, loops.values, number)[2]


def test_whole_frames_are_taken_where_every_way_passes_the_delay_once():
    """Of a delay of 130 ticks in frames of 4, 32 less one that it keeps; none where a way leads past it, or back to it
    without the number."""
    assert frames_taken(IN_SERIES["before a hold"]) == 31
    assert frames_taken(IN_SERIES["in slower ticks"]) == 23  # 48 steps of 3 ticks are 24 frames of 6, less one
    assert frames_taken(IN_SERIES["two"]) == 24 + 8
    late = {"mass": MASS, "d": delay(90)}
    past = drawn(late, {"d.u": "mass.x", "mass.f": "-K*d.y - K*mass.v"})
    back = drawn(late, {"d.u": "mass.x", "mass.f": "-K*d.y - 3*d.y"})
    beside = drawn({**late, "e": delay(90)}, {"d.u": "mass.x", "e.u": "mass.v", "mass.f": "-K*d.y - 3*e.y"})
    short = drawn({"mass": MASS, "d": delay(21)}, {"d.u": "mass.x", **FORCE})  # 20 frames, which are few
    outside = drawn(late, {"d.u": "mass.x", "mass.f": "-K*mass.x"})  # the delay is in no loop
    assert [frames_taken(tables) for tables in (past, back, short, outside)] == [0, 0, 0, 0]
    assert frames_taken(beside) == 89  # 3 goes past the delay of K, and is no way from K to it
