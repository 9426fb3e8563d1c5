"""The modes of a loop, of its own numbers or over a range of one of them: the table `poles`."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wavesweep.program.columns import Columns
from wavesweep.program.spec import Axis, Spec
from wavesweep.program.tables.kind import Line, Numbers, count, from_spec, in_doubt, plain, whole_kind
from wavesweep.program.tables.table import Table, facts_of

LOCUS = 300  # values of the number by default
MOST = 8  # modes that the summary names
METHOD = (
    "eigenvalues of the frame in double precision, and whether rounding can move one across the circle by the smallest "
    "singular value there; the line of a mode by following it through the ticks of a frame; ends as stable intervals have them"
)


End = tuple[float, list[float], list[float], float, bool]


def poles(spec: Spec, number: str = "") -> Table:
    """The poles of the spec's own loop, or those over the range of a number.

    Errors: UsageError for a name that is not that of a number, SpecError for a range that the spec does not take.
    """
    from wavesweep.program.spec.loading import naming

    return over(spec := naming(spec, [number] if number else []), axis_over(spec, number) if number else None)


def over(spec: Spec, axis: Axis | None = None) -> Table:
    """The same over the values of an axis."""
    from wavesweep.program.analyses.assumptions import over_preset
    from wavesweep.program.analyses.poles import poles as poles_of
    from wavesweep.program.sweep.grid import own_loop

    started, columns, own_loops = time.perf_counter(), poles_of(spec, axis), own_loop(spec)
    drawn, drift = own_loops.drawn(), own_loops.drift()
    labels = drawn.labels()
    gone = [labels[drift.states[at]] for at in sorted({*drift.leads, *drift.varying, *drift.unobserved})]
    notices = [f"left out, since nothing in the loop holds or reads it: {', '.join(gone)}"] if gone else []
    timings = {"compute_s": time.perf_counter() - started}
    loops, doubted = len(axis.values) if axis else 1, columns["doubt"] != ""
    certified = loops - np.unique(columns[axis.name][doubted]).size if axis else int(not doubted.any())
    counts = {"computed": loops, "skipped": 0, "certified": certified}
    swept, said = [axis.path] if axis else [], [*notices, *over_preset(spec)]
    facts = facts_of(spec, {"poles": METHOD}, counts, timings, said, swept, nominal=True)
    facts |= {"over": axis.name if axis else "", "period_s": float(drawn.period * drawn.ticks)}
    return Table.of("poles", columns, facts | {"ends": ends_on_circle(spec, axis) if axis else []})


def axis_over(spec: Spec, name: str) -> Axis:
    """The values of a root locus: over the range of a number in [sweep], from the least to the largest of a list, or in which
    `check` looks. A number that decides how the loop is built has the values of its list alone. Errors: UsageError."""
    from wavesweep.program.analyses.asked import axes_asked, key_named
    from wavesweep.program.analyses.own_design import searched

    key = key_named(spec, name)
    of_sweep = [axis for axis in spec.sweep if axis.path == key.path]
    listed = of_sweep[0].values if of_sweep else ()
    if listed and of_sweep[0].structural:
        return of_sweep[0]
    ranged = of_sweep and of_sweep[0].start < of_sweep[0].stop
    start, stop = (of_sweep[0].start, of_sweep[0].stop) if ranged else searched(spec, name, key.path)
    spaced = np.geomspace if ranged and of_sweep[0].scale == "log" else np.linspace
    values = spaced(start, stop, LOCUS)
    (axis,) = axes_asked(spec, {name: np.unique(values.round().astype(int)) if key.type == "integer" else values})
    return axis


def ends_on_circle(spec: Spec, axis: Axis) -> list[End]:
    """Ends of stable intervals between the least and the largest value of an axis: the value, real and imaginary parts of the
    poles there that are on the unit circle, the strongest line of their oscillation (Hz), and whether the end is certified.

    None of a number that decides how the loop is built, or without a range.
    """
    from wavesweep.program.analyses.interval_jobs import job_over
    from wavesweep.program.analyses.poles import ON_CIRCLE
    from wavesweep.program.analyses.poles import poles as poles_of
    from wavesweep.program.sweep.grid import make_grid
    from wavesweep.program.sweep.running import in_memory

    if axis.structural or not axis.start < axis.stop:
        return []
    rows, ends = in_memory(job_over(make_grid(spec, (), axis.path), replace(axis, values=()))), []
    for end in ("low", "high"):
        columns = (rows[name] for name in (end, f"{end}_omega", f"{end}_hz", "certified"))
        for value, omega, hz, certified in zip(*columns, strict=True):
            if np.isfinite(value) and np.isfinite(omega):  # one that stability sets
                there_poles = poles_of(spec.with_values({axis.path: float(value)}))
                on = np.abs(there_poles["radius"] - 1) <= ON_CIRCLE
                ends.append(
                    (
                        float(value),
                        there_poles["z_re"][on].tolist(),
                        there_poles["z_im"][on].tolist(),
                        float(hz),
                        bool(certified),
                    )
                )
    return sorted((end for end in ends if end[1]), key=lambda each: each[0])  # what drifts there is left out


def modes(columns: Columns) -> Iterator[dict[str, Any]]:
    """Yield each mode of one loop, a pair of poles as one, in their order."""
    for row in range(len(columns["radius"])):
        if not columns["z_im"][row] < 0 and not np.isnan(columns["radius"][row]):
            yield {name: plain(column[row]) for name, column in columns.items()}


def in_words(mode: Mapping[str, Any]) -> str:
    """A mode as a line of a summary."""
    hz, ratio, tau, image = (mode[name] for name in ("shown_hz", "shown_damping_ratio", "time_constant_s", "frequency_hz"))
    if not mode["radius"]:
        return f"over within a frame: {mode['states']}"
    second = f" and {mode['second_hz']:.4g} Hz" if mode["second_hz"] else ""
    once = f" (once a frame {image:.4g} Hz)" if hz and abs(hz - image) > 1e-6 * hz else ""
    rings = f"{hz:.4g} Hz{second}{once}, damping ratio {ratio:.3g}" if hz else "no oscillation"
    decays = "stays" if tau is None else f"{'falls to 1/e' if tau > 0 else 'grows by e'} in {abs(tau):.4g} s"
    unknown = f", {mode['doubt']} hides whether it is stable" if mode["doubt"] else "" if mode["stable"] else ", UNSTABLE"
    return f"{rings}, {decays}{unknown}: {mode['states']}"


def _numbers(columns: Columns, facts: Mapping[str, Any]) -> Numbers:
    name = facts["over"]
    tally = {"period_s": facts["period_s"], "poles": len(columns["radius"]), "doubts": {}, "over": name or None}
    words, counts = np.unique(columns["doubt"][columns["doubt"] != ""].astype(str), return_counts=True)
    tally["doubts"] = dict(zip(words.tolist(), counts.tolist(), strict=True))
    if not name:
        return tally | {"modes": [*modes(columns)]}
    values = np.unique(columns[name])
    ends = [{"value": value, "hz": hz, "certified": certified} for value, _, _, hz, certified in facts["ends"]]
    return tally | {"from": plain(values[0]), "to": plain(values[-1]), "values": int(values.size), "ends": ends}


def _lines(found: Numbers) -> Iterator[Line]:
    per = f"per frame of {1e3 * found['period_s']:.6g} ms"
    if found["over"]:
        span = f"{found['values']} values of {found['over']}, {found['from']:g} to {found['to']:g}"
        yield f"{count(found['poles'], 'pole')} {per} at {span}", False
        for end in found["ends"]:
            doubt = "" if end["certified"] else ", not certified"
            yield f"  a stable interval ends at {found['over']} = {end['value']:.6g}, {end['hz']:.4g} Hz{doubt}", bool(doubt)
    else:
        yield f"{count(found['poles'], 'pole')} {per}", False
        for mode in found["modes"][:MOST]:
            yield f"  {in_words(mode)}", not mode["stable"]
        if len(found["modes"]) > MOST:
            yield f"  and {count(len(found['modes']) - MOST, 'faster mode')}, which the table has", False
    doubts = dict(found["doubts"])
    if overflows := doubts.pop("overflow", 0):
        yield f"not known at {count(overflows, 'value')} (overflow)", True
    yield from in_doubt(doubts, found["poles"], "not known to be stable or unstable", "pole")


KINDS = (whole_kind("poles", _numbers, _lines, "wavesweep.poles.figure.poles", again=from_spec(poles, "over")),)
