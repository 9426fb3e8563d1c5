"""The rows of intervals that hold for every wall that pushes and never pulls."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from wavesweep.program.row_kinds import OPEN_BETWEEN, RowKind

if TYPE_CHECKING:
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.sweep.job import Job

ROWS = {
    "contact": RowKind(
        "every wall that pushes and never pulls, softens or saturates",
        "proved through contact",
        "#CC79A7",
        1,
        "guarantee",
        OPEN_BETWEEN,
    )
}


def of_run(own: Job, asked: Iterable[Guarantee]) -> Iterable[Guarantee]:
    """The guarantees of a run: that of contact after those that come before.

    Errors: UsageError for hands, requirements, or a number, beside which it cannot be had.
    """
    spec = own.grid.spec
    if not spec.contact:
        return asked
    from wavesweep.contact.rows import ContactGuarantee, refuse, rules_of
    from wavesweep.contact.verdict import saturations
    from wavesweep.engine.errors import UsageError

    if not spec.wall and saturations(
        spec.drawing
    ):  # of these `check` has a verdict, and there are no rows
        return asked
    if hands := [each.word for each in asked if each.word]:
        expected = "no --for-hands, since its rows are of the spec's own hand"
        raise UsageError(f"[for_all] contact: expected {expected}, found {', '.join(hands)}")
    spec.refuse_require("[for_all] contact")
    refuse(spec, own.asked.axis.path)
    return [*asked, ContactGuarantee(rules_of(spec))]
