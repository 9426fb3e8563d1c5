"""A drawing with a gain behind one of its signals: with it, the loop is cut there."""

from dataclasses import replace

from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._drawing.drawn_block import DrawnBlock
from wavesweep.engine._drawing.expressions import ONE, Tree

# No block and no number of a spec can be called so.
BLOCK, LATE = "the cut", "later than the cut"
GAIN = "gain of the cut"


def with_gain(drawing: Drawing, signal: str, number: str) -> Drawing:
    """The drawing with a gain behind a signal, the number of that name, which runs when its block
    does; all wires read the signal behind it."""
    return _with_block(drawing, signal, BLOCK, "gain", ("k", Tree.name(number)))


def with_late_signal(drawing: Drawing, runs: int) -> Drawing:
    """The drawing, one with a gain behind a signal, in which all wires read the signal behind it so
    many runs of its block later."""
    return _with_block(drawing, f"{BLOCK}.y", LATE, "delay", ("steps", Tree.number(runs)))


def _with_block(
    drawing: Drawing, signal: str, name: str, kind: str, key: tuple[str, Tree]
) -> Drawing:
    """The drawing with a block of this name behind a signal, which runs when that of the signal does.

    All wires read NAME.y in place of the signal, and nothing else does.
    """
    source = next(block for block in drawing.blocks if block.name == signal.rpartition(".")[0])
    added = DrawnBlock(name, kind, (key,), source.every, source.phase, source.phases)
    behind = {signal: f"{name}.y"}
    wires = tuple(
        (port, tuple((behind.get(term, term), factor) for term, factor in terms))
        for port, terms in drawing.wires
    )
    wires += ((f"{name}.u", ((signal, ONE),)),)
    return replace(drawing, blocks=(*drawing.blocks, added), wires=wires)
