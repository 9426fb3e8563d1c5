"""Intervals along a number of the wall that hold for every wall that pushes and never pulls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from wavesweep.contact.motions import motion_beyond
from wavesweep.contact.stretches import TRIED_NEAR_END, Line
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import name_of, path_of
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import FIRST, SECOND, LinearFractional, open_loops
from wavesweep.engine.intervals import blank_records, record_type, stable_intervals
from wavesweep.engine.loop import Loops
from wavesweep.haptics.felt import FELT
from wavesweep.program.analyses.claims import AT_REST, PUSHES, Property, Scope, Status, own_scope
from wavesweep.program.analyses.interval_jobs import Guarantee
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import own_loop
from wavesweep.program.tables.refuters import Refuters

TEXT = 1000  # characters of a counterexample
SETTLED_WITHIN = 1e-2  # of an end, how far proof and refutation may be apart
LINEAR = "no loss of contact, the linear wall"
FREE = "no contact at all, the loop without a wall"
CONTACT_RECORD = record_type(
    *((name, "<f8") for name in (*FELT, "fails_below", "fails_from")),
    ("settled", "?"),
    ("counterexample", f"<U{TEXT}"),
)


@dataclass(frozen=True, slots=True)
class ContactGuarantee(Guarantee):
    """Every wall that pushes and never pulls, as `IntervalQuery.guarantee`."""

    kind = "contact"
    dtype = CONTACT_RECORD
    status = Status.PROVED
    method = (
        "multipliers of Zames and Falb, by linear programmes, checked on arcs of the unit circle "
        "with bounds on all errors; refuted by a wall and a motion that repeats"
    )

    @property
    def what(self) -> Property:
        """What its rows say of their loops."""
        return AT_REST

    def scope(self, spec: Spec) -> Scope:
        """The spec's own numbers and frames, with every wall."""
        return replace(own_scope(spec), walls=PUSHES)

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop."""
        return records_through_contact(loop, along, span)


class Row(NamedTuple):
    """What is proved, and the nearest values beyond that are refuted, NaN if none are known."""

    low: float
    high: float
    fails_below: float
    fails_from: float
    refuters: Refuters


def refuse(spec: Spec, along: str) -> None:
    """Raise UsageError if the spec has no wall that acts once a frame, or `along` is not of it."""
    if not spec.wall:
        expected = "wall = { stiffness = ..., damping = ... } in [ports], the numbers of a wall"
        raise UsageError(f"[for_all] contact: expected {expected}, found none")
    if along not in spec.wall:
        names = " or ".join(map(name_of, spec.wall))
        found = f"{name_of(along)}; --set for_all.contact=false leaves contact out"
        raise UsageError(f"[for_all] contact: expected intervals along {names}, found {found}")
    if wall_cut(own_loop(spec, along)) is None:
        expected = "a wall whose force is computed once a frame"
        found = "one that acts several times in it, as where rates do not divide"
        raise UsageError(f"[for_all] contact: expected {expected}, found {found}")


def wall_cut(loops: Loops) -> LinearFractional | None:
    """The loop cut at the numbers of its wall; None if the wall is not one scalar of a frame."""
    try:
        opened = open_loops(loops.read, *map(name_of, loops.drawing.wall))
    except IllPosedLoopError:
        return None
    return opened and opened.cut


def records_through_contact(loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
    """Intervals of a loop along a number of its wall within span = (low, high), as records.

    A row is what one chain of checked multipliers serves within an interval of the linear loop.
    """
    wall = [path_of(name) for name in loop.drawing.wall]
    index = wall.index(along)
    fixed = float(loop.values[wall[1 - index]]) if len(wall) > 1 else 0.0
    cut = wall_cut(loop)
    whole = WallLoop.of(cut) if cut else None
    if whole is None:
        return _recorded([], span, none=False)
    if whole.unstable:  # as it is for the wall that is never touched
        return _recorded([], span, none=True)
    linear = stable_intervals(cut.as_batch(1), (FIRST, SECOND)[index], span, np.array([[fixed]]))
    line = Line.of(WallsAlong(whole, index, fixed))
    ends = np.stack([linear.low, linear.high], axis=1)
    intervals = ends[linear.index >= 0].tolist()
    rows = [row for interval in intervals if (row := _row(line, interval, span))]
    nowhere = not intervals and bool((linear.doubt == Doubt.NONE).all())
    return _recorded(rows, span, none=nowhere)


def _row(line, interval, span) -> Row | None:
    """What is proved in an interval of the linear loop; None if nothing is."""
    room = TRIED_NEAR_END * (interval[1] - interval[0])
    low = interval[0] if interval[0] == span[0] else interval[0] + room
    high = interval[1] if interval[1] == span[1] else interval[1] - room
    stretch = line.stretch(low, high)
    if stretch is None:
        return None
    below, by_low = _refuted(line, stretch.low, *interval[:1], span[0])
    beyond, by_high = _refuted(line, stretch.high, *interval[1:], span[1])
    return Row(stretch.low, stretch.high, below, beyond, Refuters(by_low, by_high))


def _refuted(line, end, linear_end, border):
    """The nearest value beyond an end of a proof that is refuted, and by what; NaN and nothing."""
    motion = motion_beyond(line.walls, end, linear_end)
    if motion is not None:
        return motion.value, str(motion)
    return (np.nan, "") if linear_end == border else (linear_end, LINEAR)


def _recorded(rows: list[Row], span: tuple[float, float], *, none: bool) -> np.ndarray:
    """The rows as records of CONTACT_RECORD; none: whether it is known that there are none."""
    ends = (np.array([getattr(row, end) for row in rows]) for end in ("low", "high"))
    records = blank_records(*ends, CONTACT_RECORD)
    known = bool(rows) or none
    records["certified"], records["residual"] = known, 0.0
    records["doubt"] = Doubt.NONE if known else Doubt.SEARCH
    records["settled"] = none
    for number, row in enumerate(rows):
        records["fails_below"][number], records["fails_from"][number] = row[2:4]
        records["counterexample"][number] = row.refuters.written(TEXT)
        records["settled"][number] = _is_settled(row, span)
    return records


def _is_settled(row, span):
    """Whether each end is next to what is refuted, or to the end of the range."""
    below = row.low - (span[0] if np.isnan(row.fails_below) else row.fails_below)
    beyond = (span[1] if np.isnan(row.fails_from) else row.fails_from) - row.high
    return max(below, beyond) <= SETTLED_WITHIN * max(abs(row.high), abs(row.low))
