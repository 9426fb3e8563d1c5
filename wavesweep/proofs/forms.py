"""Forms P for a matrix that depends on one number, found in doubles; nothing rests on how."""

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

SLOPES = 2  # degree of P(s)
LEAST_SLACK = 0.05  # of a form that is given to the checker, whose errors take the rest
LEAST_INDEPENDENT = 1e14  # condition of L from which on it says nothing
ENOUGH = 0.3  # with which no other form is tried
DIGITS = (4, 6, 9, 13, 17)  # of its entries, that are tried


class Form(NamedTuple):
    """`P(s) = L' (diag(signs) + sum_k slopes[k] s^(k+1)) L`. turn: see the checker's file."""

    L: np.ndarray
    signs: np.ndarray
    slopes: Sequence[np.ndarray]
    turn: int


def form_of(A: Sequence[np.ndarray]) -> Form | None:
    """Return a form of few digits with `P - A' P A > 0` for s from -1 to 1, None if none is found.

    A: the terms of the matrix by powers of s.
    """
    for found in _candidates(A[0]):
        with np.errstate(all="ignore"):
            form = _with_slopes(found, A)
            for digits in DIGITS if form else ():
                rounded = _rounded(form, digits)
                if slack(rounded, A) > LEAST_SLACK:
                    return rounded
    return None


def _candidates(A) -> Iterator[tuple[np.ndarray, np.ndarray, Callable[..., np.ndarray]]]:
    """Yield L and signs of forms for the middle, and what solves `X - A' X A = R`."""
    with np.errstate(all="ignore"):
        try:
            yield _modal(A)
            yield _stein(A)
        except (np.linalg.LinAlgError, ValueError):
            return


def _modal(A):
    """In eigenvectors, each by its distance from the circle."""
    values, vectors = np.linalg.eig(A)
    inverse = np.linalg.inv(vectors / np.linalg.norm(vectors, axis=0))
    rows = []
    signs = []
    for value, row in zip(values, inverse, strict=True):
        if value.imag < 0:
            continue
        # the same for a mode and its inverse
        away = (1 - abs(value) ** 2) / max(1.0, abs(value) ** 2)
        parts = [row.real] if value.imag == 0 else [2**0.5 * row.real, 2**0.5 * row.imag]
        rows += [part / np.sqrt(abs(away)) for part in parts]
        signs += [np.sign(away)] * len(parts)
    left = vectors / np.linalg.norm(vectors, axis=0)

    def solved(R):
        X = (left.conj().T @ R @ left) / (1 - np.outer(values.conj(), values))
        return (inverse.conj().T @ X @ inverse).real

    return np.array(rows), np.array(signs), solved


def _stein(A):
    """Of Stein's equation, solved twice, the second time in units of the first."""
    n = len(A)
    inverse = np.linalg.inv(np.eye(n * n) - np.kron(A.T, A.T))

    def solved(R):
        X = (inverse @ R.ravel()).reshape(n, n)
        return (X + X.T) / 2

    units = np.diag(np.abs(np.diag(solved(np.eye(n)))))
    P = solved(units + A.T @ units @ A)
    scale = 1 / np.sqrt(np.abs(np.diag(P)) + 1e-300)
    values, vectors = np.linalg.eigh(P * scale * scale[:, None])
    L = (np.sqrt(np.abs(values)) * vectors).T / scale
    return L, np.sign(values), solved


def _with_slopes(found, A) -> Form | None:
    """The form with the derivatives of its equation, and the turn that leaves most slack."""
    L, signs, solved = found
    if not np.isfinite(L).all() or 0 in signs:
        return None
    L = L / np.abs(L).max()
    P = [L.T * signs @ L]
    if not np.linalg.cond(L) < LEAST_INDEPENDENT:
        return None
    inverse = np.linalg.inv(L)
    if len(A) > 1:
        for k in range(1, SLOPES + 1):
            right = np.zeros_like(L)
            for m in range(k):
                for i in range(min(k - m, SLOPES) + 1):
                    if k - m - i <= SLOPES:
                        right += A[i].T @ P[m] @ A[k - m - i]
            P.append(solved((right + right.T) / 2))
    slopes = [inverse.T @ each @ inverse for each in P[1:]]
    if not np.isfinite(slopes).all():
        return None
    best = Form(L, signs, slopes, 0)
    most = slack(best, A)
    for turn, count in product((0, -1, 1), range(len(slopes), -1, -1)):
        if most > ENOUGH:
            break
        form = Form(L, signs, slopes[:count], turn)
        left = slack(form, A)
        if left > most:
            best, most = form, left
    return best if most > LEAST_SLACK else None


def _rounded(form, digits):
    def few(matrix, count):
        return np.array([[float(f"{x:.{count}g}") for x in row] for row in matrix])

    slopes = [few((each + each.T) / 2, digits + 1) for each in form.slopes]
    return form._replace(L=few(form.L, digits), slopes=slopes)


def slack(form: Form, A: Sequence[np.ndarray]) -> float:
    """Return what is left of `X' (P - A' P A) X`, in its own units, at Bernstein's control points,
    of 1; X is 1, or near `(1 + turn A)^-1`."""
    L = form.L
    one = np.eye(len(L))
    P = [L.T * form.signs @ L, *(L.T @ each @ L for each in form.slopes)]
    X = [one]
    Y = list(A)  # A X
    if form.turn:
        turned = form.turn
        if not np.linalg.cond(one + turned * A[0]) < LEAST_INDEPENDENT:
            return -1.0
        X = [np.linalg.inv(one + turned * A[0])]
        for k in (1, 2):
            terms = [-turned * A[i] @ X[k - i] for i in range(1, min(k, len(A) - 1) + 1)]
            X.append(X[0] @ sum(terms, 0 * one))
        Y = [turned * (one - X[0]), -turned * X[1], -turned * X[2]]  # less rounding
        for power in range(3, len(A) + 2):
            Y.append(sum((A[i] @ X[power - i] for i in range(len(A)) if power - i < 3), 0 * one))
    F = np.zeros((max(3, len(P) + 2 * max(len(X), len(Y)) - 2), *L.shape))
    for each, sign in ((np.array(X), 1), (np.array(Y), -1)):
        whole = _products(each.mT, _products(np.array(P), each))
        F[: len(whole)] += sign * whole
    rest = np.abs(F[3:]).sum(0)
    control = np.stack([F[0] + F[1] + F[2], F[0] - F[2], F[0] - F[1] + F[2]])
    diagonal = np.diagonal(control, axis1=1, axis2=2)
    if not (diagonal > 0).all():
        return -1.0
    units = 1 / np.sqrt(diagonal)
    both = units[:, :, None] * units[:, None, :]
    try:
        W = np.abs(np.linalg.inv(np.linalg.cholesky(control * both)))
    except np.linalg.LinAlgError:
        return -1.0
    return float(1 - (W @ (rest * both) @ W.mT).sum(-1).max())


def _products(first, second):
    """The terms of a product of two matrices that are polynomials."""
    every = first[:, None] @ second[None]
    terms = np.zeros((len(first) + len(second) - 1, *every.shape[2:]))
    for power, row in enumerate(every):
        terms[power : power + len(second)] += row
    return terms
