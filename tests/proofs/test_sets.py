"""Proof files of what holds for all of [for_all]: the writers' claims, and that the checker refuses what promises more."""

import math
from fractions import Fraction
from pathlib import Path

import pytest
from checker.test_for_all import SPEC as PATTERN
from support.proofs import changed, checked, checked_file, lines_of, written

from wavesweep.checker.balls import Refused
from wavesweep.checker.file import Claim, spec_of
from wavesweep.proofs.claims import claim_of_set, claim_refuted
from wavesweep.proofs.drifts import drifts_of

PMW = Path(__file__).parents[2] / "sweeps" / "for-all" / "pmw.toml"
TANK = """
rates.tick_hz = 10
numbers = {{ k = 1.0{p} }}
[block]
tank = {{ type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }}
net = {{ type = "channel", {messages} }}
[wire]
"tank.u" = "net.y"
"net.u" = "-k*tank.y"
[sweep]
along = "k"
k = {{ start = 0, stop = 30 }}
"""


def tank(messages: str) -> str:
    """The tank behind a channel, with the number p if messages are lost with it."""
    return TANK.format(messages=messages, p=", p = 0.2" * ("p" in messages))


VALVE = """
rates.tick_hz = 10
numbers = { k = 1.0, n = 2, a = 1.0 }
[block]
tank = { type = "ss", inputs = ["u"], A = [[0]], B = [["a"]], C = [[1]] }
valve = { type = "hold", every = "n" }
[wire]
"tank.u" = "valve.y"
"valve.u" = "-k*tank.y"
[sweep]
along = "k"
k = { start = 0, stop = 30 }
[for_all]
"""
FRAMES = VALVE + "n = { values = [1, 2, 3], varying = true }"
BOX = VALVE + "a = { start = 0.5, stop = 2.0 }"
MEMBERS = VALVE + "a = [0.5, 2.0]"
BOTH = FRAMES + "\na = { start = 0.5, stop = 2.0 }"
WHOLE = VALVE + "n = { start = 1, stop = 3 }"
LATE = """
rates.tick_hz = 10
numbers = { k = 1.0, tau = 0.05 }
[block]
tank = { type = "ss", inputs = ["u"], A = [[0]], B = [[1]], C = [[1]] }
line = { type = "delay", seconds = "tau" }
[wire]
"tank.u" = "line.y"
"line.u" = "-k*tank.y"
[for_all]
tau = { start = 0.04, stop = 0.06 }
"""
CHANCES = VALVE + "n = { values = [1, 3], varying = true, shares = [3, 1] }"


def along(low, high):
    return "k", low, high


# what is proved of x' = -a k x with steps of 0.1 n s: k below 20/(a n); at random below where the mean square grows;
# with a dead time of tau within a step, z^2 - (1 - k (0.1 - tau)) z + k tau, k below 1/tau
SETS = {
    "frames": (FRAMES, "for all", 6.66, 6.67),
    "a range": (BOX, "for all", 4.99, 5.01),
    "whole numbers": (WHOLE, "for all", 6.66, 6.67),
    "a dead time": (LATE, "for all", 16.66, 16.67),
    "values": (MEMBERS, "for all", 4.99, 5.01),
    "frames beside a range": (BOTH, "for all", 3.33, 3.34),
    "frames at random": (CHANCES, "mean square", 9.9, 10.1),
    "lost messages": (tank("lost = 1"), "for all", 9.99, 10.01),
    "messages lost at random": (tank('loss = "p"'), "mean square", 11.0, 16.0),
    "a late message": (tank("late = 1"), "for all", 9.8, 10.1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_a_set_is_proved_up_to_its_end_and_no_further(name, tmp_path):
    spec, kind, high, beyond = SETS[name]
    lines = claim_of_set(spec_of(spec.encode()), kind, {}, along(0.001, high))
    code, words = checked(tmp_path, spec, lines)
    assert code == 0, words
    assert f"k from 0.001 to {high:g}" in words
    with pytest.raises(Refused, match="no forms are found"):
        claim_of_set(spec_of(spec.encode()), kind, {}, along(0.001, beyond))
    lines[0]["sides"]["k"] = ["0.001", str(beyond)]
    assert checked(tmp_path, spec, lines)[0] == 1


def test_the_own_numbers_are_a_set_too(tmp_path):
    for spec in (FRAMES, BOX, MEMBERS):
        lines = claim_of_set(spec_of(spec.encode()), "for all", {}, None)
        assert checked(tmp_path, spec, lines)[0] == 0
        other = spec.replace("k = 1.0", "k = 7.0")
        assert checked(tmp_path, other, lines)[0] == 1


BEHIND = LATE.replace('"-k*tank.y"', '"law.y"\n"law.u" = "-k*tank.y"').replace("line =", 'law = { type = "hold" }\nline =')


@pytest.mark.parametrize("spec", [LATE, BEHIND], ids=["before", "behind"])
def test_a_dead_time_has_any_value_of_its_range(spec, tmp_path):
    lines = claim_of_set(spec_of(spec.encode()), "for all", {"k": "16.6"}, None)
    code, words = checked(tmp_path, spec, lines)
    assert (code, "tau from 0.04 to 0.06" in words) == (0, True), words
    wider = spec.replace("stop = 0.06", "stop = 0.061")
    assert checked(tmp_path, wider, lines)[0] == 1
    longer = spec.replace('"tau" }', '"tau + 0.001" }')
    assert checked(tmp_path, longer, lines)[0] == 1
    lines[0]["sides"]["tau"][1] = "0.061"
    assert checked(tmp_path, wider, lines)[0] == 1


@pytest.mark.parametrize("ends", ["start = 0.06, stop = 0.14", "start = 0.1, stop = 0.14", "start = 0.06, stop = 0.1"])
def test_a_dead_time_that_may_reach_a_tick_has_no_proof(ends, tmp_path):
    spec = LATE.replace("start = 0.04, stop = 0.06", ends)
    lines = claim_of_set(spec_of(LATE.encode()), "for all", {}, None)
    low, high = (each.split(" = ")[1] for each in ends.split(", "))
    lines[0]["sides"]["tau"] = [low, high]
    code, words = checked(tmp_path, spec, lines)
    assert (code, "in the whole of a range of dead times" in words) == (2, True), words


@pytest.mark.parametrize("seconds", ["0.002/tau", "0.2*sqrt(tau)", "tau**2 + 0.05"])
def test_a_dead_time_that_is_no_sum_of_ranges_has_no_proof(seconds, tmp_path):
    lines = claim_of_set(spec_of(LATE.encode()), "for all", {}, None)
    code, words = checked(tmp_path, LATE.replace('"tau" }', f'"{seconds}" }}'), lines)
    assert (code, "a time or a count follows from a number with a range" in words) == (2, True), words


def test_a_range_of_how_often_a_block_runs_is_that_of_whole_numbers(tmp_path):
    """Of x+ = (1 - 0.1 n k) x, with a form of each n."""
    member = {"drifts": [], "states": ["@tank x0"]}
    form = {"L": [["1"]], "signs": "+"}
    lines = [{"claim": "for all", "numbers": {"k": "6.6"}, "sides": {}}]
    for n in "123":
        lines += [{"member": {"n": n}, **member}, form]
    code, words = checked(tmp_path, WHOLE, lines)
    assert code == 0, words
    assert checked(tmp_path, WHOLE, lines[:-2])[0] == 1
    assert checked(tmp_path, WHOLE.replace("stop = 3 }", "stop = 4 }"), lines)[0] == 1
    lines[0]["numbers"]["k"] = "6.7"
    assert checked(tmp_path, WHOLE, lines)[0] == 1


REFUTERS = {
    "frames": (FRAMES, {"k": "6.67"}, "frames 3", ["n=3"]),
    "a member": (BOX, {"k": "5.01"}, "a = 2", []),
    "both": (BOTH, {"k": "3.34"}, "a = 2, frames 3", ["n=3"]),
    "messages": (tank("lost = 1"), {"k": "10.01"}, "messages net: 0, lost", ["0: net has 1", "0: net gets 0"]),
}


@pytest.mark.parametrize("name", REFUTERS)
def test_what_refutes_is_multiplied_out(name, tmp_path):
    spec, numbers, text, word = REFUTERS[name]
    lines = claim_refuted(spec_of(spec.encode()), numbers, text)
    assert sorted(lines[0]["word"]) == sorted(word)
    code, words = checked(tmp_path, spec, lines)
    assert (code, "unstable" in words) == (0, True), words
    with pytest.raises(Refused, match="no form is found of what refutes it"):
        claim_refuted(spec_of(spec.encode()), {"k": str(0.99 * float(numbers["k"]))}, text)


def test_late_messages_are_the_letters_of_what_a_receiver_has():
    spec = tank("late = 2")
    found = claim_refuted(spec_of(spec.encode()), {"k": "20.1"}, "messages net: 0")
    assert found[0]["word"] == ["0: net gets 0"]
    found = claim_refuted(spec_of(spec.encode()), {"k": "10.1"}, "messages net: 1, 0")
    assert found[0]["word"] == ["0: net has 1", "0: net gets 0"]


TABLE = PATTERN + "[sweep]\nK_VE = { start = 0, stop = 5000 }\n"


@pytest.mark.slow
def test_rows_of_frames_in_any_order_and_their_refuters_have_proofs(tmp_path, capsys):
    spec, proof = written(tmp_path, TABLE, "zwidth", "--no-plot")
    assert "no proof" not in capsys.readouterr().err
    code, said = checked_file(spec, proof)
    assert code == 0, said
    kinds = [line["claim"] for line in lines_of(proof) if "claim" in line]
    assert kinds == ["modes", "modes", "modes", "for all", "refuted"]  # the first of K_VE = 0 alone is third
    at_0 = next(line for line in lines_of(proof) if line.get("numbers") == {"K_VE": "0.0"})
    assert (at_0["claim"], len(at_0["drifts"])) == ("modes", 1)

    def without_a_frame(line):
        edges = [edge for edge in line.get("edges", []) if edge[1] != "rates.ratio=7"]
        return line | {"edges": edges} if "edges" in line else line

    changed(proof, without_a_frame)
    code, said = checked_file(spec, proof)
    assert (code, said.count("REFUSED")) == (1, 1)


def test_equations_that_nearly_repeat_have_the_drift_of_a_place_alone():
    """A slow filter leaves a direction that is kept but for 1e-5: rounding over that is no share of a drift."""
    tables = spec_of(PMW.with_name("pmw-lm.toml").read_bytes())
    sides = {"K_VE": (Fraction(0), Fraction(20000))}
    (drift,) = drifts_of(tables, Claim("modes", {"b": Fraction(40)}, sides, 0))
    assert {*drift} == {"@x", "@x before", "x"}


@pytest.mark.slow
def test_memory_in_units_that_differ_by_thousands_has_forms(tmp_path, capsys):
    """As the checker has it, in m, m/s and N beside each other, no norms were found about K_VE = 11."""
    written(tmp_path, PMW.read_text(encoding="utf-8"), "zwidth", "--no-plot", "--set", "sweep.b=[20]")
    assert "no proof" not in capsys.readouterr().err


@pytest.mark.slow
def test_rows_without_a_kind_of_claim_are_named(tmp_path, capsys):
    text = TABLE.replace('[for_all]\n"rates.ratio" = { values = [4, 5, 7], varying = true }', "")
    _, proof = written(tmp_path, text, "zwidth", "--no-plot", "--for-hands", "passive")
    assert "no proof file for every passive hand" in capsys.readouterr().err
    assert not proof.exists()


REQUIRED = VALVE.replace("[for_all]", "[sweep.require]")


def test_a_gain_that_is_required_has_no_proof_file(tmp_path, capsys):
    text = REQUIRED + "damping_ratio = 0.5"
    _, proof = written(tmp_path, text, "stability-region", "--no-plot")
    assert "no proof file for what [sweep] require asks for" in capsys.readouterr().err
    assert not proof.exists()


# Of two ticks of 0.1 s: 0.9^2, exp(-0.2/0.5), and 0.02^(0.2/2), as 2 % are left after 2 s.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "radius"), [("radius = 0.9", 0.81), ("time_constant = 0.5", math.exp(-0.4)), ("settling = 2", 0.02**0.1)]
)
def test_modes_within_a_radius_are_proved(key, radius, tmp_path, capsys):
    """Of x+ = (1 - 0.2 k) x, a frame of two ticks of 0.1 s."""
    spec, proof = written(tmp_path, REQUIRED + key, "stability-region", "--no-plot")
    assert "no proof" not in capsys.readouterr().err
    claims = [line for line in lines_of(proof) if "claim" in line]
    assert [line["outside"] for line in claims] == [1, 0, 1]
    assert [float(end) for end in claims[1]["sides"]["k"]] == pytest.approx([5 * (1 - radius), 5 * (1 + radius)])
    code, said = checked_file(spec, proof)
    assert code == 0, said
    assert f"inside the circle of radius {radius:.3g}"[:-1] in said  # the last digit may be rounded
    assert "not within to" in said.splitlines()[-1]  # the last values of k, up to 30
    smaller = str(0.99 * radius)
    changed(proof, lambda line: line | {"radius": smaller} if "radius" in line else line)
    assert checked_file(spec, proof)[0] == 1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spec", "said", "claims"),
    [
        (FRAMES, "for all of [for_all] and channels: proved stable", ["modes", "for all"]),
        (FRAMES.replace("k = 1.0", "k = 7.0"), "of [for_all] and channels: refuted", ["modes", "refuted"]),
        (BOX.replace("k = 1.0", "k = 7.0"), "of [for_all] and channels: refuted", ["modes", "refuted"]),
        (
            tank('loss = "p"'),
            "for the chances of [for_all] and channels: proved stable",
            ["modes", "mean square"],
        ),
    ],
)
def test_check_proves_what_it_says_of_all(spec, said, claims, tmp_path, capsys):
    path, proof = written(tmp_path, spec, "check")
    assert said in capsys.readouterr().err
    assert [line["claim"] for line in lines_of(proof) if "claim" in line][:2] == claims
    assert checked_file(path, proof)[0] == 0
