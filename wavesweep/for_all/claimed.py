"""What a proof for all of [for_all] is a claim about: the plans and the ranges that it used."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from wavesweep.for_all.channel_families import channels_of
from wavesweep.for_all.plan import LOST
from wavesweep.for_all.unknown import Case
from wavesweep.for_all.varying import Rules
from wavesweep.program.analyses.claims import (
    Chances,
    Frames,
    Messages,
    Order,
    Scope,
    own_scope,
    ranges_of,
    with_texts,
)

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def scope_of(spec: Spec, rules: Rules, cases: Sequence[Case]) -> Scope:
    """The loops of some cases, whose frames, messages and chances are those of the plan of each;
    spec: has the numbers of all other keys."""
    frames = own_scope(spec).frames
    messages: tuple[Messages, ...] = ()
    if rules.messages:
        of_case = _messages(rules, cases[0])
        messages = with_texts(
            of_case, [rules.drawing], {axis.path for axis in rules.for_all.unknown}
        )
    if rules.vary and (not rules.messages or rules.for_all.changing):
        frames = _common([_frames(rules, case) for case in cases])
    boxes = [
        ({unknown.path: (unknown.start, unknown.stop) for unknown in case.ranges}, case.fixed)
        for case in cases
    ]
    paths = [axis.path for axis in rules.for_all.unknown]
    return Scope(ranges_of(paths, boxes), frames, messages)


def _messages(rules: Rules, case: Case) -> tuple[Messages, ...]:
    """What the messages of a case may do."""
    losses = rules.losses(case.values) if rules.at_random else {}
    messages = []
    for channel in channels_of(rules.drawing, case.values):
        if channel.name in losses:
            chances = tuple(losses[channel.name].written().items())
            messages.append(Messages(channel.name, channel.late, 0, chances))
        else:
            messages.append(Messages(channel.name, channel.late, channel.lost))
    return tuple(messages)


def _frames(rules: Rules, case: Case) -> Frames:
    """The frames of the plan of a case."""
    symbols = rules.plan(case.values).symbols
    lengths = frozenset(float(symbol.ticks) for symbol in symbols)
    delays = frozenset(symbol.delay for symbol in symbols) - {None, LOST}
    if rules.at_random:
        chances = Chances.of(rules.for_all)
        loss = max(row[-1] for row in chances.results)
        return Frames(Order.AT_RANDOM, lengths, delays, 0, loss, chances)
    return Frames(Order.ANY, lengths, delays, max(symbol.lost for symbol in symbols))


def _common(frames: Sequence[Frames]) -> Frames:
    """The frames that several plans have in common."""
    shared, *further = frames
    for plan in further:
        shared = Frames(
            shared.order,
            shared.lengths & plan.lengths,
            shared.delays & plan.delays,
            min(shared.lost, plan.lost),
            shared.loss,
            shared.chances,
        )
    return shared
