"""Ticks that no block needs are divided out of a drawn loop, and only these."""

import pytest

import wavesweep
from wavesweep.engine._loops.common_tick import with_common_tick
from wavesweep.engine._loops.from_drawing import assembled
from wavesweep.program.spec import load

LAG = {"type": "tf", "num": [1], "den": [0.2, 1]}
PI = {"type": "pi", "kp": "k", "ki": 2.0, "every": 20}


def loop(blocks, wires, **numbers):
    """A lag of 0.2 s with a controller of 20 ms, on ticks of 1 ms."""
    own = {"lag": LAG, "pi": PI} | blocks
    return {"rates": {"tick_hz": 1000}, "numbers": {"k": 1.0} | numbers, "block": own, "wire": wires}


LATE = {"late": {"type": "delay", "seconds": "tau"}}
FED_BACK = {"pi.u": "-lag.y", "late.u": "pi.y", "lag.u": "late.y"}
SENSOR = {"sensor": {"type": "hold", "every": 20, "phase": 8}}
LINE = {"line": {"type": "delay", "steps": 40}}
CASES = {  # blocks, wires, numbers, and the ticks of a frame that are left
    "held": ({}, {"pi.u": "-lag.y", "lag.u": "pi.y"}, {}, 1),
    "arriving late": (LATE, FED_BACK, {"tau": 0.0437}, 1),
    "read late": (LATE, {"pi.u": "-late.y", "late.u": "lag.y", "lag.u": "pi.y"}, {"tau": 0.0437}, 1),
    "phases": (SENSOR, {"pi.u": "-sensor.y", "sensor.u": "lag.y", "lag.u": "pi.y"}, {}, 5),
    "steps": (LINE, {"pi.u": "-line.y", "line.u": "lag.y", "lag.u": "pi.y"}, {}, 1),
    "steps and a gain": (
        LINE | {"g": {"type": "gain", "k": 0.5}},
        {"pi.u": "-lag.y", "g.u": "pi.y", "line.u": "g.y", "lag.u": "line.y"},
        {},
        1,
    ),
    "sampled in every tick": ({}, {"pi.u": "-lag.y", "lag.u": "pi.y - 0.5*lag.y"}, {}, 20),
    "by a gain": ({"g": {"type": "gain", "k": -0.5}}, {"pi.u": "-lag.y", "g.u": "lag.y", "lag.u": "pi.y + g.y"}, {}, 20),
    "late, in every tick": (LATE, FED_BACK | {"lag.u": "late.y", "late.u": "pi.y - 0.5*lag.y"}, {"tau": 0.0437}, 20),
    "an odd step": ({"line": {"type": "delay", "steps": 43}}, {"pi.u": "-line.y", "line.u": "lag.y", "lag.u": "pi.y"}, {}, 20),
    "a filter of every tick": (
        {"low": {"type": "lowpass", "a": 0.3}},
        {"pi.u": "-low.y", "low.u": "lag.y", "lag.u": "pi.y"},
        {},
        20,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_ends_are_those_of_the_ticks_that_are_drawn(name):
    """The spectral radius is computed tick by tick as drawn."""
    blocks, wires, numbers, left = CASES[name]
    tables = loop(blocks, wires, **numbers)
    spec, compiled = load(tables), wavesweep.compile(tables)
    assert assembled(*with_common_tick(spec.drawing, spec.values)).ticks == left
    rows = compiled.stable_intervals(along="k", span=(0.0, 200.0))
    high = rows["high"][0]
    assert rows["certified"].all()
    assert high < 200
    below, above = compiled.spectral_radius(k=[high * (1 - 1e-6), high * (1 + 1e-6)])
    assert below < 1 < above
