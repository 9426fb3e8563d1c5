"""Records of intervals, what the hand feels at their ends, and the lines that a spectrum shows there."""

import traceback
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from wavesweep.engine.errors import IllPosedLoopError
from wavesweep.engine.loops.batch import Loops
from wavesweep.engine.loops.dead_time import pieces_of
from wavesweep.engine.loops.from_drawing import FACTOR, PRODUCT, scalar_place, seen_by_hand
from wavesweep.engine.loops.ports import feels, hand_of
from wavesweep.engine.rows import different
from wavesweep.engine.search.lines_of_loops import lines_in_loops, strongest_in_cut
from wavesweep.engine.search.open_loops import Opened, by_zeros
from wavesweep.engine.stability.certificate import SEARCH
from wavesweep.engine.stability.intervals import Intervals, in_rows
from wavesweep.engine.stability.radii import watched_drift

if TYPE_CHECKING:
    from wavesweep.engine.response.resting import DcGain
    from wavesweep.engine.search.interval_search import Search

FIELDS = (
    ("slice", "<i4"),
    ("intervals", "<i4"),
    ("interval", "<i4"),
    ("low", "<f8"),
    ("high", "<f8"),
    ("low_omega", "<f8"),
    ("high_omega", "<f8"),
    ("certified", "?"),
    ("residual", "<f8"),
    ("doubt", "i1"),
)
FELT = ("felt_low", "felt_high")
LINES = ("low_hz", "high_hz")
OPEN = (("open_places", "<i4"), ("open_low", "<f8"), ("open_high", "<f8"))
RECORD = np.dtype([*FIELDS, *((name, "<f8") for name in (*FELT, *LINES)), *OPEN])

FAILURES = (ArithmeticError, np.linalg.LinAlgError, IndexError)  # what numerics raise where they have no answer


def records_of(found: Intervals) -> np.ndarray:
    """The intervals as records, sorted by slice (numbered from 0 in the chunk); see `in_rows`."""
    found, open_ = in_rows(found)
    records = np.zeros(found.column.size, RECORD)
    records["slice"] = found.column
    records["intervals"], records["interval"] = found.count, np.maximum(found.index, 0)
    for name in ("low", "high", "low_omega", "high_omega", "certified", "residual", "doubt"):
        records[name] = getattr(found, name)
    for name, _ in OPEN:
        records[name] = getattr(open_, name.removeprefix("open_"))
    return records


def ends_of(records: np.ndarray, *, set_by: bool) -> Mapping[str, np.ndarray]:
    """The omegas of records as columns and, if `set_by`, what sets each end: a mode, or a gain."""
    omegas = {end: records[f"{end}_omega"] for end in ("low", "high")}
    found = {f"{end}_omega": np.abs(omega) for end, omega in omegas.items()}
    words = {end: np.where(np.signbit(omega), "gain", "mode").astype(object) for end, omega in omegas.items()}
    more = {f"{end}_set_by": np.where(np.isnan(omega), "", words[end]) for end, omega in omegas.items()}
    return found | (more if set_by else {})


def blank_records(low: np.ndarray, high: np.ndarray, dtype: np.dtype) -> np.ndarray:
    """Records of slice 0 with these ends, or the one record of a slice without intervals; other numbers are missing."""
    records = np.zeros(max(low.size, 1), dtype)
    records["doubt"] = SEARCH
    for name in dtype.names:
        if dtype[name].kind == "f":
            records[name] = np.nan
    records["intervals"] = low.size
    if low.size:
        records["interval"], records["low"], records["high"] = np.arange(low.size), low, high
    return records


def unanswered(dtype: np.dtype, number: int, span: tuple[float, float], error: Exception) -> np.ndarray:
    """The record of a slice whose search failed in arithmetic: nothing is known from one end of the range to the other.

    Where it failed is a warning, which --debug shows.
    """
    warnings.warn("".join(traceback.format_exception(error)), RuntimeWarning, stacklevel=2)
    record = blank_records(np.zeros(0), np.zeros(0), dtype)
    record["slice"] = number
    record["open_places"], record["open_low"], record["open_high"] = 1, *span
    return record


def open_places(columns: Mapping[str, np.ndarray], row: int) -> dict[str, float] | None:
    """The open places of a row: how many, where the first begins, where the last ends; None without."""
    if not columns["open_places"][row]:
        return None
    ends = {side: float(columns[f"open_{end}"][row]) for side, end in (("from", "low"), ("to", "high"))}
    return {"places": int(columns["open_places"][row]), **ends}


BATCH = 256  # modes that are followed through their frames at once
TINY = 1e-300  # in place of a zero, which would take a state out of the loop
BESIDE = 1e-4  # of an end, how far from it is looked where a mode has the frame's own period there
AGREED = 1e-3  # relative difference of two such looks, beyond which nothing is felt that is the same on both sides


def felt_at_ends(records: np.ndarray, rows: np.ndarray, stiffness: Callable) -> None:
    """Fill in the stiffness felt at both ends of these rows, along a number that is no wall.

    stiffness(some, p): that of the loops of the rows `some`, at these values of the number. A 0 takes a branch out of the loop,
    so ends at 0 are computed apart. At a crossing of z = 1 a frame does not determine the state at rest, since a mode that
    alternates from tick to tick repeats in it; the stiffness is smooth there, and follows from both sides.
    """
    p, omega = (
        np.concatenate([records[name][rows] for name in names]) for names in (("low", "high"), ("low_omega", "high_omega"))
    )
    own, found = np.tile(np.arange(rows.size), 2), np.empty(p.size)
    with np.errstate(all="ignore"):
        for some in (np.flatnonzero(p == 0), np.flatnonzero(p != 0)):
            if some.size:
                found[some] = stiffness(own[some], p[some])
        at = np.flatnonzero((omega == 0) & (p != 0))
        if at.size:
            sides = np.multiply.outer([1 - BESIDE, 1 + BESIDE, 1 - 2 * BESIDE, 1 + 2 * BESIDE], p[at])
            beside = stiffness(np.tile(own[at], 4), sides.ravel()).reshape(4, -1)
            near, far = beside[0] + beside[1], beside[2] + beside[3]
            found[at] = np.where(np.abs(near - far) <= AGREED * np.abs(near), (4 * near - far) / 6, np.nan)
    for name, part in zip(FELT, np.split(found, 2), strict=True):
        records[name][rows] = part


def fill_in_felt(search: "Search", records: np.ndarray, members: np.ndarray, loops: Loops, opened: Opened | None) -> None:
    """Fill in the stiffness felt at both ends of the intervals of the loops `members`; opened: these without the number."""
    rows = np.flatnonzero(records["intervals"] > 0)
    rows = rows[_among(search, records["slice"][rows], members)]
    at = np.searchsorted(members, records["slice"][rows])
    known = opened if opened and opened.loops.at_rest else _resting(search, loops)
    if known is not None:
        ends, twice = np.concatenate([records[end][rows] for end in ("low", "high")]), np.tile(at, 2)
        both = known.stiffness(twice, ends)
        if known is opened and opened.loops.beside:
            unknown = np.flatnonzero(np.isnan(both) & ~np.isnan(ends))
            of = different(twice[unknown])
            for columns in (of[part] for part in by_zeros(loops, of)) if unknown.size else ():
                alone = Opened.of_each(loops.some(columns), search.number, columns.size, felt=True)
                some = unknown[np.isin(twice[unknown], columns)]
                if alone and alone.loops.at_rest:
                    both[some] = alone.stiffness(np.searchsorted(columns, twice[some]), ends[some])
        for name, part in zip(FELT, np.split(both, 2), strict=True):
            records[name][rows] = part
        unknown = np.flatnonzero(np.isnan([records[name][rows] for name in FELT]).any(0))
        rows, at = rows[unknown], at[unknown]

    def stiffness(some, p):
        found, columns, varied = np.empty(p.size), at[some], _buildable(search, loops)
        for part in np.arange(p.size)[:, None] if search.in_pieces else by_zeros(loops, columns):
            found[part] = felt_along(varied.some(columns[part]), search.along, p[part])
        return found

    if rows.size:
        felt_at_ends(records, rows, stiffness)


def _among(search, slices, members):
    """Which slices are those of some members of a search."""
    every = members.size == sum(part.size for part, _ in search.groups)
    return np.ones(slices.shape, bool) if every else np.isin(slices, members)


def _buildable(search, loops):
    """The loops at any value of the number: without the whole numbers of ticks of dead times, which follow from it."""
    building = loops.drawing.building if search.in_pieces else ()
    return Loops(loops.drawing, {path: v for path, v in loops.values.items() if path not in building})


def _resting(search, loops) -> "DcGain | None":
    """The loops at rest, if the number is one scalar gain of them."""
    if not scalar_place(loops.drawing, search.number) or seen_by_hand(loops.drawing, search.number):
        return None
    with suppress(IllPosedLoopError):
        drift = watched_drift(loops.changed({search.along: np.array(search.span)}))
        if not (drift.constant or drift.varying):
            from wavesweep.engine.response.resting import tick_dcgain

            one = loops.changed({search.along: 1.0})
            return tick_dcgain(one.drawn(search.number), hand_of(loops.drawing), PRODUCT, FACTOR)
    return None


def fill_in_lines(search: "Search", records: np.ndarray, members: np.ndarray, loops: Loops, opened: Opened | None) -> None:
    """Fill in the strongest line (Hz) of the oscillation that starts at each end, of the loops `members`.

    Ends that a gain sets have an omega with a minus, and no mode that starts.
    """
    few, bound = 1 if search.in_pieces else BATCH, search.bound
    ends, omegas = (np.stack([records[name] for name in pair]) for pair in (("low", "high"), ("low_omega", "high_omega")))
    end, rows = np.nonzero(~np.isnan(omegas) & ~np.signbit(omegas) & _among(search, records["slice"], members))
    p, omega = ends[end, rows], omegas[end, rows]
    at, found = np.searchsorted(members, records["slice"][rows]), omega / (2 * np.pi)
    if opened and opened.loops.cut and (bound is None or bound.on_circle):
        found = strongest_in_cut(loops.drawing, opened, at, omega, bound)
    else:
        for part in (slice(first, first + few) for first in range(0, rows.size, few)):
            varied = _buildable(search, loops).some(at[part])
            varied = varied.changed({search.along: np.where(p[part] == 0, TINY, p[part])})
            with suppress(IllPosedLoopError):
                drawn = varied.drawn()
                period = np.broadcast_to(np.asarray(drawn.period * drawn.ticks, float), p[part].shape)
                if drawn.ticks > 1:
                    s = bound.logarithms(period, omega[part]) if bound else 1j * (omega[part] * period)[:, None]
                    found[part] = lines_in_loops(varied, s)[:, 0]
    for name, own in zip(LINES, (end == 0, end == 1), strict=True):
        records[name][rows[own]] = found[own]


def felt_along(loops: Loops, along: str, p: np.ndarray) -> np.ndarray:
    """The stiffness (N/m) felt at rest in loops at values p of a number, `(n,)`."""
    from wavesweep.engine.response.at_hand import felt_of

    return felt_of(loops.changed({along: p}), p.size)


def loop_by_loop(parts, along: str, span: tuple[float, float], guarantee) -> np.ndarray:
    """Records of guaranteed intervals along a number, sorted by slice, with what the hand feels at their ends.

    parts: (members, loops) pairs. guarantee: it has `records_of` a loop. A loop whose search fails in arithmetic is in doubt
    everywhere.
    """
    found = {}
    for members, loops in parts:
        for place, number in enumerate(members.tolist()):
            loop = loops.one(place)
            try:
                pieces = pieces_of(*loop, along, span)
                records = [guarantee.records_of(loop.changed(whole), along, piece) for piece, whole in pieces]
                found[number] = records = _joined(records) if len(records) > 1 else records[0]
                if feels(loop.drawing) and records["intervals"][0]:
                    felt_at_ends(records, np.arange(records.size), lambda _, p, loop=loop: felt_along(loop, along, p))
            except FAILURES as error:
                found[number] = unanswered(guarantee.dtype, number, span, error)
            found[number]["slice"] = number
    return np.concatenate([found[number] for number in sorted(found)])


def _joined(pieces):
    """The records of pieces of a range, of which those that meet are one; none is known better than the piece known least."""
    rows = [row for piece in pieces for row in piece if row["intervals"]]
    joined = rows[:1]
    for row in rows[1:]:
        last = joined[-1]
        if row["low"] > last["high"]:
            joined.append(row)
            continue
        for name in row.dtype.names:
            if name.startswith("high") or name == "fails_from":
                last[name] = row[name]
            elif row.dtype[name].kind == "U":
                last[name] = "; ".join(dict.fromkeys(filter(None, (str(last[name]), str(row[name])))))
    every = np.concatenate(pieces)
    found = np.array(joined or every[:1])
    found["intervals"], found["interval"] = len(joined), np.arange(len(found))
    found["doubt"] = every["doubt"][np.argmin(every["certified"])]
    for name in found.dtype.names:
        if found.dtype[name].kind == "b":
            found[name] = every[name].all()
    return found
