"""Words: patterns of frames that make a loop unstable if they are repeated for ever."""

from collections.abc import Sequence
from heapq import nlargest

import numpy as np

from wavesweep.engine.frames import both
from wavesweep.engine.poles import count_outside
from wavesweep.for_all.graph import Family, Graph
from wavesweep.for_all.norm_check import Norms

KEPT = 60  # words of each length that are extended
LOOKED_AT = 120  # words of each length whose eigenvalues are computed
LONGEST = 14  # matrices in a word
RUN = 12  # matrices of each of the two runs of a word
LEADING = 8  # words of each length, and of each pair of runs, whose growth counts
WALKS, WALKED = 32, 160  # walks of a state, and their matrices
TINY = 1e-290  # a state that is gone
IMPROVED = 3  # of all words that grow most, those that are changed matrix by matrix
LONGEST_IMPROVED = 64  # matrices
BISECTIONS = 40
BEYOND = (1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3)  # of a number where a word begins to grow, how far beyond it that is proved
LOOKED_BACK = 32  # numbers on the way to a refuted one at which its word may grow already
SHORTEST, MOST = 4, 400  # matrices of the words that are all tried, and how many these are at most
SHORT = 2  # matrices of the words that are looked for to rank numbers, before the best are improved
RANKED, STEPS, HALVED = 1e-2, 24, 6  # of the limit, from where on numbers are tried; how many, and bisections after them

Word = tuple[int, ...]


def is_refuted(family: Family, word: Word, x: float) -> bool:
    """Return whether the word, repeated for ever, is proved to grow at x.

    The product has an eigenvalue outside the unit circle for all matrices within the bounds on the errors of its entries (see
    `count_outside`).
    """
    E, dE = family.enclosed(x)
    product = E[word[0]], dE[word[0]]
    for symbol in word[1:]:
        product = both(product, (E[symbol], dE[symbol]))
    count, clear = count_outside(product[0][None], product[1][None])
    return bool(count[0] > 0 and clear[0])


def product_of(A: np.ndarray, word: Word) -> np.ndarray:
    """Return the product of the matrices of a word, the first of which acts first."""
    product = A[word[0]]
    for symbol in word[1:]:
        product = A[symbol] @ product
    return product


def growth(A: np.ndarray, word: Word) -> float:
    """Return the spectral radius of the product of a word."""
    product = product_of(A, word)
    return float(np.abs(np.linalg.eigvals(product)).max()) if np.isfinite(product).all() else np.inf


def growing(
    A: np.ndarray,
    follows: np.ndarray,
    basis: np.ndarray,
    known: Sequence[Word] = (),
    more: int = 1,
    longest: int = LONGEST,
    norms: Norms | None = None,
) -> list[Word]:
    """Return words of matrices A `(symbols, n, n)` whose products have a spectral radius of 1 or more, fastest growth per
    matrix first.

    basis: one in which the matrices are small. known: words to start from. norms: in which the matrices nearly
    shrink. Of words of each length, `more` times KEPT, those with the largest matrices, are extended. Beside these there are
    words of two runs, and the ends of walks. The best of all are changed matrix by matrix. This is a search: it may return
    nothing although there are such words.
    """
    A, longest = np.linalg.inv(basis) @ A @ basis, more * longest
    rates = {word: growth(A, word) ** (1 / len(word)) for word in known} | _of_two_runs(A, follows)
    words, products = np.arange(len(A))[:, None], A
    for length in range(1, longest + 1):
        order = np.argsort(-np.linalg.norm(products, axis=(-2, -1)))
        closing = order[follows[words[order, -1], words[order, 0]]][:LOOKED_AT]
        if closing.size:
            radius = np.abs(np.linalg.eigvals(products[closing])).max(-1) ** (1 / length)
            best = np.argsort(-radius)[:LEADING]
            rates |= {_least(tuple(words[closing[i]].tolist())): radius[i] for i in best}
        first, symbol = np.nonzero(follows[words[order[: more * KEPT], -1]])
        first = order[first]
        words = np.concatenate([words[first], symbol[:, None]], axis=1)
        products = A[symbol] @ products[first]
    graph = norms.graph if norms else Graph.least(follows)
    P = basis.T @ norms.P @ basis if norms else np.broadcast_to(np.eye(len(basis)), (graph.nodes, *basis.shape))
    rates |= _of_walks(A, follows, Norms(P, graph))
    for word in sorted(rates, key=rates.get, reverse=True)[:IMPROVED]:
        better = improved(A, follows, word)
        rates[better] = growth(A, better) ** (1 / len(better))
    return [word for word in sorted(rates, key=rates.get, reverse=True) if rates[word] >= 1]


def _of_two_runs(A, follows):
    """The growth per matrix of the best words of a run of one matrix and a run of another.

    Frames are in the order of their lengths: one of both is the first or the last, the other one of these or of three between.
    """
    last, rates = len(A) - 1, {}
    some = sorted({0, last // 4, last // 2, 3 * last // 4, last})
    ends = [(i, j) for i in some for j in some if i < j and (i == 0 or j == last) and follows[[i, i, j, j], [i, j, i, j]].all()]
    if not ends:
        return rates
    size = np.linalg.norm(A[some], axis=(-2, -1)).max() or 1.0
    powers = np.repeat(A[some][None] / size, RUN, 0)
    for length in range(1, RUN):
        powers[length] = powers[0] @ powers[length - 1]
    lengths = np.add.outer(np.arange(1, RUN + 1), np.arange(1, RUN + 1))
    for i, j in ends:
        products = powers[None, :, some.index(j)] @ powers[:, None, some.index(i)]
        radius = np.abs(np.linalg.eigvals(products)).max(-1) ** (1 / lengths)
        for place in np.argsort(-radius, axis=None)[:LEADING].tolist():
            one, other = divmod(place, RUN)
            rates[_least((i,) * (1 + one) + (j,) * (1 + other))] = size * radius.flat[place]
    return rates


def _of_walks(A, follows, norms):
    """The growth per matrix of the ends of walks, on which each matrix is that which leaves the state largest in norms."""
    graph, n = norms.graph, A.shape[-1]
    scale = np.linalg.norm(A, axis=(-2, -1)).max() or 1.0
    A, state = A / scale, np.random.default_rng(0).normal(size=(WALKS, n))
    leads_to = np.full((graph.nodes, len(A)), -1)
    leads_to[graph.source, graph.symbol] = graph.target
    node, walker, walks = np.arange(WALKS) % graph.nodes, np.arange(WALKS), np.empty((WALKS, WALKED), int)
    for step in range(WALKED):
        moved, target = np.einsum("sij,wj->wsi", A, state), leads_to[node]
        size = np.einsum("wsi,wsij,wsj->ws", moved, norms.P[target], moved)
        walks[:, step] = symbol = np.where(target < 0, -1.0, size).argmax(1)
        state, node = moved[walker, symbol], target[walker, symbol]
        state /= np.maximum(np.linalg.norm(state, axis=-1, keepdims=True), TINY)
    ends = np.unique(walks[:, -LONGEST_IMPROVED:], axis=0)
    products, closed = np.broadcast_to(np.eye(n), (len(ends), n, n)), []
    for length in range(1, 1 + LONGEST_IMPROVED):
        products = products @ A[ends[:, -length]]
        closing = np.flatnonzero(follows[ends[:, -1], ends[:, -length]])
        radius = scale * np.abs(np.linalg.eigvals(products[closing])).max(-1) ** (1 / length)
        closed += zip(radius.tolist(), closing.tolist(), [length] * closing.size, strict=True)
    return {_least(tuple(ends[i, -length:].tolist())): rate for rate, i, length in nlargest(LOOKED_AT, closed)}


def improved(A: np.ndarray, follows: np.ndarray, word: Word) -> Word:
    """Return a word that grows at least as fast per matrix, by changing, adding or removing one matrix at a time.

    If many matrices are nearly alike, this finds words that `growing` drops. A: `(symbols, n, n)`.
    """
    rate = growth(A, word) ** (1 / len(word))
    while len(word) < LONGEST_IMPROVED:
        words, products = _neighbours(A, word)
        radius = np.abs(np.linalg.eigvals(products)).max(-1) ** (1 / np.array([len(each) for each in words]))
        best = next((i for i in np.argsort(-radius).tolist() if _allowed(follows, words[i])), None)
        if best is None or radius[best] <= rate * (1 + 1e-12):
            break
        word, rate = words[best], radius[best]
    return _least(word)


def _neighbours(A, word):
    """The words with one matrix changed, added or removed, and their products."""
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
    return changed + added + less, products


def _allowed(follows, word):
    return all(follows[one, other] for one, other in zip(word, (*word[1:], word[0]), strict=True))


def _least(word):
    """The representative of all words with the same cycle: rotations and repetitions of a word have the same one."""
    length = next(k for k in range(1, len(word) + 1) if len(word) % k == 0 and word == word[:k] * (len(word) // k))
    return min(word[i:length] + word[:i] for i in range(length))


def short_words(follows: np.ndarray) -> list[Word]:
    """Return all words of few matrices, each cycle once: of up to SHORTEST matrices, or fewer if they are more than MOST."""
    one_way, found = [(i,) for i in range(len(follows))], {}
    for _ in range(SHORTEST):
        closed = {_least(word) for word in one_way if follows[word[-1], word[0]]}
        if found and len(found) + len(closed) > MOST:
            break
        found |= dict.fromkeys(sorted(closed, key=lambda word: (len(word), word)))
        one_way = [(*word, i) for word in one_way for i in np.flatnonzero(follows[word[-1]]).tolist()]
        if len(one_way) > MOST * SHORTEST:
            break
    return list(found)


def growing_of(A: np.ndarray, words: Sequence[Word]) -> list[Word]:
    """Return those of some words whose products have a spectral radius of 1 or more, fastest growth per matrix first."""
    rates = {}
    for length in {len(word) for word in words}:
        some = [word for word in words if len(word) == length]
        products = A[[word[0] for word in some]]
        for at in range(1, length):
            products = A[[word[at] for word in some]] @ products
        known = np.isfinite(products).all((-1, -2))
        radius = np.abs(np.linalg.eigvals(np.where(known[:, None, None], products, 0.0))).max(-1)
        rates |= dict(zip(some, np.where(known, radius, np.inf) ** (1 / length), strict=True))
    return [word for word in sorted(rates, key=rates.get, reverse=True) if rates[word] >= 1]


def nearest(family: Family, word: Word, start: float, x: float) -> float:
    """Return the refuted number closest to the start at which a word grows, one that is refuted at x."""
    inside = start
    for outside in start + (x - start) * np.linspace(0, 1, LOOKED_BACK + 1)[1:]:
        if growth(family.at(outside), word) >= 1:
            at = refuted_beyond(family, word, crossing(family, word, inside, outside), x)
            return x if at is None else at
        inside = outside
    return x


def crossing(family: Family, word: Word, stable: float, unstable: float) -> float:
    """Return the number between both at which the word begins to grow, on the side where it does."""
    low, high = stable, unstable
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        low, high = (low, middle) if growth(family.at(middle), word) >= 1 else (middle, high)
    return high


def seems_refuted(family: Family, x: float) -> bool:
    """Return whether some short word grows at x, in plain doubles: a search, which proves nothing."""
    A = family.at(x)
    return not np.isfinite(A).all() or bool(growing(A, family.follows, np.eye(A.shape[-1]), longest=SHORT))


def seems_refuted_from(family: Family, limit: float) -> float:
    """Return about the least number up to the limit at which some short word grows, or else the limit.

    To rank what it is too long to prove: a proof from 0 on hardly reaches further.
    """
    low, high = 0.0, limit
    for x in np.geomspace(RANKED * limit, limit, STEPS):
        if seems_refuted(family, x):
            high = float(x)
            break
        low = float(x)
    for _ in range(HALVED):
        middle = (low + high) / 2
        low, high = (low, middle) if seems_refuted(family, middle) else (middle, high)
    return high


def refuted_beyond(family: Family, word: Word, x: float, limit: float) -> float | None:
    """Return a number just beyond x, towards the limit, at which the word is proved to grow; None if none is found."""
    away = np.sign(limit - x) * max(abs(x), 1e-6 * abs(limit - x))
    for step in BEYOND:
        at = x + step * away
        if abs(at - x) <= abs(limit - x) and is_refuted(family, word, at):
            return float(at)
    return None
