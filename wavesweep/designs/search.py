"""A search for the front of one or two objectives under constraints, in batches of a whole
generation.

Q. Zhang, H. Li, MOEA/D: A multiobjective evolutionary algorithm based on decomposition, IEEE Trans.
Evolutionary Computation 11, 2007, with the differential evolution of H. Li, Q. Zhang, IEEE Trans.
Evolutionary Computation 13, 2009: every place of the population minimises its own weighted largest
objective, and takes over good designs that are found for its neighbours. Places that share designs
follow a front across kinds of design that a search by rank and crowding (NSGA-II) loses. A feasible
design beats an infeasible one, and of two infeasible ones the one that violates less wins (K. Deb,
Computer Methods in Applied Mechanics and Engineering 186, 2000). The result is determined by the
seed and the values of the designs.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod

import numpy as np

from wavesweep.engine.rows import Rows
from wavesweep.program.spec import Axis

GENERATIONS_APART = 0.45  # of the generations, each kind of design by itself
LOOKS = (GENERATIONS_APART, 0.7, 0.85)  # of the generations, after which the best are examined
BAD = 1e9  # more than any objective is, measured across the front


@dataclass(frozen=True, slots=True, eq=False)
class Judged(Rows):
    """Designs with their objectives and violations.

    genes: in [0, 1], `(designs, genes)`. objectives: to be made small, `(designs, objectives)`.
    violation: `(designs,)`, 0 if every constraint holds.
    """

    genes: np.ndarray
    objectives: np.ndarray
    violation: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Places of a population, in blocks of one kind of design.

    weights: `(places, 2)`, of the objectives whose largest weighted value each place minimises;
    near: `(places, neighbours)`; block: places of a kind; chosen, fixed: genes that make a kind,
    and their values.
    """

    weights: np.ndarray
    near: np.ndarray
    block: int
    chosen: np.ndarray
    fixed: np.ndarray

    @staticmethod
    def of(kinds, block, chosen) -> "_Places":
        """Return places for each of the kinds, `(kinds, chosen genes)`."""
        shares = np.tile((np.arange(block) + 0.5) / block, len(kinds))
        kind = np.repeat(np.arange(len(kinds)), block)
        weights = np.stack([shares, 1 - shares], 1)
        away = np.abs(shares[:, None] - shares) + (kind[:, None] != kind)
        neighbours = min(20, max(block // 2, 2), block)  # with itself, and at most half of its kind
        near = np.argsort(away, axis=1, kind="stable")[:, :neighbours]
        return _Places(weights, near, block, chosen, kinds[kind])

    def partners(self, local, rng):
        """Return another place for every place: a neighbour if `local` says so, otherwise any
        place of its kind."""
        every = np.arange(len(self.near))
        begin = every // self.block * self.block
        of_kind = begin + rng.integers(self.block, size=every.size)
        neighbour = self.near[every, rng.integers(self.near.shape[1], size=every.size)]
        return np.where(local, neighbour, of_kind)


@dataclass(frozen=True, slots=True)
class Evolution:
    """The settings of a search: designs of a generation, generations, and the seed of the random
    numbers."""

    population: int
    generations: int
    seed: int


def _latin_hypercube(designs: int, genes: int, rng: np.random.Generator) -> np.ndarray:
    """Random designs `(designs, genes)`: each of equal parts of the range of a gene has one."""
    parts = rng.permuted(np.tile(np.arange(designs), (genes, 1)), axis=1).T
    return (parts + rng.random((designs, genes))) / designs


def generations(
    judge: Callable[[int, np.ndarray], Judged],
    evolution: Evolution,
    choices: Sequence[int],
    first: np.ndarray,
    look: Callable[[Judged], bool] | None = None,
) -> Iterator[Judged]:
    """Yield the best designs of all after each generation; no other design dominates them.

    judge(number, x): returns the designs x `(designs, genes)` of that generation, judged. choices:
    for every gene the number of its values if these are few, or 0. Every combination of
    them is a kind of design, which has a share of the population to itself at first: a kind that is
    good only if it is finely tuned would be lost among others. first: designs of the first
    generation besides random ones, `(designs, genes)`. look(best): called at some
    generations, with the designs that would be yielded last; it returns True if designs are judged
    differently from then on. Then one generation judges the population again, and the best designs
    are taken from that generation.
    """
    population = evolution.population
    count = evolution.generations
    rng = np.random.default_rng(evolution.seed)
    together = _Places.of(np.zeros((1, 0)), population, np.zeros(0, int))
    places = together
    apart = 0
    kinds = prod(max(1, few) for few in choices)
    # With fewer places of a kind a population is not divided by kinds.
    if 1 < kinds <= population // 6:
        apart = round(GENERATIONS_APART * count)
        chosen = np.flatnonzero(choices)
        values = [(np.arange(choices[gene]) + 0.5) / choices[gene] for gene in chosen]
        places = _Places.of(np.array(list(product(*values))), population // kinds, chosen)
    beginning = _latin_hypercube(population, len(choices), rng)[: len(places.near)]
    beginning[:, places.chosen] = places.fixed
    beginning[: len(first)] = first[: len(beginning)]
    alive = judge(0, beginning)
    best = alive.take(undominated(alive))
    yield best
    looks = [round(share * count) for share in LOOKS]
    for number in range(1, count):
        if number == apart:
            places = together
            pool = Judged.join([best, alive])
            worth = _worth(best)(pool, places.weights[:, None])
            alive = pool.take(np.argmin(worth, axis=1))
        if look and number in looks and look(best):
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
    """Return a child for every place, and which of them are offered to the neighbours of their
    places alone."""
    count, genes = parents.shape
    every = np.arange(count)
    # Of the children, by differences of neighbours alone, and given to these alone.
    local = rng.random(count) < 0.8
    first = places.partners(local, rng)
    second = places.partners(local, rng)
    third = places.partners(local, rng)
    base = np.where(rng.random(count) < 0.5, every, third)
    difference = parents[first] - parents[second]
    # Least and largest share of a difference.
    moved = parents[base] + rng.uniform(0.2, 1.0, (count, 1)) * difference
    # Of the genes that a child takes from a difference: 30 % or all.
    crossed = rng.random(parents.shape) < rng.choice((0.3, 1.0), (count, 1))
    crossed[every, rng.integers(genes, size=count)] = True
    x = np.where(crossed, moved, parents)
    mutated = rng.random(x.shape) < 0.5 / genes  # half a gene of a child, on average
    # Decimal logarithms of the least and the largest size of a mutation.
    x = x + mutated * rng.normal(size=x.shape) * 10.0 ** rng.uniform(-3.0, -0.5, (count, 1))
    reflected = 1 - np.abs(1 - np.abs(x))
    x = np.clip(reflected, 0.0, 1.0)
    # Drawn uniformly anew: what the others have all left behind can be found again.
    fresh = rng.random(count) < 0.06
    x = np.where(fresh[:, None], rng.random(x.shape), x)
    x[:, places.chosen] = places.fixed
    return x, local & ~fresh


def _settled(alive, children, best, places, local, rng):
    """Return the designs in every place after the children have been offered.

    alive, children: a design of each place. best: the least objectives that are known. local: which
    children are of neighbours. Such a child is offered to the neighbours of its own place. Any other
    child is offered to the neighbours of the place of its kind that it improves most.
    """
    worth = _worth(best)
    now = worth(alive, places.weights)  # `(places,)`
    new = worth(children, places.weights[:, None])  # `(places, children)`
    genes = alive.genes.copy()
    objectives = alive.objectives.copy()
    violation = alive.violation.copy()
    for child in rng.permutation(len(local)):
        home = child
        if not local[child]:
            begin = child // places.block * places.block
            kind = slice(begin, begin + places.block)
            home = begin + int(np.argmin(new[kind, child] - now[kind]))
        neighbours = rng.permutation(places.near[home])
        improved = neighbours[new[neighbours, child] < now[neighbours]]
        # Places that take over a child at most, so that one design does not fill all.
        taking = improved[:2]
        genes[taking] = children.genes[child]
        objectives[taking] = children.objectives[child]
        violation[taking] = children.violation[child]
        now[taking] = new[taking, child]
    return Judged(genes, objectives, violation)


def _worth(best):
    """Return a function of designs and weights that gives their largest weighted objective, as a
    share of the known front.

    For designs that violate constraints it gives a number that grows with the violation and is
    larger than all others.
    """
    complete = (best.violation == 0) & np.isfinite(best.objectives).all(1)
    front = best.objectives[complete]
    if not len(front):
        front = np.zeros((1, best.objectives.shape[1]))
    least = front.min(0)
    across = np.ptp(front, axis=0)
    across = np.where(across > 0, across, 1.0)

    def worth(designs, weights):
        objectives = designs.objectives
        with np.errstate(invalid="ignore"):
            share = np.where(np.isfinite(objectives), (objectives - least) / across, BAD)
        weighted = weights[..., : share.shape[-1]] * share
        value = np.minimum(weighted.max(-1), BAD)
        return np.where(designs.violation > 0, 2 * BAD + designs.violation, value)

    return worth


def spread(designs: Judged, count: int) -> Judged:
    """Return `count` of the designs, far from each other: those whose neighbours are nearest are
    left out one by one."""
    across = np.ptp(designs.objectives, axis=0)
    scale = np.where(across > 0, across, 1.0)
    order = np.lexsort(designs.objectives.T[::-1])
    place = designs.objectives[order] / scale
    while len(order) > count:
        step = np.concatenate([[np.inf], np.abs(np.diff(place, axis=0)).sum(-1), [np.inf]])
        crowded = int(np.argmin(step[1:] + step[:-1]))
        order = np.delete(order, crowded)
        place = np.delete(place, crowded, axis=0)
    return designs.take(order)


_rounded = np.vectorize(lambda value: float(f"{value:.9g}"), otypes=[float])


def undominated(designs: Judged) -> np.ndarray:
    """Return the indices of the designs that no other dominates; of equal feasible designs only the
    first is kept.

    A feasible design dominates every infeasible one, and of two infeasible ones that which violates
    less dominates. Objectives are compared to the nine digits that they are good to: what differs
    by less is no reason to keep a design.
    """
    violation = designs.violation
    f = _rounded(designs.objectives)
    # Entry (i, j): whether design i is so beside design j.
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
            count = len(axis.values)
            index = np.minimum((gene * count).astype(int), count - 1)
            columns[axis.path] = np.asarray(axis.values)[index]
        elif axis.scale == "log":
            low = np.log(axis.start)
            value = np.exp(low + gene * (np.log(axis.stop) - low))
            columns[axis.path] = np.clip(value, axis.start, axis.stop)
        else:
            columns[axis.path] = np.clip(
                axis.start + gene * (axis.stop - axis.start), axis.start, axis.stop
            )
    return columns


def genes_of(vary: Sequence[Axis], values: Mapping[str, object]) -> np.ndarray:
    """Return the genes of one design, `(axes,)`; a value beyond its range is moved to the end of
    the range."""
    genes = []
    for axis in vary:
        value = values[axis.path]
        if axis.values:
            index = int(np.argmin(np.abs(np.asarray(axis.values, float) - value)))
            genes.append((index + 0.5) / len(axis.values))
        elif axis.scale == "log":
            low = np.log(axis.start)
            high = np.log(axis.stop)
            genes.append((np.log(max(value, axis.start)) - low) / (high - low))
        else:
            genes.append((value - axis.start) / (axis.stop - axis.start))
    return np.clip(genes, 0.0, 1.0)


def differing(
    vary: Sequence[Axis],
    genes: np.ndarray,
    known_genes: np.ndarray,
    apart: float,
    most_designs: int,
) -> np.ndarray:
    """Return the indices of the first designs that differ from those found, and from each other.

    They differ if a number is another choice, or another by a share `apart` of its range. genes:
    `(designs, axes)`, the best first; known_genes: the same of others. most_designs: of them.
    """
    few = np.array([len(axis.values or ()) for axis in vary])

    def places(genes):
        """Numbers of choices, and genes of numbers with a range."""
        return np.where(few > 0, np.minimum(np.floor(genes * few), few - 1), genes)

    before = [*places(known_genes)]
    chosen = []
    for index, candidate in enumerate(places(genes)):
        if len(chosen) == most_designs:
            break
        away = np.abs(candidate - np.reshape(before, (-1, len(vary))))
        if (away >= apart).any(-1).all():
            chosen.append(index)
            before.append(candidate)
    return np.array(chosen, dtype=int)
