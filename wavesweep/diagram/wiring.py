"""The wiring of a loop for a picture: its blocks, sums and ports, and the gains of the wires between them, as texts."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from wavesweep.diagram.drawing import Diagram
from wavesweep.spec.drawing import Drawing, scalars
from wavesweep.spec.expressions import ONE, evaluate, text_of

Terms = tuple[tuple[str, str], ...]
"""Signals and their gains as texts; a gain of one is "1"."""


@dataclass(frozen=True, slots=True)
class Part:
    """A block, a sum or a port of the loop.

    kind: "block", "sum" or "port". type: of a block, in words. inputs: name of each port and its terms. outputs: name of each
    port that something reads, and its signal. It runs at the ticks `phase`, `phase + every`, and so on; `every` is 0 for ports
    and sums.
    """

    name: str
    kind: str
    inputs: tuple[tuple[str, Terms], ...]
    outputs: tuple[tuple[str, str], ...]
    type: str = ""
    every: int = 0
    phase: int = 0


@dataclass(frozen=True, slots=True)
class Wiring:
    """The parts of a loop, the period of its tick (s) and the ticks of its frame."""

    parts: tuple[Part, ...]
    tick_s: float
    ticks: int


def wiring_of_drawing(drawing: Drawing, values: Mapping[str, object]) -> Wiring:
    """Return the wiring of a loop that a spec draws; the gains are expressions in its numbers. values: flat numbers."""
    known, wires = scalars(values), {port: _texts(terms) for port, terms in drawing.wires}
    parts = []
    for block in drawing.blocks:
        every, phase = (int(evaluate(tree, known)) for tree in (block.every, block.phase))
        inputs, outputs = block.ports
        parts.append(
            Part(
                block.name,
                "block",
                tuple((port, wires[f"{block.name}.{port}"]) for port in inputs),
                tuple((port, f"{block.name}.{port}") for port in outputs),
                block.type.replace("_", " "),
                every,
                phase,
            )
        )
    if drawing.hand:
        force, *seen = drawing.hand
        parts.insert(0, Part(force, "port", (), (("", force),)))
        named = zip(("displacement", "reaction"), seen, strict=True)
        parts += [Part(name, "port", (("", _texts(terms)),), ()) for name, terms in named if terms is not None]
    return _read(parts, 1 / drawing.rate(values), int(np.lcm.reduce([part.every or 1 for part in parts])))


def _texts(terms) -> Terms:
    return tuple((signal, text_of(_shown(gain))) for signal, gain in terms)


def _shown(gain):
    """A gain without the factor -1 that a sign before a parenthesis leaves."""
    if gain[0] == "*" and any(factor[0] == "negative" and factor[1][:2] == ONE[:2] for factor in gain[1:3]):
        other = gain[2] if gain[1][0] == "negative" else gain[1]
        return ("negative", _shown(other), gain[-1])
    return gain


def wiring_of_diagram(diagram: Diagram) -> Wiring:
    """Return the wiring of a controller's loop; the gains are its numbers, those of the wall are named."""
    alias, samplers, holds = {}, [], []
    for sampled, source in diagram.samples.items():
        if diagram.ratio > 1:
            samplers.append(_single(sampled, "sampler", source, diagram.ratio))
        else:
            alias[sampled] = source
    for held, source in diagram.holds.items():
        if diagram.ratio > 1:
            holds.append(_single(held, "hold", source, diagram.ratio, diagram.delay))
        else:
            alias[held] = alias.get(source, source)
    sums = {
        name: {alias.get(source, source): _number(gain) for source, gain in terms.items() if np.any(gain)}
        for name, terms in diagram.sums.items()
    }
    parts = [Part(diagram.hand.force, "port", (), (("", diagram.hand.force),))]
    for blocks, every in ((diagram.fast, 1), (diagram.slow, diagram.ratio)):
        for block in blocks:
            inputs = tuple((port, tuple(sums.pop(f"{block.name}.{port}", {}).items())) for port in block.inputs)
            outputs = tuple((port, f"{block.name}.{port}") for port in block.outputs)
            states = len(block.states)
            about = f"{states} state{'' if states == 1 else 's'}" if states else "no state"
            parts.append(Part(block.name, "block", inputs, outputs, about, every))
    x, v = (alias.get(name, name) for name in diagram.wall)
    laws = (("x", ((x, "1"),)), ("v", ((v, "1"),)))
    parts += [*samplers, Part("wall", "block", laws, (("", diagram.wall_force),), "K_VE x + B_VE v", diagram.ratio), *holds]
    parts += [Part(name, "sum", (("", tuple(terms.items())),), (("", name),)) for name, terms in sums.items()]
    return _read(_without_plain_sums(parts), float(np.ravel(diagram.period)[0]), diagram.ratio)


def _single(name, kind, source, every, phase=0):
    return Part(name, "block", (("", ((source, "1"),)),), (("", name),), kind, every, phase)


def _number(gain) -> str:
    return f"{float(np.ravel(gain)[0].real):.4g}"


def _without_plain_sums(parts):
    """The parts without sums of a single term of gain one: their readers read its source."""
    plain = {
        part.name: part.inputs[0][1][0][0]
        for part in parts
        if part.kind == "sum" and len(part.inputs[0][1]) == 1 and part.inputs[0][1][0][1] == "1"
    }

    def source(signal):
        return source(plain[signal]) if signal in plain else signal

    for part in parts:
        if part.name not in plain or part.kind != "sum":
            inputs = tuple((port, tuple((source(signal), gain) for signal, gain in terms)) for port, terms in part.inputs)
            yield replace(part, inputs=inputs)


def _read(parts, tick_s, ticks):
    """The wiring with the outputs alone that some part reads."""
    parts = tuple(parts)
    read = {signal for part in parts for _, terms in part.inputs for signal, _ in terms}
    kept = tuple(replace(part, outputs=tuple(each for each in part.outputs if each[1] in read)) for part in parts)
    return Wiring(kept, tick_s, ticks)
