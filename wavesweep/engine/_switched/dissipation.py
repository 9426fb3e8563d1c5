"""The least damping with which a switched system takes in no less energy than it gives back,
whatever the order.

The system goes from states s and a displacement u to `A s + B u`, and takes in `z' S z + d u^2`
meanwhile, z being s and u. If `s' P_i s` is stored at node i of a graph, it never gives back more
than was stored as long as

    F = [P_i 0; 0 d] + S - [A B]' P_j [A B]

is positive definite on every edge from i to j. The least such d is a semidefinite program in P and
d. `every_hand_proof` checks what is found here.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from wavesweep.engine._monodromy.rounding import balance
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.norms import Centre, find_norms
from wavesweep.engine._switched.semidefinite import Inequality, minimised, symmetric_basis

# Of the damping: how far above the least one there is room for the rounding of a proof, in turn.
ROOM = 1e-7 * 8.0 ** np.arange(8)


# rests of words, each with the words that may come then
_Node = frozenset[tuple[tuple[int, ...], tuple[int, ...]]]


def automaton(words: tuple[tuple[int, ...], ...], follows: np.ndarray) -> Graph:
    """Return the smallest graph of ticks whose walks are the allowed sequences of words.

    words: the kinds of ticks of each word; follows: `(words, words)`, which may come after which. A
    node is what may still happen: the rests of words, each with the words that may come then.
    """
    after = [tuple(np.flatnonzero(row).tolist()) for row in follows]
    nodes: dict[_Node, int] = {}
    edges = []
    open_ = []

    def begun(some: tuple[int, ...]) -> _Node:
        return frozenset((words[symbol], after[symbol]) for symbol in some)

    def number(node: _Node) -> int:
        if node not in nodes:
            nodes[node] = len(nodes)
            open_.append(node)
        return nodes[node]

    for some in dict.fromkeys(after):
        number(begun(some))
    while open_:
        node = open_.pop()
        for kind in sorted({rest[0] for rest, _ in node}):
            further: set[tuple[tuple[int, ...], tuple[int, ...]]] = set()
            for rest, some in node:
                if rest[0] == kind:
                    further |= {(rest[1:], some)} if rest[1:] else begun(some)
            edges.append((nodes[node], kind, number(frozenset(further))))
    return Graph(*np.array(edges).T)


def _units_of_states(M: np.ndarray, S: np.ndarray) -> np.ndarray:
    """The units `(n,)` of the states in which M and S have rows and columns of similar sizes."""
    n = M.shape[1]
    # Of (s, u): the sizes of what states become, above that of what a displacement takes in.
    size = np.abs(S).sum(0)
    size[:n] = np.abs(M).sum(0)
    _, units_of_batch = balance(size[None], thorough=True)
    units = units_of_batch[0]
    return units[:n] / units[n]  # u keeps its own


def _dissipating(M: np.ndarray, S: np.ndarray, graph: Graph, forms: np.ndarray) -> Inequality:
    """Of every edge i to j `S + diag(P_i, d) - M' P_j M - t I >= 0`, in the unknowns: the coordinates
    of the P_i in the basis `forms`, node by node, then d and t."""
    n = M.shape[1]
    m = len(forms)
    d = graph.nodes * m
    index = np.empty((len(S), 2 * m + 2), int)
    index[:, :m] = graph.source[:, None] * m + np.arange(m)
    index[:, m : 2 * m] = graph.target[:, None] * m + np.arange(m)
    index[:, 2 * m :] = d, d + 1
    slopes = np.zeros((len(S), 2 * m + 2, n + 1, n + 1))
    slopes[:, :m, :n, :n] = forms
    slopes[:, m : 2 * m] -= M[:, None].mT @ forms @ M[:, None]
    slopes[:, 2 * m, n, n] = 1.0
    slopes[:, 2 * m + 1] = -np.eye(n + 1)
    return Inequality(S, slopes, index)


def least_damping(
    M: np.ndarray, S: np.ndarray, follows: np.ndarray
) -> Iterator[tuple[Centre, float]]:
    """Yield energies and dampings with which every edge dissipates, from next to the least damping
    on; nothing if none are found.

    M: `[A B]` of each edge, `(edges, n, n + 1)`; S: `(edges, n + 1, n + 1)`; follows: `(edges,
    edges)`. The edges are the symbols of the graph of the energies. Accuracy: the first of ROOM, or a
    later one where rounding leaves less.

    The search is in units t of the states, s = U s_t with U = diag(t), in which `A_t = U^-1 A U`,
    `B_t = U^-1 B` and `S_t = diag(U, 1) S diag(U, 1)` have rows and columns of similar sizes, and in
    the basis of energies in which all A shrink. For each damping the largest t is looked for with
    which all F are above t I.
    """
    n = M.shape[1]
    units = _units_of_states(M, S)
    M = M / units[:, None]
    M[..., :n] *= units
    centre, factor = find_norms(M[..., :n], follows)
    if factor < 1:
        return
    graph = centre.graph
    basis = units[:, None] * centre.basis
    M = centre.inverse @ M[graph.symbol]
    M[..., :n] = M[..., :n] @ centre.basis
    S = S[graph.symbol]
    S[:, :n] = basis.mT @ S[:, :n]
    S[..., :n] = S[..., :n] @ basis
    largest = np.abs(S).max()
    forms = symmetric_basis(n)
    m = len(forms)
    d = graph.nodes * m  # their places among the unknowns, behind the P_i
    t = d + 1
    edges = [_dissipating(M, S / largest, graph, forms)]
    unknown = np.eye(t + 1)
    least = minimised(unknown[d], edges, -unknown[[t]], np.zeros(1))[d]
    for room in ROOM if np.isfinite(least) else ():
        damping = least + room * max(abs(least), ROOM[0])
        x = minimised(-unknown[t], edges, unknown[[d]], np.array([damping]))
        P = np.tensordot(x[:d].reshape(-1, m), forms, (1, 0)) * largest
        energies = replace(centre, P=P, basis=basis, inverse=centre.inverse / units)
        yield energies, float(damping * largest)
