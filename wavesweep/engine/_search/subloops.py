"""Loops drawn in one spec that do not act on each other both ways: each by itself, and the values
at which all are stable.

Applies if the drawing has several such subloops. The eigenvalues of the loops are those of all
subloops, so that intervals that are proved of each of them are proved of the loops where they have
values in common.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._loops.domain import domains
from wavesweep.engine._loops.values import numbers_of, values_of
from wavesweep.engine._search.open_loops import Opened
from wavesweep.engine._search.question import Question, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, common
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops


def applies(question: Question, slices: Slices) -> bool:
    """Whether there are several subloops."""
    return len(subloops_along(question, slices.loops)) > 1


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals in which all subloops are stable."""
    loops, along, span, bound = slices.loops, question.along, question.span, question.bound
    drawings = subloops_along(question, loops)
    if not _drift_alike(
        question, loops, drawings
    ):  # a cut would leave out a mode that grows and that the number does not see
        return rest(question, Slices(loops, slices.size))
    domains(*loops, along, span, slices.size)  # of what leads from one subloop to another, too
    ticks, answers = loops.drawn().ticks if bound else 0, []
    for subloop in (Loops(drawing, loops.values) for drawing in drawings):
        of_subloop = (
            replace(question, bound=bound.over(ticks // subloop.drawn().ticks))
            if bound
            else question
        )
        opened = None
        with suppress(
            IllPosedLoopError
        ):  # it may have no solution at 0 of the number, which may be beyond the range
            opened = Opened.of(subloop, question.number, slices.size)
        answers.append(rest(of_subloop, Slices(subloop, slices.size, opened)))
    return common(answers)


def subloops_along(question: Question, loops: Loops) -> tuple[Drawing, ...]:
    """The drawings of the subloops, without terms whose gain is 0 in every loop."""
    without = silent(*loops.changed({question.along: 1.0}), question.number)
    return subloops(loops.drawing, without, every=question.bound is not None)


def _drift_alike(question, loops, drawings):
    """Whether as many shifts of the subloops are opposed by nothing as of all together, and nothing
    else is left out of them.

    A block that reads a subloop, or a hand that moves it, may make a shift of it a mode that grows
    with time.
    """
    over = loops.changed({question.along: np.array(question.span)})
    drifts = [
        Loops(drawing, over.values).drift_of_frames() for drawing in (loops.drawing, *drawings)
    ]
    unread, *of_subloops = ({drift.states[state] for state in drift.unobserved} for drift in drifts)
    shifts, *counts = (len(drift.constant) + len(drift.varying) for drift in drifts)
    return shifts == sum(counts) and unread >= set().union(*of_subloops)


@lru_cache(maxsize=64)
def _feeds(drawing: Drawing, silent: frozenset[tuple[str, str]]) -> dict[str, set[str]]:
    """Return the blocks that read the outputs of each block."""
    feeds = {block.name: set() for block in drawing.blocks}
    for port, terms in (*drawing.wires, *drawing.couplings):
        for source in (
            signal.rpartition(".")[0] for signal, _ in terms if (port, signal) not in silent
        ):
            if source in feeds:
                feeds[source].add(port.rpartition(".")[0])
    return feeds


def subloops(
    drawing: Drawing, silent: frozenset[tuple[str, str]] = frozenset(), *, every: bool = False
) -> tuple[Drawing, ...]:
    """Return the parts of a drawing whose blocks all act on one another, in the order of their
    blocks.

    silent: ports and signals of the terms whose gain is 0, through which nothing acts. every:
    whether blocks that come to rest by themselves are parts too, as how fast they do may matter.

    A block that acts on a part and is not acted on by it changes none of its eigenvalues, and those
    of the whole are those of all parts. Two equal joints of a robot, or two equal cars of which one
    follows the other, cross the unit circle at the same value of a gain, which looks like one that
    only touches it; by themselves they are simple crossings. A block that is no part of a loop and
    comes to rest with any numbers is in no part, unless there is no other.
    """
    feeds = _feeds(drawing, silent)
    reached = {name: _reached(feeds, name) for name in feeds}
    parts = dict.fromkeys(
        frozenset({name, *(other for other in reached[name] if name in reached[other])})
        for name in feeds
    )
    alone = [block for block in drawing.blocks if block.name not in reached[block.name]]
    rests = {frozenset({block.name}) for block in alone if TYPES[block.type].settles}
    return tuple(_part(drawing, names) for names in parts if every or names not in rests) or (
        drawing,
    )


def silent(
    drawing: Drawing, values: Mapping[str, object], number: str
) -> frozenset[tuple[str, str]]:
    """Return ports and signals through which nothing acts: of terms that are 0 in every loop and do
    not read a number.

    values: flat numbers, or arrays over a batch.
    """
    numbers, (reading, others) = numbers_of(values), _terms(drawing, number)
    with np.errstate(all="ignore"):
        gains = [(place, values_of(gain, numbers)) for place, gain in others]
    acting = {place for place, gain in gains if (np.any(gain) if np.ndim(gain) else gain)}
    return frozenset({place for place, _ in others} - acting - reading)


@lru_cache(maxsize=64)
def _terms(drawing, number):
    """Ports and signals of the terms that read a number, and those of the others, each with its
    gain."""
    terms = [
        ((port, signal), gain)
        for port, terms in (*drawing.wires, *drawing.couplings)
        for signal, gain in terms
    ]
    reads = [number in gain.names for _, gain in terms]
    reading = {place for (place, _), read in zip(terms, reads, strict=True) if read}
    return reading, [term for term, read in zip(terms, reads, strict=True) if not read]


def _reached(feeds, name):
    """The blocks that a block acts on, by way of others too."""
    reached, front = set(), {name}
    while front:
        front = set().union(*(feeds[block] for block in front)) - reached
        reached |= front
    return reached


def _part(drawing, names):
    """The drawing of these blocks without the others that act on them, and without a hand."""

    def within(wires):
        inner = ((port, terms) for port, terms in wires if port.rpartition(".")[0] in names)
        return tuple(
            (port, tuple(term for term in terms if term[0].rpartition(".")[0] in names))
            for port, terms in inner
        )

    blocks = tuple(block for block in drawing.blocks if block.name in names)
    wires, couplings = within(drawing.wires), within(drawing.couplings)
    return replace(drawing, blocks=blocks, wires=wires, couplings=couplings, hand=None)
