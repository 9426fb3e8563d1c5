"""Loops with long delays in which nothing crosses the circle, against all of their eigenvalues."""

import numpy as np
import pytest

from wavesweep.engine.stability.by_lines import unstable_counts
from wavesweep.engine.stability.sampled_frames import Frames

STATES = 30  # of the delay


def radius(M):
    return np.abs(np.linalg.eigvals(M)).max()


def random_loop(seed):
    """M0, M1 and M2 of `M0 + p M1 + p^2 M2`: a few states behind and before a delay, whose last two are read.

    The gain from these is such that the largest eigenvalue at p = 0 has a size from well inside the circle to just outside.
    """
    random = np.random.default_rng(seed)
    k, line = int(random.integers(1, 4)), np.arange(STATES)
    parts = np.zeros((3, k + STATES, k + STATES))
    for M, size in zip(parts, (1.0, 0.03, 0.01), strict=True):
        M[:k, :k], M[:k, -2:] = size * 0.3 * random.normal(size=(k, k)), size * random.normal(size=(k, 2))
        M[k, :k], M[k + 5, :k] = size * random.normal(size=k), size * 0.1 * random.normal(size=k)
    parts[0, k + line[1:], k + line[:-1]] = 1
    low, high, wanted = 0.0, 8.0, random.choice([0.9, 0.99, 1 - 1e-3, 1 - 1e-5, 1 + 1e-4, 1.01])
    for _ in range(30):
        gain = np.ones(k + STATES)
        gain[-2:] = (low + high) / 2
        low, high = (gain[-1], high) if radius(parts[0] * gain) < wanted else (low, gain[-1])
    return parts * gain


def counts(parts):
    """What is known of the loop for p from -1 to 1; its entries are exact but for a rounding."""

    def frames(_, p):
        return Frames.of(np.tensordot(np.ravel(p)[:, None] ** np.arange(3), parts, 1) - np.eye(parts.shape[-1]))

    def errors(_, p):
        E = frames(_, p).E
        return E, np.finfo(float).eps * np.abs(E)

    (found,) = unstable_counts(frames, errors, (-1.0, 1.0), 1, np.array([[-np.inf], [np.inf]]))
    return found


@pytest.mark.sample(4)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(400))
def test_a_count_is_that_of_the_eigenvalues_at_all_values(seed):
    parts = random_loop(seed)
    frames = [parts[0] + p * parts[1] + p**2 * parts[2] for p in np.linspace(-1, 1, 101)]
    outside = {(np.abs(np.linalg.eigvals(M)) > 1).sum() for M in frames}
    assert counts(parts) in ({-1, *outside} if len(outside) == 1 else {-1})


@pytest.mark.parametrize(("gain", "unstable"), [(0.5, 0), (1.5, STATES + 1), (1.0, -1)])
def test_what_is_clear_is_known(gain, unstable):
    """`z^(n + 1) = gain + p/100`, whose roots are all of one size; with a gain of 1 they cross."""
    parts = np.zeros((3, STATES + 1, STATES + 1))
    parts[0, np.arange(1, STATES + 1), np.arange(STATES)] = 1
    parts[0, 0, -1], parts[1, 0, -1] = gain, 0.01
    assert counts(parts) == unstable
