"""The check of a proof: in given norms on a given graph, given matrices shrink, whatever rounding does.

Nothing here depends on how the norms were found.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import comb

import numpy as np

from wavesweep.engine.sets import UNIT, Polynomials, monomials
from wavesweep.for_all.graph import Graph

SURELY = 4.0  # times the bounds: what is computed in doubles of bounds is known to far better than that
WEIGHED = 1e-13  # relative error of a probability, in addition to some roundings of 1
SURE = 1.001  # times the bounds whose own roundings alone are not in them
LEAST = 1e-290  # entry from which on nothing underflows


@dataclass(frozen=True, slots=True, eq=False)
class Norms:
    """Quadratic norms `x -> sqrt(x' P_i x)` at the nodes of a graph, P `(nodes, n, n)`, symmetric."""

    P: np.ndarray
    graph: Graph


def shrink(norms: Norms, E: np.ndarray, dE: np.ndarray, follows: np.ndarray) -> bool:
    """Return whether all matrices within dE of `I + E` are proved to shrink in the norms, in every order that is allowed.

    E, dE: `(symbols, n, n)`; dE bounds the errors of the entries. follows: `(symbols, symbols)`, see `Family`.

    Norms are convex: if this holds for two matrices of each symbol, by the same norms, it holds for all between them.
    """
    return shrink_along((norms,), E[None], dE[None], follows)


def shrink_along(norms: Sequence[Norms], E: np.ndarray, dE: np.ndarray, follows: np.ndarray) -> bool:
    """Return whether matrices that depend on a number are proved to shrink in norms that depend on it, in every order.

    The number is constant in time. With s from 0 to 1, the forms are `P_i(s)`, a Bezier curve with the forms of `norms` as its
    control points, and the matrices are within dE of `A(s) = I + E(s)`, a Bezier curve with the control points `I + E`,
    `(points, symbols, n, n)`. follows: see `shrink`.

    They shrink if the graph is complete, all P_i are positive definite, and `F = P_i - A' P_j A` is so on each edge, for
    all s. Both are combinations of their own control points, the matrices of `_bezier`. F is computed with a bound R on its
    errors, entry by entry.
    """
    graph, P = norms[0].graph, np.array([each.P for each in norms])
    n = P.shape[-1]
    if not (graph.is_complete(follows) and _symmetric(P) and definite(P, np.zeros_like(P))):
        return False
    A = np.eye(n) + E[:, graph.symbol]
    size, dA = np.abs(A).max(0), (dE[:, graph.symbol] + UNIT * np.abs(A)).max(0)
    of_P = np.abs(P).max(0)
    F, joined = _bezier(P, A, graph)
    across = _transposed(size) @ of_P[graph.target]
    R = _transposed(dA) @ of_P[graph.target] @ (size + dA) + across @ dA
    R = SURELY * (R + UNIT * (2 * n + 2 + joined) * (across @ size + of_P[graph.source]))
    return definite(*_in_its_units(F, np.broadcast_to(R, F.shape)))


def _bezier(P, A, graph):
    """The control points of `P_i(s) - A(s)' P_j(s) A(s)`, `(degree + 1, edges, n, n)`, and how many terms one has at most."""
    of_P, of_A = len(P) - 1, len(A) - 1
    degree = of_P + 2 * of_A
    F, last = np.zeros((degree + 1, *A.shape[1:])), P[:, graph.target]
    for k in range(of_P + 1):
        for more in range(degree - of_P + 1):
            F[k + more] += comb(of_P, k) * comb(degree - of_P, more) / comb(degree, k + more) * P[k, graph.source]
        for i, j in product(range(of_A + 1), repeat=2):
            weight = comb(of_P, k) * comb(of_A, i) * comb(of_A, j) / comb(degree, i + j + k)
            F[i + j + k] -= weight * (_transposed(A[i]) @ last[k] @ A[j])
    return F, 2 * len(P) * len(A) ** 2


def _in_its_units(F, R):
    """The matrices `W' F W`, about 1, and what errors R of F become in them; as they are if a factor W is not found.

    Slow and fast states make F nearly singular in every other basis, and errors of its entries would count as if they were in
    the direction in which it is least. R holds SURELY times the rounding of products whose terms are no smaller than F, and so
    that of `W' F W` as well.
    """
    diagonal = np.diagonal(F, axis1=-2, axis2=-1)
    if not (np.isfinite(F).all() and (diagonal > LEAST).all()):
        return F, R
    units = 1 / np.sqrt(diagonal)
    try:
        W = units[..., None] * _transposed(np.linalg.inv(np.linalg.cholesky(F * units[..., None, :] * units[..., :, None])))
    except np.linalg.LinAlgError:
        return F, R
    size = np.abs(W)
    return _transposed(W) @ F @ W, _transposed(size) @ R @ size


def shrink_on_average(norms: Norms, weight: np.ndarray, E: np.ndarray, dE: np.ndarray) -> bool:
    """Return whether all matrices within dE of `I + E` are proved to shrink on average in the norms, on a Markov chain.

    weight: the probability of each edge of the norms' graph, with a few roundings. E, dE: `(symbols, n, n)`.

    It is so if the probabilities of the edges from each node have the sum 1, each P_i is positive definite, and so is
    `F_i = P_i - sum w A' P_j A`, the sum over the edges from i. F is linear in w, and `A' P_j A` convex in A: if F is definite
    at the points of a hull of either, by the same norms, it is so in all of the hull.
    """
    P, graph = norms.P, norms.graph
    n, root = P.shape[-1], _root(weight)
    if not (_symmetric(P) and definite(P, np.zeros_like(P)) and _are_chances(weight, graph)):
        return False
    A, size, dA = np.eye(n) + E, np.abs(np.eye(n) + E), dE + UNIT * np.abs(np.eye(n) + E)
    A, size, dA = (root * each[graph.symbol] for each in (A, size, dA))
    last, of_P = P[graph.target], np.abs(P)[graph.target]
    F, R, terms = P.copy(), np.zeros_like(P), np.abs(P)
    across = _transposed(size) @ of_P
    np.subtract.at(F, graph.source, _transposed(A) @ last @ A)
    np.add.at(R, graph.source, _transposed(dA) @ of_P @ (size + dA) + across @ dA)
    np.add.at(terms, graph.source, across @ size)
    count = np.bincount(graph.source).max()
    return definite(F, SURELY * (R + UNIT * (2 * n + 8 + count) * terms))


def shrink_over(
    forms: Polynomials, graph: Graph, A: Polynomials, follows: np.ndarray | None, weight: np.ndarray | None = None
) -> tuple[bool, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return whether all matrices of a box are proved to shrink in forms of that box, in every order that is allowed; and what
    the slack consists of, see `_slack_over`.

    forms: `P_i(s)` at each node, symmetric, exact; A: the matrix of each symbol. Both for s from -1 to 1 in each number, which
    are constant in time. weight: the probability of each edge, if they have to shrink on average, see `shrink_on_average`;
    follows then is of no account.

    It is so if the graph is complete, P_i(0) is positive definite, and `F(s) = P_i(s) - A(s)' P_j(s) A(s)` is so on each edge
    for every s: on the way from 0 to s no form can be the first to become singular, since it exceeds `A' P_j A`. F is definite
    if `G = W' F W` is, whatever W. The terms of G of degree two or less are a convex combination of Bernstein's control points,
    each of which has to exceed the norms of all other terms and errors. On average the same holds for the sums over the edges
    from each node.
    """
    P = forms.terms
    terms, errors, higher = slack = _slack_over(forms, graph, A, weight)
    if not (
        (graph.is_complete(follows) if weight is None else _are_chances(weight, graph))
        and _symmetric(P)
        and definite(P[0], np.zeros_like(P[0]))
    ):
        return False, slack
    off = errors + higher
    low = terms[: len(monomials(A.numbers, 2)[0])]
    control = np.tensordot(_control(A.numbers), low, (1, 0))
    rounding = 4 * len(low) * UNIT * np.abs(low).sum(0)
    return bool(np.isfinite(off).all()) and definite(control, np.broadcast_to(rounding, control.shape), off), slack


def _slack_over(
    forms: Polynomials, graph: Graph, A: Polynomials, weight: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the terms of `G(s)` on each edge, `(monomials, edges, n, n)`, and bounds `(edges,)` on the norm of all errors and
    of the terms of degree three or more; with weights at each node in place of an edge. G(0) is about 1, if F(0) is positive
    definite; infinite bounds otherwise.
    """
    last, n, moved = forms.of(graph.target), A.terms.shape[-1], A.of(graph.symbol)
    if weight is None:
        first, at, most = forms.of(graph.source), np.arange(graph.source.size), 0
    else:
        first, at, most = forms, graph.source, np.bincount(graph.source).max()
        root = _root(weight)
        moved = Polynomials(
            root * moved.terms, root * moved.rest + 2 * UNIT * root * np.abs(moved.terms).sum(0), A.numbers, A.order
        )

    def summed(each):
        if weight is None:
            return each
        found = np.zeros((*each.shape[:-3], graph.nodes, n, n))
        np.add.at(found, (..., at, slice(None), slice(None)), each)
        return found

    F = first.terms[0] - summed(_transposed(moved.terms[0]) @ last.terms[0] @ moved.terms[0])
    try:
        W = _transposed(np.linalg.inv(np.linalg.cholesky(F)))
    except np.linalg.LinAlgError:
        return np.zeros_like(first.terms), np.full(len(F), np.inf), np.zeros(len(F))
    size = np.abs(W)
    rest = moved.rest @ size[at] + 2 * n * UNIT * (np.abs(moved.terms).sum(0) @ size[at])
    B = Polynomials(moved.terms @ W[at], rest, A.numbers, A.order)
    after = Polynomials(_transposed(B.terms), _transposed(B.rest), A.numbers, A.order) @ (last @ B)
    terms = _transposed(W) @ first.terms @ W - summed(after.terms)
    whole = _transposed(size) @ np.abs(first.terms).sum(0) @ size + summed(np.abs(after.terms).sum(0))
    errors = summed(after.rest) + (4 * n + most) * UNIT * whole
    more = len(monomials(A.numbers, 2)[0])
    terms = (terms + _transposed(terms)) / 2
    return terms, SURE * _norm(errors), SURE * _norm(terms[more:]).sum(0)


def definite(F: np.ndarray, R: np.ndarray, off: np.ndarray | float = 0.0) -> bool:
    """Return whether all symmetric matrices within R of F, entry by entry, and within a norm `off`, are positive definite.

    In units of the states, powers of 2, that make its diagonal about 1, F is positive definite if the Cholesky decomposition
    of `F - (|R| + c) I` runs to its end. Here `|R|` is the largest sum of a row, and c is what rounding may do to the
    decomposition itself (S. M. Rump, Verification of positive definiteness, BIT 46, 2006, Theorem 2.3).
    """
    n = F.shape[-1]
    F, R = (F + _transposed(F)) / 2, (R + _transposed(R)) / 2
    diagonal = np.diagonal(F, axis1=-2, axis2=-1)
    if not (np.isfinite(F).all() and np.isfinite(R).all() and (diagonal > LEAST).all()):
        return False
    units = np.exp2(-np.round(np.log2(diagonal) / 2))
    F, R = (part * units[..., None, :] * units[..., :, None] for part in (F, R))
    rounding = SURELY * (n + 2) * UNIT * np.trace(F, axis1=-2, axis2=-1)
    less = SURELY / 2 * R.sum(-1).max(-1) + rounding + off * units.max(-1) ** 2
    try:
        np.linalg.cholesky(F - less[..., None, None] * np.eye(n))
    except np.linalg.LinAlgError:
        return False
    return True


def _root(weight):
    """The roots of probabilities, or more, as factors of matrices."""
    return np.sqrt(weight * (1 + WEIGHED) + 16 * UNIT)[:, None, None]


def _are_chances(weight, graph):
    """Whether the edges from each node have probabilities of the sum 1."""
    whole = np.bincount(graph.source, weight, graph.nodes)
    return bool((weight >= 0).all() and (np.abs(whole - 1) <= WEIGHED).all())


def _symmetric(P):
    return bool(np.isfinite(P).all() and (_transposed(P) == P).all())


def _transposed(X):
    return np.swapaxes(X, -1, -2)


def _norm(X):
    """An upper bound on the largest singular value."""
    return np.sqrt(np.abs(X).sum(-1).max(-1) * np.abs(X).sum(-2).max(-1))


@lru_cache(maxsize=8)
def _control(numbers):
    """The weights of the monomials up to degree two in each of Bernstein's control points, three for each number."""
    weights = np.array([[1, 1, 1], [-1, 0, 1], [1, -1, 1]], float)  # of 1, s and s^2 at each
    exponents = monomials(numbers, 2)[0]
    points = product(range(3), repeat=numbers)
    return np.array([[np.prod(weights[each, list(point)]) for each in exponents] for point in points])
