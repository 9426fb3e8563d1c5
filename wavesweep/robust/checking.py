"""The check of a proof: in given norms on a given graph, given matrices shrink, whatever rounding does.

Nothing here depends on how the norms were found.
"""

from dataclasses import dataclass

import numpy as np

from wavesweep.robust.graph import Graph

UNIT = np.finfo(float).eps / 2
SURELY = 4.0  # times the bounds: what is computed in doubles of bounds is known to far better than that
WEIGHED = 1e-13  # relative error of a probability, in addition to some roundings of 1
LEAST = 1e-290  # entry from which on nothing underflows


@dataclass(frozen=True, slots=True, eq=False)
class Norms:
    """Quadratic norms `x -> sqrt(x' P_i x)` at the nodes of a graph, P `(nodes, n, n)`, symmetric."""

    P: np.ndarray
    graph: Graph


def shrink(norms: Norms, E: np.ndarray, dE: np.ndarray, follows: np.ndarray) -> bool:
    """Return whether all matrices within dE of `I + E` are proved to shrink in the norms, in every order that is allowed.

    E, dE: `(symbols, n, n)`; dE bounds the errors of the entries. follows: `(symbols, symbols)`, see `Family`.

    It is so if the graph is complete, and `F = P_i - A' P_j A` is positive definite on each edge. F is computed with a bound R
    on its errors, entry by entry.

    Norms are convex: if this holds for two matrices of each symbol, by the same norms, it holds for all between them.
    """
    P, graph = norms.P, norms.graph
    n = P.shape[-1]
    if not (graph.is_complete(follows) and np.isfinite(P).all() and (np.swapaxes(P, -1, -2) == P).all()):
        return False
    A, size, dA = np.eye(n) + E, np.abs(np.eye(n) + E), dE + UNIT * np.abs(np.eye(n) + E)
    A, size, dA = A[graph.symbol], size[graph.symbol], dA[graph.symbol]
    of_P, first, last = np.abs(P), P[graph.source], P[graph.target]
    F = first - np.swapaxes(A, -1, -2) @ last @ A
    terms = np.swapaxes(size, -1, -2) @ of_P[graph.target]
    R = np.swapaxes(dA, -1, -2) @ of_P[graph.target] @ (size + dA) + terms @ dA
    return definite(F, SURELY * (R + UNIT * (2 * n + 2) * (terms @ size + np.abs(first))))


def shrink_on_average(norms: Norms, weight: np.ndarray, E: np.ndarray, dE: np.ndarray) -> bool:
    """Return whether all matrices within dE of `I + E` are proved to shrink on average in the norms, on a Markov chain.

    weight: the probability of each edge of the norms' graph, with a few roundings. E, dE: `(symbols, n, n)`.

    It is so if the probabilities of the edges from each node have the sum 1, each P_i is positive definite, and so is
    `F_i = P_i - sum w A' P_j A`, the sum over the edges from i. F is linear in w, and `A' P_j A` convex in A: if F is definite
    at the points of a hull of either, by the same norms, it is so in all of the hull.
    """
    P, graph = norms.P, norms.graph
    n, whole = P.shape[-1], np.bincount(graph.source, weight, graph.nodes)
    if not (np.isfinite(P).all() and (np.swapaxes(P, -1, -2) == P).all() and definite(P, np.zeros_like(P))):
        return False
    if not ((weight >= 0).all() and (np.abs(whole - 1) <= WEIGHED).all()):
        return False
    root = np.sqrt(weight * (1 + WEIGHED) + 16 * UNIT)[:, None, None]
    A, size, dA = np.eye(n) + E, np.abs(np.eye(n) + E), dE + UNIT * np.abs(np.eye(n) + E)
    A, size, dA = (root * each[graph.symbol] for each in (A, size, dA))
    last, of_P = P[graph.target], np.abs(P)[graph.target]
    F, R, terms = P.copy(), np.zeros_like(P), np.abs(P)
    across = np.swapaxes(size, -1, -2) @ of_P
    np.subtract.at(F, graph.source, np.swapaxes(A, -1, -2) @ last @ A)
    np.add.at(R, graph.source, np.swapaxes(dA, -1, -2) @ of_P @ (size + dA) + across @ dA)
    np.add.at(terms, graph.source, across @ size)
    count = np.bincount(graph.source).max()
    return definite(F, SURELY * (R + UNIT * (2 * n + 8 + count) * terms))


def definite(F: np.ndarray, R: np.ndarray) -> bool:
    """Return whether all symmetric matrices within R of F, entry by entry, are positive definite.

    In units of the states, powers of 2, that make its diagonal about 1, F is positive definite if the Cholesky decomposition
    of `F - (|R| + c) I` runs to its end. Here `|R|` is the largest sum of a row, and c is what rounding may do to the
    decomposition itself (S. M. Rump, Verification of positive definiteness, BIT 46, 2006, Theorem 2.3).
    """
    n = F.shape[-1]
    F, R = (F + np.swapaxes(F, -1, -2)) / 2, (R + np.swapaxes(R, -1, -2)) / 2
    diagonal = np.diagonal(F, axis1=-2, axis2=-1)
    if not (np.isfinite(F).all() and np.isfinite(R).all() and (diagonal > LEAST).all()):
        return False
    units = np.exp2(-np.round(np.log2(diagonal) / 2))
    F, R = (part * units[..., None, :] * units[..., :, None] for part in (F, R))
    rounding = SURELY * (n + 2) * UNIT * np.trace(F, axis1=-2, axis2=-1)
    less = SURELY / 2 * R.sum(-1).max(-1) + rounding
    try:
        np.linalg.cholesky(F - less[:, None, None] * np.eye(n))
    except np.linalg.LinAlgError:
        return False
    return True
