"""Loops drawn in one spec that do not act on each other both ways: each by itself, and the values at which all are stable."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from wavesweep.engine.drawing.block_types import TYPES
from wavesweep.engine.drawing.drawing import Drawing
from wavesweep.engine.drawing.expressions import names_in
from wavesweep.engine.loops.values import numbers_of, values_of
from wavesweep.engine.stability.certificate import NONE
from wavesweep.engine.stability.intervals import Intervals


@lru_cache(maxsize=64)
def subloops(drawing: Drawing, silent: frozenset[tuple[str, str]] = frozenset(), *, every: bool = False) -> tuple[Drawing, ...]:
    """Return the parts of a drawing whose blocks all act on one another, in the order of their blocks.

    silent: ports and signals of the terms whose gain is 0, through which nothing acts. every: whether blocks that come to rest
    by themselves are parts too, as how fast they do may matter.

    A block that acts on a part and is not acted on by it changes none of its eigenvalues, and those of the whole are those of
    all parts. Two equal joints of a robot, or two equal cars of which one follows the other, cross the unit circle at the same
    value of a gain, which looks like one that only touches it; by themselves they are simple crossings. A block that is no
    part of a loop and comes to rest with any numbers is in no part, unless there is no other.
    """
    feeds = {block.name: set() for block in drawing.blocks}
    for port, terms in (*drawing.wires, *drawing.couplings):
        for source in (signal.rpartition(".")[0] for signal, _ in terms if (port, signal) not in silent):
            if source in feeds:
                feeds[source].add(port.rpartition(".")[0])
    reached = {name: _reached(feeds, name) for name in feeds}
    parts = dict.fromkeys(frozenset({name, *(each for each in reached[name] if name in reached[each])}) for name in feeds)
    alone = [block for block in drawing.blocks if block.name not in reached[block.name]]
    rests = {frozenset({block.name}) for block in alone if TYPES[block.type].settles}
    return tuple(_part(drawing, names) for names in parts if every or names not in rests) or (drawing,)


def silent(drawing: Drawing, values: Mapping[str, object], number: str) -> frozenset[tuple[str, str]]:
    """Return ports and signals through which nothing acts: of terms that are 0 in every loop and do not read a number.

    values: flat numbers, or arrays over a batch.
    """
    known, (reading, others) = numbers_of(values), _terms(drawing, number)
    with np.errstate(all="ignore"):
        gains = [(place, values_of(gain, known)) for place, gain in others]
    acting = {place for place, gain in gains if (np.any(gain) if np.ndim(gain) else gain)}
    return frozenset({place for place, _ in others} - acting - reading)


@lru_cache(maxsize=64)
def _terms(drawing, number):
    """Ports and signals of the terms that read a number, and those of the others, each with its gain."""
    terms = [((port, signal), gain) for port, terms in (*drawing.wires, *drawing.couplings) for signal, gain in terms]
    reads = [number in dict(names_in(gain)) for _, gain in terms]
    reading = {place for (place, _), read in zip(terms, reads, strict=True) if read}
    return reading, [term for term, read in zip(terms, reads, strict=True) if not read]


def _reached(feeds, name):
    """The blocks that a block acts on, by way of others too."""
    found, open_ = set(), {name}
    while open_:
        open_ = set().union(*(feeds[each] for each in open_)) - found
        found |= open_
    return found


def _part(drawing, names):
    """The drawing of these blocks without the others that act on them, and without a hand."""

    def own(wires):
        found = ((port, terms) for port, terms in wires if port.rpartition(".")[0] in names)
        return tuple((port, tuple(term for term in terms if term[0].rpartition(".")[0] in names)) for port, terms in found)

    blocks = tuple(block for block in drawing.blocks if block.name in names)
    return replace(drawing, blocks=blocks, wires=own(drawing.wires), couplings=own(drawing.couplings), hand=None, wall=None)


def common(found: Sequence[Intervals]) -> Intervals:
    """Return the intervals in which all of several loops are stable, for every column.

    found: of each loop, the same columns. A doubt of one is one of the column, unless the others are never stable together.
    """
    rows = [_by_column(each) for each in found]
    whole = {name: [] for name in ("column", "index", "count", "low", "high", "low_omega", "high_omega", "doubt", "residual")}
    for column in rows[0]:
        certain = [each[column][0] for each in rows if each[column][1] == NONE]
        shared, doubt = _of_all(certain), NONE
        if len(certain) < len(rows) and not (certain and not shared):
            shared, doubt = _of_all([each[column][0] for each in rows]), max(each[column][1] for each in rows)
        stable = [known for *_, known in shared]
        for at, interval in enumerate(shared or [(np.nan, np.nan, np.nan, np.nan, 0.0, False)]):
            facts = (column, sum(stable[:at]) if interval[5] else -1, sum(stable), *interval[:4], doubt, interval[4])
            for name, value in zip(whole, facts, strict=True):
                whole[name].append(value)
    kinds = {name: getattr(found[0], name).dtype for name in whole}
    return Intervals(**{name: np.array(values, kinds[name]) for name, values in whole.items()})


def _by_column(found):
    """Column -> its elements as (low, high, low_omega, high_omega, residual, known to be stable), and its doubt."""
    columns = {}
    for at in range(found.column.size):
        intervals, _ = columns.setdefault(int(found.column[at]), ([], int(found.doubt[at])))
        if not np.isnan(found.low[at]):
            ends = (float(getattr(found, name)[at]) for name in ("low", "high", "low_omega", "high_omega", "residual"))
            intervals.append((*ends, bool(found.index[at] >= 0)))
    return dict(sorted(columns.items()))


def _of_all(loops):
    """What several lists have in common, in order."""
    shared = loops[0] if loops else []
    for other in loops[1:]:
        shared = [both for one in shared for two in other if (both := _overlap(one, two)) is not None]
    return shared


def _overlap(one, two):
    """The part that two elements have in common, each end with its frequency, open if one is; None if there is none."""
    begins = max(one, two, key=lambda each: each[0])
    ends = min(one, two, key=lambda each: each[1])
    if begins[0] >= ends[1]:
        return None
    known = one[5] and two[5]
    omegas = (begins[2], ends[3]) if known else (np.nan, np.nan)
    return begins[0], ends[1], *omegas, max(one[4], two[4]) * known, known
