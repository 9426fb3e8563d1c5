"""Proof files of ticks that take any times: of rows, of `check`, and of the patterns that refute them."""

import pytest
from checker.test_ticks import EVERY_SECOND, TANK
from support.proofs import changed, checked, checked_file, lines_of, written

from wavesweep.checker.balls import Refused
from wavesweep.checker.file import spec_of
from wavesweep.proofs.claims import claim_of_set, claim_refuted


def proof_of(spec, low, high):
    return claim_of_set(spec_of(spec.encode()), "for all", {}, ("k", low, high))


def test_ticks_are_proved_up_to_their_end_and_no_further(tmp_path):
    """|1 - (h + h') k| < 1 for ticks of 0.1 to 0.15 s: k below 6.667."""
    lines = proof_of(EVERY_SECOND, 6.0, 6.65)
    code, words = checked(tmp_path, EVERY_SECOND, lines)
    assert (code, "k from 6 to 6.65: with ticks of any times from 0.1 to 0.15 s" in words) == (0, True), words
    with pytest.raises(Refused, match="no forms are found"):
        proof_of(EVERY_SECOND, 6.0, 6.67)
    lines[0]["sides"]["k"][1] = "6.67"
    assert checked(tmp_path, EVERY_SECOND, lines)[0] == 1
    lines[0]["sides"]["k"][1] = "6.65"
    for old, new in CHANGED.items():
        assert checked(tmp_path, EVERY_SECOND.replace(old, new), lines)[0] == 1, new


CHANGED = {"late = 0.05": "late = 0.0511", "every = 2": "every = 3", '"-k*': '"-1.01*k*', "tick_hz = 10": "tick_hz = 9.9"}


def test_what_refutes_late_ticks_is_a_word_of_the_checker(tmp_path):
    lines = claim_refuted(spec_of(EVERY_SECOND.encode()), {"k": "6.7"}, "ticks of 150 x 2 ms")
    assert lines[0]["word"] == ["stop", "stop"]
    assert checked(tmp_path, EVERY_SECOND, lines)[0] == 0
    lines = claim_refuted(spec_of(TANK.encode()), {"k": "13.4"}, "ticks of 150, 149.9 ms")
    assert lines[0]["word"] == ["stop", "0.1499"]
    with pytest.raises(Refused, match="no form is found of what refutes it"):
        claim_refuted(spec_of(EVERY_SECOND.encode()), {"k": "6.7"}, "ticks of 150, 100 ms")
    with pytest.raises(Refused, match="no whole pattern"):
        claim_refuted(spec_of(TANK.encode()), {"k": "13.4"}, "ticks of 150, (100 x ... ms")


DIRECT = """
[device]
velocity = "difference"
[environment]
B_VE = 1.0
[controller]
kind = "dc"
[for_all]
tick = { late = 0.0002 }
[sweep]
along = "K_VE"
K_VE = { start = 0, stop = 20000 }
"""


@pytest.mark.slow
def test_rows_of_late_ticks_have_proofs(tmp_path, capsys):
    spec, proof = written(tmp_path, DIRECT, "zwidth", "--no-plot")
    said = capsys.readouterr().err
    assert "no proof of a row for all of [for_all]: above K_VE = 43" in said  # of 4441.4
    code, said = checked_file(spec, proof)
    assert (code, "with ticks of 0.0012 s for ever" in said) == (3, True), said
    assert "NOT COVERED from 43" in said.splitlines()[-1]
    claims = [line["claim"] for line in lines_of(proof) if "claim" in line]
    assert [claims[0], *claims[-2:]] == ["modes", "for all", "refuted"]
    changed(proof, lambda line: line | {"word": ["start"]} if line.get("word") else line)
    code, said = checked_file(spec, proof)
    assert (code, said.count("REFUSED")) == (1, 1)


@pytest.mark.slow
@pytest.mark.parametrize(("K", "said"), [("4000", "every motion decays"), ("4500", "with ticks of 0.0012 s for ever")])
def test_check_proves_what_it_says_of_late_ticks(K, said, tmp_path):
    spec, proof = written(tmp_path, DIRECT.replace("B_VE", f"K_VE = {K}\nB_VE", 1), "check")
    code, words = checked_file(spec, proof)
    assert (code, said in words) == (0, True), words
