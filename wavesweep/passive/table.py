"""Passivity of the wave channel and of the hand's port over a sweep: `passivity`."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import prod
from numbers import Real
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from wavesweep.engine.errors import UsageError
from wavesweep.passive.port_rows import LEAST_INDEX
from wavesweep.program.analyses.assumptions import notices_of
from wavesweep.program.analyses.claims import own_figures
from wavesweep.program.columns import Columns, joined
from wavesweep.program.number_words import rounded_down, rounded_up
from wavesweep.program.tables.columns import at_port
from wavesweep.program.tables.interval_table import interval_kind
from wavesweep.program.tables.kind import Kind, Line, Numbers, SingleBlockSummary, count, from_spec
from wavesweep.program.tables.table import Table, facts_of, spans_held

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec
    from wavesweep.program.sweep.running import Run, WorkOptions

# J per J sent that aliasing may add for the channel to pass for passive in a verdict
ALIASING_ALLOWED = 1e-3
METHODS = {
    "channel": "H-infinity norm by levels: the level just above it is met at no frequency (symplectic pencil of a frame)",
    "port": "least eigenvalue of the Hermitian part by levels, the level just below it met at no frequency",
}


def passivity(
    spec: Spec, tolerance: float = ALIASING_ALLOWED, **work: Unpack[WorkOptions]
) -> Table:
    """Channel norm and port margin for every combination of the axes of [sweep] that have values.

    An axis that has only a span is not swept. Nothing is computed twice: the norm depends on
    filters and rates, the margin on the keys that the controller reads. tolerance: J per J sent
    that aliasing may add, for the verdicts of the summary. work: jobs, backend, scheduler,
    progress, checkpoint and force, see `Work`. Raises UsageError, and the errors of `run`.
    """
    from wavesweep.passive.port_jobs import certified_slices, jobs_of, not_computed
    from wavesweep.program.sweep.running import Work, run

    _refuse_tolerance(tolerance)
    axes = tuple(axis for axis in spec.sweep if axis.values)
    done = run(jobs_of(spec, axes), Work.of(work))
    grid = done.jobs["port"].grid
    counts = {"computed": grid.loops, "skipped": grid.size - grid.loops}
    counts["certified"] = certified_slices(done)
    methods = METHODS | ({"damping_needed": "not computed"} if not_computed(grid) else {})
    facts = facts_of(
        spec,
        methods,
        counts,
        done.timings,
        _notices(grid),
        [axis.path for axis in axes],
        claims=own_figures([spec], "energies at the ports"),
    )
    facts |= {"warnings": done.warnings, "tolerance": tolerance}
    return Table(
        "passivity",
        lambda: map(KINDS[0].ordered, _blocks(done)),
        facts,
        forget=done.forget,
        rows=done.rows,
    )


def passive_along(
    spec: Spec, along: str, tolerance: float = ALIASING_ALLOWED, **work: Unpack[WorkOptions]
) -> Table:
    """The intervals of a number with a passive port, and with a passive wave channel if there is
    one, beside the stable ones.

    along: the axis of the intervals; the others of [sweep] that have values are swept. tolerance,
    work: as for `passivity`.
    """
    from wavesweep.passive.port_jobs import sends_waves
    from wavesweep.program.tables.hand_rows import hands_of
    from wavesweep.program.tables.interval_table import intervals

    _refuse_tolerance(tolerance)
    words = ["ports"] * bool(spec.drawing and spec.drawing.environment)
    hands = hands_of(
        ["port", *words, *([f"channel:{float(tolerance)!r}"] if sends_waves(spec) else [])]
    )
    table = intervals(spec, along=along, hands=hands, **work)
    return replace(
        table, kind="passivity-along", facts={**table.facts, "along": along, "tolerance": tolerance}
    )


def over_frequency(spec: Spec) -> Table:
    """Llewellyn's index and the damping that both ports could do without, over frequency, for
    every combination of the axes."""
    from wavesweep.passive.port_jobs import curves

    started = time.perf_counter()
    axes = tuple(axis for axis in spec.sweep if axis.values)
    columns = joined(curves(spec, axes))
    methods = {
        "ports": "least eigenvalue of the Hermitian part with balanced weights, at each frequency"
    }
    counts = {"computed": columns["llewellyn"].size, "skipped": 0, "certified": 0}
    facts = facts_of(
        spec,
        methods,
        counts,
        {"compute_s": time.perf_counter() - started},
        (),
        [axis.path for axis in axes],
        claims=own_figures([spec], "energies at the ports"),
    )
    return Table.of("passivity-ports", columns, facts)


def in_memory(spec: Spec, axes) -> Columns:
    """The table over `axes`, computed in this process."""
    from wavesweep.passive.port_jobs import jobs_of
    from wavesweep.program.sweep.running import Work, run

    return joined(_blocks(run(jobs_of(spec, axes), Work(jobs=1))))


def _blocks(found: Run) -> Iterator[Columns]:
    """Yield the rows in blocks."""
    from wavesweep.passive.port_jobs import blocks

    for axes, columns in blocks(found):
        columns |= {
            name.replace("_omega", "_hz"): column / (2 * np.pi)
            for name, column in columns.items()
            if "_omega" in name
        }
        shown = {
            field.name: np.ascontiguousarray(columns[field.name])
            for field in KINDS[0].fields
            if field.name in columns
        }
        yield axes | shown


def _notices(grid) -> Iterator[str]:
    """Yield notices about axes that are not swept, and about a missing channel."""
    from wavesweep.passive.port_jobs import not_computed, sends_waves

    yield from notices_of(grid)
    yield from spans_held(grid.spec)
    yield from not_computed(grid)
    if not grid.spec.drawing and not sends_waves(grid.spec):
        missing = "the column channel_norm is empty, and channel_passive is 1"
        yield f"{grid.spec.kind} has no wave channel: {missing}"


def _refuse_tolerance(tolerance):
    if not (
        isinstance(tolerance, Real) and not isinstance(tolerance, bool) and 0 <= tolerance < np.inf
    ):
        raise UsageError(
            f"tolerance: expected a finite number >= 0 (J per J sent), found {tolerance!r}"
        )


class PassivityTally:
    """Counts the passive rows, and keeps the ranges of norm, margin and further damping; facts:
    those of the run."""

    def __init__(self, facts: Mapping[str, Any]) -> None:
        self._tolerance, self._slices = facts["tolerance"], facts["slices"]
        self._damped = "damping_needed" not in facts["methods"]  # otherwise it is not known
        self._counts: Counter[str] = Counter()
        self._ranges: dict[str, list[float] | None] = dict.fromkeys(
            ("channel_norm", "port_margin", "damping_needed", "ports_margin")
        )

    def add(self, columns: Columns) -> None:
        """Count the rows of a block that are passive, unstable and so on, and widen the ranges of numbers
        by it."""
        needed = columns["damping_needed"]
        passive = columns["channel_passive"]
        nearly = columns["channel_norm"] ** 2 - 1 <= self._tolerance
        flags = {
            "rows": np.ones(needed.size, bool),
            "channel_passive_within_tolerance": nearly | passive,
            "channel_passive": passive,
            "port_passive": columns["port_passive"],
            "no_damping_is_enough": np.isnan(needed) & self._damped,
            "absolutely_stable": columns.get("absolutely_stable", np.zeros(0)),
            "ports_proved": columns.get("ports_certified", np.zeros(0)),
            "margin_unknown": np.isnan(columns["port_margin"]),
            "unstable": ~columns["stable"],
        }
        self._counts.update({name: int(flag.sum()) for name, flag in flags.items()})
        values = {name: columns.get(name, np.zeros(0)) for name in self._ranges}
        values["damping_needed"] = needed[needed > 0]
        for name, column in values.items():
            ends = [*(self._ranges[name] or ()), *(_range(column) or ())]
            self._ranges[name] = _range(np.array(ends))

    def numbers(self, facts: Mapping[str, Any]) -> Numbers:
        order = ("rows", "tolerance", "channel_norm", "channel_passive_within_tolerance", "channel_passive", "port_passive",
                 "port_margin", "margin_unknown", "damping_needed", "no_damping_is_enough", "absolutely_stable", "ports_proved",
                 "ports_margin", "unstable", "slices")  # fmt: skip
        tally = {
            **self._counts,
            **self._ranges,
            "tolerance": self._tolerance,
            "slices": dict(self._slices),
        }
        units = {"port_margin": at_port("m/N", facts), "damping_needed": at_port("N*s/m", facts)}
        return {name: tally[name] for name in order} | {"units": units}


def _lines(found: Numbers) -> Iterator[Line]:
    rows = count(found["rows"], "row")
    if found["channel_norm"]:
        within = f"{100 * found['tolerance']:g} % of energy in {found['channel_passive_within_tolerance']} of {rows}"
        norm = _span(found["channel_norm"], rounded_up)
        yield (
            f"wave channel: passive to within {within}, strictly in {found['channel_passive']}; norm {norm}",
            False,
        )
    if found["port_margin"]:
        reach = (
            f"; margin {_span(found['port_margin'], rounded_down)} {found['units']['port_margin']}"
        )
    else:
        reach = ""
    port = "hand's port, its force held over a tick"
    yield f"{port}: passive in {found['port_passive']} of {rows}{reach}", False
    if found["margin_unknown"]:
        yield (
            f"margin lost in rounding or overflow, and not known to be passive: {count(found['margin_unknown'], 'row')}",
            True,
        )
    if found["damping_needed"]:
        needed, unit = (
            _span(found["damping_needed"], rounded_up, 3),
            found["units"]["damping_needed"],
        )
        yield f"further damping of the device that makes it passive: {needed} {unit}", False
    if found["no_damping_is_enough"]:
        yield (
            f"no damping of the device makes it passive in {count(found['no_damping_is_enough'], 'row')}",
            False,
        )
    if found["ports_margin"]:
        margin, unit = (
            _span(found["ports_margin"], rounded_down, 6),
            found["units"]["damping_needed"],
        )
        yield (
            f"both ports: absolutely stable in {found['absolutely_stable']} of {rows}; margin {margin} {unit}",
            False,
        )
        if open_ := found["rows"] - found["ports_proved"] - found["unstable"]:
            yield f"not known at both ports: {count(open_, 'row')}", True
    if found["unstable"]:
        yield (
            f"not stable in the first place, or not known to be: {count(found['unstable'], 'row')}",
            True,
        )
    slices = found["slices"]
    if slices["certified"] < slices["computed"]:
        yield (
            f"{slices['computed'] - slices['certified']} of {count(slices['computed'], 'loop')} not certified",
            True,
        )


def _index_numbers(columns: Columns, _: Mapping[str, Any]) -> Numbers:
    worst = int(columns["llewellyn"].argmin())
    return {
        "llewellyn": float(columns["llewellyn"][worst]),
        "frequency_hz": float(columns["frequency_hz"][worst]),
    }


def _index_lines(found: Numbers) -> Iterator[Line]:
    least = f"at least {rounded_down(found['llewellyn'])}"
    if found["llewellyn"] < 1.00001 * LEAST_INDEX:
        least = f"at most {LEAST_INDEX}, the least that is looked for,"
    yield f"Llewellyn's index: {least} of those computed, at {found['frequency_hz']:.4g} Hz", False


def _range(values: np.ndarray) -> list[float] | None:
    """The least and the largest value; None if none is known."""
    finite = values[~np.isnan(values)]
    if finite.size:
        return [float(finite.min()), float(finite.max())]
    return None


def _span(ends: list[float], bound: Callable[[float, int], str], digits: int = 7) -> str:
    """From the least to the largest of some bounds."""
    return " to ".join(dict.fromkeys(bound(end, digits) for end in ends))


KINDS = (
    Kind(
        "passivity",
        lambda table: PassivityTally(table.facts),
        _lines,
        figure="wavesweep.passive.figure.passivity",
        again=from_spec(
            partial(passivity, jobs=1),
            "tolerance",
            rows=lambda spec: prod(len(axis.values) or 1 for axis in spec.sweep),
        ),
    ),
    Kind(
        "passivity-ports",
        lambda _: SingleBlockSummary(_index_numbers),
        _index_lines,
        figure="wavesweep.passive.figure.passivity_ports",
        again=from_spec(over_frequency),
    ),
    interval_kind("passivity-along", None),
)
