"""The search for forms in which what a wall stores falls, a semidefinite programme: the finder, whose
finds are checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavesweep.contact.stored_check import Conditions, Stored, coefficient_parts
from wavesweep.engine.switched import Inequality, minimised, symmetric_basis


def find_stored(
    conditions: Conditions,
    walls: Sequence[tuple[float, float]],
    known: Sequence[Stored] = (),
) -> Stored | None:
    """Return forms with which V falls at a wall; None if none are found.

    walls: one, or two, of which `known` has the forms of the first: then V falls at all walls
    between them as well, with forms between both.

    The largest t is looked for with which all Bernstein coefficients of F, see `falls`, are above t
    I, all P_i are positive, and `g + h <= 1`: so there is room for errors.
    """
    terms = [conditions.terms(wall) for wall in walls]
    count, N = terms[0].own.value.shape[:2]
    n = N - 1  # of (eta, m)
    basis = symmetric_basis(n)
    m = len(basis)
    nodes = 1 + int(max(conditions.source.max(), conditions.target.max()))
    own = np.arange(m)
    g, h, t = nodes * m + np.arange(3)  # their places among the unknowns, behind the P_i
    index = np.empty((count, 2 * m + 3), int)
    index[:, :m] = conditions.source[:, None] * m + own
    index[:, m : 2 * m] = conditions.target[:, None] * m + own
    index[:, 2 * m :] = g, h, t
    inequalities = []
    for k in range(len(known), 3 * len(known) + 1):
        constant = np.zeros((count, N, N))
        slopes = np.zeros((count, 2 * m + 3, N, N))
        slopes[:, -1] = -np.eye(N)
        parts = coefficient_parts(len(walls), k)
        for a, b, c in parts:
            G_b = terms[b].G.value[:, None]
            G_c = terms[c].G.value[:, None]
            if a < len(known):
                P = known[a].P
                moved = (G_b.mT @ P[conditions.target, None] @ G_c)[:, 0]
                constant += known[a].g * terms[b].own.value + known[a].h * terms[b].stored.value
                constant -= (moved + moved.mT) / 2
                constant[:, :n, :n] += P[conditions.source]
            else:
                moved = G_b.mT @ basis @ G_c
                slopes[:, :m, :n, :n] += basis
                slopes[:, m : 2 * m] -= (moved + moved.mT) / 2
                slopes[:, 2 * m] += terms[b].own.value
                slopes[:, 2 * m + 1] += terms[b].stored.value
        slopes[:, :-1] /= len(parts)
        inequalities.append(Inequality(constant / len(parts), slopes, index))
    each_node = np.arange(nodes * m).reshape(nodes, m)
    of_forms = np.broadcast_to(basis, (nodes, m, n, n))
    inequalities.append(Inequality(np.zeros((nodes, n, n)), of_forms, each_node))
    cost = np.zeros(t + 1)
    # A small share of the traces of all P_i beside t keeps those bounded that F does not bound.
    cost[:g] = 1e-9 * np.tile(np.trace(basis, axis1=1, axis2=2), nodes)
    cost[t] = -1.0
    G = np.zeros((3, t + 1))
    G[0, g] = -1.0
    G[1, h] = -1.0
    G[2, [g, h]] = 1.0
    # The least weight of the rest, g, where g + h is 1 at most.
    x = minimised(cost, inequalities, G, np.array([-1e-5, 0.0, 1.0]))
    # The least room of F, where forces are of size 1.
    if not (np.isfinite(x).all() and x[t] > 1e-7):
        return None
    P = np.tensordot(x[each_node], basis, (1, 0))
    return Stored(P, float(x[g]), max(0.0, float(x[h])))
