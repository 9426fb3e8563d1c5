"""The section of a report on margins."""

from collections.abc import Callable
from shlex import quote

from wavesweep.program.spec import Spec
from wavesweep.program.tables.table import Table

TITLE, PLACE = "Margins", 2


def section(spec: Spec, cut: str) -> tuple[str, Callable[[], Table]]:
    """The command of the table, with {} for the spec, and what makes it; cut: by default that
    of the spec, see `default_cut`."""
    from wavesweep.margins.broken_loops import default_cut
    from wavesweep.margins.table import margins

    cut = cut or default_cut(spec)
    return f"margins {{}} --cut {quote(cut)}", lambda: margins(spec, cut)
