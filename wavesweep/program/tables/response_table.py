"""Frequency responses over specs and axes: the table `bode`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import prod
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.analyses.assumptions import notices_of
from wavesweep.program.analyses.claims import own_figures
from wavesweep.program.columns import SPARED, Columns, axes_of
from wavesweep.program.tables import kind_named
from wavesweep.program.tables.kind import Kind, Line, Numbers, Recompute, count
from wavesweep.program.tables.table import Table, digest_of, facts_of, with_unlike_units

if TYPE_CHECKING:
    from wavesweep.program.spec import Spec
    from wavesweep.program.sweep.job import Job
    from wavesweep.program.sweep.running import Run, WorkOptions

UNITS = {
    "admittance_re": "m/N",
    "admittance_im": "m/N",
    "admittance_abs": "m/N",
    "worst_gain": "m/N",
    "impedance_re": "N/m",
    "impedance_im": "N/m",
    "impedance_abs": "N/m",
}


def responses(specs: Sequence[Spec], **work: Unpack[WorkOptions]) -> Table:
    """Admittance, impedance, worst-case gain and verdict of all specs, for every combination of their [bode] axes.

    Of specs that ask for responses between inputs and outputs (see `Spec.routes`) the table is
    `bode-ports`, with these.

    A spec without one of the axes has its own value in that column, or NaN if its controller does
    not read it. work: jobs, backend, scheduler, progress, checkpoint and force, see `Work`. Raises
    UsageError for a frequency beyond half the fast rate, for specs that mix responses at the hand
    with others, and the errors of `run`.
    """
    from wavesweep.program.analyses.response_jobs import response_job
    from wavesweep.program.sweep.running import Work, run

    if not specs:
        raise UsageError("responses: expected at least one spec, found none")
    axes = [axis.name for spec in specs for axis in spec.bode]
    names = tuple(dict.fromkeys(axes))
    routes = [(spec, route) for spec in specs for route in routes_of(spec)]
    at_hand = {route is None for _, route in routes}
    if len(at_hand) > 1:
        raise UsageError(
            "bode: expected responses at the hand of all specs, or between inputs and outputs of all, found both"
        )
    kind = "bode" if at_hand == {True} else "bode-ports"
    jobs = {}
    for number, (spec, route) in enumerate(routes):
        name = f"spec-{number}" if len(routes) > 1 else ""
        jobs[name] = response_job(spec, spec.bode, spec.frequency_hz, names, route=route)
    result = run(jobs, Work.of(work))
    facts = with_unlike_units(_facts(specs, kind, result), _units(specs, kind, names))
    return Table(
        kind, partial(_blocks, kind, jobs, result), facts, forget=result.forget, rows=result.rows
    )


def _units(
    specs: Sequence[Spec], kind: str, names: Sequence[str]
) -> dict[str, list[tuple[str, str]]]:
    """The unit that each spec has in the columns of the axes and of the responses at the hand."""
    from wavesweep.program.analyses.response_jobs import units_in

    units = {name: units_in([(spec, spec.bode) for spec in specs], name) for name in names}
    if kind == "bode":
        for name, unit in UNITS.items():
            units[name] = [(spec.name, spec.at_port(unit)) for spec in specs]
    return units


def _facts(specs: Sequence[Spec], kind: str, result: Run) -> dict[str, Any]:
    """The facts of a run; a table of responses certifies none."""
    grids = [job.grid for job in result.jobs.values()]
    computed = sum(grid.loops for grid in grids)
    counts = {
        "computed": computed,
        "skipped": sum(grid.size for grid in grids) - computed,
        "certified": 0,
    }
    notices = [notice for grid in grids for notice in notices_of(grid)]
    swept = [axis.path for spec in specs for axis in spec.bode]
    methods = METHODS if kind == "bode" else METHODS_PORTS
    claims = own_figures(specs, "responses")
    facts = facts_of(list(specs), methods, counts, result.timings, notices, swept, claims=claims)
    return facts | {"warnings": result.warnings}


def routes_of(spec: Spec) -> tuple[tuple[str, str] | None, ...]:
    """The routes of a spec, or None for the hand. Errors: SpecError for a drawn loop without either."""
    if spec.drawing and not spec.drawing.hand and not spec.routes:
        lacking = "no input" if not spec.drawing.inputs else "no output"
        expected = "inputs and outputs, or hand = { force = ..., displacement = ... }, whose response is wanted"
        raise SpecError([spec.mistake("ports", expected, lacking)])
    return spec.routes or (None,)


def _blocks(kind: str, jobs: Mapping[str, Job], found: Run) -> Iterator[Columns]:
    """Yield the rows of one spec after the other; a column that some spec has no value for is one of doubles in all rows."""
    from wavesweep.program.analyses.response_jobs import has_values

    rough = set()
    for job in jobs.values():
        for axis in job.asked.names:
            if not has_values(job.grid.spec, job.grid.axes, axis, job.asked.read):
                rough.add(axis)
    for name in jobs:
        for block in found.blocks(name):
            columns = dict(block)
            for axis in rough:
                columns[axis] = columns[axis].astype(float)
            yield kind_named(kind).ordered(columns)


METHODS = {
    "admittance": "closed loop of the frame, displacement in the tick, component at the force's own frequency",
    "worst_gain": "singular values of the lifted map from forces to positions",
    "errors": "residual, rounding of all entries and size of the inverse, entry by entry",
}


METHODS_PORTS = {
    "response": "closed loop of the frame, input held over each tick, component at the input's own frequency",
    "errors": METHODS["errors"],
}


class BodeTally:
    """Counts the rows of a table of responses: curves, frequencies, unstable loops, and rows with other doubts."""

    def __init__(self) -> None:
        self._rows = 0
        self._curves = 0
        self._diverging = 0  # curves of unstable loops
        self._undecided = 0  # curves of loops not known to be stable
        self._doubted = 0
        self._gains = 0  # rows of which the worst gain alone is in doubt
        self._frequencies = np.empty(0)
        self._last: list[np.ndarray] = []
        self._unstable: set[str] = set()
        self._doubts: Counter[str] = Counter()

    def add(self, columns: Columns) -> None:
        """Count a block of rows; a curve is rows with the same values, one after the other."""
        leading = [columns[name] for name in axes_of(columns, "frequency_hz")]
        begins = np.zeros(len(columns["frequency_hz"]), bool)
        for column in leading:
            begins[1:] |= _differ(column[1:], column[:-1])
        begins[:1] = not self._last
        for column, last in zip(leading, self._last, strict=False):
            begins[:1] |= _differ(column[:1], last)
        self._last = [column[-1:] for column in leading]
        self._rows += begins.size
        self._curves += int(begins.sum())
        unstable = columns["doubt"] == "unstable"
        undecided = ~columns["stable"] & ~unstable
        self._diverging += int((begins & unstable).sum())
        self._undecided += int((begins & undecided).sum())
        doubted = np.isin(columns["doubt"].astype(str), ["", "unstable"], invert=True)
        self._doubted += int(doubted.sum())
        if "admittance_error" in columns:
            gains = columns["doubt"] == "rounding"
            for name in ("admittance_error", "impedance_error"):
                gains &= columns[name] <= SPARED
            self._gains += int(gains.sum())
        self._frequencies = np.union1d(self._frequencies, columns["frequency_hz"])
        self._unstable.update(columns["spec"][unstable].tolist())
        self._doubts.update(columns["doubt"][doubted].tolist())

    def numbers(self, _: Mapping[str, Any]) -> Numbers:
        return {
            "rows": self._rows,
            "frequencies": self._frequencies.size,
            "curves": self._curves,
            "unstable_curves": self._diverging,
            "unstable_specs": sorted(self._unstable),
            "undecided_curves": self._undecided,
            "doubted_rows": self._doubted,
            "doubted_worst_gains": self._gains,
            "doubts": dict(sorted(self._doubts.items())),
        }


def _differ(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Where two columns differ; a missing number equals another."""
    numbers = (first == first) | (second == second)  # noqa: PLR0124 - a missing number is unequal to itself
    return np.asarray((first != second) & numbers)


def bode_lines(facts: Numbers) -> Iterator[Line]:
    """Yield what is said of curves, of loops without a steady response, and of rows in doubt."""
    frequencies = "frequency" if facts["frequencies"] == 1 else "frequencies"
    if facts["rows"] != facts["curves"] * facts["frequencies"]:
        frequencies = f"different {frequencies}"
    yield f"{count(facts['curves'], 'curve')} of {facts['frequencies']} {frequencies}", False
    if facts["unstable_specs"]:
        share = f"{facts['unstable_curves']} of {count(facts['curves'], 'curve')}"
        specs = ", ".join(facts["unstable_specs"])
        yield f"{share} of unstable loops, without a steady response (of {specs})", True
    if facts["undecided_curves"]:
        share = f"{facts['undecided_curves']} of {count(facts['curves'], 'curve')}"
        yield f"{share} of loops not known to be stable, see the column doubt", True
    if facts["doubted_worst_gains"]:
        rows = count(facts["doubted_worst_gains"], "row")
        yield f"{rows} without a reliable worst gain, the rest of them reliable", True
    remaining = facts["doubted_rows"] - facts["doubted_worst_gains"]
    if remaining:
        words = ", ".join(facts["doubts"])
        yield f"{count(remaining, 'row')} without a reliable value ({words})", True


def _again(facts: Mapping[str, Any], name: Callable[[], str]) -> Recompute:
    from wavesweep.program.spec import load

    written = facts.get("specs") or {name(): facts["spec"]}
    specs = [replace(load(tables), name=spec_name) for spec_name, tables in written.items()]
    rows = 0
    for spec in specs:
        combinations = prod(len(axis.values) for axis in spec.bode)
        rows += combinations * len(routes_of(spec)) * len(spec.frequency_hz)
    return Recompute(digest_of(specs), lambda: responses(specs, jobs=1).blocks(), rows)


def _kind(name: str, figure: str) -> Kind:
    return Kind(name, lambda _: BodeTally(), bode_lines, figure, _again, study="bode")


KINDS = (
    _kind("bode", "wavesweep.program.plots.response_figures.bode"),
    _kind("bode-ports", "wavesweep.program.plots.response_figures.bode_ports"),
)
