"""The modes of a loop, of its own numbers or over a range of one of them: the table `poles`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns
from wavesweep.program.number_words import in_time, lasting, rounded_down, rounded_up
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.tables.kind import (
    Line,
    Numbers,
    count,
    from_spec,
    in_doubt,
    plain,
    whole_kind,
)
from wavesweep.program.tables.table import Table, facts_of

LOCUS = 300  # values of the number by default
MOST_MODES_NAMED = 8  # modes that the summary names
METHOD = (
    "eigenvalues of the frame in double precision, and whether rounding can move one across the circle by the smallest "
    "singular value there; the line of a mode by following it through the ticks of a frame; ends as stable intervals have them"
)


End = tuple[float, list[float], list[float], float, bool, str]


def poles(spec: Spec, number: str = "") -> Table:
    """The poles of the spec's own loop, or those over the range of a number.

    Errors: UsageError for a name that is not that of a number, SpecError for a range that the spec
    does not take.
    """
    from wavesweep.program.spec.loading import naming

    if not number:
        return over(naming(spec, []))
    spec = naming(spec, [number])
    return over(spec, axis_over(spec, number))


def over(spec: Spec, axis: Axis | None = None) -> Table:
    """The same over the values of an axis."""
    from wavesweep.program.analyses.assumptions import over_preset
    from wavesweep.program.analyses.claims import own_figures
    from wavesweep.program.analyses.poles import poles as poles_of
    from wavesweep.program.sweep.grid import own_loop

    started = time.perf_counter()
    columns = poles_of(spec, axis)
    own_loops = own_loop(spec)
    drawn = own_loops.drawn()
    drift = own_loops.drift_of_frames()
    labels = drawn.labels()
    left_out = sorted({*drift.leads, *drift.varying, *drift.unobserved})
    notices = []
    if left_out:
        gone = ", ".join(labels[drift.states[at]] for at in left_out)
        notices.append(f"left out, since nothing in the loop holds or reads it: {gone}")
    timings = {"compute_s": time.perf_counter() - started}
    notices += over_preset(spec)
    doubted = columns["doubt"] != ""
    if axis:
        loops = len(axis.values)
        certified = loops - np.unique(columns[axis.name][doubted]).size
        swept = [axis.path]
    else:
        loops = 1
        certified = int(not doubted.any())
        swept = []
    counts = {"computed": loops, "skipped": 0, "certified": certified}
    claims = own_figures([spec], "modes")
    facts = facts_of(spec, {"poles": METHOD}, counts, timings, notices, swept, claims=claims)
    facts["over"] = axis.name if axis else ""
    facts["period_s"] = float(drawn.period * drawn.ticks)
    facts["ends"] = ends_on_circle(spec, axis) if axis else []
    return Table.of("poles", columns, facts)


def axis_over(spec: Spec, name: str) -> Axis:
    """The values of a root locus: over the range of a number in [sweep], from the least to the
    largest of a list, or in which `check` looks. A number that decides how the loop is built has
    the values of its list alone. Errors: UsageError."""
    from wavesweep.program.analyses.asked import axes_asked, key_named
    from wavesweep.program.analyses.own_design import searched

    key = key_named(spec, name)
    of_sweep = [axis for axis in spec.sweep if axis.path == key.path]
    listed = of_sweep[0].values if of_sweep else ()
    if listed and of_sweep[0].structural:
        return of_sweep[0]
    logarithmic = False
    if of_sweep and of_sweep[0].start < of_sweep[0].stop:
        start = of_sweep[0].start
        stop = of_sweep[0].stop
        logarithmic = of_sweep[0].scale == "log"
    else:
        start, stop = searched(spec, name, key.path)
    if logarithmic:
        values = np.geomspace(start, stop, LOCUS)
    else:
        values = np.linspace(start, stop, LOCUS)
    if key.type == "integer":
        values = np.unique(values.round().astype(int))
    (axis,) = axes_asked(spec, {name: values})
    return axis


def ends_on_circle(spec: Spec, axis: Axis) -> list[End]:
    """Ends of stable intervals between the least and the largest value of an axis: the value, real
    and imaginary parts of the poles there that are on the unit circle, the strongest line of their
    oscillation (Hz), whether the end is certified, and whether it is the low or the high one.

    None of a number that decides how the loop is built, or without a range.
    """
    from wavesweep.program.analyses.interval_jobs import job_over
    from wavesweep.program.analyses.poles import ON_CIRCLE
    from wavesweep.program.analyses.poles import poles as poles_of
    from wavesweep.program.sweep.grid import make_grid
    from wavesweep.program.sweep.running import in_memory

    if axis.structural or not axis.start < axis.stop:
        return []
    rows = in_memory(job_over(make_grid(spec, (), axis.path), replace(axis, values=())))
    ends = []
    for end in ("low", "high"):
        set_by_stability = np.isfinite(rows[end]) & np.isfinite(rows[f"{end}_omega"])
        for row in np.flatnonzero(set_by_stability):
            value = float(rows[end][row])
            there = poles_of(spec.with_values({axis.path: value}))
            on_circle = np.abs(there["radius"] - 1) <= ON_CIRCLE
            if not on_circle.any():  # what drifts there is left out
                continue
            z_re = there["z_re"][on_circle].tolist()
            z_im = there["z_im"][on_circle].tolist()
            hz = float(rows[f"{end}_hz"][row])
            ends.append((value, z_re, z_im, hz, bool(rows["certified"][row]), end))
    return sorted(ends, key=lambda each: each[0])


def modes(columns: Columns) -> Iterator[dict[str, Any]]:
    """Yield each mode of one loop, a pair of poles as one, in their order."""
    for row in range(len(columns["radius"])):
        if not columns["z_im"][row] < 0 and not np.isnan(columns["radius"][row]):
            yield {name: plain(column[row]) for name, column in columns.items()}


def in_words(mode: Mapping[str, Any]) -> str:
    """A mode as a line of a summary."""
    if not mode["radius"]:
        return f"over within a frame: {mode['states']}"
    hz = mode["shown_hz"]
    rings = "no oscillation"
    if hz:
        rings = f"{hz:.4g} Hz"
        if mode["second_hz"]:
            rings += f" and {mode['second_hz']:.4g} Hz"
        image = mode["frequency_hz"]
        if abs(hz - image) > 1e-6 * hz:
            rings += f" (once a frame {image:.4g} Hz)"
        ratio = mode["shown_damping_ratio"] + 0.0  # of -0: 0
        rings += f", damping ratio {ratio:.3g}"
    tau = mode["time_constant_s"]
    decays = "stays"
    if tau is not None:
        decays = lasting(tau)
    if mode["doubt"]:
        decays += f", {mode['doubt']} hides whether it is stable"
    elif not mode["stable"]:
        decays += ", UNSTABLE"
    return f"{rings}, {decays}: {mode['states']}"


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    name = facts["over"]
    doubted = columns["doubt"] != ""
    words, counts = np.unique(columns["doubt"][doubted].astype(str), return_counts=True)
    doubts = dict(zip(words.tolist(), counts.tolist(), strict=True))
    poles_found = len(columns["radius"])
    tally = {
        "period_s": facts["period_s"],
        "poles": poles_found,
        "doubts": doubts,
        "over": name or None,
    }
    if not name:
        return tally | {"modes": [*modes(columns)]}
    values = np.unique(columns[name])
    span = {"from": plain(values[0]), "to": plain(values[-1]), "values": int(values.size)}
    ends = []
    for value, _, _, hz, certified, *side in facts["ends"]:  # earlier tables have no side
        ends.append({"value": value, "hz": hz, "certified": certified, "low": side == ["low"]})
    return tally | span | {"ends": ends}


def _lines(found: Numbers) -> Iterator[Line]:
    per = f"per frame of {in_time(found['period_s'])}"
    if found["over"]:
        span = f"{found['values']} values of {found['over']}, {found['from']:g} to {found['to']:g}"
        yield f"{count(found['poles'], 'pole')} {per} at {span}", False
        for end in found["ends"]:
            value = rounded_up(end["value"]) if end["low"] else rounded_down(end["value"])
            place = f"{found['over']} = {value}, {end['hz']:.4g} Hz"
            doubt = "" if end["certified"] else ", not certified"
            yield f"  a stable interval ends at {place}{doubt}", bool(doubt)
    else:
        yield f"{count(found['poles'], 'pole')} {per}", False
        for mode in found["modes"][:MOST_MODES_NAMED]:
            yield f"  {in_words(mode)}", not mode["stable"]
        if len(found["modes"]) > MOST_MODES_NAMED:
            faster = count(len(found["modes"]) - MOST_MODES_NAMED, "faster mode")
            yield f"  and {faster}, which the table has", False
    doubts = dict(found["doubts"])
    if overflows := doubts.pop("overflow", 0):
        yield f"not known at {count(overflows, 'value')} (overflow)", True
    yield from in_doubt(doubts, found["poles"], "not known to be stable or unstable", "pole")


KINDS = (
    whole_kind(
        "poles", _numbers, _lines, "wavesweep.poles.figure.poles", again=from_spec(poles, "over")
    ),
)
