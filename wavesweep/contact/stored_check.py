"""The check of a proof through contact while frames vary: what a wall stores never grows.

Nothing here depends on how the forms were found, and nothing is sampled.

Between samples of the wall the loop moves as `WallFrames` has it. With omega as in `coming_rests`,
the place `q = p + omega' eta` where the device would come to rest without its wall moves by the
wall's force alone, whatever frames come:

    q+ = q + R u,   R = r + omega+' b,   x = q + (o - omega)' eta + d_x u.

With y = K x + B v, u = phi(y), and f = (y - u)/K = q + c' eta + d u, slopes of phi from 0 to 1 make
u a rising function of f. It is the slope of a convex function Phi of f, with Phi >= 0 and Phi = 0
where u = 0: what the wall stores. So, for any two samples in a row, and with R < 0,

    u f >= Phi(f) >= 0,   u (f - f_before) >= Phi(f) - Phi(f_before).

Let m = f_before - p, z = (eta, m), and a form P_i at each node. On an edge from i to j, with
`f - p = e' eta + d u`, so that `c = e - omega` and `m+ = (e - l)' eta + (d - r) u`, the sum
`V = g q^2 + z' P z + 2 h Phi(f_before)` falls by at least w' F w,

    w = (z, u),   w' F w = z' P_i z - z+' P_j z+ - g R^2 u^2 + 2 g R u (c' eta + d u)
                           - 2 h u (e' eta + d u - m),

where the term of u f with the weight -g R has taken away q u: nothing of F depends on q. If all P_i
and F are positive definite, g > 0 and h >= 0, the squares of eta, m and u have finite sums; so they decay,
Phi(f) <= u f does, q^2 converges, and q with it, since its steps decay. `F` is positive definite
only if 1 > K d_x + B d_v, so that every sample has one force. Of F only the terms with g depend on
the frames to come: with f_before - q in place of m all of it would, and far less is proved.

If no position drifts there is no q, f = y - u, R = 0, and the term of u f has the weight g.

Omega and R lie in hulls. F is linear in omega for each R, and concave in R for each omega: so F is
positive definite in the hulls if it is so at all pairs of their vertices.

Source: the function Phi is that of A. I. Lur'e and V. N. Postnikov (1944), in discrete time that of
E. I. Jury and B. W. Lee, On the absolute stability of multinonlinear systems, Automation and Remote
Control 26 (1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.contact.coming_rests import Edge
from wavesweep.contact.wall_loop import BOUNDS_OF_DOUBLES
from wavesweep.engine.doubles import EPS

POINT = 1e-9  # of R, up to which its interval counts as a value with an error


@dataclass(frozen=True, slots=True, eq=False)
class Conditions:
    """What has to hold on the edges of a graph, at the vertices of the hulls.

    moved `(conditions, n + 1, n + 1)`: A and b, and the row (l, r) below; read `(conditions, 2, n +
    1)`: (o, d_x) and (c, d_v); rest `(conditions, n)`: omega; R `(conditions,)`; ..._error: bounds
    on the errors of their entries. exact: whether all rests are points, up to such errors. drifts:
    whether a position does.
    """

    source: np.ndarray
    target: np.ndarray
    moved: np.ndarray
    read: np.ndarray
    rest: np.ndarray
    R: np.ndarray
    moved_error: np.ndarray
    read_error: np.ndarray
    rest_error: np.ndarray
    R_error: np.ndarray
    drifts: bool
    exact: bool

    @staticmethod
    def on_edges(frames: Any, edges: Sequence[Edge]) -> Conditions:
        """The conditions of frames, see `WallFrames`, on these edges.

        One for each vertex omega of the hull of an edge, and for each of its R: the middle of the
        interval of R with half of its width as error, or both of its ends if that error is above
        POINT times R.
        """
        n = frames.changes.shape[-1] - 1
        # Changes are those of eta and p; the force u behind them has no value before.
        unchanged = np.eye(n + 1)
        unchanged[n, n] = 0.0
        conditions: list[tuple] = []
        exact = True
        for edge in edges:
            i = edge.frame
            moved = unchanged + frames.changes[i]
            moved_error = frames.changes_error[i] + EPS * np.abs(moved)
            least, most = edge.turned
            middle = (least + most) / 2
            R_values = [middle]
            R_error = (most - least) / 2 + EPS * abs(middle)
            if R_error > POINT * abs(middle):
                R_values = [least, most]
                R_error = 0.0
            exact &= len(R_values) == len(edge.vertices) == 1
            for R, omega in product(R_values, edge.vertices):
                ends = (edge.source, edge.target)
                values = (moved, frames.rows[i], omega, R)
                errors = (moved_error, frames.rows_error[i], edge.errors, R_error)
                conditions.append((*ends, *values, *errors))
        arrays = map(np.array, zip(*conditions, strict=True))
        return Conditions(*arrays, drifts=frames.drifts, exact=exact)

    def terms(self, wall: tuple[float, float, float]) -> Terms:
        """The parts of F at a wall (a_x, a_v, a_u), which is (1, B/K, 1/K), or (K, B, 1) without a
        drift: `f - p = a_x (x - p) + a_v v - a_u u`, where x - p and v are the rows of `read`."""
        a_x, a_v, a_u = wall
        n = self.rest.shape[1]
        force = n + 1
        state = [*range(n), force]
        f = a_x * self.read[:, 0] + a_v * self.read[:, 1]
        size = np.abs(a_x * self.read[:, 0]) + np.abs(a_v * self.read[:, 1])
        f[:, n] -= a_u
        size[:, n] += a_u
        f_error = abs(a_x) * self.read_error[:, 0] + abs(a_v) * self.read_error[:, 1]
        f_error += 8 * EPS * size
        count = len(f)
        G = np.zeros((count, n + 1, n + 2))
        G_error = np.zeros_like(G)
        G[:, :, state] = self.moved
        G_error[:, :, state] = self.moved_error
        G[:, n, state] = f - self.moved[:, n]
        G_error[:, n, state] += f_error + EPS * np.abs(G[:, n, state])
        # From where the device would rest to f.
        from_rest = f.copy()
        from_rest[:, :n] -= self.rest
        from_rest_error = f_error + EPS * np.abs(from_rest)
        from_rest_error[:, :n] += self.rest_error
        weight = -self.R if self.drifts else np.ones(count)
        own = _times_force(-weight[:, None] * from_rest)
        own[:, force, force] -= self.R**2
        size_of_R = np.abs(self.R) + self.R_error
        product_error = np.abs(weight)[:, None] * from_rest_error
        product_error += self.R_error[:, None] * (np.abs(from_rest) + from_rest_error)
        own_error = _times_force(product_error)
        own_error[:, force, force] += self.R_error * (np.abs(self.R) + size_of_R)
        own_error[:, force, force] += 4 * EPS * self.R**2
        own_error += 4 * EPS * np.abs(own)
        stored = _times_force(-f)
        stored[:, force, n] = stored[:, n, force] = 1.0
        return Terms(G, own, stored, G_error, own_error, _times_force(f_error))


def _times_force(row: np.ndarray) -> np.ndarray:
    """The matrices of `2 u (row (eta, u))` in (eta, m, u); rows `(conditions, n + 1)`."""
    count, force = row.shape
    n = force - 1
    matrix = np.zeros((count, n + 2, n + 2))
    matrix[:, n + 1, :n] = matrix[:, :n, n + 1] = row[:, :n]
    matrix[:, n + 1, n + 1] = 2 * row[:, n]
    return matrix


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """`F = E' P_i E - G' P_j G + g own + h stored` of each condition, with E = (I, 0);
    ..._error: bounds on the errors of the entries."""

    G: np.ndarray
    own: np.ndarray
    stored: np.ndarray
    G_error: np.ndarray
    own_error: np.ndarray
    stored_error: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """Forms P `(nodes, n + 1, n + 1)` at the nodes, symmetric, and the weights g of the rest and
    h of what the wall stores."""

    P: np.ndarray
    g: float
    h: float


def falls(
    conditions: Conditions,
    ends: Sequence[tuple[Stored, tuple[float, float, float]]],
) -> bool:
    """Return whether V is proved to fall in all frames at a wall, or at two and at all between
    them.

    ends: one or two times forms with weights and the wall to them, as in `Conditions.terms`.

    Between two walls, with s from 0 to 1, the walls, forms and weights are linear in s. So F is a
    polynomial of degree three, and positive definite if its Bernstein coefficients are. The k-th one
    is the mean of `E' P_a E + g_a own_b + h_a stored_b - G_b' P_a G_c` over the ends a, b, c of
    which k are the second. As doubles it is wrong by at most, with all sizes those of both ends,

        dG' |P_j| (|G| + dG) + |G|' |P_j| dG + g d_own + h d_stored
        + (2 n + 16) rounding (|G|' |P_j| |G| + g |own| + h |stored| + E' |P_i| E).
    """
    switched = offered("switched")
    forms = [stored for stored, _ in ends]
    if not all(_are_positive(stored) for stored in forms):
        return False
    if conditions.drifts and not (conditions.R + conditions.R_error < 0).all():
        return False
    terms = [conditions.terms(wall) for _, wall in ends]
    error = _error_of_doubles(conditions, forms, terms)
    degree = 3 * (len(ends) - 1)  # 0 of a single wall, which is the only coefficient
    for k in range(degree + 1):
        coefficient = _bernstein_coefficient(conditions, forms, terms, k)
        if not switched.definite(*switched.in_its_units(coefficient, error)):
            return False
    return True


def _are_positive(stored: Stored) -> bool:
    """Whether forms are proved to be positive definite, and their weights are positive."""
    P = stored.P
    symmetric = np.isfinite(P).all() and (P.mT == P).all()
    if not symmetric or not (stored.g > 0 and stored.h >= 0):
        return False
    return offered("switched").definite(P, np.zeros_like(P))


def _error_of_doubles(conditions, forms, terms):
    """The bound on the error of every Bernstein coefficient, see `falls`."""
    n = forms[0].P.shape[-1]
    size_of_P_i = _largest([each.P[conditions.source] for each in forms])
    size_of_P_j = _largest([each.P[conditions.target] for each in forms])
    g = max(each.g for each in forms)
    h = max(each.h for each in forms)
    size_of_G = _largest([each.G for each in terms])
    size_of_own = _largest([each.own for each in terms])
    size_of_stored = _largest([each.stored for each in terms])
    G_error = _largest([each.G_error for each in terms])
    own_error = _largest([each.own_error for each in terms])
    stored_error = _largest([each.stored_error for each in terms])

    across = size_of_G.mT @ size_of_P_j
    moved_error = G_error.mT @ size_of_P_j @ (size_of_G + G_error) + across @ G_error
    added = across @ size_of_G + g * size_of_own + h * size_of_stored
    added[:, :n, :n] += size_of_P_i
    rounding_error = EPS * (2 * n + 16) * added
    return BOUNDS_OF_DOUBLES * (moved_error + rounding_error + g * own_error + h * stored_error)


def _bernstein_coefficient(conditions, forms, terms, k):
    """The k-th coefficient of F between two walls, or F of a single one, see `falls`."""
    n = forms[0].P.shape[-1]
    products = []
    for a, b, c in product(range(len(forms)), repeat=3):
        if a + b + c != k:
            continue
        F = forms[a].g * terms[b].own + forms[a].h * terms[b].stored
        moved = terms[b].G.mT @ forms[a].P[conditions.target] @ terms[c].G
        F = F - (moved + moved.mT) / 2
        F[:, :n, :n] += forms[a].P[conditions.source]
        products.append(F)
    return np.mean(products, axis=0)


def _largest(ends: Sequence[np.ndarray]) -> np.ndarray:
    """The largest size of each entry at the ends."""
    return np.max(np.abs(ends), axis=0)
