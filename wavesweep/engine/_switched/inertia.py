"""Forms of single matrices over cells: what they prove of the eigenvalues outside the unit circle."""

from typing import NamedTuple

import numpy as np

from wavesweep.engine._sets.taylor_models import Polynomials, balanced
from wavesweep.engine._switched.norm_check import norm_bound, outside_each

LEAST_INDEPENDENT = 1e10  # condition of eigenvectors from which on the states are the basis
NEXT_TO_0 = 0.1  # eigenvalues below it, of one size in what forms are


class Inertia(NamedTuple):
    """What is known of some cells.

    outside: the number of eigenvalues outside, -1 where it is not known, `(cells,)`. moves: by how
    much each number moves the slack, `(cells, numbers)`. rest: which part of the slack is lost to
    what the matrices leave out, `(cells,)`. forms: their terms, `(monomials, cells, pieces, n, n)`,
    for states z with x = basis z before each piece, `(cells, pieces, n, n)`.
    """

    outside: np.ndarray
    moves: np.ndarray
    rest: np.ndarray
    forms: np.ndarray
    basis: np.ndarray


def inertia_of_cells(A: Polynomials, pieces: int = 1) -> Inertia:
    """Return what forms prove of the products of so many matrices, `(cells pieces, n, n)`, the first
    one that acts first.

    Each piece has a form `P_j` before it. They are the Taylor series, of the order of A, of the
    solution of `P_j - A_j' P_(j+1) A_j = I`, the last one followed by the first, in unit
    eigenvectors of the middle. So the slack is I but for terms of a higher order. These are as large
    as the squares of the pieces, and not as that of their product, which far unstable modes make
    huge.
    """
    n = A.rest.shape[-1]
    cells = len(A.rest) // pieces
    with np.errstate(all="ignore"):  # what overflows is not proved
        basis = _bases(A, pieces)
        index = np.arange(len(A.rest)).reshape(cells, pieces)
        following = np.roll(index, -1, 1).ravel()
        seen = A.similar(basis, np.linalg.inv(basis)[following], basis[following])
        P = _series(seen, pieces)
        forms = Polynomials(P, np.zeros(P.shape[1:]), A.numbers, A.order)
        outside, slack = outside_each(forms, seen, pieces)
        positive = np.isfinite(slack.errors)  # F is positive in the middle
        moves = _moves(np.where(positive, norm_bound(P), 1.0), seen)
        size = norm_bound(np.abs(seen.terms).sum(0)) * norm_bound(np.abs(P).sum(0))[following]
        rest = 2 * size * norm_bound(seen.rest)
    by_cell = (cells, pieces)
    return Inertia(
        outside,
        moves.reshape(*by_cell, -1).max(1),
        rest.reshape(by_cell).max(1),
        P.reshape(-1, *by_cell, n, n),
        basis.reshape(*by_cell, n, n),
    )


def _bases(A: Polynomials, pieces: int) -> np.ndarray:
    """Bases V_j of the states before each piece j, `(cells pieces, n, n)`: eigenvectors of the
    product `A_(j+p-1) ... A_j` of the p pieces from j on, in the middle, in units (powers of 2) that
    balance the cycle of all `|V_(j+1)^-1 A_j V_j|`; one piece has unit eigenvectors."""
    n = A.rest.shape[-1]
    middle = A.terms[0].reshape(-1, pieces, n, n)
    products = middle
    for later in range(1, pieces):
        products = np.roll(middle, -later, 1) @ products
    basis = _eigenvectors(products)
    if pieces == 1:
        return basis[:, 0]
    after = np.linalg.inv(np.roll(basis, -1, 1))
    sizes = np.abs(after @ A.terms.reshape(-1, *basis.shape) @ basis).sum(0)
    # Block (j + 1, j) is the size of piece j in these bases.
    cycle = np.zeros((len(basis), pieces, n, pieces, n))
    for piece in range(pieces):
        cycle[:, (piece + 1) % pieces, :, piece] = sizes[:, piece]
    units = balanced(cycle.reshape(-1, pieces * n, pieces * n))
    return (basis * units.reshape(-1, pieces, 1, n)).reshape(-1, n, n)


def _eigenvectors(A: np.ndarray) -> np.ndarray:
    """Real and imaginary parts of the eigenvectors of matrices; an orthonormal basis of those whose
    eigenvalues are next to 0, where a frame that forgets states has nearly dependent ones; the states
    where all are nearly dependent."""
    values, vectors = np.linalg.eig(A)
    order = np.argsort(np.abs(values), -1)
    values = np.take_along_axis(values, order, -1)
    vectors = np.take_along_axis(vectors, order[..., None, :], -1)
    # of a pair, the first has the real part and the second the imaginary one
    imaginary = values.imag[..., None, :]
    basis = np.where(imaginary < 0, vectors.imag, vectors.real) * np.where(imaginary, 2**0.5, 1.0)
    next_to_0 = np.abs(values)[..., None, :] < NEXT_TO_0
    basis = np.where(next_to_0, np.linalg.qr(basis)[0], basis)
    dependent = ~(np.linalg.cond(basis) < LEAST_INDEPENDENT)
    basis[dependent] = np.eye(A.shape[-1])
    return basis


def _inverse_of_stein(M: np.ndarray) -> np.ndarray:
    """The inverse of `X -> X - M' X M` on matrices as vectors, `(cells, n n, n n)`, for M `(cells, n, n)`."""
    n = M.shape[-1]
    fixed_part = np.einsum("cki,clj->cijkl", M, M).reshape(-1, n * n, n * n)
    less = np.nan_to_num(np.eye(n * n) - fixed_part)
    try:
        return np.linalg.inv(less)
    except np.linalg.LinAlgError:  # two eigenvalues of a cell have the product 1
        return np.linalg.pinv(less)


def _series(A: Polynomials, pieces: int) -> np.ndarray:
    """The terms of the Taylor series of the forms P_j with `P_j - A_j' P_(j+1) A_j = I` over each cell of
    A `(monomials, cells pieces, n, n)`: a frame's pieces follow each other, and the first the last."""
    n = A.rest.shape[-1]
    by_cell = (-1, pieces, n, n)
    middle = A.terms[0].reshape(by_cell)
    before = [np.broadcast_to(np.eye(n), middle[:, 0].shape)]  # the pieces before each
    for piece in range(pieces):
        before.append(middle[:, piece] @ before[-1])
    inverse = _inverse_of_stein(before.pop())
    degree = A.exponents.sum(1)

    def solved(right: np.ndarray) -> np.ndarray:
        """X of `X_j - M_j' X_(j+1) M_j = right_j`."""
        right = right.reshape(*right.shape[:-3], *by_cell)
        moved = np.stack(before, 1)
        whole = (moved.mT @ right @ moved).sum(-3)
        first = (inverse @ whole.reshape(*whole.shape[:-2], n * n, 1)).reshape(whole.shape)
        X = np.empty_like(right)
        X[..., 0, :, :] = (first + first.mT) / 2
        for piece in range(pieces - 1, 0, -1):
            M_j = middle[:, piece]
            moved = M_j.mT @ X[..., (piece + 1) % pieces, :, :] @ M_j + right[..., piece, :, :]
            X[..., piece, :, :] = (moved + moved.mT) / 2
        return X.reshape(*right.shape[:-4], -1, n, n)

    following = np.roll(np.arange(len(A.rest)).reshape(-1, pieces), -1, 1).ravel()
    P = np.zeros_like(A.terms)
    after = np.zeros_like(A.terms)  # P A, of the form that follows
    P[0] = solved(np.broadcast_to(np.eye(n), A.rest.shape))
    after[0] = P[0][following] @ A.terms[0]
    for order in range(1, A.order + 1):
        here = degree == order
        A.multiply_degree(after, P[:, following], A.terms, A.numbers, A.order, order)
        A.multiply_degree(P, A.terms.mT, after, A.numbers, A.order, order)
        P[here] = solved(P[here])
        after[here] += P[here][:, following] @ A.terms[0]
    return P


def _moves(sizes: np.ndarray, A: Polynomials) -> np.ndarray:
    """By how much each number moves the slack, `(cells, numbers)`: what is gone, if its side is
    halved, of the terms of P A above the order, which are all that F has beside I.

    sizes: of the terms of P, `(monomials, cells)`.
    """
    exponents = A.exponents[:, None] + A.exponents
    above = exponents.sum(-1, keepdims=True) > A.order
    gone = np.where(above, 1 - 0.5**exponents, 0.0)
    return np.einsum("kc,ic,kin->cn", sizes, norm_bound(A.terms), gone)
