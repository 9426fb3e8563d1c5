"""Programs of a tape on many loops at a time."""

import numpy as np

from wavesweep.lifted.compiled.caching import compiled
from wavesweep.lifted.tape import ADD, CLEAN, CONSTANT, GIVE, MULTIPLY, READ, ROUNDING, SIZE

WIDTH = 64  # loops that each step does at a time
MATRICES = 4  # of numbers, and as many of sizes


def run(steps, places: int, results, values, matrices, sizes, kept) -> None:
    """Do the steps for every loop, and store results.

    steps: of a `Program` whose numbers are given as they are needed, READ with a matrix (0 for the first one, 1 for the first
    of sizes) and the number of an entry, `(steps, 4)`. results: the matrix, the entry and the place of each, `(results, 3)`;
    of sizes from MATRICES on, and 2 MATRICES for the row of `kept`. values: numbers or arrays that are given. matrices, sizes:
    up to MATRICES each, `(loops, entries)`. kept: `(rows, loops)`.
    """
    loops, kind = kept.shape[1], kept.dtype
    if set(map(type, values)) == {float}:
        row_of, plain, rows = np.arange(-1, -len(values) - 1, -1), values, []
    else:
        row_of, plain, rows = np.empty(len(values), np.int64), [], []
        for at, value in enumerate(values):
            if isinstance(value, float):
                plain.append(value)
                row_of[at] = -len(plain)
            else:
                row_of[at] = len(rows)
                rows.append(value if value.shape == (loops,) else np.broadcast_to(value, loops))
    varied = np.array(rows, kind) if rows else np.empty((0, loops), kind)
    nothing = tuple(np.empty((loops, 0), of) for of in (kind, float))
    found = [(*some, *(MATRICES - len(some)) * (none,)) for some, none in zip((matrices, sizes), nothing, strict=True)]
    _run(steps, places, row_of, np.array(plain, kind), varied, results, *found, kept)


@compiled
def _run(steps, places, row_of, plain, varied, results, matrices, sizes, kept):  # noqa: C901, PLR0912 - a branch per operation
    """See `run`; row_of: row of each given number in `varied`, `(rows, loops)`, or -1 less its place in `plain`."""
    loops = kept.shape[1]
    work = np.zeros((places, WIDTH), kept.dtype)
    for first in range(0, loops, WIDTH):
        count = min(WIDTH, loops - first)
        for step in range(len(steps)):
            operation, one, other = steps[step, 0], steps[step, 1], steps[step, 2]
            to = work[steps[step, 3]]
            if operation == MULTIPLY:
                a, b = work[one], work[other]
                for i in range(WIDTH):
                    to[i] = a[i] * b[i]
            elif operation == ADD:
                a, b = work[one], work[other]
                for i in range(WIDTH):
                    to[i] = a[i] + b[i]
            elif operation == GIVE and row_of[one] >= 0:
                a = varied[row_of[one]]
                for i in range(count):
                    to[i] = a[first + i]
            elif operation == GIVE:
                to[:] = plain[-1 - row_of[one]]
            elif operation == CONSTANT:
                to[:] = float(one)
            elif operation == READ:
                for i in range(count):
                    to[i] = sizes[0][first + i, other] if one else matrices[0][first + i, other]
            elif operation == SIZE:
                a = work[one]
                for i in range(WIDTH):
                    to[i] = abs(a[i])
            elif operation == CLEAN:
                a, b = work[one], work[other]
                for i in range(WIDTH):
                    to[i] = 0.0 if abs(a[i]) <= ROUNDING * b[i].real < np.inf else a[i]
        for result in range(len(results)):
            matrix, entry, a = results[result, 0], results[result, 1], work[results[result, 2]]
            if matrix < MATRICES:
                for i in range(count):
                    matrices[matrix][first + i, entry] = a[i]
            elif matrix < 2 * MATRICES:
                for i in range(count):
                    sizes[matrix - MATRICES][first + i, entry] = a[i].real
            else:
                for i in range(count):
                    kept[entry, first + i] = a[i]
