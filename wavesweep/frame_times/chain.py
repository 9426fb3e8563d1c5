"""Which frames follow which, and whether that matters."""

import numpy as np

SHUFFLES = 199  # with the run itself 200: SIGNIFICANCE is two of them
SIGNIFICANCE = 2 / (1 + SHUFFLES)  # share of shuffled runs, below which frames are not independent


def pairs_of(lengths: np.ndarray, values: np.ndarray) -> np.ndarray:
    """How often each length is followed by each, `(values, values)`."""
    index = np.searchsorted(values, lengths)
    n = len(values)
    return np.bincount(index[:-1] * n + index[1:], minlength=n * n).reshape(n, n)


def are_independent(lengths: np.ndarray, values: np.ndarray) -> bool:
    """Whether frames follow each other as in a run whose order is random, as far as pairs of
    neighbours show.

    A permutation test at SIGNIFICANCE: the likelihood ratio of pairs against independent frames,
    beside that of shuffled runs. It is exact for runs of any length, which a chi-squared
    distribution of pairs that are rare is not.
    """
    rng = np.random.default_rng(0)
    dependence = _dependence(pairs_of(lengths, values))
    least = dependence - 1e-9 * abs(dependence)
    larger = 0
    for _ in range(SHUFFLES):
        shuffled = rng.permutation(lengths)
        larger += _dependence(pairs_of(shuffled, values)) >= least
    return bool((1 + larger) / (1 + SHUFFLES) > SIGNIFICANCE)


def _dependence(pairs):
    """The sum of `n log(n / (r c))` over pairs, with the sums r and c of their row and column,
    up to a constant."""
    return _information(pairs) - _information(pairs.sum(0)) - _information(pairs.sum(1))


def _information(n):
    """The sum of `n log n`."""
    return float((n * np.log(np.maximum(n, 1))).sum())
