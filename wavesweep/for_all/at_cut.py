"""What [sweep] requires of all loops of [for_all]: margins, whose factors at a cut are numbers that
are not known, so that a refuter is a member with a factor; and modes within a radius, by which frames
are divided."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.engine.loop import Loops
from wavesweep.program.analyses.factors_at_cut import PATH, with_factors
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.keys import TIMES_OF_MODES
from wavesweep.program.reading.tables import TableValue
from wavesweep.program.sweep.grid import frames_per_clock

if TYPE_CHECKING:
    from wavesweep.for_all.varying import Rules

__all__ = ["PATH", "of_required", "refused"]

ANSWERED = ("margins", "radius", *TIMES_OF_MODES)
RMS = "rms"  # which alone can be had of chances


def refused(require: TableValue, rules: Rules, *, at_random: bool) -> str:
    """Why a requirement cannot be held for all of [for_all], empty if it can; at_random: whether
    it is about chances."""
    words = (RMS,) if at_random else ANSWERED
    unanswered = [name for name in require.written() if name not in words]
    if unanswered:
        answered = " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
        beside = "chances of frames or messages" if at_random else "[for_all]"
        return f"expected {answered} alone beside {beside}, found {', '.join(unanswered)}"
    if at_random and rules.ranges:
        return "expected values = [...] of numbers of [for_all] beside rms, found a range"
    if rules.vary and not at_random:
        return (
            "expected constant numbers in [for_all] beside it, found frames or messages that vary"
        )
    return ""


def of_required(
    rules: Rules,
    loops: Loops,
    ranges: Sequence[Axis],
    along: Mapping[str, Sequence[float]],
) -> Iterator[tuple[Loops, list[Axis], Any]]:
    """Yield the loops themselves with the bound on their modes, None for stability, and those of each
    margin that is required, see `with_factors`, all with their ranges. along: path -> ends of a number
    of intervals. Of loops without ranges the exact intervals along it have all margins.

    Errors: UsageError for a time of modes beside a number that changes the rate.
    """
    require: Any = rules.require
    if not require or rules.at_random:
        yield loops, [*ranges], None
        return
    if along and not ranges and require.cuts:
        yield loops, [], require.bound.over(frames_per_clock(rules.drawing, loops))
        return
    varied = {axis.path: (axis.start, axis.stop) for axis in ranges} | {**along}
    if modes := require.bound.of_modes:
        rate = loops.changed({path: np.array(ends) for path, ends in varied.items()}).rate
        if modes.times and np.ptp(rate):
            times = " and ".join(name for name, _ in modes.times)
            expected = f"numbers beside {times} that leave the rate as it is"
            raise UsageError(f"{PATH}: expected {expected}, found one that changes it")
        yield loops, [*ranges], modes.over(frames_per_clock(rules.drawing, loops))
    for cut_margins in require.cuts:
        for with_factor, factors in with_factors(loops, cut_margins, varied):
            yield with_factor, [*ranges, *factors], None
