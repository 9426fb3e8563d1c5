"""Guarantees for hands of loops that a spec draws: those of the same loops built in, and what is refused."""

import numpy as np
import pytest
from scipy.signal import cont2discrete

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


@pytest.mark.parametrize(
    ("hand", "box", "port"),
    [
        ("passive", None, False),
        ("free", None, True),
        ("box", BOX, False),
    ],
)
@pytest.mark.slow
def test_an_inertia_has_the_guarantees_of_a_mass(hand, box, port):
    turned = drawn(4, "speed.y")
    turned["block"] = turned["block"] | {"device": {"type": "inertia", "inertia": "m", "damping": 3.0}}
    found, expected = (rows_of(tables, hand, box, port) for tables in (turned, drawn(4, "speed.y")))
    assert expected["high"].item() > 0
    for name in ("low", "high", "certified"):
        assert found[name].tolist() == expected[name].tolist()


@pytest.mark.slow
@pytest.mark.sample(1)
@pytest.mark.parametrize("ratio", [1, 4])
@pytest.mark.parametrize(("hand", "port"), [("passive", False), ("free", True)])
def test_a_drawn_loop_has_the_guarantees_of_the_built_in_one(ratio, hand, port):
    found, expected = (rows_of(spec, hand, port=port) for spec in (drawn(ratio, "speed.y"), built_in(ratio)))
    for name in ("low", "high", "high_omega", "felt_high"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-6, err_msg=name)
    assert found["certified"].tolist() == expected["certified"].tolist() == [True]


@pytest.mark.slow
@pytest.mark.parametrize("number", ["B", "m"])
def test_a_box_goes_along_any_number(number):
    span = {"start": 0.01, "stop": 1.0}
    found = rows_of(drawn(5, "device.v", sweep={"along": number, number: span, "K": [100.0]}), "box", BOX)
    assert found["intervals"].tolist() == [1]
    assert found["settled"].tolist() == [True]


def test_the_damping_that_a_drawn_device_needs_is_that_of_the_built_in_one():
    found = passivity(load(drawn(20, "speed.y"))).columns["damping_needed"]
    assert found == pytest.approx(passivity(built_in(20)).columns["damping_needed"], rel=2e-3)
    assert found > 0


FAR = {
    "rates": {"tick_hz": 500},
    "numbers": {"K": 50.0, "dm": 2.0},
    "block": {
        "master": {"type": "mass", "mass": 0.3, "damping": "dm"},
        "slave": {"type": "mass", "mass": 0.6, "damping": 2.0, "stiffness": 300.0},
        "there": {"type": "delay", "steps": 3},
        "back": {"type": "delay", "steps": 3},
    },
    "signals": {"felt": "K*(master.x - back.y)"},
    "wire": {"there.u": "master.x", "back.u": "slave.x", "slave.f": "500*(there.y - slave.x)", "master.f": "hand - felt"},
    "ports": {"hand": {"force": "hand", "displacement": "master.x", "reaction": "felt"}},
    "sweep": {"along": "K", "K": {"start": 0, "stop": 2000}},
}


@pytest.mark.slow
@pytest.mark.parametrize("port", [False, True])
def test_the_frequency_of_an_end_is_that_at_which_a_hand_takes_energy(port):
    """Where Colgate and Schenkel's `T Re((1 - 1/z) H(z))/(2 - 2 cos(w T))` is largest, which is between points of a grid."""
    T = 1 / 500
    num, den, _ = cont2discrete(([500.0], [0.6, 2.0, 300.0]), T)
    omega = np.linspace(30, 50, 200_001)
    z = np.exp(1j * omega * T)
    H = 1 - z**-6 * np.polyval(num[0], z) / np.polyval(den + num[0], z)
    needed = T * ((1 - 1 / z) * H).real / (2 - 2 * np.cos(omega * T))
    row = rows_of(FAR, "free" if port else "passive", port=port)
    assert row["high_omega"] == pytest.approx(omega[needed.argmax()], rel=1e-4)
    assert row["high"] == pytest.approx(2 / needed.max(), rel=1e-3)
