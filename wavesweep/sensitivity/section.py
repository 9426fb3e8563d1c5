"""The section of a report on what sets the limits."""

from collections.abc import Callable

from wavesweep.program.spec import Spec
from wavesweep.program.tables.table import Table

TITLE, PLACE = "What sets the limits", 1


def section(spec: Spec, _: str) -> tuple[str, Callable[[], Table]]:
    """The command of the table `why`, with {} for the spec, and what makes the table."""
    from wavesweep.sensitivity.table import why

    return "why {}", lambda: why(spec)
