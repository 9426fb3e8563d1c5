"""The table of statements: every one judged, as columns and as text."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Sequence

import numpy as np

from wavesweep.paper.bench import Bench
from wavesweep.paper.specs import folder, load_paper
from wavesweep.paper.verdicts import CONTRADICTED, INFERRED, REPRODUCED, UNTESTABLE, Finding, Statement
from wavesweep.results import Field
from wavesweep.sweep import Run
from wavesweep.sweep.run import facts_of

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


def judge(bench: Bench, statements: Sequence[Statement], done: Callable[[], None] = lambda: None) -> Run:
    """Judge the statements in turn, calling `done` after each: a row each."""
    started, found = time.perf_counter(), []
    for statement in statements:
        found.append(statement.judge(bench))
        done()
    columns = {"number": np.arange(1, len(found) + 1), **_rows(statements, found)}
    counts = {"computed": len(found), "skipped": 0, "certified": 0}
    return Run(columns, _facts(counts, time.perf_counter() - started))


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
    specs = [load_paper(path.stem) for path in sorted(folder().glob("*.toml"))]
    facts = facts_of(specs[0], METHODS, counts, {"compute_s": seconds})
    del facts["spec"]
    digest = hashlib.sha256("".join(spec.sha256 for spec in specs).encode()).hexdigest()
    return {**facts, "specs": {spec.name: spec.tables() for spec in specs}, "spec_sha256": digest}
