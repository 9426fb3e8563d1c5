"""The check of a proof: in given norms on a given graph, given matrices shrink, whatever rounding
does.

Nothing here depends on how the norms were found.
Paragraphs in quotes are those of "More than stability" in docs/proof.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import comb
from typing import Any, NamedTuple

import numpy as np

from wavesweep.engine._sets.taylor_models import Polynomials, monomials
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine.doubles import UNIT_ROUNDING

# times the bounds: what is computed in doubles of bounds is known to far better than that
BOUNDS_OF_DOUBLES = 4.0
WEIGHED = 1e-13  # relative error of a probability, in addition to some roundings of 1
OWN_ROUNDING = 1.001  # times the bounds whose own roundings alone are not in them
LEAST_POSITIVE_ENTRY = 1e-290  # entry from which on nothing underflows


@dataclass(frozen=True, slots=True, eq=False)
class Norms:
    """Quadratic norms `x -> sqrt(x' P_i x)` at the nodes of a graph, P `(nodes, n, n)`,
    symmetric."""

    P: np.ndarray
    graph: Graph


def shrink(norms: Norms, E: np.ndarray, dE: np.ndarray, follows: np.ndarray) -> bool:
    """Return whether all matrices within dE of `I + E` are proved to shrink in the norms, in every
    order that is allowed.

    E, dE: `(symbols, n, n)`; dE bounds the errors of the entries. follows: `(symbols, symbols)`,
    see `Family`.

    Norms are convex: if this holds for two matrices of each symbol, by the same norms, it holds for
    all between them.
    """
    return shrink_along((norms,), E[None], dE[None], follows)


def shrink_along(
    norms: Sequence[Norms], E: np.ndarray, dE: np.ndarray, follows: np.ndarray
) -> bool:
    """Return whether matrices that depend on a number are proved to shrink in norms that depend on
    it, in every order.

    The number is constant in time. With s from 0 to 1, the forms are `P_i(s)`, a Bezier curve with
    the forms of `norms` as its control points, and the matrices are within dE of `A(s) = I + E(s)`,
    a Bezier curve with the control points `I + E`, `(points, symbols, n, n)`. follows: see
    `shrink`.

    They shrink if the graph is complete, all P_i are positive definite, and `F = P_i - A' P_j A` is
    so on each edge, for all s. Both are combinations of their own control points, the matrices of
    `_bezier`. F is computed with a bound R on its errors, entry by entry.
    """
    graph = norms[0].graph
    P = np.array([norm.P for norm in norms])
    # "Frames in any order": forms at the nodes of a complete graph.
    if not (graph.is_complete(follows) and _symmetric(P) and definite(P, np.zeros_like(P))):
        return False
    n = P.shape[-1]
    A = np.eye(n) + E[:, graph.symbol]
    # "Frames in any order": `P_i - A' P_j A` for each edge, by its Bernstein coefficients.
    F = _bezier(P, A, graph)
    # Its errors at any control point: those of the entries of A, and rounding.
    size = np.abs(A).max(0)
    dA = (dE[:, graph.symbol] + UNIT_ROUNDING * np.abs(A)).max(0)
    size_of_P = np.abs(P).max(0)
    P_i = size_of_P[graph.source]
    P_j = size_of_P[graph.target]
    across = size.mT @ P_j
    of_entries = dA.mT @ P_j @ (size + dA) + across @ dA
    joined = 2 * len(P) * len(A) ** 2  # terms of a control point, at most
    of_rounding = UNIT_ROUNDING * (2 * n + 2 + joined) * (across @ size + P_i)
    R = BOUNDS_OF_DOUBLES * (of_entries + of_rounding)
    # "Frames in any order": Cholesky decompositions with all rounding taken off.
    return definite(*in_its_units(F, np.broadcast_to(R, F.shape)))


def _bezier(P: np.ndarray, A: np.ndarray, graph: Graph) -> np.ndarray:
    """The control points of `P_i(s) - A(s)' P_j(s) A(s)`, `(degree + 1, edges, n, n)`."""
    of_P = len(P) - 1
    of_A = len(A) - 1
    degree = of_P + 2 * of_A
    F = np.zeros((degree + 1, *A.shape[1:]))
    P_i = P[:, graph.source]
    P_j = P[:, graph.target]
    for k in range(of_P + 1):
        for more in range(degree - of_P + 1):
            weight = comb(of_P, k) * comb(degree - of_P, more) / comb(degree, k + more)
            F[k + more] += weight * P_i[k]
        for i, j in product(range(of_A + 1), repeat=2):
            weight = comb(of_P, k) * comb(of_A, i) * comb(of_A, j) / comb(degree, i + j + k)
            F[i + j + k] -= weight * (A[i].mT @ P_j[k] @ A[j])
    return F


def in_its_units(F: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices `W' F W`, about 1, and what errors R of F become in them; as they are if a
    factor W is not found.

    Slow and fast states make F nearly singular in every other basis, and errors of its entries
    would count as if they were in the direction in which it is least. R holds BOUNDS_OF_DOUBLES
    times the rounding of products whose terms are no smaller than F, and so that of `W' F W` as
    well.
    """
    diagonal = np.diagonal(F, axis1=-2, axis2=-1)
    if not (np.isfinite(F).all() and (diagonal > LEAST_POSITIVE_ENTRY).all()):
        return F, R
    units = 1 / np.sqrt(diagonal)
    about_1 = F * units[..., None, :] * units[..., :, None]
    try:
        L = np.linalg.cholesky(about_1)
        W = units[..., None] * np.linalg.inv(L).mT
    except np.linalg.LinAlgError:
        return F, R
    size = np.abs(W)
    return W.mT @ F @ W, size.mT @ R @ size


def shrink_on_average(norms: Norms, weight: np.ndarray, E: np.ndarray, dE: np.ndarray) -> bool:
    """Return whether all matrices within dE of `I + E` are proved to shrink on average in the
    norms, on a Markov chain.

    weight: the probability of each edge of the norms' graph, with a few roundings. E, dE:
    `(symbols, n, n)`.

    It is so if the probabilities of the edges from each node have the sum 1, each P_i is positive
    definite, and so is `F_i = P_i - sum w A' P_j A`, the sum over the edges from i. F is linear in
    w, and `A' P_j A` convex in A: if F is definite at the points of a hull of either, by the same
    norms, it is so in all of the hull.
    """
    P = norms.P
    graph = norms.graph
    n = P.shape[-1]
    if not (_symmetric(P) and definite(P, np.zeros_like(P)) and are_chances(weight, graph)):
        return False
    root = _root(weight)
    whole = np.eye(n) + E
    size_of_whole = np.abs(whole)
    A = root * whole[graph.symbol]
    size = root * size_of_whole[graph.symbol]
    dA = root * (dE + UNIT_ROUNDING * size_of_whole)[graph.symbol]
    P_j = P[graph.target]
    size_of_P_j = np.abs(P)[graph.target]
    # "Messages": `P_i - sum w A' P_j A`, the sum over the edges from i.
    F = P.copy()
    np.subtract.at(F, graph.source, A.mT @ P_j @ A)
    # Its errors: those of the entries of A, and rounding of all terms.
    across = size.mT @ size_of_P_j
    of_entries = np.zeros_like(P)
    np.add.at(of_entries, graph.source, dA.mT @ size_of_P_j @ (size + dA) + across @ dA)
    terms = np.abs(P)
    np.add.at(terms, graph.source, across @ size)
    count = np.bincount(graph.source).max()
    of_rounding = UNIT_ROUNDING * (2 * n + 8 + count) * terms
    # "Messages": the same file checks them.
    return definite(F, BOUNDS_OF_DOUBLES * (of_entries + of_rounding))


class Slack(NamedTuple):
    """What the slack `G(s)` of forms over a box consists of, on each edge.

    With weights it is at each node in place of an edge. terms: `(monomials, edges, n, n)`;
    errors, higher: bounds `(edges,)` on the norm of all errors, and on that of the terms of
    degree three or more.
    """

    terms: np.ndarray
    errors: np.ndarray
    higher: np.ndarray


def shrink_over(
    forms: Polynomials,
    graph: Graph,
    A: Polynomials,
    follows: np.ndarray | None,
    weight: np.ndarray | None = None,
) -> tuple[bool, Slack]:
    """Return whether all matrices of a box are proved to shrink in forms of that box, in every
    order that is allowed; and what the slack consists of.

    forms: `P_i(s)` at each node, symmetric, exact; A: the matrix of each symbol. Both for s from -1
    to 1 in each number, which are constant in time. weight: the probability of each edge, if they
    have to shrink on average, see `shrink_on_average`; follows then is of no account.

    It is so if the graph is complete, P_i(0) is positive definite, and `F(s) = P_i(s) - A(s)'
    P_j(s) A(s)` is so on each edge for every s: on the way from 0 to s no form can be the first to
    become singular, since it exceeds `A' P_j A`. F is definite if `G = W' F W` is, whatever W. The
    terms of G of degree two or less are a convex combination of Bernstein's control points, each of
    which has to exceed the norms of all other terms and errors. On average the same holds for the
    sums over the edges from each node.
    """
    P = forms.terms
    slack = _slack_over(forms, graph, A, weight)
    if weight is None:
        allowed = follows is not None and graph.is_complete(follows)
    else:
        allowed = are_chances(weight, graph)
    # "Unknown numbers": P(0) > 0, so that no form can be the first to become singular.
    if not (allowed and _symmetric(P) and definite(P[0], np.zeros_like(P[0]))):
        return False, slack
    return bool(_exceeds_each(slack, A.numbers).all()), slack


def outside_each(forms: Polynomials, A: Polynomials, pieces: int = 1) -> tuple[np.ndarray, Slack]:
    """Return for each of some products of so many matrices how many of its eigenvalues the forms of
    its pieces prove to be outside the unit circle all over its box, -1 if they prove nothing; and what
    the slack of each piece consists of.

    forms, A: of each piece, `(cells pieces, n, n)`, in their order, the first one after the last.

    If `F_j(s) = P_j(s) - A_j(s)' P_(j+1)(s) A_j(s)` is positive definite for every s and j, then so is
    `P_j - B' P_j B` with the product B that begins with piece j. So no eigenvalue is on the circle,
    P_j(s) is regular, and as many are outside as P_j(s) has negative eigenvalues, which are as many as
    P_j(0) has (A. Ostrowski, H. Schneider, J. Math. Anal. Appl. 4, 72-84, 1962). P_j(0) has so many if
    it is negative definite on that many states, and positive definite on all others; one j is enough.
    """
    index = np.arange(len(A.rest)).reshape(-1, pieces)
    graph = Graph(index.ravel(), index.ravel(), np.roll(index, -1, 1).ravel())
    slack = _slack_over(forms, graph, A, None)
    P = forms.terms
    side = np.where(np.diagonal(P[0], axis1=-2, axis2=-1) < 0, -1.0, 1.0)
    alike = side[:, :, None] == side[:, None, :]
    on_each_side = np.where(alike, side[:, :, None] * P[0], 0.0)
    counted = definite_each(on_each_side, np.zeros_like(on_each_side))
    count = np.where(counted, (side < 0).sum(-1), -1).reshape(index.shape).max(1)
    exceeds = (np.isfinite(P) & (P.mT == P)).all((0, -1, -2)) & _exceeds_each(slack, A.numbers)
    return np.where(exceeds.reshape(index.shape).all(1), count, -1), slack


def _exceeds_each(slack: Slack, numbers: int) -> np.ndarray:
    """Whether the slack on each edge is positive definite in all of a box."""
    # "Unknown numbers": terms up to degree two are a convex combination of control points.
    low = slack.terms[: len(monomials(numbers, 2)[0])]
    control = np.tensordot(_control(numbers), low, (1, 0))
    rounding = 4 * len(low) * UNIT_ROUNDING * np.abs(low).sum(0)
    # "Unknown numbers": each exceeds all other terms and all errors, with rounding taken off.
    off = slack.errors + slack.higher
    return np.all(definite_each(control, np.broadcast_to(rounding, control.shape), off), 0)


def _slack_over(
    forms: Polynomials, graph: Graph, A: Polynomials, weight: np.ndarray | None
) -> Slack:
    """The slack `G = W' F W` of each edge from i to j, `F = P_i - A' P_j A`, or on average of each node i,
    `F = P_i - sum weight A' P_j A` over its edges; W is the same over the box, and such that G in its
    middle is about 1 where F is positive definite there. Elsewhere bounds are infinite.
    """
    n = A.terms.shape[-1]
    P_j = forms.of(graph.target)
    moved = A.of(graph.symbol)
    if weight is None:
        P_i = forms.of(graph.source)
        place = np.arange(graph.source.size)  # of each edge among the F
        added = 0
    else:
        P_i = forms
        place = graph.source
        added = np.bincount(graph.source).max()
        root = _root(weight)
        rest = root * moved.rest + 2 * UNIT_ROUNDING * root * np.abs(moved.terms).sum(0)
        moved = Polynomials(root * moved.terms, rest, A.numbers, A.order)

    def summed(of_edges: np.ndarray) -> np.ndarray:
        """On average: the sum over the edges from each node."""
        if weight is None:
            return of_edges
        of_nodes = np.zeros((*of_edges.shape[:-3], graph.nodes, n, n))
        at_nodes: Any = (..., place, slice(None), slice(None))  # which numpy's types do not know
        np.add.at(of_nodes, at_nodes, of_edges)
        return of_nodes

    # "Unknown numbers": `W' F(0) W` is near 1.
    A_0 = moved.terms[0]
    F_0 = P_i.terms[0] - summed(A_0.mT @ P_j.terms[0] @ A_0)
    roots = cholesky_of_each(F_0)
    unbounded = ~np.isfinite(roots).all((-1, -2))
    roots[unbounded] = np.eye(n)
    W = np.linalg.inv(roots).mT
    size = np.abs(W)
    # "Unknown numbers": `W' F(s) W`, multiplied out with B = A W.
    rounding = 2 * n * UNIT_ROUNDING * (np.abs(moved.terms).sum(0) @ size[place])
    rest = moved.rest @ size[place] + rounding
    B = Polynomials(moved.terms @ W[place], rest, A.numbers, A.order)
    B_transposed = Polynomials(B.terms.mT, B.rest.mT, A.numbers, A.order)
    after = B_transposed @ (P_j @ B)
    terms = W.mT @ P_i.terms @ W - summed(after.terms)
    terms = (terms + terms.mT) / 2
    # Its errors: what the models leave out, and rounding of all terms.
    size_of_first = size.mT @ np.abs(P_i.terms).sum(0) @ size
    size_of_terms = size_of_first + summed(np.abs(after.terms).sum(0))
    errors = summed(after.rest) + (4 * n + added) * UNIT_ROUNDING * size_of_terms
    higher = terms[len(monomials(A.numbers, 2)[0]) :]
    bounds = np.where(unbounded, np.inf, OWN_ROUNDING * norm_bound(errors))
    return Slack(terms, bounds, OWN_ROUNDING * norm_bound(higher).sum(0))


def cholesky_of_each(F: np.ndarray) -> np.ndarray:
    """Return the Cholesky factors of matrices `(..., n, n)`, NaN for those that are not positive
    definite."""
    try:
        return np.linalg.cholesky(F)
    except np.linalg.LinAlgError:
        if F.ndim == 2:
            return np.full_like(F, np.nan)
    # Where some fail, all others at once; eigenvalues say of nearly all that do.
    n = F.shape[-1]
    likely = np.linalg.eigvalsh(F)[..., :1, None] > 0
    try:
        return np.where(likely, np.linalg.cholesky(np.where(likely, F, np.eye(n))), np.nan)
    except np.linalg.LinAlgError:
        factors = [cholesky_of_each(matrix) for matrix in F.reshape(-1, n, n)]
        return np.array(factors).reshape(F.shape)


def definite(F: np.ndarray, R: np.ndarray, off: np.ndarray | float = 0.0) -> bool:
    """Return whether all symmetric matrices within R of F, entry by entry, and within a norm `off`,
    are positive definite."""
    bounded, less = _less_errors(F, R, off)
    try:
        np.linalg.cholesky(less)
    except np.linalg.LinAlgError:
        return False
    return bool(bounded.all())


def definite_each(F: np.ndarray, R: np.ndarray, off: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the same of each matrix `(..., n, n)`."""
    bounded, less = _less_errors(F, R, off)
    return bounded & np.isfinite(cholesky_of_each(less)).all((-1, -2))


def _less_errors(
    F: np.ndarray, R: np.ndarray, off: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Which matrices have bounds and a positive diagonal, and what is left of them, in units of the
    states, powers of 2, that make their diagonal about 1.

    F is positive definite if the Cholesky decomposition of `F - (|R| + c) I` runs to its end. Here
    `|R|` is the largest sum of a row, and c is what rounding may do to the decomposition itself (S.
    M. Rump, Verification of positive definiteness, BIT 46, 2006, Theorem 2.3).
    """
    n = F.shape[-1]
    diagonal = np.diagonal(F, axis1=-2, axis2=-1)
    bounded = (np.isfinite(F) & np.isfinite(R)).all((-1, -2)) & np.isfinite(off)
    bounded &= (diagonal > LEAST_POSITIVE_ENTRY).all(-1)
    F = np.where(bounded[..., None, None], (F + F.mT) / 2, np.eye(n))
    R = np.where(bounded[..., None, None], (R + R.mT) / 2, 0.0)
    units = np.exp2(-np.round(np.log2(np.diagonal(F, axis1=-2, axis2=-1)) / 2))
    F = F * units[..., None, :] * units[..., :, None]
    R = R * units[..., None, :] * units[..., :, None]
    c = BOUNDS_OF_DOUBLES * (n + 2) * UNIT_ROUNDING * np.trace(F, axis1=-2, axis2=-1)
    size_of_R = BOUNDS_OF_DOUBLES / 2 * R.sum(-1).max(-1)
    less = size_of_R + c + np.where(bounded, off, 0.0) * units.max(-1) ** 2
    return bounded, F - less[..., None, None] * np.eye(n)


def _root(weight: np.ndarray) -> np.ndarray:
    """The roots of probabilities, or more, as factors of matrices."""
    return np.sqrt(weight * (1 + WEIGHED) + 16 * UNIT_ROUNDING)[:, None, None]


def are_chances(weight: np.ndarray, graph: Graph) -> bool:
    """Return whether the edges from each node have probabilities of the sum 1."""
    whole = np.bincount(graph.source, weight, graph.nodes)
    return bool((weight >= 0).all() and (np.abs(whole - 1) <= WEIGHED).all())


def _symmetric(P: np.ndarray) -> bool:
    return bool(np.isfinite(P).all() and (P.mT == P).all())


def norm_bound(X: np.ndarray) -> np.ndarray:
    """An upper bound on the largest singular value."""
    size = np.abs(X)
    return np.sqrt(size.sum(-1).max(-1) * size.sum(-2).max(-1))


@lru_cache(maxsize=8)
def _control(numbers: int) -> np.ndarray:
    """The weights of the monomials up to degree two in each of Bernstein's control points, three
    for each number."""
    weights = np.array([[1, 1, 1], [-1, 0, 1], [1, -1, 1]], float)  # of 1, s and s^2 at each
    exponents = monomials(numbers, 2)[0]
    control = []
    for point in product(range(3), repeat=numbers):
        control.append([np.prod(weights[chosen, list(point)]) for chosen in exponents])
    return np.array(control)
