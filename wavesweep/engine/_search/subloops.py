"""Loops drawn in one spec that do not act on each other both ways: each by itself, and the values
at which all are stable.

Applies if the drawing has several such subloops. The eigenvalues of the loops are those of all
subloops, so that intervals that are proved of each of them are proved of the loops where they have
values in common.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine._drawing.block_types import TYPES
from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._loops.domain import domains
from wavesweep.engine._loops.values import numbers_of
from wavesweep.engine._search.open_loops import Opened
from wavesweep.engine._search.question import Question, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, common
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops

if TYPE_CHECKING:
    from wavesweep.engine._monodromy.drift import MarginalModes


def applies(question: Question, slices: Slices) -> bool:
    """Whether there are several subloops."""
    return len(subloops_along(question, slices.loops)) > 1


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The intervals in which all subloops are stable."""
    loops = slices.loops
    drawings = subloops_along(question, loops)
    # A cut would leave out a mode that grows and that the number does not see.
    if not _have_all_drifts(question, loops, drawings):
        return rest(question, Slices(loops, slices.size))
    # UsageError if a divisor, a root or a mass vanishes, in what is between subloops as well.
    domains(*loops, question.along, question.span, slices.size)
    answers = []
    for drawing in drawings:
        subloop = Loops(drawing, loops.values)
        of_subloop = question
        if question.bound:
            frames = loops.drawn().ticks // subloop.drawn().ticks
            of_subloop = replace(question, bound=question.bound.over(frames))
        opened = None
        # Where the number is 0, which need not be in the range, it may have no solution.
        with suppress(IllPosedLoopError):
            opened = Opened.of(subloop, question.number, slices.size)
        answers.append(rest(of_subloop, Slices(subloop, slices.size, opened)))
    return common(answers)


def subloops_along(question: Question, loops: Loops) -> tuple[Drawing, ...]:
    """The drawings of the subloops, without terms whose gain is 0 in every loop."""
    without = silent(*loops.changed({question.along: 1.0}), question.number)
    return subloops(loops.drawing, without, every=question.bound is not None)


def _have_all_drifts(question: Question, loops: Loops, drawings: tuple[Drawing, ...]) -> bool:
    """Whether the subloops drift as the whole loop does: they have as many marginal modes together,
    and no state is unobserved in a subloop alone.

    A marginal mode is a shift of a loop at rest that nothing opposes. A block that reads a subloop,
    or a hand that moves it, may make of its shift a mode of the whole that grows with time.
    """
    values = loops.changed({question.along: np.array(question.span)}).values
    of_whole = Loops(loops.drawing, values).drift_of_frames()
    marginal = 0
    unobserved: set[str] = set()
    for drawing in drawings:
        of_subloop = Loops(drawing, values).drift_of_frames()
        marginal += _number_of_modes(of_subloop)
        unobserved |= _unobserved(of_subloop)
    return marginal == _number_of_modes(of_whole) and unobserved <= _unobserved(of_whole)


def _number_of_modes(drift: MarginalModes) -> int:
    return len(drift.constant) + len(drift.varying)


def _unobserved(drift: MarginalModes) -> set[str]:
    """The names of the states that nothing reads, which a frame leaves out."""
    return {drift.states[state] for state in drift.unobserved}


def _feeds(drawing: Drawing, silent: frozenset[tuple[str, str]]) -> dict[str, set[str]]:
    """Return the blocks that read the outputs of each block."""
    feeds: dict[str, set[str]] = {block.name: set() for block in drawing.blocks}
    for port, terms in (*drawing.wires, *drawing.couplings):
        for signal, _ in terms:
            source = signal.rpartition(".")[0]
            if source in feeds and (port, signal) not in silent:
                feeds[source].add(port.rpartition(".")[0])
    return feeds


@lru_cache(maxsize=64)
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
    parts = {}
    for block in drawing.blocks:
        acted_on = reached[block.name]
        names = frozenset({block.name, *(name for name in acted_on if block.name in reached[name])})
        comes_to_rest = block.name not in acted_on and TYPES[block.type].settles
        if names not in parts and (every or not comes_to_rest):
            parts[names] = _part(drawing, names)
    return tuple(parts.values()) or (drawing,)


def silent(
    drawing: Drawing, values: Mapping[str, object], number: str
) -> frozenset[tuple[str, str]]:
    """Return ports and signals through which nothing acts: of terms that are 0 in every loop and do
    not read a number.

    values: flat numbers, or arrays over a batch.
    """
    numbers = numbers_of(values)
    acting, remaining_terms = _terms(drawing, number)
    zero = set()
    with np.errstate(all="ignore"):
        for place, gain in remaining_terms:
            if np.any(gain.values(numbers)):
                acting = acting | {place}
            else:
                zero.add(place)
    return frozenset(zero - acting)


@lru_cache(maxsize=64)
def _terms(
    drawing: Drawing, number: str
) -> tuple[frozenset[tuple[Any, ...]], list[tuple[Any, ...]]]:
    """Ports and signals of the terms that read a number, and those of the others, each with its
    gain."""
    reading = set()
    remaining_terms = []
    for port, terms in (*drawing.wires, *drawing.couplings):
        for signal, gain in terms:
            if gain.reads(number):
                reading.add((port, signal))
            else:
                remaining_terms.append(((port, signal), gain))
    return frozenset(reading), remaining_terms


def _reached(feeds: dict[str, set[str]], name: str) -> set[str]:
    """The blocks that a block acts on, by way of others too."""
    reached: set[str] = set()
    front = {name}
    while front:
        fed = [feeds[block] for block in front]
        front = set().union(*fed) - reached
        reached |= front
    return reached


def _part(drawing: Drawing, names: frozenset[str]) -> Drawing:
    """The drawing of these blocks without the others that act on them, and without a hand."""

    def is_within(signal: str) -> bool:
        return signal.rpartition(".")[0] in names

    def within(
        wires: tuple[tuple[str, tuple[Any, ...]], ...],
    ) -> tuple[tuple[str, tuple[Any, ...]], ...]:
        ports = []
        for port, terms in wires:
            if is_within(port):
                ports.append((port, tuple(term for term in terms if is_within(term[0]))))
        return tuple(ports)

    blocks = tuple(block for block in drawing.blocks if block.name in names)
    wires = within(drawing.wires)
    couplings = within(drawing.couplings)
    return replace(drawing, blocks=blocks, wires=wires, couplings=couplings, hand=None)
