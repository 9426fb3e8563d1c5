"""Numbers that several ticks of a frame read: closed in the frame against closed in every tick."""

import numpy as np
import pytest

from wavesweep.engine._loops.from_drawing import FACTOR, PRODUCT
from wavesweep.engine._monodromy import open_ticks
from wavesweep.engine._monodromy.open_ticks import OpenTicks
from wavesweep.engine._monodromy.periodic import frame_of
from wavesweep.engine.loop import Loops
from wavesweep.program.spec import load


def opened(tables, number, batch):
    """The ticks of loops without the number; batch: values of others."""
    spec = load(tables)
    some = dict(spec.values) | {f"numbers.{number}": 1.0} | {f"numbers.{name}": value for name, value in batch.items()}
    return OpenTicks.of(Loops(spec.drawing, some).drawn(number), Loops(spec.drawing, some).drawn(), PRODUCT, FACTOR)


def wheel(readings, direct=0.0):
    """A mass on a spring of stiffness K that is read so many times in a frame of 40 ticks, and on another in every tick."""
    every = 40 // readings
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0, "m": 0.2},
        "block": {
            "m": {"type": "mass", "mass": "m", "damping": 1.0},
            "g": {"type": "ss", "every": every, "A": [[0.5]], "B": [[1.0]], "C": [[0.5]], "D": [[direct]], "discrete": True},
            "h": {"type": "hold", "every": every},
            "slow": {"type": "hold", "every": 40, "phase": 3},
        },
        "wire": {"h.u": "m.x + 0.01*g.y", "g.u": "-K*h.y", "slow.u": "m.x", "m.f": "g.y - 30*m.x - 20*slow.y"},
    }


@pytest.mark.parametrize("direct", [0.0, 0.5])
@pytest.mark.parametrize("readings", [2, 4, 8])
def test_closed_in_the_frame_as_in_every_tick(readings, direct):
    ticks = opened(wheel(readings, direct), "K", {"m": np.array([0.1, 0.3, 0.9])})
    assert ticks.frame is not None
    p = np.array([[-20.0, 3.0, 80.0, 700.0 + 30.0j]])
    E, *facts = ticks.frames(np.arange(3)[:, None], p)
    whole = ticks.closed(np.arange(3)[:, None], p)
    expected = frame_of(whole)
    np.testing.assert_allclose(E, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    for found, each in zip(facts, whole.facts, strict=True):
        assert np.array_equal(*np.broadcast_arrays(found, each))


def test_frames_whose_terms_cancel_are_closed_in_the_ticks(monkeypatch):
    """An unstable plant without its controller: what the gain takes away in the frame is far larger than what remains."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0},
        "block": {
            "m": {"type": "mass", "mass": 1.0, "damping": 0.0, "stiffness": -1.0e6},
            "h": {"type": "hold", "every": 10},
            "slow": {"type": "hold", "every": 20},
        },
        "wire": {"h.u": "K*m.x + 0.001*K*m.v", "slow.u": "m.x", "m.f": "-h.y - 0.1*slow.y"},
    }
    ticks, p = opened(tables, "K", {}), np.array([1.0e6, 0.0])
    expected = frame_of(ticks.closed(0, p))
    E, *_ = ticks.frames(0, p)
    assert np.array_equal(E[0], expected[0])
    monkeypatch.setattr(open_ticks, "CANCELS", np.inf)
    E, *_ = ticks.frames(0, p)
    assert not np.array_equal(E[0], expected[0])


def test_without_a_solution_of_direct_terms_there_is_no_frame():
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"c": 0.1},
        "block": {"m": {"type": "mass", "mass": 0.1, "damping": 1.5}, "g": {"type": "gain", "every": 2}},
        "wire": {"g.u": "c*g.y + m.v", "m.f": "-g.y"},
    }
    ticks = opened(tables, "c", {})
    assert ticks.frame is not None
    E, pivot, _ = ticks.frames(0, np.array([1.0, 0.5]))
    assert not np.isfinite(E[0]).all()
    assert np.isfinite(E[1]).all()
    assert pivot[0] == 0
