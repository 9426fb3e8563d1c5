"""Certified slices of a table proved again on demand, in ball arithmetic, whatever certified them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise
from math import isnan, lcm, nan
from typing import TYPE_CHECKING, Literal

import numpy as np

from wavesweep.analyses.loops import drift_of
from wavesweep.errors import IllPosedLoopError
from wavesweep.loops.dead_time import ROUNDED, timing
from wavesweep.spec.drawing import name_of, scalars
from wavesweep.spec.expressions import value_of
from wavesweep.sweep.grid import Loops

if TYPE_CHECKING:
    from wavesweep.analyses.interval_search import Search

OPERATIONS = 1e8  # of ball arithmetic for a slice, at most: up to some twenty seconds
CLOSE = 1e-9  # relative difference that two proofs of an end may have
LEAST = 1e-5  # share of the range: ends that are nearer to 0 are compared as if they were there
NEAR = 1e-6  # of an end, the distance to both sides in which it is proved alone
FINEST = 64  # parts of a tick, of which dead times are made
Claim = tuple[float, float, float, float]  # an interval: low, high, low_omega, high_omega
Verdict = Literal["whole", "ends", "refuted", "unsettled"]


@dataclass(frozen=True, slots=True)
class ProvedAgain:
    """What ball arithmetic says of a certified slice.

    verdict: "whole" if it proves the same intervals on the whole range; "ends" if that takes too many operations, and it proves
    each end and one value between two ends; "refuted" if it proves something else; otherwise "unsettled". why: in words, of the
    last two.
    """

    verdict: Verdict
    why: str = ""


def prove_again(search: "Search", claims: Sequence[Claim], operations: float = OPERATIONS) -> ProvedAgain:
    """Prove the intervals of a certified slice again in ball arithmetic, whatever certified them.

    search: of this slice alone. claims: its intervals in order. operations: at most, for the whole range, and as many again for
    its ends.
    """
    from wavesweep.prove import prove_column

    loop = _without_dead_times(search.groups[0][1].one(0), search.along)
    if search.bound or loop is None:
        why = "[sweep] require asks for more than stability" if search.bound else "ball arithmetic has no such dead time"
        return ProvedAgain("unsettled", why)
    span = search.span
    if not all(span[0] <= low < high <= span[1] for low, high, *_ in claims):
        return ProvedAgain("refuted", f"its ends are not in order within {span[0]!r} and {span[1]!r}")
    least = LEAST * (span[1] - span[0])
    try:
        drift = drift_of(loop.changed({search.along: np.array(span)}))
    except IllPosedLoopError:
        return ProvedAgain("unsettled", "a loop of direct terms has no solution at an end of the range")

    def difference(part, most):
        proof = prove_column(*loop, search.along, part, len(drift.states) - len(drift.kept), operations=most)
        return None if proof is None else _first_difference(list(_clipped(claims, part)), proof.intervals, part, least)

    whole = difference(span, operations)
    if whole is not None:
        return ProvedAgain("refuted", whole) if whole else ProvedAgain("whole")
    parts = _pieces(claims, span, least)
    of_parts = [difference(part, operations / len(parts)) for part in parts]
    if refuted := next(filter(None, of_parts), ""):
        return ProvedAgain("refuted", refuted)
    return ProvedAgain("unsettled", f"more than {operations:g} operations") if None in of_parts else ProvedAgain("ends")


def _without_dead_times(loop, along):
    """The loop at a faster tick, of which its dead times are whole numbers; None if it cannot be given so.

    A plant that runs more often with the same inputs is the same plant. So no plant may be sampled for another one, which would
    happen more often as well, and no dead time for another. Dead times are meant to be simple parts of a tick, from which they
    differ by rounding.
    """
    drawing, values = loop
    if not drawing.dead_times:
        return loop
    known, plants = scalars(values), {block.name for block in drawing.blocks if block.plant}
    ratio = {name: value_of(tree, known) * drawing.rate(values) for name, tree in drawing.dead_times.items()}
    exact = {name: Fraction(each).limit_denominator(FINEST) for name, each in ratio.items()}
    finer = lcm(*(each.denominator for each in exact.values()))
    inexact = finer > FINEST or any(abs(exact[name] - each) > ROUNDED * max(each, 1) for name, each in ratio.items())
    slower = any(value_of(block.every, known) != 1 for block in drawing.blocks if block.name in exact)
    pairs = [(port.rpartition(".")[0], signal.rpartition(".")[0]) for port, terms in drawing.wires for signal, _ in terms]
    pairs = [(reader, source) for reader, source in pairs if {reader, source} <= plants | exact.keys()]
    sensing = {reader for reader, source in pairs if source in plants}
    sampled = any((reader in plants) == (source in plants) or source in sensing for reader, source in pairs)
    if name_of(along) in timing(drawing) or inexact or slower or sampled:
        return None

    def number(value):
        return "number", float(value), 0

    def at_faster_tick(block):
        if block.name in exact:
            return replace(block, keys=(("steps", number(exact[block.name] * finer)),))
        if block.plant:
            return block
        every, phase = (("*", number(finer), tree, 0) for tree in (block.every, block.phase))
        return replace(block, every=every, phase=phase, phases=tuple(each * finer for each in block.phases))

    tick_hz = ("*", number(finer), drawing.tick_hz, 0)
    return Loops(replace(drawing, tick_hz=tick_hz, blocks=tuple(map(at_faster_tick, drawing.blocks))), values)


def _pieces(claims, span, least):
    """Short parts of the range: about each end of an interval and of the range, and in the middle between two of them."""
    ends = sorted({*span, *(end for claim in claims for end in claim[:2])})
    middles = [(a + b) / 2 for a, b in pairwise(ends)]
    places = sorted([*ends, *middles])
    pieces = []
    for place in places:
        apart = min(abs(other - place) for other in places if other != place) / 2
        radius = min(NEAR * max(abs(place), least), apart)
        pieces.append((max(place - radius, span[0]), min(place + radius, span[1])))
    return pieces


def _clipped(claims, part) -> Iterator[Claim]:
    """Yield the parts of the intervals within a part of the range; no mode oscillates where they are cut off."""
    for low, high, low_omega, high_omega in claims:
        if low < part[1] and high > part[0]:
            omegas = low_omega if low >= part[0] else nan, high_omega if high <= part[1] else nan
            yield max(low, part[0]), min(high, part[1]), *omegas


def _first_difference(claims, proved, part, least):
    """The first difference of intervals that a row claims from those that are proved, in words; empty if there is none."""
    if len(claims) != len(proved):
        return f"{len(proved)} stable intervals and not {len(claims)} from {part[0]!r} to {part[1]!r}"
    for one, other in zip(claims, proved, strict=True):
        for name, a, b in zip(("low", "high"), one, other, strict=False):
            if abs(a - b) > CLOSE * max(abs(a), abs(b), least):
                return f"{name} is {b!r} and not {a!r}"
        for name, a, b in zip(("low_omega", "high_omega"), one[2:], other[2:], strict=True):
            if (isnan(a), a > 0) != (isnan(b), b > 0):
                return f"{name} is {b!r} and not {a!r}"
    return ""
