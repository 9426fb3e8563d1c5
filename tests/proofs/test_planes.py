"""Proof files of maps: each part of a plane with its form, as the checker counts the shares."""

import re
from fractions import Fraction

import numpy as np
import pytest
from support.proofs import changed, checked_file, written

from wavesweep.checker import file
from wavesweep.proofs.planes import SMALLER, Part, lines_of

TANK = """
rates.tick_hz = 10
numbers = { k = 1.0, a = 1.0 }
[block]
tank = { type = "ss", inputs = ["u"], A = [[0]], B = [["a"]], C = [[1]] }
valve = { type = "hold", every = 2 }
[wire]
"tank.u" = "valve.y"
"valve.u" = "-k*tank.y"
[sweep]
along = "k"
k = { start = 1, stop = 20 }
a = { start = 0.5, stop = 2 }
"""  # stable where k a < 10


@pytest.mark.slow
def test_a_map_has_a_proof_of_its_parts(tmp_path, capsys):
    spec = tmp_path / "spec.toml"
    written(tmp_path, TANK, "stability-region", "--no-plot", "--map", "k,a", "--open", "0.03")
    proof = tmp_path / "out" / "stability-map.proof"
    share = re.search(r"forms prove ([\d.]+) % of the area", capsys.readouterr().err)
    written(tmp_path, TANK, "stability-region", "--no-plot", "--map", "k,a", "--open", "0.03", "--overwrite", "--quiet")
    assert not capsys.readouterr().err
    code, said = checked_file(spec, proof)
    assert code == 0, said
    stable, unstable = (float(said.partition(f"% {what}")[0].split()[-1]) for what in ("stable", "1 modes outside"))
    assert stable + unstable == pytest.approx(float(share[1]), abs=0.01)
    assert stable + unstable > 96
    # the area in which k a < 10, of 19 * 1.5: k below 5 with all a, then 10/k
    assert stable == pytest.approx(100 * (4 * 1.5 + 10 * 1.3863 - 15 * 0.5) / (19 * 1.5), abs=3.1)

    signs = []

    def other_count(line):
        if line.get("signs") == "+" and not signs:
            signs.append(line)
            return line | {"signs": "-"}
        return line

    changed(proof, other_count)
    code, said = checked_file(spec, proof)
    assert code == 1, said
    assert "does not decrease" in said


@pytest.mark.slow
def test_what_a_map_leaves_open_stays_open():
    claim = file.Claim("modes", sides={"k": (Fraction(1), Fraction(20)), "a": (Fraction(1, 2), Fraction(2))})
    family = file.family_of(file.spec_of(TANK.encode()), claim)
    whole = np.array([[1.0, 0.5], [20.0, 2.0]])
    assert lines_of(family, ["k", "a"], [Part(whole, None)]) == (0, [{"open": True}])
    share, lines = lines_of(family, ["k", "a"], [Part(whole, 0)])  # which it is not all over
    assert {"open": True} in lines
    assert 0.1 < share < 0.9
    assert sum("L" in line for line in lines) > 1
    assert len(lines) < 2 ** (SMALLER + 2)
