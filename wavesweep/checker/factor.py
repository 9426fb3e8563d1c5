"""The loop with a factor of its signal at a cut: a gain, or a phase exp(j phi).

The signal is multiplied in each tick in which it is made, which is how far gain and phase margins go. With a phase the loop is
x+ = A(phi) x with complex numbers, and as many of its modes are outside the unit circle for -phi: the real loop of twice the
memory, (Re x, Im x), has the modes of both.
"""

from dataclasses import replace
from fractions import Fraction
from typing import Any

from . import balls
from .balls import Refused
from .gain import CUT
from .reader.loops import Instant, Schedule, scaled

FACTOR, PHASE = "factor of the signal", "phase of the signal (deg)"  # sides, which no spec has
TWIN = " imaginary"  # ends the names of imaginary parts


def with_factor(schedule: Schedule, name: str, value: Any) -> Schedule:
    """The schedule with such a factor, or a phase in degrees, of a loop that is read with a cut."""
    real, imaginary = value, None
    if name == PHASE:
        angle = balls.pi * value * Fraction(1, 180)
        real, imaginary = balls.cos(angle), balls.sin(angle)
    kinds = {}
    made = False
    for kind, instant in schedule.kinds.items():
        equations = dict(instant.equations)
        signal = {at: c for at, c in equations.get(CUT, {}).items() if not at.startswith("!")}
        turns = len(signal) < len(equations.get(CUT, {}))
        made |= turns
        if turns:
            equations[CUT] = scaled(real, signal)
        if imaginary is not None:
            twin = _twin(equations)
            if turns:
                twin[CUT + TWIN] |= scaled(imaginary, signal)
                equations[CUT] = equations[CUT] | _named(scaled(-imaginary, signal))
            equations |= twin
        kinds[kind] = Instant(equations, _both(instant.writes, imaginary))
    if not made:
        raise Refused("nothing is made at the cut")
    motion = Instant(
        _both(schedule.motion.equations, imaginary), _both(schedule.motion.writes, imaginary)
    )
    return replace(schedule, kinds=kinds, motion=motion)


def _both(rows: dict, imaginary: Any) -> dict:
    return rows if imaginary is None else rows | _twin(rows)


def _twin(rows: dict) -> dict:
    return {name + TWIN: _named(row) for name, row in rows.items()}


def _named(row: dict) -> dict:
    """The same of imaginary parts; what comes in from outside is real."""
    return {name + TWIN: c for name, c in row.items() if not name.startswith("!")}
