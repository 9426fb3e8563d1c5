"""Arithmetic of a structure, recorded once, and done with the numbers of every batch of loops that has it."""

from math import prod
from typing import NamedTuple

import numpy as np

from wavesweep.diagram.block import numbers

ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero
NOTHING, ONE, ANY = range(3)  # patterns of an entry: 0 in the whole batch, 1 in the whole batch, or any number
CONSTANT, READ, ADD, MULTIPLY, SIZE, CLEAN = range(6)  # operations, see `Program`
ARGUMENTS = (0, 0, 2, 2, 1, 2)  # of each operation, number of arguments that are results


class Tape:
    """Records operations on numbers that are not known yet.

    given: number of the numbers that it starts from; `start`: these numbers.
    """

    def __init__(self, given: int):
        self.start = [Term(self, at) for at in range(given)]
        self.steps, self.known = [], {}

    def do(self, *step) -> "Term":
        """Return the result of an operation; none is done twice."""
        if step not in self.known:
            self.known[step] = Term(self, len(self.start) + len(self.steps))
            self.steps.append(step)
        return self.known[step]

    def term(self, number) -> "Term":
        """Return a plain number as a term."""
        return number if isinstance(number, Term) else self.do(CONSTANT, number, 0)

    def program(self, results) -> tuple["Program", dict[int, int]]:
        """Return the program for the results, which are terms, and the place of each of these after it."""
        given, wanted = len(self.start), [term.at for term in results]
        size = given + len(self.steps)
        last = [-1] * size  # step that needs each result last
        for at in wanted:
            last[at] = size
        for at in range(size - 1, given - 1, -1):
            operation, one, other = self.steps[at - given]
            count = ARGUMENTS[operation] if last[at] >= 0 else 0
            if count and last[one] < 0:
                last[one] = at
            if count == 2 and last[other] < 0:
                last[other] = at
        free, places, done, size = [at for at in range(given) if last[at] < 0], list(range(size)), [], given
        for at, (operation, one, other) in enumerate(self.steps, start=given):
            if last[at] < 0:
                continue
            count, place = ARGUMENTS[operation], free.pop() if free else size
            size, places[at] = max(size, place + 1), place  # none of its arguments': loops over what may overlap are slow
            mine, others = places[one] if count else one, places[other] if count == 2 else other
            if count and last[one] == at:
                free.append(mine)
            if count == 2 and other != one and last[other] == at:
                free.append(others)
            done.append((operation, mine, others, place))
        return Program(size, tuple(done)), {at: places[at] for at in wanted}


class Term:
    """A number that is not known yet."""

    __slots__ = ("at", "tape")

    def __init__(self, tape, at):
        self.tape, self.at = tape, at

    def __add__(self, other):
        return self.tape.do(ADD, self.at, self.tape.term(other).at)

    def __mul__(self, other):
        return self.tape.do(MULTIPLY, self.at, self.tape.term(other).at)

    __radd__, __rmul__ = __add__, __mul__

    def __abs__(self):
        return self.tape.do(SIZE, self.at, 0)

    def without_rounding(self, size) -> "Term":
        """Return the term, or 0 if it is only rounding of terms whose sizes `size` is the sum of."""
        return self.tape.do(CLEAN, self.at, size.at)


class Program(NamedTuple):
    """Steps on numbers in places, of which the first are given.

    steps: an operation, its two arguments, and the place of its result. Arguments are places; but that of CONSTANT is a number,
    and those of READ are a matrix, by number, and the row and column of an entry. SIZE is the absolute value of the first;
    CLEAN is the first, or 0 if it is only rounding of terms whose sizes the second is the sum of.
    """

    places: int
    steps: tuple

    def run(self, values: list, matrices) -> list:
        """Return the numbers in the places after all steps.

        values: the numbers that are given: plain if they are the same real number in the whole batch, or arrays over it.
        """
        work = values + [0.0] * (self.places - len(values))
        for operation, one, other, at in self.steps:
            if operation == MULTIPLY:
                work[at] = work[one] * work[other]
            elif operation == ADD:
                work[at] = work[one] + work[other]
            elif operation == READ:
                work[at] = plain_or_array(np.ascontiguousarray(matrices[one][(..., *other)]))
            elif operation == SIZE:
                work[at] = abs(work[one])
            elif operation == CLEAN:
                work[at] = _clean(work[one], work[other])
            else:
                work[at] = one
        return work


def _clean(total, size):
    if isinstance(size, float):
        return 0.0 if abs(total) <= ROUNDING * size < np.inf else total
    return np.where((np.abs(total) <= ROUNDING * size) & np.isfinite(size), 0.0, total)


def entries_of(matrices, values: list) -> bytes:
    """Append the entries of which there may be any to values, and return the patterns of all entries, by rows.

    matrices: one after the other. An entry that does not vary over the batch is a plain number.
    """
    if all(matrix.ndim == 2 and matrix.dtype.kind != "c" for matrix in matrices):
        flat = [each for matrix in matrices for each in matrix.ravel().tolist()]
        values += [each for each in flat if each not in (0.0, 1.0)]
        return bytes([NOTHING if each == 0.0 else ONE if each == 1.0 else ANY for each in flat])
    found, groups = [None] * len(matrices), {}
    for at, matrix in enumerate(matrices):
        if matrix.ndim == 2 and matrix.dtype.kind != "c":
            own = []
            found[at] = entries_of((matrix,), own), own
        else:
            groups.setdefault((matrix.shape[:-2], matrix.dtype), []).append(at)  # sizes of complex numbers are real
    for (batch, _), members in groups.items():
        for at, each in zip(members, _varied([matrices[at] for at in members], batch), strict=True):
            found[at] = each
    values += [each for _, own in found for each in own]
    return b"".join(pattern for pattern, _ in found)


def _varied(matrices, batch):
    """Yield patterns and open entries of matrices over a batch, one after the other."""
    widths = [prod(matrix.shape[-2:]) for matrix in matrices]
    flat = np.concatenate([matrix.reshape(prod(batch), width) for matrix, width in zip(matrices, widths, strict=True)], -1)
    filled = np.flatnonzero(flat.any(0))
    some = np.ascontiguousarray(flat[:, filled].T)
    one = some[:, :1]
    plain = (some == one).all(1) & (one[:, 0].imag == 0) if len(flat) else np.zeros(0, bool)  # see `plain_or_array`
    patterns, entries = bytearray(flat.shape[1]), [None] * flat.shape[1]
    for at, place in enumerate(filled.tolist()):
        value = one[at, 0].real.item() if plain[at] else some[at].reshape(batch)
        patterns[place] = ONE if plain[at] and value == 1.0 else ANY
        entries[place] = value
    first = 0
    for width in widths:
        pattern = bytes(patterns[first : first + width])
        yield pattern, [each for each, what in zip(entries[first : first + width], pattern, strict=True) if what == ANY]
        first += width


def plain_or_array(each):
    """Return a plain number if `each` is the same real number in the whole batch, and an array otherwise.

    Complex numbers stay in arrays, since Python multiplies them differently.
    """
    if isinstance(each, int | float):
        return float(each)
    each = numbers(each)
    flat = each.ravel()
    if not flat.size or flat[0] != flat[-1] or flat[0].imag != 0 or not (flat == flat[0]).all():
        return each
    return flat[0].real.item()
