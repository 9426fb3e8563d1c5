"""The rows of intervals that hold for fast ticks of all lengths, in whatever order
these come; their words are those of [for_all]."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.sweep.job import Job


def of_run(job: Job, guarantees: Iterable[Guarantee]) -> Iterable[Guarantee]:
    """The guarantees of a run: that of late ticks after those that come before.

    Errors: UsageError for hands, requirements, or a number, beside which it cannot be had.
    """
    spec = job.grid.spec
    intervals = job.asked  # along what number, and of what requirement
    if not spec.tick:
        return guarantees
    from wavesweep.engine.errors import UsageError
    from wavesweep.late_ticks.rows import LateTicksGuarantee, refuse

    if hands := [guarantee.word for guarantee in guarantees if guarantee.word]:
        expected = "no --for-hands, since its rows are of the spec's own hand"
        raise UsageError(f"[for_all] tick: expected {expected}, found {', '.join(hands)}")
    if intervals.require:
        expected = "no requirement, since its rows are about stability alone"
        raise UsageError(f"[for_all] tick: expected {expected}, found require")
    refuse(spec, intervals.axis.path)
    return [*guarantees, LateTicksGuarantee(spec.tick.interval(spec.tick_hz))]
