"""Patterns of frames that make a loop unstable: words that are repeated for ever."""

import numpy as np

from wavesweep.monodromy.rounding import both
from wavesweep.robust.family import Family
from wavesweep.stability.spectrum import count_outside

KEPT = 60  # words of each length that are made longer
LOOKED_AT = 80  # words of each length whose eigenvalues are computed
LONGEST = 14  # matrices in a word
LONGEST_IMPROVED = 64
BISECTIONS = 40

Word = tuple[int, ...]


def is_refuted(family: Family, word: Word, x: float) -> bool:
    """Return whether the word, repeated for ever, is proved to grow at x.

    Its product has an eigenvalue outside the unit circle. The product is formed with a bound on the errors of its entries, and
    no matrix within it may have an eigenvalue on the circle near those that are outside (see `count_outside`).
    """
    E, dE = family.enclosed(x)
    product = E[word[0]], dE[word[0]]
    for symbol in word[1:]:
        product = both(product, (E[symbol], dE[symbol]))
    count, clear = count_outside(product[0][None], product[1][None])
    return bool(count[0] > 0 and clear[0])


def growth(A: np.ndarray, word: Word) -> float:
    """Return the spectral radius of the product of a word."""
    product = A[word[0]]
    for symbol in word[1:]:
        product = A[symbol] @ product
    return float(np.abs(np.linalg.eigvals(product)).max()) if np.isfinite(product).all() else np.inf


def growing(A: np.ndarray, follows: np.ndarray, basis: np.ndarray, kept: int = KEPT, longest: int = LONGEST) -> list[Word]:
    """Return words of matrices A `(symbols, n, n)` whose products have a spectral radius of 1 or more, those that grow most per
    matrix first.

    Of each length the words are kept whose products have the largest norms, in a basis in which the matrices are small: longer
    ones begin with these. None may be found though there are some.
    """
    A = np.linalg.inv(basis) @ A @ basis
    words, products, found = np.arange(len(A))[:, None], A, []
    for length in range(1, longest + 1):
        size = np.linalg.norm(products, axis=(-2, -1))
        order = np.argsort(-size)
        closing = order[follows[words[order, -1], words[order, 0]]][:LOOKED_AT]
        if closing.size:
            radius = np.abs(np.linalg.eigvals(products[closing])).max(-1)
            found += [(radius[i] ** (1 / length), tuple(words[closing[i]].tolist())) for i in np.flatnonzero(radius >= 1)]
        first, symbol = np.nonzero(follows[words[order[:kept], -1]])
        first = order[first]
        words = np.concatenate([words[first], symbol[:, None]], axis=1)
        products = A[symbol] @ products[first]
    return list(dict.fromkeys(_least(word) for _, word in sorted(found, reverse=True)))


def improved(A: np.ndarray, follows: np.ndarray, word: Word) -> Word:
    """Return a word that grows at least as fast per matrix, by changing, adding or leaving out one matrix again and again.

    Among many matrices that are nearly alike, this finds words that `growing` leaves out. A: `(symbols, n, n)`.
    """
    rate = growth(A, word) ** (1 / len(word))
    while len(word) < LONGEST_IMPROVED:
        n, length = A.shape[-1], len(word)
        before, after = [np.eye(n)], [np.eye(n)]
        for i in range(length):
            before.append(A[word[i]] @ before[-1])
            after.append(after[-1] @ A[word[-1 - i]])
        after.reverse()  # after[i]: of the matrices from the i-th on
        changed = [(*word[:i], j, *word[i + 1 :]) for i in range(length) for j in range(len(A))]
        added = [(*word[:i], j, *word[i:]) for i in range(length) for j in range(len(A))]
        less = [word[:i] + word[i + 1 :] for i in range(length)] if length > 1 else []
        products = [after[i + 1] @ A @ before[i] for i in range(length)] + [after[i] @ A @ before[i] for i in range(length)]
        products = np.concatenate([*products, np.array([after[i + 1] @ before[i] for i in range(len(less))]).reshape(-1, n, n)])
        words = changed + added + less
        radius = np.abs(np.linalg.eigvals(products)).max(-1) ** (1 / np.array([len(each) for each in words]))
        best = next((i for i in np.argsort(-radius).tolist() if _allowed(follows, words[i])), None)
        if best is None or radius[best] <= rate * (1 + 1e-12):
            break
        word, rate = words[best], radius[best]
    return _least(word)


def _allowed(follows, word):
    return all(follows[one, other] for one, other in zip(word, (*word[1:], word[0]), strict=True))


def _least(word):
    """The same word for all that begin elsewhere in it, and for repetitions."""
    length = next(k for k in range(1, len(word) + 1) if len(word) % k == 0 and word == word[:k] * (len(word) // k))
    return min(word[i:length] + word[:i] for i in range(length))


def crossing(family: Family, word: Word, stable: float, unstable: float) -> float:
    """Return a number between both at which the word begins to grow, from the side of the one at which it does."""
    low, high = stable, unstable
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (low, middle) if growth(family.at(middle), word) >= 1 else (middle, high)
    return high


def refuted_beyond(family: Family, word: Word, x: float, limit: float) -> float | None:
    """Return the number nearest to x, towards the limit, at which the word is proved to grow; None if none is found."""
    away = np.sign(limit - x) * max(abs(x), 1e-6 * abs(limit - x))
    for step in (1e-10, 1e-8, 1e-6):
        at = x + step * away
        if abs(at - x) <= abs(limit - x) and is_refuted(family, word, at):
            return float(at)
    return None
