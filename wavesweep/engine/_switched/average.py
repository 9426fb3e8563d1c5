"""Boxes of unknown numbers while what varies is at random: forms that decay on average in a part of
a box.

They are the solution of a linear equation in the middle of the part, `P_i - sum w A' P_j A = Q`,
and their slopes along each number follow from its derivative. `norm_check` proves what is found
here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine._sets.taylor_models import Polynomials
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.mean_square import SIZING, operator_of
from wavesweep.engine._switched.norm_check import cholesky_of_each
from wavesweep.engine._switched.norms import CALLS, Centre, packed, unpacked
from wavesweep.engine.doubles import BY_TWO

ALONE = Graph.least(np.ones((1, 1), bool))  # the graph of a single matrix
CONVERGED = 1e-10  # entry of a power, below which it counts for nothing: it is squared in a sum


@dataclass(frozen=True, slots=True, eq=False)
class OnAverage:
    """What frames do at random: the graph of the chain, and the probability of each edge."""

    graph: Graph
    weight: np.ndarray


ALWAYS = OnAverage(ALONE, np.ones(1))  # one matrix, whose powers decay


def _even_forms(powers: list[np.ndarray]) -> np.ndarray:
    """Return P with `P - A' P A = Q`, `(cells, n, n)`, for the diagonal Q with which P and the moments
    `M - A M A' = Q^-1` have alike diagonals. powers: of A, `(cells, n, n)` each, see `_powers`."""
    n = powers[0].shape[-1]
    identity = np.eye(n)
    back = [power.mT for power in powers]
    size = np.ones((len(powers[0]), n))
    P = _summed(powers, identity)
    for _ in range(SIZING):
        moments = _summed(back, size[..., None] ** 2 * identity)
        size = (_diagonal(moments) / _diagonal(P)) ** 0.25
        P = _summed(powers, size[..., None] ** -2.0 * identity)
    return P


def forms_of_each(A: Polynomials) -> tuple[list[tuple[Centre, np.ndarray] | None], float]:
    """Return for each of some single matrices, `(cells, n, n)`, a form for the middle of its cell
    and its further terms `(monomials - 1, 1, n, n)`, None if it does not decay there; and the work
    for each.

    They are the Taylor series of `P - A' P A = Q`, with Q in units of the states in which P and the
    moments that follow Q are alike in the middle. So the slack is Q but for terms of a higher order
    than that of A.
    """
    cells, n = A.rest.shape[:2]
    degree = A.exponents.sum(1)
    work = BY_TWO * (2 + SIZING + len(degree)) * n**3 + CALLS
    forms_of_cells: list[tuple[Centre, np.ndarray] | None] = [None] * cells
    decaying, powers = _powers(A.terms[0])
    if not decaying.size:
        return forms_of_cells, work
    with np.errstate(all="ignore"):
        P = _even_forms(powers)
        to = cholesky_of_each(P).mT
        basis = np.linalg.inv(to)
        after = to @ A.terms[:, decaying] @ basis
        powers = [to @ power @ basis for power in powers]
        forms = np.zeros_like(after)  # P
        moved = np.zeros_like(after)  # P A
        forms[0] = basis.mT @ P @ basis
        forms[0] = (forms[0] + forms[0].mT) / 2
        moved[0] = forms[0] @ after[0]
        for order in range(1, A.order + 1):
            here = degree == order
            A.multiply_degree(moved, forms, after, A.numbers, A.order, order)
            A.multiply_degree(forms, after.mT, moved, A.numbers, A.order, order)
            forms[here] = _summed(powers, forms[here])
            moved[here] += forms[here] @ after[0]
    for index, cell in enumerate(decaying.tolist()):
        series = forms[:, index : index + 1]
        if np.isfinite(series).all():
            forms_of_cells[cell] = Centre(series[0], ALONE, basis[index], to[index]), series[1:]
    return forms_of_cells, work


def _powers(M: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
    """Which of some matrices `(cells, n, n)` have powers that vanish, as indices, and of these `M^1, M^2,
    M^4, ...`, until all of them have vanished or overflown."""
    powers = []
    with np.errstate(all="ignore"):
        for _ in range(BY_TWO):
            powers.append(M)
            size = np.abs(M).max((-1, -2), initial=0.0)
            if not ((size >= CONVERGED) & np.isfinite(size)).any():
                break
            M = M @ M
    decaying = np.flatnonzero(size < CONVERGED)
    return decaying, [power[decaying] for power in powers]


def _summed(powers: Sequence[np.ndarray], Q: np.ndarray) -> np.ndarray:
    """`sum_k M'^k Q M^k`, which solves `P - M' P M = Q`. powers: of M, see `_powers`."""
    total = Q
    for power in powers:
        total = total + power.mT @ total @ power
    return (total + total.mT) / 2


def _diagonal(X: np.ndarray) -> np.ndarray:
    return np.diagonal(X, axis1=-2, axis2=-1)


def forms_on_average(
    A: Polynomials, graph: Graph, weight: np.ndarray
) -> tuple[tuple[Centre, np.ndarray] | None, float]:
    """Return forms for the middle of a box and their slopes, None if moments do not decay there;
    and the work.

    Errors: LinAlgError if a matrix is singular to rounding.
    """
    from scipy.linalg import lu_factor, lu_solve

    middle = A.terms[0]
    slopes = A.terms[1 : 1 + A.numbers]
    n = A.terms.shape[-1]
    operator = operator_of(middle, graph, weight)
    lu = lu_factor(np.eye(len(operator)) - operator)
    work = len(operator) ** 3 + CALLS
    size = np.ones(n)

    def solved(right: np.ndarray, *, forms: bool) -> np.ndarray:
        return unpacked(
            lu_solve(lu, packed(right).ravel(), trans=int(forms)).reshape(graph.nodes, -1), n
        )

    def alike(diagonal: np.ndarray) -> np.ndarray:
        return np.broadcast_to(np.diag(diagonal), (graph.nodes, n, n))

    P = solved(alike(size), forms=True)
    for _ in range(SIZING):
        moments = solved(alike(size**2), forms=False)
        with np.errstate(invalid="ignore"):  # negative where moments do not decay
            size = (np.diagonal(moments.sum(0)) / np.diagonal(P.sum(0))) ** 0.25
        if not np.isfinite(size).all():
            return None, work
        P = solved(alike(size**-2.0), forms=True)
    if not (np.linalg.eigvalsh(P) > 0).all():
        return None, work
    last = P[graph.target]
    moved = middle[graph.symbol]
    changes = []
    for slope in slopes:
        changed = slope[graph.symbol].mT @ last @ moved  # A_k' P_j A
        half = weight[:, None, None] * changed
        right = np.zeros_like(P)
        np.add.at(right, graph.source, half + half.mT)
        changes.append(solved(right, forms=True))
    to = np.linalg.cholesky(P.mean(0)).mT
    basis = np.linalg.inv(to)
    P, *changes = (basis.T @ moment @ basis for moment in (P, *changes))
    centre = Centre((P + P.mT) / 2, graph, basis, to)
    return (centre, np.array(changes).reshape(A.numbers, *P.shape)), work
