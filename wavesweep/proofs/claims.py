"""The claims of a proof file: stretches of one number, with how many modes are outside in each."""

import gzip
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Any

from wavesweep.checker import file
from wavesweep.checker.balls import Refused
from wavesweep.proofs.cells import (
    Cell,
    cell_of,
    cells_along,
    exactly,
    stays_on_circle,
    stretches,
    tree,
)
from wavesweep.proofs.drifts import drifts_of

PLACES = 0.31, 0.77  # of a range, at which a mode is looked for that is on the circle everywhere
Lines = list[dict[str, Any]]
Found = tuple[float, float, int]  # a stretch, and how many modes are outside


def claims_along(
    tables: dict,
    numbers: Mapping[str, str],
    name: str,
    span: tuple[float, float],
    ends: Sequence[float],
) -> Iterator[tuple[Found, Lines]]:
    """Yield the stretches of a number and their lines.

    numbers: the others that are set. ends: those of stable intervals, as far as they are known.
    Errors: Refused, Unreadable.
    """
    sides = {name: (exactly(span[0]), exactly(span[1]))}
    family, claim = _family(tables, numbers, sides)
    low, high = span
    for place in PLACES:
        if stays_on_circle(family, {name: (low + place * (high - low),) * 2}):
            raise Refused("a mode stays next to the unit circle")
    for run in stretches(cells_along(family, name, *span, ends)):
        low = run[0].low
        high = run[-1].high
        outside = run[0].outside
        head = claim | {"sides": {name: [repr(low), repr(high)]}, "outside": outside}
        yield (low, high, outside), [head, *tree(name, run)]


def claim_of_point(tables: dict, numbers: Mapping[str, str]) -> tuple[int, Lines] | None:
    """Return how many modes of a loop are outside, and the lines; None without a form."""
    family, claim = _family(tables, numbers, {})
    found = cell_of(family, {})
    if not isinstance(found, Cell):
        return None
    return found.outside, [claim | {"outside": found.outside}, found.line]


def _family(tables, numbers, sides):
    exact = {name: Fraction(value) for name, value in numbers.items()}
    claim = file.Claim("modes", exact, sides, 0)
    claim.drifts = drifts_of(tables, claim)
    family = file.family_of(tables, claim)
    head = {
        "claim": "modes",
        "numbers": dict(numbers),
        "drifts": claim.drifts,
        "states": family.states,
    }
    return family, head


def write(place: Path, spec: bytes, claims: Iterable[Lines]) -> int:
    """Write a proof file about a spec; return how many claims it has."""
    claims = list(claims)
    header = {"format": file.FORMAT, "sha256": sha256(spec).hexdigest(), "claims": len(claims)}
    # Without a time and a name in it, so that equal runs give equal bytes.
    with place.open("wb") as raw, gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed:
        for line in (header, *(line for lines in claims for line in lines)):
            packed.write(json.dumps(line, separators=(",", ":")).encode() + b"\n")
    return len(claims)
