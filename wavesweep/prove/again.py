"""Certified slices of a table proved again on demand, in ball arithmetic, whatever certified
them."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import isnan, nan
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.program.tables.kind import ProvedAgain

if TYPE_CHECKING:
    from wavesweep.engine.intervals import Search

SAME_END = 1e-9  # relative difference that two proofs of an end may have
AS_ZERO = 1e-5  # share of the range: ends that are nearer to 0 are compared as if they were there
PROVED_ALONE = 1e-6  # of an end, the distance to both sides in which it is proved alone
Claim = tuple[float, float, float, float]  # an interval: low, high, low_omega, high_omega


def prove_again(
    search: "Search",
    claims: Sequence[Claim],
    operations: float = 1e8,  # of ball arithmetic for a slice, at most: some twenty seconds
) -> ProvedAgain:
    """Prove the intervals of a certified slice again in ball arithmetic, whatever certified them.

    search: of this slice alone. claims: its intervals in order. operations: at most, for the whole
    range, and as many again for its ends.
    """
    from wavesweep.prove.columns import prove_column

    loop = search.groups[0][1].one(0)
    in_ticks = loop.in_whole_ticks(search.along)
    if search.bound:
        return ProvedAgain("unsettled", "[sweep] require asks for more than stability")
    if in_ticks is None:
        return ProvedAgain("unsettled", "ball arithmetic has no such dead time")
    loop = in_ticks
    span = search.span
    if not all(span[0] <= low < high <= span[1] for low, high, *_ in claims):
        return ProvedAgain(
            "refuted", f"its ends are not in order within {span[0]!r} and {span[1]!r}"
        )
    least = AS_ZERO * (span[1] - span[0])
    try:
        drift = loop.changed({search.along: np.array(span)}).drift_of_frames()
    except IllPosedLoopError:
        return ProvedAgain(
            "unsettled", "a loop of direct terms has no solution at an end of the range"
        )

    def difference(part, most):
        proof = prove_column(loop, search.along, part, drift, operations=most)
        if proof is None:
            return None
        return _first_difference(list(_clipped(claims, part)), proof.intervals, part, least)

    problem = difference(span, operations)
    if problem is not None:
        if problem:
            return ProvedAgain("refuted", problem)
        return ProvedAgain("whole")
    pieces = _pieces(claims, span, least)
    of_parts = [difference(piece, operations / len(pieces)) for piece in pieces]
    if refuted := next(filter(None, of_parts), ""):
        return ProvedAgain("refuted", refuted)
    if None in of_parts:
        return ProvedAgain("unsettled", f"more than {operations:g} operations")
    return ProvedAgain("ends")


def _pieces(claims, span, least):
    """Short parts of the range: about each end of an interval and of the range, and in the
    middle between two of them."""
    ends = sorted({*span, *(end for claim in claims for end in claim[:2])})
    middles = [(a + b) / 2 for a, b in pairwise(ends)]
    places = sorted([*ends, *middles])
    pieces = []
    for place in places:
        apart = min(abs(another - place) for another in places if another != place) / 2
        radius = min(PROVED_ALONE * max(abs(place), least), apart)
        pieces.append((max(place - radius, span[0]), min(place + radius, span[1])))
    return pieces


def _clipped(claims, part) -> Iterator[Claim]:
    """Yield the parts of the intervals within a part of the range; no mode oscillates where they
    are cut off."""
    for low, high, low_omega, high_omega in claims:
        if low < part[1] and high > part[0]:
            omegas = low_omega if low >= part[0] else nan, high_omega if high <= part[1] else nan
            yield max(low, part[0]), min(high, part[1]), *omegas


def _first_difference(claims, proved, part, least):
    """The first difference of intervals that a row claims from those that are proved, in words;
    empty if there is none."""
    if len(claims) != len(proved):
        return (
            f"{len(proved)} stable intervals and not {len(claims)} from {part[0]!r} to {part[1]!r}"
        )
    for claim, row in zip(claims, proved, strict=True):
        for name, a, b in zip(("low", "high"), claim, row, strict=False):
            if abs(a - b) > SAME_END * max(abs(a), abs(b), least):
                return f"{name} is {b!r} and not {a!r}"
        for name, a, b in zip(("low_omega", "high_omega"), claim[2:], row[2:], strict=True):
            if (isnan(a), a > 0) != (isnan(b), b > 0):
                return f"{name} is {b!r} and not {a!r}"
    return ""
