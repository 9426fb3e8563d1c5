"""The value of a number that comes nearest to meeting requirements which no value meets together."""

from typing import Any

import numpy as np

from wavesweep.capabilities import modules
from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loop import Loops
from wavesweep.program.reading.keys import TIMES_OF_MODES

PLACES = 33  # inside a span, at which requirements are looked at, beside its ends
MOST_STATES = 40  # of a frame; of more a margin at each place takes long


def nearest_to_all(
    bound: Any, loops: Loops, path: str, span: tuple[float, float]
) -> dict[str, Any]:
    """The value that misses by the least factor what it misses most, and what each requirement is there;
    empty if no value looked at is stable, or nothing is measured.

    bound: a `Bound` with gains. loops: a single loop. path: path of the number, span: its range.
    requirements: by their words, each with its value, its bound, and whether more is better.
    """
    values = np.linspace(*span, PLACES + 2)
    values = values[values != 0]
    if len(loops.read.drift_of_frames().remaining) > MOST_STATES:
        return {}
    try:
        measured = _measured(bound, loops.changed({path: values}), values.size)
    except IllPosedLoopError:  # of one value at least
        return {}
    missed = np.zeros(values.size)
    for requirement in measured.values():
        ratio = requirement["value"] / requirement["bound"]
        missed = np.fmax(
            missed,
            np.where(np.isfinite(ratio), 1 / ratio if requirement["more"] else ratio, np.inf),
        )
    nearest = int(missed.argmin())
    if not measured or not np.isfinite(missed[nearest]):
        return {}
    requirements = {
        word: requirement | {"value": float(requirement["value"][nearest])}
        for word, requirement in measured.items()
    }
    return {"value": float(values[nearest]), "requirements": requirements}


def _measured(bound, loops, size):
    """Each requirement that has a value of its own: those of loops `(size,)`, its bound, and whether
    more is better."""
    wishes: dict[str, Any] = {}
    for module in modules("wish"):
        wishes |= module.WISHES
    measured = {}
    drawn = loops.read.drawn()
    radius = loops.read.radii(size)
    decay = -np.log(np.where(radius < 1, radius, np.nan)) / (drawn.period * drawn.ticks)
    for name, time in bound.times:
        lasting = TIMES_OF_MODES[name].constants / decay
        measured[name] = {"value": lasting, "bound": time, "more": False}
    for gain in bound.gains:
        wish, wanted, options = gain.wish
        if wish in wishes:
            value, _ = wishes[wish]["seen"](loops, size, **options)
            measured[gain.word] = {"value": value, "bound": wanted, "more": wishes[wish]["more"]}
    return measured
