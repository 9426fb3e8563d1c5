"""The mean square of a signal under white noise while frames, or messages, are at random.

The second moments at the nodes of a Markov chain follow

    X_j = sum w (A X_i A' + pi_i G G'),    x+ = A x + G u,  y = O x + T u,

over the edges from i to j of probability w, pi being the probabilities of the nodes (O. L. V. Costa,
M. D. Fragoso, R. P. Marques, Discrete-time Markov jump linear systems, Springer 2005, section 3.4).
The mean square of y over all ticks is

    sum w tr(O X_i O' + pi_i T T') / sum w pi_i n,

n being the ticks of a frame. Both are linear equations, whose solutions are had with bounds on all
errors. On a panel of a number the value differs from that in the middle by what it does on a rim
of complex numbers, see `enclosed`, if neither equation is singular within it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wavesweep.engine.doubles import EPS, FEW_ROUNDINGS
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.frames import Bounded, solve
from wavesweep.engine.intervals import Intervals
from wavesweep.engine.switched import Graph, acting, packed
from wavesweep.require.between import determinants, needed, poles_inside
from wavesweep.require.disc_panels import (
    BAD,
    GOOD,
    HALF_RIM,
    OPEN,
    Accuracy,
    Domain,
    along_panels,
)
from wavesweep.require.enclosed import Enclosed, moved_from_middle
from wavesweep.require.gain_intervals import END_EXACTNESS
from wavesweep.require.maps import over_frame

CHANCE_ROUNDING = 64 * EPS  # of a probability that is a product of a few numbers


def mean_square_at_random(
    frames: Sequence[Sequence[Bounded]], ticks: np.ndarray, graph: Graph, weight: Bounded
) -> Enclosed:
    """The mean square of the output on a panel of loops whose second moments decay there, by the
    formulas above.

    frames: E less identity, G, O and T of each symbol at the middle of the panel and on its rim,
    `(points, ...)`; ticks: of each symbol; weight: the probability of each edge, `(points, edges)`. All
    have bounds on their errors. Accuracy: that of the linear equations, infinite where one may be singular.
    """
    order = frames[0][0].value.shape[-1]
    size = order * (order + 1) // 2
    points = len(weight.value)
    with np.errstate(all="ignore"):
        recurrence, share = _shares(graph, weight)
        moments = Bounded.exact(np.zeros((points, graph.nodes * size, graph.nodes * size)))
        noise = Bounded.exact(np.zeros((points, graph.nodes * size, 1)))
        seen = noise.mT
        direct = length = Bounded.exact(np.zeros((points, 1, 1)))
        maps = [_of_moments(frame) for frame in frames]
        edges = zip(graph.source, graph.symbol, graph.target, strict=True)
        for edge, (source, symbol, target) in enumerate(edges):
            onward, added, read, through = maps[symbol]
            chance = weight.part(..., edge, None, None)
            arriving = chance * share.part(..., [source], slice(None))
            rows = slice(target * size, (target + 1) * size)
            columns = slice(source * size, (source + 1) * size)
            moments = _with(moments, (rows, columns), onward * chance)
            noise = _with(noise, (rows, slice(1)), added * arriving)
            seen = _with(seen, (slice(1), columns), read * chance)
            direct = direct + through * arriving
            length = length + arriving * float(ticks[symbol])
        equation = Bounded.exact(np.eye(graph.nodes * size)) - moments
        on_points = seen.value @ solve(equation.value, noise.value) + direct.value
        off = moved_from_middle((on_points / length.value)[None])[0, 0, 0]
        singular = [determinants(x.value[None])[..., None] for x in (recurrence, equation, length)]
        if points > 1 and any(poles_inside(pivots).any() for pivots in singular):
            return Enclosed.unknown(1)
        equation, noise, seen, direct, length = (
            part.part(slice(1)).real for part in (equation, noise, seen, direct, length)
        )
        square = (seen @ equation.solved(noise) + direct).over(length)
        value = square.value[0, 0, 0]
        off = off + square.error[0, 0, 0]
    if not np.isfinite(off):
        return Enclosed.unknown(1)
    return Enclosed(np.array([max(0.0, value - off)]), np.array([value + off]))


def _shares(graph: Graph, weight: Bounded) -> tuple[Bounded, Bounded]:
    """How often each node of the chain is met, `(points, nodes, 1)`, and the matrix of the equation
    for it.

    With `1' M = 1'`, the solution of `(1 - M + 1 1'/nodes) x = 1/nodes` has the sum 1, and `M x = x`.
    """
    nodes = graph.nodes
    flow = Bounded.exact(np.zeros((len(weight.value), nodes, nodes)))
    for edge, (source, target) in enumerate(zip(graph.source, graph.target, strict=True)):
        place = slice(target, target + 1), slice(source, source + 1)
        flow = _with(flow, place, weight.part(..., edge, None, None))
    even = Bounded.exact(np.ones((nodes, 1))).over(Bounded.exact(np.full((nodes, 1), nodes)))
    recurrence = Bounded.exact(np.eye(nodes)) - flow + even @ np.ones((1, nodes))
    return recurrence, recurrence.solved(even)


def _with(whole: Bounded, place: tuple[slice, slice], more: Bounded) -> Bounded:
    """A matrix with something added at a place."""
    total = whole.part(..., *place) + more
    value = whole.value.astype(np.result_type(whole.value, total.value), copy=True)
    error = whole.error.copy()
    value[..., *place] = total.value
    error[..., *place] = total.error
    return Bounded(value, error)


def _of_moments(frame: Sequence[Bounded]) -> tuple[Bounded, Bounded, Bounded, Bounded]:
    """What a frame does to second moments as vectors of `packed`, what noise adds to them, and the sum
    of squares that they and the noise show."""
    # errors of complex maps are stored as complex numbers
    E, G, O, T = (Bounded(part.value, part.error.real) for part in frame)
    order = E.value.shape[-1]
    A = Bounded.exact(np.eye(order)) + E
    size = np.abs(A.value)
    onward = _acting(A.value)
    largest = _acting(A.size)
    error = largest - _acting(size) + FEW_ROUNDINGS * largest

    def vectors(X: Bounded) -> Bounded:
        value = packed(X.value)
        return Bounded(value, packed(X.error) + FEW_ROUNDINGS * np.abs(value))

    added = vectors(G @ G.mT).each(lambda x: x[..., None])
    read = vectors(O.mT @ O).each(lambda x: x[..., None, :])
    through = (T * T).sum((-1, -2)).each(lambda x: x[..., None, None])
    return Bounded(onward, error), added, read, through


def _acting(A: np.ndarray) -> np.ndarray:
    """The maps `X -> A X A'`, see `acting`."""
    return acting(A[:, :, :, None, None] * A[:, None, None], A.shape[-1])


@dataclass(frozen=True, slots=True, eq=False)
class AtRandom:
    """The root mean square of loops at random along a number as a `Judge`: it has to be at most the level.

    ports: `RandomPorts`; kept: their states that count.
    """

    ports: Any
    kept: np.ndarray
    level: float
    columns: ClassVar[np.ndarray] = np.zeros(1, int)
    many: ClassVar[int] = 1000
    smooth: ClassVar[bool] = False
    forms: ClassVar[None] = None

    @staticmethod
    def of(ports: Any, level: float) -> AtRandom:
        """The judge of the ports of loops at random."""
        port, _ = ports.port_at(np.zeros(1))
        return AtRandom(ports, needed(port.maps), level)

    @property
    def order(self) -> int:
        """Of the matrices of a panel."""
        return self.kept.size * (self.kept.size + 1) // 2 * self.ports.chances.graph.nodes

    def label(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        """GOOD, BAD or OPEN of panels."""
        label = np.full(column.size, OPEN)
        for panel in range(column.size):
            middle = (low[panel] + high[panel]) / 2
            radius = high[panel] - low[panel]  # twice that of the panel
            if middle - radius < bounds[0][0] or middle + radius > bounds[1][0]:
                continue
            value = self.about(middle + radius * np.append(0.0, HALF_RIM))
            if value.high[0] <= self.level:
                label[panel] = GOOD
            elif value.low[0] > self.level:
                label[panel] = BAD
        return label

    def worst(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The point z = 1, less 1, and by how much the value is beyond the level."""
        del column
        values = [self.about(np.array([number])) for number in p]
        size = np.array([(value.low[0] + value.high[0]) / 2 for value in values])
        return np.zeros(p.size), size / self.level - 1

    def about(self, p: np.ndarray) -> Enclosed:
        """What is known of the value about the first of some numbers, the others being on a rim."""
        try:
            ports, pivots = self.ports.at(p)
        except IllPosedLoopError:  # of one of them at least
            return Enclosed.unknown(1)
        if p.size > 1 and poles_inside(pivots[None]).any():
            return Enclosed.unknown(1)
        ticks = np.array([port.kind.size for port in ports])
        frames = [over_frame(port, self.kept, p.shape, np.arange(port.kind.size)) for port in ports]
        weight = self.ports.weights(p)
        chances = Bounded(weight, CHANCE_ROUNDING * np.abs(weight))
        square = mean_square_at_random(frames, ticks, self.ports.chances.graph, chances)
        return Enclosed(*(np.sqrt(end) for end in square[:2]))


def along_at_random(ports: Any, span: tuple[float, float], at_most: float) -> Intervals:
    """All intervals of a number in which the root mean square of a signal is at most a level, within a
    span in which second moments decay.

    ports: `RandomPorts`. Accuracy: ends to END_EXACTNESS.
    """
    port, _ = ports.port_at(np.array(span))
    bounds = [np.array([end]) for end in ports.loops.domain(ports.along, span)]

    def resolved(*panels: np.ndarray) -> np.ndarray:
        return np.ones(panels[1].size, bool)

    domain = Domain(span, np.array([port.period]), (bounds[0], bounds[1]), resolved)
    judge = AtRandom(ports, needed(port.maps), at_most)
    ends = Accuracy(END_EXACTNESS, 8.0, END_EXACTNESS, np.full(1, END_EXACTNESS))
    return along_panels([judge], np.ones(1, bool), domain, ends)
