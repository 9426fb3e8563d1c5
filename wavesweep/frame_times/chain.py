"""Which frames follow which, and whether that matters."""

import numpy as np

SHUFFLES = 199
LEVEL = 0.01  # share of shuffled runs, below which frames are not independent


def pairs_of(lengths: np.ndarray, values: np.ndarray) -> np.ndarray:
    """How often each length is followed by each, `(values, values)`."""
    index, n = np.searchsorted(values, lengths), len(values)
    return np.bincount(index[:-1] * n + index[1:], minlength=n * n).reshape(n, n)


def are_independent(lengths: np.ndarray, values: np.ndarray) -> bool:
    """Whether frames follow each other as in a run whose order is random, as far as pairs of neighbours show.

    A permutation test at LEVEL: the likelihood ratio of pairs against independent frames, beside that of shuffled runs. It is
    exact for runs of any length, which a chi-squared distribution of pairs that are rare is not.
    """
    rng = np.random.default_rng(0)
    dependence = _dependence(pairs_of(lengths, values))
    larger = sum(
        _dependence(pairs_of(rng.permutation(lengths), values)) >= dependence - 1e-9 * abs(dependence) for _ in range(SHUFFLES)
    )
    return bool((1 + larger) / (1 + SHUFFLES) > LEVEL)


def _dependence(pairs):
    """The sum of `n log(n / (r c))` over pairs, with the sums r and c of their row and column, up to a constant."""
    return sum(
        sign * float((n * np.log(np.maximum(n, 1))).sum()) for sign, n in ((1, pairs), (-1, pairs.sum(0)), (-1, pairs.sum(1)))
    )
