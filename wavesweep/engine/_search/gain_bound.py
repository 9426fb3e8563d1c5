"""A bound on a gain of the loop, beside what is required of its modes.

Applies if the region that is asked for has one. The other methods find where the loop is stable;
within that, each gain in turn is proved to be below its bound on panels of the number, by that
region itself, where those before it are.
"""

from dataclasses import replace

import numpy as np

from wavesweep.engine._search.question import Question, RequiredRegion, Rest, Slices
from wavesweep.engine._stability.intervals import Intervals, common


def applies(question: Question, slices: Slices) -> bool:  # noqa: ARG001
    """Whether a gain is bounded."""
    return bool(question.bound and question.bound.gains)


def find(question: Question, slices: Slices, rest: Rest) -> Intervals:
    """The stable intervals, as far as the gain is small enough."""
    from wavesweep.engine._search.frames_along import FramesAlong, in_own_time

    loops = slices.loops
    bound: RequiredRegion = question.bound  # type: ignore[assignment]  # else it does not apply
    stable = rest(replace(question, bound=bound.of_modes), slices)
    frames = FramesAlong.of(question, loops, slices.size)
    for number, gain in enumerate(bound.gains, start=1):
        within = bound.within_gain(gain, frames, question.span, stable)
        causes = {}
        for end in ("low", "high"):
            by_gain = np.signbit(getattr(within, f"{end}_omega"))
            before = getattr(within, f"{end}_cause")
            causes[f"{end}_cause"] = np.where(by_gain & (before == 0), number, before)
        stable = common([stable, replace(within, **causes)])
    # Ends of stability are in their own time already; those of gains have a minus.
    timed = in_own_time(stable, loops, question.along)
    omegas = {}
    for name in ("low_omega", "high_omega"):
        omega = getattr(stable, name)
        omegas[name] = np.where(omega < 0, getattr(timed, name), omega)
    return replace(stable, **omegas)
