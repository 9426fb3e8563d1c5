"""The section of a report on what sets the limits."""

from collections.abc import Callable, Iterator

from wavesweep.program.spec import Spec
from wavesweep.program.tables.table import Table

TITLE, PLACE = "What sets the limits", 1


def sections(spec: Spec, _: str) -> Iterator[tuple[str, str, Callable[[], Table]]]:
    """Yield the title, the command of the table `why`, with {} for the spec, and what makes the
    table."""
    from wavesweep.sensitivity.table import why

    yield TITLE, "why {}", lambda: why(spec)
