"""How the blocks of a structure are connected: which numbers are added and multiplied, worked out once."""

from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from wavesweep.lifted.net import Net, moved
from wavesweep.lifted.sparse import between, product, rows_of, sizes_of
from wavesweep.lifted.stage import Stage
from wavesweep.lifted.tape import ANY, ONE, Tape, Term, entries_of, plain_or_array


def plan_of(blocks, sums, inputs, outputs, terms):
    """Return the plan for blocks and sums, the numbers that it is given, the shape of the batch and the type of the numbers.

    See `connect`.
    """
    values, gains = [], [gain for sources in sums.values() for gain in sources.values()]
    plan = _plan(_structure(blocks, sums, inputs, outputs, terms, values))
    arrays = [part for block in blocks for part in (block.E, block.B, block.C, block.D)]
    used = [np.asarray(gains[at]) for at in plan.used if not isinstance(gains[at], int | float)]
    batch = np.broadcast_shapes(*{part.shape[:-2] for part in arrays}, *{gain.shape for gain in used})
    return plan, values, batch, np.result_type(float, *{part.dtype for part in (*arrays, *used)})


class _Structure(NamedTuple):
    """What a plan depends on.

    blocks: name, inputs, outputs, number of states, and whether the sizes of its terms are known, of each. sums: signals and
    their sources. patterns: of the entries of B, C and D, of the sizes that are known (of D alone without terms) and of gains.
    """

    blocks: tuple
    sums: tuple
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    terms: bool
    patterns: bytes


def _structure(blocks, sums, inputs, outputs, terms, values) -> _Structure:
    """Return the structure, and append the entries and the gains that its patterns leave open to values."""
    matrices = [part for block in blocks for part in (block.B, block.C, block.D)]
    matrices += [size for block in blocks for size in _known_sizes(block.terms, terms)]
    patterns, gains = entries_of(matrices, values), bytearray()
    for sources in sums.values():
        for gain in sources.values():
            plain = plain_or_array(gain)
            gains.append(ONE if isinstance(plain, float) and plain == 1.0 else ANY)
            if gains[-1] == ANY:
                values.append(plain)
    names = tuple([(b.name, b.inputs, b.outputs, len(b.states), b.terms is not None) for b in blocks])
    wires = tuple([(signal, tuple(sources)) for signal, sources in sums.items()])
    return _Structure(names, wires, inputs, outputs, terms, patterns + bytes(gains))


def _known_sizes(sizes, terms):
    """Return those of E's, B's, C's and D's sizes that become terms of sums at the beginning."""
    return sizes[1 if terms else 3 :] if sizes else ()


class Plan:
    """How the blocks of a structure are connected.

    used: gains that signals go through. states: number of states. torn: number of torn ports; reached: which torn ports each of
    them depends on, directly or through others; closed: names of the ports on the loop. loop: the stage that gives the part of
    torn ports that comes from torn ports, and the sizes of its terms, and numbers that the next stage is given.
    """

    def __init__(self, structure: _Structure):
        self._tape, self._sizes = Tape(structure.patterns.count(ANY)), structure.terms
        self._net, sized, self.used = Net.of(structure, self._tape)
        net, (self._order, self._torn) = self._net, self._net.order()
        self._sized = sized() if self._torn or structure.terms else None
        self._rows, self._endings, first = net.followed(self._order, self._torn), {}, net.states + net.inputs
        self.torn, self.states = len(self._torn), net.states
        if self.torn:
            sizes = self._sized.followed(self._order, self._torn, states=False)
            matrices = [[between(rows[port], first) for port in self._torn] for rows in (self._rows, sizes)]
            later = (*self._rows, *net.numbers(), *(self._sized.numbers() if self._sizes else ()))
            self._later = sorted({each.at for row in later for each in row.values() if isinstance(each, Term)})
            self.loop = Stage(self._tape, matrices, [Term(self._tape, at) for at in self._later])
            self.reached = net.reached(self._rows, self._torn)
            self.closed = [port for port, row in zip(net.ports, self._rows, strict=True) if max(row, default=0) >= first]
        else:  # at once, since threads share a plan, and its tape must not change any more
            self._endings[b""] = self._ending(b"")

    def ending(self, pattern: bytes) -> Stage:
        """Return the stage that gives E, B, C and D, and the sizes of their terms if they are wanted.

        pattern: of the inverse of the torn ports' return difference, b"" without any.
        """
        if pattern not in self._endings:
            self._endings[pattern] = self._ending(pattern)
        return self._endings[pattern]

    def _ending(self, pattern):
        net, sized, rows, torn, order, inverse = self._net, self._sized, self._rows, self._torn, self._order, []
        tape, terms = self._tape, ()
        if torn:
            tape = Tape(len(self._later) + pattern.count(ANY))
            on_tape = partial(moved, dict(zip(self._later, tape.start, strict=False)))
            net, rows = net.on(tape, on_tape), list(map(on_tape, rows))
            sized = sized.on(tape, on_tape) if self._sizes else None
            inverse = rows_of(iter(pattern), (len(torn), len(torn)), 0, iter(tape.start[len(self._later) :]))
        known = net.solved(rows, torn, inverse)
        parts = net.assembled(net.untorn(rows, torn, known))
        if self._sizes:
            rows = sized.followed(order, torn)
            uncertain = product(map(sizes_of, inverse), sized.unsolved(rows, torn, list(map(sizes_of, known)), 1.0))
            terms = sized.assembled(sized.untorn(rows, torn, uncertain))
        return Stage(tape, (*parts, *terms))


_plan = lru_cache(maxsize=256)(Plan)  # of some 0.1 MB each
