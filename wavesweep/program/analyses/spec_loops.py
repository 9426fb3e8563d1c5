"""The loops of a spec: their radii over axes, the port of its own loop, and what has no
solution."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.blocks import POSITION
from wavesweep.engine.drawing import Drawing
from wavesweep.engine.errors import SpecError
from wavesweep.engine.keys import show
from wavesweep.engine.loop import Loops
from wavesweep.program.sweep.grid import make_grid, own_loop

if TYPE_CHECKING:
    from wavesweep.engine.response import Lifted, Port


def refuse_singular(spec, drawing: Drawing) -> None:
    """Raise SpecError if a loop of direct terms has no solution with the spec's own numbers."""
    blocks = Loops(drawing, spec.values).blocks_without_solution()
    if blocks is not None:
        path = f"block.{blocks[0]}" if blocks else "wire"
        lacking = (
            f"one without, or with none that double precision can find, through {', '.join(blocks)}"
        )
        raise SpecError([spec.mistake(path, "loops of direct terms that have a solution", lacking)])


def radius_over(spec, axes) -> np.ndarray:
    """Spectral radius per frame for every combination of the axes, flat, the first axis slowest.

    That of a controller of which nothing runs at the slow rate, as of direct coupling, is counted
    per T_s of its spec, whether the rates divide or not.
    """
    grid = make_grid(spec, axes)
    radii = np.empty(grid.loops)
    for members, loops in grid.drawn(numbers=range(grid.loops)):
        if spec.drawing:
            loops.refuse_unsuitable()
        one_rate = not spec.drawing and loops.drawn().ticks == 1
        frames = loops.values["rates.ratio"] if one_rate else 1
        with np.errstate(over="ignore"):
            radii[members] = loops.read.radii(members.size) ** frames
    return radii[grid.slice_of(np.arange(grid.size))]


def port_at_hand(spec) -> Port:
    """The port of the spec's own loop. Errors: SpecError if it names no hand, or a position that
    no plant has in every tick."""
    from wavesweep.engine.response import NoPositionError, port_of_loops

    if missing := spec.without_hand():
        raise SpecError(missing)
    loop = own_loop(spec)
    try:
        loop.refuse_unsuitable()
        return port_of_loops(loop.one(0))
    except NoPositionError:
        from wavesweep.engine.drawing import OF_PLANT

        displacement = spec.tables()["ports"]["hand"]["displacement"]
        raise SpecError([spec.mistake(POSITION, OF_PLANT, show(displacement))]) from None


def loop_at_hand(spec) -> Lifted:
    """The spec's own loop over a frame as its hand feels it. Errors: as for `port_at_hand`."""
    from wavesweep.engine.response import Lifted

    return Lifted.of(port_at_hand(spec))
