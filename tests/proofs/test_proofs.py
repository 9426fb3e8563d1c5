"""Proof files that commands write, as the checker reads them."""

import gzip
import json

import numpy as np
import pytest
from support.proofs import checked_file

from wavesweep.program.cli import main
from wavesweep.proofs.cells import written
from wavesweep.proofs.forms import form_of

WALL = """
[rates]
fast_hz = 1000.0
ratio = 4
[device]
mass = 0.1
damping = 1.5
[environment]
integration = "explicit"
delay = 1
[controller]
kind = "dc"
[sweep]
K_VE = { start = 0, stop = 20000 }
B_VE = [1.0, 3.0]
"""
SERVO = """
[rates]
tick_hz = 1000
[numbers]
k = { value = 20.0 }
[block.body]
type = "tf"
num = [1]
den = [0.03, 1, 0]
[block.late]
type = "delay"
[wire]
"late.u" = "-k*body.y"
"body.u" = "late.y"
[sweep]
along = "k"
k = { start = 1, stop = 3000 }
"""


def _run(*words):
    return main([str(word) for word in words]) or 0


def _written(folder, text, *words):
    spec = folder / "spec.toml"
    spec.write_text(text)
    assert _run(*words[:1], spec, "--proof", "--out", folder / "out", *words[1:]) == 0
    return spec


def _lines(proof):
    with gzip.open(proof) as file:
        return [json.loads(line) for line in file]


@pytest.mark.slow
def test_every_row_of_walls_has_a_proof_to_its_ends(tmp_path, capsys):
    spec = _written(tmp_path, WALL, "zwidth", "--no-plot")
    proof = tmp_path / "out" / "zwidth.proof"
    assert "K_VE from 0 to 20000 at B_VE = 1: proved stable" in capsys.readouterr().err
    code, said = checked_file(spec, proof)
    assert (code, said.count("proved: ")) == (0, said.count("\n") - 2)
    stable = [line for line in _lines(proof) if line.get("outside") == 0 and "sides" in line]
    rows = (tmp_path / "out" / "zwidth.csv").read_text().splitlines()
    high = [float(row.split(",")[rows[0].split(",").index("high")]) for row in rows[1:]]
    assert [float(line["sides"]["K_VE"][1]) for line in stable] == pytest.approx(high, rel=2e-9)
    # a row that promises more has no proof
    proof.write_bytes(gzip.compress(gzip.decompress(proof.read_bytes()).replace(b'"3.0"', b'"2.9"')))
    assert checked_file(spec, proof)[0] == 1


@pytest.mark.slow
def test_crossings_between_unstable_stretches_are_found_by_the_proof(tmp_path, capsys):
    spec = _written(tmp_path, SERVO, "stability-region", "--no-plot")
    proof = tmp_path / "out" / "stability-region.proof"
    assert checked_file(spec, proof)[0] == 0
    assert [line["outside"] for line in _lines(proof)[1:] if "claim" in line] == [0, 2]
    assert _run("verify", tmp_path / "out") == 0
    assert "2 of 2 claims proved by the checker" in capsys.readouterr().out


LAG = """rates.tick_hz = "1/h"
[numbers]
h = 0.5
k = 3.0
[block]
lag = { type = "tf", num = [1], den = [1, 1] }
hold = { type = "hold" }
[wire]
"hold.u" = "-k*lag.y"
"lag.u" = "hold.y"
[sweep]
along = "h"
h = { start = 0.1, stop = 2 }
"""


@pytest.mark.slow
@pytest.mark.parametrize("command", ["stability-region", "check"])
def test_a_range_of_periods_and_the_ranges_of_check_have_proofs(tmp_path, command):
    # x+ = e x - k (1 - e) x with e = exp(-h) is stable where k < (1 + e)/(1 - e)
    spec = _written(tmp_path, LAG, command, *["--no-plot"][command == "check" :])
    proof = tmp_path / "out" / f"{command}.proof"
    assert checked_file(spec, proof)[0] == 0
    ends = {}
    for line in _lines(proof)[1:]:
        if "claim" in line and line.get("sides"):
            ((name, (low, high)),) = line["sides"].items()
            ends[name, line["outside"]] = float(low), float(high)
    limits = {"h": np.log(2), "k": (1 + np.exp(-0.5)) / (1 - np.exp(-0.5))}
    for name in limits if command == "check" else ["h"]:
        assert ends[name, 0][1] == pytest.approx(limits[name], rel=1e-8)
        assert ends[name, 1][0] == pytest.approx(limits[name], rel=1e-8)


@pytest.mark.parametrize(("gain", "outside"), [(20.0, 0), (900.0, 2)])
def test_the_own_design_has_a_proof(tmp_path, gain, outside):
    spec = _written(tmp_path, SERVO.replace("value = 20.0", f"value = {gain}"), "check")
    proof = tmp_path / "out" / "check.proof"
    assert checked_file(spec, proof)[0] == 0
    assert _lines(proof)[1]["outside"] == outside


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("zwidth", "SPEC", "--proof", "--set", "controller.kind=dc-slow"), "expected a number beside --proof"),
        (("zwidth", "SPEC", "--proof", "--out", "-"), "--proof: expected a folder"),
        (("stability-region", "SPEC", "--proof", "--map", "K_VE,b", "--out", "-"), "--proof: expected a folder"),
        (("why", "SPEC", "--proof"), "no proof file for why; those that write one are zwidth, stability-region, "),
    ],
)
def test_what_has_no_proof_file_is_refused(tmp_path, capsys, words, said):
    spec = tmp_path / "spec.toml"
    spec.write_text(WALL)
    assert _run(*(spec if word == "SPEC" else word for word in words)) == 2
    assert said in capsys.readouterr().err


def test_what_is_too_small_for_a_file_is_0_in_it():
    entries = np.array([[1e-106, -0.0], [1e-99, -1.25]])
    assert written(entries) == [["0.0", "0.0"], ["1e-99", "-1.25"]]
    assert written(entries, 8) == [["0", "0"], ["1e-99", "-1.25"]]


@pytest.mark.parametrize("seed", [1, 2, 4, 5])
def test_a_form_does_not_depend_on_the_last_bits_of_its_matrix(seed):
    """Which are others on another processor: what is 0 but for rounding is 0."""
    random = np.random.default_rng(seed)
    A = np.zeros((2, 5, 5))
    A[0, :4, :4] = 0.45 * random.normal(size=(4, 4))
    A[0, 4] = 0.3 * random.normal(size=5)
    A[0, 2:, :2] = 0  # the first two move none of the others
    A[1, :3, :3] = 1e-3 * random.normal(size=(3, 3))
    units = 10.0 ** random.uniform(-3, 3, 5)
    A = A * units / units[:, None]
    form = form_of(A)
    for _ in range(4):
        other = form_of(A * (1 + 1e-15 * random.normal(size=A.shape)))
        assert (other.L == form.L).all()
        assert (np.array(other.slopes) == np.array(form.slopes)).all()
