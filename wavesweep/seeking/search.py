"""A genetic search for the front of one or two objectives under constraints, in batches of a whole generation.

K. Deb, A. Pratap, S. Agarwal, T. Meyarivan, A fast and elitist multiobjective genetic algorithm: NSGA-II, IEEE Trans.
Evolutionary Computation 6, 2002, with its rule for constraints: a feasible design beats an infeasible one, and of two
infeasible ones the one that violates less wins. Most children are those of differential evolution (R. Storn, K. Price, J.
Global Optimization 11, 1997; for fronts S. Kukkonen, J. Lampinen, Proc. CEC 2005): they follow valleys that lie across the
genes, where crossovers and mutations gene by gene are slow. Everything follows from the seed and the values of the designs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

CROSSOVER, MUTATION = 15.0, 20.0  # distribution indices: larger ones stay nearer to the parents
DIFFERENCES = 0.7  # of a generation, children by differential evolution
SHARES = (0.3, 0.9)  # of the genes that such a child takes from the difference
MUTANTS = 0.1  # of a generation, drawn uniformly anew: what the others have all left behind can be found again


@dataclass(frozen=True, slots=True, eq=False)
class Judged:
    """Designs as genes in [0, 1], `(designs, genes)`; objectives to be made small, `(designs, objectives)`; and violation,
    `(designs,)`, 0 if every constraint holds."""

    genes: np.ndarray
    objectives: np.ndarray
    violation: np.ndarray

    def take(self, index) -> "Judged":
        """Some of the designs."""
        return Judged(self.genes[index], self.objectives[index], self.violation[index])

    def joined(self, other: "Judged") -> "Judged":
        """These designs and others."""
        pairs = ((self.genes, other.genes), (self.objectives, other.objectives), (self.violation, other.violation))
        return Judged(*(np.concatenate(pair) for pair in pairs))


def generations(
    judge: Callable[[int, np.ndarray], Judged], genes: int, population: int, count: int, seed: int, first: np.ndarray
):
    """Yield the surviving designs after each generation.

    judge(number, x): the designs x `(designs, genes)` of that generation, judged. first: designs of the first generation
    besides random ones, `(designs, genes)`.
    """
    rng = np.random.default_rng(seed)
    spread = (rng.permuted(np.tile(np.arange(population), (genes, 1)), axis=1).T + rng.random((population, genes))) / population
    spread[: len(first)] = first[:population]
    alive = judge(0, spread)
    yield alive
    for number in range(1, count):
        children = judge(number, _children(alive, population, rng))
        alive = survivors(alive.joined(children), population)
        yield alive


def _children(parents, count, rng):
    rank, crowding = ranked(parents)
    order = np.lexsort((-crowding, rank))
    place = np.empty(len(order), int)
    place[order] = np.arange(len(order))
    rivals = rng.integers(len(order), size=(2, count, 2))
    chosen = np.where(place[rivals[0]] < place[rivals[1]], rivals[0], rivals[1])
    one, other = parents.genes[chosen[:, 0]], parents.genes[chosen[:, 1]]
    different, alike = _by_differences(parents.genes, one, other, rng), _by_crossing(one, other, rng)
    return np.where((rng.random(count) < DIFFERENCES)[:, None], different, alike)


def _by_differences(genes, base, target, rng):
    """The base with some genes moved by the difference of two other designs, the others those of the target."""
    first, second = genes[rng.integers(len(genes), size=(2, len(base)))]
    moved = base + rng.uniform(0.2, 1.0, (len(base), 1)) * (first - second)
    taken = rng.random(base.shape) < rng.choice(SHARES, (len(base), 1))
    taken[np.arange(len(base)), rng.integers(base.shape[1], size=len(base))] = True
    folded = np.abs(np.where(taken, moved, target))
    return np.clip(1 - np.abs(1 - folded), 0.0, 1.0)


def _by_crossing(one, other, rng):
    """Genes between and about those of two parents, and some designs that are new; Deb's crossover and mutation."""
    count = len(one)
    u = rng.random(one.shape)
    beta = np.where(u < 0.5, (2 * u) ** (1 / (CROSSOVER + 1)), (2 * (1 - u)) ** (-1 / (CROSSOVER + 1)))
    crossed = np.where(rng.random(one.shape) < 0.5, 0.5 * ((1 + beta) * one + (1 - beta) * other), one)
    u = rng.random(one.shape)
    step = np.where(u < 0.5, (2 * u) ** (1 / (MUTATION + 1)) - 1, 1 - (2 * (1 - u)) ** (1 / (MUTATION + 1)))
    # Most mutations are small, and some of them reach far.
    step *= 10.0 ** rng.uniform(-3, 0.5, (len(one), 1))
    mutate = rng.random(one.shape) < 1 / one.shape[1]
    mutate[np.arange(len(one)), rng.integers(one.shape[1], size=len(one))] = True
    children = np.clip(crossed + mutate * step, 0.0, 1.0)
    fresh = rng.random(count) < MUTANTS
    return np.where(fresh[:, None], rng.random(children.shape), children)


def survivors(designs: Judged, count: int) -> Judged:
    """The best designs: by rank, the last of them by how far they are from their neighbours."""
    rank, crowding = ranked(designs)
    return designs.take(np.lexsort((-crowding, rank))[:count])


def ranked(designs: Judged) -> tuple[np.ndarray, np.ndarray]:
    """Rank of each design, 0 for those that no other dominates, and its distance from its neighbours in the same rank."""
    size = len(designs.violation)
    rank, left, level = np.zeros(size, int), np.arange(size), 0
    while left.size:
        best = left[undominated(designs.take(left))]
        rank[best] = level
        left, level = np.setdiff1d(left, best, assume_unique=True), level + 1
    crowding = np.zeros(size)
    for level in range(rank.max(initial=-1) + 1):
        members = np.flatnonzero(rank == level)
        for values in designs.objectives[members].T:
            order = np.argsort(values, kind="stable")
            across = values[order]
            gaps = np.full(members.size, np.inf)
            if np.isfinite(across).all() and (width := across[-1] - across[0]) > 0:
                gaps[1:-1] = (across[2:] - across[:-2]) / width
            crowding[members[order]] += gaps
    return rank, crowding


def undominated(designs: Judged) -> np.ndarray:
    """Indices of the designs that no other dominates; of equal designs the first."""
    violation, f = designs.violation, designs.objectives
    better = (f[:, None] <= f[None]).all(-1) & (f[:, None] < f[None]).any(-1)
    earlier = (f[:, None] == f[None]).all(-1) & np.triu(np.ones((len(f), len(f)), bool), 1)
    feasible = violation == 0
    both = feasible[:, None] & feasible[None]
    beats = np.where(both, better | earlier, violation[:, None] < violation[None])
    return np.flatnonzero(~beats.any(axis=0))


def hypervolume(objectives: np.ndarray, reference: np.ndarray) -> float:
    """Area that two objectives, to be made small, dominate up to a reference point."""
    kept = objectives[(objectives < reference).all(axis=1)]
    if not len(kept):
        return 0.0
    order = kept[np.argsort(kept[:, 0], kind="stable")]
    lowest = np.minimum.accumulate(order[:, 1])
    ends = np.append(order[1:, 0], reference[0])
    return float(((ends - order[:, 0]) * (reference[1] - lowest)).sum())
