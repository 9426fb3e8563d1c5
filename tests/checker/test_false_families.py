"""A set that was once called proved and is not: what proves a smaller set is refused for it."""

from fractions import Fraction
from functools import partial

import pytest
from support.proofs import checked

pytest.importorskip("wavesweep.proofs", reason="its cells are those that are refused")
from wavesweep.checker import file
from wavesweep.proofs.cells import cell_of, cells_along, tree

# Masses that are constant are stable from 0.0327 to 0.2168 kg; a, a, b, b in turn grow by 1.2077 a frame.
MASSES = """
[rates]
ratio = 10
[device]
damping = 0.3
velocity = "difference"
[environment]
integration = "explicit"
delay = 1
K_VE = 325
B_VE = 2
[controller]
kind = "dc-slow"
[for_all]
"device.mass" = { start = 0.0327, stop = 0.2168 }
"""
ENDS = {"device.mass": ["0.0327", "0.2168"]}


@pytest.mark.slow
def test_masses_that_vary_are_not_proved_by_masses_that_are_constant(tmp_path):
    sides = {name: tuple(map(Fraction, ends)) for name, ends in ENDS.items()}
    claim = file.Claim("for all", sides=sides)
    family = file.family_of(file.spec_of(MASSES.encode()), claim)
    cells = cells_along("device.mass", 0.0327, 0.2168, [], partial(cell_of, family))
    lines = [{"claim": "for all", "sides": ENDS, "states": family.states}, *tree("device.mass", cells)]
    assert checked(tmp_path, MASSES, lines)[0] == 0
    varying = MASSES.replace("0.2168", "0.2168, varying = true")
    code, words = checked(tmp_path, varying, lines)
    assert code == 2
    assert "device.mass varies from frame to frame" in words
