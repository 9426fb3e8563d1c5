"""`wavesweep passivity` from the spec to its files."""

import json

import numpy as np
import pytest
from support.held import more_damping, port_margin
from support.specs import values_of

from wavesweep.passive.table import PassivityTally

pytestmark = pytest.mark.slow

SPEC = """
[controller]
kind = "pmw"
[sweep]
filters.lp1.order = [1, 2, 4]
Kp = [0, 20]
K_VE = { start = 0, stop = 2000 }
"""


@pytest.fixture
def filters(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "filters.toml").write_text(SPEC)
    return "filters.toml"


def test_the_damping_needed_makes_the_port_passive():
    """With it, and not with a hundredth less."""
    values = values_of("pmw", velocity="difference", Kp=20.0, ratio=5)
    needed = float(more_damping(values))
    assert needed > 0
    for factor, passive in ((1.0, True), (0.99, False)):
        assert port_margin(values | {"device.damping": 1.5 + factor * needed}).passive == passive


def test_margins_that_are_lost_are_counted(wavesweep, tmp_path):
    """The impedance of a wave line without hold or delay cancels in the tick."""
    path = tmp_path / "line.toml"
    path.write_text("""
rates.tick_hz = 1000
numbers = { K = 3000.0, b = 1.0 }
block.device = { type = "mass", mass = 0.1, damping = 1.5 }
block.end = { type = "wave", b = "b" }
block.avatar = { type = "avatar", b = "b", integration = "explicit" }
ports.hand = { force = "hand", displacement = "device.x", reaction = "end.force" }
sweep.b = [1.0, 1e10]
[wire]
"end.v" = "device.v"
"end.in" = "avatar.out"
"avatar.in" = "end.out"
"avatar.f" = "K*avatar.x_spring + 1*avatar.v"
"device.f" = "hand - end.force"
""")
    to_out = ("passivity", str(path), "--out", str(tmp_path / "out"), "--no-plot")
    code, _, err = wavesweep(*to_out)
    assert code == 0
    assert "margin lost in rounding or overflow, and not known to be passive: 1 row" in err
    _, out, _ = wavesweep(*to_out, "--json")
    assert json.loads(out)["tables"]["passivity"]["margin_unknown"] == 1


def test_the_tolerance_is_one_of_energy_and_not_of_amplitude():
    """A norm of 1.0007 adds 0.14 % of energy, more than a tolerance of 0.1 %."""
    facts = {"tolerance": 1e-3, "methods": ["damping_needed"], "slices": {"computed": 2, "certified": 2}, "spec": {}}
    rows = {"channel_norm": np.array([1.0007, 1.0004]), "channel_passive": np.zeros(2, bool), "port_margin": np.zeros(2)}
    rows |= {"port_passive": np.ones(2, bool), "stable": np.ones(2, bool), "damping_needed": np.zeros(2)}
    tally = PassivityTally(facts)
    tally.add(rows)
    assert tally.numbers(facts)["channel_passive_within_tolerance"] == 1
