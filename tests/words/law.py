"""One random spec through all commands: each line with a number has a shape, and holds."""

import contextlib
import io
import json
import re
from pathlib import Path

import pandas
from words.explanations import hold_columns
from words.loops import AT_RANDOM, T, drawn, greatest
from words.report import hold_page
from words.sentences import Run, hold, pole

from wavesweep.program.cli import main
from wavesweep.program.spec.writing import as_toml

QUIET = ("--no-plot", "--out", "t", "--overwrite")
OTHERS = ("margins", "simulate", "bode", "why", "poles")
TABLES = {"bode": "bode-ports"}
UNSURE = ("not known", "not certified")
WIDEST = 120


def said_by(*command):
    """The exit code of a command, what it writes to stdout, and all lines that have a number."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([*command])
    lines = [line for line in (out.getvalue() + err.getvalue()).splitlines() if line.strip()]
    return code, out.getvalue(), lines


def unfolded(lines, indent="      "):
    """Some lines, those that were folded whole again; indent: of their rests, by default those of `check`."""
    whole = []
    for line in lines:
        if line.startswith(indent) and whole:
            whole[-1] += " " + line.strip()
        else:
            whole.append(line)
    return whole


def hold_spec(seed, others=OTHERS):
    """Hold all that commands say of a random spec; in a folder of its own."""
    case = drawn(seed)
    Path("mine.toml").write_text(as_toml(case.tables), encoding="utf-8")
    run = Run(case, "check")
    code, out, _ = said_by("check", "mine.toml", "--json")
    verdict = json.loads(out)["verdict"]
    assert code == 0
    code, _, lines = said_by("check", "mine.toml", "--strict")
    assert code == (verdict["answer"] != "yes")
    assert len(lines[0]) <= WIDEST, lines[0]
    hold_verdict(case, verdict, lines[0])
    said = unfolded(lines[: lines.index("next:")] if "next:" in lines else lines)
    said = [*unfolded(said[:2], "    "), *said[2:]]  # the verdict has the rest of a line at another indent
    for line in said:
        if re.search(r"\d", line):
            hold(run, line)
    assert "but for the age" not in " ".join(said) or any("age:" in line for line in said), said

    run.command = "stability-region"
    code, _, lines = said_by("stability-region", "mine.toml", *QUIET)
    assert code == 0, lines
    table = pandas.read_csv("t/stability-region.csv")
    facts = json.loads(Path("t/stability-region.datapackage.json").read_text(encoding="utf-8"))["wavesweep"]
    hold_rows(run, table, facts)
    hold_columns(table)
    for line in lines:
        assert len(line) <= WIDEST or re.match(r"Wrote|assumes|\d+ slices?:", line), line
    for line in unfolded(lines, "    "):
        if found := re.match(r".*? \((\w+)\):$", line):
            run.word = found[1]
            assert run.word in run.claims, line
            assert run.word == "spec" or line.startswith(run.claims[run.word]["said"]), line
        elif not line.startswith("  "):
            run.word = "spec"
        if re.search(r"\d", line):
            hold(run, line)
    if not table["certified"].all():
        assert any(words in line for line in lines for words in UNSURE)

    for command in others:
        run.command, run.word = command, "spec"
        code, _, lines = said_by(command, "mine.toml", *QUIET)
        if code == 0:
            table = pandas.read_csv(f"t/{TABLES.get(command, command)}.csv")
            hold_columns(table)
            run.table = table.to_dict("records")
            for line in unfolded(lines, "    "):
                run.word = "for_all" if "(for_all):" in line else run.word
                if re.search(r"\d", line):
                    hold(run, line)
        else:
            assert code in (1, 2), (command, lines)
            assert len([line for line in lines if "at work" not in line]) <= 3, (command, lines)
    if others:
        code, _, lines = said_by("report", "mine.toml", "--out", "r.html", "--quiet")
        assert code == 0, lines
        hold_page(run, verdict)


def hold_oscillations(run, row):
    """The mode at an end turns with half the rate of the frame or not at all, as the pole there does."""
    n, c = run.case.own_length, row.get("c", run.case.tables["numbers"]["c"])
    for end in ("low", "high"):
        hz = row[f"{end}_hz"]
        if not pandas.isna(hz):
            assert any(abs(hz - each) <= 1e-9 * each for each in (0.0, 0.5 / (n * T))), row
            of_a_peak = run.case.asks in ("gain", "Ms", "disk")
            assert of_a_peak or (hz == 0) == (pole(run, n, c, row[end]) > 0), row


def hold_verdict(case, verdict, first):
    """The answer of `check`, as JSON and in words, agree; what is refuted comes first."""
    answer = verdict["answer"]
    words = first.partition(": ")[2]
    worded = {
        "yes": r"(proved )?(stable|as required)",
        "no": r"not (stable|as required)|does not come to rest|UNSTABLE",
        "not known": "not known",
    }
    assert re.match(worded[answer], words), (case.seed, first)
    statuses = [each["status"] for each in verdict["questions"]]
    assert ("refuted" in statuses) == (answer == "no")
    if any(status in ("unknown", "refuted") for status in statuses):
        assert answer != "yes"


def hold_rows(run, table, facts):
    """Each row of the table is of a claim, which holds what the spec asks, and is so."""
    run.rows = table.to_dict("records")
    run.claims = facts["claims"]
    run.facts = facts
    case = run.case
    for row in run.rows:
        run.word = row.get("guarantee", "spec")
        assert run.word in run.claims, row
        c = row.get("c")
        truth = case.inside(run.members(None if c is None or pandas.isna(c) else c))
        if row["intervals"]:
            assert any(a <= row["low"] * (1 + 1e-10) and row["high"] <= b * (1 + 1e-10) for a, b in truth), (row, truth)
        elif run.word == "spec" and row["certified"]:
            assert not truth or greatest(truth) <= 1.01 * case.start, (row, truth)
        if row["intervals"] and not pandas.isna(row.get("fails_from")):
            assert row["fails_from"] >= row["high"]
            assert not any(a < row["fails_from"] < b * (1 - 1e-9) for a, b in truth), (row, truth)
        hold_oscillations(run, row)
    if "for_all" in run.claims:
        scope = run.claims["for_all"]["scope"]
        if case.asks in ("frames", "both") and len(case.members["n"]) > 1:
            assert {*case.members["n"]} <= {*scope["frames"]["lengths"]}
            assert scope["frames"]["order"] == "any"
        if case.asks in ("numbers", "both"):
            (numbers,) = [each for each in scope["numbers"] if each["path"].endswith("c")]
            for value in case.members["c"]:
                assert value in numbers["values"] or numbers["low"] <= value <= numbers["high"]
        if case.asks == "losses":
            assert scope["messages"][0]["lost"] == len(case.members["n"]) - 1
    if case.asks == AT_RANDOM:
        claim = run.claims["mean_square"]
        lost = case.members["lost"]
        said = f"stable in mean square for messages of h lost with probability {lost:g}"
        assert claim["said"].startswith(said), claim
        assert ["loss", lost] in claim["scope"]["messages"][0]["chances"], claim
    assert all("for all" not in run.claims[word]["said"] for word in run.claims if word != "for_all")
