"""The search for quadratic norms in which every frame shrinks, on a graph that is refined until
there are such norms.

The norm at node i is `x -> sqrt(x' P_i x)`. If the graph is complete, and `P_i - A' P_j A` is
positive definite for every edge from i to j by the matrix A, then every allowed product of matrices
decays (A. A. Ahmadi, R. M. Jungers, P. A. Parrilo, M. Roozbehani, Joint spectral radius and
path-complete graph Lyapunov functions, SIAM J. Control Optim. 52, 2014). The norms are found by an
interior-point method: the minimum of the barrier `-sum log det (P_i - A' P_j A) + sum tr P_i` is
followed while the matrices grow from a small multiple to their size. `norm_check` proves what is
found here.

Graphs in which a node stands for the last 0, 1 or 2 frames, with a general solver (Clarabel), were
tried in place of this. They need 324 nodes where eighteen lengths of frames need 8 here.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.norm_check import Norms

STEP_SHARE = 0.8  # part of the way to where the prediction fails that is taken
CENTRED_DECREMENT = 0.6  # Newton decrement below which a point counts as the centre
NEAR_START = 1e-3  # by which the matrices are made smaller first, where known forms do not do
LEAST_SCALE = 0.1  # known forms are of no use if the matrices must be scaled below this
LEAST_FORM = 1e-3  # what Lyapunov functions lose at a place, in units in which states are about 1
NARROW = 3  # nodes times more than are next to each other in a ring whose Hessian has a narrow band
CALLS = 3e6  # operations that take as long as the overhead of a Newton step
OPERATIONS_OF_SEARCH = 2e11  # operations in Newton steps after which a search ends: about 20 s


@dataclass(frozen=True, slots=True, eq=False)
class Centre:
    """Forms P `(nodes, n, n)` on a graph, for states z with x = basis z, and the operations
    spent on them."""

    P: np.ndarray
    graph: Graph
    basis: np.ndarray
    inverse: np.ndarray
    work: float = 0.0

    @property
    def norms(self) -> Norms:
        """The norms for the states x."""
        P = self.inverse.mT @ self.P @ self.inverse
        return Norms((P + P.mT) / 2, self.graph)

    def in_basis(self, A: np.ndarray) -> np.ndarray:
        """Return matrices for the states z."""
        return self.inverse @ A @ self.basis

    def shrinks(self, A: np.ndarray) -> bool:
        """Return whether the matrices A of x shrink on every edge, in doubles."""
        return _shrinks(self.P, self.in_basis(A), self.graph)

    def rounded(self) -> "Centre":
        """Return the same forms in a basis in which their mean is a multiple of the identity."""
        to = np.linalg.cholesky(self.P.sum(0) / self.graph.source.size).mT
        back = np.linalg.inv(to)
        P = back.mT @ self.P @ back
        return replace(self, P=(P + P.mT) / 2, basis=self.basis @ back, inverse=to @ self.inverse)

    def sloped(self, terms: np.ndarray) -> tuple["Centre", np.ndarray]:
        """Return forms after a Newton step, and their slopes along some numbers, `(numbers, nodes, n,
        n)`, from the same equations.

        terms: the matrices, and their slopes along each number, `(1 + numbers, symbols, n, n)`, of x.
        """
        A, *changes = (self.in_basis(term) for term in terms)
        newton = _Newton.of(self.P, A, self.graph)
        small = 1e-4
        slopes = []
        for change in changes:
            moved, _ = _gradient(self.P, A + small * change, self.graph)
            slopes.append(newton.solved(-(moved - newton.gradient) / small))
        P = _nearer(self, newton, A)
        work = newton.work * (1 + len(changes) / 4)
        return replace(self, P=P, work=work), np.array(slopes).reshape(len(changes), *P.shape)


def rough_basis(A: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a basis in which matrices A `(symbols, n, n)` are small, and its inverse."""
    n = A.shape[-1]
    P = np.eye(n)
    for _ in range(100):
        P = 1e-3 * np.eye(n) + (A.mT @ P @ A).mean(0)
        P /= np.trace(P) / n
    to = np.linalg.cholesky(P).mT
    return np.linalg.inv(to), to


def units_of_places(A: np.ndarray, place: np.ndarray) -> np.ndarray | None:
    """Return units at the places of a ring, `z = to x`, `(places, n, n)`, in which the Lyapunov
    functions of the means of the matrices A of each place are about 1; None if the means are not
    stable.

    place: of each matrix, 0, 1, ...; the next one follows, and the first the last.
    """
    identity = np.eye(A.shape[-1])
    places = 1 + place.max()
    P = np.broadcast_to(identity, (places, *identity.shape)).copy()
    for _ in range(60):  # as `rough_basis`, at each place
        for index in range(places - 1, -1, -1):
            at_place = A[place == index]
            P[index] = LEAST_FORM * identity + (
                at_place.mT @ P[(index + 1) % places] @ at_place
            ).mean(0)
        P = P / np.trace(P.mean(0)) * len(identity)
    rough = np.linalg.cholesky(P).mT
    means = means_of_places(A, place)
    forms = periodic_forms(np.roll(rough, -1, 0) @ means @ np.linalg.inv(rough))
    return forms if forms is None else np.linalg.cholesky(forms).mT @ rough


def means_of_places(A: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Return the mean of the matrices of each place."""
    return np.array([A[place == index].mean(0) for index in range(1 + place.max())])


def periodic_forms(A: np.ndarray) -> np.ndarray | None:
    """Return forms that each of some matrices in a row lowers, `P_i = e + A_i' P_{i+1} A_i`; None if the
    loop is not stable."""
    from scipy.linalg import solve_discrete_lyapunov

    identity = np.eye(A.shape[-1])
    whole = identity
    lost = np.zeros_like(identity)
    for matrix in A:
        lost = lost + LEAST_FORM * whole.T @ whole
        whole = matrix @ whole
    if not np.isfinite(whole).all() or np.abs(np.linalg.eigvals(whole)).max() >= 1:
        return None
    P = solve_discrete_lyapunov(whole.T, lost)
    forms = []
    for matrix in A[::-1]:
        P = LEAST_FORM * identity + matrix.T @ P @ matrix
        forms.append((P + P.T) / 2)
    return np.array(forms[::-1])


def first_centre(A: np.ndarray, follows: np.ndarray) -> tuple[Centre, float]:
    """Return a form for matrices A `(symbols, n, n)`, the same at each node of the least graph,
    and a factor: in this form the matrices times the factor shrink."""
    graph = Graph.least(follows)
    n = A.shape[-1]
    centre = Centre(np.broadcast_to(np.eye(n), (graph.nodes, n, n)), graph, *rough_basis(A))
    largest = np.linalg.norm(centre.in_basis(A), 2, axis=(-2, -1)).max()
    return centre, 0.5 / max(largest, 0.5)


def find_norms(
    A: np.ndarray,
    follows: np.ndarray,
    start: Centre | None = None,
    work: float = OPERATIONS_OF_SEARCH,
    enough: float = 1.0,
) -> tuple[Centre, float]:
    """Search for forms in which the matrices A `(symbols, n, n)` shrink. Return the forms and a
    factor: 1 if they were found, otherwise the largest factor below 1 for which the scaled matrices
    shrink.

    The matrices grow from a small multiple of themselves; when the growth stalls below the factor
    `enough`, nodes of the graph are split. start: forms to begin with, such as those of similar
    matrices; if a step from these is singular to rounding, the search begins again without them.
    work: operations after which the search ends.
    """
    centre, factor, singular = _grown(A, follows, *_started(A, follows, start), work, enough)
    if singular and start and factor < 1:
        work_left = work - centre.work
        centre, factor, _ = _grown(A, follows, *first_centre(A, follows), work_left, enough)
    return centre, factor


def _grown(
    A: np.ndarray, follows: np.ndarray, centre: Centre, factor: float, work: float, enough: float
) -> tuple[Centre, float, bool]:
    """The forms and the factor that a search ends with, and whether it ended at a step that is
    singular to rounding."""
    # Newton's steps from the forms that a search begins with.
    centre = recentred(centre, factor * A, 8)
    try:
        while factor < 1 and centre.work < work:
            before = factor
            centre, factor = advanced(centre, lambda t: t * A, factor, 1.0)
            centre = centre.rounded()
            # Nodes are split if a step gains less than this, absolutely and relative to the rest.
            stalled = factor - before < min(2e-3, 0.2 * (1 - factor))
            if factor < 1 and stalled:
                if factor >= enough:
                    break
                split = finer(centre, factor * A, follows)
                if split is None:
                    break
                centre = split
        if factor == 1:
            # The matrices are made to shrink by 1e-3 more than necessary.
            beyond, _ = advanced(centre, lambda t: t * A, 1.0, 1 + 1e-3)
            beyond = beyond.rounded()
            if beyond.shrinks(A):
                centre = beyond
    except np.linalg.LinAlgError:
        return centre, factor, True
    return centre, factor, False


def _started(A: np.ndarray, follows: np.ndarray, start: Centre | None) -> tuple[Centre, float]:
    """The forms that a search begins with, and its factor: `start`, unless there is none or it
    is too far from the matrices."""
    if start is None:
        return first_centre(A, follows)
    lacking = 0.0
    while lacking < 1 - LEAST_SCALE and not start.shrinks((1 - lacking) * A):
        lacking = max(2 * lacking, NEAR_START)
    if lacking >= 1 - LEAST_SCALE:
        return first_centre(A, follows)
    # A little further from where they only just shrink.
    factor = 1 - 1.2 * lacking
    return replace(start, work=0.0), factor


def recentred(centre: Centre, A: np.ndarray, steps: int = 4) -> Centre:
    """Return forms near the centre of all forms in which the matrices A of x shrink, by some
    Newton steps."""
    P = centre.P
    seen = centre.in_basis(A)
    work = centre.work
    for _ in range(steps):
        try:
            newton = _Newton.of(P, seen, centre.graph)
        except np.linalg.LinAlgError:  # singular to rounding
            break
        step = newton.solved(-newton.gradient)
        work += newton.work
        decrement = np.sqrt(max(0.0, -newton.gradient @ packed(step).ravel()))
        length = 1.0
        least = 0.1 / (1 + decrement)
        while not _shrinks(P + length * step, seen, centre.graph) and length > least:
            length *= 0.7
        if length < 1:
            length *= STEP_SHARE
        if not _shrinks(P + length * step, seen, centre.graph):  # rounding leaves no room
            break
        P = P + length * step
        if decrement < CENTRED_DECREMENT:
            break
    return replace(centre, P=P, work=work)


def advanced(
    centre: Centre, matrices: Callable[[float], np.ndarray], x: float, target: float
) -> tuple[Centre, float]:
    """Return forms for a number closer to the target, and that number: a step along the tangent of
    the centres, then Newton steps.

    centre: forms for the number x. matrices: the matrices of a number.
    """
    graph = centre.graph
    A = centre.in_basis(matrices(x))
    newton = _Newton.of(centre.P, A, graph)
    small = 1e-6 * (target - x)
    next_gradient, _ = _gradient(centre.P, centre.in_basis(matrices(x + small)), graph)
    tangent = newton.solved(-(next_gradient - newton.gradient) / small)
    P = _nearer(centre, newton, A)

    def holds(step: float) -> bool:
        return _shrinks(P + step * tangent, centre.in_basis(matrices(x + step)), graph)

    step = target - x
    if holds(step):
        reached = target
    else:
        longest = _longest(holds, step)
        if not longest:
            return replace(centre, work=centre.work + newton.work), x
        step = STEP_SHARE * longest
        reached = x + step
    centre = replace(centre, P=P + step * tangent, work=centre.work + newton.work)
    return recentred(centre, matrices(reached)), reached


def _nearer(centre: Centre, newton: "_Newton", A: np.ndarray) -> np.ndarray:
    """The forms after a Newton step, if the matrices A of z shrink in them; or else those
    before."""
    P = centre.P + newton.solved(-newton.gradient)
    if _shrinks(P, A, centre.graph):
        return P
    return centre.P


def finer(centre: Centre, A: np.ndarray, follows: np.ndarray) -> Centre | None:
    """Return forms on a graph with some nodes split in two; None if no node can be split.

    centre: forms in which the matrices A of x shrink. The inverse slacks of the edges weight the
    sequences for which the forms are worst. Nodes are split where very different sequences meet,
    along the principal component of their differences.
    """
    graph = centre.graph
    _, edge_terms = _gradient(centre.P, centre.in_basis(A), graph)
    leaving = np.zeros_like(centre.P)
    np.add.at(leaving, graph.source, edge_terms.inverse)
    scores = []
    parts = []
    for node in range(graph.nodes):
        edges = np.flatnonzero(graph.target == node)
        if edges.size < 2:
            continue
        scale = np.linalg.inv(np.linalg.cholesky(leaving[node]))
        flows = scale @ edge_terms.arriving[edges] @ scale.mT
        weight = np.trace(flows, axis1=-2, axis2=-1)
        mean = flows.sum(0) / weight.sum()
        apart = packed(flows / weight[:, None, None] - mean)
        values, vectors = np.linalg.eigh((apart * weight[:, None]).T @ apart)
        late = apart @ vectors[:, -1] > 0
        if late.any() and not late.all():
            share = values[-1] / weight.sum()
            scores.append(share * np.trace(leaving[node] @ centre.P[node]))
            parts.append((node, edges[late]))
    if not scores:
        return None
    chosen = {}
    for (node, late_edges), score in zip(parts, scores, strict=True):
        # Nodes whose score is at least half of the largest are split.
        if score >= 0.5 * max(scores):
            chosen[node] = late_edges
    graph, origin = graph.split(chosen, follows)
    return recentred(replace(centre, graph=graph, P=centre.P[origin]), A, 6)


def _longest(holds: Callable[[float], bool], step: float) -> float:
    """The longest part of a step that holds, by five bisections; 0 if less than 1e-7 of it does."""
    shortest = 1e-7 * abs(step)
    while not holds(step):
        step /= 4
        if abs(step) < shortest:
            return 0.0
    low = step
    high = 4 * step
    for _ in range(5):
        middle = (low + high) / 2
        if holds(middle):
            low = middle
        else:
            high = middle
    return low


def _shrinks(P: np.ndarray, A: np.ndarray, graph: Graph) -> bool:
    try:
        np.linalg.cholesky(_slack(P, A[graph.symbol], graph))
    except np.linalg.LinAlgError:
        return False
    return True


def _slack(P: np.ndarray, A: np.ndarray, graph: Graph) -> np.ndarray:
    return P[graph.source] - A.mT @ P[graph.target] @ A


class _EdgeTerms(NamedTuple):
    """Of each edge the inverse slack F^-1, A F^-1 and A F^-1 A'."""

    inverse: np.ndarray
    moved: np.ndarray
    arriving: np.ndarray


def _gradient(P: np.ndarray, A: np.ndarray, graph: Graph) -> tuple[np.ndarray, _EdgeTerms]:
    """The gradient of the barrier, and the terms of each edge that it consists of."""
    A = A[graph.symbol]
    inverse = np.linalg.inv(_slack(P, A, graph))
    inverse = (inverse + inverse.mT) / 2
    moved = A @ inverse
    arriving = moved @ A.mT
    total = np.zeros_like(P) + np.eye(P.shape[-1])
    np.add.at(total, graph.source, -inverse)
    np.add.at(total, graph.target, arriving)
    return packed(total).ravel(), _EdgeTerms(inverse, moved, arriving)


@dataclass(frozen=True, slots=True, eq=False)
class _Newton:
    """The gradient of the barrier, and its Hessian as a Cholesky factor.

    If the graph is a long ring, as one of ticks is, the Hessian has a narrow band in the order of
    the nodes in which those that edges join are near. order: of the unknowns then, or None. band:
    entries of the factor below its diagonal.
    """

    gradient: np.ndarray
    factor: np.ndarray
    order: np.ndarray | None
    band: int
    shape: tuple[int, int]

    @staticmethod
    def of(P: np.ndarray, A: np.ndarray, graph: Graph) -> "_Newton":
        from scipy.linalg import cho_factor, cholesky_banded

        nodes, n, _ = P.shape
        gradient, edge_terms = _gradient(P, A, graph)
        unknowns = n * (n + 1) // 2
        nodes_in_order, apart = graph.along
        if NARROW * (apart + 1) > nodes:
            hessian = np.zeros((nodes, unknowns, nodes, unknowns))
            for first, last, parts in _hessian_parts(*edge_terms, graph, nodes):
                hessian[first, :, last] += parts
            hessian = hessian.reshape(nodes * unknowns, -1)
            factor, _ = cho_factor(hessian, lower=True, overwrite_a=True)
            return _Newton(gradient, factor, None, nodes * unknowns, (nodes, n))
        order = (nodes_in_order[:, None] * unknowns + np.arange(unknowns)).ravel()
        band = (apart + 1) * unknowns - 1
        place = np.empty_like(order)
        place[order] = np.arange(order.size)
        entries = np.zeros((band + 1, order.size))
        for first, last, parts in _hessian_parts(*edge_terms, graph, nodes):
            rows = place[first[:, None] * unknowns + np.arange(unknowns)][:, :, None]
            columns = place[last[:, None] * unknowns + np.arange(unknowns)][:, None]
            rows, columns = np.broadcast_arrays(rows, columns)
            below = rows >= columns
            entries[(rows - columns)[below], columns[below]] += parts[below]
        factor = cholesky_banded(entries, lower=True, overwrite_ab=True)
        return _Newton(gradient, factor, order, band, (nodes, n))

    @property
    def work(self) -> float:
        """Rough number of operations."""
        return self.gradient.size * min(self.band + 1, self.gradient.size) ** 2 / 3 + CALLS

    def solved(self, right: np.ndarray) -> np.ndarray:
        """The changes of the forms that solve the equations for a right side."""
        from scipy.linalg import cho_solve, cho_solve_banded

        nodes, n = self.shape
        if self.order is None:
            step = cho_solve((self.factor, True), right)
        else:
            step = np.empty_like(right)
            step[self.order] = cho_solve_banded((self.factor, True), right[self.order])
        return unpacked(step.reshape(nodes, -1), n)


def _hessian_parts(
    inverse: np.ndarray, moved: np.ndarray, arriving: np.ndarray, graph: Graph, nodes: int
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Yield the Hessian of `-sum log det F`, F = P_i - A' P_j A on each edge from node i to j, in the
    forms as vectors (`packed`): nodes of rows, nodes of columns, and blocks `(parts, m, m)`, which
    add up.

    Along dP it is the sum of `tr(G dF G dF)` with `G = F^-1` (inverse) and `dF = dP_i - A' dP_j A`.
    So the blocks are the maps `S -> G S G` at (i, i), `S -> (A G A') S (A G A')` (arriving) at (j, j)
    and `S -> -(A G)' S (A G)` (moved) at (i, j), and its transpose at (j, i).
    """
    n = inverse.shape[-1]
    nodes_in_order = np.arange(nodes)
    for end, terms in ((graph.source, inverse), (graph.target, arriving)):
        yield nodes_in_order, nodes_in_order, acting(_products(terms, *graph.grouped(end)), n)
    pairs, first, last = graph.pairs
    mixed = acting(_products(moved.mT, *graph.grouped(pairs)), n)
    yield first, last, -mixed  # each pair of nodes once
    yield last, first, -mixed.mT


@lru_cache(maxsize=64)
def _places(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    row, column = np.triu_indices(n)
    return row, column, np.where(row == column, 1.0, np.sqrt(2))


def packed(X: np.ndarray) -> np.ndarray:
    """Return symmetric matrices `(..., n, n)` as vectors with the same inner product."""
    row, column, weight = _places(X.shape[-1])
    return X[..., row, column] * weight


def unpacked(vectors: np.ndarray, n: int) -> np.ndarray:
    """Return the symmetric matrices of such vectors."""
    row, column, weight = _places(n)
    X = np.empty((*vectors.shape[:-1], n, n))
    X[..., row, column] = X[..., column, row] = vectors / weight
    return X


def _products(X: np.ndarray, order: np.ndarray, bounds: list[int]) -> np.ndarray:
    """The sums of `vec(X) vec(X)'` over groups of matrices, `(groups, n, n, n, n)`; see
    `Graph.grouped`."""
    n = X.shape[-1]
    vectors = X.reshape(-1, n * n)[order]
    sums = np.empty((len(bounds) - 1, n * n, n * n))
    for i in range(len(sums)):
        group = vectors[bounds[i] : bounds[i + 1]]
        np.matmul(group.T, group, out=sums[i])
    return sums


def acting(products: np.ndarray, n: int) -> np.ndarray:
    """Return the sums over groups of the maps `S -> X S X'` of symmetric matrices, as matrices
    for vectors of `packed`."""
    weight = _places(n)[2]
    factor = weight / np.sqrt(2)
    first, second = _crossed(n)
    flat = products.reshape(len(products), -1)
    acts = flat.take(first, axis=1)
    acts += flat.take(second, axis=1)
    acts *= factor[:, None] * factor
    return acts


@lru_cache(maxsize=64)
def _crossed(n: int) -> tuple[np.ndarray, np.ndarray]:
    """The places of X_ac X_bd and X_ad X_bc, for all pairs a <= b and c <= d."""
    row, column, _ = _places(n)
    a, b, c, d = row[:, None], column[:, None], row, column
    return ((a * n + c) * n + b) * n + d, ((a * n + d) * n + b) * n + c
