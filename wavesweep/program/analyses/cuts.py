"""Whether a loop can be cut at a signal, by its drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.engine.keys import nearest, show

if TYPE_CHECKING:
    from wavesweep.engine.drawing import Drawing


def fault_of_cut(drawing: Drawing, cut: str) -> tuple[str, str, str] | None:
    """What is expected and found of a signal at which a loop cannot be cut, and a suggestion;
    None if it can."""
    between_ticks = set()  # a factor there would be in the tick
    for plant in drawing.plants:
        between_ticks |= {name for name, _ in plant.sensed}
        between_ticks |= {f"{name}.y" for _, name in plant.arriving}
    read = {name for _, terms in drawing.wires for name, _ in terms} - between_ticks
    made = {f"{block.name}.{port}" for block in drawing.blocks for port in block.ports[1]}
    signals = sorted(read & made)
    if cut not in signals:
        expected = f"an output of a block that some wire reads ({', '.join(signals)})"
        return expected, show(cut), nearest(cut, signals)
    if not _returns(drawing, cut):
        return "a signal of a loop", f"{show(cut)}, which does not come back to itself", ""
    return None


def _returns(drawing, cut):
    """Whether the block of a signal reads what it makes, perhaps through others."""
    wires = [(_block_of(port), dict(terms)) for port, terms in drawing.wires]
    wires += [(_block_of(port), dict(terms)) for port, terms in drawing.couplings]
    source = _block_of(cut)
    reached = {block for block, terms in wires if cut in terms}
    while True:
        further = {
            block
            for block, terms in wires
            if reached & {_block_of(name) for name in terms} and block not in reached
        }
        if not further:
            return source in reached
        reached |= further


def _block_of(port):
    return port.rpartition(".")[0]
