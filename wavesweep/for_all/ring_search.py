"""What is proved and refuted of a ring of messages: by a small gain, by norms, and by patterns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from wavesweep.engine.switched import (
    Bracket,
    Decision,
    Refuted,
    RingSearch,
    Verdict,
    covered,
    driven,
    is_refuted,
)
from wavesweep.for_all.message_patterns import PERIODS, SHORT, growing_pattern, nearest_pattern
from wavesweep.for_all.message_rings import RingFrames

WORK = 1e11  # operations of a search for norms, or of a proof on one side: some 40 s
STARTS = (0.1, 0.01, 0.5, 1e-3, 1e-4)  # of an interval, where a proof begins
NORMS_BEGIN = 0.2  # of what a small gain proves, where norms are searched that prove more
ROOM = 0.01  # of a number with which a proof begins
LEAST_STEP = 5e-3  # of a number, or of the way that is left: shorter ones end a proof
STEPS = 80  # of a proof
TOLERANCE = 0.01  # of what is refuted, how near to it a proof is aimed at
BY_GAIN = "by a small gain"


def decide_ring(family: RingFrames, x: float = 0.0, work: float = WORK) -> Decision:
    """Decide whether all patterns decay at x; as `decide`, whose norms, work and errors it has."""
    if family.gain.proved(x, x):
        return Decision(Verdict.PROVED, by=BY_GAIN)
    word = _refuting(family, x, SHORT)
    if word:
        return Decision(Verdict.REFUTED, word=word)
    search = None if family.few else RingSearch.at_mean(family, x)
    centre = search and search.found(x, work)
    if centre is not None and search.proved((x, centre)):
        return Decision(Verdict.PROVED)
    word = _refuting(family, x, PERIODS)
    return Decision(Verdict.REFUTED, word=word) if word else Decision(Verdict.UNKNOWN)


def _refuting(family, x, periods):
    """A pattern that is proved to grow at x; empty if none is found."""
    rate, word = growing_pattern(family, x, periods=periods)
    return word if rate >= 1 and is_refuted(family, word, x) else ()


def _reached_by_norms(
    family: RingFrames, below: float, above: float, goal: float, report: Callable
) -> float:
    """Return the number towards the goal that a proof by norms reaches, of a range in which a small
    gain is proved; it begins where that leaves room."""
    start = below + NORMS_BEGIN * (above - below)
    search = RingSearch.at_mean(family, start)
    centre = search and search.found(start, WORK)
    if centre is None or not search.proved((start, centre)):
        return above
    centre = replace(centre, work=0.0)
    _, end, _ = covered(search, centre, start, goal, LEAST_STEP, WORK, STEPS, report)
    return end


def bracket_ring(
    family: RingFrames,
    about: tuple[float, float],
    report: Callable[[float, float, float], None] = lambda *_: None,
    value: float = np.nan,
) -> Bracket | None:
    """Return what is proved and refuted within an interval of a number, as `bracket`; None if
    no start of a proof is found. value: of the number; a proof that has reached it goes no farther."""
    low, high = about
    gain = family.gain
    starts = [low + share * (high - low) for share in STARTS]
    # With some room about it: from where a proof only just holds, it goes nowhere.
    begun = next((x for x in starts if gain.proved(x - ROOM * abs(x), x + ROOM * abs(x))), None)
    if begun is None:
        return None
    reached = gain.reached(begun, high)
    below = gain.reached(begun, low)
    report(below, reached, 100 * (reached - low) / (high - low))
    if below <= value <= reached:
        return Bracket(below, reached, Refuted(), Refuted())

    def told(end: float, _: float) -> None:
        # Norms begin below what the small gain has proved.
        highest = max(end, reached)
        report(below, highest, 100 * (highest - low) / (high - low))

    def by_norms(above, goal, _refuted):
        if above < goal and not family.few:
            above = max(above, _reached_by_norms(family, below, above, goal, told))
        return above, Refuted()

    refuted = nearest_pattern(family, reached, high) if reached != high else Refuted()
    above, refuted = driven(reached, high, TOLERANCE / 2, refuted, by_norms)
    first = Refuted()
    if below > max(low, TOLERANCE**2 * above):
        first = nearest_pattern(family, below, low)
    return Bracket(below, above, first, refuted)
