"""What may be wished for of a design: margins of the loop that is cut at a signal."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import TYPE_CHECKING

from wavesweep.engine.keys import Key

if TYPE_CHECKING:
    from wavesweep.engine.drawing import Drawing
    from wavesweep.engine.loop import Loops
    from wavesweep.margins.lifted_margins import LiftedLoop

CUT = {"cut": Key.word("cut", None, "signal BLOCK.PORT at which the loop is cut")}


@lru_cache(maxsize=256)  # several wishes ask about one design
def _broken_at(drawing: Drawing, items: tuple, cut: str) -> LiftedLoop:
    """One loop or a batch that is broken, remembered by its numbers."""
    from wavesweep.engine.loop import Loops
    from wavesweep.margins.broken_loops import broken_in

    return broken_in(Loops.remembered(drawing, items), cut)


def _measured(name: str, loops: Loops, size: int, cut: str):
    """A margin of each loop, missing if it is not stable, and whether it is certified."""
    import numpy as np

    from wavesweep.margins.lifted_margins import margins_of

    value = np.full(size, np.nan)
    certified = np.zeros(size, bool)
    for number in range(size):
        loop = loops.one(number)
        margins, doubt = margins_of(_broken_at(loop.drawing, loop.items, cut), {name})
        certified[number] = not doubt
        for margin in margins:
            if margin.name == name:
                value[number] = margin.value
                certified[number] = not doubt and not margin.doubt
    return value, certified


def _seen(name: str, loops: Loops, size: int, cut: str):
    """The same of margins that a search ranks by, which are seen alone."""
    import numpy as np

    from wavesweep.margins.lifted_margins import seen_margins

    value = seen_margins(_broken_at(loops.drawing, loops.items, cut), size, name)
    return value, np.ones(size, bool)


def _wish(name: str, *, more: bool, title: str, description: str, unit: str, within: tuple):
    """A wish for the margin of this name."""
    return {
        "unit": unit,
        "within": within,
        "more": more,
        "title": title,
        "description": description,
        "options": CUT,
        "ports": (),
        "measure": partial(_measured, name),
        "seen": partial(_seen if name in ("gain", "phase") else _measured, name),
    }


WISHES = {
    "gain": _wish(
        "gain",
        more=True,
        title="gain margin",
        description="gain margin at a cut: every factor between it and 1 over it leaves the loop stable",
        unit="1",
        within=(1.0, None),
    ),
    "phase_deg": _wish(
        "phase",
        more=True,
        title="phase margin",
        description="phase margin at a cut",
        unit="deg",
        within=(0.0, 180.0),
    ),
    "disk": _wish(
        "disk",
        more=True,
        title="disk margin",
        description="disk margin at a cut, of gain and phase together",
        unit="1",
        within=(0.0, 2.0),
    ),
    "Ms": _wish(
        "sensitivity",
        more=False,
        title="peak sensitivity Ms",
        description="peak sensitivity at a cut, the largest |1/(1 + L)|",
        unit="1",
        within=(1.0, None),
    ),
}
