"""The rows of stable intervals with passive hands, a passive port, two of them, or a passive
channel."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from wavesweep.program.row_kinds import RowKind

if TYPE_CHECKING:
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.sweep.job import Job

ROWS = {
    "passive": RowKind(
        "every passive hand, of any mass and stiffness, also if it moves within a tick",
        "every passive hand",
        "#009E73",
        3,
    ),
    "port": RowKind(
        "the hand's port is passive, if forces are held over a tick", "passive port", "#CC79A7", 5
    ),
    "ports": RowKind(
        "every pair of linear passive terminations at both ports, if forces are held over a tick",
        "absolutely stable",
        "#000000",
        4,
    ),
    "channel": RowKind(
        "the wave channel adds at most the tolerance of the run to its waves",
        "passive wave channel",
        "#E69F00",
        4,
    ),
}
HANDS = {
    "passive": "stable with every passive hand, of any mass and stiffness, also if it moves within a tick",
    "port": "the hand's port is passive if forces are held over a tick",
}


def of_word(kind: str, tolerance: str | None) -> Guarantee | None:
    """The guarantee for a word of --for-hands, None for a word of others; see
    `program.tables.hand_rows`."""
    from wavesweep.passive.hands import PassiveGuarantee

    if kind not in ROWS or (tolerance is not None and kind != "channel"):
        return None
    return PassiveGuarantee(kind, float(tolerance or 0))


def of_run(own: Job, asked: Iterable[Guarantee]) -> Iterable[Guarantee]:
    """The guarantees of a run; see `hand_rows.guarantees_of`. Errors: UsageError for loops that
    hands cannot hold."""
    from wavesweep.program.tables.hand_rows import refuse_velocity

    if any(guarantee.kind == "passive" for guarantee in asked):
        refuse_velocity(own)
    return asked
