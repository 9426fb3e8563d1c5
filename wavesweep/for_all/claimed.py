"""What a proof for all of [for_all] is a claim about: the plans and the ranges that it used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from wavesweep.for_all.plan import LOST
from wavesweep.for_all.unknown import Case
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.claims import (
    Frames,
    Messages,
    Order,
    Range,
    Scope,
    messages_of,
    own_scope,
)

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def scope_of(spec: Spec, rules: Rules, cases: Sequence[Case]) -> Scope:
    """The loops of some cases, whose frames are those of the plan of each; spec: has the numbers
    of all other keys."""
    frames = own_scope(spec).frames
    messages: tuple[Messages, ...] = ()
    table = rules.for_all
    if rules.messages:
        messages = messages_of(rules.drawing, cases[0].values)
    if rules.vary and (not rules.messages or table.changing):
        frames = _common([_frames(rules, case) for case in cases])
    return Scope(_numbers(rules, cases), frames, messages)


def _frames(rules: Rules, case: Case) -> Frames:
    """The frames of the plan of a case."""
    symbols = rules.plan(case.values).symbols
    lengths = frozenset(float(each.ticks) for each in symbols)
    delays = frozenset(each.delay for each in symbols) - {None, LOST}
    if rules.at_random:
        table = rules.for_all
        chances = repr((table.lengths, table.results))
        return Frames(Order.AT_RANDOM, lengths, delays, 0, table.loss, chances)
    return Frames(Order.ANY, lengths, delays, max(each.lost for each in symbols))


def _common(frames: Sequence[Frames]) -> Frames:
    """The frames that several plans have in common."""
    first, *others = frames
    for each in others:
        first = Frames(
            first.order,
            first.lengths & each.lengths,
            first.delays & each.delays,
            min(first.lost, each.lost),
            first.loss,
            first.chances,
        )
    return first


def _numbers(rules: Rules, cases: Sequence[Case]) -> tuple[Range, ...]:
    """The numbers of the cases; one that no loop reads may be any."""
    ranges = []
    for axis in rules.for_all.unknown:
        spans = [each for case in cases for each in case.ranges if each.path == axis.path]
        values = {case.fixed[axis.path] for case in cases if axis.path in case.fixed}
        if spans:
            low = min(each.start for each in spans)
            high = max(each.stop for each in spans)
            ranges.append(Range(axis.path, low, high))
        elif values:
            ranges.append(Range(axis.path, min(values), max(values), tuple(sorted(values))))
        else:
            ranges.append(Range.of(axis))
    return tuple(ranges)
