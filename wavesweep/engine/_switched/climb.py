"""Members of a box of numbers that grow most, looked for by a random climb over all numbers at
once.

A claim about a set is tried here before it is proved, and again where its proof has trouble. The
climb knows nothing of how a loop reads its numbers: it starts at many places, and moves along some
of the numbers or all of them by steps that shrink. What it finds is a place to look at; whether a
loop is unstable there is for others to say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.mean_square import operator_of
from wavesweep.engine._switched.patterns import product_of, short_words
from wavesweep.engine.loop import Loops
from wavesweep.engine.rows import distinct

SCATTERED, LEAST_SCATTERED = 256, 32  # members that are tried first, beside those that are given
BEST, OTHERS = 4, 4  # of those, from which the climb goes on: the worst, and some of the next
MOVES = 8  # of each in a step, half of them along some numbers alone
LONGER, SHORTER = 2.0, 0.7  # the next step of one that has moved, and of one that has not
OPERATIONS_OF_CLIMB = 3e8  # of a climb
OF_A_MEMBER = 2e4  # operations beside those of its matrices
EIGENVALUES = 25  # operations are so many times n^3
DRAWN = 48  # members that a proof is held against
BEYOND = 1e-6  # of 1: a growth above it contradicts a proof, and is no rounding
WORDS = 16  # patterns, the shortest ones, whose growth is climbed


@dataclass(frozen=True, slots=True, eq=False)
class Climbed:
    """Members that grow most, `(members, numbers)`, the worst first, and their growth."""

    points: np.ndarray
    growth: np.ndarray

    @property
    def unstable(self) -> np.ndarray:
        """Those that grow, or of which that is not known."""
        return self.points[~(self.growth < 1)]


@dataclass(frozen=True, slots=True)
class Growth:
    """How much members grow.

    of: from points `(points, numbers)` to the growth of each per frame, inf where it is not known.
    operations: of one member.
    """

    of: Callable[[np.ndarray], np.ndarray]
    operations: float

    @staticmethod
    def of_loops(loop: Loops, paths: list[str], radius: float = 1.0) -> Growth:
        """Return the spectral radii of loops with other numbers at these paths, over a radius.

        loop: with or without the whole ticks of dead times, which are those of each member.
        """
        unbuilt = loop.unbuilt
        drawn = loop.drawn()
        states = sum(len(scheduled.block.states) for scheduled in drawn.placed)
        operations = OF_A_MEMBER + (EIGENVALUES + drawn.ticks) * states**3

        def of(points: np.ndarray) -> np.ndarray:
            radii = np.empty(len(points))
            for alike in distinct([points[:, i] == 0 for i in range(len(paths))], len(points)):
                columns = {path: points[alike, i].copy() for i, path in enumerate(paths)}
                for some, batch in unbuilt.changed(columns).built_alike(alike):
                    radii[some] = batch.radii(some.size)
            return np.nan_to_num(radii, nan=np.inf) / radius

        return Growth(of, operations)

    @staticmethod
    def in_words(
        frames_at: Callable[[np.ndarray], np.ndarray], states: int, follows: np.ndarray
    ) -> Growth:
        """Return the growth per frame of the fastest of some short patterns of frames.

        frames_at: from points to the matrices of all symbols, `(symbols, points, n, n)`.
        """
        words = short_words(follows)[:WORDS]

        def of(points: np.ndarray) -> np.ndarray:
            A = frames_at(points)
            growth = np.zeros(len(points))
            for word in words:
                growth = np.maximum(growth, _radii(product_of(A, word)) ** (1 / len(word)))
            return growth

        return Growth(of, OF_A_MEMBER + EIGENVALUES * len(words) * states**3)

    @staticmethod
    def on_average(
        frames_at: Callable[[np.ndarray], np.ndarray], states: int, graph: Graph, weight: np.ndarray
    ) -> Growth:
        """Return the growth of second moments per frame; see `in_words`. weight: of the
        edges."""

        def of(points: np.ndarray) -> np.ndarray:
            A = frames_at(points)
            return _radii(
                np.stack([operator_of(A[:, i], graph, weight) for i in range(len(points))])
            )

        size = graph.nodes * states * (states + 1) / 2
        return Growth(of, OF_A_MEMBER + EIGENVALUES * size**3)

    def climb(
        self, box: np.ndarray, starts: np.ndarray, operations: float = OPERATIONS_OF_CLIMB
    ) -> Climbed:
        """Return the members of a box `(2, numbers)` that grow most, as far as a climb finds them.

        starts: members that are tried in any case, `(points, numbers)`. The same box has the same
        answer at any time.
        """
        rng = np.random.default_rng(0)
        wide = np.flatnonzero(box[0] < box[1])
        if not wide.size:
            return _ranked(starts, self.of(starts))
        member_count = operations / self.operations
        scattered = _scattered(box, int(np.clip(member_count / 4, LEAST_SCATTERED, SCATTERED)), rng)
        points = np.unique(np.concatenate([np.clip(starts, *box), scattered]), axis=0)
        ranked = _ranked(points, self.of(points))
        spread = np.linspace(BEST, min(len(points), 64) - 1, OTHERS).astype(int)
        chosen = np.unique(np.clip([*range(BEST), *spread], 0, len(points) - 1))
        points = ranked.points[chosen]
        values = ranked.growth[chosen]
        step = np.full((len(points), 1), 0.4)  # in halves of a range
        left = member_count - len(ranked.points)
        last = np.zeros((len(points), wide.size))
        for _ in range(80):  # steps of the climb
            if left < 0:
                break
            moves = step * rng.normal(size=(MOVES, len(points), wide.size))
            moves[::2] *= rng.random(moves[::2].shape) < 1 / wide.size
            moves[1] += LONGER * last  # on along a ridge
            places = _moved(points, moves, box, wide)
            reached = self.of(places.reshape(-1, box.shape[1])).reshape(MOVES, -1)
            best = reached.argmax(0), np.arange(len(points))
            better = reached[best] > values
            last = np.where(better[:, None], moves[best], 0.0)
            points = np.where(better[:, None], places[best], points)
            values = np.where(better, reached[best], values)
            step = step * np.where(better, LONGER, SHORTER)[:, None]
            left -= reached.size
        return _ranked(np.concatenate([points, ranked.points]), np.append(values, ranked.growth))

    def contradicts(self, box: np.ndarray) -> bool:
        """Return whether a member of a box grows, all of which is proved not to: some are drawn,
        others each time."""
        shares = np.random.default_rng().random((DRAWN, box.shape[1]))
        points = box[0] + shares * (box[1] - box[0])
        return bool((self.of(points) > 1 + BEYOND).any())


def _ranked(points: np.ndarray, growth: np.ndarray) -> Climbed:
    order = np.argsort(-growth, kind="stable")
    return Climbed(points[order], growth[order])


def _scattered(box: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points that are spread evenly, and such on the edges."""
    numbers = box.shape[1]
    roots = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0])[:numbers]
    spread = 2 * np.mod(np.outer(np.arange(1, count + 1), roots), 1.0) - 1
    at_edge = spread[::4].copy()
    edges = rng.random(at_edge.shape) < 0.5
    at_edge[edges] = np.sign(at_edge[edges])
    return _numbers(box, np.concatenate([spread, at_edge]))


def corners_of(box: np.ndarray) -> np.ndarray:
    """Return the corners of a box, and its middle."""
    return np.unique([*product(*box.T), box.mean(0)], axis=0)


def on_edges_of(box: np.ndarray) -> np.ndarray:
    """Return 40 points on each edge of a box, evenly, by factors where it spans decades:
    `(points, numbers)`."""
    numbers = box.shape[1]
    shares = np.linspace(-1.0, 1.0, 42)[1:-1]
    points = []
    for number in range(numbers):
        for corner in product([-1.0, 1.0], repeat=numbers - 1):
            points.append(np.insert(np.tile(corner, (shares.size, 1)), number, shares, axis=1))
    return _numbers(box, np.concatenate(points))


def _by_factors(box: np.ndarray) -> np.ndarray:
    """Which numbers are moved by factors."""
    # Steps in ranges of more than a decade are factors.
    return (box[0] > 0) & (box[1] > 10.0 * box[0])


def _numbers(box: np.ndarray, units: np.ndarray) -> np.ndarray:
    """The numbers at places from -1 to 1 of their ranges."""
    by_factors = _by_factors(box)
    middle = box.mean(0)
    half = np.ptp(box, axis=0) / 2
    low, high = np.where(by_factors, box, 1.0)
    factors = low * (high / low) ** ((1 + units) / 2)
    return np.clip(np.where(by_factors, factors, middle + half * units), *box)


def _moved(points: np.ndarray, moves: np.ndarray, box: np.ndarray, wide: np.ndarray) -> np.ndarray:
    """Points after moves `(moves, points, numbers)` in halves of the ranges of the numbers `wide`,
    held within the box."""
    places = np.repeat(points[None], len(moves), 0)
    units = _units(box[:, wide], places[..., wide]) + moves
    places[..., wide] = _numbers(box[:, wide], np.clip(units, -1.0, 1.0))
    return places


def _units(box: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """The places from -1 to 1 of numbers in ranges that are wide."""
    by_factors = _by_factors(box)
    middle = box.mean(0)
    half = np.ptp(box, axis=0) / 2
    low, high = np.where(by_factors, box, [[1.0], [2.0]])
    shares = np.log(np.where(by_factors, numbers, 1.0) / low) / np.log(high / low)
    return np.where(by_factors, 2 * shares - 1, (numbers - middle) / half)


def _radii(matrices: np.ndarray) -> np.ndarray:
    finite = np.isfinite(matrices).all((-1, -2))
    safe = np.where(finite[:, None, None], matrices, 0.0)
    return np.where(finite, np.abs(np.linalg.eigvals(safe)).max(-1, initial=0.0), np.inf)
