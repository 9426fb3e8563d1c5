"""The wiring of a loop for a picture: its blocks and ports, and the gains of the wires between them, as texts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import lcm

from wavesweep.engine.drawing.drawing import Drawing, scalars
from wavesweep.engine.drawing.expressions import ONE, evaluate, text_of

# Begin the gains of terms of a plant that read plants: of one that is held, and of one that acts continuously.
HELD, CONTINUOUS = "held ", "continuous "
Terms = tuple[tuple[str, str], ...]
"""Signals and their gains as texts; a gain of one is "1"."""


@dataclass(frozen=True, slots=True)
class WiringPart:
    """A block or a port of the loop.

    kind: "block" or "port". type: of a block, in words. inputs: name of each port and its terms. outputs: name of each port
    that something reads, and its signal. It runs at the ticks `phase`, `phase + every`, and so on, on average if it has several
    phases; `every` is 0 for ports. plant: whether it is continuous.
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
    """Return the wiring of a loop that is drawn; the gains are expressions in its numbers. values: flat numbers."""
    numbers, boxes, ticks, wires = scalars(values), [], [], _wires(drawing)
    for block in drawing.blocks:
        every, phase = (int(evaluate(tree, numbers)) for tree in (block.every, block.phase))
        inputs, outputs = block.ports
        ticks.append(every)
        boxes.append(
            WiringPart(
                block.name,
                "block",
                tuple((port, wires[f"{block.name}.{port}"]) for port in inputs),
                tuple((port, f"{block.name}.{port}") for port in outputs),
                block.type.replace("_", " "),
                every / len(block.phases or (phase,)),
                phase,
                block.plant,
            )
        )
    if drawing.hand:
        force, *displayed = drawing.hand
        boxes.insert(0, WiringPart(force, "port", (), (("", force),)))
        named = zip(("displacement", "reaction"), displayed, strict=True)
        boxes += [WiringPart(name, "port", (("", _texts(terms)),), ()) for name, terms in named if terms is not None]
    force = (drawing.hand or ("",))[0]
    boxes[:0] = [WiringPart(name, "port", (), (("", signal),)) for name, signal, _ in drawing.inputs if signal != force]
    boxes += [WiringPart(name, "port", (("", _texts(terms)),), ()) for name, terms, _ in drawing.outputs]
    return _read(boxes, 1 / drawing.rate(values), lcm(*ticks))


def _wires(drawing: Drawing) -> dict[str, tuple[tuple[str, str], ...]]:
    """What each port of a block reads: signals and gains.

    If a plant is a member of a larger one, the gains of what is held at its ports begin with HELD, though it reads a plant, and
    those of what acts continuously with CONTINUOUS, if they are not 1.
    """
    plants = {block.name for block in drawing.blocks if block.plant}
    members = {block.name for plant in drawing.plants if plant.couplings for block in plant.members}
    wires = {port: _texts(terms) for port, terms in drawing.wires}
    for port in (port for port in wires if port.rpartition(".")[0] in members):
        wires[port] = tuple((name, HELD * (name.rpartition(".")[0] in plants) + gain) for name, gain in wires[port])
    for port, terms in drawing.couplings:
        texts = _texts(terms)
        wires[port] += tuple((name, CONTINUOUS * (gain not in ("1", "-1")) + gain) for name, gain in texts)
    return wires


def _texts(terms) -> Terms:
    return tuple((signal, text_of(_shown(gain))) for signal, gain in terms)


def _shown(gain):
    """A gain without the factor -1 that a sign before a parenthesis leaves, and with the last names of a spec's keys."""
    if gain[0] == "name":
        return (gain[0], gain[1].rpartition(".")[2], gain[2])
    if gain[0] == "*" and any(factor[0] == "negative" and factor[1][:2] == ONE[:2] for factor in gain[1:3]):
        operand = gain[2] if gain[1][0] == "negative" else gain[1]
        return ("negative", _shown(operand), gain[-1])
    return tuple(_shown(term) if isinstance(term, tuple) else term for term in gain)


def _read(parts, tick_s, ticks):
    """The wiring with the outputs alone that some part reads."""
    parts = tuple(parts)
    read = {signal for box in parts for _, terms in box.inputs for signal, _ in terms}
    read_boxes = tuple(replace(box, outputs=tuple(output for output in box.outputs if output[1] in read)) for box in parts)
    return Wiring(read_boxes, tick_s, ticks)
