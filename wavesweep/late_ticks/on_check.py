"""What `check` finds of ticks that are late: whether the spec's own loop is stable for all of
their lengths in any order."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec


def facts(spec: Spec, *_: object) -> dict[str, Any]:
    """tick: of a spec with [for_all] tick, what is known of it; claims: the same."""
    if not spec.tick:
        return {}
    from wavesweep.late_ticks.rows import claim

    claimed = claim(spec)
    return {
        "tick": {"status": claimed.status.name.lower(), "counterexample": claimed.reason},
        "claims": [claimed],
    }
