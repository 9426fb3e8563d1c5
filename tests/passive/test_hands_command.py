"""`--for-hands` of the commands that find stable intervals."""

import json

import numpy as np
import pytest
from support.chunks import finished_in

from wavesweep import load
from wavesweep.program import results
from wavesweep.program.store.checkpoint import FileCheckpoint
from wavesweep.program.tables.table import digest_of

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


@pytest.mark.parametrize("kind", ["zwidth", "stability-region"])
def test_without_the_flags_the_table_is_the_contracts(kind, wavesweep, held, tmp_path):
    assert wavesweep(kind, held, "--no-plot")[0] == 0
    assert (tmp_path / f"results/held/{kind}.csv").read_text().startswith(PLAIN)


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


@pytest.mark.slow
@pytest.mark.thorough
def test_free_and_guaranteed_results_lie_side_by_side_and_those_for_other_hands_are_not_lost(wavesweep, held):
    free = ["zwidth", held, "--no-plot", "--set", "sweep.B_VE=[1]", "--out", "results/held"]
    passive, both = [*free, "--for-hands", "passive"], [*free, "--for-hands", "passive", "--for-hands", "port"]
    for run in (free, passive, free):
        assert wavesweep(*run)[0] == 0
    code, _, err = wavesweep(*both)
    assert (code, "found results for other hands (passive); give --overwrite" in err) == (2, True)
    assert wavesweep(*both, "--overwrite")[0] == 0
    code, out, _ = wavesweep("verify", "results/held")
    assert (code, "zwidth.parquet: " in out, "zwidth-hands.parquet: 4 of 4 combinations" in out) == (0, True, True)
    assert wavesweep("plot", "results/held/zwidth-hands.csv") == (0, "", "Wrote results/held/zwidth-hands.png\n")


@pytest.mark.thorough
def test_a_checkpoint_for_other_hands_stays_and_disturbs_nothing(wavesweep, held, tmp_path):
    digest = digest_of([load("held.toml")])[:12]
    place = tmp_path / f"results/held/.zwidth-hands-{digest}.sqlite"
    box = FileCheckpoint(place, "box", {}, np.dtype(float), False, [])
    box.save(0, np.arange(3.0))
    code, _, err = wavesweep("zwidth", held, "--no-plot", "--for-hands", "passive")
    assert (code, "Error" in err) == (0, False)
    assert finished_in(place) == [0]
    assert box.load(0).tolist() == [0, 1, 2]
