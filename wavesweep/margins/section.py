"""The section of a report on margins."""

from collections.abc import Callable, Iterator
from functools import partial
from shlex import quote

from wavesweep.program.spec import Spec
from wavesweep.program.tables.table import Table

TITLE, PLACE = "Margins", 2


def sections(spec: Spec, cut: str) -> Iterator[tuple[str, str, Callable[[], Table]]]:
    """Yield for each signal at which the spec asks for margins the title, the command of the table,
    with {} for the spec, and what makes it.

    cut: another signal in their place. Errors: UsageError for one at which the loop is not cut.
    """
    from wavesweep.margins.broken_loops import asked_cuts, broken_at, default_cut
    from wavesweep.margins.table import margins

    if cut:
        broken_at(spec, cut)
    cuts = [cut] if cut else asked_cuts(spec) or [default_cut(spec)]
    for signal in cuts:
        title = TITLE if len(cuts) == 1 else f"{TITLE} at {signal}"
        yield title, f"margins {{}} --cut {quote(signal)}", partial(margins, spec, signal)
