"""A part of a plan, done by numpy or by the kernel."""

from functools import cached_property
from math import prod

import numpy as np

from wavesweep.kernel import NUMPY, chosen
from wavesweep.lifted.sparse import stacked
from wavesweep.lifted.tape import CONSTANT, READ, Term


class Stage:
    """A part of a plan that makes matrices, given by rows of terms, and other terms."""

    def __init__(self, tape, matrices, others=()):
        self._tape, self._matrices, self._others = tape, matrices, others
        self._numbers = None

    def run(self, values, batch, kind, widths, of_sizes=(), own=(), sizes=()) -> tuple[list[np.ndarray], list]:
        """Return the matrices, `(..., rows, width)`, and the other numbers.

        values: those that are given. batch: shape. kind: type of the numbers. widths: of the matrices, the first of which has
        `own` along its diagonal for entries that the rows lack. of_sizes, sizes: the same of the sizes of terms, which follow.
        """
        count, whole = len(widths), (*widths, *of_sizes)

        def filled(matrices):
            bases = {0: own, count: sizes}
            kinds = (kind,) * count + (float,) * len(of_sizes)
            each = enumerate(zip(matrices, whole, kinds, strict=True))
            return [stacked(rows, width, batch, of, bases.get(at, ())) for at, (rows, width, of) in each]

        if chosen() == NUMPY or len(batch) > 1:
            program, places = self._plain
            work = program.run(values, (*own, *sizes))

            def number(term):
                return work[places[term.at]] if isinstance(term, Term) else term

            matrices = [[{at: number(term) for at, term in row.items()} for row in rows] for rows in self._matrices]
            return filled(matrices), list(map(number, self._others))
        from wavesweep.lifted.compiled import programs

        loops, found = batch[0] if batch else 1, filled(self._constant)
        flat = [matrix.reshape(loops, prod(matrix.shape[-2:])) for matrix in found]
        kept = np.empty((len(self._others), loops), kind)
        steps, places, results = self._numbered(count, whole)
        programs.run(steps, places, results, values, flat[:count], flat[count:], kept)
        return found, list(kept)

    @cached_property
    def _constant(self):
        """The entries of the matrices that are plain numbers."""
        return [
            [{column: each for column, each in row.items() if isinstance(each, float)} for row in rows]
            for rows in self._matrices
        ]

    def _numbered(self, count, widths):
        """Return the arguments of `programs.run`; count: of matrices that are not sizes."""
        if self._numbers is None:
            from wavesweep.lifted.compiled.programs import MATRICES

            program, places = self._tape.program(self._terms(), giving=True)
            steps, results = [], []
            for operation, one, other, at in program.steps:
                if operation == CONSTANT:
                    steps.append((operation, int(one), 0, at))
                else:
                    steps.append((operation, other[3], other[2], at) if operation == READ else (operation, one, other, at))
            for at, (rows, width) in enumerate(zip(self._matrices, widths, strict=True)):
                matrix = at if at < count else MATRICES + at - count
                terms = ((i * width + j, each) for i, row in enumerate(rows) for j, each in row.items())
                results += [(matrix, entry, places[each.at]) for entry, each in terms if isinstance(each, Term)]
            results += [(2 * MATRICES, at, places[each.at]) for at, each in enumerate(self._others)]
            tables = (np.array(some, np.int64).reshape(len(some), width) for some, width in ((steps, 4), (results, 3)))
            self._numbers = next(tables), program.places, next(tables)
        return self._numbers

    @cached_property
    def _plain(self):
        return self._tape.program(self._terms())

    def _terms(self):
        rows = (row for rows in self._matrices for row in rows)
        return [each for row in rows for each in row.values() if isinstance(each, Term)] + list(self._others)
