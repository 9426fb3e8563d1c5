"""From finished chunks to the rows of the table, in blocks."""

from collections.abc import Iterator, Mapping

import numpy as np

from wavesweep.store.checkpoint import DamagedError
from wavesweep.sweep.job import Job

BLOCK = 1 << 17  # combinations; 13 columns of them take some 15 MB, 22 of responses 25 MB


def records_of(job: Job, store, number: int) -> np.ndarray:
    """The records of a finished chunk; if it was damaged meanwhile, it is computed again."""
    try:
        return store.load(number)
    except DamagedError as error:
        store.set_aside(number, error)
        store.save(number, job.task(job.chunks[number]).records())
        return store.load(number)


def blocks(job: Job, store) -> Iterator[Mapping[str, np.ndarray]]:
    """Yield the table's columns for consecutive combinations; store: a checkpoint in which all chunks are finished."""
    for combination in stretches(job.size):
        which, records = gather(job, store, job.slice_of(combination))
        yield job.columns(combination[which], records)


def stretches(size: int) -> Iterator[np.ndarray]:
    """Yield the numbers of the combinations of each block."""
    for start in range(0, size, BLOCK):
        yield np.arange(start, min(start + BLOCK, size))


def gather(job: Job, store, slices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For the records of the slices, in their order, the index of the slice in `slices`; and the records.

    If the wall's axes are not the last ones, neighbouring rows are in different chunks, and each chunk is read again for
    every block that has rows of it: from the page cache, at a cost far below that of computing it.
    """
    if len(job.chunks) == 1 and slices.size == job.slices and (slices == np.arange(slices.size)).all():
        records = records_of(job, store, 0)
        return records["slice"], records
    owner = job.chunks.of(slices)
    order = np.argsort(owner, kind="stable")
    borders = np.flatnonzero(np.diff(owner[order])) + 1
    which, records = [], []
    for members in np.split(order, borders):
        chunk = job.chunks[int(owner[members[0]])]
        found = records_of(job, store, chunk.number)
        wanted = slices[members] - chunk.first
        first, end = (np.searchsorted(found["slice"], wanted, side=side) for side in ("left", "right"))
        rows = end - first
        at = np.repeat(first - np.concatenate([[0], np.cumsum(rows)[:-1]]), rows) + np.arange(rows.sum())
        which.append(np.repeat(members, rows))
        records.append(found[at])
    which, records = np.concatenate(which), np.concatenate(records)
    if borders.size and np.any(np.diff(which) < 0):
        back = np.argsort(which, kind="stable")
        which, records = which[back], records[back]
    return which, records
