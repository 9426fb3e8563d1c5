"""What the package certifies of a spec's own loop along its number, the checker proves.

`python -m proofs.law 0 100` takes random specs, `python -m proofs.law a.toml b.toml` files. It names what has no proof, and
ends with 1 if a row has other ends than its proof, or if the checker refuses one.
"""

import sys
import tempfile
from collections import Counter
from pathlib import Path

from meaning.judge import compiled
from meaning.specs import spec_text

from wavesweep.checker.balls import Refused
from wavesweep.checker.file import check, spec_of
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.proofs.claims import claims_along, write
from wavesweep.proofs.of_table import checked_name, end_without_proof, ends_of

SAME = "proved"


def fate(text: str, folder: Path) -> str:
    """What becomes of the own rows of a spec along its number: "proved", "in doubt", or what is in the way."""
    loop = compiled(text, folder)
    if isinstance(loop, str):
        return "refused by the package"
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
        return f"no form: {str(error)[:12]}"
    if end := end_without_proof(rows, [stretch for stretch, _ in found], span):
        return f"ANOTHER END {end}"
    place = folder / "law.proof"
    write(place, source, [lines for _, lines in found])
    with place.open("rb") as file:
        refused = [why for _, why in check(source, file) if why]
    return f"REFUSED {refused[0]}" if refused else SAME


def main(arguments: list[str]) -> int:
    if arguments[0].endswith(".toml"):
        texts = {name: Path(name).read_text(encoding="utf-8") for name in arguments}
    else:
        texts = {str(number): spec_text(number, quick=True) for number in range(*map(int, arguments))}
    fates = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            found = fate(text, Path(folder))
            fates[found] += 1
            if found != SAME:
                print(f"{name}: {found}", flush=True)  # noqa: T201
    print(*(f"{count} {found}" for found, count in fates.most_common()), sep="\n")  # noqa: T201
    return int(any(found.startswith(("REFUSED", "ANOTHER")) for found in fates))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
