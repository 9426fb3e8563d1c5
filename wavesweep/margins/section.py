"""The section of a report on margins."""

from collections.abc import Callable
from shlex import quote

from wavesweep.program.spec import Spec
from wavesweep.program.tables.table import Table

TITLE, PLACE = "Margins", 2
KNOWN = "Certified, to a relative 1e-6 or better, unless a line says that it is not certified."


def section(spec: Spec, cut: str) -> tuple[str, Callable[[], Table]]:
    """The command of the table, with {} for the spec, and what makes it; cut: by default the
    signal that acts on the plant."""
    from wavesweep.margins.broken_loops import cuts_of
    from wavesweep.margins.table import margins

    cut = cut or next(iter(cuts_of(spec)), "")
    return f"margins {{}} --cut {quote(cut)}", lambda: margins(spec, cut)
