"""What the package certifies of the rows of a spec, the checker proves.

`python -m proofs.law 0 100` takes random specs, `--sets 0 100` random sets of [for_all], `a.toml b.toml` files; `--seconds 20`
before them is the processor time of each. A line for each says what became of it, and the last ones how many of each kind are
proved, and how many ran out of their time. It ends with 1 if the checker refuses a claim, or if less of a kind is proved than
`LEAST` says.
"""

import contextlib
import csv
import io
import json
import os
import re
import resource
import sys
import tempfile
import tomllib
import traceback
from collections import Counter
from pathlib import Path

from meaning.sets import set_of
from meaning.specs import spec_text, toml
from support.proofs import checked_file, lines_of

from wavesweep.checker import coverage
from wavesweep.checker.file import ask_of, claim_of, spec_of
from wavesweep.checker.reader import path_of
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.program.cli import main as command

WORDS = {"varying", "lost", "loss", "burst", "late", "tick", "contact"}  # of [for_all] and of channels
LEAST = 0.98  # share of what is certified of each kind that is proved
WHY = re.compile(r"  (no proof .*)")
AT_ENDS = 1e-7  # of an interval or its end, that may be left out
CLAIMS = {"for_all": "for all", "mean_square": "mean square", "contact": "contact"}  # of rows
KINDS = {"modes": "slices", "refuted": "refuted ends"}


def fate(text: str, folder: Path) -> tuple[Counter, Counter, list[str]]:
    """What is proved of a spec, and what is certified: {"slices": 1, "rows": 2, "refuted ends": 2}; and what is in the way."""
    spec = folder / "law.toml"
    spec.write_text(text, encoding="utf-8")
    name = "zwidth" if "controller" in tomllib.loads(text) else "stability-region"
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        code = command([name, str(spec), "--proof", "--no-plot", "--out", str(folder)]) or 0
    words = said.getvalue().replace("\n    ", " ")
    why = WHY.findall(words)
    proof = folder / f"{name}.proof"
    if not proof.exists():
        return Counter(), Counter(), why or [words.strip().splitlines()[-1] if words.strip() else f"exit code {code}"]
    with (folder / f"{name}.csv").open(encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    proved, certified = counted(text, proof, rows)
    certified["refuted ends"] += sum("refuted end" in line for line in why)
    code, words = checked_file(spec, proof)
    refused = [line for line in words.splitlines() if not line.startswith("proved")][:-2] if code == 1 else []
    return +proved, +certified, why + refused


def counted(text: str, proof: Path, rows: list[dict]) -> tuple[Counter, Counter]:
    """The parts of the question of each kind whose stable rows have claims to their ends, or which have a claim where there is
    no such row, and all of them; refuted ends that are."""
    tables = spec_of(text.encode())
    header, *lines = lines_of(proof)
    claims = coverage.Claims(tables, [claim_of(line) for line in lines if "claim" in line])
    proved: Counter = Counter()
    certified: Counter = Counter()
    for ask in map(ask_of, header["question"]):
        line, _ = coverage.with_holes(ask, claims.pieces_of(ask))
        kind = KINDS.get(ask.claim, "rows")
        nothing = ask.open[:1] == [*ask.sides.values()]  # has no interval
        certified[kind] += ask.claim in coverage.SCOPES and not nothing
        intervals = [(float(row["low"]), float(row["high"])) for row in rows if row["low"] and is_of(row, ask, tables)]
        states = {piece.state for piece in line}
        proved[kind] += all(is_covered(ask, line, *ends) for ends in intervals) and bool(
            states & {"stable", "within", "unstable"}
        )
    refuted = Counter({"refuted ends": sum(claim.claim == "refuted" for claim in claims.claims)})
    return proved + refuted, certified + refuted


def is_of(row: dict, ask: coverage.Ask, tables: dict) -> bool:
    """Whether a row of the table is of this part of the question."""
    asked = {path_of(tables, name): float(value) for name, value in ask.numbers.items()}
    for column, cell in row.items():
        with contextlib.suppress(Unreadable):
            if asked.get(path_of(tables, column), cell) not in (cell, float(cell or "nan")):
                return False
    return CLAIMS.get(row.get("guarantee", ""), "modes") == ask.claim


def is_covered(ask: coverage.Ask, line: list[coverage.Piece], low: float, high: float) -> bool:
    """Whether pieces and stated openings leave nothing out of a stable interval."""
    left_out = 0.0
    for piece in line:
        if piece.state not in ("stable", "within") and not coverage.is_stated(ask, piece):
            left_out += max(0.0, min(high, float(piece.high)) - max(low, float(piece.low)))
    return left_out <= AT_ENDS * max(abs(low), abs(high), high - low)


def fate_within(seconds: int, text: str) -> tuple[Counter, Counter, list[str], float] | None:
    """The same and the seconds that it took, in a process of its own; None if these are more than it has."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        try:
            with tempfile.TemporaryDirectory() as folder, os.fdopen(write, "w") as out:
                json.dump(fate(text, Path(folder)), out)
            os._exit(0)
        finally:
            traceback.print_exc()
            os._exit(1)
    os.close(write)
    with os.fdopen(read) as answer:
        said = answer.read()
    _, status, spent = os.wait4(child, 0)
    if os.WIFSIGNALED(status):
        return None
    proved, certified, why = json.loads(said)
    return Counter(proved), Counter(certified), why, spent.ru_utime + spent.ru_stime


def kind_of(text: str) -> str:
    """The controller, and what [for_all] and channels have."""
    tables = tomllib.loads(text)
    kind = tables["controller"]["kind"] if "controller" in tables else "drawn"
    allowed = [
        ("varying" if "varying" in str(given) else key if key in WORDS else "numbers", given)
        for key, given in tables.get("for_all", {}).items()
    ]
    of_sets = {what for what, given in allowed if given} | {
        key for block in tables.get("block", {}).values() if block["type"] == "channel" for key in WORDS & block.keys()
    }
    return " ".join([kind, *sorted(of_sets)])


def texts_of(arguments: list[str]) -> dict[str, str]:
    if arguments[0].endswith(".toml"):
        return {name: Path(name).read_text(encoding="utf-8") for name in arguments}
    if arguments[0] == "--sets":
        return {str(number): toml(set_of(number)) for number in range(*map(int, arguments[1:]))}
    return {str(number): spec_text(number, quick=True) for number in range(*map(int, arguments))}


def main(arguments: list[str]) -> int:
    seconds = 600
    if arguments[0] == "--seconds":
        _, given, *arguments = arguments
        seconds = int(given)
    proved = Counter()
    certified = Counter()
    late = Counter()
    wrong = False
    for name, text in texts_of(arguments).items():
        kind = kind_of(text)
        found = fate_within(seconds, text)
        if found is None:
            print(name, kind, f"more than {seconds} s", flush=True)  # noqa: T201
            late[kind] += 1
            continue
        own, whole, why, spent = found
        wrong |= any(line.startswith(("REFUSED", "not checked", "Traceback")) for line in why)
        parts = [f"{own[what]} of {count} {what}" for what, count in whole.items()]
        print(name, kind, f"{spent:.1f} s:", "; ".join(parts + why), flush=True)  # noqa: T201
        proved += Counter({f"{kind}, {what}": count for what, count in own.items()})
        certified += Counter({f"{kind}, {what}": count for what, count in whole.items()})
    for kind, count in sorted(certified.items()):
        print(f"{kind}: {proved[kind]} of {count} proved")  # noqa: T201
    for kind, count in sorted(late.items()):
        print(f"{kind}: {count} took more than {seconds} s")  # noqa: T201
    return int(wrong or any(proved[kind] < LEAST * count for kind, count in certified.items()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
