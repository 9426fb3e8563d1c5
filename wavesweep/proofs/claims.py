"""The claims of a proof file: stretches of one number, with how many modes are outside in each, sets
of loops, and what refutes them."""

import gzip
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import partial
from hashlib import sha256
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from wavesweep.checker import balls, file
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader import for_all, loop_of, with_numbers
from wavesweep.program.tables.refuters import Refuter
from wavesweep.proofs.cells import (
    WINDOW,
    Cell,
    cell_of,
    cells_along,
    exactly,
    stays_on_circle,
    stretches,
    tree,
)
from wavesweep.proofs.drifts import drifts_of
from wavesweep.proofs.planes import Part, lines_of, lines_within
from wavesweep.proofs.refuted import word_of
from wavesweep.proofs.sets import Cells, decimals, lines_over

PLACES = 0.31, 0.77  # of a range, at which a mode is looked for that is on the circle everywhere
Lines = list[dict[str, Any]]
Found = tuple[float, float, int]  # a stretch, and how many modes are outside


def claims_along(
    tables: dict,
    numbers: Mapping[str, str],
    name: str,
    span: tuple[float, float],
    ends: Sequence[float],
    radius: float = 1.0,
    cut: str = "",
) -> Iterator[tuple[Found, Lines]]:
    """Yield the stretches of a number and their lines.

    numbers: the others that are set. ends: those of stable intervals, as far as they are known.
    radius: of the circle outside of which modes are counted. cut: the signal of which the number is a
    factor or a phase. Errors: Refused, Unreadable.
    """
    sides = {name: (exactly(span[0]), exactly(span[1]))}
    family, claim = _family(tables, numbers, sides, radius, cut)
    low, high = span
    for place in PLACES:
        if stays_on_circle(family, {name: (low + place * (high - low),) * 2}):
            raise Refused("a mode stays next to the unit circle")
    for run in stretches(cells_along(name, *span, ends, partial(cell_of, family))):
        low = run[0].low
        high = run[-1].high
        outside = run[0].outside
        head = claim | {"sides": {name: [repr(low), repr(high)]}, "outside": outside}
        yield (low, high, outside), [head, *tree(name, run)]


def claims_again(tables: dict, numbers: Mapping[str, str], claims: Sequence[Lines]) -> list[Lines]:
    """Return claims of the own loop with other numbers, none if the checker refuses one of them.
    Errors: Unreadable."""
    found: list[Lines] = []
    for head, *cells in claims:
        own = head | {"numbers": dict(numbers)}
        claim = file.claim_of(own)
        try:
            family = file.family_of(tables, claim)
            if family.states != claim.states:
                return []
            file.check_cells(family, claim, iter(cells))
        except Refused:
            return []
        found.append([own, *cells])
    return found


def claim_at(tables: dict, kind: str, numbers: Mapping[str, str], radius: float = 1.0) -> Lines:
    """Return the lines of a claim without a range: how many modes are outside a circle, or what
    `claim_of_set` has. Errors: Refused, Unreadable."""
    if kind != "modes":
        return claim_of_set(tables, kind, numbers, None)
    family, claim = _family(tables, numbers, {}, radius)
    found = cell_of(family, {})
    if not isinstance(found, Cell):
        raise Refused("an eigenvalue is next to the circle")
    return [claim | {"outside": found.outside}, found.line]


def claim_of_set(
    tables: dict,
    kind: str,
    numbers: Mapping[str, str],
    along: tuple[str, float, float] | None,
    refuter: tuple[float, str] = (np.inf, ""),
) -> Lines:
    """Return the lines of a claim about all that [for_all] and channels say.

    kind: "for all" or "mean square". along: the number of a row with its ends; None for the spec's own
    numbers. refuter: the number beyond the row that is refuted, and by what. Where no form is found
    next to the low end, the claim begins beyond. Errors: Refused, Unreadable.
    """
    allowed = for_all.read(tables, balls.exact)
    sides = {}
    if along:
        name, low, high = along
        sides[name] = exactly(low), exactly(high)
    claim = file.Claim(kind, _exact(numbers), sides | allowed.ranges)
    written = {name: [decimals(low), decimals(high)] for name, (low, high) in claim.sides.items()}
    head = {"claim": kind, "numbers": dict(numbers), "sides": written}
    lines: Lines = []
    beyond, text = refuter
    families = []
    for member in allowed.members:
        claim.drifts = drifts_of(tables, claim, member)
        families.append((member, claim.drifts, file.family_of(tables, claim, member)))
    constant = kind == "for all" and not allowed.ranges and "" in families[0][2].frames.words
    if along and constant:
        low, high = _closed_ends([family for *_, family in families], name, low, high)
        written[name] = [repr(low), repr(high)]
    for member, drifts, family in families:
        claim.drifts = drifts
        claim.states = family.states
        own = _coordinates(claim)
        if member:
            lines.append({"member": _texts(member)} | own)
        else:
            head |= own
        if along and constant:
            lines += _constant(family, name, low, high)
            continue
        cells = Cells.of(family, claim, beyond)
        words = []
        if kind == "for all":
            words.append(cells.cycle)
        if kind == "for all" and text:
            words.append(cells.word(word_of(tables, claim, _refuter(text))))
        begins, tree_of_cells = lines_over(cells, [word for word in words if word])
        lines += tree_of_cells
        if along and begins > cells.whole[0, 0]:
            if len(allowed.members) > 1:
                raise Refused(f"no forms are found next to {name} = {low:.6g}")
            written[name] = [decimals(cells.number(0, begins)), written[name][1]]
    return [head, *lines]


def _texts(member: Mapping[str, Any]) -> dict[str, str]:
    """The values of a member of [for_all] as a proof file has them."""
    return {
        name: str(value) if value == "frame" else decimals(value) for name, value in member.items()
    }


def _closed_ends(families: Sequence[file.Family], name: str, *ends: float) -> list[float]:
    """The ends of a range, without a window about one at which a mode of a family is on the circle."""
    low, high = ends
    windows = WINDOW * (high - low), -WINDOW * abs(high)
    found = []
    for end, window in zip(ends, windows, strict=True):
        cells = [cell_of(family, {name: (end, end)}) for family in families]
        closed = all(isinstance(cell, Cell) for cell in cells)
        found.append(end if closed else end + window)
    return found


def _constant(family: file.Family, name: str, low: float, high: float) -> Lines:
    """The cells of a loop that is stable from one number to another. Errors: Refused."""
    runs = list(stretches(cells_along(name, low, high, [], partial(cell_of, family))))
    whole = [run for run in runs if (run[0].low, run[-1].high, run[0].outside) == (low, high, 0)]
    if not whole:
        raise Refused(f"no forms are found from {name} = {low:.6g} to {high:.6g}")
    return list(tree(name, whole[0]))


def _refuter(text: str) -> Refuter:
    """What a table says that refutes a value. Errors: Refused for what is no member and no pattern, or of a wall."""
    with suppress(ValueError):
        refuter = Refuter.read(text)
        if not refuter.wall:
            return refuter
    raise Refused(f"what refutes it is no member and no whole pattern: {text}")


def claim_refuted(tables: dict, numbers: Mapping[str, str], text: str) -> Lines:
    """Return the lines of a claim that a member of [for_all], with its frames, is unstable.

    text: what refutes, as it is printed. Errors: Refused, Unreadable.
    """
    refuter = _refuter(text)
    whole = {**numbers, **refuter.numbers}
    claim = file.Claim("for all", _exact(whole))
    claim = file.Claim("refuted", claim.numbers, outside=1, word=word_of(tables, claim, refuter))
    claim.drifts = drifts_of(tables, claim)
    family = file.family_of(tables, claim)
    claim.states = family.states
    found = cell_of(family, {})
    if not isinstance(found, Cell) or not found.outside:
        raise Refused(f"no form is found of what refutes it: {text}")
    head = {"claim": "refuted", "numbers": whole, "outside": found.outside, "word": claim.word}
    return [head | _coordinates(claim), found.line]


def claim_of_factors(
    tables: dict, numbers: Mapping[str, str], sides: Mapping[str, tuple[float, float]], cut: str
) -> Lines:
    """Return the lines of a claim of stability all over a number and factors at a cut. Errors: Refused, Unreadable."""
    exact = {name: (exactly(low), exactly(high)) for name, (low, high) in sides.items()}
    family, head = _family(tables, numbers, exact, cut=cut)
    written = {name: [decimals(low), decimals(high)] for name, (low, high) in exact.items()}
    cells = lines_within(family, [*sides], np.array([*sides.values()]).T)
    return [head | {"sides": written, "outside": 0}, *cells]


def claim_of_plane(
    tables: dict,
    numbers: Mapping[str, str],
    ends: Mapping[str, tuple[float, float]],
    parts: Sequence[Part],
) -> tuple[float, Lines]:
    """Return the share of a map that is proved, and its lines. ends: of its numbers; parts: what is known
    of each. Errors: Refused, Unreadable."""
    sides = {name: (exactly(low), exactly(high)) for name, (low, high) in ends.items()}
    family, head = _family(tables, numbers, sides)
    written = {name: [decimals(low), decimals(high)] for name, (low, high) in sides.items()}
    share, cells = lines_of(family, [*sides], parts)
    return share, [head | {"sides": written, "open": True}, *cells]


def times_of(tables: dict, numbers: Mapping[str, str]) -> tuple[float, float]:
    """Return how long a tick and a frame of the own loop take (s). Errors: Unreadable."""
    loop = loop_of(with_numbers(tables, _exact(numbers)), balls)
    return float(loop.T), float(loop.schedule().period)


def radii_at(
    tables: dict, numbers: Mapping[str, str], along: Mapping[str, Sequence[float]]
) -> list[float]:
    """Return the spectral radii of the own loop over a frame, in doubles, for each combination of
    values of some numbers, without what drifts for all of them. Errors: Refused, Unreadable."""
    sides = {name: (exactly(min(values)), exactly(max(values))) for name, values in along.items()}
    family, _ = _family(tables, numbers, sides)
    radii = []
    for point in product(*along.values()):
        ends = {name: (exactly(value),) * 2 for name, value in zip(along, point, strict=True)}
        A = np.array(family.matrix("", balls.Cell(ends)).parts[()], float) / balls.ONE
        radii.append(float(np.abs(np.linalg.eigvals(A)).max(initial=0)) if len(A) else 0.0)
    return radii


def _family(tables, numbers, sides, radius=1.0, cut=""):
    claim = file.Claim("modes", _exact(numbers), sides, 0, radius=exactly(radius), cut=cut)
    claim.drifts = drifts_of(tables, claim)
    family = file.family_of(tables, claim)
    claim.states = family.states
    head = {"claim": "modes", "numbers": dict(numbers)} | _coordinates(claim)
    if cut:
        head["cut"] = cut
    return family, head if radius == 1 else head | {"radius": repr(radius)}


def _exact(numbers):
    return {name: Fraction(value) for name, value in numbers.items()}


def _coordinates(claim):
    return {"drifts": claim.drifts, "states": claim.states}


def write(
    place: Path, spec: bytes, ran: str, question: Sequence[dict], claims: Sequence[Lines]
) -> None:
    """Write a proof file about a spec."""
    header: dict[str, Any] = {"format": file.FORMAT, "sha256": sha256(spec).hexdigest(), "of": ran}
    header |= {"question": [*question], "claims": len(claims)}
    # Without a time and a name in it, so that equal runs give equal bytes.
    with place.open("wb") as raw, gzip.GzipFile("", "wb", fileobj=raw, mtime=0) as packed:
        for line in (header, *(line for lines in claims for line in lines)):
            packed.write(json.dumps(line, separators=(",", ":")).encode() + b"\n")
