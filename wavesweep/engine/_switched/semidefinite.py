"""Semidefinite programmes, by an interior-point method for cones.

Source: P. J. Goulart, Y. Chen, Clarabel: An interior-point solver for conic programs with quadratic
objectives, 2024 (arXiv:2405.12762).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


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

    Accuracy: cost and inequalities to about 1e-8 of the size of what they consist of, or less where
    the solver makes no more progress: who needs more checks what is found.
    """
    import clarabel
    from scipy.sparse import csc_matrix, vstack

    unknowns = cost.size
    parts = [csc_matrix(G)]
    right = [h]
    cones = [clarabel.NonnegativeConeT(h.size)]
    for each in inequalities:
        count, N = each.constant.shape[:2]
        # The upper triangle, column by column, with the inner product of the matrices.
        column, row = np.tril_indices(N)
        weight = np.where(row == column, 1.0, np.sqrt(2))
        entries = -each.slopes[:, :, row, column] * weight
        condition, term, entry = np.nonzero(entries)
        places = condition * row.size + entry, each.index[condition, term]
        values = entries[condition, term, entry]
        parts.append(csc_matrix((values, places), (count * row.size, unknowns)))
        right.append((each.constant[:, row, column] * weight).ravel())
        cones += [clarabel.PSDTriangleConeT(N)] * count
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    A = vstack(parts, format="csc")
    nothing = csc_matrix((unknowns, unknowns))
    solver = clarabel.DefaultSolver(nothing, cost, A, np.concatenate(right), cones, settings)
    return np.array(solver.solve().x)
