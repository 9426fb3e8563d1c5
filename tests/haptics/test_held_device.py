"""Which mass of a drawing is the device that a hand holds."""

import pytest

from wavesweep.haptics.held_loop import device_of, held_loop
from wavesweep.program.spec import load
from wavesweep.program.sweep.grid import own_loop


@pytest.mark.parametrize(
    ("kind", "force", "displacement", "held"),
    [
        ("mass", "hand - h.y", "tool.x", "tool"),
        ("inertia", "hand - h.y", "tool.x", "tool"),
        ("mass", "0.5*hand - h.y", "tool.x", None),
        ("mass", "hand - h.y", "2*tool.x", None),
    ],
    ids=["a mass", "an inertia", "half the force", "twice the position"],
)
def test_a_device_is_a_mass_with_all_of_the_force_and_the_position_itself(kind, force, displacement, held):
    tables = {
        "rates": {"tick_hz": 1000},
        "block": {
            "tool": {"type": kind, kind: 0.1, "damping": 1.0},
            "h": {"type": "hold", "every": 2},
        },
        "wire": {"h.u": "100*tool.x", "tool.f": force},
        "ports": {"hand": {"force": "hand", "displacement": displacement, "reaction": "h.y"}},
    }
    assert device_of(own_loop(load(tables)).drawing) == held


@pytest.mark.parametrize("kind", ["mass", "inertia"])
def test_a_hand_on_a_drawn_device_is_a_larger_mass_damping_and_stiffness(kind):
    def loop(**more):
        keys = {kind: 0.1, "damping": 1.0, "stiffness": 2.0}
        keys = {key: value + more.get(key, 0.0) for key, value in keys.items()}
        return {
            "rates": {"tick_hz": 1000},
            "block": {"tool": {"type": kind, **keys}, "h": {"type": "hold", "every": 2}},
            "wire": {"h.u": "100*tool.x", "tool.f": "hand - h.y"},
            "ports": {"hand": {"force": "hand", "displacement": "tool.x"}},
        }

    hand = {"mass": 0.3, "damping": 0.7, "stiffness": 11.0}
    held = held_loop(own_loop(load(loop()))).with_hand()
    held = held.changed({f"operator.{key}": value for key, value in hand.items()})
    heavy = own_loop(load(loop(**{kind if key == "mass" else key: value for key, value in hand.items()})))
    found, right = (each.frames(each.drift()) for each in (held, heavy))
    assert found == pytest.approx(right, rel=1e-12)
