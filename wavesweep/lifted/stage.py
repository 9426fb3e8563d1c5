"""A part of a plan."""

from functools import cached_property

import numpy as np

from wavesweep.lifted.sparse import stacked
from wavesweep.lifted.tape import Term


class Stage:
    """A part of a plan that makes matrices, given by rows of terms, and other terms."""

    def __init__(self, tape, matrices, others=()):
        self._tape, self._matrices, self._others = tape, matrices, others

    def run(self, values, batch, kind, widths, of_sizes=(), own=(), sizes=()) -> tuple[list[np.ndarray], list]:
        """Return the matrices, `(..., rows, width)`, and the other numbers.

        values: those that are given. batch: shape. kind: type of the numbers. widths: of the matrices, the first of which has
        `own` along its diagonal for entries that the rows lack. of_sizes, sizes: the same of the sizes of terms, which follow.
        """
        count, whole = len(widths), (*widths, *of_sizes)
        bases, kinds = {0: own, count: sizes}, (kind,) * count + (float,) * len(of_sizes)
        program, places = self._program
        work = program.run(values, (*own, *sizes))

        def number(term):
            return work[places[term.at]] if isinstance(term, Term) else term

        found = []
        for at, (rows, width, of) in enumerate(zip(self._matrices, whole, kinds, strict=True)):
            numbers = [{column: number(term) for column, term in row.items()} for row in rows]
            found.append(stacked(numbers, width, batch, of, bases.get(at, ())))
        return found, list(map(number, self._others))

    @cached_property
    def _program(self):
        return self._tape.program(self._terms())

    def _terms(self):
        rows = (row for rows in self._matrices for row in rows)
        return [each for row in rows for each in row.values() if isinstance(each, Term)] + list(self._others)
