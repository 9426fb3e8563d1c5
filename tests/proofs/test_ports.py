"""Tables of passivity and rows of passive ports with their proof files."""

import pytest
from checker.test_channel import aliased
from checker.test_channel import spec as waves
from checker.test_ports import SPRING, WALL
from support.proofs import checked_file, written

from wavesweep.program import cli
from wavesweep.program.results.package import packaged_facts
from wavesweep.program.results.table_files import read_rows
from wavesweep.proofs.of_table import checked

pytest.importorskip("wavesweep.passive", reason="its tables are those that are proved")

# B_VE = 40 is beyond what the device's damping allows
TABLE = f"{WALL}\n[sweep]\nK_VE = [0, 100]\nB_VE = [0.5, 40]\n"


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return written(tmp_path_factory.mktemp("ports"), TABLE, "passivity", "--no-plot")


@pytest.mark.slow
def test_each_passive_row_is_proved_and_the_others_are_told(table):
    code, words = checked_file(*table)
    assert code == 3
    assert words.count("proved: ") == 2
    assert words.count("B_VE = 40: NOT COVERED") == 2


@pytest.mark.slow
def test_a_passive_row_of_which_a_file_does_not_ask_is_told(table):
    _, proof = table
    facts = packaged_facts(proof.with_name("passivity.datapackage.json"))
    columns = read_rows(proof.with_suffix(".parquet"))
    for factor, count in ((1, 0), (2, 2)):
        said = [*checked(proof, facts, columns | {"B_VE": factor * columns["B_VE"]})]
        assert sum("of which the file does not ask" in text for text, wrong in said if wrong) == count


@pytest.mark.slow
@pytest.mark.parametrize("words", [["passivity", "--along", "k"], ["stability-region", "--for-hands", "port"]])
def test_rows_of_a_passive_port_are_proved(tmp_path, words):
    spec = tmp_path / "spring.toml"
    spec.write_text(f'{SPRING}[sweep]\nalong = "k"\nk = {{ start = 0, stop = 100 }}\n')
    assert not cli.main([*words, str(spec), "--proof", "--no-plot", "--out", str(tmp_path / "out")])
    (proof,) = (tmp_path / "out").glob("*.proof")
    code, said = checked_file(spec, proof)
    assert code == 0
    assert "k from 0 to 100 for a passive port of the hand: proved passive" in said


@pytest.mark.slow
@pytest.mark.parametrize("words", [[], ["--along", "b"]])
def test_norms_of_a_wave_channel_are_proved(tmp_path, words):
    text = waves(order=4, more='[sweep]\nalong = "b"\nb = { start = 20, stop = 30 }\n')
    spec, _ = written(tmp_path, text, "passivity", "--no-plot", *words)
    (proof,) = (tmp_path / "out").glob("*.proof")
    _, said = checked_file(spec, proof)
    _, below = said.splitlines()[-1].split("for the norm of the wave channel below ")
    level, verdict = below.split(": ")
    assert verdict.startswith("proved below")
    assert float(level) == pytest.approx(1.001**0.5 if words else aliased(4), rel=2e-6)  # the tolerance of rows, or the norm


@pytest.mark.slow
def test_another_loop_of_the_engine_is_not_written(tmp_path, monkeypatch):
    monkeypatch.setattr("wavesweep.proofs.of_ports.times_of", lambda *_: (1e-3, 1.01e-3))
    spec = tmp_path / "spec.toml"
    spec.write_text(TABLE.replace("0.5, 40", "40"))
    assert cli.main(["passivity", str(spec), "--proof", "--no-plot", "--out", str(tmp_path / "out")])
    assert not (tmp_path / "out").exists() or not [*(tmp_path / "out").glob("*.proof")]
