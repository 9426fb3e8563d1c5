"""From finished chunks to the rows of the table, in the order of the spec's axes, a block at a time."""

from collections.abc import Iterator

import numpy as np

from wavesweep.analysis.doubt import words
from wavesweep.sweep.question import Question

BLOCK = 1 << 17  # combinations; 13 columns of them take some 15 MB


def blocks(asked: Question, parts) -> Iterator[dict[str, np.ndarray]]:
    """Yield the table's columns for consecutive combinations; `parts`: all chunks, finished."""
    grid = asked.grid
    for start in range(0, grid.size, BLOCK):
        combination = np.arange(start, min(start + BLOCK, grid.size))
        loop, wall = grid.column_of(combination)
        which, records = _gather(asked.chunks, parts, loop * grid.walls + wall)
        yield _columns(grid, asked.axis.name, combination[which], records)


def _gather(chunks, parts, column):
    """The records of the columns in their order, and for each the index of its column in `column`.

    Where the wall's axes are not the last ones, neighbouring rows are in different chunks, and each chunk is read again
    for every block that it has rows in: from the page cache, at a cost far below that of solving it.
    """
    owner = chunks.of(column)
    order = np.argsort(owner, kind="stable")
    borders = np.flatnonzero(np.diff(owner[order])) + 1
    which, records = [], []
    for members in np.split(order, borders):
        chunk = chunks[int(owner[members[0]])]
        found = parts.load(chunk.number)
        wanted = column[members] - chunk.first
        first, end = (np.searchsorted(found["column"], wanted, side=side) for side in ("left", "right"))
        rows = end - first
        at = np.repeat(first - np.concatenate([[0], np.cumsum(rows)[:-1]]), rows) + np.arange(rows.sum())
        which.append(np.repeat(members, rows))
        records.append(found[at])
    which, records = np.concatenate(which), np.concatenate(records)
    if borders.size and np.any(np.diff(which) < 0):
        back = np.argsort(which, kind="stable")
        which, records = which[back], records[back]
    return which, records


def _columns(grid, along, combination, records):
    found = {name: np.ascontiguousarray(records[name]) for name in records.dtype.names if name != "column"}
    found["doubt"] = words(found["doubt"])
    leading = grid.axis_columns(combination)
    return leading | {"along": np.full(records.size, along, dtype=object)} | found
