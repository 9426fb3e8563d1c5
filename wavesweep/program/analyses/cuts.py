"""Whether a loop can be cut at a signal, by its drawing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wavesweep.engine.keys import nearest, show

if TYPE_CHECKING:
    from wavesweep.engine.drawing import Drawing


def fault_of_cut(drawing: Drawing, cut: str) -> tuple[str, str, str] | None:
    """What is expected and found of a signal at which a loop cannot be cut, and a suggestion;
    None if it can."""
    read = signals_at_ticks(drawing)
    made = {f"{block.name}.{port}" for block in drawing.blocks for port in block.ports[1]}
    signals = sorted(read & made)
    if cut not in signals:
        expected = f"an output of a block that some wire reads at a tick ({', '.join(signals)})"
        return expected, show(cut), nearest(cut, signals)
    if not _returns(drawing, cut):
        return "a signal of a loop", f"{show(cut)}, which does not come back to itself", ""
    return None


def signals_at_ticks(drawing: Drawing) -> set[str]:
    """The signals that wires read at a tick, where a factor can be put in.

    Left out are those that act between two ticks, as a factor there would: outputs of plants that
    dead times read, and outputs of dead times that a plant reads. The latter are at a tick if all that
    the dead time reads are outputs of the former kind.
    """
    sensed = {name for plant in drawing.plants for name, _ in plant.sensed}
    read = set()
    brought = set()
    for port, terms in drawing.wires:
        names = dict(terms).keys()
        read |= names
        if not sensed.issuperset(names):
            brought.add(f"{_block_of(port)}.y")
    arriving = {f"{name}.y" for plant in drawing.plants for _, name in plant.arriving}
    return read - sensed - (brought & arriving)


def _returns(drawing, cut):
    """Whether the block of a signal reads what it makes, perhaps through others."""
    source = _block_of(cut)
    reached = set()
    reads = []  # pairs of blocks: the first one reads the second one
    for port, terms in (*drawing.wires, *drawing.couplings):
        reader = _block_of(port)
        reads += [(reader, _block_of(name)) for name, _ in terms]
        if cut in dict(terms):
            reached.add(reader)
    while True:
        further = {reader for reader, read in reads if read in reached} - reached
        if not further:
            return source in reached
        reached |= further


def _block_of(port):
    return port.rpartition(".")[0]
