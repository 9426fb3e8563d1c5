"""How the ends of stable intervals, and the stiffness felt there, move with every number of the
loop: the table `why`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from math import isclose, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.program.columns import Columns, axes_of, open_places
from wavesweep.program.number_words import in_digits, rounded_down, rounded_up, span_in_words
from wavesweep.program.reading.keys import readable
from wavesweep.program.spec import Axis, Spec, sweep_axes
from wavesweep.program.spec.loading import naming
from wavesweep.program.tables.interval_sentences import open_in_words
from wavesweep.program.tables.kind import (
    Line,
    Numbers,
    Recompute,
    counted_doubts,
    in_doubt,
    plain,
    whole_kind,
)
from wavesweep.program.tables.table import Table, facts_of, held

if TYPE_CHECKING:
    from wavesweep.program.sweep.grid import Grid

METHOD = (
    "implicit function theorem at the crossing eigenvalue; derivatives of the frame by a complex step of 1e-30, along what the "
    "spec keeps: rates.fast_hz with the ratio, rates.tick_hz with the periods in ticks"
)


def why(spec: Spec, along: str | None = None) -> Table:
    """The elasticities of each limit of the spec's own design: per cent by which it moves for one
    per cent of each number.

    along: the axis of the intervals, the spec's own by default; a key of a block by its path too.
    The other axes of [sweep] are held at the spec's values. Errors: as for `intervals`.
    """
    from wavesweep.program.analyses.assumptions import over_preset
    from wavesweep.program.analyses.claims import own_figures
    from wavesweep.program.analyses.interval_jobs import job_over, method
    from wavesweep.program.sweep.grid import make_grid
    from wavesweep.program.sweep.running import in_memory
    from wavesweep.sensitivity.elasticities import elasticities, without_derivatives

    started = time.perf_counter()
    spec = naming(spec, [along])
    spec.refuse_require("why")
    axis, other_axes = sweep_axes(spec, along, swept=False)
    job = job_over(make_grid(spec, (), axis.path), axis)
    found = in_memory(job)
    columns = KINDS[0].ordered(elasticities(job.grid, axis, found, KINDS[0].names))
    certified = int(found["certified"].all())
    notices = [
        f"{other_axis.name} is not swept here, {held(spec, other_axis.path)}"
        for other_axis in other_axes
    ]
    notices += _span_notices(spec, axis)
    if left_out := without_derivatives(spec):
        notices.append(
            f"without derivatives, since they are whole numbers or decide how the loop is built: {', '.join(left_out)}"
        )
    if spec.for_all:
        notices.append(f"the spec's own design: {spec.for_all.verdict(spec)}")
    notices += over_preset(spec)
    counts = {"computed": 1, "skipped": 0, "certified": certified}
    timings = {"compute_s": time.perf_counter() - started}
    facts = facts_of(
        spec,
        {"intervals": method(job.asked), "why": METHOD},
        counts,
        timings,
        notices,
        [axis.path],
        claims=own_figures([spec], "limits"),
    )
    ends = zip(
        *(found[end][found["intervals"] > 0].tolist() for end in ("low", "high")), strict=True
    )
    spans = [{"low": low, "high": high} for low, high in ends]
    doubts = counted_doubts(found["doubt"])
    searched = {
        "name": axis.name,
        "unit": spec.names.keys[axis.path].unit,
        "from": axis.start,
        "to": axis.stop,
    }
    open_ = [*filter(None, (open_places(found, row) for row in range(len(found["intervals"]))))]
    facts |= {"along": searched, "intervals": spans, "open": open_, "doubts": doubts}
    return Table.of("why", columns, facts)


def _span_notices(spec: Spec, axis: Axis) -> list[str]:
    """Between which values an axis is searched that has no span in [sweep]."""
    if (
        any(swept.path == axis.path and not swept.values for swept in spec.sweep)
        or axis.path in spec.wall[:1]
    ):
        return []
    listed = any(swept.path == axis.path and swept.start < swept.stop for swept in spec.sweep)
    if listed:
        said = "has values in [sweep]: searched between their ends,"
    else:
        said = "has no span in [sweep]: searched"
    return [f"{axis.name} {said} from {span_in_words(axis.start, axis.stop)}"]


def sensitivities(grid: Grid, axis: Axis) -> Columns:
    """The same columns for every combination of a grid, in memory."""
    from wavesweep.program.analyses.interval_jobs import job_over
    from wavesweep.program.sweep.running import in_memory
    from wavesweep.sensitivity.elasticities import elasticities

    reserved = sorted({other_axis.name for other_axis in grid.axes} & set(KINDS[0].names))
    if reserved:
        raise UsageError(
            f"{', '.join(reserved)}: the table has a column of this name; name the axis by its path, numbers.{reserved[0]}"
        )
    return elasticities(grid, axis, in_memory(job_over(grid, axis)), KINDS[0].names)


LEAST_ELASTICITY = 5e-4  # an elasticity below which a number does not matter


KEPT = {
    "rates.fast_hz": " (same ratio)",
    "rates.tick_hz": " (same periods in ticks)",
}  # and what stays as it is beside it

_MODE = ("crossing", "omega", "damping_ratio", "states", "corner", "second_hz")
_OF_END = {
    "interval": "interval",
    "end": "side",
    **{name: name for name in _MODE},
    "line_hz": "hz",
}  # and their columns


def ends_of(columns: Columns) -> list[Columns]:
    """The rows of each combination of axes, interval, end and crossing."""
    names = [*axes_of(columns), "interval", "side", "crossing"]
    ends: dict[tuple, list[int]] = {}
    for row, key in enumerate(zip(*(columns[name].tolist() for name in names), strict=True)):
        ends.setdefault(key, []).append(row)
    return [
        {name: np.asarray(column)[rows] for name, column in columns.items()}
        for rows in ends.values()
    ]


def _of_quantity(rows: Columns, quantity: str) -> Columns:
    """The rows of a quantity."""
    some = rows["quantity"] == quantity
    return {name: column[some] for name, column in rows.items()}


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    """For each end and crossing its mode, the limit and the stiffness felt there, each with the
    numbers that matter most."""
    ends = []
    for rows in ends_of(columns):
        limit = _limit(_of_quantity(rows, "end"))
        felt = _limit(_of_quantity(rows, "felt"))
        ends.append(
            {name: plain(rows[column][0]) for name, column in _OF_END.items()}
            | {"limit": limit, "felt": felt}
        )
    return {
        "along": dict(facts["along"]),
        "stable_intervals": [list(interval.values()) for interval in facts["intervals"]],
        "slices": dict(facts["slices"]),
        "open": list(facts["open"]),
        "doubts": dict(facts["doubts"]),
        "rows": len(columns["doubt"]),
        "doubtful_rows": counted_doubts(columns["doubt"]),
        "ends": ends,
    }


def _limit(rows: Columns) -> Numbers | None:
    """Value, unit, doubt, and elasticities, the largest first; those of falling numbers where they
    are others; None if there is no such limit."""
    if not len(rows["number"]):
        return None
    sizes = np.fmax(np.abs(rows["elasticity"]), np.abs(rows["elasticity_down"]))
    order = np.argsort(-sizes, kind="stable")
    known = [row for row in order.tolist() if not np.isnan(rows["elasticity"][row])]
    up: dict[str, float] = {}
    down: dict[str, float] = {}
    for row in known[:3]:  # numbers that are named
        number = str(rows["number"][row])
        up[number] = float(rows["elasticity"][row])
        falling = float(rows["elasticity_down"][row])
        if f"{falling:.6g}" != f"{up[number]:.6g}" and not np.isnan(falling):
            down[number] = falling
    return {
        "value": float(rows["limit_value"][0]),
        "unit": str(rows["unit"][0]),
        "doubts": counted_doubts(rows["doubt"]),
        "elasticities": up,
        "elasticities_down": down,
    }


def _lines(found: Numbers) -> Iterator[Line]:
    axis, spans = found["along"], found["stable_intervals"]
    name, unit = axis["name"], _unit(axis["unit"])
    searched = f"{span_in_words(axis['from'], axis['to'])}{unit}"
    places = "".join(f", {open_in_words(place, unit)}" for place in found["open"])
    if spans:
        yield (
            f"{name}: stable from {' and '.join(span_in_words(*span) for span in spans)}{unit}{places}",
            False,
        )
    elif not found["doubts"]:
        yield f"{name}: no stable interval in {searched}", True
    if found["doubts"]:
        if spans:
            none = ""
        else:
            none = f", and no stable interval is known in {searched}{places}"
        yield (
            f"{name}: not certified ({', '.join(found['doubts'])}), so no derivatives are given{none}",
            True,
        )
    if spans and not found["ends"]:
        yield f"stability sets no end of it in the range, {searched}", False
    for end in found["ends"]:
        yield from _end_lines(name, end)
    yield from in_doubt(found["doubtful_rows"], found["rows"], "not certified", "derivative")


def _inside(end: Numbers, value: float) -> str:
    """A value at an end of an interval, rounded as the end is, into the interval."""
    if end["end"] == "low":
        return rounded_up(value)
    return rounded_down(value)


def _end_lines(name: str, end: Numbers) -> Iterator[Line]:
    limit, felt = end["limit"], end["felt"]
    if end["corner"]:
        corner = f", crossing {end['crossing'] + 1} of a corner"
    else:
        corner = ""
    mode = mode_words(end["omega"], end["line_hz"], end["second_hz"])
    damped = ""
    if end["damping_ratio"] is not None:
        damped = f", damping ratio {end['damping_ratio']:.3g} just inside"
    yield (
        f"{end['end']} end, {name} = {_inside(end, limit['value'])}{_unit(limit['unit'])}{corner}: set by {mode}{damped}",
        False,
    )
    if end["states"]:
        yield f"  states that take part: {end['states']}", False
    yield _moves(limit)
    if limit["elasticities_down"]:
        yield (
            f"  {_moves_down(limit)} (another change, since a dead time is a whole number of ticks)",
            False,
        )
    if felt is not None:
        line, warning = _moves(felt)
        if felt["elasticities_down"]:
            line = f"{line}, {_moves_down(felt)}"
        said = felt["value"] == limit["value"] == 0  # a limit of 0 has no changes in per cent
        warning = warning and not said
        yield (
            f"  felt there: {_inside(end, felt['value'])}{_unit(felt['unit'])}{'' if said else ';' + line.removeprefix(' ')}",
            warning,
        )


def mode_words(omega: float | None, hz: float | None, second_hz: float | None) -> str:
    """A mode with the frequencies that a spectrum shows of it, of which the strongest may be an
    image of that per frame."""
    if omega is None or hz is None:
        return "a mode that is not known"
    second = f" and {second_hz:.4g} Hz" if second_hz else ""
    if not isclose(2 * pi * hz, omega, rel_tol=1e-6, abs_tol=1e-9):
        if omega:
            once = f"once a frame {omega / (2 * pi):.4g} Hz"
        else:
            once = "none from frame to frame"
        return f"an oscillation of {hz:.4g} Hz{second} within the frame ({once})"
    if omega:
        return f"an oscillation of {omega:.5g} rad/s ({hz:.4g} Hz{second})"
    within = f", with one of {second_hz:.4g} Hz within it" if second_hz else ""
    return f"a mode without oscillation from frame to frame{within}"


def _moves(limit: Numbers) -> Line:
    """The sentence about the numbers that matter most."""
    moving = {
        number: value
        for number, value in limit["elasticities"].items()
        if abs(value) >= LEAST_ELASTICITY or number in limit["elasticities_down"]
    }
    if moving:
        return f"  {_changes(moving, 'more', 1)}", False
    if limit["doubts"]:
        return f"  no elasticities ({', '.join(limit['doubts'])})", True
    if limit["value"] == 0:
        return (
            "  the limit is 0, which has no changes in per cent; the column slope has its derivatives",
            False,
        )
    return "  no number of the loop moves it", False


def _moves_down(limit: Numbers) -> str:
    """The numbers that move a limit in another way if they fall."""
    return _changes(limit["elasticities_down"], "less", -1)


def _changes(elasticities: Mapping[str, float], than: str, sign: int) -> str:
    """What 1 % more (sign 1) or less (-1) of each number does."""
    verb = " moves it"
    changes = []
    for number, elasticity in elasticities.items():
        way = "up" if sign * elasticity > 0 else "down"
        change = f"{way} by {in_digits(abs(elasticity), 3)} %"
        if abs(elasticity) < LEAST_ELASTICITY:
            change = "not at all"
        changes.append(f"1 % {than} {number}{KEPT.get(number, '')}{verb} {change}")
        verb = ""
    return ", ".join(changes)


def _unit(unit: str) -> str:
    if unit in ("", "1"):
        return ""
    return f" {readable(unit)}"


def _again(facts: Mapping[str, Any], _: Callable[[], str]) -> Recompute:
    from wavesweep.program.spec import load

    spec = load(facts["spec"])
    return Recompute(spec.sha256, why(spec, facts["along"]["name"]).blocks)


KINDS = (
    whole_kind(
        "why",
        _numbers,
        _lines,
        "wavesweep.sensitivity.figure.why",
        again=_again,
        vouched=("limit_value",),
    ),
)
