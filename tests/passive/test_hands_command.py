"""`--for-hands` of the commands that find stable intervals."""

import json

import numpy as np
import pytest

from wavesweep.program import results

SPEC = """
[device]
velocity = "difference"
damping = 3.0
[operator]
mass = 0.2
damping = 5.0
[controller]
kind = "dc"
[sweep]
K_VE = { start = 0, stop = 20000 }
B_VE = [0, 1]
"""
FELT = ",felt_low,felt_high"
PLAIN = f"B_VE,along,intervals,interval,low,high,low_omega,high_omega,certified,residual,doubt{FELT}"
WITH_HANDS = PLAIN.replace("along,", "along,hand,")
ENDS = [f"{end}_hand_{part}" for end in ("low", "high") for part in ("mass", "damping", "stiffness")]


@pytest.fixture
def held(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "held.toml").write_text(SPEC)
    return "held.toml"


@pytest.mark.slow
def test_the_box_is_told_beside_its_hands(wavesweep, held, tmp_path):
    box = ("--for-hands", "box:mass=0.1..0.2, stiffness=100..100", "--set", "sweep.B_VE=[1]")
    code, _, err = wavesweep("zwidth", held, *box, "--out", "results/held", "--no-plot")
    assert code == 0
    text = (tmp_path / "results/held/zwidth-hands.csv").read_text()
    assert text.startswith(",".join([WITH_HANDS.removesuffix(FELT), *ENDS, f"settled{FELT}"]))
    table = results.read(tmp_path / "results/held/zwidth-hands.parquet")
    box = table["hand"] == "box"
    assert table["high_hand_stiffness"][box].tolist() == [100]
    assert np.isnan(table["high_hand_mass"][~box]).all()
    assert " (box):\n" in err
    assert " ended by a hand of 0.1 kg, 2 N*s/m, 100 N/m" in err
    assert "  largest proved K_VE: " in err
    assert table["certified"][box].all()
    assert table["settled"][box].all()
    assert "not certified" not in err
    facts = json.loads((tmp_path / "results/held/zwidth-hands.datapackage.json").read_text())["wavesweep"]
    assert facts["for_hands"] == ["box:mass=0.1..0.2,damping=2..10,stiffness=100..100"]


def test_the_columns_of_hands_have_units():
    fields = {field.name: field for field in results.fields("zwidth-hands", ["B_VE"], "K_VE", [*ENDS, "settled"])}
    assert (fields["hand"].kind, fields["hand"].unit) == ("string", "")
    assert [fields[name].unit for name in ENDS[:3]] == ["kg", "N*s/m", "N/m"]
    assert all(field.description for field in fields.values())
