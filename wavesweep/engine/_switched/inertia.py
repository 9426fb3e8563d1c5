"""Forms of single matrices over cells: what they prove of the eigenvalues outside the unit circle."""

from typing import NamedTuple

import numpy as np

from wavesweep.engine._sets.taylor_models import Polynomials
from wavesweep.engine._switched.norm_check import norm_bound, outside_each

LEAST_INDEPENDENT = 1e10  # condition of eigenvectors from which on the states are the basis


class Inertia(NamedTuple):
    """What is known of some cells.

    outside: the number of eigenvalues outside, -1 where it is not known, `(cells,)`. moves: by how
    much each number moves the slack, `(cells, numbers)`. rest: which part of the slack is lost to
    what the matrices leave out, `(cells,)`. forms: their terms, `(monomials, cells, n, n)`, for
    states z with x = basis z, `(cells, n, n)`.
    """

    outside: np.ndarray
    moves: np.ndarray
    rest: np.ndarray
    forms: np.ndarray
    basis: np.ndarray


def inertia_of_cells(A: Polynomials) -> Inertia:
    """Return what forms prove of matrices `(cells, n, n)`.

    A form is the Taylor series, of the order of A, of the solution of `P - A' P A = I` in unit
    eigenvectors of the middle. So the slack is I but for terms of a higher order.
    """
    with np.errstate(all="ignore"):  # what overflows is not proved
        basis = _eigenvectors(A.terms[0])
        seen = A.similar(basis, np.linalg.inv(basis))
        P = _series(seen)
        forms = Polynomials(P, np.zeros(P.shape[1:]), A.numbers, A.order)
        outside, slack = outside_each(forms, seen)
        moves = norm_bound(slack.terms).T @ (
            1 - 0.5**A.exponents
        )  # what is gone if a side is halved
        size = norm_bound(np.abs(seen.terms).sum(0)) * norm_bound(np.abs(P).sum(0))
        return Inertia(outside, moves, 2 * size * norm_bound(seen.rest), P, basis)


def _eigenvectors(A: np.ndarray) -> np.ndarray:
    """Real and imaginary parts of the eigenvectors of matrices; the states where eigenvectors are
    nearly dependent."""
    values, vectors = np.linalg.eig(A)
    # of a pair, the first has the real part and the second the imaginary one
    imaginary = values.imag[:, None]
    basis = np.where(imaginary < 0, vectors.imag, vectors.real) * np.where(imaginary, 2**0.5, 1.0)
    dependent = ~(np.linalg.cond(basis) < LEAST_INDEPENDENT)
    basis[dependent] = np.eye(A.shape[-1])
    return basis


def _series(A: Polynomials) -> np.ndarray:
    """The terms of the series of P."""
    cells, n = A.rest.shape[:2]
    M = A.terms[0]
    kept = np.einsum("cki,clj->cijkl", M, M).reshape(cells, n * n, n * n)
    less = np.nan_to_num(np.eye(n * n) - kept)
    try:
        inverse = np.linalg.inv(less)
    except np.linalg.LinAlgError:  # two eigenvalues of a cell have the product 1
        inverse = np.linalg.pinv(less)
    degree = A.exponents.sum(1)

    def solved(right: np.ndarray) -> np.ndarray:
        """X of `X - M' X M = right`."""
        X = (inverse @ right.reshape(*right.shape[:-2], n * n, 1)).reshape(right.shape)
        return (X + X.mT) / 2

    P = np.zeros_like(A.terms)
    after = np.zeros_like(A.terms)  # P A
    P[0] = solved(np.broadcast_to(np.eye(n), M.shape))
    after[0] = P[0] @ M
    for order in range(1, A.order + 1):
        here = degree == order
        A.multiply_degree(after, P, A.terms, A.numbers, A.order, order)
        A.multiply_degree(P, A.terms.mT, after, A.numbers, A.order, order)
        P[here] = solved(P[here])
        after[here] += P[here] @ M
    return P
