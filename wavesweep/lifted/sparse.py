"""Signals as sums over columns, entry by entry: the arithmetic of sparse rows by which blocks are connected."""

from math import prod

import numpy as np

from wavesweep.diagram.block import numbers

ROUNDING = 8 * np.finfo(float).eps  # of the terms of a sum, what is left of it when it should be zero

Row = dict[int, object]
"""A signal as a sum over columns: states, then inputs from outside, then torn ports; column -> number or array over the batch.

Loops are sparse, and an entry that does not vary over a batch is a plain number here: dense products of small matrices cost
ten times as much. Each sum is added up in an order that the structure alone decides, so a loop does not depend on its batch.
"""


def rows_of(matrix, first) -> list[Row]:
    """Return the entries of each row that are not zero in the whole batch, by their columns, the first of which is `first`."""
    if matrix.ndim == 2 and matrix.dtype.kind != "c":
        return [{first + at: each for at, each in enumerate(row) if each} for row in matrix.tolist()]
    (*batch, height, width), found = matrix.shape, [{} for _ in range(matrix.shape[-2])]
    flat = matrix.reshape(prod(batch), height * width)
    filled = np.flatnonzero((flat != 0).any(0))
    if not filled.size:
        return found
    some = np.ascontiguousarray(flat[:, filled].T)
    one = some[:, 0]
    plain = (some == one[:, None]).all(1) & (one.imag == 0)  # see `plain_or_array`
    for at, place in enumerate(filled.tolist()):
        found[place // width][first + place % width] = one[at].real.item() if plain[at] else some[at].reshape(batch)
    return found


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


def add_to(row, other, factor):
    """Add `factor` times the other row to the row."""
    plain = isinstance(factor, float) and factor == 1.0
    for column, value in other.items():
        term = value if plain else factor * value
        row[column] = row[column] + term if column in row else term


def product(matrix, rows) -> list[Row]:
    """Return a matrix times rows."""
    found = []
    for line in rows_of(matrix, 0):
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


class Diagonal:
    """Square matrices `(..., n, n)` along a diagonal, whose entries are read one by one.

    Of the frames of a large batch, to take every entry out and to put it back costs more than the changes of a few of them.
    """

    def __init__(self, parts):
        self.parts, self._rows = tuple(parts), []
        for part in self.parts:
            first, width = len(self._rows), part.shape[-1]
            plain = part.tolist() if part.ndim == 2 and part.dtype.kind != "c" else None
            self._rows += [(part, plain, first, first + width)] * width

    def __len__(self):
        return len(self._rows)

    def entry(self, row, column):
        """Return an entry as `rows_of` does, None if it is zero in the whole batch."""
        part, plain, first, end = self._rows[row]
        if not first <= column < end:
            return None
        if plain:
            return plain[row - first][column - first] or None
        each = part[..., row - first, column - first]
        return plain_or_array(np.ascontiguousarray(each)) if each.any() else None

    def filled(self, out):
        """Return the zeros `out`, `(..., n, n)`, with the matrices in them."""
        first = 0
        for part in self.parts:
            end = first + part.shape[-1]
            out[..., first:end, first:end], first = part, end
        return out


def stacked(rows, width, batch, kind, base=None):
    """Return rows as an array `(..., len(rows), width)`.

    If the batch has several axes, each axis along which nothing varies has length 1. base: a `Diagonal` with the entries that
    rows lack.
    """
    if len(batch) > 1:
        shapes = {np.shape(value) for row in rows for value in row.values()}
        shapes |= {part.shape[:-2] for part in base.parts} if base else set()
        batch = np.broadcast_shapes((1,) * len(batch), *shapes)
    out = np.zeros((*batch, len(rows), width), kind)
    if base:
        base.filled(out)
    for at, row in enumerate(rows):
        for column, value in row.items():
            out[..., at, column] = value
    return out


def summed(row, ports, rows, states, entry=None) -> Row:
    """Return the row plus the sum of these ports; an entry of an input is 0 if it is only rounding of its terms.

    entry(column): an entry of the row that it lacks, or None; those to which no port adds are left out.
    With no filter and no delay in the line the wall's force reaches the avatar twice, by +1/b and -1/b. What rounding leaves of
    that is eps/b, which is large if b is small.
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
        total = row[column]
        if isinstance(size, float):
            row[column] = 0.0 if abs(total) <= ROUNDING * size < np.inf else total
        else:
            with np.errstate(invalid="ignore"):
                row[column] = np.where((np.abs(total) <= ROUNDING * size) & np.isfinite(size), 0.0, total)
    return row
