"""Intervals along a number of the wall that hold for every wall that pushes and never pulls."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.contact.motions import motion_beyond
from wavesweep.contact.rows_in_frames import Along, along_of, fit_frames
from wavesweep.contact.stretches import TRIED_NEAR_END, Line
from wavesweep.contact.wall_loop import WallLoop, WallsAlong
from wavesweep.engine.doubts import Doubt
from wavesweep.engine.drawing import name_of, path_of
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import LinearFractional, open_loops
from wavesweep.engine.intervals import blank_records
from wavesweep.engine.loop import Loops
from wavesweep.haptics.felt import felt_along
from wavesweep.program.analyses.claims import (
    AT_REST,
    PUSHES,
    SETTLED_WITHIN,
    Property,
    Scope,
    Status,
    own_scope,
)
from wavesweep.program.analyses.interval_jobs import PROVED_RECORD, Guarantee, records_of_loop
from wavesweep.program.number_words import span_around
from wavesweep.program.row_kinds import TEXT
from wavesweep.program.spec import Spec
from wavesweep.program.sweep.grid import loops_of
from wavesweep.program.tables.refuters import LINEAR_WALL, Refuters

LINEAR = f"{LINEAR_WALL}, in contact all the time"
NOWHERE = f"{LINEAR}, is stable at none"
BY_MULTIPLIERS = (
    "multipliers of Zames and Falb, by linear programmes, proved by sums of squares "
    "with bounds on all errors; refuted by a wall and a motion that repeats"
)
IN_FRAMES = (
    "quadratic forms on a graph of frames, with what the wall stores, which fall in all frames, proved by Cholesky with "
    "bounds on all errors; refuted by a pattern of frames, or a wall and a motion that repeats in frames of one length"
)


@dataclass(frozen=True, slots=True)
class ContactGuarantee(Guarantee):
    """Every wall that pushes and never pulls, as `IntervalQuery.guarantee`; rules: of frames that
    vary, and of values of numbers, or None for a spec without these."""

    rules: Any = None
    kind = "contact"
    status = Status.PROVED

    @property
    def method(self) -> str:
        """How the intervals are found, in a line."""
        return IN_FRAMES if self.rules else BY_MULTIPLIERS

    @property
    def what(self) -> Property:
        """What its rows say of their loops."""
        return AT_REST

    def scope(self, spec: Spec) -> Scope:
        """The loops that its rows are of, with every wall."""
        return replace(scope_of(spec, self.rules), walls=PUSHES)

    def records_of(self, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop."""
        if self.rules:
            return records_in_frames(self.rules, loop, along, span)
        return records_through_contact(loop, along, span)

    def felt(self, loop: Loops, along: str, values: np.ndarray) -> np.ndarray:
        """The least of all loops of the rules, with the stiffest wall of the class."""
        if self.rules:
            return offered("rules").felt_for_all(self.rules, loop, along, values)
        return felt_along(loop, along, values)


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
    rules = rules_of(spec)
    own = loops_of(spec, dict(spec.values), along)
    constant = [loop for _, loop in constant_members(rules, own, along)] if rules else [own]
    found = ""
    if not constant:
        try:
            fit_frames(rules, dict(spec.values), list(spec.wall))
        except offered("rules").UnfitWallError as error:
            found = f"{error}; --set for_all.contact=false leaves contact out"
    elif any(wall_cut(loop) is None for loop in constant):
        found = (
            "one that acts several times in it, as where rates do not divide; leave contact out, or ask for frames in any "
            "order, such as rates.ratio = 17 and [for_all] rates.ratio = [16, 17] for 60 Hz under 1 kHz"
        )
    if found:
        expected = "a wall whose force is computed once a frame, and one position that drifts without it at most"
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
    return _recorded(*_rows_of(loop, along, span), span, along)


def _rows_of(loop: Loops, along: str, span: tuple[float, float]) -> tuple[list[Row], str]:
    """The rows of one loop, and why there are none if that is known."""
    wall = [path_of(name) for name in loop.drawing.wall]
    index = wall.index(along)
    fixed = float(loop.values[wall[1 - index]]) if len(wall) > 1 else 0.0
    cut = wall_cut(loop)
    whole = WallLoop.of(cut) if cut else None
    if whole is None:
        return [], ""
    if whole.unstable:  # as it is for the wall that is never touched
        return [], whole.without_wall
    # As an array the other number of the wall is taken out of the loop as well.
    beside = {path: np.array([loop.values[path]]) for path in wall if path != along}
    linear = records_of_loop(loop.changed(beside), along, span)
    line = Line.of(WallsAlong(whole, index, fixed))
    rows = []
    for own in linear[linear["intervals"] > 0]:
        row = _row(line, [float(own["low"]), float(own["high"])], span)
        if row:
            rows.append(row)
    nowhere = not linear["intervals"].any() and linear["certified"].all()
    return rows, NOWHERE if nowhere else ""


def rules_of(spec: Spec) -> Any:
    """The rules of frames that vary, and of values of numbers; None without [for_all]."""
    if spec.for_all:
        return offered("rules").Rules.of(spec)
    return None


def constant_members(rules: Any, loop: Loops, along: str = "") -> list[tuple[str, Loops]]:
    """The loops of a spec of which nothing varies, with numbers in lists: each is one frame for ever.
    None of them where frames vary or a number has a range.

    Each comes with its numbers of lists in words.
    """
    if rules.vary:
        return []
    asked = offered("rules")
    cases = asked.cases_of(rules, along, (0.0, 0.0), loop)
    if any(case.ranges for case in cases):
        return []
    return [
        (asked.numbers_in_words(case.fixed), Loops(case.loop.drawing, dict(case.values)))
        for case in cases
    ]


def of_member(member: str, refuter: str) -> str:
    """What refutes a member, behind its numbers of lists; empty if nothing does."""
    if member and refuter:
        return f"{member}, {refuter}"
    return refuter


def scope_of(spec: Spec, rules: Any) -> Scope:
    """The loops that a proof by some rules is about, with the linear wall; rules: None for the
    spec's own numbers and frames."""
    if not rules:
        return own_scope(spec)
    asked = offered("rules")
    own = loops_of(spec, dict(spec.values))
    return asked.scope_of(spec, rules, asked.cases_of(rules, "", (0.0, 0.0), own))


def records_in_frames(rules: Any, loop: Loops, along: str, span: tuple[float, float]) -> np.ndarray:
    """`records_through_contact` for all frames, and all values of numbers, of some rules."""
    rows = []
    for member, each in constant_members(rules, loop, along):
        own, why = _rows_of(each, along, span)
        if not own:
            return _recorded([], of_member(member, why), span)
        widest = max(own, key=lambda row: row.high - row.low)
        beyond = of_member(member, widest.refuters.high)
        rows.append(widest._replace(refuters=widest.refuters._replace(high=beyond)))
    for case in [] if rows else offered("rules").cases_of(rules, along, span, loop):
        walls = along_of(rules, dict(case.values), [*loop.drawing.wall], along)
        if walls is None:
            return _recorded([], "", span)
        member = offered("rules").numbers_in_words(case.fixed)
        if walls.loop.unstable:
            return _recorded([], of_member(member, walls.loop.unstable), span)
        row = _row_in_frames(walls, span)
        if row is None:
            return _recorded([], "", span)
        beyond = of_member(member, row.refuters.high)
        rows.append(row._replace(refuters=Refuters("", beyond)))
    low = max(rows, key=lambda row: row.low)
    high = min(rows, key=lambda row: row.high)
    if low.low >= high.high:
        return _recorded([], "", span)
    if rules.vary:
        rows += _linear(rules, loop, along, span, high.high)
    refuted = [row for row in rows if row.fails_from > high.high]
    beyond = min(refuted, key=lambda row: row.fails_from, default=high)
    text = beyond.refuters.high
    common = Row(low.low, high.high, np.nan, beyond.fails_from, Refuters("", text))
    return _recorded([common], "", span, along)


def _linear(rules, loop, along, span, high) -> list[Row]:
    """What refutes the linear wall, which is one of those that push: it is that of its own rows."""
    found = []
    for row in offered("rules").rows_of(rules, loop, along, span):
        if row.part.high_by is not None and row.low < high:
            said = f"{LINEAR_WALL}, {Refuters.read(row.text).high}"
            found.append(Row(row.low, row.high, np.nan, row.part.high, Refuters("", said)))
    return found


def _row_in_frames(walls: Along, span) -> Row | None:
    """What is proved of one case; None if nothing is."""
    pieces = walls.proved(*span)
    if not pieces:
        return None
    low, high = walls.value(pieces[-1].walls[-1]), walls.value(pieces[0].walls[0])
    beyond, text = walls.motion(high, span[1])
    return Row(low, high, np.nan, beyond, Refuters("", text))


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
    if linear_end == border:
        return (np.nan, "")
    return (linear_end, LINEAR)


def _recorded(rows: list[Row], why: str, span: tuple[float, float], along="") -> np.ndarray:
    """The rows as records of PROVED_RECORD; why: there are none, if that is known."""
    ends = (np.array([getattr(row, end) for row in rows]) for end in ("low", "high"))
    records = blank_records(*ends, PROVED_RECORD)
    known = bool(rows or why)
    records["certified"] = known
    records["doubt"] = Doubt.NONE if known else Doubt.SEARCH
    records["settled"] = not rows and known
    if not rows:
        records["counterexample"] = why
    for number, row in enumerate(rows):
        records["fails_below"][number] = row.fails_below
        records["fails_from"][number] = row.fails_from
        records["counterexample"][number] = row.refuters.written(TEXT)
        places = _open_places(row, span)
        records["settled"][number] = not places
        if places:
            records["left_open"][number] = f"within {name_of(along)} {' and '.join(places)}"
    return records


def _open_places(row, span):
    """Where nothing is known, between each end and what is refuted next to it, or the end of the
    range."""
    below = span[0] if np.isnan(row.fails_below) else row.fails_below
    beyond = span[1] if np.isnan(row.fails_from) else row.fails_from
    least = SETTLED_WITHIN * max(abs(row.high), abs(row.low))
    places = [(below, row.low), (row.high, beyond)]
    return [span_around(low, high, 4) for low, high in places if high - low > least]
