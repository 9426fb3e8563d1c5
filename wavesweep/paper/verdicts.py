"""A statement of the paper, what was found under each reading, and the verdict that follows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from wavesweep.paper.bench import Bench
from wavesweep.paper.readings import OWN, Reading

REPRODUCED = "reproduced"
INFERRED = "reproduced only under an inferred value"
CONTRADICTED = "contradicted"
UNTESTABLE = "not testable here"


class Answer(NamedTuple):
    """Whether a statement holds, and the numbers that say so."""

    holds: bool
    numbers: str


UNSTABLE = Answer(False, "unstable, so there is no steady response")


@dataclass(frozen=True)
class Outcome:
    """The answer under one reading of what the paper leaves open."""

    reading: Reading
    holds: bool
    numbers: str

    @property
    def unstable(self) -> bool:
        """Whether it fails because there is no response to look at."""
        return self.numbers == UNSTABLE.numbers


@dataclass(frozen=True)
class Finding:
    """All outcomes of a statement, the spec's own values first; none, and a reason, where it cannot be tested."""

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
    def held(self) -> int:
        """Under how many readings it holds."""
        return sum(outcome.holds for outcome in self.outcomes)

    @property
    def numbers(self) -> str:
        """The numbers of the first reading, and of the smallest change that decides otherwise and has any."""
        if not self.outcomes:
            return self.reason
        first, *others = self.outcomes[0], *_smallest(self._others(unstable=False))
        own = first.numbers if first.reading.label == OWN else f"{first.reading.label}: {first.numbers}"
        return "; ".join([own, *(f"{other.reading.label}: {other.numbers}" for other in others[:1])])

    @property
    def turned_by(self) -> str:
        """The smallest changes of the first reading that decide otherwise; those that make a loop unstable apart."""
        seen, unstable = (_named(_smallest(self._others(unstable=each))) for each in (False, True))
        return "; ".join([*([seen] if seen else []), *([f"unstable: {unstable}"] if unstable else [])])

    def readings(self, *, holds: bool) -> str:
        """The readings under which it holds, or fails, but those that contain another one of these."""
        chosen = [outcome for outcome in self.outcomes if outcome.holds == holds]
        return _named([one for one in chosen if not any(one.reading.contains(other.reading) for other in chosen)])

    def _others(self, *, unstable: bool) -> list[Outcome]:
        """The outcomes that decide otherwise than the first one."""
        return [each for each in self.outcomes if each.holds != self.outcomes[0].holds and each.unstable == unstable]


def _smallest(outcomes: Sequence[Outcome]) -> list[Outcome]:
    fewest = min((outcome.reading.size for outcome in outcomes), default=0)
    return [outcome for outcome in outcomes if outcome.reading.size == fewest]


def _named(outcomes: Sequence[Outcome]) -> str:
    return "; ".join(outcome.reading.label for outcome in outcomes)


@dataclass(frozen=True)
class Statement:
    """One statement: where the paper makes it, what it says, and the function that judges it.

    says: the paper's own words in quotation marks, which may leave out some ("..."), then which part of them is meant.
    The judge's docstring says what is compared with what; it stands in the table.
    """

    where: str
    says: str
    judge: Callable[[Bench], Finding]

    @property
    def test(self) -> str:
        """What is compared with what."""
        return " ".join((self.judge.__doc__ or "").split())


def over(readings: Sequence[Reading], check: Callable[..., Answer], *found: Sequence) -> Finding:
    """Try `check` on what was found under each reading; found: sequences with an element per reading."""
    answers = (check(*each) for each in zip(*found, strict=True))
    return Finding(tuple(Outcome(reading, *answer) for reading, answer in zip(readings, answers, strict=True)))


def untestable(reason: str) -> Callable[[Bench], Finding]:
    """Give the judge of a statement that this program has no means to test."""

    def judge(_: Bench) -> Finding:
        """Not tested."""
        return Finding((), reason)

    return judge
