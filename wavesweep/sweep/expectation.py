"""How long the work will take: measured on a few loops from all over the sweep."""

import time

import numpy as np

from wavesweep.sweep.question import Question, cut_otherwise
from wavesweep.sweep.slices import solve

PROBES = 5  # samples of the sweep
ENOUGH = 40  # columns of a sample, about: what a batch costs beside its columns should not decide


def expected_seconds(asked: Question) -> float:
    """Seconds of work in one process for the whole question, by solving a small part of it."""
    chunks = asked.chunks
    wide = min(chunks.walls, ENOUGH)
    small = cut_otherwise(asked, deep=max(1, ENOUGH // wide) if wide == chunks.walls else 1, wide=wide)
    numbers = np.unique(np.linspace(0, len(small.chunks) - 1, PROBES).round().astype(int)).tolist()
    samples = [small.chunks[number] for number in numbers]
    solve(small.work(samples[0]))  # the first call of everything costs more than it will later
    started = time.perf_counter()
    for sample in samples:
        solve(small.work(sample))
    seconds = time.perf_counter() - started
    return seconds / sum(sample.columns for sample in samples) * asked.columns
