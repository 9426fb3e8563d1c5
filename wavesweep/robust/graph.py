"""Graphs with a quadratic norm at each node, whose edges are the matrices of a switched system."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np


@dataclass(frozen=True, eq=False)
class Graph:
    """Edges `(edges,)`: from the node `source` by the matrix `symbol` to the node `target`; nodes are 0, 1, ...

    A node stands for what has happened before it. The graph is complete if from the target of every edge there is one for
    every matrix that may follow: then every allowed sequence is a walk in it.
    """

    source: np.ndarray
    symbol: np.ndarray
    target: np.ndarray

    @staticmethod
    def least(follows: np.ndarray) -> "Graph":
        """Return the graph that remembers no more than what may follow: one node, if all may follow all."""
        kinds, node = np.unique(follows, axis=0, return_inverse=True)
        source, symbol = np.nonzero(kinds)
        return Graph(source, symbol, node.reshape(-1)[symbol])

    @cached_property
    def nodes(self) -> int:
        """The number of nodes."""
        return 1 + int(max(self.source.max(), self.target.max()))

    @cached_property
    def pairs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The number of the pair of nodes that each edge joins, and the first and the last node of each pair."""
        known, number = np.unique(self.source * self.nodes + self.target, return_inverse=True)
        return number, known // self.nodes, known % self.nodes

    def grouped(self, number: np.ndarray) -> tuple[np.ndarray, list[int]]:
        """Return the edges in the order of a number that each has, 0, 1, ..., and where each number begins, and the end."""
        order = np.argsort(number, kind="stable")
        return order, np.searchsorted(number[order], np.arange(number.max() + 2)).tolist()

    def doubled(self, symbols: int) -> "Graph":
        """Return the graph with a second edge beside each one, whose matrix is the one that is `symbols` further on."""
        pairs = (self.source, self.source), (self.symbol, self.symbol + symbols), (self.target, self.target)
        return Graph(*map(np.concatenate, pairs))

    def is_complete(self, follows: np.ndarray) -> bool:
        """Return whether every sequence that `follows` allows is a walk, from some node."""
        leaving = np.zeros((1 + max(self.source.max(), self.target.max()), len(follows)), bool)
        leaving[self.source, self.symbol] = True
        every = np.isin(np.flatnonzero(follows.any(0) | follows.any(1)), self.symbol).all()
        return bool(every and not (follows[self.symbol] & ~leaving[self.target]).any())

    def split(self, parts: dict[int, np.ndarray], follows: np.ndarray) -> tuple["Graph", np.ndarray]:
        """Return the graph with some nodes in two, and of each of its nodes the one that it was.

        parts: node -> the edges into it (indices) that lead to its new half. What leaves a node leaves both halves, by the
        matrices that may follow those of the edges into them; nodes that nothing reaches are left out.
        """
        halves = {node: self.nodes + i for i, node in enumerate(parts)}
        target = self.target.copy()
        for node, edges in parts.items():
            target[edges] = halves[node]
        leaving = {node: np.flatnonzero(self.source == node) for node in parts}
        source = np.concatenate([self.source, *(np.full(leaving[node].size, half) for node, half in halves.items())])
        more = np.concatenate([np.arange(self.source.size), *leaving.values()])
        symbol, target, origin = self.symbol[more], target[more], np.append(np.arange(self.nodes), list(parts)).astype(int)
        while True:
            may = np.zeros((origin.size, len(follows)), bool)
            np.logical_or.at(may, target, follows[symbol])
            kept = may[source, symbol]
            if kept.all():
                break
            source, symbol, target = source[kept], symbol[kept], target[kept]
        reached = np.unique(target)
        number = np.full(origin.size, -1)
        number[reached] = np.arange(reached.size)
        return Graph(number[source], symbol, number[target]), origin[reached]
