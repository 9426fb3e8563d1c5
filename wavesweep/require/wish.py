"""What may be wished for of a design: overshoot and settling of a step, and what white noise comes
out with."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from wavesweep.engine.keys import Key
from wavesweep.require.gain_bound import MEASURES, OVERSHOOT

if TYPE_CHECKING:
    from wavesweep.engine.loop import Loops

EXACT = 1e-6  # of a value, to which it is known if it is certified
ENDS = {
    "from": Key.word("from", None, "input in [ports]"),
    "to": Key.word("to", None, "output in [ports], or a signal"),
}


def _measured(measure: str, loops: Loops, size: int, **ends: str):
    """A value of the response of each loop, missing if it is not stable, and whether it is
    certified, to EXACT."""
    import numpy as np

    from wavesweep.engine.response import Port
    from wavesweep.program.analyses.signals import routed
    from wavesweep.require.between import needed
    from wavesweep.require.maps import over_frame
    from wavesweep.require.time_intervals import enclosed_value, refuse_long_frame

    drawing, route = routed(loops.drawing, ends["from"], ends["to"], f"design.wish.{measure}")
    loops = loops._replace(drawing=drawing)
    stable = loops.read.radii(size) < 1
    port = Port.between(loops.drawn(), *route, loops.drift(watched=route[1:]))
    refuse_long_frame(port.kind.size, f"design.wish.{measure}")
    value = np.full(size, np.nan)
    if port.outputs > 1 or not stable.any():
        return value, stable
    maps = over_frame(port, needed(port.maps), (size,), np.arange(port.kind.size))
    maps = [matrix.part(stable, None) for matrix in maps]
    found = enclosed_value(measure, maps, port.rate)
    known = np.isfinite(found.high)
    value[stable] = np.where(known, found.high, np.nan)
    certified = ~np.isnan(loops.read.radii(size))
    size_of = found.high + (measure == OVERSHOOT)  # which is a share
    certified[stable] = known & (found.high - found.low <= EXACT * size_of)
    return value, certified


WISHES = {
    name: {
        "unit": "" if measure.unit == "of to over from" else measure.unit,
        "more": False,
        "title": measure.title,
        "description": measure.description,
        "options": ENDS,
        "ports": (),
        "measure": partial(_measured, name),
    }
    for name, measure in MEASURES.items()
}
