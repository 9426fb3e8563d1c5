"""How long the work will take: measured on a few loops from all over the sweep."""

import time

import numpy as np

from wavesweep.sweep.question import Question, cut_otherwise

PROBES = 6  # samples of the sweep
SHARE = 10  # a sample is so many times smaller than a chunk: large enough that what a batch costs does not decide
LONGEST = 0.3  # s; no further sample after that


def expected_seconds(asked: Question) -> float:
    """Seconds of work in one process for the whole question, by solving a small part of it."""
    samples = _samples(asked)
    samples[0].records()  # the first call of everything costs more than it will later
    started, seconds, columns = time.perf_counter(), 0.0, 0
    for sample in samples:
        sample.records()
        seconds = time.perf_counter() - started
        columns += sum(members.size for members, _ in sample.groups) * len(next(iter(sample.walls.values())))
        if seconds > LONGEST:
            break
    return seconds / columns * asked.columns


def _samples(asked):
    """Pieces of the work, alternately from its ends and its middle."""
    chunks = asked.chunks
    enough = max(1, chunks.deep * chunks.wide // SHARE)
    wide = min(chunks.walls, enough)
    small = cut_otherwise(asked, deep=max(1, enough // wide), wide=wide)
    shares = np.linspace(0, 1, PROBES)[[0, 3, 5, 1, 4, 2]]
    numbers = dict.fromkeys(np.rint(shares * (len(small.chunks) - 1)).astype(int).tolist())
    return [small.work(small.chunks[number]) for number in numbers]
