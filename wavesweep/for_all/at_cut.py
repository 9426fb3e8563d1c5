"""What [sweep] requires of all loops of [for_all]: margins, whose factors at a cut are numbers that
are not known. So a refuter is a member with a factor."""

from collections.abc import Iterator, Mapping, Sequence

from wavesweep.engine.loop import Loops
from wavesweep.program.analyses.factors_at_cut import PATH, with_factors
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.tables import TableValue

__all__ = ["PATH", "of_required", "refused"]


def refused(require: TableValue, *, vary: bool) -> str:
    """Why a requirement cannot be held for all of [for_all], empty if it can; vary: whether frames
    or messages do."""
    others = [name for name in require.written() if name != "margins"]
    if others:
        return f"expected margins alone beside [for_all], found {', '.join(others)}"
    if vary:
        return "expected constant numbers in [for_all] beside margins, found frames or messages that vary"
    return ""


def of_required(
    loops: Loops,
    require: TableValue | None,
    ranges: Sequence[Axis],
    along: Mapping[str, Sequence[float]],
) -> Iterator[tuple[Loops, list[Axis]]]:
    """Yield the loops and the ranges of each margin that is required, see `with_factors`; without
    any the loops themselves. along: path -> ends of a number of intervals."""
    if not require:
        yield loops, [*ranges]
        return
    varied = {axis.path: (axis.start, axis.stop) for axis in ranges} | {**along}
    for asked in require.cuts:
        for with_factor, factors in with_factors(loops, asked, varied):
            yield with_factor, [*ranges, *factors]
