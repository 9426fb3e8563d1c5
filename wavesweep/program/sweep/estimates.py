"""Estimates of a run: bytes of disk, and seconds of work."""

import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.atomic_files import free_bytes
from wavesweep.program.sweep.job import Job, cut_otherwise, naming_values
from wavesweep.program.sweep.pools import timed


def expected_bytes(job: Job) -> int:
    """Bytes of disk that the run needs at its end, before the finished chunks are removed,
    roughly."""
    # An axis has 12 bytes in a row of CSV and Parquet file together.
    row = job.kind.row_bytes + 12 * len(job.grid.axes)
    return int(job.kind.rows * (job.slices * job.dtype.itemsize + job.size * row))


def refuse_full_disk(checkpoint: Path | None, jobs: Iterable[Job]) -> None:
    """Raise UsageError if the disk of the file `checkpoint`, in which the jobs keep their chunks, cannot
    hold their results.

    Chunks of a run that was stopped are counted as part of the results.
    """
    if checkpoint is None:
        return
    place = next(folder for folder in checkpoint.absolute().parents if folder.is_dir())
    present = checkpoint.stat().st_size if checkpoint.is_file() else 0
    need = sum(map(expected_bytes, jobs)) - present
    free = free_bytes(place)
    if need > free:
        raise UsageError(
            f"{checkpoint.parent}: the run needs about {_size(need)}, found {_size(free)} free on this disk; name "
            "another folder for the results, or sweep fewer values"
        )


def _size(count):
    if count >= 1e9:
        return f"{count / 1e9:.3g} GB"
    return f"{count / 1e6:.3g} MB"


SLOW_SLICE = 1.0  # s of a slice, which its first call does not change by much


def expected_seconds(job: Job, longest: float = 0.1) -> float:  # s; no further sample after that
    """Seconds of a processor for the whole job, estimated from a small part of it; longest: for the
    samples, s.

    A chunk costs so much by itself, and so much for each of its slices. Samples of several slices
    beside one of a single slice tell both; what slices of a chunk share makes the estimate too
    large, by up to two times.
    """
    sample, times = job.kind.sample(job)
    total_slices = job.slices * times
    total_chunks = len(job.chunks) * times
    job, chunks = _samples(sample)
    single = job.task(replace(chunks[0], loops=chunks[0].loops[:1], points=chunks[0].points[:1]))
    tasks = [job.task(chunk) for chunk in chunks]
    done, slices = 0, 0
    with naming_values(job):
        first = _seconds_of(single)
        if first > SLOW_SLICE:
            return first * total_slices
        one_slice = _seconds_of(single)  # the first call costs more than it will later
        if one_slice > longest and all(chunk.slices == 1 for chunk in chunks):
            return one_slice * total_slices
        started = time.process_time()
        for chunk, task in zip(chunks, tasks, strict=True):
            timed(chunk.number, task)
            done += 1
            slices += chunk.slices
            seconds = time.process_time() - started
            if seconds > longest:
                break
    if slices == done:
        return seconds / slices * total_slices
    each_slice = max(0.0, seconds - done * one_slice) / (slices - done)
    each_chunk = max(0.0, one_slice - each_slice)
    return each_chunk * total_chunks + each_slice * total_slices


def _seconds_of(task):
    started = time.process_time()
    task()
    return time.process_time() - started


def _samples(job):
    """The job in small chunks, and some of them, from its middle and its ends."""
    chunks = job.chunks
    # Half a chunk, so that neither the overhead of a batch nor one dear loop of it decides.
    enough = max(1, chunks.deep * chunks.wide // 2)
    wide = min(chunks.points, enough)
    deep = max(1, enough // wide)
    if (
        2 * len(job.grid.resolved) > chunks.loops
    ):  # nearly every loop is drawn for itself, and few of them show the time
        deep = min(deep, 8)  # loops of a sample that share no drawing
    small = cut_otherwise(job, deep=deep, wide=wide)
    shares = np.linspace(0, 1, 6)[[3, 0, 5, 1, 4, 2]]  # slices at an end often take longer
    numbers = dict.fromkeys(np.rint(shares * (len(small.chunks) - 1)).astype(int).tolist())
    return small, [small.chunks[number] for number in numbers]


def duration(seconds: float) -> str:
    """Seconds, or minutes, in words."""
    if seconds < 100:
        return f"{short(seconds)} s"
    return f"{short(seconds / 60)} min"


def short(number):
    """A number with two digits, or as a whole one."""
    if number < 99.5:
        return f"{number:.2g}"
    return f"{number:.0f}"
