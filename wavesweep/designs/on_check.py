"""What `check` says of the work of `design`."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def plan(spec: Spec) -> list[str]:
    """The work of `design` and its time; none without [design]."""
    if spec.design is None:
        return []
    from wavesweep.designs.study import job_of, seconds_of
    from wavesweep.engine.errors import WavesweepError
    from wavesweep.program.sweep.estimates import duration
    from wavesweep.program.sweep.workers import choose

    try:
        job = job_of(spec)
        seconds = seconds_of(job)
    except WavesweepError as error:
        return [f"  design: not possible with this spec: {error}"]
    workers = choose(None, None, None, len(job.chunks), lambda: seconds)
    over = f"{len(job.asked.scenarios)} combination{'s' * (len(job.asked.scenarios) != 1)}"
    if workers.backend is None:
        who = "no workers"
    else:
        who = f"{workers.count} worker processes"
    return [
        f"  design: {job.slices} designs, each over {over} that it has to hold for; the front over {len(job.asked.finest)}",
        f"    work: about {duration(seconds / workers.count)}; {who} ({workers.why})",
    ]
