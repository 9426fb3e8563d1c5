"""The room that each number of a spec's own design has: the stable interval about its value, and
the largest delay."""

from collections.abc import Callable
from operator import ne, or_

import numpy as np

from wavesweep.engine.doubts import words
from wavesweep.engine.errors import WavesweepError
from wavesweep.engine.intervals import Searches
from wavesweep.program.analyses.interval_jobs import Way, job_over, searches_of
from wavesweep.program.analyses.own_design import searched
from wavesweep.program.columns import open_places
from wavesweep.program.platform_compat import one_thread
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.spec.resolving import longest_delay
from wavesweep.program.sweep.grid import keys_of, loops_of, make_grid, own_loop

HALVINGS_TO_END = 30  # towards the end of what a spec takes
# on the range of one number in pieces, see `Search.about`, after which it ends where it is: some 3
# s
PIECES_OF_RANGE = 50_000
SECONDS, LONG = (
    3.0,
    1.0,
)  # that another range may take, see `IntervalQuery`, from a cut and by panels
# share of a number that a pose depends on, or of its range about 0, that is searched
NEAR_POSE = 0.02
LATE = "it takes longer than check does"
# of the way to where the range of a key ends, that is left out if it cannot be decided, or if the
# key does not take its end
LEFT_OUT_OF_WAY = 1e-3
DIGITS_OF_KEYS = 7  # that the end of a key's range has


def limits(spec: Spec, report: Callable[[int, int], None] | None = None) -> list[dict]:
    """For each symbol that the loop reads: value, the ends of the stable interval about it, and the
    factors to them.

    low, high: None if the interval goes on to the end of the range that was searched (`from`,
    `to`), see `searched`, as far as the spec takes its ends.
    intervals: all stable intervals in that range. certified: whether they are. open: the places in
    or beside the interval where nothing is known, see `open_places`. stopped: whether the range
    would go on, but takes more than PIECES_OF_RANGE or SECONDS; it is then the part next to the
    value, or LATE is the doubt. of_key: for each end of the range, whether the key takes no value
    beyond it. report: is called with the numbers that are done, and all.
    """
    read = keys_of(spec) - (spec.drawing.of_losses if spec.drawing else set())
    names = {}
    for name, path in spec.names.symbols.items():
        if path in read and not spec.names.keys[path].structural:
            names[name] = path
    limits_found = []
    for done, (name, path) in enumerate(names.items(), start=1):
        span = searched(spec, name, path)
        limits_found.append(_limit(spec, name, path, span))
        if report:
            report(done, len(names))
    return limits_found


def _limit(spec, name, path, span, of_key=(False, False), again=False):
    """span: to search; again: whether it leaves out what is next to the range of the key."""
    value = spec.values[path]
    limit = {"name": name, "value": value, "from": span[0], "to": span[1]}
    limit |= {"low": None, "high": None, "intervals": []}
    limit |= {"stopped": False, "open": None, "of_key": [bool(end) for end in of_key]}
    try:
        near = _next_to(spec, path, value, span) if _poses(spec, path) else span
        job = _job(spec, name, path, near)
        rows, reached = _rows(job, value, near)
    except WavesweepError as error:
        if (
            value == 0 and span[0] < 0 and not _poses(spec, path)
        ):  # a number that may not be negative
            return _limit(spec, name, path, (0.0, span[1]), (True, of_key[1]))
        if narrower := _narrower(spec, name, path, value, span):
            cut = map(ne, narrower, span)
            return _limit(spec, name, path, narrower, tuple(map(or_, of_key, cut)))
        return limit | {"stable": None, "doubt": str(error), "certified": False}
    start, stop = reached
    of_key = (of_key[0] and span[0] == start, of_key[1] and span[1] == stop)
    limit |= {"from": start, "to": stop, "stopped": reached != span}
    limit["of_key"] = [bool(end) for end in of_key]
    if rows is None:
        return limit | {"stable": None, "doubt": LATE, "certified": False}
    # A filter's cutoff is next to half its rate.
    from_moves = of_key[0] and float(rows["open_low"][0]) == start
    to_moves = of_key[1] and float(rows["open_high"][-1]) == stop
    if not again and (from_moves or to_moves):
        start += LEFT_OUT_OF_WAY * (value - start) * from_moves
        stop += LEFT_OUT_OF_WAY * (value - stop) * to_moves
        return _limit(spec, name, path, (start, stop), of_key, again=True)
    return limit | _around(rows, value, start, stop)


def _narrower(spec, name, path, value, span):
    """The range of a number in which the spec makes loops, if that is less than the range to
    search; otherwise None."""

    def makes_loops(end: float) -> object:
        return _job(spec, name, path, tuple(sorted((float(value), end))))

    def takes(end: float) -> object:
        return spec.with_values({path: end})

    # Few steps towards the end of where it has loops, as an angle has up to a pole.
    for attempt, times in ((takes, HALVINGS_TO_END), (makes_loops, 8)):
        less = tuple(_reached(attempt, value, end, times) for end in span)
        if less != span and less[0] < less[1]:
            if attempt is takes:
                less = tuple(
                    end if end == asked else _end_of_key(takes, value, end)
                    for end, asked in zip(less, span, strict=True)
                )
            return less
    return None


def _end_of_key(takes, value, last):
    """Where a range ends whose key takes no value beyond one next to `last`: there, or, if not even
    that is taken, as half of its rate by a filter, before what crowds towards it."""
    end = float(f"{last:.{DIGITS_OF_KEYS}g}")
    try:
        takes(end)
    except WavesweepError:
        return last + LEFT_OUT_OF_WAY * (value - last)
    return end


def _around(rows, value, start, stop):
    """The stable intervals from start to stop, and the ends of the one around the value, with
    what is open in it."""
    low = rows["low"]
    high = rows["high"]
    at_low = (low == value) & ~np.isnan(rows["low_omega"])
    at_high = (high == value) & ~np.isnan(rows["high_omega"])
    inside = (low <= value) & (value <= high) & ~(at_low | at_high)
    filled = rows["intervals"] != 0
    stable = np.column_stack([low[filled], high[filled]]).tolist()
    limit = {"intervals": stable, "stable": bool(inside.any())}
    limit |= {"doubt": str(rows["doubt"][0]), "certified": bool(rows["certified"].all())}
    if not inside.any():
        unknown = (rows["open_low"] <= value) & (value <= rows["open_high"])
        if unknown.any():
            limit["stable"] = None
        return limit
    row = int(np.flatnonzero(inside)[0])
    limit["open"] = open_places(rows, row)
    for end, of_range in (
        ("low", start),
        ("high", stop),
    ):  # one without a crossing may end where nothing is known
        if not np.isnan(rows[f"{end}_omega"][row]) or rows[end][row] != of_range:
            limit[end] = float(rows[end][row])
    return limit


def _job(spec, name, path, span):
    """The job of the intervals along a number alone."""
    return job_over(make_grid(spec, (), path), Axis(name, path, (), *span, False, "linear"))


def _rows(job, value, span):
    """The intervals, and the part of the range that was searched; None and the value itself if
    they take too long."""
    (search,) = searches_of(job, job.chunks[0], felt=False).searches
    if search.in_pieces:
        records, span = search.about(value, PIECES_OF_RANGE)
    else:
        most = SECONDS if job.asked.way is Way.CUT else LONG
        if job.asked.cost > most:
            return None, (value, value)
        with one_thread():
            records = Searches((search,)).records()
    rows = {name: records[name] for name in records.dtype.names}
    rows["doubt"] = words(records["doubt"])
    return rows, span


def _poses(spec, path):
    """Whether the pose of a linkage depends on a number."""
    return spec.drawing and path in spec.drawing.posing


def _next_to(spec, path, value, span):
    """The part of a range that is near (NEAR_POSE) the value of a number that a pose depends on, in which no
    pose is singular.

    Panels crowd towards a singular pose.
    """
    if value == 0:
        span = tuple(
            _reached(lambda end: spec.with_values({path: end}), value, end, HALVINGS_TO_END)
            for end in span
        )
    away = NEAR_POSE * (abs(value) or min(map(abs, span)))
    tiny = 1e-3 * away
    low, high = own_loop(spec, path).domain(path, (value - tiny, value + tiny))
    return max(span[0], low, value - away), min(span[1], high, value + away)


def _reached(attempt, value, end, times):
    """The value nearest to an end of a range whose attempt raises no error, by halving from the
    number's own on."""
    inside = float(value)
    tried = float(end)
    beyond = float(end)
    for _ in range(1 + times):
        try:
            attempt(tried)
            inside = tried
        except WavesweepError:
            beyond = tried
        if inside == beyond:
            break
        tried = (inside + beyond) / 2
    return inside


def delays(spec):
    """The largest delay of the slow environment up to which every delay is stable, in ticks;
    none if the loop has none."""
    path = "environment.delay"
    if path not in keys_of(spec):
        return None
    now = spec.values[path]
    if spec.delay_of_frame:
        frame = tried = now
        tries = [now]
    else:
        frame = longest_delay(spec.values)
        tried = min(frame, now + 200)  # ticks of delay that are tried
        tries = range(now, tried + 1)
    most = None
    for delay in tries:
        loop = loops_of(spec, {**spec.values, path: delay}).read
        if not loop.radii()[0] < 1:
            break
        most = delay
    return {"ticks": now, "most": most, "frame": frame, "tried": tried}
