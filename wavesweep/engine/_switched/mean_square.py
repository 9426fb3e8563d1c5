"""Loops whose messages are lost at random, or whose frames are at random: whether the mean square
of all states decays, and the interval for which it does.

Both are Markov chains. Of frames, the nodes are the length of the last one, where anything depends
on it. Of messages, they are the moments at which channels send, together with whether each channel
is in a burst of losses (E. N. Gilbert, Capacity of a burst-noise channel, Bell Syst. Tech. J. 39,
1960; E. O. Elliott, the same, 42, 1963). Edges carry a matrix and its probability. Second moments
`X_i = E[x x'; node i]` become `X_j = sum w A X_i A'` over the edges from i to j. They decay if the
spectral radius of this operator is below 1, and if and only if there are forms P_i > 0 with `P_i -
sum w A' P_j A > 0`, the sum over the edges that leave i (O. L. V. Costa, M. D. Fragoso, R. P.
Marques, Discrete-time Markov jump linear systems, Springer 2005, theorem 3.9). Such forms, checked
in `norm_check`, are a proof; an eigenvalue of the operator outside the unit circle for all matrices
within the errors is a refutation.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from math import comb
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import Chebyshev, chebpts2

from wavesweep.engine._sets.taylor_models import Polynomials
from wavesweep.engine._stability.spectrum import count_outside
from wavesweep.engine._switched.brackets import Bracket, Refuted
from wavesweep.engine._switched.graph import Graph
from wavesweep.engine._switched.loop_frames import LoopFrames
from wavesweep.engine._switched.norm_check import Norms, shrink_on_average, shrink_over
from wavesweep.engine._switched.norms import acting, packed, unpacked
from wavesweep.engine._switched.stretches import ProvedStretch
from wavesweep.engine.doubles import BY_TWO, EPS, FEW_ROUNDINGS

# Of the search for zeros: degree and most panels; a panel's narrowest part of the whole, its
# largest last coefficient, and the least size at all of its points but two, relative to the
# largest.
DEGREE, PANELS, NARROWEST, RESOLVED, EVEN = 24, 200, 1e-9, 1e-9, 1e-5
# of a number where moments stop to decay, how far beyond it is refuted
BEYOND = (1e-10, 1e-8, 1e-6, 1e-5)
# of the whole way and of the number, how near to the refuted one the proof goes
PROOF_DISTANCE = 1e-5
LEAST_AWAY = 0.01  # of half of an interval, how near at least
TRIES = 1000  # stretches that are tried where moments grow
WORK = 10**9  # entries of all of these, times their rows
SIZING = 6  # rounds in which sizes of states are found
CUBIC = 3  # degree of a linear form between matrices that are linear
CHANCE_ROUNDING = 64 * EPS  # of a probability that is a product of a few numbers


@dataclass(frozen=True, slots=True, eq=False)
class Chances:
    """A family whose matrices have probabilities, along a number that either matrices or
    probabilities depend on.

    family: along the number if matrices depend on it. graph: the chain; edges whose probability is
    always 0 are left out. factors: of the probability of each edge, at values 0 and 1 of the number
    if it is one of them, `(edges, factors, 2)`. in_matrices: whether matrices depend on the number,
    and probabilities do not.
    """

    family: LoopFrames
    graph: Graph
    factors: np.ndarray
    in_matrices: bool

    def weights(self, low: float, high: float) -> np.ndarray:
        """The probabilities from low to high as control points of polynomials in the number,
        `(points, edges)`.

        With x = low + t (high - low) the product of n factors (1 - t) a_i + t b_i is
        `sum_k c_k t^k (1 - t)^(n - k)`. Its control points are c_k/binomial(n, k), and for t from 0
        to 1 it is a convex combination of these. One point if low is high or none depends on x.
        """
        slope = self.factors[..., 1] - self.factors[..., 0]
        ends = np.clip(
            np.stack([self.factors[..., 0] + x * slope for x in (low, high)], -1), 0.0, 1.0
        )
        if low == high or self.in_matrices:
            return ends[..., 0].prod(-1)[None]
        count = ends.shape[1]
        weights = np.ones((len(ends), 1))
        for i in range(count):
            longer = np.zeros((len(ends), weights.shape[1] + 1))
            longer[:, :-1] += weights * ends[:, i, :1]
            longer[:, 1:] += weights * ends[:, i, 1:]
            weights = longer
        return (weights / [comb(count, k) for k in range(count + 1)]).T

    def probable(self, low: float, high: float) -> tuple[float, float]:
        """The part of an interval in which all probabilities are at least 0 and at most 1."""
        first = self.factors[..., 0].ravel()
        slope = np.diff(self.factors).ravel()
        moves = slope != 0
        first = first[moves]
        slope = slope[moves]
        ends = np.sort([-first / slope, (1 - first) / slope], axis=0)
        return float(ends[0].max(initial=low)) + 0.0, float(ends[1].min(initial=high))

    def at(self, x: float) -> tuple[np.ndarray, np.ndarray]:
        """The matrices of the symbols and the probabilities of the edges at x, in plain doubles."""
        return self.family.at(x if self.in_matrices else 0.0), self.weights(x, x)[0]

    def proves(self, P: np.ndarray, low: float, high: float) -> bool:
        """Whether these forms are proved to decay on average for all numbers from low to high."""
        points = self._hull(low, high)
        if points is None:
            return False
        weights = self.weights(low, high)
        norms = Norms(P, self.graph)
        for weight in weights:
            for E, dE in zip(*points, strict=True):
                if not shrink_on_average(norms, weight, E, dE):
                    return False
        return True

    def proves_between(self, P: np.ndarray, low: float, high: float) -> bool:
        """Whether the forms between those at both ends, `(2, nodes, n, n)`, are proved to decay on
        average for the numbers between these, if matrices depend on the number."""
        points = self._hull(low, high) if self.in_matrices else None
        if points is None:
            return False
        E, dE = points
        A, slope, rest = _line(E + np.eye(E.shape[-1]))
        rest = rest + dE.max(0) + FEW_ROUNDINGS * (np.abs(A) + np.abs(slope))
        nothing = np.zeros_like(A)
        forms = np.stack([(P[0] + P[1]) / 2, (P[1] - P[0]) / 2])
        along = np.concatenate([forms, np.zeros_like(forms)])
        proved, _ = shrink_over(
            Polynomials(along, np.zeros_like(P[0]), 1, CUBIC),
            self.graph,
            Polynomials(np.stack([A, slope, nothing, nothing]), rest, 1, CUBIC),
            None,
            self.weights(low, low)[0],
        )
        return proved

    def _hull(self, low: float, high: float) -> tuple[np.ndarray, np.ndarray] | None:
        """Control points of the matrices from low to high, and bounds on their errors; or None."""
        if self.in_matrices:
            return self.family.hull(low, high)
        E, dE = self.family.enclosed(0.0)
        return E[None], dE[None]

    def operator(self, x: float) -> np.ndarray:
        """What becomes of second moments at x, as a matrix for vectors of their entries."""
        A, weight = self.at(x)
        return operator_of(A, self.graph, weight)

    def decays(self, x: float) -> bool:
        """Whether second moments decay at x, in plain doubles: only then are the forms definite."""
        try:
            np.linalg.cholesky(self.forms(x, np.ones(self.family.kept.size)))
        except np.linalg.LinAlgError:
            return False
        return True

    def refuted(self, x: float) -> bool:
        """Whether second moments are proved to grow at x."""
        enclosed = self._enclosed(x, x)
        return enclosed is not None and _grow(enclosed[0], enclosed[2])

    def grow(self, low: float, high: float) -> bool:
        """Whether second moments are proved to grow at all numbers from low to high.

        The spectral radius of the operator is one of its eigenvalues, see `parts_that_decay`. It is
        above m at all of them if it is in the middle, and if no operator `L + s D` within its
        errors, s from -1 to 1, has the eigenvalue m. With an approximate inverse C of `m - L` that
        is so if the spectral radius of `|1 - C (m - L)| + |C D| + |C| errors` is below 1 (S. M.
        Rump, Verification methods, Acta Numerica 19, 2010). m is half-way to the next real
        eigenvalue, but at least 1.
        """
        enclosed = self._enclosed(low, high)
        if enclosed is None:
            return False
        value, slope, off = enclosed
        identity = np.eye(len(value))
        eigenvalues = np.linalg.eigvals(value)
        is_real = np.abs(eigenvalues.imag) < 1e-9 * np.abs(eigenvalues)
        *_, next_, radius = np.sort(np.append(eigenvalues.real[is_real], [0, 0]))
        m = (radius + max(next_, 1.0)) / 2
        rounding = 4 * len(identity) * EPS
        middle = self._enclosed((low + high) / 2, (low + high) / 2)
        if radius <= 1 or middle is None or not _grow(middle[0] / m, middle[2] / m):
            return False
        with suppress(np.linalg.LinAlgError):  # singular
            C = np.linalg.inv(m * identity - value)
            size = np.abs(identity - C @ (m * identity - value)) + np.abs(C @ slope)
            size += np.abs(C) @ (off + rounding * (m * identity + np.abs(value) + np.abs(slope)))
            u = np.linalg.solve((1 - rounding) * identity - size, np.ones(len(identity)))
            return bool((u > 0).all() and (size @ u < (1 - rounding) * u).all())
        return False

    def _enclosed(
        self, low: float, high: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """The operator from low to high as `L + s D` and bounds on the rest, s from -1 to 1;
        None if it is not known."""
        points = self._hull(low, high)
        if points is None:
            return None
        E, dE = points
        A, D, rest = _line(E + np.eye(E.shape[-1]))
        weight, weight_slope, change = _line(self.weights(low, high))
        A_size = np.abs(A)
        moved = np.abs(D)
        off = rest + dE.max(0)
        acting = _acting(A)
        larger = _acting(A_size + moved + off)
        slope = _acting(A + D) - acting - _acting(D)
        error = larger - _acting(A_size + moved) + _acting(moved) + CHANCE_ROUNDING * larger
        weight = weight[:, None, None]
        weight_slope = weight_slope[:, None, None]
        change = change[:, None, None]
        of_edges = self.graph.symbol
        acting = acting[of_edges]
        slope = slope[of_edges]
        error = error[of_edges]
        larger = larger[of_edges]
        rest = weight * error + change * larger
        rest += np.abs(weight_slope) * (larger - np.abs(acting))
        L = _summed(weight * acting, self.graph)
        D = _summed(weight * slope + weight_slope * acting, self.graph)
        return L, D, _summed(rest, self.graph)

    def forms(self, x: float, size: np.ndarray) -> np.ndarray:
        """Forms that decay at x, on average by the squares of the states over their sizes, NaN
        where there are none."""
        return self._solved(self.operator(x).T, size**-2.0)

    def sizes(self, x: float) -> np.ndarray:
        """Sizes of the states, `(n,)`, in whose units second moments under noise and forms have
        similar entries."""
        size = np.ones(self.family.kept.size)
        operator = self.operator(x)
        for _ in range(SIZING):
            moments = self._solved(operator, size**2)
            forms = self._solved(operator.T, size**-2.0)
            with np.errstate(
                all="ignore"
            ):  # next to where moments do not decay rounding makes them negative
                size = (np.diagonal(moments.sum(0)) / np.diagonal(forms.sum(0))) ** 0.25
        return size

    def _solved(self, operator: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
        """The matrices at the nodes that the operator changes by this diagonal matrix."""
        nodes = self.graph.nodes
        n = diagonal.size
        right_side = np.tile(packed(np.diag(diagonal)), nodes)
        solution = np.full((nodes, n, n), np.nan)
        with suppress(np.linalg.LinAlgError):  # singular where moments stop to decay
            solution = unpacked(
                np.linalg.solve(np.eye(right_side.size) - operator, right_side).reshape(nodes, -1),
                n,
            )
        return solution


def operator_of(A: np.ndarray, graph: Graph, weight: np.ndarray) -> np.ndarray:
    """Return what becomes of second moments, as a matrix for vectors of their entries.

    A: of each symbol; weight: of each edge.
    """
    return _summed(weight[:, None, None] * _acting(A)[graph.symbol], graph)


def _summed(parts: np.ndarray, graph: Graph) -> np.ndarray:
    size = parts.shape[-1]
    nodes = graph.nodes
    total = np.zeros((nodes, size, nodes, size))
    edges: Any = (graph.target, slice(None), graph.source)  # which numpy's types do not know
    np.add.at(total, edges, parts)
    return total.reshape(nodes * size, nodes * size)


def _grow(operator: np.ndarray, off: np.ndarray) -> bool:
    """Whether an operator within these errors has an eigenvalue outside the unit circle."""
    identity = np.eye(len(operator))
    count, clear = count_outside(
        (operator - identity)[None], (off + CHANCE_ROUNDING * identity)[None]
    )
    return bool(count[0] > 0 and clear[0])


def _line(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is on a Bezier curve: `middle + s slope`, s from -1 to 1, and bounds on the rest;
    points: control points."""
    n = len(points) - 1
    if not n:
        return points[0], 0 * points[0], 0 * points[0]
    middle = (points[-1] + points[0]) / 2
    slope = (points[-1] - points[0]) / 2
    line = middle + np.multiply.outer(np.linspace(-1, 1, n + 1), slope)
    return middle, slope, np.abs(points - line).max(0)


def _acting(A: np.ndarray) -> np.ndarray:
    """The maps `X -> A X A'` of symmetric matrices, as matrices for vectors of `packed`."""
    return acting(A[:, :, :, None, None] * A[:, None, None], A.shape[-1])


def decays(loop: Chances) -> str:
    """Whether second moments decay: "proved", "refuted" or "unknown"."""
    if not loop.decays(0.0):
        if loop.refuted(0.0):
            return "refuted"
        return "unknown"
    P = loop.forms(0.0, loop.sizes(0.0))
    if loop.proves(P, 0.0, 0.0):
        return "proved"
    return "unknown"


def brackets_on_average(loop: Chances, limits: tuple[float, float]) -> list[Bracket]:
    """Return the numbers within limits for which second moments decay, an element for each
    interval; see `Bracket`.

    An interval's proof holds for every number of it, by forms on stretches without a gap. Intervals
    are searched in plain doubles: one that is much narrower than a panel of `_zeros` may be missed.
    """
    limits = loop.probable(*limits)
    rows = []
    for stretch in parts_that_decay(loop, *limits):
        row = _bracket(loop, stretch, limits)
        if row.low < row.high:
            rows.append(row)
    return rows


def parts_that_decay(loop: Chances, low: float, high: float) -> list[tuple[float, float]]:
    """Return the parts of an interval in which second moments decay, in plain doubles.

    The operator maps semidefinite matrices to such. So its spectral radius is one of its
    eigenvalues (M. G. Krein and M. A. Rutman, Linear operators leaving invariant a cone, Uspekhi
    Mat. Nauk 3, 1948), and passes 1 only where `I - operator` is singular.
    """

    def distance(x: float) -> tuple[float, float]:
        operator = loop.operator(x)
        return np.linalg.slogdet(np.eye(len(operator)) - operator)

    zeros = sorted(_zeros(distance, low, high))
    edges = [low, *(x for x in zeros if low < x < high), high]
    middles = [(first + second) / 2 for first, second in pairwise(edges)]
    stable = [loop.decays(x) for x in middles]
    stretches: list[tuple[float, float]] = []
    for i, inside in enumerate(stable):
        if inside and stretches and stretches[-1][1] == edges[i] and loop.decays(edges[i]):
            stretches[-1] = stretches[-1][0], edges[i + 1]
        elif inside:
            stretches.append((edges[i], edges[i + 1]))
    outside = [x for x, inside in zip(middles, stable, strict=True) if not inside]
    polished = []
    for stretch in stretches:
        ends = []
        for end in stretch:
            if end in (low, high):
                ends.append(end)
            else:
                ends.append(_polished(loop, stretch, end, outside))
        polished.append((ends[0], ends[1]))
    return polished


def grows_everywhere(loop: Chances, low: float, high: float) -> bool:
    """Return whether second moments are proved to grow at all numbers of an interval in which
    probabilities can be."""
    open_ = [loop.probable(low, high)]
    for _ in range(min(TRIES, WORK // len(loop.operator(open_[0][0])) ** 3)):
        if not open_:
            return True
        left, right = open_.pop()
        middle = (left + right) / 2
        if left < right and not loop.grow(left, right):
            if loop.decays(middle):
                return False
            open_ += [(middle, right), (left, middle)]
    return False


def nearest_growing(
    loop: Chances,
    start: float,
    limit: float,
    scanned: int = 24,  # numbers at which the nearest one is looked for where moments grow
) -> Refuted:
    """Return the refuted number closest to the start, towards a limit, that a scan finds, if it
    finds one."""
    inside = start
    for outside in [
        start,
        *(start + (limit - start) * np.geomspace(1e-4, 1.0, scanned)[-scanned:]),
    ]:
        if not loop.decays(outside):
            break
        inside = outside
    else:
        return Refuted()
    for _ in range(BY_TWO if inside != outside else 0):
        middle = (inside + outside) / 2
        if loop.decays(middle):
            inside = middle
        else:
            outside = middle
    return _refuted_beyond(loop, outside, limit - start)


def _refuted_beyond(loop: Chances, end: float, way: float) -> Refuted:
    """What is refuted next to an end of what decays, on the way to a limit, if anything is."""
    for step in BEYOND:
        x = float(end + step * np.sign(way) * max(abs(end), 1e-6 * abs(way)))
        if loop.refuted(x):
            return Refuted(x, (0,))
    return Refuted()


def _polished(
    loop: Chances, part: tuple[float, float], end: float, outside: Sequence[float]
) -> float:
    """An end of a part by bisection, between its middle and the next one outside."""
    inside = sum(part) / 2
    beyond = min(
        (x for x in outside if (x - end) * (end - inside) > 0),
        key=lambda x: abs(x - end),
        default=end,
    )
    for _ in range(BY_TWO):
        middle = (inside + beyond) / 2
        if loop.decays(middle):
            inside = middle
        else:
            beyond = middle
    return inside


def _zeros(
    function: Callable[[float], tuple[float, float]], low: float, high: float
) -> list[float]:
    """The zeros of an analytic function within an interval, given as sign and logarithm of its
    size.

    They are those of Chebyshev interpolants. A panel is halved until the coefficients fall, and
    until the function is of similar size at most of its points, after an exponential between two of
    them is divided out.
    """
    points = chebpts2(DEGREE + 1)
    found = []
    panels = [(low, high)]
    for _ in range(PANELS):
        if not panels:
            break
        left, right = panels.pop(0)
        with np.errstate(all="ignore"):
            sign, size = np.array(
                [function(x) for x in (left + right) / 2 + (right - left) / 2 * points]
            ).T
            size = size - (size[-4] - size[3]) / (points[-4] - points[3]) * points
            values = sign * np.exp(size - size.max())
            series = Chebyshev.fit(points, values, DEGREE, domain=(-1, 1))
        tail = np.abs(series.coef[-2:]).max()
        if right - left > NARROWEST * (high - low) and not (
            tail < RESOLVED and np.sort(np.abs(values))[2] > EVEN
        ):
            panels += [(left, (left + right) / 2), ((left + right) / 2, right)]
        elif np.isfinite(values).all():
            zeros = series.roots()
            zeros = zeros.real[(np.abs(zeros.imag) < 1e-3) & (np.abs(zeros.real) <= 1)]
            found += ((left + right) / 2 + (right - left) / 2 * zeros).tolist()
    return found


def _bracket(loop: Chances, part: tuple[float, float], limits: tuple[float, float]) -> Bracket:
    """What is proved of a part, from its middle on, and what is refuted beyond its ends."""
    sides = [_side(loop, sum(part) / 2, *ends) for ends in zip(part, limits, strict=True)]
    (low, below, down), (high, above, up) = sides
    stretches = sorted((*down, *up), key=lambda stretch: stretch.low)
    return Bracket(low, high, below, above, tuple(stretches))


def _proved(
    loop: Chances, start: float, P_start: np.ndarray, end: float, P_end: np.ndarray
) -> ProvedStretch | None:
    """The stretch between two numbers, proved by forms that move from one's to the other's or by those
    of the end; None if neither proves it."""
    low, high = sorted((start, end))
    between = [P_start, P_end] if start < end else [P_end, P_start]
    if loop.proves_between(np.stack(between), low, high):
        proof = between
    elif loop.proves(P_end, low, high):
        proof = [P_end]
    else:
        return None
    return ProvedStretch(low, high, tuple(Norms(P, loop.graph) for P in proof))


def _side(
    loop: Chances, start: float, end: float, limit: float
) -> tuple[float, Refuted, list[ProvedStretch]]:
    """The number that the proof reaches towards an end, what is refuted beyond it, and the
    stretches.

    Where moments stop to decay is known to all digits, so that no search sets the goal.
    """
    refuted = Refuted()
    goal = end
    distance = limit - start
    if end != limit:
        refuted = _refuted_beyond(loop, end, distance)
        if abs(refuted.x - start) > abs(distance):
            refuted = Refuted()
        goal -= np.sign(distance) * min(
            PROOF_DISTANCE * (abs(end) + 1e-3 * abs(distance)), LEAST_AWAY * abs(end - start)
        )
    stretches: list[ProvedStretch] = []
    at = start
    known = loop.forms(at, loop.sizes(at))
    step = goal - start
    failed = False
    while at != goal and len(stretches) < 200 and abs(step) > 1e-9 * abs(goal - start):  # stretches
        to = goal if abs(goal - at) <= abs(step) else at + step
        P = loop.forms(to, loop.sizes(to))
        stretch = _proved(loop, at, known, to, P)
        if stretch:
            stretches.append(stretch)
            known = P
            at = to
            step = step if failed else 2 * step
            failed = False
        else:
            step = step / 2
            failed = True
    return float(at), refuted, stretches
