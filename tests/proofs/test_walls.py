"""Proof files of rows and verdicts through contact."""

import pytest
from checker.test_contact import DIRECT, DRAWN
from support.proofs import changed, checked_file, lines_of, written

from wavesweep.checker.balls import Refused
from wavesweep.checker.file import spec_of
from wavesweep.proofs.walls import claim_of_motion


def unfolded(capsys):
    return capsys.readouterr().err.replace("\n    ", " ")


VARYING = '"rates.ratio" = { values = [19, 20], varying = true }\n[sweep]'
CONTACT = "[for_all]\ncontact = true\n[sweep]\n"


def test_check_writes_the_proof_of_its_own_wall(tmp_path, capsys):
    text = DIRECT + "environment.K_VE = 200\n" + CONTACT
    spec, proof = written(tmp_path, text, "check", "--set", "environment.B_VE=2")
    assert "for any wall that pushes and never pulls at B_VE = 2, K_VE = 200: proved stable" in unfolded(capsys)
    claim = lines_of(proof)[3]
    assert claim["sides"] == {"K_VE": ["200", "200"], "B_VE": ["2", "2"]}
    code, words = checked_file(spec, proof)
    assert code == 0
    assert "any wall that pushes and never pulls, K_VE = 200, B_VE = 2: every motion comes to rest" in words


def test_check_writes_the_motion_that_refutes_its_wall(tmp_path, capsys):
    text = DIRECT + "environment.K_VE = 255\n" + CONTACT
    spec, proof = written(tmp_path, text, "check")
    assert "for any wall that pushes and never pulls at K_VE = 255, B_VE = 1: refuted" in unfolded(capsys)
    assert [line["claim"] for line in lines_of(proof) if "claim" in line][:2] == ["modes", "goes on"]
    code, words = checked_file(spec, proof)
    assert code == 0
    assert "a wall that pushes and never pulls, K_VE = 255, B_VE = 1: its forces are" in words


@pytest.mark.slow
def test_the_motion_that_refutes_a_wall_while_frames_vary_is_in_frames_of_one_kind(tmp_path):
    text = DIRECT + "environment.K_VE = 260\n" + CONTACT.replace("[sweep]", VARYING)
    spec, proof = written(tmp_path, text, "check")
    (claim,) = (line for line in lines_of(proof) if line.get("claim") == "goes on")
    (frame,) = claim["word"]
    assert checked_file(spec, proof)[0] == 0
    other = {"rates.ratio=19": "rates.ratio=20", "rates.ratio=20": "rates.ratio=19"}[frame]
    forged = {
        "no wall that pushes and never pulls": {"word": [other]},
        "in frames of several kinds": {"word": ["rates.ratio=19", "rates.ratio=20"]},
        "does not allow": {"word": ["rates.ratio=18"]},
        "has a word where frames vary": {"word": []},
    }
    for words, change in forged.items():
        changed(proof, lambda line, change=change: line | (change if line.get("claim") == "goes on" else {}))
        code, said = checked_file(spec, proof)
        assert code == 1
        assert words in said


def test_a_linear_wall_that_refutes_is_no_motion():
    text = "the linear wall, in contact all the time"
    with pytest.raises(Refused, match="no motion that repeats"):
        claim_of_motion(spec_of(DIRECT.encode()), {}, {}, text)


@pytest.mark.slow
def test_a_row_through_contact_has_a_proof(tmp_path, capsys):
    text = DRAWN + CONTACT + 'along = "K"\nK = { start = 0, stop = 2000 }\nB = [0, 5]\n'
    spec, proof = written(tmp_path, text, "stability-region", "--no-plot")
    said = unfolded(capsys)
    assert "no proof" not in said
    assert "for any wall that pushes and never pulls at B = 0: proved stable" in said
    claims = [line["sides"] for line in lines_of(proof) if line.get("claim") == "contact"]
    assert [claim["B"] for claim in claims] == [["0", "0"], ["5", "5"]]
    assert float(claims[1]["K"][1]) > 500
    assert checked_file(spec, proof)[0] == 0


IN_FRAMES = DIRECT + CONTACT.replace("[sweep]", VARYING)


@pytest.mark.slow
def test_a_row_beside_frames_that_vary_has_a_proof(tmp_path):
    spec, proof = written(tmp_path, IN_FRAMES + "K_VE = { start = 0, stop = 500 }\n", "zwidth", "--no-plot")
    (claim,) = (line["sides"] for line in lines_of(proof) if line.get("claim") == "contact")
    assert float(claim["K_VE"][0]) < 1
    assert float(claim["K_VE"][1]) > 200
    words = checked_file(spec, proof)[1]
    assert "REFUSED" not in words
    assert "any wall that pushes and never pulls, K_VE from" in words
