"""A drawing with a complex factor of one of its signals, as a real drawing of twice the size.

A loop whose signal has the factor `re + j im` has states `x + j y`. Real and imaginary part follow
the same blocks, and meet at the cut alone: there `re x - im y` is read in place of x, and `im x +
re y` in place of y. So the eigenvalues are those of the complex loop and their conjugates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from wavesweep.engine._drawing.drawing import Drawing
from wavesweep.engine._drawing.expressions import Terms, Tree
from wavesweep.engine._drawing.gain_at_signal import BLOCK

# behind the name of a block of the imaginary part: no block of a spec can be called so
TWIN = " (imaginary)"


def with_complex_factor(drawing: Drawing, re: Tree, im: Tree) -> Drawing:
    """Return the real drawing of a loop with the factor `re + j im` of a signal.

    drawing: with a gain at the signal, see `gain_at_signal`.
    """
    names = {block.name for block in drawing.blocks}
    blocks = tuple(replace(block, name=block.name + TWIN) for block in drawing.blocks)
    wires = _inside(drawing.wires, names)
    couplings = _inside(drawing.couplings, names)
    twin_wires = _twins(wires)
    twin_couplings = _twins(couplings)
    ((signal, _),) = wires[f"{BLOCK}.u"]
    ((twin, _),) = twin_wires[f"{BLOCK}{TWIN}.u"]
    wires[f"{BLOCK}.u"] = ((signal, re), (twin, -im))
    twin_wires[f"{BLOCK}{TWIN}.u"] = ((signal, im), (twin, re))
    return replace(
        drawing,
        blocks=(*drawing.blocks, *blocks),
        wires=(*wires.items(), *twin_wires.items()),
        couplings=(*couplings.items(), *twin_couplings.items()),
        hand=None,
        inputs=(),
        outputs=(),
        named=(),
    )


def _inside(wires: Sequence[tuple[str, Terms]], names: set[str]) -> dict[str, Terms]:
    """The wires without signals from outside."""
    return {
        port: tuple(term for term in terms if term[0].rpartition(".")[0] in names)
        for port, terms in wires
    }


def _twins(wires: Mapping[str, Terms]) -> dict[str, Terms]:
    """The wires of the imaginary part."""

    def twin(signal: str) -> str:
        block, _, port = signal.rpartition(".")
        return f"{block}{TWIN}.{port}"

    return {
        twin(port): tuple((twin(name), gain) for name, gain in terms)
        for port, terms in wires.items()
    }
