"""A drawing with a gain behind one of its signals: with it, the loop is cut there."""

from dataclasses import replace

from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._drawing.drawn_block import DrawnBlock

BLOCK, GAIN = "the cut", "gain of the cut"  # no block and no number of a spec can be called so


def with_gain(drawing: Drawing, signal: str) -> Drawing:
    """The drawing with a gain behind a signal, which runs when its block does; all wires read
    the signal behind it."""
    source = next(block for block in drawing.blocks if block.name == signal.rpartition(".")[0])
    gain = DrawnBlock(
        BLOCK, "gain", (("k", ("name", GAIN, 0)),), source.every, source.phase, source.phases
    )
    behind = {signal: f"{BLOCK}.y"}
    wires = tuple(
        (port, tuple((behind.get(name, name), factor) for name, factor in terms))
        for port, terms in drawing.wires
    )
    wires += ((f"{BLOCK}.u", ((signal, ("number", 1.0, 0)),)),)
    return replace(drawing, blocks=(*drawing.blocks, gain), wires=wires)
