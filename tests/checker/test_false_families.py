"""Two sets that were once called proved and are not: what proves a smaller set, or another one, is refused for them."""

from fractions import Fraction
from functools import partial

import pytest
from checker.test_messages import BEHIND, proof_of
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


@pytest.mark.parametrize("written", ["seconds = 0.05", "steps = 5"])
def test_a_dead_time_behind_losses_is_taken_whole(written, tmp_path):
    spec = BEHIND.replace("seconds = 0.05", written)
    assert checked(tmp_path, spec, proof_of(spec, "14.2", "s"))[0] == 0
    shorter = spec.replace("0.05", "0.03").replace("= 5", "= 3")
    false = proof_of(shorter, "15.4692", "s")
    assert checked(tmp_path, shorter, false)[0] == 0
    code, words = checked(tmp_path, spec, false)
    assert code == 1
    assert "REFUSED: all that [for_all] and its channels allow, s = 15.4692" in words
