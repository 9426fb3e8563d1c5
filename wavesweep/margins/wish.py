"""What may be wished for of a design: margins of the loop that is cut at a signal."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, partial
from typing import TYPE_CHECKING

from wavesweep.engine.keys import Key

if TYPE_CHECKING:
    from wavesweep.engine.drawing import Drawing
    from wavesweep.engine.loop import Loops
    from wavesweep.margins.lifted_margins import LiftedLoop
    from wavesweep.margins.loop_margins import Margin

Margins = Mapping[str, "Margin"]

CUT = {"cut": Key.word("cut", None, "signal BLOCK.PORT at which the loop is cut")}


@lru_cache(maxsize=256)  # several wishes ask about one design
def _broken_at(drawing: Drawing, items: tuple, cut: str) -> LiftedLoop:
    from wavesweep.engine.loop import Loops
    from wavesweep.margins.broken_loops import broken_in

    return broken_in(Loops(drawing, dict(items)), cut)


def _gain(found: Margins) -> float:
    """The least factor by which a gain may not change, up or down."""
    down = found["gain_down"].value
    return min(found["gain_up"].value, 1 / down if down else float("inf"))


def _measured(value_of: Callable, names: tuple[str, ...], loops: Loops, size: int, cut: str):
    """A value of the margins of each loop, missing if it is not stable, and whether those of
    these names are certified."""
    import numpy as np

    from wavesweep.margins.lifted_margins import margins_of

    value = np.full(size, np.nan)
    certified = np.zeros(size, bool)
    for number in range(size):
        one = loops.one(number)
        margins, doubt = margins_of(_broken_at(one.drawing, one.items, cut), names)
        found = {margin.name: margin for margin in margins}
        if found:
            value[number] = value_of(found)
        certified[number] = not doubt and not any(found[name].doubt for name in names if found)
    return value, certified


def _wish(value_of: Callable, *names: str, more: bool, title: str, description: str, unit: str):
    """A wish that is measured from the margins of these names."""
    return {
        "unit": unit,
        "more": more,
        "title": title,
        "description": description,
        "options": CUT,
        "ports": (),
        "measure": partial(_measured, value_of, names),
    }


WISHES = {
    "gain": _wish(
        _gain,
        "gain_up",
        "gain_down",
        more=True,
        title="gain margin",
        description="gain margin at a cut: every factor between it and 1 over it leaves the loop stable",
        unit="1",
    ),
    "phase_deg": _wish(
        lambda found: found["phase"].value,
        "phase",
        more=True,
        title="phase margin",
        description="phase margin at a cut",
        unit="deg",
    ),
    "disk": _wish(
        lambda found: found["disk"].value,
        "disk",
        more=True,
        title="disk margin",
        description="disk margin at a cut, of gain and phase together",
        unit="1",
    ),
    "Ms": _wish(
        lambda found: found["sensitivity"].value,
        "sensitivity",
        more=False,
        title="peak sensitivity Ms",
        description="peak sensitivity at a cut, the largest |1/(1 + L)|",
        unit="1",
    ),
}
