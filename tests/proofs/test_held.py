"""A proof file is held against its table before it is written, and by `verify`."""

import pytest
from proofs.test_proofs import SERVO
from support.proofs import checked_file, written

from wavesweep.program.cli import main
from wavesweep.program.results.package import packaged_facts
from wavesweep.program.results.table_files import read_rows
from wavesweep.proofs import of_table

WORDS = "this is a fault of wavesweep: please report it, with the spec; no proof file is written"


def of_another(text):
    """The tables of a loop that is not that of its spec."""
    tables = of_another.read(text)
    tables["block"]["body"]["den"][0] *= 2
    return tables


of_another.read = of_table.spec_of


@pytest.mark.parametrize("command", ["stability-region", "check"])
def test_no_file_is_written_about_another_loop_than_that_of_the_table(command, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(of_table, "spec_of", of_another)
    spec = tmp_path / "spec.toml"
    spec.write_text(SERVO, encoding="utf-8")
    plots = ["--no-plot"] if command != "check" else []
    assert main([command, str(spec), "--proof", "--out", str(tmp_path / "out"), *plots]) == 1
    said = capsys.readouterr().err
    assert ("is proved unstable from" if plots else "the spectral radius is 0.98") in said
    assert WORDS in said
    assert not [*(tmp_path / "out").glob("*.proof")]
    assert not [*(tmp_path / "out").glob("*.csv")]


def test_radii_are_held_where_ends_are_alike(tmp_path, capsys, monkeypatch):
    radii_at = of_table.radii_at
    monkeypatch.setattr(of_table, "radii_at", lambda *loops: [1.0001 * radius for radius in radii_at(*loops)])
    spec = tmp_path / "spec.toml"
    spec.write_text(SERVO, encoding="utf-8")
    assert main(["stability-region", str(spec), "--proof", "--out", str(tmp_path / "out"), "--no-plot"]) == 1
    assert "by the checker; this is a fault of wavesweep" in capsys.readouterr().err


HELD = """[rates]
tick_hz = 10
[numbers]
r = 0.5
n = 2
[block.a]
type = "hold"
[wire]
"a.u" = "{gain}*prev(a.y)"
[{table}
r = {{ start = 0.1, stop = 1.9 }}
"""


def test_a_mode_that_is_at_1_where_a_row_ends_is_one_of_both(tmp_path):
    text = HELD.format(gain="r**n", table='sweep]\nalong = "r"')
    _, proof = written(tmp_path, text, "stability-region", "--no-plot")
    assert proof.exists()


def test_a_whole_exponent_that_is_a_number_is_one_in_a_box_and_its_proof(tmp_path):
    files = written(tmp_path, HELD.format(gain="(1 - r)**n", table="for_all]"), "check")
    code, said = checked_file(*files)
    assert code == 3  # n itself has a range in `check`
    assert "own numbers for all of [for_all] and channels: proved stable" in said


def test_members_of_for_all_are_held(tmp_path, monkeypatch):
    places = []
    hold_loop = of_table.Proofs.hold_loop
    monkeypatch.setattr(of_table.Proofs, "hold_loop", lambda self, *loop: places.append(loop[1]) or hold_loop(self, *loop))
    text = SERVO.partition("[sweep]")[0] + "[for_all]\nk = { start = 10, stop = 30 }\n"
    written(tmp_path, text, "check")
    assert places[:3] == [{}, {"k": [10]}, {"k": [30]}]


def test_verify_holds_claims_against_rows(tmp_path):
    _, proof = written(tmp_path, SERVO, "stability-region", "--no-plot")
    facts = packaged_facts(proof.with_name("stability-region.datapackage.json"))
    columns = read_rows(proof.with_suffix(".parquet"))
    assert [wrong for _, wrong in of_table.checked(proof, facts, columns)] == [False]
    for factor, words in ((0.9, "is proved stable from"), (1.1, "is proved unstable from")):
        (said, wrong), _ = of_table.checked(proof, facts, columns | {"high": columns["high"] * factor})
        assert wrong
        assert words in said


def test_verify_holds_the_question_against_rows(tmp_path):
    text = SERVO + "'rates.tick_hz' = [1000, 2000]\n"
    _, proof = written(tmp_path, text, "stability-region", "--no-plot")
    facts = packaged_facts(proof.with_name("stability-region.datapackage.json"))
    columns = read_rows(proof.with_suffix(".parquet"))
    changed = columns | {"rates.tick_hz": columns["rates.tick_hz"] * 3}
    said = [text for text, wrong in of_table.checked(proof, facts, changed) if wrong]
    assert len(said) == 2
    assert "of which the file does not ask" in said[0]


def test_a_proof_that_takes_more_memory_than_it_may_is_left_out_with_a_sentence(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(of_table, "claims_along", lambda *_: bytearray(of_table.MEGABYTES << 21))
    _, proof = written(tmp_path, SERVO, "stability-region", "--no-plot")
    assert "no proof of a slice: more than 800 MB of memory; fewer states or messages take less" in capsys.readouterr().err
    assert not proof.exists()
    assert len(bytearray(of_table.MEGABYTES << 21)) > 1e9  # the limit ends with the claim
