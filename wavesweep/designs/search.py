"""A search for the front of one or two objectives under constraints, in batches of a whole generation.

Q. Zhang, H. Li, MOEA/D: A multiobjective evolutionary algorithm based on decomposition, IEEE Trans. Evolutionary Computation
11, 2007, with the differential evolution of H. Li, Q. Zhang, IEEE Trans. Evolutionary Computation 13, 2009: every place of the
population minimises its own weighted largest objective, and takes over good designs that are found for its neighbours. Places
that share designs follow a front across kinds of design that a search by rank and crowding (NSGA-II) loses. A feasible design
beats an infeasible one, and of two infeasible ones the one that violates less wins (K. Deb, Computer Methods in Applied
Mechanics and Engineering 186, 2000). The result is determined by the seed and the values of the designs.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from wavesweep.engine.rows import Rows
from wavesweep.program.spec import Axis

NEIGHBOURS = 20  # of a place, itself included, and at most half of its kind
LEAST = 6  # places of a kind; with fewer a population is not divided by kinds
APART = 0.45  # of the generations, each kind of design by itself
LOOKS = (APART, 0.7, 0.85)  # of the generations, after which the best are examined
LOCAL = 0.8  # of the children, by differences of neighbours alone, and given to these alone
SHARES = (0.3, 1.0)  # of the genes that a child takes from a difference
FACTORS = (0.2, 1.0)  # least and largest share of a difference
MUTATED = 0.5  # genes of a child, on average
REACH = (-3.0, -0.5)  # decimal logarithms of the least and the largest size of a mutation
FRESH = 0.06  # of a generation, drawn uniformly anew: what the others have all left behind can be found again
TAKEN = 2  # places that take over a child at most, so that one design does not fill all
BAD = 1e9  # more than any objective is, measured across the front


@dataclass(frozen=True, slots=True, eq=False)
class Judged(Rows):
    """Designs with their objectives and violations.

    genes: in [0, 1], `(designs, genes)`. objectives: to be made small, `(designs, objectives)`. violation: `(designs,)`, 0 if
    every constraint holds.
    """

    genes: np.ndarray
    objectives: np.ndarray
    violation: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Places of a population, in blocks of one kind of design.

    weights: `(places, 2)`, of the objectives whose largest weighted value each place minimises; near: `(places, neighbours)`;
    block: places of a kind; chosen, fixed: genes that make a kind, and their values.
    """

    weights: np.ndarray
    near: np.ndarray
    block: int
    chosen: np.ndarray
    fixed: np.ndarray

    @staticmethod
    def of(kinds, block, chosen) -> "_Places":
        """Return places for each of the kinds, `(kinds, chosen genes)`."""
        along, kind = np.tile((np.arange(block) + 0.5) / block, len(kinds)), np.repeat(np.arange(len(kinds)), block)
        away = np.abs(along[:, None] - along) + (kind[:, None] != kind)
        near = np.argsort(away, axis=1, kind="stable")[:, : min(NEIGHBOURS, max(block // 2, 2), block)]
        return _Places(np.stack([along, 1 - along], 1), near, block, chosen, kinds[kind])

    def partners(self, local, rng):
        """Return another place for every place: a neighbour if `local` says so, otherwise any place of its kind."""
        every = np.arange(len(self.near))
        any_ = every // self.block * self.block + rng.integers(self.block, size=every.size)
        return np.where(local, self.near[every, rng.integers(self.near.shape[1], size=every.size)], any_)


def generations(
    judge: Callable[[int, np.ndarray], Judged],
    genes: int,
    population: int,
    count: int,
    seed: int,
    first: np.ndarray,
    choices: Sequence[int] = (),
    look: Callable[[Judged], bool] | None = None,
) -> Iterator[Judged]:
    """Yield the best designs of all after each generation; no other design dominates them.

    judge(number, x): returns the designs x `(designs, genes)` of that generation, judged. genes: number of genes. population:
    designs of a generation. count: number of generations. seed: of the random numbers. first: designs of the first generation
    besides random ones, `(designs, genes)`. choices: for every gene the number of its values if these are few, or 0. Every
    combination of them is a kind of design, which has a share of the population to itself at first: a kind that is good only if
    it is finely tuned would be lost among others. look(best): called at some generations, with the designs that would be
    yielded last; it returns True if designs are judged differently from then on. Then one generation judges the population
    again, and the best designs are taken from that generation.
    """
    rng = np.random.default_rng(seed)
    places = together = _Places.of(np.zeros((1, 0)), population, np.zeros(0, int))
    kinds, apart = prod(max(1, few) for few in choices), 0
    if 1 < kinds <= population // LEAST:
        chosen, apart = np.flatnonzero(choices), round(APART * count)
        values = [(np.arange(choices[gene]) + 0.5) / choices[gene] for gene in chosen]
        places = _Places.of(np.array(list(product(*values))), population // kinds, chosen)
    spread = rng.permuted(np.tile(np.arange(population), (genes, 1)), axis=1).T
    spread = ((spread + rng.random((population, genes))) / population)[: len(places.near)]
    spread[:, places.chosen] = places.fixed
    spread[: len(first)] = first[: len(spread)]
    alive = judge(0, spread)
    best = alive.take(undominated(alive))
    yield best
    for number in range(1, count):
        if number == apart:
            pool, places = Judged.join([best, alive]), together
            alive = pool.take(np.argmin(_worth(best)(pool, places.weights[:, None]), axis=1))
        if look and number in [round(share * count) for share in LOOKS] and look(best):
            alive = judge(number, alive.genes)
            best = alive.take(undominated(alive))
            yield best
            continue
        x, local = _children(alive.genes, places, rng)
        children = judge(number, x)
        best = Judged.join([best, children])
        best = best.take(undominated(best))
        alive = _settled(alive, children, best, places, local, rng)
        yield best


def _children(parents, places, rng):
    """Return a child for every place, and which of them are offered to the neighbours of their places alone."""
    count, genes = parents.shape
    every, local = np.arange(count), rng.random(count) < LOCAL
    first, second, third = (places.partners(local, rng) for _ in range(3))
    base = np.where(rng.random(count) < 0.5, every, third)
    moved = parents[base] + rng.uniform(*FACTORS, (count, 1)) * (parents[first] - parents[second])
    crossed = rng.random(parents.shape) < rng.choice(SHARES, (count, 1))
    crossed[every, rng.integers(genes, size=count)] = True
    x = np.where(crossed, moved, parents)
    mutated = rng.random(x.shape) < MUTATED / genes
    x = x + mutated * rng.normal(size=x.shape) * 10.0 ** rng.uniform(*REACH, (count, 1))
    x = np.clip(1 - np.abs(1 - np.abs(x)), 0.0, 1.0)
    fresh = rng.random(count) < FRESH
    x = np.where(fresh[:, None], rng.random(x.shape), x)
    x[:, places.chosen] = places.fixed
    return x, local & ~fresh


def _settled(alive, children, best, places, local, rng):
    """Return the designs in every place after the children have been offered.

    A child of neighbours is offered to the neighbours of its own place. Any other child is offered to the neighbours of the
    place of its kind that it improves most.
    """
    worth = _worth(best)
    now, new = worth(alive, places.weights), worth(children, places.weights[:, None])  # `(places,)`; `(places, children)`
    genes, objectives, violation = alive.genes.copy(), alive.objectives.copy(), alive.violation.copy()
    for child in rng.permutation(len(local)):
        kind = slice(start := child // places.block * places.block, start + places.block)
        home = child if local[child] else start + int(np.argmin(new[kind, child] - now[kind]))
        neighbours = rng.permutation(places.near[home])
        neighbours = neighbours[new[neighbours, child] < now[neighbours]][:TAKEN]
        genes[neighbours], objectives[neighbours] = children.genes[child], children.objectives[child]
        violation[neighbours], now[neighbours] = children.violation[child], new[neighbours, child]
    return Judged(genes, objectives, violation)


def _worth(best):
    """Return a function of designs and weights that gives their largest weighted objective, as a share of the known front.

    For designs that violate constraints it gives a number that grows with the violation and is larger than all others.
    """
    feasible = best.objectives[(best.violation == 0) & np.isfinite(best.objectives).all(1)]
    feasible = feasible if len(feasible) else np.zeros((1, best.objectives.shape[1]))
    least, across = feasible.min(0), np.ptp(feasible, axis=0)
    across = np.where(across > 0, across, 1.0)

    def worth(designs, weights):
        with np.errstate(invalid="ignore"):
            share = np.where(np.isfinite(designs.objectives), (designs.objectives - least) / across, BAD)
        value = np.minimum((weights[..., : share.shape[-1]] * share).max(-1), BAD)
        return np.where(designs.violation > 0, 2 * BAD + designs.violation, value)

    return worth


def spread(designs: Judged, count: int) -> Judged:
    """Return `count` of the designs, far from each other: those whose neighbours are nearest are left out one by one."""
    scale = np.where(np.ptp(designs.objectives, axis=0) > 0, np.ptp(designs.objectives, axis=0), 1.0)
    order = np.lexsort(designs.objectives.T[::-1])
    place = designs.objectives[order] / scale
    while len(order) > count:
        step = np.concatenate([[np.inf], np.abs(np.diff(place, axis=0)).sum(-1), [np.inf]])
        crowded = int(np.argmin(step[1:] + step[:-1]))
        order, place = np.delete(order, crowded), np.delete(place, crowded, axis=0)
    return designs.take(order)


_rounded = np.vectorize(lambda value: float(f"{value:.9g}"), otypes=[float])


def undominated(designs: Judged) -> np.ndarray:
    """Return the indices of the designs that no other dominates; of equal designs only the first is kept.

    Objectives are compared to the nine digits that they are good to: what differs by less is no reason to keep a design.
    """
    violation, f = designs.violation, _rounded(designs.objectives)
    better = (f[:, None] <= f[None]).all(-1) & (f[:, None] < f[None]).any(-1)
    earlier = (f[:, None] == f[None]).all(-1) & np.triu(np.ones((len(f), len(f)), bool), 1)
    feasible = violation == 0
    both = feasible[:, None] & feasible[None]
    beats = np.where(both, better | earlier, violation[:, None] < violation[None])
    return np.flatnonzero(~beats.any(axis=0))


def designs_of(vary: Sequence[Axis], genes: np.ndarray) -> dict[str, np.ndarray]:
    """Return path -> value of each design from its genes, `(designs, axes)` in [0, 1].

    Choices divide the unit interval into equal parts.
    """
    columns = {}
    for axis, gene in zip(vary, genes.T, strict=True):
        if axis.values:
            at = np.minimum((gene * len(axis.values)).astype(int), len(axis.values) - 1)
            columns[axis.path] = np.asarray(axis.values)[at]
        elif axis.scale == "log":
            value = np.exp(np.log(axis.start) + gene * (np.log(axis.stop) - np.log(axis.start)))
            columns[axis.path] = np.clip(value, axis.start, axis.stop)
        else:
            columns[axis.path] = np.clip(axis.start + gene * (axis.stop - axis.start), axis.start, axis.stop)
    return columns


def genes_of(vary: Sequence[Axis], values: Mapping[str, object]) -> np.ndarray:
    """Return the genes of one design, `(axes,)`; a value beyond its range is moved to the end of the range."""
    genes = []
    for axis in vary:
        value = values[axis.path]
        if axis.values:
            at = int(np.argmin(np.abs(np.asarray(axis.values, float) - value)))
            genes.append((at + 0.5) / len(axis.values))
        elif axis.scale == "log":
            low, high = np.log(axis.start), np.log(axis.stop)
            genes.append((np.log(max(value, axis.start)) - low) / (high - low))
        else:
            genes.append((value - axis.start) / (axis.stop - axis.start))
    return np.clip(genes, 0.0, 1.0)


def differing(vary: Sequence[Axis], genes: np.ndarray, found: np.ndarray, apart: float, most: int) -> np.ndarray:
    """Return the indices of the first designs that differ from those found, and from each other.

    They differ if a number is another choice, or another by a share `apart` of its range. genes: `(designs, axes)`, the best
    first; found: the same of others. most: of them.
    """
    few = np.array([len(axis.values or ()) for axis in vary])
    rounded = np.where(few > 0, np.minimum(np.floor(genes * few), few - 1), genes)
    seen_genes = [*np.where(few > 0, np.minimum(np.floor(found * few), few - 1), found)]
    chosen = []
    for at, candidate in enumerate(rounded):
        if len(chosen) < most and all((np.abs(candidate - chosen_before) >= apart).any() for chosen_before in seen_genes):
            chosen.append(at)
            seen_genes.append(candidate)
    return np.array(chosen, dtype=int)
