"""Switched systems: families of matrices, and graphs whose edges are these matrices and whose
nodes carry norms."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np


class Family(Protocol):
    """Matrices `(symbols, n, n)`, one for each kind of frame, that depend on one number x.

    follows: `(symbols, symbols)`; `follows[i, j]` says whether matrix j may come after matrix i.
    """

    @property
    def follows(self) -> np.ndarray:
        """Which matrix may come after which."""

    def at(self, x: float) -> np.ndarray:
        """Return the matrices at x in plain doubles, for searches, `(symbols, n, n)`."""

    def enclosed(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the matrices at x minus the identity, and bounds on the errors of their
        entries."""

    def hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Return matrices minus the identity, `(points, symbols, n, n)`, and bounds on the errors
        of their entries.

        Up to these bounds, the matrices of every number from low to high are those of a Bezier
        curve at some place of it, the same for all symbols, whose control points these are. None if
        they cannot be given, as near a pole.
        """


@dataclass(frozen=True, eq=False)
class Graph:
    """Edges `(edges,)`: from the node `source` by the matrix `symbol` to the node `target`; nodes
    are 0, 1, ...

    A node stands for what has happened before. The graph is complete if the target of every edge
    has an outgoing edge for every matrix that may follow: then every allowed sequence is a walk in
    the graph.
    """

    source: np.ndarray
    symbol: np.ndarray
    target: np.ndarray

    @staticmethod
    def least(follows: np.ndarray) -> "Graph":
        """Return the smallest complete graph: one node for each set of matrices that may follow."""
        kinds, node = np.unique(follows, axis=0, return_inverse=True)
        source, symbol = np.nonzero(kinds)
        return Graph(source, symbol, node.reshape(-1)[symbol])

    @cached_property
    def nodes(self) -> int:
        """The number of nodes."""
        return 1 + int(max(self.source.max(), self.target.max()))

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The index of the pair of nodes that each edge joins, and the first and the last node
        of each pair."""
        pairs, index = np.unique(self.source * self.nodes + self.target, return_inverse=True)
        return index, pairs // self.nodes, pairs % self.nodes

    @cached_property
    def along(self) -> tuple[np.ndarray, int]:
        """Return an order of the nodes in which those that edges join are near, and how far apart
        any of these are in it (E. Cuthill, J. McKee, ACM National Conference 1969)."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import reverse_cuthill_mckee

        shape = self.nodes, self.nodes
        joined = coo_array((np.ones(self.source.size), (self.source, self.target)), shape).tocsr()
        both_ways = (joined + joined.T).tocsr()
        order = reverse_cuthill_mckee(both_ways, symmetric_mode=True).astype(int)
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        return order, int(np.abs(place[self.source] - place[self.target]).max())

    def grouped(self, group: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """Return the edges sorted by their group 0, 1, ..., and the bounds of the groups in that
        order."""
        order = np.argsort(group, kind="stable")
        return order, np.searchsorted(group[order], np.arange(group.max() + 2)).tolist()

    def is_complete(self, follows: np.ndarray) -> bool:
        """Return whether every sequence that `follows` allows is a walk in the graph."""
        leaving = np.zeros((1 + max(self.source.max(), self.target.max()), len(follows)), bool)
        leaving[self.source, self.symbol] = True
        every = np.isin(np.flatnonzero(follows.any(0) | follows.any(1)), self.symbol).all()
        return bool(every and not (follows[self.symbol] & ~leaving[self.target]).any())

    def split(
        self, parts: dict[int, np.ndarray], follows: np.ndarray
    ) -> tuple["Graph", np.ndarray]:
        """Return the graph with some nodes split in two, and the old node of each new one.

        parts: node -> the edges into it (indices) that lead to its new half. Edges out of a node
        leave both halves, but only for matrices that may follow those of the edges into that half;
        nodes that nothing reaches are removed.
        """
        halves = {node: self.nodes + i for i, node in enumerate(parts)}
        target = self.target.copy()
        for node, edges in parts.items():
            target[edges] = halves[node]
        leaving = {node: np.flatnonzero(self.source == node) for node in parts}
        source = np.concatenate(
            [self.source, *(np.full(leaving[node].size, half) for node, half in halves.items())]
        )
        more = np.concatenate([np.arange(self.source.size), *leaving.values()])
        symbol = self.symbol[more]
        target = target[more]
        origin = np.append(np.arange(self.nodes), list(parts)).astype(int)
        while True:
            may = np.zeros((origin.size, len(follows)), bool)
            np.logical_or.at(may, target, follows[symbol])
            used = may[source, symbol]
            if used.all():
                break
            source = source[used]
            symbol = symbol[used]
            target = target[used]
        reached = np.unique(target)
        number = np.full(origin.size, -1)
        number[reached] = np.arange(reached.size)
        return Graph(number[source], symbol, number[target]), origin[reached]
