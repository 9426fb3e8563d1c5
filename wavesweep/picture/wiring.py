"""The wiring of a loop for a picture: its blocks and ports, and the gains of the wires between
them, as texts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import lcm

from wavesweep.engine.drawing import Drawing, scalars
from wavesweep.engine.expressions import Tree

# Begin the gains of terms of a plant that read plants: of one that is held, and of one that acts
# continuously.
HELD, CONTINUOUS = "held ", "continuous "
Terms = tuple[tuple[str, str], ...]
"""Signals and their gains as texts; a gain of one is "1"."""


@dataclass(frozen=True, slots=True)
class WiringPart:
    """A block or a port of the loop.

    kind: "block" or "port". type: of a block, in words. inputs: name of each port and its terms.
    outputs: name of each port that something reads, and its signal. It runs at the ticks `phase`,
    `phase + every`, and so on, on average if it has several phases; `every` is 0 for ports. plant:
    whether it is continuous.
    """

    name: str
    kind: str
    inputs: tuple[tuple[str, Terms], ...]
    outputs: tuple[tuple[str, str], ...]
    type: str = ""
    every: float = 0
    phase: int = 0
    plant: bool = False


@dataclass(frozen=True, slots=True)
class Wiring:
    """The parts of a loop, the period of its tick (s) and the ticks of its frame."""

    parts: tuple[WiringPart, ...]
    tick_s: float
    ticks: int


def wiring_of_drawing(drawing: Drawing, values: Mapping[str, object]) -> Wiring:
    """Return the wiring of a loop that is drawn; the gains are expressions in its numbers.
    values: flat numbers."""
    numbers = scalars(values)
    wires = _wires(drawing)
    force = drawing.hand[0] if drawing.hand else ""
    sources = []
    blocks = []
    sinks = []
    ticks = []
    for block in drawing.blocks:
        every = int(block.every.evaluate(numbers))
        runs_in_every = len(block.phases) if block.phases else 1
        inputs, outputs = block.ports
        blocks.append(
            WiringPart(
                name=block.name,
                kind="block",
                inputs=tuple((port, wires[f"{block.name}.{port}"]) for port in inputs),
                outputs=tuple((port, f"{block.name}.{port}") for port in outputs),
                type=block.type.replace("_", " "),
                every=every / runs_in_every,
                phase=int(block.phase.evaluate(numbers)),
                plant=block.plant,
            )
        )
        ticks.append(every)
    for name, signal, _ in drawing.inputs:
        if signal != force:
            sources.append(_source(name, signal))
    if drawing.hand:
        _, displacement, reaction = drawing.hand
        sources.append(_source(force, force))
        sinks.append(_sink("displacement", displacement))
        if reaction is not None:
            sinks.append(_sink("reaction", reaction))
    for name, terms, _ in drawing.outputs:
        sinks.append(_sink(name, terms))
    return _read([*sources, *blocks, *sinks], 1 / drawing.rate(values), lcm(*ticks))


def _source(name, signal) -> WiringPart:
    """A port from which a signal comes into the loop."""
    return WiringPart(name, "port", inputs=(), outputs=(("", signal),))


def _sink(name, terms) -> WiringPart:
    """A port that shows a sum of signals."""
    return WiringPart(name, "port", inputs=(("", _texts(terms)),), outputs=())


def _wires(drawing: Drawing) -> dict[str, tuple[tuple[str, str], ...]]:
    """What each port of a block reads: signals and gains.

    If a plant is a member of a larger one, the gains of what is held at its ports begin with HELD,
    though it reads a plant, and those of what acts continuously with CONTINUOUS, if they are not 1.
    """
    plants = {block.name for block in drawing.blocks if block.plant}
    members = {block.name for plant in drawing.plants if plant.couplings for block in plant.members}
    wires = {}
    for port, terms in drawing.wires:
        texts = _texts(terms)
        if _block_of(port) in members:
            texts = tuple(
                (name, f"{HELD}{gain}" if _block_of(name) in plants else gain)
                for name, gain in texts
            )
        wires[port] = texts
    for port, terms in drawing.couplings:
        for name, gain in _texts(terms):
            shown = gain if gain in ("1", "-1") else f"{CONTINUOUS}{gain}"
            wires[port] += ((name, shown),)
    return wires


def _block_of(signal: str) -> str:
    return signal.rpartition(".")[0]


def _texts(terms) -> Terms:
    return tuple((signal, _shown(gain).text) for signal, gain in terms)


def _shown(gain):
    """A gain without the factor -1 that a sign before a parenthesis leaves, and with the last
    names of a spec's keys."""
    if gain.operation == "name":
        return Tree.name(gain.leaf.rpartition(".")[2])
    if gain.operation == "*":
        first, second = gain.operands
        if _is_minus_one(first):
            return -_shown(second)
        if _is_minus_one(second):
            return -_shown(first)
    return gain.with_operands(tuple(map(_shown, gain.operands)))


def _is_minus_one(factor: Tree) -> bool:
    return factor.operation == "negative" and factor.operands[0].is_number(1.0)


def _read(parts, tick_s, ticks):
    """The wiring with the outputs alone that some part reads."""
    read = set()
    for part in parts:
        for _, terms in part.inputs:
            read |= {signal for signal, _ in terms}
    shown = []
    for part in parts:
        outputs = tuple((port, signal) for port, signal in part.outputs if signal in read)
        shown.append(replace(part, outputs=outputs))
    return Wiring(tuple(shown), tick_s, ticks)
