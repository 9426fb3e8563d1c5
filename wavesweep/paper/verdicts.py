"""A statement of the paper, what was found under each reading, and the verdict that follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wavesweep.paper.bench import Bench
from wavesweep.paper.readings import OWN, READINGS, Reading, summary

REPRODUCED = "reproduced"
INFERRED = "reproduced only under an inferred value"
CONTRADICTED = "contradicted"
UNTESTABLE = "not testable here"

ONLY = "the paper's own values"


class Answer(NamedTuple):
    """Whether a statement holds, and the numbers that say so."""

    holds: bool
    numbers: str


UNSTABLE = Answer(False, "unstable, so there is no steady response")


@dataclass(frozen=True)
class Outcome:
    """The answer under one reading of what the paper leaves open."""

    reading: str
    holds: bool
    numbers: str

    @property
    def unstable(self) -> bool:
        """Whether it fails because there is no response to look at."""
        return self.numbers == UNSTABLE.numbers


@dataclass(frozen=True)
class Finding:
    """All outcomes of a statement; none, and a reason, where it cannot be tested."""

    outcomes: tuple[Outcome, ...]
    reason: str = ""

    @property
    def verdict(self) -> str:
        """One of the four verdicts: it follows from the outcomes alone."""
        held = [outcome.holds for outcome in self.outcomes]
        if not held:
            return UNTESTABLE
        if all(held):
            return REPRODUCED
        return INFERRED if any(held) else CONTRADICTED

    @property
    def numbers(self) -> str:
        """The numbers of the first reading, and those of the first one that decides otherwise and has any."""
        if not self.outcomes:
            return self.reason
        first = self.outcomes[0]
        others = [other for other in self.outcomes if other.holds != first.holds and not other.unstable]
        own = first.numbers if first.reading in (OWN, ONLY) else f"{first.reading}: {first.numbers}"
        return "; ".join([own, *(f"{other.reading}: {other.numbers}" for other in others[:1])])

    def readings(self, *, holds: bool) -> str:
        """The readings under which the statement holds, or fails, in few words."""
        chosen = [outcome for outcome in self.outcomes if outcome.holds == holds]
        unstable = summary(outcome.reading for outcome in chosen if outcome.unstable)
        seen = summary(outcome.reading for outcome in chosen if not outcome.unstable)
        return "; ".join([*([seen] if seen else []), *([f"unstable: {unstable}"] if unstable else [])])


@dataclass(frozen=True)
class Statement:
    """One statement: where the paper makes it, what it says, and the function that judges it.

    The judge's docstring says what is compared with what; it stands in the table.
    """

    where: str
    says: str
    judge: Callable[[Bench], Finding]

    @property
    def test(self) -> str:
        """What is compared with what."""
        return " ".join((self.judge.__doc__ or "").split())


def over(check: Callable[..., Answer], readings: Sequence[Reading] = READINGS) -> Finding:
    """Try `check(*overrides)` under each reading."""
    return Finding(tuple(Outcome(reading.label, *check(*reading.overrides)) for reading in readings))


def once(answer: Answer) -> Finding:
    """The finding of a statement on which nothing that is inferred has a say."""
    return Finding((Outcome(ONLY, *answer),))


def untestable(reason: str) -> Callable[[Bench], Finding]:
    """Give the judge of a statement that this program has no means to test."""

    def judge(_: Bench) -> Finding:
        """Not tested."""
        return Finding((), reason)

    return judge
