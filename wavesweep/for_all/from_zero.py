"""Second moments that decay from a number 0 on, at which nothing holds the loop.

Frames are `A(f) = A_0 + f b c'`, where f is the number, or `x/(1 - d x)` of a number x. At f = 0 a
shift e of the loop stays, `A_0 e = e` for every kind of frame, and e is a unit vector in states that
are counted from it. So forms that do not depend on f have `F = P_i - sum w A' P_j A` with `e' F e =
0` at f = 0, and bounds on errors leave nothing of it. But F also has `F e = 0` there, if with P_i =
[1, p_i'; p_i, Q_i] and A_0 = [1, beta'; 0, D]

    p_i = sum w (beta + D' p_j).

Then the rest of F is a polynomial in f. In units in which e is 1/sqrt(f), F is positive definite
for all f in (0, f_1] if

    [F_1[e, e], 0; 0, F_0[r, r]]

is so by more than what the other coefficients of its powers, up to f_1, add to it. With `P_i[e, e] =
1 + f alpha_i` the decay at e is the same at all nodes: alpha is the solution of another such
equation, which need not be exact.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.doubles import LEAST_NORMAL, UNIT_ROUNDING
from wavesweep.for_all.graph import Graph
from wavesweep.for_all.norm_check import (
    BOUNDS_OF_DOUBLES,
    WEIGHED,
    are_chances,
    definite,
    in_its_units,
)

SHARES = 10.0 ** np.arange(-4, 13)  # of the squares of all other states beside that of the shift


@dataclass(frozen=True, slots=True, eq=False)
class FramesFromZero:
    """Frames `A_0 + f b c'` of each symbol, whose first state is moved by a shift that stays at f = 0.

    A, b, c: `(symbols, n, n)`, `(symbols, n)` each, and dA, db, dc bounds on their errors. The first
    column of A is exactly that of the identity, without an error. d: `f = x/(1 - d x)`.
    """

    A: np.ndarray
    dA: np.ndarray
    b: np.ndarray
    db: np.ndarray
    c: np.ndarray
    dc: np.ndarray
    d: float

    def decay(self, graph: Graph, weight: np.ndarray, x: float) -> bool:
        """Whether second moments are proved to decay for all numbers above 0 and up to x.

        weight: the probability of each edge.
        """
        f = x / (1 - self.d * x)
        if not (x > 0 and f > 0 and are_chances(weight, graph)):
            return False
        f *= 1 + 8 * UNIT_ROUNDING
        on = _OnGraph(self, graph, weight)
        with suppress(np.linalg.LinAlgError):  # singular where second moments stop to decay
            solved = on.row()
            if solved is None:
                return False
            p, dp = solved
            base, more = on.forms_of_others(p)
            for share in SHARES:
                P = on.forms(p, base + share * more)
                if on.shrink(P, dp, f):
                    return True
        return False


class _OnGraph:
    """The frames at the edges of a graph. s: of the shift alone."""

    def __init__(self, frames, graph, weight):
        self.graph = graph
        self.weight = weight
        of_edges = graph.symbol
        self.A = frames.A[of_edges]
        self.b = frames.b[of_edges]
        self.c = frames.c[of_edges]
        self.dA = frames.dA[of_edges] + UNIT_ROUNDING * np.abs(self.A)
        self.db = frames.db[of_edges]
        self.dc = frames.dc[of_edges]
        self.D = self.A[:, 1:, 1:]
        self.beta = self.A[:, 0, 1:]
        self.n = self.A.shape[-1]

    def summed(self, parts):
        """The sums of parts of edges, times their probabilities, at the nodes that they leave."""
        shape = (-1,) + (1,) * (parts.ndim - 1)
        total = np.zeros((self.graph.nodes, *parts.shape[1:]))
        np.add.at(total, self.graph.source, self.weight.reshape(shape) * parts)
        return total

    def row(self):
        """p of each node, and bounds on its errors; None without them."""
        nodes, m = self.graph.nodes, self.n - 1
        if not m:
            return np.zeros((nodes, 0)), np.zeros((nodes, 0))
        T = self._operator(self.D.mT)
        dT = self._operator(self.dA[:, 1:, 1:].mT + 2 * WEIGHED * np.abs(self.D.mT))
        h = self.summed(self.beta).ravel()
        dh = self.summed(self.dA[:, 0, 1:] + 2 * WEIGHED * np.abs(self.beta)).ravel()
        identity = np.eye(nodes * m)
        R = np.linalg.inv(identity - T)
        p = R @ h
        p += R @ (h - p + T @ p)
        rounding = BOUNDS_OF_DOUBLES * (nodes * m + 4) * UNIT_ROUNDING
        sizes = np.abs(h) + np.abs(p) + np.abs(T) @ np.abs(p)
        left = np.abs(h - p + T @ p) + dh + dT @ np.abs(p) + rounding * sizes
        z = np.abs(R) @ left
        G = np.abs(identity - R @ (identity - T)) + np.abs(R) @ dT
        G += rounding * np.abs(R) @ (identity + np.abs(T))
        # dp <= z + G dp, in the units in which z is 1.
        units = np.where(z > 0, z, z.max(initial=0.0) + LEAST_NORMAL)
        growth = float((G * (units / units[:, None])).sum(-1).max())
        if not growth < 0.5:
            return None
        dp = BOUNDS_OF_DOUBLES / 2 * units / (1 - growth)
        return p.reshape(nodes, m), dp.reshape(nodes, m)

    def _operator(self, matrices):
        """What `x_i = sum w M x_j` does to the vectors of all nodes."""
        nodes, m = self.graph.nodes, matrices.shape[-1]
        total = np.zeros((nodes, m, nodes, m))
        weighted = self.weight[:, None, None] * matrices
        np.add.at(total, (self.graph.source, slice(None), self.graph.target), weighted)
        return total.reshape(nodes * m, nodes * m)

    def forms_of_others(self, p):
        """Q that equals what e's own square brings to the other states, and Q that decays by the
        squares of these over their sizes."""
        m = self.n - 1
        nodes = self.graph.nodes
        pairs = np.einsum("eki,elj->eijkl", self.D, self.D).reshape(-1, m * m, m * m)
        of_forms = np.eye(nodes * m * m) - self._operator(pairs)
        cross = np.einsum("ei,ek,ekj->eij", self.beta, p[self.graph.target], self.D)
        own = self.beta[:, :, None] * self.beta[:, None]
        brought = self.summed(cross + cross.mT + own).reshape(-1)
        sizes = np.ones(m)
        for _ in range(4):  # rounds in which sizes of states are found
            forms = self._solved(of_forms, np.diag(sizes**-2.0))
            moments = self._solved(of_forms.T, np.diag(sizes**2.0))
            with np.errstate(all="ignore"):
                sizes = (np.diagonal(moments.sum(0)) / np.diagonal(forms.sum(0))) ** 0.25
            sizes = np.where(np.isfinite(sizes) & (sizes > 0), sizes, 1.0)
        base = np.linalg.solve(of_forms, brought).reshape(nodes, m, m)
        return base, self._solved(of_forms, np.diag(sizes**-2.0))

    def _solved(self, operator, matrix):
        nodes = self.graph.nodes
        right = np.tile(matrix.ravel(), nodes)
        return np.linalg.solve(operator, right).reshape(nodes, *matrix.shape)

    def forms(self, p, Q):
        """The forms P of the nodes."""
        P = np.zeros((self.graph.nodes, self.n, self.n))
        P[:, 0, 0] = 1.0
        P[:, 0, 1:] = p
        P[:, 1:, 0] = p
        P[:, 1:, 1:] = (Q + Q.mT) / 2
        return P

    def alpha(self, P):
        """alpha of each node, with which the decay at e is the same at all nodes."""
        through = np.einsum("ei,ei->e", P[self.graph.target][:, 0], self.b)
        own = -2 * self.summed(self.c[:, 0] * through)
        nodes = self.graph.nodes
        chain = np.zeros((nodes, nodes))
        np.add.at(chain, (self.graph.source, self.graph.target), self.weight)
        # alpha_i - sum w alpha_j + own_i = mean, with the first alpha 0.
        system = np.concatenate([(np.eye(nodes) - chain), -np.ones((nodes, 1))], axis=1)[:, 1:]
        solution = np.linalg.lstsq(system, -own, rcond=None)[0]
        return np.concatenate([[0.0], solution[:-1]])

    def shrink(self, P, dp, f) -> bool:
        """Whether the forms are proved to shrink for all numbers up to f."""
        alpha = self.alpha(P)
        dP = np.zeros_like(P)
        dP[:, 0, 1:] = dp
        dP[:, 1:, 0] = dp
        more = np.zeros_like(P)
        more[:, 0, 0] = f * np.abs(alpha)
        if not definite(P, dP + more):
            return False
        lead = np.zeros_like(P)
        lead[:, 0, 0] = alpha
        through = self.b[:, :, None] * self.c[:, None]
        of_through = np.abs(self.b)[:, :, None] * self.dc[:, None]
        of_through += self.db[:, :, None] * (np.abs(self.c) + self.dc)[:, None]
        of_through += UNIT_ROUNDING * np.abs(through)
        F = self._powers((self.A, through), (P, lead))
        terms = self._powers((np.abs(self.A), np.abs(through)), (np.abs(P), np.abs(lead)))
        wide = (np.abs(self.A) + self.dA, np.abs(through) + of_through)
        widest = self._powers(wide, (np.abs(P) + dP, np.abs(lead)))
        count = np.bincount(self.graph.source).max()
        rounding = (4 * self.n + 2 * count + 16) * UNIT_ROUNDING + 2 * WEIGHED
        R = [
            BOUNDS_OF_DOUBLES * (large - size + rounding * large)
            for size, large in zip(terms, widest, strict=True)
        ]
        whole = P - F[0]
        of_whole = R[0] + BOUNDS_OF_DOUBLES * rounding * np.abs(P)
        middle = np.zeros_like(P)
        middle[:, 1:, 1:] = whole[:, 1:, 1:]
        errors = np.zeros_like(P)
        errors[:, 1:, 1:] = of_whole[:, 1:, 1:]
        alpha_change = lead - F[1]
        middle[:, 0, 0] = alpha_change[:, 0, 0]
        errors[:, 0, 0] = (R[1] + BOUNDS_OF_DOUBLES * rounding * np.abs(lead))[:, 0, 0]
        root = np.sqrt(f)
        for power in range(1, len(F)):
            size = np.abs(F[power]) + R[power]
            errors[:, 1:, 1:] += f**power * size[:, 1:, 1:]
            across = root * f ** (power - 1) * size[:, 0, 1:]
            errors[:, 0, 1:] += across
            errors[:, 1:, 0] += across
            if power > 1:
                errors[:, 0, 0] += f ** (power - 1) * size[:, 0, 0]
        errors *= 1 + 64 * UNIT_ROUNDING
        return definite(*in_its_units(middle, errors))

    def _powers(self, A, P):
        """The coefficients of the powers of f in `sum w A' P_j A`, of `A + f through` and `P + f
        lead`."""
        powers = [np.zeros_like(P[0]) for _ in range(len(P) + 2 * len(A) - 2)]
        for i, left in enumerate(A):
            for j, form in enumerate(P):
                for k, right in enumerate(A):
                    powers[i + j + k] += self.summed(left.mT @ form[self.graph.target] @ right)
        return powers
