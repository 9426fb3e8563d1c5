"""The verdict on a spec's own design: its own numbers, and what each capability says of it."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from math import inf
from typing import Any

import numpy as np

from wavesweep.capabilities import asked
from wavesweep.program.analyses.assumptions import of_axes
from wavesweep.program.analyses.claim_words import as_json
from wavesweep.program.analyses.claims import AT_REST, PUSHES, Claim, Status, Verdict, curve_of
from wavesweep.program.analyses.own_design import is_first, own_claim, own_design
from wavesweep.program.spec import Spec

Facts = Mapping[str, Any]
Ranked = tuple[float, str | Callable[[], str]]


def verdict(spec: Spec) -> dict:
    """The verdict on the spec's own design as a JSON-able dict; a missing number is None.

    The numbers of `own_design`, those that capabilities add to them, those of `further`, and
    `answer`: "yes", "no" or "not known" to what the spec asks, see `claims.questions`, with the
    answer to each of its `questions`.
    """
    facts = own_design(spec) | numbers(spec)
    return written(spec, facts | further(spec, facts))


def of_spec(spec: Spec, found: Facts) -> Verdict:
    """The verdict on what a spec asks; found: what is known of its own design, with `further`."""
    return Verdict.of(spec, [own_claim(spec, found), *found["claims"]])


def written(spec: Spec, found: Facts) -> dict[str, Any]:
    """What is known of a spec's own design as JSON has it, with the verdict."""
    judged = of_spec(spec, found)
    claims = {
        "answer": judged.status.answer,
        "questions": [as_json(claim) for claim in judged.answers],
    }
    shown = {name: value for name, value in found.items() if name != "claims"}
    refuted = {}  # by walls
    for claim in judged.answers:
        if claim.what == AT_REST and claim.status is Status.REFUTED:
            refuted[claim.scope.walls] = {"verdict": "refuted", "counterexample": claim.reason}
    if "contact" in found and found["contact"]["verdict"] != "refuted":
        shown["contact"] = refuted.get(PUSHES, found["contact"])
    for block, known in found.get("saturations", {}).items():
        if known["verdict"] != "refuted":
            told = refuted.get(curve_of(block), known)
            shown["saturations"] = shown["saturations"] | {block: told}
    return shown | claims


def numbers(spec: Spec) -> dict:
    """The numbers that capabilities add to those of a spec's own design."""
    of_all = {}
    for of_one in asked("on_check", "numbers", spec):
        of_all |= of_one
    return of_all


@np.errstate(all="ignore")  # of numbers that overflow
def further(spec: Spec, own: dict, report: Callable[[int, int], None] | None = None) -> dict:
    """What capabilities say in addition to the numbers of `own_design`; claims: those of all of
    them.

    report: is called with the number of ranges that are done, and of all.
    """
    of_all = {}
    claims: list[Claim] = []
    for facts in asked("on_check", "facts", spec, own, report):
        claims += facts.get("claims", ())
        of_all |= facts
    return of_all | {"claims": claims}


def verdict_lines(spec: Spec, found: Facts, late: bool = False) -> Iterator[Ranked]:
    """Yield what the verdict says beside `own_lines`, each line with its rank, see `on_check`.

    late: yield lines that take a while to make as functions that make them.
    """

    def indented(line):
        return f"  {line() if callable(line) else line}"

    if design := of_axes(spec, [axis for axis in spec.sweep if axis.values], "[sweep]"):
        yield 1, f"  for the spec's own {design}"
    for lines in asked("on_check", "lines", spec, found):
        for rank, line in lines:
            yield rank, partial(indented, line) if late and callable(line) else indented(line)
    if found["assumes"] and not is_first(spec, found):
        yield 0, f"  assumes: {found['assumes']}"


def distance(limit: Facts) -> float:
    """The rank of a limit among others, from 0 for one that is not known or not stable to 1 for
    ends that are far away."""
    value = limit["value"]
    if not limit["stable"] or not value:
        return 0.0
    down = value / limit["low"] if limit["low"] else inf
    up = limit["high"] / value if limit["high"] else inf
    nearest = min(abs(down), abs(up))
    return 1 - 1 / max(nearest, 1.0)
