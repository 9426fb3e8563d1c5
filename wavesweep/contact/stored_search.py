"""The search for forms in which what a wall stores falls, a semidefinite programme: the finder, whose
finds are checked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wavesweep.contact.stored_check import Conditions, Stored, coefficient_parts
from wavesweep.engine.switched import Inequality, minimised, symmetric_basis


def find_stored(conditions: Conditions, walls: Sequence[tuple[float, float]]) -> list[Stored]:
    """Return forms with which V falls at a wall, or at two and at all between them, one for each;
    nothing if none are found.

    The largest t is looked for with which all Bernstein coefficients of F, see `falls`, are above t
    I, all P_i are positive, `g + h <= 1`, and so are the weights of single conditions: so there is
    room for errors.
    """
    terms = [conditions.terms(wall) for wall in walls]
    count, N = terms[0].own.value.shape[:2]
    n = N - 1  # of (eta, m)
    basis = symmetric_basis(n)
    m = len(basis)
    nodes = 1 + int(max(conditions.source.max(), conditions.target.max()))
    kinds = len(terms[0].beside)
    # Places of the P_i, of g and h, and of the weights of each condition among the unknowns of a wall.
    forms = np.arange(nodes * m).reshape(nodes, m)
    g, h = nodes * m + np.arange(2)
    beside = h + 1 + np.arange(count * kinds).reshape(count, kinds)
    size = h + 1 + beside.size
    own = np.empty((count, 2 * m + 2 + kinds), int)
    own[:, :m] = forms[conditions.source]
    own[:, m : 2 * m] = forms[conditions.target]
    own[:, 2 * m : 2 * m + 2] = g, h
    own[:, 2 * m + 2 :] = beside
    t = len(walls) * size
    of_t = np.full((count, 1), t), np.broadcast_to(-np.eye(N), (count, 1, N, N))
    index = np.concatenate([*(own + wall * size for wall in range(len(walls))), of_t[0]], axis=1)
    inequalities = []
    for k in range(3 * len(walls) - 2):
        slopes = np.zeros((len(walls), *own.shape, N, N))
        parts = coefficient_parts(len(walls), k)
        for a, b, c in parts:
            G_b = terms[b].G.value[:, None]
            G_c = terms[c].G.value[:, None]
            moved = G_b.mT @ basis @ G_c
            slopes[a, :, :m, :n, :n] += basis
            slopes[a, :, m : 2 * m] -= (moved + moved.mT) / 2
            for at, term in enumerate((terms[b].own, terms[b].stored, *terms[b].beside)):
                slopes[a, :, 2 * m + at] += term.value
        of_walls = np.concatenate([*(slopes / len(parts)), of_t[1]], axis=1)
        inequalities.append(Inequality(np.zeros((count, N, N)), of_walls, index))
    each_node = np.concatenate([forms + wall * size for wall in range(len(walls))])
    of_forms = np.broadcast_to(basis, (len(each_node), m, n, n))
    inequalities.append(Inequality(np.zeros((len(each_node), n, n)), of_forms, each_node))
    # A small share of the traces of all P_i beside t keeps those bounded that F does not bound.
    cost = np.zeros(t + 1)
    cost[each_node] = 1e-9 * np.trace(basis, axis1=1, axis2=2)
    cost[t] = -1.0
    starts = size * np.arange(len(walls))[:, None]
    weights = (starts + np.arange(g, size)).ravel()
    G = np.zeros((2 * weights.size + len(walls), t + 1))
    G[np.arange(weights.size), weights] = -1.0
    G[weights.size + np.arange(weights.size), weights] = 1.0
    G[2 * weights.size + np.arange(len(walls))[:, None], starts + np.array([g, h])] = 1.0
    limits = np.repeat([0.0, 1.0], [weights.size, weights.size + len(walls)])
    limits[: weights.size][weights % size == g] = -1e-5  # the least weight of the rest
    x = minimised(cost, inequalities, G, limits)
    # The least room of F, where forces are of size 1.
    if not (np.isfinite(x).all() and x[t] > 1e-7):
        return []
    found = []
    for each in x[:t].reshape(len(walls), size):
        P = np.tensordot(each[forms], basis, (1, 0))
        weight = np.maximum(each, 0.0)
        found.append(Stored(P, float(each[g]), float(weight[h]), weight[beside]))
    return found
