"""Semidefinite programmes, by an interior-point method for cones.

Source: P. J. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic
objectives, 2024 (arXiv:2405.12762).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

TOLERANCE = 1e-11  # of a solution, which the solver stays above where rounding leaves less


@dataclass(frozen=True, slots=True, eq=False)
class Inequality:
    """`C + sum_k x_index[k] S_k` is positive semidefinite, for each of some conditions.

    constant C `(conditions, N, N)`; slopes S `(conditions, terms, N, N)`; index `(conditions,
    terms)`: the unknown of each term. All matrices are symmetric.
    """

    constant: np.ndarray
    slopes: np.ndarray
    index: np.ndarray


def minimised(
    cost: np.ndarray, inequalities: Sequence[Inequality], G: np.ndarray, h: np.ndarray
) -> np.ndarray:
    """Return x `(unknowns,)` with the least `cost' x` of those that meet all inequalities and `G x <=
    h`, NaN if there is none.

    Accuracy: TOLERANCE of the size of what cost and inequalities consist of, and some 1e-8 where the
    solver makes no more progress: who relies on the inequalities checks them.
    """
    import clarabel
    from scipy.sparse import csc_matrix, vstack

    unknowns = cost.size
    parts = [csc_matrix(G)]
    right = [h]
    cones = [clarabel.NonnegativeConeT(h.size)]
    for inequality in inequalities:
        count, N = inequality.constant.shape[:2]
        # The upper triangle, column by column, with the inner product of the matrices.
        column, row = np.tril_indices(N)
        weight = np.where(row == column, 1.0, np.sqrt(2))
        entries = -inequality.slopes[:, :, row, column] * weight
        condition, term, entry = np.nonzero(entries)
        places = condition * row.size + entry, inequality.index[condition, term]
        values = entries[condition, term, entry]
        parts.append(csc_matrix((values, places), (count * row.size, unknowns)))
        right.append((inequality.constant[:, row, column] * weight).ravel())
        cones += [clarabel.PSDTriangleConeT(N)] * count
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = TOLERANCE
    A = vstack(parts, format="csc")
    nothing = csc_matrix((unknowns, unknowns))
    solver = clarabel.DefaultSolver(nothing, cost, A, np.concatenate(right), cones, settings)
    solution = solver.solve()
    if "Infeasible" in str(solution.status):
        return np.full(unknowns, np.nan)
    return np.array(solution.x)


def symmetric_basis(n: int) -> np.ndarray:
    """Return a basis of symmetric matrices, `(n (n + 1) / 2, n, n)`: of zeros and ones."""
    row, column = np.triu_indices(n)
    index = np.arange(row.size)
    basis = np.zeros((row.size, n, n))
    basis[index, row, column] = 1.0
    basis[index, column, row] = 1.0
    return basis
