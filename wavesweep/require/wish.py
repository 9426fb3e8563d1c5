"""What may be wished for of a design: overshoot and settling of a step, and what white noise comes
out with."""

from __future__ import annotations

from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from wavesweep.engine.keys import Key
from wavesweep.program.columns import SPARED
from wavesweep.require.gain_bound import MEASURES, OVERSHOOT, RMS, STEP_SETTLING, WITHIN, distance

if TYPE_CHECKING:
    from collections.abc import Mapping

    from wavesweep.engine.drawing import Drawing
    from wavesweep.engine.loop import Loops

ENDS = {
    "from": Key.word("from", None, "input in [ports]"),
    "to": Key.word("to", None, "output in [ports], or a signal"),
}
SETTLED = {
    "within": Key.number(
        "within", WITHIN, "1", "the share of its end to which it settles", low=1e-6, high=0.999
    )
}


def _seen(wish: str, loops: Loops, size: int, ends: Mapping[str, str]):
    """Which loops are stable, and their port between two ends with its maps, those of stable loops;
    no maps if none is, or if the output drifts."""
    from wavesweep.program.analyses.signals import routed

    drawing, route = routed(loops.drawing, ends["from"], ends["to"], f"design.wish.{wish}")
    return _seen_along(drawing, loops.items, route, size, wish if wish in ("peak", RMS) else "")


@lru_cache(maxsize=3)  # several wishes ask about one response
def _seen_along(drawing: Drawing, items: tuple, route: tuple[str, str], size: int, measure: str):
    """The same of loops that are remembered by their numbers, along a route; measure: "" of a step. Of a peak the maps
    have all inputs, of a step those that are read."""
    import numpy as np

    from wavesweep.engine.loop import Loops
    from wavesweep.engine.response import Port
    from wavesweep.require.between import needed
    from wavesweep.require.gain_intervals import reads
    from wavesweep.require.time_intervals import maps_of

    loops = Loops.remembered(drawing, items)
    stable = loops.read.radii(size) < 1
    port = Port.between(loops.drawn(), *route, loops.drift(watched=route[1:]))
    if port.outputs > 1 or not stable.any():
        return stable, port, []
    read = np.arange(port.kind.size) if measure == "peak" else np.flatnonzero(reads(port))
    maps = maps_of(measure, port, needed(port.maps), (size,), read)
    return stable, port, [matrix.part(stable, None) for matrix in maps]


def _peak(loops: Loops, size: int, *, proved: bool, **ends: str):
    """The largest gain of sines of each loop, missing if it is not stable, and whether it is
    certified, to SPARED, or seen alone."""
    import numpy as np

    from wavesweep.require.disc_panels import GOOD
    from wavesweep.require.gain_intervals import between_reads, reads
    from wavesweep.require.sines import Panel

    stable, port, maps = _seen("peak", loops, size, ends)
    value = np.full(size, np.nan)
    certified = stable.copy()
    if not maps:
        return value, certified
    apart = between_reads(np.flatnonzero(reads(port)), port.kind.size)
    arc = np.array([0.0, np.pi / apart])
    for at, loop in enumerate(np.flatnonzero(stable)):
        of_loop = [matrix.part(at) for matrix in maps]
        found = Panel(of_loop, 0.0, arc, at_rest=False).largest()
        level = found * (1 + SPARED)
        value[loop] = level
        panel = Panel(of_loop, level, arc, at_rest=False)
        certified[loop] = not proved or panel.label() == GOOD
    return value, certified


def measured(measure: str, loops: Loops, size: int, *, proved: bool, **options: Any):
    """A value of the response of each loop, missing if it is not stable, and whether it is
    certified, to SPARED; proved: see `step`."""
    import numpy as np

    from wavesweep.require.time_intervals import enclosed_value, refuse_long_frame

    stable, port, maps = _seen(measure, loops, size, options)
    refuse_long_frame(port.kind.size, f"design.wish.{measure}")
    value = np.full(size, np.nan)
    if not maps:
        return value, stable
    band = options.get("within", WITHIN)
    of_signal = isinstance(band, str)
    if of_signal:
        band = distance(loops.drawing, options["to"], band)
    how: Any = {"band": band, "of_signal": of_signal, "proved": proved}
    found = enclosed_value(measure, maps, port, **how)
    known = np.isfinite(found.high)
    value[stable] = np.where(known, found.high, np.nan)
    certified = ~np.isnan(loops.read.radii(size))
    size_of = found.high + (measure == OVERSHOOT)  # which is a share
    certified[stable] = known & (found.high - found.low <= SPARED * size_of)
    return value, certified


WISHES = {
    "peak": {
        "unit": "",
        "within": (0.0, None),
        "more": False,
        "title": "peak of the gain of sines",
        "description": "largest of what comes out of a sine at its own frequency, over the sine, as bode has it: Mt from a reference. Of "
        "sines below half the rate at which the input is read",
        "options": ENDS,
        "ports": (),
        "measure": partial(_peak, proved=True),
        "seen": partial(_peak, proved=False),
    },
} | {
    name: {
        "unit": "" if measure.unit == "of to over from" else measure.unit,
        "within": (0.0, None),
        "more": False,
        "title": measure.title,
        "description": measure.description,
        "options": ENDS | (SETTLED if name == STEP_SETTLING else {}),
        "ports": (),
        "measure": partial(measured, name, proved=True),
        "seen": partial(measured, name, proved=False),
    }
    for name, measure in MEASURES.items()
}
