"""Signals as sums over columns, entry by entry: the arithmetic of sparse rows by which blocks are connected."""

import numpy as np

from wavesweep.lifted.tape import NOTHING, ONE, Term

Row = dict[int, object]
"""A signal as a sum over columns: states, then inputs from outside, then torn ports; column -> `Term` or plain number.

Loops are sparse: dense products of small matrices cost ten times as much. Each sum is added up in an order that the structure
alone decides, so a loop does not depend on its batch.
"""


def rows_of(patterns, shape: tuple[int, int], first: int, given) -> list[Row]:
    """Return the entries of each row that are not zero in the whole batch, by their columns, the first of which is `first`.

    patterns: an iterator over those of all entries, by rows; given: one over the terms of those that may be any number.
    """
    (height, width), found = shape, []
    for _ in range(height):
        own = list(zip(range(first, first + width), patterns, strict=False))
        found.append({column: 1.0 if each == ONE else next(given) for column, each in own if each != NOTHING})
    return found


def add_to(row, other, factor):
    """Add `factor` times the other row to the row."""
    plain = isinstance(factor, float) and factor == 1.0
    for column, value in other.items():
        term = value if plain else factor * value
        row[column] = row[column] + term if column in row else term


def product(matrix, rows) -> list[Row]:
    """Return a matrix, given by its rows, times rows."""
    found = []
    for line in matrix:
        found.append({})
        for at, factor in line.items():
            add_to(found[-1], rows[at], factor)
    return found


def sizes_of(row) -> Row:
    """Return the sizes of the entries."""
    return {column: abs(value) for column, value in row.items()}


def between(row, first, end=np.inf) -> Row:
    """Return the columns from `first` on up to `end`, counted from `first`."""
    return {column - first: value for column, value in row.items() if first <= column < end}


def stacked(rows, width, batch, kind, base=()):
    """Return rows of numbers as an array `(..., len(rows), width)`.

    If the batch has several axes, each axis along which nothing varies has length 1. base: matrices along the diagonal with the
    entries that rows lack.
    """
    if len(batch) > 1:
        shapes = {np.shape(value) for row in rows for value in row.values()}
        batch = np.broadcast_shapes((1,) * len(batch), *shapes, *{part.shape[:-2] for part in base})
    out, first = np.zeros((*batch, len(rows), width), kind), 0
    for part in base:
        end = first + part.shape[-1]
        out[..., first:end, first:end], first = part, end
    for at, row in enumerate(rows):
        for column, value in row.items():
            out[..., at, column] = value
    return out


def summed(row, ports, rows, states, entry=None) -> Row:
    """Return the row plus the sum of these ports; an entry of an input is 0 if it is only rounding of its terms.

    entry(column): an entry of the row that it lacks, or None; those to which no port adds are left out.
    With no filter and no delay in the line the wall's force reaches the avatar twice, by +1/b and -1/b. Rounding leaves eps/b
    of that, which is large if b is small.
    """
    sizes = {}  # of the terms, where there are several
    for port, factor in ports.items():
        for column, value in rows[port].items():
            term = factor * value
            if entry and column not in row and (own := entry(column)) is not None:
                row[column] = own
            if column in row and column >= states:
                sizes[column] = (sizes[column] if column in sizes else abs(row[column])) + abs(term)
            row[column] = row[column] + term if column in row else term
    for column, size in sizes.items():
        if isinstance(row[column], Term):
            row[column] = row[column].without_rounding(size)
    return row
