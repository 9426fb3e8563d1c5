"""The check of a proof through contact while frames vary: what a wall stores never grows.

Nothing here depends on how the forms were found, and nothing is sampled.

Between samples of the wall the loop moves as `WallFrames` has it. With omega as in `coming_rests`,
the place `q = p + omega' eta` where the device would come to rest without its wall moves by the
wall's force alone, whatever frames come:

    q+ = q + R u,   R = r + omega+' b,   x = q + (o - omega)' eta + d_x u.

With y = K x + B v, u = phi(y), and f = y - u = K q + c' eta + d u, slopes of phi from 0 to 1 make
u a rising function of f. It is the slope of a convex function Phi of f, with Phi >= 0 and Phi = 0
where u = 0: what the wall stores. So, for any two samples in a row, and with R < 0 < K,

    u f >= Phi(f) >= 0,   u (f - f_before) >= Phi(f) - Phi(f_before).

Let m = f_before - K p, z = (eta, m), and a form P_i at each node. On an edge from i to j, with
`f - K p = e' eta + d u`, so that `c = e - K omega` and `m+ = (e - K l)' eta + (d - K r) u`, the sum
`V = g K q^2 + z' P z + 2 h Phi(f_before)` falls by at least w' F w,

    w = (z, u),   w' F w = z' P_i z - z+' P_j z+ - g K R^2 u^2 + 2 g R u (c' eta + d u)
                           - 2 h u (e' eta + d u - m),

where the term of u f with the weight -g R has taken away K q u: nothing of F depends on q. If all P_i
and F are positive definite, g > 0 and h >= 0, the squares of eta, m and u have finite sums; so they decay,
Phi(f) <= u f does, q^2 converges, and q with it, since its steps decay. `F` is positive definite
only if 1 > K d_x + B d_v, so that every sample has one force. Of F only the terms with g depend on
the frames to come: with f_before - K q in place of m all of it would, and far less is proved.

If no position drifts there is no q, R = 0, and the term of u f has the weight g + g_e, another g_e >= 0
on each edge. In place of m, what the wall read last and its last force are states, x_before, v_before and
u_before, so that z' P z has products of these too, and

    u_before (f_before - f) >= Phi(f_before) - Phi(f)

is taken with a weight 2 a_e >= 0. With it the weight of the other inequality is 2 (h + a_e), so that Phi
keeps its weight in V: `2 (a_e u_before - (h + a_e) u) (f - f_before)` stands in w' F w. This is the
anticausal part of a multiplier of Zames and Falb. Where a position drifts, it proves no more.

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

from wavesweep.contact.coming_rests import Edge
from wavesweep.contact.wall_loop import BOUNDS_OF_DOUBLES
from wavesweep.engine.doubles import EPS
from wavesweep.engine.frames import Bounded
from wavesweep.engine.switched import definite, in_its_units

POINT = 1e-9  # of R, up to which its interval counts as a value with an error


@dataclass(frozen=True, slots=True, eq=False)
class Conditions:
    """What has to hold on the edges of a graph, at the vertices of the hulls.

    moved `(conditions, n + 1, n + 1)`: A and b, and the row (l, r) below; read `(conditions, 2, n +
    1)`: (o, d_x) and (c, d_v); rest `(conditions, n)`: omega; R `(conditions,)`. exact: whether all
    rests are points, up to their errors. drifts: whether a position does; else the last three states are
    x, v and u of the last sample.
    """

    source: np.ndarray
    target: np.ndarray
    moved: Bounded
    read: Bounded
    rest: Bounded
    R: Bounded
    drifts: bool
    exact: bool

    @property
    def are_met_by_rests(self) -> bool:
        """Whether a force of the wall is proved to move the rest away from it, if anything drifts."""
        return not self.drifts or bool((self.R.value + self.R.error < 0).all())

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
            moved = Bounded(frames.changes[i], frames.changes_error[i]) + Bounded.exact(unchanged)
            read = Bounded(frames.rows[i], frames.rows_error[i])
            if not frames.drifts:
                moved, read = _with_last_sample(moved, read)
            least, most = edge.turned
            middle = (least + most) / 2
            R_values = [middle]
            R_error = (most - least) / 2 + EPS * abs(middle)
            if R_error > POINT * abs(middle):
                R_values = [least, most]
                R_error = 0.0
            exact &= len(R_values) == len(edge.vertices) == 1
            more = (0, read.value.shape[-1] - 1 - n)
            errors = np.pad(edge.errors, more)
            for R, omega in product(R_values, edge.vertices):
                rest = Bounded(np.pad(omega, more), errors)
                bounded = (moved, read, rest, Bounded(R, R_error))
                conditions.append((edge.source, edge.target, *bounded))
        source, target, *bounded = zip(*conditions, strict=True)
        bounded = [Bounded(*map(np.array, zip(*each, strict=True))) for each in bounded]
        ends = np.array(source), np.array(target)
        return Conditions(*ends, *bounded, drifts=frames.drifts, exact=exact)

    def terms(self, wall: tuple[float, float]) -> Terms:
        """The parts of F at a wall (K, B): `f - K p = K (x - p) + B v - u`, where x - p and v are the
        rows of `read`."""
        K, B = (Bounded(each, EPS * abs(each)) for each in wall)
        count, n = self.rest.value.shape
        force = np.eye(n + 1)[n]
        f = self.read.part(slice(None), 0) * K + self.read.part(slice(None), 1) * B
        f = f - Bounded.exact(force)
        # From where the device would rest to f.
        rest = self.rest.each(lambda omega: np.pad(omega, ((0, 0), (0, 1))))
        weight = -self.R if self.drifts else Bounded.exact(np.ones(count))
        of_rest = (rest * K - f) * weight.part(slice(None), None)
        if not self.drifts:
            x, v, u = np.eye(n + 1)[n - 3 : n]
            before = K * Bounded.exact(x) + B * Bounded.exact(v) - Bounded.exact(u)
            stored = _times(before - f, n)
            of_last = _times(before - f, n - 1)
            own = _times(of_rest, n)
            return Terms(
                self.moved.part(slice(None), slice(n)), own, stored, (own, stored - of_last)
            )
        f_moved = f - self.moved.part(slice(None), n) * K
        rows = [self.moved.part(slice(None), slice(n)), f_moved.part(slice(None), None)]
        G = Bounded.joined(rows, -2).each(_beside_m)
        squared = np.zeros((n + 2, n + 2))
        squared[n + 1, n + 1] = 1.0
        own = _times(of_rest.each(_beside_m), n + 1)
        own = own - (self.R * self.R * K).part(slice(None), None, None) * squared
        before = Bounded.exact(np.eye(n + 2)[n])
        return Terms(G, own, _times(before - f.each(_beside_m), n + 1), ())


def _with_last_sample(moved, read):
    """What a frame moves and its sample reads, with x, v and u of the last sample as states behind
    the others."""
    n = moved.value.shape[-1] - 1
    force = Bounded.exact(np.eye(n + 1)[[n]])
    rows = Bounded.joined([moved.part(slice(n)), read, force, moved.part([n])], -2)

    def beside_them(matrix):
        return np.insert(matrix, [n] * 3, 0.0, axis=-1)

    return rows.each(beside_them), read.each(beside_them)


def _beside_m(rows):
    """Rows of (eta, u) as rows of (eta, m, u)."""
    return np.insert(rows, -1, 0.0, axis=-1)


def _times(rows, at):
    """The matrices of `2 w_at (row w)`; rows `(conditions, n)`."""

    def matrices(row):
        matrix = np.zeros((*row.shape, row.shape[-1]))
        matrix[:, at] = row
        return matrix + matrix.mT

    return rows.each(matrices)


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """`F = E' P_i E - G' P_j G + g own + h stored` of each condition, with E = (I, 0), and with each
    of `beside` times a weight of its own."""

    G: Bounded
    own: Bounded
    stored: Bounded
    beside: tuple[Bounded, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """Forms P `(nodes, n, n)` of z at the nodes, symmetric, and the weights g of the rest and h of
    what the wall stores; beside `(conditions, terms)`: those of each condition, g_e and a_e, none where
    a position drifts."""

    P: np.ndarray
    g: float
    h: float
    beside: np.ndarray


def falls(
    conditions: Conditions,
    ends: Sequence[tuple[Stored, tuple[float, float]]],
) -> bool:
    """Return whether V is proved to fall in all frames at a wall, or at two and at all between
    them.

    ends: one or two times forms with weights and the wall to them, as in `Conditions.terms`.

    Between two walls, with s from 0 to 1, the walls, forms and weights are linear in s. So F is a
    polynomial of degree three, and positive definite if its Bernstein coefficients are. The k-th one
    is the mean of `E' P_a E + g_a own_b + h_a stored_b - G_b' P_a G_c`, with what is beside as with
    own, over the ends a, b, c of which k are the second.
    """
    forms = [stored for stored, _ in ends]
    if not all(_are_positive(stored) for stored in forms):
        return False
    if not conditions.are_met_by_rests:
        return False
    terms = [conditions.terms(wall) for _, wall in ends]
    degree = 3 * (len(ends) - 1)  # 0 of a single wall, which is the only coefficient
    for k in range(degree + 1):
        F, error = _bernstein_coefficient(conditions, forms, terms, k)
        if not definite(*in_its_units(F, BOUNDS_OF_DOUBLES * error)):
            return False
    return True


def _are_positive(stored: Stored) -> bool:
    """Whether forms are proved to be positive definite, and their weights are positive."""
    P = stored.P
    symmetric = np.isfinite(P).all() and (P.mT == P).all()
    if not symmetric or not (stored.g > 0 and stored.h >= 0 and (stored.beside >= 0).all()):
        return False
    return definite(P, np.zeros_like(P))


def coefficient_parts(ends: int, k: int) -> list[tuple[int, int, int]]:
    """Return the ends a, b, c, of one or two, of the parts of the k-th coefficient of F; see `falls`."""
    return [each for each in product(range(ends), repeat=3) if sum(each) == k]


def _bernstein_coefficient(conditions, forms, terms, k):
    """The k-th coefficient of F between two walls, or F of a single one, see `falls`."""
    products = []
    for a, b, c in coefficient_parts(len(forms), k):
        form = forms[a]
        moved = terms[b].G.mT @ form.P[conditions.target] @ terms[c].G
        F = terms[b].own * form.g + terms[b].stored * form.h - (moved + moved.mT) * 0.5
        for weight, beside in zip(form.beside.T, terms[b].beside, strict=True):
            F = F + beside * weight[:, None, None]
        of_state = np.pad(form.P[conditions.source], ((0, 0), (0, 1), (0, 1)))
        products.append(F + Bounded.exact(of_state))
    return sum(products[1:], products[0]) * (1 / len(products))
