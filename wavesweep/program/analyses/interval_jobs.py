"""The job of stable intervals along an axis."""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache, partial
from typing import Any

import numpy as np

from wavesweep.capabilities import offered
from wavesweep.engine.doubts import words
from wavesweep.engine.drawing import name_of, path_of
from wavesweep.engine.errors import IllPosedLoopError, UsageError
from wavesweep.engine.frames import REMEMBERED_LOOPS, open_loops
from wavesweep.engine.intervals import FAILURES, Prover, Search, Searches, record_type, unanswered
from wavesweep.engine.loop import Loops
from wavesweep.haptics.felt import FELT, FELT_AT_ENDS, RECORD, feels, felt_along, felt_at_ends
from wavesweep.program.analyses.claims import STABLE, Claim, Property, Scope, Status, own_scope
from wavesweep.program.analyses.spec_loops import refuse_singular
from wavesweep.program.columns import Columns, columns_of_ends
from wavesweep.program.reading.tables import TableValue
from wavesweep.program.row_kinds import ARGUMENTS, LEFT_OPEN, TEXT
from wavesweep.program.spec import Axis, Spec, no_axis, sweep_axes
from wavesweep.program.sweep.grid import (
    CHECKED,
    FAST,
    Grid,
    Group,
    drawn_groups,
    frames_per_clock,
    make_grid,
    own_loop,
)
from wavesweep.program.sweep.job import (
    FEWEST,
    MOST,
    MOST_DRAWN,
    MOST_SLOW,
    SECONDS_OF_CHUNK,
    Chunk,
    Chunks,
    Job,
    JobKind,
)

# Seconds per slice and squared order, measured: one polynomial per slice; dominance, along any
# parameter but the wall, and for crowded poles of high order.
BY_POLYNOMIAL, BY_DOMINANCE = 0.2e-6, 15e-6


class Way(Enum):
    """How the intervals along a number are found: from a cut, where it is one scalar gain of a
    frame, by dominance, or both."""

    CUT = "cut"
    DOMINANCE = "dominance"
    BOTH = "both"


PROVED_RECORD = record_type(
    *((name, "<f8") for name in (*FELT, "fails_below", "fails_from")),
    ("settled", "?"),
    ("counterexample", f"<U{TEXT}"),
    ("left_open", f"<U{LEFT_OPEN}"),
)
"""Of rows that are proved, with the nearest values beyond that are refuted."""


class Guarantee:
    """Intervals that hold for more than the spec's own loop, such as for hands; a frozen dataclass
    of a capability is one.

    kind: the word of its rows. dtype: of its records, which have the fields of RECORD and those of
    its own columns. method: how they are found, in a line. own_ticks: whether forces are held over
    the ticks of the spec, which are then not divided out. Of those for hands, word: what
    --for-hands has for it; order: of the rows in a table; replaces: whether other hands are in the
    place of the spec's operator. status: how rows are known that are not in doubt.
    """

    __slots__ = ()
    kind: str
    dtype = PROVED_RECORD
    method: str
    word = ""
    order = 0
    replaces = False
    own_ticks = False
    status = Status.CERTIFIED

    def records_of(self, loop: Loops, path: str, span: tuple[float, float]) -> np.ndarray:
        """The intervals of one loop along a number, as records of slice 0."""
        raise NotImplementedError

    def felt(self, loop: Loops, path: str, values: np.ndarray) -> np.ndarray:
        """The least stiffness (N/m) that the hand feels at rest of all loops that rows hold for, at
        values of the number, `(n,)`; NaN where it is not known."""
        return felt_along(loop, path, values)

    @property
    def what(self) -> Property:
        """What its rows say of their loops."""
        return STABLE

    def scope(self, spec: Spec) -> Scope:
        """The loops that its rows are of, by the plan that they are proved by."""
        return own_scope(spec)

    def claim(self, spec: Spec) -> Claim:
        """What its rows say, and of which loops."""
        return Claim(self.what, self.scope(spec), self.status)

    def notices(self, job: Job) -> Iterable[str]:  # noqa: ARG002
        """What a user should know beforehand about these rows of a job."""
        return ()


@dataclass(frozen=True, slots=True)
class IntervalQuery:
    """What is asked of the loops: their stable intervals along `axis`, found in that way.

    cost: s that a slice takes, roughly. guarantee: the hands or numbers for which the intervals are
    guaranteed; None: those of the spec's own loop. require: of every mode, in place of stability
    alone.
    """

    axis: Axis
    way: Way = Way.DOMINANCE
    cost: float = 0.0
    guarantee: "Guarantee | None" = None
    require: TableValue | None = None

    @property
    def span(self) -> tuple[float, float]:
        """The range of the axis."""
        return float(self.axis.start), float(self.axis.stop)

    def drawn_along(self, spec: Spec) -> str:
        """The path along which loops are made, see `drawn_groups`; none if drawn ones keep their
        own ticks, as for a gain, for the lines of modes, or for what has `own_ticks`."""
        if self.guarantee:
            in_own_ticks = self.guarantee.own_ticks
        else:
            bound = self.require and self.require.bound
            in_own_ticks = bound and (bound.gains or bound.damped)
        return "" if spec.drawing and in_own_ticks else self.axis.path

    @property
    def identity(self) -> dict[str, object]:
        """What the records depend on besides the spec."""
        facts_of_axis = {"along": self.axis.name} | (
            {"require": self.require.written()} if self.require else {}
        )
        if self.guarantee is None:
            return facts_of_axis
        return facts_of_axis | {"guarantee": repr(self.guarantee)}


def _task(job, chunk):
    query = job.asked
    if query.guarantee is None:
        return searches_of(job, chunk).records
    loops = job.grid.drawn(query.drawn_along(job.grid.spec), chunk.loops)
    return partial(loop_by_loop, loops, query.axis.path, query.span, query.guarantee)


def searches_of(job: Job, chunk: Chunk, *, felt: bool = True) -> Searches:
    """The searches for the intervals of the loops of a chunk; felt: see `_searches`."""
    grid = job.grid
    loops = grid.drawn(job.asked.drawn_along(grid.spec), chunk.loops)
    checked = grid.loops <= CHECKED
    return _searches(grid.spec, job.asked, loops, felt=felt, checked=checked, prover=ball_prover)


def ball_prover(
    loops: Loops, path: str, period: np.ndarray
) -> Callable[[int, float, float], Any] | None:
    """The prover in ball arithmetic, if the capability is there."""
    module = offered("prover")
    if module:
        return module.ball_prover(loops, path, period)
    return None


def records_of_loop(loop: Loops, path: str, span: tuple[float, float]) -> np.ndarray:
    """The stable intervals of one loop along a number as records; ball arithmetic proves what
    doubles leave in doubt."""
    groups = ((np.zeros(1, int), loop),)
    search = Search(path, span, groups, lines=False, checked=True, prover=ball_prover)
    return Searches((search,)).records()


_PAIRS = (("low", "high"), ("low_omega", "high_omega"))


def loop_by_loop(parts, path: str, span: tuple[float, float], guarantee: Guarantee) -> np.ndarray:
    """Records of guaranteed intervals along a number, sorted by slice, with what the hand feels at
    their ends.

    parts: (members, loops) pairs. A loop whose search fails in arithmetic is in doubt everywhere.
    """
    by_number = {}
    for members, loops in parts:
        for place, number in enumerate(members.tolist()):
            loop = loops.one(place)
            try:
                pieces = loop.pieces(path, span)
                records = [
                    guarantee.records_of(loop.changed(built), path, piece)
                    for piece, built in pieces
                ]
                by_number[number] = records = _joined(records) if len(records) > 1 else records[0]
                if feels(loop.drawing) and records["intervals"][0]:
                    p, omega = (np.stack([records[name] for name in pair]) for pair in _PAIRS)
                    felt = felt_at_ends(
                        p, omega, lambda _, values, loop=loop: guarantee.felt(loop, path, values)
                    )
                    records[FELT[0]], records[FELT[1]] = felt
            except FAILURES as error:
                by_number[number] = unanswered(guarantee.dtype, number, span, error)
            by_number[number]["slice"] = number
    return np.concatenate([by_number[number] for number in sorted(by_number)])


def _joined(pieces):
    """The records of pieces of a range, of which those that meet are one; none is known better
    than the piece known least."""
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
                last[name] = "; ".join(
                    dict.fromkeys(filter(None, (str(last[name]), str(row[name]))))
                )
    together = np.concatenate(pieces)
    records = np.array(joined or together[:1])
    records["intervals"], records["interval"] = len(joined), np.arange(len(records))
    records["doubt"] = together["doubt"][np.argmin(together["certified"])]
    records["argument"] = together["argument"].max()
    for name in records.dtype.names:
        if records.dtype[name].kind == "b":
            records[name] = together[name].all()
    return records


def _columns(job, combination, records):
    """The axes, `along`, and the fields of the records."""
    columns = {
        name: np.ascontiguousarray(records[name])
        for name in records.dtype.names
        if name != "slice" and not name.endswith("_cause")
    }
    columns["doubt"] = words(columns["doubt"])
    columns["argument"] = _arguments(records)
    required = job.asked.require
    columns |= columns_of_ends(records, required.bound.set_by if required else ())
    if job.asked.guarantee:  # what refutes it names what sets an end
        columns |= {
            name: np.full(records.size, "", object) for name in columns if name.endswith("_set_by")
        }
    along = np.full(records.size, job.asked.axis.name, dtype=object)
    return job.grid.axis_columns(combination) | {"along": along} | columns


def _arguments(records: np.ndarray) -> np.ndarray:
    """The words of the column `argument`."""
    codes = np.where(records["certified"], records["argument"], 0)
    return np.array(list(ARGUMENTS), object)[codes]


def _sample(job):
    """The job in one of the pieces into which dead times of other whole ticks cut its range, and
    the times it is of that."""
    spec, axis = job.grid.spec, job.asked.axis
    if not spec.drawing or name_of(axis.path) not in spec.drawing.timing:
        return job, 1
    ends = own_loop(spec, axis.path).breaks(axis.path, job.asked.span)
    middle = (len(ends) - 1) // 2
    piece_number = min(middle, 64)  # pieces of a range, up to which one is a sample
    longer = (
        (middle / max(piece_number, 1)) ** 3 if middle > piece_number else 1
    )  # as eigenvalues of more states take
    piece = replace(axis, start=ends[piece_number], stop=ends[piece_number + 1])
    return replace(job, asked=replace(job.asked, axis=piece)), (len(ends) - 1) * longer


# Some slices have several intervals. Bytes of a row: 130 in the CSV and 30 in the Parquet file,
# measured on millions of rows.
INTERVALS = JobKind(_task, _columns, rows=1.2, row_bytes=160, sample=_sample)


def _searches(
    spec: Spec,
    query: IntervalQuery,
    loops: Iterable[Group],
    *,
    felt: bool = True,
    checked: bool = True,
    prover: Prover | None = None,
) -> Searches:
    """The searches for the intervals of loops of the spec.

    felt: whether to give what is felt at the ends and the lines of a spectrum. checked, prover: see
    `Search`.
    """
    by_bound: dict = {}
    require = query.require
    for members, alike in loops:
        bound = require and require.bound.over(frames_per_clock(spec.drawing, alike))
        by_bound.setdefault((alike.drawing, bound), []).append((members, alike.read))
    path = query.axis.path
    span = query.span
    checked_before = checked or not spec.drawing
    at_port = FELT_AT_ENDS if felt else None
    searches = []
    for (drawing, bound), several in by_bound.items():
        groups = tuple((members, Loops(drawing, alike.values)) for members, alike in several)
        searches.append(
            Search(path, span, groups, felt, checked_before, prover, bound, at_port, RECORD)
        )
    return Searches(tuple(searches))


def job_of(spec: Spec, along: str | None = None) -> Job:
    """The job of a spec's [sweep]. Raises UsageError if it cannot be done, before anything is
    computed."""
    axis, other_axes = sweep_axes(spec, along)
    return job_over(make_grid(spec, other_axes, axis.path), axis, require=spec.require)


def job_over(grid: Grid, axis: Axis, *, require: TableValue | None = None) -> Job:
    """The job of a grid; require: see `IntervalQuery`. Errors: UsageError or SpecError if it
    cannot be done."""
    spec = grid.spec
    query = IntervalQuery(axis, require=require)
    if axis.structural:
        other_paths = [loop_axis.path for loop_axis in grid.loop_axes]
        if spec.builds(axis.path, [axis.path, *other_paths]):
            raise UsageError(no_axis(spec, axis.name))
    grid.resolve_all()
    from_rates = spec.uneven or axis.path == FAST
    for end in query.span:
        if from_rates or _unsuitable(spec, axis.path, end):
            spec.with_values({axis.path: end})
    if spec.drawing:
        refuse_singular(spec, spec.drawing)
    drawn = grid.drawn(query.drawn_along(spec))
    for _, loops in drawn:
        if require and name_of(axis.path) in loops.drawing.rating:
            require.bound.refuse_rates(axis.name)
        loops.domain(axis.path, query.span)
    orders_and_ways = _orders_of_few(spec, query, drawn)
    if not orders_and_ways:
        # Loops of a sweep whose way is looked for.
        orders_and_ways = [_order_of(spec, loops.some([0]), axis) for _, loops in drawn[:8]]
    orders, ways = zip(*orders_and_ways, strict=True)
    way = ways[0] if len({*ways}) == 1 else Way.BOTH
    cost = (require and require.bound.cost) or expected_cost(orders[0], ways[0])
    limit = MOST_DRAWN if spec.drawing else MOST
    if way is not Way.CUT:
        limit = MOST_SLOW
    # Of about SECONDS_OF_CHUNK each; `limit` slices keep an error of the cost small.
    together = int(np.clip(SECONDS_OF_CHUNK / cost, FEWEST, limit))
    chunks = Chunks(grid.loops, 1, together, 1)
    query = replace(query, way=way, cost=cost)
    return Job(INTERVALS, grid, chunks, RECORD, query.identity, query)


def _unsuitable(spec, path, value):
    """Whether a drawn loop has no frames at a value of a number."""
    if not spec.drawing:
        return False
    loops = Loops(spec.drawing, {**spec.values, path: np.array([value])})
    return loops.unsuitable().any()


def guaranteed(job: Job, guarantee: Guarantee) -> Job:
    """The job of the intervals that are guaranteed for hands or numbers, with records of their
    own."""
    query = replace(job.asked, guarantee=guarantee)
    return replace(job, dtype=guarantee.dtype, identity=query.identity, asked=query)


def _orders_of_few(spec, query, drawn):
    """States of few loops that are all cut at the number, as their search cuts them, which
    remembers them, and that way; otherwise nothing."""
    if sum(members.size for members, _ in drawn) > REMEMBERED_LOOPS:
        return []
    with suppress(IllPosedLoopError, *FAILURES):
        searches = _searches(spec, query, drawn).searches
        opened = [slices.opened for search in searches for _, slices in search.opened_groups()]
        if all(loops and loops.loops.cut for loops in opened):
            return [(loops.loops.cut.order, Way.CUT) for loops in opened]
    return []


@lru_cache(maxsize=64)
def _order_of_drawing(drawing, path, items):
    """States of a loop, and the way along the number."""
    loops = Loops(drawing, {path: np.array(v) if isinstance(v, tuple) else v for path, v in items})
    opened = open_loops(loops, name_of(path), shortened=True)
    if opened and opened.cut:
        return opened.cut.order, Way.CUT
    return len(loops.drift_of_frames().remaining), Way.DOMINANCE


def expected_cost(order: int, way: Way) -> float:
    """Seconds that a slice of a loop with `order` states takes, roughly.

    A fixed rule and no measurement, so that a run that goes on finds the chunks of the one that was
    stopped.
    """
    if way is Way.CUT and order <= 24:  # of more states poles are crowded
        share = BY_POLYNOMIAL
    else:
        share = BY_DOMINANCE
    return share * max(order, 2) ** 2


def cost_of(spec: Spec, axis: Axis) -> tuple[float, Way]:
    """Expected s per slice of the spec along the axis, with what [sweep] requires, and its way."""
    order, method = _order_of(spec, own_loop(spec, axis.path), axis)
    required = spec.require.bound.cost if spec.require else 0.0
    if required:
        return required, Way.DOMINANCE
    return expected_cost(order, method), method


def _order_of(spec, loops, axis):
    return _order_of_drawing(
        loops.drawing, axis.path, Loops(loops.drawing, _like_own(spec, loops)).items
    )


def _like_own(spec, loops):
    """The values of loops, those of the spec in place of others of the same sign, which have the
    same structure as a rule.

    A compiled loop is asked about other values again and again.
    """
    shaping, like = {path_of(name) for name in loops.drawing.shaping}, dict(loops.values)
    for path, value in loops.values.items():
        value_of_spec, first = spec.values.get(path), value[0] if np.ndim(value) else value
        if (
            path not in shaping
            and isinstance(value_of_spec, float)
            and (first > 0, first < 0) == (value_of_spec > 0, value_of_spec < 0)
        ):
            like[path] = (
                # A number that varies has another value beside its own.
                value_of_spec * np.array([1.0, 1.001]) if np.ndim(value) else value_of_spec
            )
    return like


def at_points(
    spec: Spec,
    axis: Axis,
    points: Mapping[str, np.ndarray],
    require: TableValue | None = None,
    **how: Any,
) -> Columns:
    """Stable intervals along `axis` at single points, as the records of a table, with the column
    `slice`: the point's number.

    points: path -> value at each point, `(n,)`; no two points are the same. require: see
    `IntervalQuery`. how: see `_searches`.
    """
    count = len(next(iter(points.values())))
    query = IntervalQuery(axis, require=require)
    loops = drawn_groups(spec, points, count, rates=True, along=query.drawn_along(spec))
    records = _searches(spec, query, loops, **how).records()
    columns = {name: np.ascontiguousarray(records[name]) for name in RECORD.names}
    columns["doubt"] = words(records["doubt"])
    columns["argument"] = _arguments(records)
    return columns | columns_of_ends(records)


CUT = "crossings of the unit circle from one real polynomial, proved by signs or discs, polished in state space"
DOMINANCE = "eigenvalues off the unit circle by dominance in eigenvectors, on Chebyshev panels of the frame's entries"


def method(query: IntervalQuery) -> str:
    """How the intervals are found, in a line."""
    text = {
        Way.CUT: CUT,
        Way.DOMINANCE: DOMINANCE,
        Way.BOTH: f"{CUT}, in loops of which the axis is one scalar gain of a frame; {DOMINANCE}, in others",
    }[query.way]
    if query.require:
        return query.require.bound.method(text)
    return text
