"""The controller of CONTRIBUTING, as a maintainer would add it: right, against a loop drawn as blocks.

The slow wall's held force reaches the device through a first-order low-pass at the fast rate.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from support.drawn import as_blocks
from support.specs import nested, values_of

import wavesweep
from wavesweep.haptics.controllers import CONTROLLERS, Controller

KIND = "dc-filtered"
VALUES = values_of("dc-slow", ratio=8, delay=3, K_VE=120.0, B_VE=0.7, mass=0.12, damping=1.1, lp1_order=1, lp1_cutoff_hz=25.0)
FREE, HELD = VALUES, VALUES | {"operator.stiffness": 300.0, "operator.mass": 0.05}


def code(section):
    """What the first block of Python in a section of CONTRIBUTING defines."""
    text = (Path(__file__).parents[2] / "CONTRIBUTING.md").read_text(encoding="utf-8").split(f"## {section}\n")[1]
    names = {}
    exec(re.search(r"```python\n(.*?)```", text, re.DOTALL)[1], names)  # noqa: S102 - the document's own code
    return names


@pytest.fixture(autouse=True)
def registered(monkeypatch):
    """The line of the registry."""
    description = "direct coupling to the slow wall, whose held force is smoothed"
    monkeypatch.setitem(CONTROLLERS, KIND, Controller(description, code("Add a controller")["dc_smooth"]))


def both(values):
    """The loop of the new kind, and the drawn one."""
    tables = as_blocks(values)
    hand, filtered = tables["ports"]["hand"], {"type": "butterworth", "order": 1, "cutoff_hz": 25.0}
    tables["block"]["smooth"] = filtered
    tables["wire"] |= {"smooth.u": hand["reaction"], "m.f": "f_h - smooth.y"}
    hand["reaction"] = "smooth.y"
    return wavesweep.compile(nested(values | {"controller.kind": KIND})), wavesweep.compile(tables)


@pytest.mark.asks("passive")
@pytest.mark.parametrize("values", [FREE, HELD])
def test_intervals_responses_and_the_port_are_those_of_the_drawn_loop(values):
    own, drawn = both(values)
    assert float(own.spectral_radius()) == pytest.approx(float(drawn.spectral_radius()), rel=1e-10)
    for along, same, span in (
        ("K_VE", "K_VE", (0, 20000)),
        ("B_VE", "B_VE", (0, 50)),
        ("device.damping", "block.m.damping", (0.01, 20)),
    ):
        found, expected = own.stable_intervals(along, span), drawn.stable_intervals(same, span)
        assert found.certified.all()
        np.testing.assert_allclose(found[["low", "high"]], expected[["low", "high"]], rtol=1e-9)
    own, drawn = (loop.with_(K_VE=30.0) for loop in (own, drawn))  # stable with any hand
    found, expected = (loop.response([0.5, 5.0, 40.0, 124.9]) for loop in (own, drawn))
    assert found.stable.all()
    parts = [f"{name}_{part}" for name in ("admittance", "impedance") for part in ("re", "im")]
    np.testing.assert_allclose(found[parts], expected[parts], rtol=1e-8)
    found, expected = own.passivity(), drawn.passivity()
    assert found.channel_passive.all()
    assert found.channel_norm.isna().all()  # without waves there is no channel
    assert found.port_margin[0] == pytest.approx(expected.port_margin[0], rel=1e-6)
    assert own.to_control().ninputs == values["rates.ratio"]
