"""Intervals that hold for all numbers of [for_all]: what is proved, and the nearest values beyond that are refuted."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from wavesweep.errors import UsageError
from wavesweep.loops.controllers import loop_drawing
from wavesweep.loops.domain import domain
from wavesweep.robust.boxes import Cover, cover
from wavesweep.spec import Spec
from wavesweep.spec.drawing import name_of
from wavesweep.spec.expressions import names_in
from wavesweep.spec.for_all import values_of_range
from wavesweep.stability.certificate import NONE, SEARCH
from wavesweep.sweep.drawn_loops import drift_of, radii_of
from wavesweep.sweep.drawn_task import TINY, DrawnTask, Parts, frames_where_solvable, loop_by_loop
from wavesweep.sweep.grid import distinct, drawing_for, own_loop, read_by
from wavesweep.sweep.tasks import FELT, FIELDS
from wavesweep.sweep.varying import Rules, bracketed, decided, text_of

MOST_CASES = 256  # combinations of numbers that have values in place of a range
MOST_UNKNOWN = 5  # ranges
SCATTERED = 24  # points of a box that are looked at beside its corners, its middle and the spec's own numbers
SHRINK = 12  # halvings of the steps of the search for the worst numbers
FRAMES = 400_000  # that a proof may take
MOST_UNSTABLE = 8  # points that a proof has met, at which it is looked again
ROUNDS = 4  # of a search after a proof has met an unstable loop
NEAR = 4e-3  # of an end that is refuted, how far from it a proof is tried
SETTLED = 1e-2  # of an end, how far proof and refutation may be apart
FROM_ZERO = 1e-3  # of the high end, from which on is proved what begins at 0, where a mode may stand still
TEXT = 160  # characters of a counterexample

FOR_ALL_RECORD = np.dtype(
    [
        *FIELDS,
        *((name, "<f8") for name in FELT),
        ("fails_below", "<f8"),
        ("fails_from", "<f8"),
        ("settled", "?"),
        ("counterexample", f"<U{TEXT}"),
    ]
)


@dataclass(frozen=True, slots=True)
class ForAllGuarantee:
    """The numbers of [for_all], as `IntervalJob.guarantee`."""

    rules: Rules
    dtype = FOR_ALL_RECORD
    kind = "for_all"

    @property
    def method(self) -> str:
        """How the intervals are found, in a line."""
        if self.rules.vary:
            return (
                "quadratic norms on a graph of frames, in which all shrink, checked by Cholesky with bounds on rounding; "
                "refuted by a pattern of frames that grows"
            )
        return (
            "guardian maps of all numbers at once, interpolated with a bound and proved positive by Bernstein coefficients; "
            "refuted by the exact intervals of the worst numbers found"
        )

    def task(self, along: str, span: tuple[float, float], parts: tuple) -> "ForAllTask":
        """The task for loops with these numbers."""
        return ForAllTask(self.rules, along, span, parts)


def refuse_unsuitable_ranges(spec: Spec, along: str) -> None:
    """Raise UsageError for numbers that cannot be held for beside intervals along a number, empty for a design alone."""
    for_all, rules, drawing = spec.for_all, Rules.of(spec), own_loop(spec, along)[0]
    swept = [axis.name for axis in for_all.axes if axis.path == along]
    ranges = [axis.name for axis in for_all.unknown if not axis.values and not axis.structural]
    trees = drawing.dead_times.values()
    timing = {name for tree in trees for name, _ in names_in(tree)} | (drawing.rating if trees else set())
    timed = [axis.name for axis in for_all.unknown if not axis.values and name_of(axis.path) in timing]
    cases = np.prod([len(values_of_range(axis)) for axis in for_all.unknown if axis.values or axis.structural], initial=1.0)
    for wrong, expected, found in (
        (
            rules.vary and ranges,
            "values of numbers beside such that vary from frame to frame",
            f"the range of {', '.join(ranges)}",
        ),
        (swept, "another number than that of the intervals", ", ".join(swept)),
        (len(ranges) > MOST_UNKNOWN, f"at most {MOST_UNKNOWN} ranges", f"{len(ranges)}"),
        (cases > MOST_CASES, f"at most {MOST_CASES} combinations of values", f"{cases:g}"),
        (timed, "values of a number that dead times follow from", f"the range of {', '.join(timed)}"),
    ):
        if wrong:
            raise UsageError(f"[for_all]: expected {expected}, found {found}")
    if rules.vary:
        rules.family(drawing, dict(spec.values), along or _number(spec))


def _number(spec: Spec) -> str:
    """A number along which the frames of a design alone are looked at: that of its intervals, or of its wall."""
    name = spec.along or "K_VE"
    return spec.names.find(name).path


@dataclass(frozen=True, slots=True, eq=False)
class ForAllTask:
    """Intervals for all numbers of [for_all] along the number `along` within span = (low, high), a loop at a time.

    parts: (members, drawing, values), see `drawn_groups`.
    """

    rules: Rules
    along: str
    span: tuple[float, float]
    parts: Parts

    def records(self) -> np.ndarray:
        """The intervals as records, sorted by slice."""
        return loop_by_loop(self.parts, self.along, self._of_loop)

    def _of_loop(self, drawing, values):
        loop = _Loop(self, drawing, values)
        return _recorded(*(loop.varying() if self.rules.vary else loop.intervals()))


@dataclass(frozen=True, slots=True)
class _Part:
    """An interval that no number which was looked at refutes, by which numbers each end is set, none at the range's, and the
    oscillation that starts there (rad/s)."""

    low: float
    high: float
    low_by: Mapping[str, float] | None = None
    high_by: Mapping[str, float] | None = None
    low_omega: float = np.nan
    high_omega: float = np.nan


@dataclass(frozen=True, slots=True)
class _Row:
    low: float
    high: float
    part: _Part
    settled: bool
    text: str


class _Loop:
    """One loop of a sweep with all numbers of [for_all]."""

    def __init__(self, task, drawing, values):
        self.task, self.drawing, self.values = task, drawing, values
        unknown = [axis for axis in task.rules.for_all.unknown if axis.path in drawing.reads or axis.path in values]
        self.ranges = [axis for axis in unknown if not (axis.values or axis.structural)]
        listed = [axis for axis in unknown if axis.values or axis.structural]
        self.cases = [
            dict(zip((axis.path for axis in listed), each, strict=True)) for each in product(*map(values_of_range, listed))
        ]

    def intervals(self) -> tuple[list[_Row], bool]:
        """The rows, and whether the search was certified."""
        seen = [_Case(self, each) for each in self.cases]
        parts = [_Part(*self.task.span)]
        for case in seen:
            parts = _shared(parts, case.parts())
        parts = [part for part in parts if part.high > part.low]
        rows = [row for part in parts if (row := self._proved(seen, part))]
        return rows, all(case.certified for case in seen)

    def varying(self) -> tuple[list[_Row], bool]:
        """The rows of loops whose frames vary, and whether the search was certified."""
        cases = [_Case(self, each) for each in self.cases]
        parts = [_Part(*self.task.span)]
        for case in cases:
            parts = _shared(parts, case.parts())
        rows = []
        for part in parts:
            own = [self._bracketed(case, (part.low, part.high)) for case in cases]
            if None not in own:
                rows.append(_all_of(own))
        return [row for row in rows if row and row.low < row.high], all(case.certified for case in cases)

    def _bracketed(self, case, about) -> _Row | None:
        family = self.task.rules.family(case.drawing, self.values | case.case, self.task.along)
        found = bracketed(family, self.task.span, about)
        if found is None:
            return None
        texts = [text_of(family, word) for word in found.words]
        part = _Part(
            found.fails_below if texts[0] else found.low,
            found.fails_from if texts[1] else found.high,
            *({**case.case, text: None} if text else None for text in texts),
        )
        return _Row(found.low, found.high, part, found.settled, _text(part))

    def _proved(self, cases, part) -> _Row | None:
        """What is proved of a part; None if nothing is, or if it falls apart."""
        if not self.ranges:  # the exact intervals of each case are its proof
            return _Row(part.low, part.high, part, True, _text(part))
        for _ in range(ROUNDS):
            low, high = self._within(part)
            if not low < high:
                return None
            covers = [(case, case.cover(low, high)) for case in cases]
            parts = [part]
            for case, found in covers:
                for point in found.unstable[:MOST_UNSTABLE]:
                    parts = _shared(parts, case.at(point[1:]))
            if parts == [part]:
                break
            part = max(parts, key=lambda each: each.high - each.low, default=_Part(0.0, 0.0))
        proved = _largest_free(low, high, [box[:, 0] for _, found in covers for box in found.open])
        if proved is None:
            return None
        near = [_near(proved[0], part.low) or (part.low_by is None and proved[0] == low), _near(proved[1], part.high)]
        return _Row(*proved, part, all(near), _text(part))

    def _within(self, part):
        """The interval that is tried to be proved: next to what is refuted, and from FROM_ZERO on if that is 0."""
        least = FROM_ZERO * (part.high - part.low)
        low = part.low if part.low_by is None else part.low + NEAR * max(abs(part.low), least)
        high = part.high if part.high_by is None else part.high - NEAR * max(abs(part.high), least)
        return (FROM_ZERO * high if low == 0 else low), high


def _near(one, other):
    return abs(one - other) <= SETTLED * max(abs(other), abs(one))


def _text(part):
    ends = [("below", part.low_by), ("from", part.high_by)]
    texts = [(end, _numbers(by)) for end, by in ends if by is not None]
    if len(texts) == 1:
        return texts[0][1][:TEXT]
    return "; ".join(f"{end}: {text}" for end, text in texts)[:TEXT]


def _numbers(by):
    return ", ".join(name_of(path) if value is None else f"{name_of(path)} = {value:.6g}" for path, value in by.items())


def _all_of(rows) -> _Row | None:
    """What several rows have in common, whose parts overlap; settled if those are that set its ends."""
    low, high = max(rows, key=lambda row: row.low), min(rows, key=lambda row: row.high)
    below, above = max(rows, key=lambda row: row.part.low).part, min(rows, key=lambda row: row.part.high).part
    part = _Part(below.low, above.high, below.low_by, above.high_by)
    near = [
        by is None or _near(*ends) for by, *ends in ((part.low_by, low.low, part.low), (part.high_by, high.high, part.high))
    ]
    return _Row(low.low, high.high, part, all(near) and all(row.settled for row in (low, high)), _text(part))


def _largest_free(low, high, spans):
    """The largest part of an interval that some spans leave free; None if none does."""
    edges, free, at = sorted((float(a), float(b)) for a, b in spans), [], low
    for a, b in edges:
        if a > at:
            free.append((at, a))
        at = max(at, b)
    if at < high:
        free.append((at, high))
    return max(free, key=lambda each: each[1] - each[0], default=None)


def _shared(parts, others):
    """The parts that two sets of intervals have in common, each end with the numbers that set it."""
    found = []
    for one in parts:
        for other in others:
            low = max(one, other, key=lambda each: each.low)
            high = min(one, other, key=lambda each: each.high)
            if low.low < high.high:
                found.append(_Part(low.low, high.high, low.low_by, high.high_by, low.low_omega, high.high_omega))
    return found


class _Case:
    """The loops of one combination of the numbers that have values; its box has the ranges of the others."""

    def __init__(self, loop: _Loop, case: Mapping[str, object]):
        self.along, self.span, self.case = loop.task.along, loop.task.span, dict(case)
        values = loop.values | case
        self.drawing = loop.drawing
        if "controller.kind" in values:
            self.drawing = loop_drawing(values, (self.along,))
        self.values = read_by(self.drawing, values)
        self.ranges = [axis for axis in loop.ranges if axis.path in self.drawing.reads]
        self.box = np.array([[axis.start for axis in self.ranges], [axis.stop for axis in self.ranges]], float)
        self.certified = True

    def parts(self) -> list[_Part]:
        """What none of the numbers that are looked at refutes; a search goes to the worst ones for each end."""
        points = self._points()
        parts = self._met([_Part(*self.span)], points)
        for _ in range(SHRINK if self.ranges else 0):
            ends = {tuple(self._place(by)) for part in parts for by in (part.low_by, part.high_by) if by is not None}
            step = (self.box[1] - self.box[0]) * 0.5 ** (_ + 1)
            near = np.array(
                [
                    np.clip(np.array(end) + sign * step * unit, *self.box)
                    for end in ends
                    for unit in np.eye(len(step))
                    for sign in (-1, 1)
                ]
            )
            if not len(near):
                break
            parts = self._met(parts, np.unique(near, axis=0))
        return parts

    def _points(self):
        count = len(self.ranges)
        share = [*product((0.0, 1.0), repeat=count), (0.5,) * count]
        if count:
            golden = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]))[:count]
            share += list(np.mod(np.outer(np.arange(1, SCATTERED + 1), golden), 1.0))
        return np.array(share).reshape(-1, count) * (self.box[1] - self.box[0]) + self.box[0] if count else np.zeros((1, 0))

    def _place(self, by):
        return [by[axis.path] for axis in self.ranges]

    def at(self, point) -> list[_Part]:
        """The exact intervals at one point of the box."""
        return self._met([_Part(*self.span)], np.asarray(point, float)[None])

    def _met(self, parts, points):
        for point, found in zip(points, self._exact(points), strict=True):
            by = self.named(point)
            own = [
                _Part(low, high, by if low > self.span[0] else None, by if high < self.span[1] else None, *omegas)
                for low, high, *omegas in found
            ]
            parts = _shared(parts, own)
        return parts

    def _exact(self, points):
        """The stable intervals at each point."""
        found = [[] for _ in points]
        for some in distinct(list((points == 0).T), len(points)):
            arrays = {axis.path: np.ascontiguousarray(points[some, i]) for i, axis in enumerate(self.ranges)}
            task = DrawnTask(self.drawing, self.along, self.span, ((np.arange(some.size), self.values | arrays),), False, True)
            records = task.records()
            self.certified &= bool(records["certified"].all())
            for record in records[records["intervals"] > 0]:
                ends = (float(record[name]) for name in ("low", "high", "low_omega", "high_omega"))
                found[some[record["slice"]]].append(tuple(ends))
        return found

    def cover(self, low=0.0, high=0.0) -> Cover:
        """The proof that all loops of the box are stable, from low to high of the number if there is one."""
        box = np.column_stack([[low, high], self.box]) if self.along else self.box
        paths = [*filter(None, [self.along]), *(axis.path for axis in self.ranges)]
        bounds = np.array(
            [domain(self.drawing, self.values, path, tuple(ends)) for path, ends in zip(paths, box.T, strict=True)]
        ).T
        varied = self.values | {
            path: np.array(ends) if ends[0] < ends[1] else ends[0] for path, ends in zip(paths, box.T, strict=True)
        }
        frames = partial(_frames, self.drawing, self.values, paths, _with_lead(self.drawing, varied, paths, box, self.values))
        return cover(frames, box, bounds, FRAMES)

    def unstable(self) -> Mapping[str, float] | None:
        """Numbers among those that are looked at with which the loop is not stable, or not known to be; None without."""
        points = self._points()
        for some in distinct(list((points == 0).T), len(points)):
            arrays = {axis.path: np.ascontiguousarray(points[some, i]) for i, axis in enumerate(self.ranges)}
            radius = radii_of(self.drawing, self.values | arrays, some.size)
            if (wrong := np.flatnonzero(~(radius < 1))).size:
                return self.named(points[some[wrong[0]]])
        return None

    def named(self, point) -> dict[str, float]:
        """The numbers of a point of the box."""
        return self.case | dict(zip((axis.path for axis in self.ranges), np.asarray(point).tolist(), strict=True))


def proved_from_zero(spec: Spec, path: str, stop: float) -> float:
    """Return up to what stiffness of a wall, at most `stop`, all loops of [for_all] are proved to be stable from about 0 on."""
    values = dict(spec.values)
    drawing = drawing_for(spec, values, path)
    rows = ForAllTask(Rules.of(spec), path, (0.0, stop), ((np.zeros(1, int), drawing, values),)).records()
    found = rows[(rows["intervals"] > 0) & (rows["low"] <= FROM_ZERO * rows["high"] * (1 + SETTLED))]
    return float(found["high"].max(initial=0.0))


def verdict(spec: Spec) -> dict[str, str]:
    """Whether the spec's own loop is stable for all numbers of its [for_all]: verdict ("proved", "refuted" or "unknown") and
    counterexample, the numbers with which it is unstable."""
    refuse_unsuitable_ranges(spec, "")
    rules, values = Rules.of(spec), dict(spec.values)
    loop, known = _Loop(ForAllTask(rules, "", (0.0, 0.0), ()), own_loop(spec)[0], values), True
    for case in (_Case(loop, each) for each in loop.cases):
        if rules.vary:
            number = _number(spec)
            said, pattern = decided(rules.family(case.drawing, values | case.case, number), float(values[number]))
            if said == "refuted":
                return {"verdict": said, "counterexample": _numbers({**case.case, pattern: None})}
            known &= said == "proved"
            continue
        numbers = case.unstable()
        found = case.cover() if numbers is None and case.ranges else None
        if found is not None and len(found.unstable):
            numbers = case.named(found.unstable[0])
        if numbers is not None:
            return {"verdict": "refuted", "counterexample": _numbers(numbers)}
        known &= found is None or not len(found.open)
    return {"verdict": "proved" if known else "unknown", "counterexample": ""}


def _frames(drawing, values, paths, drift, x):
    x = np.where(x == 0, TINY, x)
    return frames_where_solvable(drawing, values | {path: x[:, i].copy() for i, path in enumerate(paths)}, drift, (len(x),))


def _with_lead(drawing, varied, paths, box, values):
    """The drift of all loops of a box, counted from the state from which their entries are smallest."""
    drift = drift_of(drawing, varied)
    if len(drift.folded) != 1:
        return drift
    corners = np.array(list(product(*box.T)))
    leads = [replace(drift, folded=(state,)) for state in sorted({*drift.kept, *drift.folded})]
    with np.errstate(all="ignore"):
        sizes = [
            np.nan_to_num(np.abs(_frames(drawing, values, paths, each, corners).E), nan=np.inf).max(initial=0.0)
            for each in leads
        ]
    return leads[int(np.argmin(sizes))]


def _recorded(rows, certified):
    records = np.zeros(max(1, len(rows)), FOR_ALL_RECORD)
    for name in FOR_ALL_RECORD.names:
        if FOR_ALL_RECORD[name].kind == "f":
            records[name] = np.nan
    records["residual"] = 0.0
    records["intervals"], records["doubt"] = len(rows), NONE if rows and certified else SEARCH
    records["certified"] = bool(rows and certified)
    for number, row in enumerate(rows):
        records[number]["interval"] = number
        records["low"][number], records["high"][number] = row.low, row.high
        records["fails_below"][number] = row.part.low if row.part.low_by is not None else np.nan
        records["fails_from"][number] = row.part.high if row.part.high_by is not None else np.nan
        records["low_omega"][number], records["high_omega"][number] = row.part.low_omega, row.part.high_omega
        records["settled"][number], records["counterexample"][number] = row.settled, row.text
    return records
