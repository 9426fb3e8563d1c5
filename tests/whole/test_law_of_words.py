"""Every printed sentence holds: random specs whose answers are known in closed form, and all that commands say of them.

The loop is `x[k+1] = x[k] - T c K y`, where y is x at the last sample that came through: a frame of n ticks multiplies x by
`1 - n T c K`. It is stable in any order of frames of up to n ticks if `0 < K < 2/(n T c)`, for the largest n and c, and with
up to m samples lost in a row for `(m + 1) n` in place of n.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from wavesweep.program.cli import main
from wavesweep.program.spec.writing import as_toml

T = 0.001
NUMBER = r"(-?[\d.]+(?:e[+-]?\d+)?)"
UNSURE = ("not known", "not certified", "not settled", "not proved", "could not be decided", "neither proved nor refuted")
FEW = (0, 7)  # a constant number beside frames in any order, and losses
SEEDS = [*FEW, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(60) if seed not in FEW)]


def drawn(seed):
    """A random spec: its tables, what it asks, the values of its members, and the largest K that is stable with all, or 0."""
    rng = np.random.default_rng(seed)
    lengths = sorted(rng.choice([1, 2, 3, 4, 6], size=rng.integers(1, 4), replace=False).tolist())
    own = int(rng.choice(lengths)) if rng.random() < 0.8 else 5
    factors = sorted(rng.choice([-1.0, 0.5, 1.0, 2.0], p=[0.15, 0.3, 0.3, 0.25], size=2, replace=False).tolist())
    stiffness = float(np.round(2 / (T * max(lengths) * 2) * rng.choice([0.3, 0.9, 1.5, 3.0]), 3))
    tables = {
        "rates": {"tick_hz": 1 / T},
        "numbers": {"K": stiffness, "n": own, "c": 1.0},
        "block": {"p": {"type": "integrator"}, "h": {"type": "hold", "every": "n"}},
        "wire": {"h.u": "p.y", "p.u": "-c*K*h.y"},
        "sweep": {"along": "K", "K": {"start": 1, "stop": 5000}},
    }
    asks = rng.choice(["nothing", "frames", "numbers", "both", "losses", "require"], p=[0.1, 0.25, 0.2, 0.2, 0.15, 0.1])
    members = {"n": [own], "c": [1.0]}
    if asks in ("frames", "both"):
        tables["for_all"] = {"n": {"values": lengths, "varying": True}}
        members["n"] = lengths
    if asks in ("numbers", "both"):
        tables.setdefault("for_all", {})["c"] = {"values": factors} if rng.random() < 0.5 else ranged(factors)
        members["c"] = factors
    if asks == "losses":
        lost = int(rng.integers(1, 3))
        tables["block"]["h"] = {"type": "channel", "every": "n", "lost": lost}
        members["n"] = [own * (1 + each) for each in range(lost + 1)]
    if asks == "require":
        tables["sweep"]["require"] = {"radius": 0.9}
    if rng.random() < 0.3 and "c" not in tables.get("for_all", {}):
        tables["sweep"]["c"] = [0.5, 1.0]
    limit = 0.0 if min(members["c"]) < 0 else 2 / (T * max(members["n"]) * max(members["c"]))
    return tables, asks, members, limit


def ranged(factors):
    return {"start": factors[0], "stop": factors[-1]}


def said_by(capsys, *command):
    """What a command prints, in lines."""
    assert main([str(each) for each in command]) == 0, command
    seen = capsys.readouterr()
    return seen.out, [line for line in (seen.out + seen.err).splitlines() if line.strip()]


def hold_bounds(line, rows, limit):
    """No bound in a line about rows lies beyond what they have, none beyond what is refuted, and none beyond the truth."""
    highest = max((row["high"] for row in rows if row["intervals"]), default=-np.inf)
    lowest = min((row["low"] for row in rows if row["intervals"]), default=np.inf)
    for bound in re.findall(rf"(?:largest [^:;]*|up to): {NUMBER}", line):
        assert float(bound) <= highest * (1 + 1e-14), line
        assert float(bound) <= limit * (1 + 1e-9), line
    for bound in re.findall(rf"least [^:;]*: {NUMBER}", line):
        assert float(bound) >= lowest * (1 - 1e-14), line
    proved, refuted = (re.findall(rf"{words} {NUMBER}", line) for words in ("largest [^:;]*:", "refuted at"))
    if proved and refuted:
        assert float(proved[0]) < float(refuted[0]), line
        assert float(refuted[0]) >= min(row["fails_from"] for row in rows if row["fails_from"] == row["fails_from"])


@pytest.mark.slow
@pytest.mark.asks("for_all", "require", "check", "reports")
@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_said_of_a_spec_is_so(seed, tmp_path, monkeypatch, capsys):
    import pandas

    tables, asks, members, limit = drawn(seed)
    stiffness = tables["numbers"]["K"]
    monkeypatch.chdir(tmp_path)
    Path("mine.toml").write_text(as_toml(tables), encoding="utf-8")

    # The verdict: the first line of `check`, its answer as JSON, and the exit code agree with the truth.
    out, _ = said_by(capsys, "check", "mine.toml", "--json")
    found = json.loads(out)["verdict"]
    _, lines = said_by(capsys, "check", "mine.toml")
    first = lines[0].partition(": ")[2]
    stable = 0 < stiffness < limit
    if asks == "require":  # of a tick
        stable = abs(1 - tables["numbers"]["n"] * T * stiffness) ** (1 / tables["numbers"]["n"]) <= 0.9
    assert len(lines[0]) <= 120
    assert found["answer"] in (("yes", "not known") if stable else ("no", "not known")), (seed, first)
    worded = {"yes": r"(proved )?(stable|as required)", "no": r"not (stable|as required)|UNSTABLE", "not known": "not known"}
    assert re.match(worded[found["answer"]], first), (seed, first)
    assert main(["check", "mine.toml", "--strict", "--quiet"]) == (found["answer"] != "yes")
    statuses = [question["status"] for question in found["questions"]]
    assert ("refuted" in statuses) == (found["answer"] == "no")  # what is refuted comes first

    # The rows: each kind has a claim, which holds every pattern that is drawn from the spec.
    said_by(capsys, "stability-region", "mine.toml", "--no-plot", "--out", "t")
    table = pandas.read_csv("t/stability-region.csv")
    facts = json.loads(Path("t/stability-region.datapackage.json").read_text(encoding="utf-8"))["wavesweep"]
    claims = facts["claims"]
    kinds = {*table.get("guarantee", pandas.Series(["spec"] * len(table)))}
    assert kinds <= {*claims}
    rng = np.random.default_rng(seed)
    if "for_all" in claims:
        scope = claims["for_all"]["scope"]
        if asks in ("frames", "both") and len(members["n"]) > 1:
            assert {*rng.choice(members["n"], 20)} <= {*scope["frames"]["lengths"]}
            assert scope["frames"]["order"] == "any"
        if asks in ("numbers", "both"):
            (numbers,) = [each for each in scope["numbers"] if each["path"].endswith("c")]
            value = rng.choice(members["c"])
            assert value in numbers["values"] or numbers["low"] <= value <= numbers["high"]
        if asks == "losses":
            assert scope["messages"][0]["lost"] == len(members["n"]) - 1
    assert all("for all" not in claims[word]["said"] for word in claims if word != "for_all")

    # The summary: each line about rows is about rows of a kind with a claim, and holds bounds and doubts.
    _, lines = said_by(capsys, "stability-region", "mine.toml", "--no-plot", "--out", "t", "--overwrite")
    softest = min(tables["sweep"].get("c", [1.0]))
    limits = {"spec": 2 / (T * tables["numbers"]["n"] * softest), "for_all": limit / softest}
    word = "spec"
    for line in lines:
        kind = re.match(r".*? \((\w+)\):$", line)
        if kind and kind[1] in claims:
            word = kind[1]
            assert word == "spec" or line.startswith(claims[word]["said"]), line
        elif not line.startswith("  "):
            word = "spec"
        rows = table[table["guarantee"] == word] if "guarantee" in table else table
        hold_bounds(line, rows.to_dict("records"), limits[word])
        assert len(line) <= 120 or line.startswith(("Wrote", "assumes")), line
        if "nowhere stable" in line:
            assert not rows["intervals"].any(), line
            assert rows["certified"].all(), line
            assert limit == 0 or limit < 1 + 1e-9 or "require" in asks, line
    if not table["certified"].all():
        assert any(words in line for line in lines for words in UNSURE)

    # The report: its headline is the verdict, and its legends hold bounds.
    said_by(capsys, "report", "mine.toml", "--out", "r.html", "--quiet")
    page = Path("r.html").read_text(encoding="utf-8")
    headline = re.search(r'<div class="verdict( doubt)?">\s*<p><strong>(.*?)</strong>', page)
    assert ("doubt" in (headline[1] or "")) or found["answer"] == "yes"
    assert not headline[2].startswith("Certified")
    if found["answer"] == "no":
        assert " not stable" in headline[2] or " not as required" in headline[2]
    for text in re.findall(r"largest[^<]*", page):
        word = "for_all" if "proved" in text else "spec"
        rows = table[table["guarantee"] == word] if "guarantee" in table else table
        hold_bounds(text, rows.to_dict("records"), limits[word])
