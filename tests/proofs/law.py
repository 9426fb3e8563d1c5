"""What the package certifies of the rows of a spec, the checker proves.

`python -m proofs.law 0 100` takes random specs, `--sets 0 100` random sets of [for_all], `a.toml b.toml` files. A line for each
says what became of it, and the last ones how many of each kind are proved. It ends with 1 if the checker refuses a claim, or if
less of a kind is proved than `LEAST` says.
"""

import contextlib
import io
import re
import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path

from meaning.sets import set_of
from meaning.specs import spec_text, toml
from support.proofs import checked_file

from wavesweep.program.cli import main as command

LEAST = 0.98  # share of what is certified of each kind that is proved
COUNTS = re.compile(r"(\d+) of (\d+) (slices|rows|refuted ends)")
WHY = re.compile(r"  no proof of \d+ (.*)|no proof file for (.*)")


def fate(text: str, folder: Path) -> tuple[Counter, Counter, list[str]]:
    """What is proved of a spec, and what is certified: {"slices": 1, "rows": 2, "refuted ends": 2}; and what is in the way."""
    spec = folder / "law.toml"
    spec.write_text(text, encoding="utf-8")
    name = "zwidth" if "controller" in tomllib.loads(text) else "stability-region"
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(said):
        code = command([name, str(spec), "--proof", "--no-plot", "--out", str(folder)]) or 0
    words = said.getvalue()
    counts = COUNTS.findall(words)
    why = [first or second for first, second in WHY.findall(words)]
    proved = Counter({kind: int(count) for count, _, kind in counts})
    certified = Counter({kind: int(count) for _, count, kind in counts})
    if not counts:
        return proved, certified, why or [words.strip().splitlines()[-1] if words.strip() else f"exit code {code}"]
    code, words = checked_file(spec, folder / f"{name}.proof")
    refused = [line for line in words.splitlines() if not line.startswith("proved")][:-1] if code else []
    return proved, certified, why + refused


def kind_of(text: str) -> str:
    tables = tomllib.loads(text)
    return tables["controller"]["kind"] if "controller" in tables else "drawn"


def texts_of(arguments: list[str]) -> dict[str, str]:
    if arguments[0].endswith(".toml"):
        return {name: Path(name).read_text(encoding="utf-8") for name in arguments}
    if arguments[0] == "--sets":
        return {str(number): toml(set_of(number)) for number in range(*map(int, arguments[1:]))}
    return {str(number): spec_text(number, quick=True) for number in range(*map(int, arguments))}


def main(arguments: list[str]) -> int:
    proved = Counter()
    certified = Counter()
    wrong = False
    for name, text in texts_of(arguments).items():
        start = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            own, whole, why = fate(text, Path(folder))
        wrong |= any(line.startswith("REFUSED") for line in why)
        parts = [f"{own[kind]} of {count} {kind}" for kind, count in whole.items()]
        print(name, kind_of(text), f"{time.process_time() - start:.1f} s:", "; ".join(parts + why), flush=True)  # noqa: T201
        proved += Counter({f"{kind_of(text)}, {kind}": count for kind, count in own.items()})
        certified += Counter({f"{kind_of(text)}, {kind}": count for kind, count in whole.items()})
    for kind, count in sorted(certified.items()):
        print(f"{kind}: {proved[kind]} of {count} proved")  # noqa: T201
    return int(wrong or any(proved[kind] < LEAST * count for kind, count in certified.items()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
