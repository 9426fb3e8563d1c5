"""Loops whose frames, or messages, are at random, as they are seen between an input and a signal:
a map of a frame for each kind of frame, or of a step from one sending to the next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from wavesweep.engine.blocks import OUTPUT
from wavesweep.engine.errors import UsageError
from wavesweep.engine.frames import MarginalModes, Ticks
from wavesweep.engine.loop import Loops
from wavesweep.engine.response import Port
from wavesweep.engine.switched import Chances
from wavesweep.for_all.channel_families import all_in_time, channels_of, places_of, steps_of
from wavesweep.for_all.plan import Plan
from wavesweep.program.analyses.signals import routed

PATH = "sweep.require.rms"
TYPICAL = (0.37, 0.71)  # of the span, where the structure of loops is looked at


@dataclass(frozen=True, slots=True, eq=False)
class RandomPorts:
    """The ports of loops at random along a number, empty for the loop at its own values.

    chances: the chain of the kinds of frames. rows: of each kind its ticks, one after the other, as
    indices of maps. port_at: gives the port at some values of the number, whose maps are all that
    occur, and the pivots of each.
    """

    loops: Loops
    along: str
    chances: Chances
    rows: Sequence[tuple[int, ...]]
    port_at: Callable[[np.ndarray], tuple[Port, np.ndarray]]

    @staticmethod
    def of(
        rules: Any,
        values: Mapping[str, object],
        along: str,
        span: tuple[float, float],
        ends: Any,
    ) -> RandomPorts:
        """Return the ports of one loop.

        rules: `Rules` of what is at random. values: all of a spec, by their paths. ends: has the input as `source` and the
        `signal`, see `routed`. Errors: UsageError for a signal that drifts.
        """
        chances = rules.family(values, along)
        _refuse_apart(chances)
        typical = span[0] + (span[1] - span[0]) * np.array(TYPICAL)
        if rules.messages and not rules.for_all.shares:
            drawing, route = routed(rules.drawing, ends.source, ends.signal, PATH)
            rows, symbols, port_at = _of_messages(drawing, values, along, typical, route)
        else:
            plan = rules.plan(values, (along,))
            drawing, route = routed(plan.drawing, ends.source, ends.signal, PATH)
            plan = replace(plan, drawing=drawing)
            values = plan.values
            rows, symbols, port_at = _of_plan(plan, along, typical, route)
        order = [symbols.index(symbol) for symbol in chances.family.symbols]
        if port_at(typical)[0].outputs > 1:
            name = route[1].removeprefix(OUTPUT)
            expected = "expected an output that comes to rest"
            raise UsageError(f"{PATH}.to: {expected}, found {name}, which drifts")
        in_order = [rows[index] for index in order]
        return RandomPorts(Loops(drawing, values), along, chances, in_order, port_at)

    def at(self, p: np.ndarray) -> tuple[list[Port], np.ndarray]:
        """Return the ports of the kinds of frames at values of the number, and all pivots,
        `(values, pivots)`."""
        port, pivots = self.port_at(p)
        if self.along:
            guards = self.loops.guards_at(self.along, p.shape).reshape(p.size, -1)
            pivots = np.concatenate([pivots, guards], -1)
        return [replace(port, kind=np.array(row)) for row in self.rows], pivots

    def weights(self, p: np.ndarray) -> np.ndarray:
        """Return the probabilities of the edges at values of the number, `(values, edges)`."""
        first, second = np.moveaxis(self.chances.factors, -1, 0)
        return (first + p[:, None, None] * (second - first)).prod(-1)


def _refuse_apart(chances: Chances) -> None:
    """Raise UsageError if what happens in the long run depends on the first frame."""
    graph = chances.graph
    flow = np.zeros((graph.nodes, graph.nodes))
    np.add.at(flow, (graph.target, graph.source), chances.weights(0.5, 0.5)[0])
    if np.linalg.matrix_rank(np.eye(graph.nodes) - flow) < graph.nodes - 1:
        expected = "expected chances by which every length of frames comes again and again"
        raise UsageError(f"{PATH}: {expected}, found next with lengths that never do")


def _port(
    ticks: Ticks, drawn: Any, route: tuple[str, str], drift: MarginalModes, size: int
) -> tuple[Port, np.ndarray]:
    """The port of ticks of all kinds, and their pivots."""
    port = Port.through(ticks, drawn, route[0], drift)
    pivots = [np.broadcast_to(block.pivot, (size,)) for block in ticks.maps]
    return port, np.stack(pivots, -1)


def _of_messages(drawing, values, along, typical, route):
    """The rows, the symbols and `port_at` of a drawn loop whose messages are at random."""
    channels = channels_of(drawing, values)

    def loops_at(p):
        return Loops(drawing, {**values, along: p} if along else values)

    loop = loops_at(typical).drawn()
    twins = [all_in_time(twin, channels) for twin in loops_at(typical).twins()]
    drift = MarginalModes.of(*twins, watched=route[1:])
    held = twins[0].held(route[1:])
    steps = list(steps_of(channels, loop))
    kinds = [row for row, *_ in steps]

    def port_at(p):
        with np.errstate(all="ignore"):
            drawn = loops_at(p).drawn()
            maps = []
            for place in places_of(drawn, channels, kinds, held)[1]:
                ticks = Ticks.of(place.loop, route[1:], held_ports=held, terms=True)
                maps.append(ticks.maps[ticks.kind[0]])
            ticks = Ticks(tuple(maps), np.arange(len(maps)))
            return _port(ticks, drawn, route, drift, p.size)

    rows, _ = places_of(loop, channels, kinds, held)
    return rows, [symbol for _, symbol, *_ in steps], port_at


def _of_plan(plan: Plan, along, typical, route):
    """The same of a loop whose frames are at random."""

    def drawn_at(step, p):
        values = {**plan.values, along: p} if along else plan.values
        at_step = plan.schedule.with_period(plan.drawing, step)
        return plan.schedule.scheduled(Loops(at_step, values).drawn())

    def ticks_at(step, p=typical, places=None):
        return Ticks.of(drawn_at(step, p), route[1:], terms=True, places=places)

    _, picked, index = plan.different_ticks(ticks_at)
    rows, samples, symbols, _ = plan.written(index)
    values = {**plan.values, along: typical} if along else plan.values
    nominal = plan.schedule.with_period(plan.drawing, plan.schedule.nominal)
    twins = map(plan.schedule.scheduled, Loops(nominal, values).twins())
    drift = MarginalModes.of(*twins, watched=route[1:])

    def port_at(p):
        maps = []
        with np.errstate(all="ignore"):
            for step, places in groupby(picked, lambda pick: pick[0]):
                ticks = ticks_at(step, p, [place for _, place in places])
                maps += [ticks.maps[kind] for kind in ticks.kind]
            ticks = Ticks(tuple(maps), np.arange(len(maps)))
            return _port(ticks, drawn_at(plan.steps[0], p), route, drift, p.size)

    whole = [(*row, sample) for row, sample in zip(rows, samples, strict=True)]
    return whole, list(symbols), port_at
