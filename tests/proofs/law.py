"""What the package certifies of a spec's own loop along its number, the checker proves.

`python -m proofs.law 0 100` takes random specs, `python -m proofs.law a.toml b.toml` files. A line for each says what became of
it, and the last ones how many of each kind are proved. It ends with 1 if a row has other ends than its proof, if the checker
refuses one, or if less of what is certified is proved than `LEAST` says.
"""

import sys
import tempfile
import time
import tomllib
from collections import Counter
from pathlib import Path

from meaning.judge import compiled
from meaning.specs import spec_text

from wavesweep.checker.balls import Refused
from wavesweep.checker.file import check, spec_of
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.proofs.claims import claims_along, write
from wavesweep.proofs.of_table import checked_name, end_without_proof, ends_of

PROVED = "proved"
ASIDE = ("no axis", "in doubt")  # nothing is certified
LEAST = 0.98  # share of certified specs of each kind that are proved


def fate(text: str, folder: Path) -> str:
    """What becomes of the own rows of a spec along its number: "proved", one of ASIDE, or what is in the way."""
    loop = compiled(text, folder)
    spec = loop.spec
    axis = next((axis for axis in spec.sweep if axis.name == spec.along), None)
    if axis is None or axis.structural:
        return "no axis"
    rows = loop.stable_intervals(along=axis.name, span=(axis.start, axis.stop))
    rows = {name: rows[name].to_numpy() for name in rows}
    if "guarantee" in rows:
        rows = {name: column[rows["guarantee"] == "spec"] for name, column in rows.items()}
    if not rows["certified"].all():
        return "in doubt"
    span = float(axis.start), float(axis.stop)
    source = text.encode()
    try:
        found = list(claims_along(spec_of(source), {}, checked_name(axis.path), span, ends_of(rows, span)))
    except Unreadable as error:
        return f"not read: {error}"
    except Refused as error:
        return f"no form: {error}"
    if end := end_without_proof(rows, [stretch for stretch, _ in found], span):
        return f"another end than {end}"
    place = folder / "law.proof"
    write(place, source, [lines for _, lines in found])
    with place.open("rb") as file:
        refused = [why for _, why in check(source, file) if why]
    return f"refused by the checker: {refused[0]}" if refused else PROVED


def kind_of(text: str) -> str:
    tables = tomllib.loads(text)
    return tables["controller"]["kind"] if "controller" in tables else "drawn"


def main(arguments: list[str]) -> int:
    if arguments[0].endswith(".toml"):
        texts = {name: Path(name).read_text(encoding="utf-8") for name in arguments}
    else:
        texts = {str(number): spec_text(number, quick=True) for number in range(*map(int, arguments))}
    proved = Counter()
    certified = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            start = time.process_time()
            found = fate(text, Path(folder))
            print(f"{name} {kind_of(text)} {time.process_time() - start:.1f} s: {found}", flush=True)  # noqa: T201
            proved[kind_of(text)] += found == PROVED
            certified[kind_of(text)] += found not in ASIDE
    for kind, count in sorted(certified.items()):
        print(f"{kind}: {proved[kind]} of {count} proved")  # noqa: T201
    return int(any(proved[kind] < LEAST * count for kind, count in certified.items()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
