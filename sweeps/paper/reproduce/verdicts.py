"""Statements of the paper, their outcomes under each reading, the verdicts that follow, and the table of all."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from reproduce.paper_loops import PaperLoops
from reproduce.readings import OWN, Reading
from reproduce.specs import FOLDER, load_paper
from wavesweep.program.results import Field
from wavesweep.program.tables.table import Table, facts_of

REPRODUCED = "reproduced"
INFERRED = "reproduced only under an inferred value"
CONTRADICTED = "contradicted"
UNTESTABLE = "not testable here"
VERDICTS = (REPRODUCED, INFERRED, CONTRADICTED, UNTESTABLE)
METHODS = {"verdict": "each statement's test is tried under each reading of what the paper leaves open"}

FIELDS = (
    Field("number", "integer", "1", "of the statement, in the paper's order"),
    Field("where", "string", "", "sections and figures of the paper that make it"),
    Field("statement", "string", "", "what the paper says"),
    Field("verdict", "string", "", ", ".join(VERDICTS)),
    Field("numbers", "string", "", "what was found"),
    Field("holds_under", "string", "", "readings of what the paper leaves open under which it holds, the smallest changes"),
    Field("fails_under", "string", "", "readings under which it does not, the smallest changes"),
    Field("test", "string", "", "what is compared with what"),
    Field("readings", "integer", "1", "how many readings were tried"),
    Field("held", "integer", "1", "under how many of them it holds"),
    Field("turned_by", "string", "", "the smallest changes of the first reading that decide otherwise"),
)


class Answer(NamedTuple):
    """Whether a statement holds, and the numbers that say so."""

    holds: bool
    numbers: str


UNSTABLE = Answer(False, "unstable, so there is no steady response")


@dataclass(frozen=True)
class Outcome:
    """The answer under one reading."""

    reading: Reading
    holds: bool
    numbers: str

    @property
    def unstable(self) -> bool:
        """Whether it fails because the loop is unstable and has no response."""
        return self.numbers == UNSTABLE.numbers


@dataclass(frozen=True)
class Finding:
    """All outcomes of a statement, that of the spec's own values first; if it cannot be tested, none and a reason."""

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
        """Number of readings under which it holds."""
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
    """One statement: its place in the paper, its words, and the function that judges it.

    says: the paper's own words in quotation marks, which may leave out some ("..."), then which part of them is meant.
    The judge's docstring names the quantities compared; it is part of the table.
    """

    where: str
    says: str
    judge: Callable[[PaperLoops], Finding]

    @property
    def test(self) -> str:
        """The quantities compared, in words."""
        return " ".join((self.judge.__doc__ or "").split())


def over(readings: Sequence[Reading], check: Callable[..., Answer], *found: Sequence) -> Finding:
    """Try `check` on the results under each reading; found: sequences with an element per reading."""
    answers = (check(*each) for each in zip(*found, strict=True))
    return Finding(tuple(Outcome(reading, *answer) for reading, answer in zip(readings, answers, strict=True)))


def untestable(reason: str) -> Callable[[PaperLoops], Finding]:
    """Give the judge of a statement that this program has no means to test."""

    def judge(_: PaperLoops) -> Finding:
        """Not tested."""
        return Finding((), reason)

    return judge


def judge(paper: PaperLoops, statements: Sequence[Statement], done: Callable[[], None] = lambda: None) -> Table:
    """Judge the statements in turn, calling `done` after each: a row each."""
    started, found = time.perf_counter(), []
    for statement in statements:
        found.append(statement.judge(paper))
        done()
    columns = {"number": np.arange(1, len(found) + 1), **_rows(statements, found)}
    counts = {"computed": len(found), "skipped": 0, "certified": 0}
    facts = _facts(counts, time.perf_counter() - started)
    return Table.of("statements", columns, facts, fields=FIELDS)


def _rows(statements: Sequence[Statement], found: Sequence[Finding]) -> dict[str, np.ndarray]:
    columns = {
        "where": [statement.where for statement in statements],
        "statement": [statement.says for statement in statements],
        "verdict": [finding.verdict for finding in found],
        "numbers": [finding.numbers for finding in found],
        "holds_under": [finding.readings(holds=True) for finding in found],
        "fails_under": [finding.readings(holds=False) for finding in found],
        "test": [statement.test for statement in statements],
        "readings": [len(finding.outcomes) for finding in found],
        "held": [finding.held for finding in found],
        "turned_by": [finding.turned_by for finding in found],
    }
    whole = ("readings", "held")
    return {name: np.array(column, dtype=int if name in whole else object) for name, column in columns.items()}


def _facts(counts: dict[str, int], seconds: float) -> dict:
    """Facts over all of the paper's specs, whose digests together are that of the table."""
    specs = [load_paper(path.stem) for path in sorted(FOLDER.glob("*.toml"))]
    facts = facts_of(specs[0], METHODS, counts, {"compute_s": seconds})
    del facts["spec"]
    digest = hashlib.sha256("".join(spec.sha256 for spec in specs).encode()).hexdigest()
    return {**facts, "specs": {spec.name: spec.tables() for spec in specs}, "spec_sha256": digest}
