"""What `margins` asks of [for_all]: all loops of a box, and the proof that they are stable."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wavesweep.engine.loop import Loops
from wavesweep.engine.sets import Side, Sides
from wavesweep.engine.switched import cover_constant
from wavesweep.for_all.rows import numbers_in_words, refuse_unsuitable_ranges
from wavesweep.program.spec import Spec

__all__ = [
    "numbers_in_words",
    "proved_stable",
    "varying",
]


@dataclass(frozen=True, slots=True, eq=False)
class Stable:
    """What is proved of a box: all loops up to `end` of its first side, and whether that is all of
    it.

    met: the numbers next to which the proof has ended, if it is not.
    """

    end: float
    whole: bool
    met: tuple[float, ...] | None


def proved_stable(
    loop: Loops,
    sides: Sequence[Side],
    ends: np.ndarray,
    ranges: Sequence[str],
    box: np.ndarray,
    up: bool,
) -> Stable:
    """Return up to where all loops of a box are stable, from an end of its first side on.

    sides: the first of the box, with their ends `(2, sides)`. ranges, box: paths of the other
    numbers, with their ends `(2, numbers)`. up: from the low end on.
    """
    others = Sides.of(loop, ranges, box)
    all_sides = Sides([*sides, *others])
    whole = np.column_stack([ends, others.places(box)])
    found = cover_constant(loop, all_sides, whole, up)
    if not found.open:
        return Stable(found.end, True, None)
    place = found.point if found.word else found.open[0].mean(0)
    return Stable(found.end, False, tuple(all_sides.numbers(place).tolist()))


def varying(spec: Spec) -> list[str]:
    """What varies from frame to frame, or from message to message.

    Errors: UsageError for too many numbers if nothing does.
    """
    found = [axis.name for axis in spec.for_all.changing]
    found += ["lost"] * bool(spec.for_all.lost or spec.for_all.loss) + ["messages"] * bool(
        spec.drawing and spec.drawing.channels
    )
    if not found:
        refuse_unsuitable_ranges(spec, "")
    return found
