"""Points next to the curves of a figure, which a capability offers in its module `marks`."""

from collections.abc import Iterable
from typing import Any

from wavesweep.capabilities import offered
from wavesweep.program.spec import Spec


def facts_of_marks(specs: Iterable[Spec], kind: str) -> dict[str, Any]:
    """What the points in the figure of a table of that kind are, as facts of the run. Errors:
    UsageError.

    They are stored with the table, so that `plot` draws the points of the run.
    """
    module = offered("marks")
    if module:
        return module.facts_of(specs, kind)
    return {}
