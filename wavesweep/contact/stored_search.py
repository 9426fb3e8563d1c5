"""The search for forms in which what a wall stores falls, a semidefinite programme: the finder, whose
finds are checked by (3) of `checker/contact.py`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from wavesweep.engine.switched import Inequality, minimised, symmetric_basis

LEAST_ROOM = 2e-9  # of the condition, where forces are of size 1: the check decides
OF_LAST = 3  # memory of the last sample: x, v and u


@dataclass(frozen=True, slots=True, eq=False)
class WallSamples:
    """Frames without the wall, each up to its sample, in doubles:

        eta+ = A eta + b u,   p+ = p + l' eta + r u,   x = p + o' eta + d_x u,   v = c' eta + d_v u.

    moved `(frames, n, n + 1)`: A and b; read `(frames, 2, n + 1)`: (o, d_x) and (c, d_v); slide `(frames,
    n + 1)`: (l, r); drifts: whether p is there, or else slide is 0. follows: which frame (column) may come
    after which (row).
    """

    moved: np.ndarray
    read: np.ndarray
    slide: np.ndarray
    drifts: bool
    follows: np.ndarray

    def in_units(self) -> tuple[WallSamples, np.ndarray, float]:
        """Return the frames in units, powers of two, in which all that a force of 1 moves is about 1; the
        units of the states, and that of p."""
        A = self.moved[:, :, :-1]
        b = self.moved[:, :, -1]
        n = b.shape[1]
        gramian = np.zeros((n, n))
        with np.errstate(all="ignore"):
            for _ in range(200):  # frames of whose sum units follow
                gramian = (A @ gramian @ A.mT + b[:, :, None] * b[:, None]).mean(0)
        size = np.sqrt(np.diagonal(gramian))
        known = np.isfinite(size) & (size > 0)
        units = np.exp2(np.round(np.log2(np.where(known, size, 1.0))))
        if self.drifts:
            omega = np.linalg.pinv(np.eye(n) - A.mean(0).T) @ self.slide[:, :n].mean(0)
            size_of_read = float(np.abs(self.slide[:, n] + b @ omega).mean())
        else:
            size_of_read = float(np.abs(self.read[:, 0] * np.append(units, 1.0)).max())
        unit = 2.0 ** round(np.log2(size_of_read)) if size_of_read > 0 else 1.0
        columns = np.append(units, 1.0)
        moved = self.moved * columns / units[:, None]
        read = self.read * columns / unit
        slide = self.slide * columns / unit
        return WallSamples(moved, read, slide, self.drifts, self.follows), units, unit


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """Frames between nodes that know the last few of them. edges `(edges, 3)`: source, frame, target."""

    nodes: int
    edges: np.ndarray

    @staticmethod
    def of(follows: np.ndarray, known: int) -> Graph:
        """The graph whose nodes know so many frames; see `WallSamples`."""
        words = _words(follows, known)
        number = {word: node for node, word in enumerate(words)}
        steps = _words(follows, known + 1)
        edges = [(number[word[:-1]], word[-1], number[word[1:]]) for word in steps]
        return Graph(len(words), np.array(edges))


def _words(follows, length):
    """All sequences of so many frames that are allowed."""
    words = [()]
    for _ in range(length):
        pairs = product(words, range(len(follows)))
        words = [(*word, i) for word, i in pairs if not word or follows[word[-1], i]]
    return words


@dataclass(frozen=True, slots=True, eq=False)
class Stored:
    """Roots L of forms P = L' L at the nodes, over states and x, v and u of the last sample, for each of
    one or two walls, `(walls, nodes, n + 3, n + 3)`; the weights h, and g and a of each edge, `(edges, 2)`."""

    L: np.ndarray
    h: float
    weights: np.ndarray


def find_stored(
    frames: WallSamples, graph: Graph, walls: Sequence[tuple[float, float]]
) -> Stored | None:
    """Return forms with which V falls at a wall (K, B), or at two and so at all between them; None if
    none are found.

    With one wall the last sample takes part by `m = f_before - K p` and u alone, as nothing else of it is
    in (3). The largest t is looked for with which all that is left over is above t I, all forms are
    positive, and no weight is above 1: so there is room for errors. frames: in units.
    """
    terms = [_terms(frames, wall) for wall in walls]
    source, frame, target = graph.edges.T
    count = len(source)
    N = terms[0].moved.shape[-1]
    basis = symmetric_basis(N - 1)
    m = len(basis)
    # Numbers of the unknowns: coordinates of the forms by wall and node, h, the weights, and t.
    forms = np.arange(len(walls) * graph.nodes * m).reshape(len(walls), graph.nodes, m)
    h = forms.size
    kinds = 1 if frames.drifts else 2
    weights = h + 1 + np.arange(count * kinds).reshape(count, kinds)
    t = h + 1 + weights.size
    h_of_edges = np.full((count, 1), h)
    t_of_edges = np.full((count, 1), t)
    inequalities = []
    for of_wall, P in zip(terms, forms, strict=True):
        unknowns = [P[source], P[target], h_of_edges, weights, t_of_edges]
        slopes = _slopes(of_wall, frame, basis, kinds)
        index = np.concatenate(unknowns, axis=1)
        inequalities.append(Inequality(np.zeros((count, N, N)), slopes, index))
    of_nodes = forms.reshape(-1, m)
    slopes = np.broadcast_to(basis, (len(of_nodes), *basis.shape))
    inequalities.append(Inequality(np.zeros((len(of_nodes), N - 1, N - 1)), slopes, of_nodes))
    # A small share of all traces beside t keeps those bounded that the condition does not bound.
    cost = np.zeros(t + 1)
    cost[of_nodes] = 1e-9 * np.trace(basis, axis1=1, axis2=2)
    cost[t] = -1.0
    bounded = np.zeros((2 * (t - h), t + 1))
    bounded[: t - h, h:t] = -np.eye(t - h)
    bounded[t - h :, h:t] = np.eye(t - h)
    x = minimised(cost, inequalities, bounded, np.repeat([0.0, 1.0], t - h))
    if not (np.isfinite(x).all() and x[t] > LEAST_ROOM):
        return None
    P = np.tensordot(x[forms], basis, (2, 0))
    weights_of_edges = np.zeros((count, 2))
    weights_of_edges[:, ::-1][:, :kinds] = np.maximum(x[weights], 0.0)
    try:
        last = frames.read.copy()
        last[:, 0] -= frames.slide
        beside = 1e-2 * x[t] / (1 + np.square(last).sum(-1).max(0))
        roots = [_over_last(of_wall, wall, beside) for of_wall, wall in zip(P, walls, strict=True)]
    except np.linalg.LinAlgError:
        return None
    return Stored(np.array(roots), float(max(x[h], 0.0)), weights_of_edges)


def _slopes(of_wall: _Terms, frame: np.ndarray, basis: np.ndarray, kinds: int) -> np.ndarray:
    """What each unknown adds to the condition of each edge from i to j, `(edges, unknowns, N, N)`:

        P_i - M' P_j M - h rise - a (rise - last) - g own - t I >= 0,

    in coordinates of P_i and P_j, h, the weights a and, if there are two kinds, g, and t.
    """
    moved = of_wall.moved[frame][:, None]
    m = len(basis)
    N = moved.shape[-1]
    slopes = np.zeros((len(frame), 2 * m + 2 + kinds, N, N))
    slopes[:, :m, :-1, :-1] = basis
    slopes[:, m : 2 * m] = -(moved.mT @ basis @ moved)
    of_forces = (of_wall.rise, of_wall.rise - of_wall.last, of_wall.own)
    for place, term in enumerate(of_forces[: 1 + kinds]):
        slopes[:, 2 * m + place] = -term[frame]
    slopes[:, -1] = -np.eye(N)
    return slopes


@dataclass(frozen=True, slots=True, eq=False)
class _Terms:
    """Frames over (eta, m, u_before, u). moved: (eta, m, u_before) of the next; and the matrices of
    `u (f - f_before)`, `u_before (f - f_before)` and `u f`."""

    moved: np.ndarray
    rise: np.ndarray
    last: np.ndarray
    own: np.ndarray


def _terms(frames: WallSamples, wall: tuple[float, float]) -> _Terms:
    """The terms of a wall (K, B), whose force is u and whose linear force is `K x + B v`; f is what
    is between them, `f = K x + B v - u`. Each is a row over (eta, m, u_before, u)."""
    K, B = wall
    n = frames.moved.shape[1]

    def wide(rows):
        """Rows over (eta, u), with 0 for m and u_before between these."""
        return np.insert(rows, [n, n], 0.0, axis=-1)

    *_, m, before, u = np.eye(n + 3)
    f = wide(K * frames.read[:, 0] + B * frames.read[:, 1]) - u
    next_m = f - K * wide(frames.slide)
    next_u = np.broadcast_to(u, next_m.shape)
    moved = np.concatenate([wide(frames.moved), next_m[:, None], next_u[:, None]], axis=1)
    return _Terms(moved, _product(u, f - m), _product(before, f - m), _product(u, f))


def _product(row, rows):
    """The symmetric matrices of products of a row and others."""
    matrix = row[:, None] * rows[:, None]
    return (matrix + matrix.mT) / 2


def _over_last(P, wall, beside):
    """Roots of forms over (eta, x, v, u_before); beside: of x^2 and v^2, which hardly takes of the room."""
    n = P.shape[-1] - 2
    T = np.zeros((n + 2, n + OF_LAST))
    T[:n, :n] = np.eye(n)
    T[n, n:] = *wall, -1.0
    T[n + 1, n + 2] = 1.0
    of_last = np.diag([*np.zeros(n), *beside, 0.0])
    return np.linalg.cholesky(T.T @ P @ T + of_last).mT
