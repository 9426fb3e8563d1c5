"""The rows of stable intervals that hold for all numbers of [for_all], and for all hands of a
box."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

from wavesweep.program.row_kinds import OPEN_BETWEEN, RowKind

if TYPE_CHECKING:
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.sweep.job import Job

ROWS = {
    "box": RowKind(
        "every hand between a fingertip and an arm, or in the ranges that --for-hands box:... gives",
        "hands of the box",
        "#D55E00",
        2,
        unsettled="{rows} of the box not certified (settled 0): a hand that the search missed may be unstable",
    ),
    "for_all": RowKind(
        "all numbers of [for_all], or all patterns of late and lost messages",
        "proved for all",
        "#D55E00",
        2,
        "guarantee",
        OPEN_BETWEEN,
    ),
    "mean_square": RowKind(
        "messages lost at random, or frames at random",
        "proved in mean square",
        "#009E73",
        3,
        "guarantee",
        OPEN_BETWEEN,
    ),
}
HANDS = {
    "box": "stable with every hand between a fingertip and an arm, or with ranges of your own, e.g. "
    "box:mass=0.1..0.4,damping=2..5 (kg, N*s/m; stiffness in N/m); what is left out keeps its range"
}


def of_word(kind: str, ranges: str | None) -> Guarantee | None:
    """The guarantee for a word of --for-hands, None for a word of others; see
    `program.tables.hand_rows`."""
    from wavesweep.for_all.hand_box import box_in_words

    if kind == "box":
        return box_in_words(ranges)
    return None


def of_run(job: Job, guarantees: Iterable[Guarantee]) -> Iterable[Guarantee]:
    """The guarantees of a run of a spec's own job, from those asked for by words: see
    `program.tables.hand_rows.guarantees_of`.

    Errors: UsageError for numbers, hands, or a requirement, that [for_all] cannot be held for
    beside.
    """
    from wavesweep.engine.errors import UsageError
    from wavesweep.program.tables.hand_rows import device_held, refuse_velocity

    spec, along, kinds = (
        job.grid.spec,
        job.asked.axis.path,
        [guarantee.kind for guarantee in guarantees],
    )
    if not spec.for_all:
        if "box" in kinds:
            device_held("box", job)
        return guarantees
    from wavesweep.for_all import every_hand
    from wavesweep.for_all.at_cut import PATH, refused
    from wavesweep.for_all.rows import ForAllGuarantee, own_cases, refuse_unsuitable_ranges
    from wavesweep.for_all.varying import Rules

    rules = Rules.of(spec)
    if kinds and rules.messages:
        raise UsageError(
            f"hands ({', '.join(kinds)}): expected messages in time, as with late = 0 and lost = 0 of each channel, found some that "
            "may be late or lost"
        )

    def refuse_every_hand():
        refuse_unsuitable_ranges(spec, along, cut=False)
        refuse_velocity(job)
        every_hand.refuse(spec, rules, along)

    if kinds not in ([], ["passive"]):
        hint = ""
        with suppress(UsageError):  # of what refuses every passive hand as well
            refuse_every_hand()
            hint = "; for all of it one proof covers every passive hand: `wavesweep stability-region SPEC --for-hands passive`"
        raise UsageError(f"hands ({', '.join(kinds)}): expected no [for_all], found one{hint}")
    if kinds:
        refuse_every_hand()
        return [every_hand.EveryHandGuarantee(rules)]
    random = rules.on_average()
    if job.asked.require:
        at_random = bool(rules.at_random or random)
        if refusal := refused(job.asked.require, rules, at_random=at_random):
            raise UsageError(f"{PATH}: {refusal}")
        if random:  # in any order stability alone is asked
            random = replace(random, require=job.asked.require)
        else:
            rules = replace(rules, require=job.asked.require)
    refuse_unsuitable_ranges(spec, along)
    own_cases(rules, spec)
    swept = {axis.path for axis in job.grid.axes}
    if wrong := [axis.name for axis in spec.for_all.axes if axis.path in swept]:
        raise UsageError(
            f"{', '.join(wrong)}: expected a number that [for_all] does not have as well"
        )
    return [ForAllGuarantee(guarantee) for guarantee in (rules, random) if guarantee]
