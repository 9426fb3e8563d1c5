"""Boxes of unknown numbers while what varies is at random: forms that decay on average in a part of a box.

They are the solution of a linear equation in the middle of the part, `P_i - sum w A' P_j A = Q`, and their slopes along each
number follow from its derivative. `norm_check` proves what is found here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.for_all.graph import Graph
from wavesweep.for_all.loop_frames import Symbol
from wavesweep.for_all.mean_square import SIZING, operator_of
from wavesweep.for_all.norms import CALLS, Centre, packed, unpacked
from wavesweep.for_all.polynomials import Polynomials


@dataclass(frozen=True, slots=True)
class OnAverage:
    """What frames do at random. chain: from their symbols to the graph of the chain and the probability of each edge."""

    chain: Callable[[Sequence[Symbol]], tuple[Graph, np.ndarray]]


def forms_on_average(A: Polynomials, graph: Graph, weight: np.ndarray) -> tuple[tuple[Centre, np.ndarray] | None, float]:
    """Return forms for the middle of a box and their slopes, None if moments do not decay there; and the work.

    Errors: LinAlgError if a matrix is singular to rounding.
    """
    from scipy.linalg import lu_factor, lu_solve

    middle, slopes, n = A.terms[0], A.terms[1 : 1 + A.numbers], A.terms.shape[-1]
    operator = operator_of(middle, graph, weight)
    lu, size, work = lu_factor(np.eye(len(operator)) - operator), np.ones(n), len(operator) ** 3 + CALLS

    def solved(right, *, forms):
        return unpacked(lu_solve(lu, packed(right).ravel(), trans=int(forms)).reshape(graph.nodes, -1), n)

    def alike(diagonal):
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
    last, moved, changes = P[graph.target], middle[graph.symbol], []
    for slope in slopes:
        half, right = weight[:, None, None] * (np.swapaxes(slope[graph.symbol], -1, -2) @ last @ moved), np.zeros_like(P)
        np.add.at(right, graph.source, half + np.swapaxes(half, -1, -2))
        changes.append(solved(right, forms=True))
    to = np.swapaxes(np.linalg.cholesky(P.mean(0)), -1, -2)
    basis = np.linalg.inv(to)
    P, *changes = (basis.T @ each @ basis for each in (P, *changes))
    return (Centre((P + np.swapaxes(P, -1, -2)) / 2, graph, basis, to), np.array(changes).reshape(A.numbers, *P.shape)), work
