"""Words: patterns of frames that make a loop unstable if they are repeated for ever."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise

import numpy as np

from wavesweep.engine._monodromy.periodic import products_of_rows
from wavesweep.engine._monodromy.rounding import both
from wavesweep.engine._stability.spectrum import count_outside
from wavesweep.engine._switched.graph import Family, Graph
from wavesweep.engine._switched.norm_check import Norms
from wavesweep.engine.doubles import NEXT_TO_ZERO

WORDS_KEPT = 60  # words of each length that are extended
RUN_OF_WORD = 12  # matrices of each of the two runs of a word
SQUARINGS = 10  # of the product of a word, by whose size its growth is bounded
# words whose eigenvalues are computed together, those of the largest bounds
EIGENVALUES_AT_ONCE = 16
LEADING = 8  # words of each length, and of each pair of runs, whose growth counts
WALKS = 8  # of a state
WALKED = 240  # matrices of a walk
LONGEST_RETURN = 160  # matrices of a word that is the end of a walk
ALL_WORDS_LENGTH = 4  # matrices of the words that are all tried
NEAR_ZERO = 1e-3  # of a range with 0 in it, from which on numbers of it are tried
MOST_RANKING_WORDS = 400  # how many these are at most

Word = tuple[int, ...]


def is_refuted(family: Family, word: Word, x: float) -> bool:
    """Return whether the word may be repeated for ever, and is proved to grow at x.

    The product has an eigenvalue outside the unit circle for all matrices within the bounds on the
    errors of its entries (see `count_outside`). Halves of the word are joined, since bounds on
    errors grow by a factor with each join.
    """
    if not _allowed(family.follows, word):
        return False
    E, dE = products_of_rows([word], family.enclosed(x), both)
    count, clear = count_outside(E, dE)
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
    if not np.isfinite(product).all():
        return np.inf
    return float(np.abs(np.linalg.eigvals(product)).max())


def _rate(A: np.ndarray, word: Word) -> float:
    """The growth of a word per matrix."""
    return growth(A, word) ** (1 / len(word))


def _of_large_products(
    A: np.ndarray, follows: np.ndarray, extended_words: int, longest: int
) -> dict[Word, float]:
    """The growth per matrix of words up to a length, each of which extends one of those `extended_words`
    of the length before whose products are largest."""
    rates: dict[Word, float] = {}
    words = np.arange(len(A))[:, None]
    products = A
    for length in range(1, longest + 1):
        order = np.argsort(-np.linalg.norm(products, axis=(-2, -1)))
        may_repeat = follows[words[order, -1], words[order, 0]]
        closing = order[may_repeat][:120]  # words of each length whose eigenvalues are computed
        places, fastest = _fastest(products[closing], np.full(closing.size, length), LEADING)
        for i, rate in zip(closing[places], fastest, strict=True):
            rates[_least(tuple(words[i].tolist()))] = rate
        extended = order[:extended_words]
        first, symbol = np.nonzero(follows[words[extended, -1]])
        first = extended[first]
        words = np.concatenate([words[first], symbol[:, None]], axis=1)
        products = A[symbol] @ products[first]
    return rates


def growing(
    A: np.ndarray,
    follows: np.ndarray,
    basis: np.ndarray,
    words_before: Sequence[Word] = (),
    more: int = 1,
    longest: int = 14,  # matrices in a word
    norms: Norms | None = None,
    changed: int = 3,  # of all words that grow most, those that are changed matrix by matrix
) -> list[Word]:
    """Return words of matrices A `(symbols, n, n)` whose products have a spectral radius of 1 or
    more, fastest growth per matrix first.

    basis: one in which the matrices are small. words_before: words to start from. norms: in which the
    matrices nearly shrink. Of words of each length, `more` times WORDS_KEPT, those with the largest
    matrices, are extended. Beside these there are words of two runs, and the ends of walks. The
    best of all, so many, are changed matrix by matrix. This is a search: it may return nothing
    although there are such words.
    """
    A = np.linalg.inv(basis) @ A @ basis
    rates = {word: _rate(A, word) for word in words_before}
    rates |= _of_two_runs(A, follows)
    rates |= _of_large_products(A, follows, more * WORDS_KEPT, more * longest)
    if norms is None:
        graph = Graph.least(follows)
        P = np.broadcast_to(np.eye(len(basis)), (graph.nodes, *basis.shape))
    else:
        graph = norms.graph
        P = basis.T @ norms.P @ basis
    rates |= _of_walks(A, follows, Norms(P, graph))
    for word in sorted(rates, key=rates.__getitem__, reverse=True)[:changed]:
        better = improved(A, follows, word)
        rates[better] = _rate(A, better)
    return [word for word in sorted(rates, key=rates.__getitem__, reverse=True) if rates[word] >= 1]


def _of_two_runs(A: np.ndarray, follows: np.ndarray) -> dict[Word, float]:
    """The growth per matrix of the best words of a run of one matrix and a run of another.

    Frames are in the order of their lengths: one of both is the first or the last, the other one of
    these or of three between.
    """
    last = len(A) - 1
    some = sorted({0, last // 4, last // 2, 3 * last // 4, last})
    ends = []
    for i, j in combinations(some, 2):
        at_an_end = i == 0 or j == last
        if at_an_end and follows[[i, i, j, j], [i, j, i, j]].all():
            ends.append((i, j))
    rates: dict[Word, float] = {}
    if not ends:
        return rates
    size = np.linalg.norm(A[some], axis=(-2, -1)).max() or 1.0
    powers = np.repeat(A[some][None] / size, RUN_OF_WORD, 0)
    for length in range(1, RUN_OF_WORD):
        powers[length] = powers[0] @ powers[length - 1]
    lengths = np.add.outer(np.arange(1, RUN_OF_WORD + 1), np.arange(1, RUN_OF_WORD + 1))
    for i, j in ends:
        products = powers[None, :, some.index(j)] @ powers[:, None, some.index(i)]
        places, fastest = _fastest(products.reshape(-1, *A.shape[1:]), lengths.ravel(), LEADING)
        for place, rate in zip(places.tolist(), fastest.tolist(), strict=True):
            first_run, second_run = divmod(place, RUN_OF_WORD)
            rates[_least((i,) * (1 + first_run) + (j,) * (1 + second_run))] = size * rate
    return rates


def _of_walks(A: np.ndarray, follows: np.ndarray, norms: Norms) -> dict[Word, float]:
    """The growth per matrix of the ends of walks, on which each matrix is that which leaves the
    state largest in norms.

    A slow oscillation that decays with each matrix alone may grow if each comes at the phases at
    which it does most. Such a pattern is as long as some halves of the period, if these are about
    a whole number of matrices, which may be over a hundred.
    """
    n = A.shape[-1]
    scale = np.linalg.norm(A, axis=(-2, -1)).max() or 1.0
    A = A / scale
    ends = np.unique(_walks(A, norms)[:, -LONGEST_RETURN:], axis=0)
    products = np.broadcast_to(np.eye(n), (len(ends), n, n))
    closed = []
    parts = []
    for length in range(1, 1 + LONGEST_RETURN):
        products = products @ A[ends[:, -length]]
        closing = np.flatnonzero(follows[ends[:, -1], ends[:, -length]])
        closed += [(i, length) for i in closing.tolist()]
        parts.append(products[closing])
    lengths = np.array([length for _, length in closed])
    rates = {}
    # Of the words of walks 40 count: most are the same one several times.
    for place, rate in zip(*_fastest(np.concatenate(parts), lengths, 40), strict=True):
        i, length = closed[place]
        rates[_least(tuple(ends[i, -length:].tolist()))] = scale * rate
    return rates


def _walks(A: np.ndarray, norms: Norms) -> np.ndarray:
    """The symbols `(WALKS, WALKED)` of walks from random states, each the one after which the state
    is largest in the norm of the node that it leads to."""
    graph = norms.graph
    state = np.random.default_rng(0).normal(size=(WALKS, A.shape[-1]))
    leads_to = np.full((graph.nodes, len(A)), -1)
    leads_to[graph.source, graph.symbol] = graph.target
    walker = np.arange(WALKS)
    node = walker % graph.nodes
    walks = np.empty((WALKS, WALKED), int)
    for step in range(WALKED):
        moved = np.einsum("sij,wj->wsi", A, state)
        target = leads_to[node]
        size = np.einsum("wsi,wsij,wsj->ws", moved, norms.P[target], moved)
        symbol = np.where(target < 0, -1.0, size).argmax(1)
        walks[:, step] = symbol
        state = moved[walker, symbol]
        node = target[walker, symbol]
        state /= np.maximum(np.linalg.norm(state, axis=-1, keepdims=True), NEXT_TO_ZERO)
    return walks


def _fastest(
    products: np.ndarray, lengths: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of the words that grow fastest per matrix, the fastest first, and their
    growth, by their products and lengths. count: of them.

    Eigenvalues are computed of those alone whose bounds exceed the growth of as many others.
    """
    bounds = _bounds(products, lengths)
    order = np.argsort(-bounds)
    rates = np.zeros(0)
    for first in range(0, len(order), EIGENVALUES_AT_ONCE):
        some = order[first : first + EIGENVALUES_AT_ONCE]
        if rates.size >= count and bounds[some[0]] < np.sort(rates)[-count]:
            break
        radii = np.abs(np.linalg.eigvals(products[some])).max(-1)
        rates = np.append(rates, radii ** (1 / lengths[some]))
    best = np.argsort(-rates, kind="stable")[:count]
    return order[best], rates[best]


def _bounds(products: np.ndarray, lengths: np.ndarray | int) -> np.ndarray:
    """Bounds on the growth per matrix of words, `(...)`, by their products and lengths: with powers,
    `|P^k|^(1/k)` is one on the spectral radius of P."""
    power = products
    log = np.zeros(products.shape[:-2])
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows has no bound
        for squaring in range(1 + SQUARINGS):
            size = np.maximum(np.linalg.norm(power, axis=(-2, -1)), NEXT_TO_ZERO)
            log += np.log(size) / 2**squaring
            if squaring < SQUARINGS:
                power = power / size[..., None, None]
                power = power @ power
        return np.nan_to_num(np.exp(log / lengths), nan=np.inf)


def improved(A: np.ndarray, follows: np.ndarray, word: Word) -> Word:
    """Return a word that grows at least as fast per matrix, by changing, adding or removing one
    matrix at a time.

    If many matrices are nearly alike, this finds words that `growing` drops. A: `(symbols, n, n)`.
    """
    rate = _rate(A, word)
    in_any_order = follows.all()
    while len(word) < 64:  # matrices
        words, products = _neighbours(A, word)
        allowed: Sequence[int] = range(len(words))
        if not in_any_order:
            allowed = [i for i in allowed if _allowed(follows, words[i])]
        lengths = np.array([len(words[i]) for i in allowed])
        best, changed_rates = _fastest(products[list(allowed)], lengths, 1)
        if not best.size or changed_rates[0] <= rate * (1 + 1e-12):
            break
        word = words[allowed[best[0]]]
        rate = changed_rates[0]
    return _least(word)


def _neighbours(A: np.ndarray, word: Word) -> tuple[list[Word], np.ndarray]:
    """The words with one matrix changed, added or removed, and their products."""
    n = A.shape[-1]
    length = len(word)
    before = [np.eye(n)]  # before[i]: of the matrices before the i-th
    after = [np.eye(n)]
    for i in range(length):
        before.append(A[word[i]] @ before[-1])
        after.append(after[-1] @ A[word[-1 - i]])
    after.reverse()  # after[i]: of the matrices from the i-th on
    words = []
    products = []
    for i in range(length):
        words += [(*word[:i], j, *word[i + 1 :]) for j in range(len(A))]
        products.append(after[i + 1] @ A @ before[i])
    for i in range(length):
        words += [(*word[:i], j, *word[i:]) for j in range(len(A))]
        products.append(after[i] @ A @ before[i])
    if length > 1:
        for i in range(length):
            words.append(word[:i] + word[i + 1 :])
            products.append((after[i + 1] @ before[i])[None])
    return words, np.concatenate(products)


def _allowed(follows: np.ndarray, word: Word) -> bool:
    after = (*word[1:], word[0])
    return all(follows[symbol, successor] for symbol, successor in zip(word, after, strict=True))


def _least(word: Word) -> Word:
    """The representative of all words with the same cycle: rotations and repetitions of a word
    have the same one."""
    for length in range(1, len(word) + 1):
        repetitions, remainder = divmod(len(word), length)
        if not remainder and word == word[:length] * repetitions:
            break
    return min(word[i:length] + word[:i] for i in range(length))


def short_words(follows: np.ndarray) -> list[Word]:
    """Return all words of few matrices, each cycle once: of up to ALL_WORDS_LENGTH matrices, or
    fewer if they are more than MOST_RANKING_WORDS."""
    one_way: list[Word] = [(i,) for i in range(len(follows))]
    words: dict[Word, None] = {}
    for _ in range(ALL_WORDS_LENGTH):
        closed = {_least(word) for word in one_way if follows[word[-1], word[0]]}
        if words and len(words) + len(closed) > MOST_RANKING_WORDS:
            break
        words |= dict.fromkeys(sorted(closed, key=lambda word: (len(word), word)))
        longer: list[Word] = []
        for word in one_way:
            longer += [(*word, i) for i in np.flatnonzero(follows[word[-1]]).tolist()]
        one_way = longer
        if len(one_way) > MOST_RANKING_WORDS * ALL_WORDS_LENGTH:
            break
    return list(words)


def shortest_through(follows: np.ndarray) -> list[Word]:
    """Return for each matrix a shortest word in which it occurs, with matrices next to it where
    there is a choice.

    So there is a word with as many losses in a row as there may be: that of the last one.
    """
    before = [np.flatnonzero(column) for column in follows.T]
    words: dict[Word, None] = {}
    for end in range(len(follows)):
        steps = np.full(len(follows), -1)  # from each matrix to this one
        layer = np.array([end])
        count = 0
        while layer.size and steps[end] < 0:
            count += 1
            layer = np.unique(np.concatenate([before[i] for i in layer]))
            layer = layer[steps[layer] < 0]
            steps[layer] = count
        word = [end]
        for steps_left in range(count - 1, 0, -1):
            choices = np.flatnonzero(follows[word[-1]] & (steps == steps_left))
            word.append(int(choices[np.abs(choices - end).argmin()]))
        if steps[end] > 0:
            words[_least(tuple(word))] = None
    return list(words)


def joined(follows: np.ndarray) -> tuple[Word, ...]:
    """Return words in which every allowed sequence can be written, no more than there are matrices.

    What only leads on is joined with what may follow: a frame whose result is lost with the next
    ones, up to one whose result is not. So all results lost in a row need no norms between them.
    """
    words = [(symbol,) for symbol in range(len(follows))]
    while True:
        after = following(words, follows)
        for may in np.unique(after, axis=0):
            leads_on = (after == may).all(1)
            longer = [
                words[first] + words[second]
                for first, second in np.argwhere(leads_on[:, None] & may)
            ]
            joined_words = [
                word for word, gone in zip(words, leads_on, strict=True) if not gone
            ] + longer
            reached = np.any(following(joined_words, follows), 0)
            joined_words = [
                word for word, is_reached in zip(joined_words, reached, strict=True) if is_reached
            ]
            if not may[leads_on].any() and len(joined_words) <= len(words):
                words = joined_words
                break
        else:
            return tuple(words)


def following(words: Sequence[Word], follows: np.ndarray) -> np.ndarray:
    """Return which words (columns) may follow which (rows)."""
    return follows[np.ix_([word[-1] for word in words], [word[0] for word in words])]


def written(word: Word, words: Sequence[Word]) -> Word:
    """Return a word that is repeated as the numbers of those of `joined` that it consists of; ()
    if it does not."""
    for begin in range(len(word)):
        remaining = word[begin:] + word[:begin]
        parts = []
        while remaining:
            numbers = [
                index
                for index, candidate in enumerate(words)
                if remaining[: len(candidate)] == candidate
            ]
            if not numbers:
                break
            parts.append(numbers[0])
            remaining = remaining[len(words[numbers[0]]) :]
        else:
            return tuple(parts)
    return ()


def growing_of(A: np.ndarray, words: Sequence[Word]) -> list[Word]:
    """Return those of some words whose products have a spectral radius of 1 or more, fastest
    growth per matrix first."""
    (rates,) = rates_of(A[None], words, 1.0)
    grow = np.flatnonzero(rates >= 1)
    return [words[i] for i in grow[np.argsort(-rates[grow], kind="stable")]]


def rates_of(A: np.ndarray, words: Sequence[Word], least: float = 0.0) -> np.ndarray:
    """Return the growth per matrix of words, `(numbers, words)`, inf of matrices that are not
    finite.

    A: at some numbers, `(numbers, symbols, n, n)`. least: of words that are known to grow less, it
    is a bound.
    """
    rates = np.zeros((len(A), len(words)))
    lengths = np.array([len(word) for word in words], int)
    for length in set(lengths.tolist()):
        some = np.flatnonzero(lengths == length)
        symbols = np.array([words[i] for i in some.tolist()]).T
        products = A[:, symbols[0]]
        for later in symbols[1:]:
            products = A[:, later] @ products
        finite = np.isfinite(products).all((-1, -2))
        bounds = np.full(finite.shape, np.inf)
        if least:
            bounds = np.where(finite, _bounds(products, length), np.inf)
        open_ = finite & (bounds >= least)
        bounds[open_] = np.abs(np.linalg.eigvals(products[open_])).max(-1) ** (1 / length)
        rates[:, some] = bounds
    return rates


def places_between(start: float, limit: float) -> Iterator[tuple[float, float]]:
    """Yield numbers on the way from a start to a limit, each with the one before it, up to the first
    one that is not before the limit.

    They are powers of the root of 2, and so the same for all starts and limits; those of a range
    with 0 in it are as small as a thousandth of its larger end.
    """
    up = 1 if limit > start else -1
    least = NEAR_ZERO * max(abs(start), abs(limit))
    lowest = math.floor(2 * math.log2(least))
    highest = math.ceil(2 * math.log2(least / NEAR_ZERO))
    powers = [2 ** (k / 2) for k in range(lowest, highest + 1)]
    numbers = sorted({0.0, *powers, *(-power for power in powers)}, key=lambda x: x * up)
    for before, x in pairwise(numbers):
        if (x - start) * up > 0:
            yield before, x
        if (x - limit) * up >= 0:
            break


def nearest(family: Family, word: Word, start: float, x: float) -> float:
    """Return the refuted number closest to the start at which a word grows, one that is refuted
    at x."""
    inside = start
    # Numbers on the way to a refuted one at which its word may grow already.
    on_the_way = start + (x - start) * np.linspace(0, 1, 33)[1:]
    for outside in on_the_way:
        if growth(family.at(outside), word) >= 1:
            nearer = begins(family, word, inside, outside)
            return x if nearer is None else nearer
        inside = outside
    return x


def begins(family: Family, word: Word, stable: float, unstable: float) -> float | None:
    """Return the number closest to one at which a word decays, of those up to one at which it
    grows, at which it is proved to grow; None if it is at none."""
    low = stable
    high = unstable
    for _ in range(40):
        middle = (low + high) / 2
        if growth(family.at(middle), word) >= 1:
            high = middle
        else:
            low = middle
    away = np.sign(unstable - high) * max(abs(high), 1e-6 * abs(unstable - high))
    # Of a number where a word begins to grow, how far beyond it that is proved.
    for step in (1e-10, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3):
        number = high + step * away
        if abs(number - high) <= abs(unstable - high) and is_refuted(family, word, number):
            return float(number)
    return float(unstable) if is_refuted(family, word, unstable) else None
