"""The least damping with which a switched system takes in no less energy than it gives back,
whatever the order.

The system goes from states s and a displacement u to `A s + B u`, and takes in `z' S z + d u^2`
meanwhile, z being s and u. If `s' P_i s` is stored at node i of a graph, it never gives back more
than was stored as long as

    F = [P_i 0; 0 d] + S - [A B]' P_j [A B]

is positive definite on every edge from i to j. The least such d is a semidefinite program in P and
d. `every_hand_proof` checks what is found here.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from wavesweep.engine._monodromy.rounding import balance
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.norms import Centre, find_norms, hessian_of, packed, unpacked

OPTIMUM_DISTANCE = 1e-7  # of the damping: distance from the optimum at which the program ends
NEWTON_STEPS_OF_ENERGY = 400  # of Newton's method
RIDGE = 1e-11  # of the diagonal of the Hessian, against rounding
SHORTEST_STEP = 1e-9  # part of a step below which rounding leaves no room
SCALES = np.geomspace(1e-6, 1e6, 49)  # of the first energies, in the size of what is taken in


def automaton(words: tuple[tuple[int, ...], ...], follows: np.ndarray) -> Graph:
    """Return the smallest graph of ticks whose walks are the allowed sequences of words.

    words: the kinds of ticks of each word; follows: `(words, words)`, which may come after which. A
    node is what may still happen: the rests of words, each with the words that may come then.
    """
    after = [tuple(np.flatnonzero(row).tolist()) for row in follows]
    nodes = {}
    edges = []
    open_ = []

    def begun(some):
        return frozenset((words[symbol], after[symbol]) for symbol in some)

    def number(node):
        if node not in nodes:
            nodes[node] = len(nodes)
            open_.append(node)
        return nodes[node]

    for some in dict.fromkeys(after):
        number(begun(some))
    while open_:
        node = open_.pop()
        for kind in sorted({rest[0] for rest, _ in node}):
            further = set()
            for rest, some in node:
                if rest[0] == kind:
                    further |= {(rest[1:], some)} if rest[1:] else begun(some)
            edges.append((nodes[node], kind, number(frozenset(further))))
    return Graph(*np.array(edges).T)


def least_damping(
    M: np.ndarray, S: np.ndarray, follows: np.ndarray
) -> Iterator[tuple[Centre, float]]:
    """Yield energies and dampings with which every edge dissipates, from the least damping on;
    nothing if none are found.

    M: `[A B]` of each edge, `(edges, n, n + 1)`; S: `(edges, n + 1, n + 1)`; follows: `(edges,
    edges)`. The edges are the symbols of the graph of the energies. Accuracy: OPTIMUM_DISTANCE,
    unless rounding ends the program earlier.

    The search is in units t of the states, s = U s_t with U = diag(t), in which `A_t = U^-1 A U`,
    `B_t = U^-1 B` and `S_t = diag(U, 1) S diag(U, 1)` have rows and columns of similar sizes. It
    begins with energies in which all A shrink.
    """
    n = M.shape[1]
    # Of (s, u): the sizes of what states become, above that of what a displacement takes in.
    size = np.abs(S).sum(0)
    size[:n] = np.abs(M).sum(0)
    _, units_of_batch = balance(size[None], thorough=True)
    units = units_of_batch[0]
    units = units[:n] / units[n]  # u keeps its own
    M = M / units[:, None]
    M[..., :n] *= units
    S = S.copy()
    S[:, :n] *= units[:, None]
    S[..., :n] *= units
    centre, factor = find_norms(M[..., :n], follows)
    if factor < 1:
        return
    for each, damping in reversed(_path(centre, M, S)):
        basis = units[:, None] * each.basis
        inverse = each.inverse / units
        yield replace(each, basis=basis, inverse=inverse), damping


def _path(centre: Centre, M, S) -> list[tuple[Centre, float]]:
    """The centres for growing weights w: the minima of the barrier `w d - sum log det F + sum tr
    P` in P and d."""
    n = centre.P.shape[-1]
    graph = centre.graph
    M = centre.inverse @ M[graph.symbol]
    S = S[graph.symbol].copy()
    M[..., :n] = M[..., :n] @ centre.basis
    S[:, :n] = centre.basis.mT @ S[:, :n]
    S[..., :n] = S[..., :n] @ centre.basis

    def slack(P, d):
        F = S - M.mT @ P[graph.target] @ M
        F[:, :n, :n] += P[graph.source]
        F[:, n, n] += d
        return F

    def barrier(P, d):
        try:
            logs = np.log(np.diagonal(np.linalg.cholesky(slack(P, d)), axis1=-2, axis2=-1)).sum()
        except np.linalg.LinAlgError:
            return np.inf
        return weight * d - 2 * logs + np.trace(P, axis1=-2, axis2=-1).sum()

    P, d = _first(slack, centre.P, np.abs(S).max())
    unit = abs(d) or 1.0
    P = P / unit
    d = d / unit
    S = S / unit
    weight = 1.0
    found = []
    steps = 0
    while steps < NEWTON_STEPS_OF_ENERGY and len(M) * (n + 1) > OPTIMUM_DISTANCE * weight * max(
        abs(d), OPTIMUM_DISTANCE
    ):
        weight = weight * 8.0  # times the weight of the damping from one centre to the next
        decrement = np.inf
        # A point of a smaller Newton decrement counts as the centre.
        while decrement > 0.5 and steps < NEWTON_STEPS_OF_ENERGY:
            steps = steps + 1
            length = 1.0
            before = barrier(P, d)
            try:
                change, step, decrement = _newton(slack(P, d), M, weight, graph, len(P))
            except np.linalg.LinAlgError:  # singular to rounding
                return found
            while (
                length > SHORTEST_STEP
                and not barrier(P + length * change, d + length * step) < before
            ):
                length *= 0.7
            if length <= SHORTEST_STEP:
                return found
            P = P + length * change
            d = d + length * step
        found.append((replace(centre, P=P * unit), d * unit))
    return found


def _first(slack: Callable, P, size):
    """Energies to begin with, and a damping with which all edges dissipate: the least over some
    scales of P."""
    n = P.shape[-1]
    best = (np.inf, P)
    for scale in SCALES * size:
        F = slack(scale * P, 0.0)
        half = np.linalg.solve(F[:, :n, :n], F[:, :n, n:])
        least = ((F[:, n:, :n] @ half)[:, 0, 0] - F[:, n, n]).max()
        best = min(best, (least, scale * P), key=lambda each: each[0])
    return best[1], best[0] + 0.2 * abs(best[0]) + 1e-12 * size


def _newton(F, M, weight, graph, nodes):
    """The step of Newton's method in the energies and the damping, and its decrement."""
    from scipy.linalg import cho_factor, cho_solve

    n = M.shape[1]
    inverse = np.linalg.inv(F)
    inverse = (inverse + inverse.mT) / 2
    moved = M @ inverse
    arriving = moved @ M.mT
    slope, mixed = np.zeros((2, nodes, n, n))
    slope += np.eye(n)
    for into, at, part, sign in (
        (graph.source, inverse[:, :n, :n], inverse[:, :n, n], -1),
        (graph.target, arriving, moved[..., n], 1),
    ):
        np.add.at(slope, into, sign * at)
        np.add.at(mixed, into, -sign * part[:, :, None] * part[:, None, :])
    slope = packed(slope).ravel()
    mixed = packed(mixed).ravel()
    hessian = hessian_of(inverse[:, :n, :n], moved[..., :n], arriving, graph, nodes)
    hessian[np.diag_indices_from(hessian)] *= 1 + RIDGE
    factor = cho_factor(hessian, lower=True, overwrite_a=True)
    of_slope, of_mixed = cho_solve(factor, np.stack([slope, mixed], -1)).T
    rise = weight - inverse[:, n, n].sum()
    step = -(rise - mixed @ of_slope) / ((inverse[:, n, n] ** 2).sum() - mixed @ of_mixed)
    change = -(of_slope + of_mixed * step)
    decrement = np.sqrt(max(0.0, -(slope @ change + rise * step)))
    return unpacked(change.reshape(nodes, -1), n), step, decrement
