"""Columns of stable intervals proved in ball arithmetic: a loop along one of its numbers, with
as many bits as it takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import nan

from flint import arb, ctx

from wavesweep.engine.drawing import name_of
from wavesweep.engine.frames import MarginalModes
from wavesweep.engine.loop import Loops
from wavesweep.prove.ball_crossings import (
    Crossing,
    CrowdedError,
    count_outside,
    crossings,
    is_unstable,
)
from wavesweep.prove.ball_polynomials import BallFamily, Budget
from wavesweep.prove.ticks import BallLoop, UndecidedError

PRECISIONS = (128, 256, 512, 1024, 2048, 4096)  # bits
CERTAIN_BITS = 52  # bits of an end or an angle that have to be certain


@dataclass(frozen=True, slots=True)
class Proof:
    """The stable intervals of a column: (low, high, low_omega, high_omega), rounded to doubles.

    omega: rad/s of the oscillation that starts there, 0 at z = 1; NaN if the range ends the
    interval. bits: of the arithmetic.
    """

    intervals: tuple[tuple[float, float, float, float], ...]
    bits: int


def prove_column(
    loop: Loops,
    path: str,
    span: tuple[float, float],
    drift: MarginalModes,
    precisions: Sequence[int] = PRECISIONS,
    # Up to some twenty seconds; counted, so that the result does not depend on the machine.
    operations: float | Budget = 1.2e8,
) -> Proof | None:
    """The stable intervals of a drawn loop along the number with the path `path` within `span`;
    None if they stay in doubt.

    They do if the operations are used up, or if no precision tells crossings apart.

    loop: a single one, the values flat. drift: what drifts in it for every value of the
    number by its structure, which does not decide stability. If digits show more eigenvalues that
    are 1 for every value, no value is stable. But beside a drift of a sum of which changes alone
    are read, as of an `impulse` or before a `difference`, these may be a drift too, and values at
    which all others are inside the circle stay in doubt. precisions: bits, tried one after the
    other. operations: at most, of all precisions together, or what is left of them. Errors:
    ValueError for a loop with dead times in seconds.
    """
    budget = operations if isinstance(operations, Budget) else Budget(operations)
    in_balls = None
    crowded = 0
    for bits in precisions:
        with ctx.workprec(bits):
            try:
                in_balls = in_balls or BallLoop(*loop, name_of(path))
                return _proof(in_balls, span, drift, budget)
            except UndecidedError as error:
                crowded += isinstance(error, CrowdedError)
                # Precisions at which crossings are crowded, after which more bits do not tell them
                # apart.
                if budget.left < 0 or crowded == 3:
                    break
    return None


def _proof(loop, span, drift, budget):
    family = BallFamily(loop, span, budget)
    try:
        ones = family.find_ones()
    except UndecidedError:
        if not all(map(is_unstable, family.over_range())):
            raise
        return Proof((), ctx.prec)
    unexplained = ones > len(drift.states) - len(drift.remaining)
    if unexplained and not _moves_what_reads_a_sum(loop.drawing, drift):
        return Proof((), ctx.prec)
    crossings_found = [Crossing(arb(end), arb("nan")) for end in span]
    for part in family.over_range():
        crossings_found += crossings(part, budget)
    ends = _merged(crossings_found)
    stable = [_is_stable(family, a.value.upper(), b.value.lower()) for a, b in pairwise(ends)]
    if any(map(all, pairwise(stable))):
        raise UndecidedError  # a root that may only touch the circle
    intervals = []
    for (a, b), inside in zip(pairwise(ends), stable, strict=True):
        if inside:
            low, high, *omegas = _rounded(loop, a, b, span)
            if low < high:
                intervals.append((low, high, *omegas))
    if intervals and unexplained:  # more bits tell no more
        return None
    return Proof(tuple(intervals), ctx.prec)


def _moves_what_reads_a_sum(drawing, drift):
    """Whether some shift of a drift moves a sum of firmware and what reads it, but no plant; one
    whose shape depends on numbers may."""
    plants = [plant.name for plant in drawing.plants]
    plants += [block.name for block in drawing.cores if block.plant]
    starts = tuple(f"{name}." for name in plants)
    for lead, followers in drift.constant:
        states = (lead, *(index for index, _ in followers))
        if followers and not any(drift.states[index].startswith(starts) for index in states):
            return True
    return bool(drift.varying)


def _merged(found):
    """Crossings in order, those that may be at the same value as one; of a value at an end of
    the range, the angle is kept."""
    ends = []
    for crossing in sorted(found, key=lambda each: (each.value.lower(), each.value.upper())):
        if ends and not ends[-1].value < crossing.value:
            theta = crossing.theta if ends[-1].theta.is_nan() else ends[-1].theta
            ends[-1] = Crossing(ends[-1].value.union(crossing.value), theta)
        else:
            ends.append(crossing)
    return ends


def _is_stable(family, low, high):
    """Whether all roots are inside the circle between two crossings."""
    for share in (0.5, 0.37, 0.71):
        value = (low + (high - low) * share).mid()
        try:
            return all(count_outside(p) == 0 for p in family.plain(value))
        except UndecidedError:
            continue
    raise UndecidedError


def _rounded(loop, low, high, span):
    """An interval as doubles. Errors: UndecidedError if the bits do not give these."""
    places = [_double(end.value, span) for end in (low, high)]
    omegas = []
    for end, place in zip((low, high), places, strict=True):
        if end.theta.is_nan():
            omegas.append(nan)
            continue
        omega = end.theta * loop.rate(arb(place)) / loop.ticks
        omegas.append(0.0 if omega.contains(0) else _sure(omega))
    return (*places, *omegas)


def _double(value, span):
    """The double next to a ball; 0 and the ends of the range are met exactly if they are in it."""
    for end in (*span, 0.0):
        if value.contains(end):
            return end
    return _sure(value)


def _sure(value):
    if value.rel_accuracy_bits() < CERTAIN_BITS:
        raise UndecidedError
    return float(value.mid())
