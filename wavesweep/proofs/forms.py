"""Forms P for a matrix that depends on one number, found in doubles; nothing rests on how."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.linalg import matrix_balance, schur

SLOPES = 2  # degree of P(s)
LEAST_SLACK = 0.05  # of a form that is given to the checker, whose errors take the rest
LEAST_INDEPENDENT = 1e14  # condition of L from which on it says nothing
ENOUGH = 0.3  # with which no other form is tried
SLOWEST = (0.9, 0.5)  # size of modes from which each has its own part in a form
WELL_APART = 1e4  # condition of eigenvectors up to which they do alone
SHARES = (10.0, 100.0, 1.0)  # of what lies beside them
DIGITS = (4, 6, 9, 13, 17)  # of its entries, that are tried
ROUNDING = 1e-12  # of the largest entry of a row: below it an entry is 0


class Form(NamedTuple):
    """`P(s) = L' (diag(signs) + sum_k slopes[k] s^(k+1)) L`. turn: see the checker's file."""

    L: np.ndarray
    signs: np.ndarray
    slopes: Sequence[np.ndarray]
    turn: int


# L, signs, and what solves `X - A' X A = R`
Candidate = tuple[np.ndarray, np.ndarray, Callable[..., np.ndarray]]


def form_of(A: Sequence[np.ndarray]) -> Form | None:
    """Return a form of few digits with `P - A' P A > 0` for s from -1 to 1, None if none is found.

    A: the terms of the matrix by powers of s.
    """
    _, (units, _) = matrix_balance(A[0], permute=False, separate=True)
    balanced = [each * units / units[:, None] for each in A]
    with np.errstate(all="ignore"):
        for find in (_split, _modal, _stein):
            candidates: list[Candidate] = []
            with suppress(np.linalg.LinAlgError, ValueError):
                candidates += [each for each in find(balanced[0]) if _is_usable(each)]
            if not candidates:
                continue
            constant = [Form(L, signs, [], 0) for L, signs, _ in candidates]
            left = [slack(form, balanced) for form in constant]
            best = int(np.argmax(left))
            form = constant[best]
            if left[best] <= ENOUGH:
                form = _with_slopes(candidates[best], balanced)
            if form and (rounded := _rounded(form, balanced, units)):
                return rounded
    return None


def _is_usable(candidate: Candidate) -> bool:
    L, signs, _ = candidate
    return bool(np.isfinite(L).all() and signs.all() and np.linalg.cond(L) < LEAST_INDEPENDENT)


def _split(A) -> Iterator[Candidate]:
    """Modes near the circle each by its distance, and by Stein's equation what lies beside them, in several
    proportions: so neither dead times nor a mode next to the circle spoil the other."""
    values, right = np.linalg.eig(A)
    others, left = np.linalg.eig(A.T)
    if np.linalg.cond(right) < WELL_APART:
        return
    solved = _solver(A)
    for least in SLOWEST:
        near = np.abs(values) > least
        if not near.any() or near.all():
            continue
        V = right[:, near]
        W = left.T[np.abs(others) > least]
        W = np.linalg.solve(W @ V, W)
        beside = np.eye(len(A)) - (V @ W).real
        W = W * np.linalg.norm(V, axis=0)[:, None]
        P = ((W.conj().T / (1 - np.abs(values[near]) ** 2)) @ W).real
        units = np.diag(np.abs(np.diag(solved(beside.T @ beside))))
        rest = solved(beside.T @ (units + A.T @ units @ A) @ beside)
        size = ((np.abs(W) ** 2).sum(0) / np.diag(rest)).max()
        for share in SHARES:
            yield _factors(P + share * size * rest, solved)


def _factors(P, solved) -> Candidate:
    """L and signs with `P = L' diag(signs) L`."""
    scale = 1 / np.sqrt(np.abs(np.diag(P)) + 1e-300)
    values, vectors = np.linalg.eigh(P * scale * scale[:, None])
    return (np.sqrt(np.abs(values)) * vectors).T / scale, np.sign(values), solved


def _solver(A) -> Callable[..., np.ndarray]:
    """What solves `X - A' X A = R`, by columns of Schur's form."""
    T, U = schur(A, output="complex")
    lower = T.conj().T
    parts = [np.linalg.inv(np.eye(len(A)) - value * lower) for value in np.diag(T)]

    def solved(R):
        S = U.conj().T @ R @ U
        Y = np.zeros_like(S)
        for at, part in enumerate(parts):
            Y[:, at] = part @ (S[:, at] + lower @ (Y[:, :at] @ T[:at, at]))
        X = (U @ Y @ U.conj().T).real
        return (X + X.T) / 2

    return solved


def _modal(A) -> Iterator[Candidate]:
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

    yield np.array(rows), np.array(signs), solved


def _stein(A) -> Iterator[Candidate]:
    """Of Stein's equation, solved twice, the second time in units of the first."""
    solved = _solver(A)
    units = np.diag(np.abs(np.diag(solved(np.eye(len(A))))))
    yield _factors(solved(units + A.T @ units @ A), solved)


def _with_slopes(found, A) -> Form | None:
    """The form with the derivatives of its equation, and the turn that leaves most slack."""
    L, signs, solved = found
    L = L / np.abs(L).max()
    P = [L.T * signs @ L]
    best = Form(L, signs, [], 0)
    most = slack(best, A)
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
    for turn, count in product((0, -1, 1), range(len(slopes), -1, -1)):
        if most > ENOUGH:
            break
        form = Form(L, signs, slopes[:count], turn)
        left = slack(form, A)
        if left > most:
            best, most = form, left
    return best if most > LEAST_SLACK else None


def _rounded(form: Form, balanced: Sequence[np.ndarray], units: np.ndarray) -> Form | None:
    """In the units that states have, with as few digits as leave slack; the largest entry of each
    row is above 0, so that the form does not depend on the signs of eigenvectors."""
    largest = np.abs(form.L).argmax(axis=1)[:, None]
    turned = np.sign(np.take_along_axis(form.L, largest, axis=1))
    rounding = ROUNDING * np.take_along_axis(form.L, largest, axis=1)
    L = np.where(np.abs(form.L) > np.abs(rounding), turned * form.L, 0.0) / units
    symmetric = [turned * (each + each.T) / 2 * turned.T for each in form.slopes]
    for digits in DIGITS:
        slopes = [np.round(each, digits + 1) for each in symmetric]
        found = form._replace(L=_few(L / np.abs(L).max(), digits), slopes=slopes)
        if slack(found._replace(L=found.L * units), balanced) > LEAST_SLACK:
            return found
    return None


def _few(matrix, digits):
    return np.array([[float(f"{x:.{digits}g}") for x in row] for row in matrix])


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
