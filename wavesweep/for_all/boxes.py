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
    other_sides = Sides.of(loop, ranges, box)
    all_sides = Sides([*sides, *other_sides])
    whole = np.column_stack([ends, other_sides.places(box)])
    covering = cover_constant(loop, all_sides, whole, up)
    if not covering.open:
        return Stable(covering.end, True, None)
    place = covering.point if covering.word else covering.open[0].mean(0)
    return Stable(covering.end, False, tuple(all_sides.numbers(place).tolist()))


def varying(spec: Spec) -> list[str]:
    """What varies from frame to frame, or from message to message.

    Errors: UsageError for too many numbers if nothing does.
    """
    names = [axis.name for axis in spec.for_all.changing]
    if spec.for_all.lost or spec.for_all.loss:
        names.append("lost")
    if spec.drawing and spec.drawing.channels:
        names.append("messages")
    if not names:
        refuse_unsuitable_ranges(spec, "")
    return names
