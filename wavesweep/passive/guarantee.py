"""The rows of stable intervals with passive hands, a passive port, two of them, or a passive
channel."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from wavesweep.program.row_kinds import RowKind

if TYPE_CHECKING:
    from wavesweep.program.analyses.interval_jobs import Guarantee
    from wavesweep.program.sweep.job import Job

_EVERY = "stable with every passive hand"
_PORT = "hand's port passive, forces held over a tick"
ROWS = {
    "passive": RowKind(
        "every passive hand, of any mass and stiffness, also if it moves within a tick",
        _EVERY,
        "every passive hand",
        "#009E73",
        3,
        nowhere=f"nowhere {_EVERY}",
        checked=True,
    ),
    "port": RowKind(
        "the hand's port is passive, if forces are held over a tick",
        _PORT,
        "passive port",
        "#CC79A7",
        5,
        "passive",
        "nowhere passive",
        checked=True,
        of_operator=True,
    ),
    "ports": RowKind(
        "every pair of linear passive terminations at both ports, if forces are held over a tick",
        "absolutely stable at both ports",
        "absolutely stable",
        "#000000",
        4,
        "absolutely stable",
        "nowhere absolutely stable",
        checked=True,
    ),
    "channel": RowKind(
        "the wave channel adds at most the tolerance of the run to its waves",
        "wave channel passive to within the tolerance",
        "passive wave channel",
        "#E69F00",
        4,
        "passive",
        "nowhere passive",
        checked=True,
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
        refuse_velocity("passive", own)
    return asked
