"""Loops along a number as they are seen between an input and a signal, on panels of the number
that something is asked of."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.drawing import BLOCK
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import Bounded, MarginalModes, Ticks, in_a_row, pole_inside
from wavesweep.engine.frames import level as level_of
from wavesweep.engine.intervals import Intervals
from wavesweep.engine.loop import Loops
from wavesweep.engine.norms import connected
from wavesweep.engine.response import Port
from wavesweep.require.disc_panels import BAD, HALF_RIM, OPEN
from wavesweep.require.maps import of_ticks, over_frame

TYPICAL = (0.53, 0.37, 0.71, 0.13, 0.91)  # of the span, where loops are looked at first


def loops_between(
    loops: Loops,
    along: str,
    drift: MarginalModes,
    route: tuple[str, str],
    number: np.ndarray,
    p: np.ndarray,
) -> tuple[Port, np.ndarray]:
    """The loops `number` at values p as they are seen between an input and a signal, and their
    pivots."""
    loops_at_values = loops.some(number).changed({along: p})
    with np.errstate(all="ignore"):
        drawn = loops_at_values.drawn()
        port = Port.between(drawn, *route, drift)
        pivot, _ = Ticks.of(drawn, alone=True).facts
    pivot = np.broadcast_to(np.asarray(pivot)[..., None], (p.size, 1))
    guards = loops_at_values.guards_at(along, p.shape).reshape(p.size, -1)
    return port, np.concatenate([pivot, guards], -1)


def typical_between(
    loops: Loops, along: str, span: tuple[float, float], size: int, route: tuple[str, str], key: str
) -> tuple[MarginalModes, Port, np.ndarray, np.ndarray] | None:
    """The drift of loops that are seen between an input and a signal, their port at TYPICAL values
    of each of `size` slices, and the slices and values.

    Errors: UsageError for a signal that moves without end, with the key of [sweep] require.
    """
    drift = loops.changed({along: np.array(span)}).drift(watched=route[1:])
    values = span[0] + (span[1] - span[0]) * np.array(TYPICAL)
    number = np.repeat(np.arange(size), values.size)
    p = np.tile(values, size)
    port, _ = loops_between(loops, along, drift, route, number, p)
    if port.outputs > 1:
        wires = dict(loops.drawing.wires)
        if f"{BLOCK}.u" in wires:  # see at_cut
            cut = wires[f"{BLOCK}.u"][0][0]
            raise UsageError(
                "sweep.require.margins.cut: expected a signal that comes to rest, "
                f"found {cut!r}, which drifts"
            )
        output = route[1].removeprefix(OUTPUT)
        expected = "expected an output that comes to rest"
        raise UsageError(f"sweep.require.{key}.to: {expected}, found {output}, which drifts")
    return drift, port, number, p


def needed(maps: tuple[Any, Any]) -> np.ndarray:
    """The states that the input reaches and the signal depends on."""
    states = np.flatnonzero(connected(maps))
    return states if states.size else np.arange(1)


@dataclass(frozen=True, slots=True, eq=False)
class Between:
    """Loops between an input and a signal (route) along a number, of which something is asked that
    has a level.

    A judge of `panels`, of these columns, without what `labelled` and `worst_at` are. kept: states that
    the input reaches and the signal depends on. read: the ticks whose inputs are looked at. stable:
    where loops may be stable, and nothing is looked for elsewhere.
    """

    loops: Loops
    along: str
    route: tuple[str, str]
    level: float
    drift: MarginalModes
    kept: np.ndarray
    read: np.ndarray
    columns: np.ndarray
    stable: Intervals
    many: ClassVar[int] = 1000
    smooth: ClassVar[bool] = False

    def between(self, column: np.ndarray, p: np.ndarray) -> tuple[Port, np.ndarray]:
        """The loops of columns at values p as they are seen between the input and the signal, and
        pivots."""
        numbers = self.columns[column]
        return loops_between(self.loops, self.along, self.drift, self.route, numbers, p)

    def maps(self, column: np.ndarray, p: np.ndarray) -> tuple[Bounded, Bounded, Bounded, Bounded]:
        """E less identity, G, O and T of a frame, each with a bound on its error."""
        return self.over_frame(self.between(column, p)[0], p.size)

    def over_frame(self, port: Port, size: int) -> tuple[Bounded, Bounded, Bounded, Bounded]:
        """The maps of so many frames."""
        return over_frame(port, self.kept, (size,), self.read)

    def changes(self, column: np.ndarray, p: np.ndarray) -> np.ndarray:
        """E less identity of frames, `(points, n, n)`."""
        port, _ = self.between(column, p)
        of_states = [e for e, *_ in of_ticks(port, self.kept, p.shape)]
        return in_a_row(port.kind.tolist(), of_states, Bounded.then).value

    def label(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        """GOOD, BAD or OPEN of panels, of what is within the intervals in which loops may be
        stable; BAD of the others."""
        stable = self.stable
        within = stable.column == self.columns[column][:, None]
        within &= (stable.low < high[:, None]) & (stable.high > low[:, None])
        inside = within.any(-1)
        low = np.maximum(low, np.where(within, stable.low, np.inf).min(-1))
        high = np.minimum(high, np.where(within, stable.high, -np.inf).max(-1))
        label = np.full(column.size, BAD)
        if inside.any():
            label[inside] = self._labelled(column[inside], low[inside], high[inside], bounds)
        return label

    def _labelled(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> np.ndarray:
        try:
            return self.labelled(column, low, high, bounds)
        except IllPosedLoopError:  # of one panel at least
            if column.size == 1:
                return np.full(1, OPEN)
            halves = np.array_split(np.arange(column.size), 2)
            return np.concatenate(
                [self._labelled(column[half], low[half], high[half], bounds) for half in halves]
            )

    def worst(self, column: int, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What `worst_at` tells of each value; NaN without a solution."""
        try:
            return self.worst_at(column, p)
        except IllPosedLoopError:  # of one of them at least
            if p.size == 1:
                return np.full(1, np.nan), np.full(1, np.nan)
            halves = [self.worst(column, half) for half in np.array_split(p, 2)]
            return tuple(map(np.concatenate, zip(*halves, strict=True)))

    def _about(
        self, column: np.ndarray, low: np.ndarray, high: np.ndarray, bounds: list[np.ndarray]
    ) -> tuple[Port, tuple[int, int], np.ndarray]:
        """The loops in the middles of panels and on rims about them, `(panels * points)`, their
        numbers, and where they are known."""
        middle = (low + high) / 2
        radius = high - low  # twice that of the panel
        p = middle[:, None] + radius[:, None] * np.append(0.0, HALF_RIM)
        port, pivots = self.between(np.repeat(column, p.shape[1]), p.ravel())
        analytic = (middle - radius >= bounds[0][column]) & (middle + radius <= bounds[1][column])
        analytic &= ~poles_inside(pivots.reshape(*p.shape, -1))
        return port, p.shape, analytic


def by_panel(pairs: tuple[Bounded, ...], shape: tuple[int, int]) -> list[Bounded]:
    """Matrices of all points, and bounds on their errors, by panels and points of each."""
    return [pair.each(lambda matrix: matrix.reshape(*shape, *matrix.shape[1:])) for pair in pairs]


def of_panels(pairs: list[Bounded], panels: np.ndarray) -> list[Bounded]:
    """Those of some panels."""
    return [pair.part(panels) for pair in pairs]


def poles_inside(pivots: np.ndarray) -> np.ndarray:
    """Whether one of the pivots may be 0 within a circle; pivots: in its middle and on its upper
    half, `(n, points, k)`."""
    moving = (pivots[:, 1:] != pivots[:, :1]).any((1, 2))
    if not moving.any():
        return moving
    return pole_inside(pivots[:, 1:], level_of(pivots[:, :1])) & moving


def determinants(A: np.ndarray) -> np.ndarray:
    """The determinants of matrices `(n, points, r, r)`, of a disc over the size of that in its
    middle."""
    sign, log = np.linalg.slogdet(A)
    return sign * np.exp(log - log[:, :1])
