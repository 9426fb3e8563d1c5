"""Rows come in the order of the spec's axes with the same bits, wherever a chunk or a block of rows ends."""

import numpy as np
import pytest

from wavesweep.program.analyses.interval_jobs import job_of
from wavesweep.program.columns import joined
from wavesweep.program.store.checkpoint import MemoryCheckpoint
from wavesweep.program.sweep import running
from wavesweep.program.sweep.job import MOST, Chunks, cut_otherwise
from wavesweep.program.sweep.running import compute
from wavesweep.program.sweep.workers import Workers

HERE = Workers(1, None, None, "a test")


def table_of(job):
    store = MemoryCheckpoint()
    compute(job, store, HERE)
    return joined(running.blocks(job, store))


@pytest.fixture(scope="module")
def whole(mixed):
    """The table of the mixed sweep."""
    return table_of(job_of(mixed))


@pytest.mark.slow
def test_borders_of_chunks_leave_no_trace(mixed, whole, same):
    same(table_of(cut_otherwise(job_of(mixed), deep=1, wide=7)), whole)


def test_borders_of_blocks_leave_no_trace(mixed, whole, same, monkeypatch):
    job, store = job_of(mixed), MemoryCheckpoint()
    compute(job, store, HERE)
    for size in (1, 5, 32):
        monkeypatch.setattr(running, "ROWS_OF_BLOCK", size)
        same(joined(running.blocks(job, store)), whole)


@pytest.mark.parametrize(("loops", "points"), [(1, 1), (10, 3), (3, 10_000), (5000, 1), (7, 4096), (500_000, 1)])
def test_chunks_cover_every_column_once(loops, points):
    chunks = Chunks(loops, points, max(MOST // points, 1), min(points, MOST))
    columns = [column for number in range(len(chunks)) for column in _columns(chunks, number)]
    assert columns == list(range(loops * points))
    owner = np.concatenate([np.full(chunks[number].slices, number) for number in range(len(chunks))])
    assert np.array_equal(chunks.of(np.arange(loops * points)), owner)
    assert chunks[0].slices == min(loops * points, MOST // points * points or MOST)


@pytest.mark.parametrize("count", [0, 1, 2, 7, 64, 1000])
def test_the_chunks_that_are_computed_first_lie_far_apart(count):
    chunks = Chunks(count + 3, 1, 1, 1)
    order = [*chunks.spread(range(3, 3 + count))]
    assert sorted(order) == [*range(3, 3 + count)]
    if count >= 64:
        assert np.diff(np.sort(order[:16])).max() <= count / 8


def _columns(chunks: Chunks, number):
    chunk = chunks[number]
    found = [loop * chunks.points + point for loop in chunk.loops for point in chunk.points]
    assert (found[0], len(found)) == (chunk.first, chunk.slices)
    return found
