"""The search for forms in which what a wall stores falls, by an interior-point method: the finder,
whose finds are checked.

The largest t is looked for with which all matrices `F - t I` and P_i, g and h are positive, with
g + h < 1 for the weights: the barrier `-s t - sum log det (F - t I) - sum log det P_i - log g h (1 -
g - h)` is minimised while s grows. See S. Boyd, L. Vandenberghe, Convex Optimization (2004), chapter
11.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wavesweep.contact.stored_check import Conditions, Stored, Terms

CENTRED_DECREMENT = 0.1  # of Newton, squared, below which s grows
# Steps in which t has to change by such a share of itself; otherwise the point counts as the centre,
# since directions in which nothing is bounded can take hundreds of steps.
SLOW_STEPS, SLOW_SHARE = 5, 0.02
FIRST_FORMS, FIRST_WEIGHT = 0.1, 0.3
FIRST_ROOM = 0.1  # of the least eigenvalue, and at least so much: by which t begins below it
ROUNDED = 1e-12  # of the barrier, which rounding may add to it
SINGULAR = 1e-14  # added to the diagonal of the Hessian, in units in which that is 1
NO_ROOM = 1e-7  # of t, to which its maximum is known when a search ends without a find


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """Conditions at a wall as a linear matrix inequality in the packed forms, g, h and t.

    basis `(m, n, n)`: of symmetric matrices. slopes `(conditions, 2 m + 3, N, N)`: of F - t I in the
    unknowns `index` of each condition.
    """

    slopes: np.ndarray
    index: np.ndarray
    basis: np.ndarray
    nodes: int

    @staticmethod
    def of(conditions: Conditions, terms: Terms) -> Programme:
        """The inequality of conditions at one wall."""
        G = terms.G.value[:, None]
        n = G.shape[-2]
        row, column = np.triu_indices(n)
        m = row.size
        basis = np.zeros((m, n, n))
        basis[np.arange(m), row, column] = 1.0
        basis[np.arange(m), column, row] = 1.0
        count, N = terms.own.value.shape[:2]
        slopes = np.zeros((count, 2 * m + 3, N, N))
        slopes[:, :m, :n, :n] = basis
        slopes[:, m : 2 * m] = -(G.mT @ basis @ G)
        slopes[:, 2 * m] = terms.own.value
        slopes[:, 2 * m + 1] = terms.stored.value
        slopes[:, 2 * m + 2] = -np.eye(N)
        nodes = 1 + int(max(conditions.source.max(), conditions.target.max()))
        own = np.arange(m)
        last = np.broadcast_to(nodes * m + np.arange(3), (count, 3))
        index = np.concatenate(
            [conditions.source[:, None] * m + own, conditions.target[:, None] * m + own, last], 1
        )
        return Programme(slopes, index, basis, nodes)

    @property
    def size(self) -> int:
        """The number of unknowns."""
        return self.nodes * len(self.basis) + 3

    def slack(self, x: np.ndarray) -> np.ndarray:
        """F - t I."""
        count, _, N, _ = self.slopes.shape
        flat = self.slopes.reshape(count, -1, N * N)
        return (x[self.index][:, None] @ flat).reshape(count, N, N)

    def forms(self, x: np.ndarray) -> np.ndarray:
        """P at each node."""
        packed = x[:-3].reshape(self.nodes, -1)
        return np.tensordot(packed, self.basis, (1, 0))

    def start(self) -> np.ndarray:
        """Unknowns that begin a search."""
        x = np.zeros(self.size)
        x[:-3] = np.tile(FIRST_FORMS * (np.trace(self.basis, axis1=1, axis2=2) > 0), self.nodes)
        x[-3:-1] = FIRST_WEIGHT
        return x


@dataclass(frozen=True, slots=True, eq=False)
class Barrier:
    """What is least where t is large and all is far from being singular: `bounded' x - s t` less
    the logarithms of all determinants and scalars that have to be positive."""

    programme: Programme
    bounded: np.ndarray
    s: float

    @staticmethod
    def of(programme: Programme, s: float) -> Barrier:
        """The barrier of a programme, with the trace of all forms."""
        bounded = np.zeros(programme.size)
        on_diagonal = np.trace(programme.basis, axis1=1, axis2=2) > 0
        # Keeps those forms bounded that F does not bound.
        bounded[:-3] = np.tile(1.0 * on_diagonal, programme.nodes)
        return Barrier(programme, bounded, s)

    def factors(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Cholesky factors of all matrices that have to be positive; None if some are not."""
        if min(_scalars(x)) <= 0:
            return None
        try:
            slack = np.linalg.cholesky(self.programme.slack(x))
            return slack, np.linalg.cholesky(self.programme.forms(x))
        except np.linalg.LinAlgError:
            return None

    def value(self, x: np.ndarray, factors: tuple[np.ndarray, np.ndarray]) -> float:
        """The barrier at a point."""
        logs = [np.log(np.diagonal(each, axis1=-2, axis2=-1)).sum() for each in factors]
        linear = self.bounded @ x - self.s * x[-1]
        return float(linear - 2 * sum(logs) - np.log(_scalars(x)).sum())

    def newton_step(self, x, factors) -> tuple[np.ndarray, float]:
        """The step to where the barrier's quadratic model is least, and how fast the barrier falls
        at its begin."""
        gradient, hessian = _derivatives(self.programme, x, factors)
        gradient += self.bounded
        gradient[-1] -= self.s
        units = 1 / np.sqrt(np.diagonal(hessian))
        scaled = hessian * units[:, None] * units + SINGULAR * np.eye(units.size)
        step = -units * np.linalg.solve(scaled, units * gradient)
        return step, float(-gradient @ step)

    def lower_point(self, x, factors, step, descent):
        """A point along a step at which the barrier has fallen by a share of what its slope
        promises, with its factors; None if it would have to be too close."""
        before = self.value(x, factors)
        length = 1.0
        while length >= 1e-8:  # of a step
            tried = x + length * step
            tried_factors = self.factors(tried)
            if tried_factors is not None:
                after = self.value(tried, tried_factors)
                # A step has to bring a twentieth of the predicted descent.
                if after <= before - 0.05 * length * descent + ROUNDED * abs(before):
                    return tried, tried_factors
            length /= 2
        return None


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Forms that a search found, its unknowns x, and the weight s at which it ended."""

    stored: Stored
    x: np.ndarray
    s: float


def find_stored(conditions: Conditions, terms: Terms, near: Found | None = None) -> Found | None:
    """Return forms with which V falls at a wall; None if none are found.

    t is near its largest value, so that there is room for errors and for other walls. near: forms of a
    similar wall, to which those that are returned are similar.
    """
    programme = Programme.of(conditions, terms)
    x = _first_point(programme, near)
    # So many logarithms of eigenvalues and of scalars: a centre is within barriers/s of the largest t.
    count, N = terms.own.value.shape[:2]
    barriers = count * N + programme.nodes * programme.basis.shape[-1] + 3
    s = barriers / max(1.0, abs(x[-1])) if near is None else near.s
    barrier = Barrier.of(programme, s)
    factors = barrier.factors(x)
    if factors is None:
        return None
    path: list[float] = []  # t after each step since s was changed
    for _ in range(90 if near is None else 40):  # Newton's steps
        step, descent = barrier.newton_step(x, factors)
        lower = barrier.lower_point(x, factors, step, descent)
        if lower is None:
            return None
        x, factors = lower
        t = x[-1]
        path.append(t)
        slow = False
        if len(path) > SLOW_STEPS:
            slow = abs(t - path[-1 - SLOW_STEPS]) <= SLOW_SHARE * abs(t)
        # Up to 400 conditions times their size each centre is waited for.
        is_centre = descent < CENTRED_DECREMENT or (slow and barriers > 400)
        gap = barriers / barrier.s
        suffices = near is not None or gap <= t
        if t > 1e-7 and is_centre and suffices:  # forces are of size 1
            P = programme.forms(x)
            stored = Stored((P + P.mT) / 2, float(x[-3]), float(x[-2]))
            return Found(stored, x, barrier.s)
        if is_centre:
            if near is not None or gap < max(-t, NO_ROOM):
                break
            barrier = replace(barrier, s=barrier.s * 8.0)
            path = []
    return None


def _first_point(programme, near):
    """A point at which all is positive, since t is below the least eigenvalue of all F."""
    x = programme.start() if near is None else near.x.copy()
    x[-1] = 0.0
    least = float(np.linalg.eigvalsh(programme.slack(x)).min())
    if near is not None and least > 0:
        x[-1] = least / 2
        return x
    x[-1] = least - FIRST_ROOM * abs(least)
    if near is None:
        x[-1] -= max(0.0, FIRST_ROOM - FIRST_ROOM * abs(least))
    return x


def _scalars(x):
    """What has to be positive beside the matrices: g, h, and what is left of their sum to 1."""
    g, h = x[-3:-1]
    return np.array([g, h, 1 - g - h])


def _derivatives(programme, x, factors):
    """Gradient and Hessian of the barrier without its linear terms."""
    of_slack, of_forms = factors
    inverse = np.linalg.inv(of_slack)[:, None]
    seen = inverse @ programme.slopes @ inverse.mT
    flat = seen.reshape(*seen.shape[:2], -1)
    index = programme.index
    size = programme.size
    of_each = -np.trace(seen, axis1=2, axis2=3)
    gradient = np.bincount(index.ravel(), of_each.ravel(), size)
    places = (index[:, :, None] * size + index[:, None]).ravel()
    hessian = np.bincount(places, (flat @ flat.mT).ravel(), size**2).reshape(size, size)
    inverse = np.linalg.inv(of_forms)[:, None]
    seen = inverse @ programme.basis @ inverse.mT
    flat = seen.reshape(*seen.shape[:2], -1)
    m = len(programme.basis)
    of_nodes = flat @ flat.mT
    gradient[:-3] -= np.trace(seen, axis1=2, axis2=3).ravel()
    for node in range(programme.nodes):
        own = slice(node * m, (node + 1) * m)
        hessian[own, own] += of_nodes[node]
    g, h, left = 1 / _scalars(x)
    gradient[-3:-1] += left - np.array([g, h])
    hessian[-3:-1, -3:-1] += left**2 + np.diag([g**2, h**2])
    return gradient, hessian
