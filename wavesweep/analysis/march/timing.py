"""When the two loops of an experiment really run: the fast ticks' lengths, and what becomes of the slow results."""

from __future__ import annotations

import numpy as np

from wavesweep.analysis.march.options import Options


def tick_lengths(options: Options, T: float, ticks: int) -> np.ndarray:
    """Give the length of every fast tick (s), ``T·(1 + jitter·U)`` with ``U`` evenly spread over -1 to 1."""
    if options.jitter == 0:
        return np.full(ticks, T)
    source = _source(options, 0)
    return T * (1 + options.jitter * source.uniform(-1.0, 1.0, ticks))


def lateness(options: Options, frames: int) -> list[int | None]:
    """Give by how many ticks each slow result is late, None for one that never comes."""
    late = _source(options, 1).integers(0, int(options.late), frames, endpoint=True).tolist()
    lost = _source(options, 2).uniform(size=frames) < options.dropped
    return [None if gone else ticks for ticks, gone in zip(late, lost.tolist(), strict=True)]


def _source(options: Options, stream: int) -> np.random.Generator:
    """Each feature has its own stream, so that switching one on leaves the others' numbers as they were."""
    return np.random.default_rng(np.random.SeedSequence(int(options.seed), spawn_key=(stream,)))
