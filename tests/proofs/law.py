"""What the package certifies of the rows of a spec, the checker proves.

`python -m proofs.law 0 100` takes random specs, `--sets 0 100` random sets of [for_all], `a.toml b.toml` files; `--seconds 20`
before them is the processor time of each. A line for each says what became of it, and the last ones how many of each kind are
proved, and how many ran out of their time. It ends with 1 if the checker refuses a claim, or if less of a kind is proved than
`LEAST` says.
"""

import contextlib
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
from wavesweep.program.cli import main as command

WORDS = {"varying", "lost", "loss", "burst", "late", "tick", "contact"}  # of [for_all] and of channels
LEAST = 0.98  # share of what is certified of each kind that is proved
WHY = re.compile(r"  (no proof .*)")
KINDS = {"modes": "slices", "refuted": "refuted ends"}


def fate(text: str, folder: Path) -> tuple[Counter, Counter, list[str]]:
    """What is proved of a spec, and what is certified: {"slices": 1, "rows": 2, "refuted ends": 2}; and what is in the way."""
    spec = folder / "law.toml"
    spec.write_text(text, encoding="utf-8")
    name = "zwidth" if "controller" in tomllib.loads(text) else "stability-region"
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        code = command([name, str(spec), "--proof", "--no-plot", "--out", str(folder)]) or 0
    words = said.getvalue()
    why = WHY.findall(words)
    proof = folder / f"{name}.proof"
    if not proof.exists():
        return Counter(), Counter(), why or [words.strip().splitlines()[-1] if words.strip() else f"exit code {code}"]
    proved, certified = counted(text, proof)
    certified["refuted ends"] += sum("refuted end" in line for line in why)
    code, words = checked_file(spec, proof)
    refused = [line for line in words.splitlines() if not line.startswith("proved")][:-2] if code == 1 else []
    return +proved, +certified, why + refused


def counted(text: str, proof: Path) -> tuple[Counter, Counter]:
    """The parts of the question of each kind that have claims without a gap, and all of them; refuted ends that are."""
    tables = spec_of(text.encode())
    header, *lines = lines_of(proof)
    claims = [claim_of(line) for line in lines if "claim" in line]
    proved: Counter = Counter()
    certified: Counter = Counter()
    for ask in map(ask_of, header["question"]):
        line, _ = coverage.with_holes(ask, coverage.pieces_of(tables, ask, claims))
        kind = KINDS.get(ask.claim, "rows")
        nothing = ask.open[:1] == [*ask.sides.values()]  # has no interval
        certified[kind] += ask.claim in coverage.SCOPES and not nothing
        states = ["stated" if coverage.is_stated(ask, piece) else piece.state for piece in line]
        torn = any(states[at - 1 : at + 2] == ["stable", "", "stable"] for at in range(1, len(states)))
        proved[kind] += not torn and ("stable" in states or "unstable" in states)
    refuted = Counter({"refuted ends": sum(claim.claim == "refuted" for claim in claims)})
    return proved + refuted, certified + refuted


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
