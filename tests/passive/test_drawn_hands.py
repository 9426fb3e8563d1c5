"""Guarantees for hands of loops that a spec draws: those of the same loops built in, and what is refused."""

import numpy as np
import pytest

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.passive.table import passivity
from wavesweep.program.spec import load
from wavesweep.program.tables.hand_rows import hands_of
from wavesweep.program.tables.interval_table import intervals

BOX = {"mass": (0.05, 0.1), "damping": (3.0, 4.0), "stiffness": (300.0, 400.0)}
SPAN = {"start": 0, "stop": 20000}


def drawn(every, velocity, **more):
    """Direct coupling to a wall that runs every so many ticks."""
    tables = {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 500.0, "B": 1.0, "m": 0.1},
        "block": {
            "device": {"type": "mass", "mass": "m", "damping": 3.0},
            "speed": {"type": "difference"},
            "wall": {"type": "hold", "every": every},
        },
        "wire": {"speed.u": "device.x", "wall.u": f"K*device.x + B*{velocity}", "device.f": "hand - wall.y"},
        "ports": {"hand": {"force": "hand", "displacement": "device.x"}, "wall": {"stiffness": "K", "damping": "B"}},
        "sweep": {"K": SPAN},
    }
    return tables | more


def built_in(ratio, velocity="difference"):
    own = {"device": {"damping": 3.0, "velocity": velocity}, "rates": {"ratio": ratio}, "sweep": {"K_VE": SPAN}}
    return load({"controller": {"kind": "dc-slow"}, "environment": {"B_VE": 1.0}} | own)


def rows_of(spec, hand, box=None, port=False):
    ranges = ",".join(f"{name}={low}..{high}" for name, (low, high) in (box or {}).items())
    words = "port" if port else f"{hand}:{ranges}" if box else hand
    found = intervals(load(spec) if isinstance(spec, dict) else spec, hands=hands_of(words)).columns
    own = "port" if port else hand
    return {name: column[found["hand"] == own] for name, column in found.items()}


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize("ratio", [1, 4])
@pytest.mark.parametrize(("hand", "port"), [("passive", False), ("free", True)])
def test_a_drawn_loop_has_the_guarantees_of_the_built_in_one(ratio, hand, port):
    found, expected = (rows_of(spec, hand, port=port) for spec in (drawn(ratio, "speed.y"), built_in(ratio)))
    for name in ("low", "high", "high_omega", "felt_high"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-6, err_msg=name)
    assert found["certified"].tolist() == expected["certified"].tolist() == [True]


@pytest.mark.thorough
def test_a_box_of_hands_is_proved_for_a_drawn_loop_too():
    found, expected = (rows_of(spec, "box", BOX) for spec in (drawn(20, "device.v"), built_in(20, "exact")))
    for name in ("high", "high_hand_mass", "high_hand_damping", "high_hand_stiffness"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, err_msg=name)
    assert found["settled"].all()


@pytest.mark.slow
@pytest.mark.parametrize("number", ["B", "m"])
def test_a_box_goes_along_any_number(number):
    span = {"start": 0.01, "stop": 1.0}
    found = rows_of(drawn(5, "device.v", sweep={"along": number, number: span, "K": [100.0]}), "box", BOX)
    assert found["intervals"].tolist() == [1]
    assert found["settled"].tolist() == [True]


@pytest.mark.slow
@pytest.mark.asks("for_all")
@pytest.mark.thorough
def test_what_a_hand_cannot_hold_is_refused():
    sampled = drawn(4, "device.v")
    with pytest.raises(UsageError, match=r"expected that nothing reads device\.v"):
        rows_of(sampled, "passive")
    both = drawn(4, "speed.y")
    both["wire"]["wall.u"] += " + 0.1*hand"
    with pytest.raises(UsageError, match="one block mass"):
        rows_of(both, "box", {})
    assert rows_of(both, "free", port=True)["intervals"].size
    none = drawn(4, "speed.y", ports={"wall": {"stiffness": "K", "damping": "B"}})
    none["wire"]["device.f"] = "-wall.y"
    with pytest.raises(SpecError, match="hand"):
        rows_of(none, "free", port=True)


def test_the_damping_that_a_drawn_device_needs_is_that_of_the_built_in_one():
    found = passivity(load(drawn(20, "speed.y"))).columns["damping_needed"]
    assert found == pytest.approx(passivity(built_in(20)).columns["damping_needed"], rel=2e-3)
    assert found > 0
