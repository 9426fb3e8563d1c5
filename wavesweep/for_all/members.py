"""Members of what a claim is about: loops at constant frames, whose exact intervals a row for all of them has to lie within.

They are computed by the way of constant rates, which shares neither the plan of frames nor the proofs: a contradiction is a
fault of the one or of the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from wavesweep.engine.intervals import Search
from wavesweep.engine.loop import Loops
from wavesweep.for_all.asked_ranges import values_of_range
from wavesweep.for_all.frame_families import DELAY, RATIO
from wavesweep.for_all.unknown import Case
from wavesweep.for_all.varying import Rules

MOST = 6  # values of each number that varies, its ends among them, beside the spec's own
ROUNDING = 1e-6  # of an end, or of a radius: no contradiction


def members(rules: Rules, case: Case, changes: Mapping[str, float] | None = None) -> list[Loops]:
    """Return loops of a case at constant frames; changes: other numbers of all, such as those of no hand.

    Unknown numbers have the spec's own values, or the nearest of their ranges, and dead times their own whole ticks. None where
    constant frames are not among what is claimed: with messages lost at random, or a step that is not the time of a frame.
    """
    values = {**case.values, **(changes or {})}
    if rules.at_random:
        return []
    for axis in (each for each in case.ranges if each.path not in (changes or {})):
        values[axis.path] = float(np.clip(values[axis.path], axis.start, axis.stop))
    constant = _at_constant_frames(rules, values)
    return [
        Loops(rules.drawing_of(numbers, (case.along,)), numbers).unbuilt for numbers in constant
    ]


def _at_constant_frames(rules, values) -> Iterator[dict[str, object]]:
    """Yield the numbers of the members: combinations of a few values of the numbers that vary from frame to frame."""
    varied = [axis for axis in rules.for_all.changing if not rules.messages]
    choices = []
    for axis in varied:
        tried = values_of_range(axis)
        spread = {tried[i] for i in np.linspace(0, len(tried) - 1, MOST).astype(int).tolist()}
        choices.append(sorted(spread | ({values[axis.path]} & {*tried})))
    for combination in product(*choices):
        numbers = values | dict(zip((axis.path for axis in varied), combination, strict=True))
        frames_differ = any(
            numbers[axis.path] != values[axis.path] and axis.path != DELAY for axis in varied
        )
        if frames_differ and not rules.elapsed:
            continue
        if rules.drawing is None and rules.with_frame:
            numbers[DELAY] = numbers[RATIO]
        yield numbers


def claims_hold(
    rules: Rules,
    cases: Sequence[Case],
    rows: Sequence | None = None,
    changes: Mapping[str, float] | None = None,
) -> bool:
    """Return whether no member of some cases contradicts what is claimed of all: a claim that one does gives way.

    rows: the intervals that are claimed, along the number of the cases; None for a claim about its own value. changes: see
    `members`.
    """
    if not rules.vary and any(_contradicted(case, rows) for case in cases if case.ranges):
        return False
    loops = [(loop, case) for case in cases for loop in members(rules, case, changes)]
    if rows is None:
        return not any(bool((loop.read.radii() > 1 + ROUNDING).any()) for loop, _ in loops)
    return all(_within(rows, loop, case.along, case.span) for loop, case in loops if rows)


def _contradicted(case, rows):
    """Whether some member that is drawn at random is unstable at the case's own value, or within a row."""
    if rows is None:
        return case.contradicts()
    return any(case.contradicts(row.low, row.high) for row in rows)


def _within(rows, loop, along, span):
    """Whether rows lie within the stable intervals of a loop, as far as these are certified."""
    records = Search(
        along, span, ((np.zeros(1, int), loop.read),), lines=False, checked=True
    ).records()
    if not records["certified"].all():
        return True
    stable = [(each["low"], each["high"]) for each in records if each["intervals"]]
    return all(
        any(
            a - ROUNDING * abs(a) <= row.low and row.high <= b + ROUNDING * abs(b)
            for a, b in stable
        )
        for row in rows
    )


def nowhere(loops: Sequence[Loops], along: str, span: tuple[float, float]) -> bool:
    """Return whether there is no value at which all of the loops are stable: their certified intervals have nothing in common,
    beyond rounding."""
    common = [span]
    for loop in loops:
        records = Search(
            along, span, ((np.zeros(1, int), loop.read),), lines=False, checked=True
        ).records()
        if records["certified"].all():
            stable = [(each["low"], each["high"]) for each in records if each["intervals"]]
            both = [(max(low, a), min(high, b)) for low, high in common for a, b in stable]
            common = [
                (low, high)
                for low, high in both
                if low - ROUNDING * abs(low) <= high + ROUNDING * abs(high)
            ]
    return not common
