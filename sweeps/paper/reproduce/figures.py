"""All tables of the paper: its figures, each from its specs and in the paper's axes, then the studies and the statements."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from reproduce import open_choices, passive_bank, verdicts
from reproduce.documents import bank_text, choices_text, statements_text
from reproduce.drawing import Line, Panel, Plane, draw_magnitudes, draw_planes
from reproduce.felt_responses import CONTROLLERS, HIGH, LOW, LOW_OF_FIGURE_2, METHODS, WHOLE, joined, respond
from reproduce.paper_loops import PaperLoops
from reproduce.specs import load_paper
from reproduce.statements import STATEMENTS
from wavesweep.program.plots import with_figure
from wavesweep.program.plots.labels import symbol, valued
from wavesweep.program.results import fields_of
from wavesweep.program.tables.interval_table import intervals
from wavesweep.program.tables.response_table import responses
from wavesweep.program.tables.table import Table, facts_of


def _named(name: str, table: Table, draw: Callable[[], Any] | None) -> Table:
    """Give a table of a kind that `results` knows a name of its own, and its figure."""
    facts = {**table.facts, "drawn_by": "python sweeps/paper/reproduce"}
    named = replace(table, kind=name, fields=fields_of(table.kind, table.columns), facts=facts)
    return named if draw is None else with_figure(named, draw)


def figure_2(_: PaperLoops) -> list[Table]:
    """Admittance for four wave impedances."""
    run = responses([load_paper(name) for name in ("fig2", "dc")])
    pmw = run.columns["controller"] == "pmw"
    family = [
        _line(valued("b", b), run.columns, pmw & (run.columns["b"] == b), shade=shade)
        for shade, b in enumerate(np.unique(run.columns["b"][pmw]))
    ]
    direct = np.flatnonzero(run.columns["controller"] == "dc")
    lines = [*family, _line("DC", run.columns, direct, ideal=True)]
    return [_named("fig2", run, _magnitudes(lines, (LOW_OF_FIGURE_2, WHOLE)))]


def figure_4(_: PaperLoops) -> list[Table]:
    """Z-width of passive multirate wave control, by both sets of inferred values."""
    runs = {name: intervals(load_paper(name)) for name in ("fig4", "fig4-b25")}
    plane = Plane("", "B_VE", [(_choices(name), run.columns, run.facts) for name, run in runs.items()], 2000.0, (1.0, 800.0))
    draw = partial(draw_planes, [plane])
    return [_named(name, run, draw if name == "fig4" else None) for name, run in runs.items()]


def _choices(name: str) -> str:
    values = load_paper(name).values
    return f"{name}: {symbol('b')} = {values['controller.b']:g}, delay {values['environment.delay']}"


def figure_5(_: PaperLoops) -> list[Table]:
    """Stability region with the local model, the wall integrated implicitly and explicitly."""
    runs = {name: intervals(load_paper(name)) for name in ("fig5", "fig5-explicit")}
    planes = [
        Plane(f"{name}: {_integration(run)} wall", "K_LM", _by_gain(run), 3000.0, note=_without_limit(run))
        for name, run in runs.items()
    ]
    draw = partial(draw_planes, planes)
    return [_named(name, run, draw if name == "fig5" else None) for name, run in runs.items()]


def _integration(run: Table) -> str:
    return run.facts["spec"]["environment"]["integration"]


def _without_limit(run: Table) -> str:
    """Give the note that a region without limit needs, since it fills its panel."""
    free = np.isnan(run.columns["high_omega"]) & (run.columns["low"] == 0) & (run.columns["intervals"] == 1)
    if not free.all():
        return ""
    return f"stable up to {symbol('K_VE')} = {run.columns['high'].min():g} N/m"


def _by_gain(run: Table) -> list:
    columns = run.columns
    rows = {Kp: columns["Kp"] == Kp for Kp in np.unique(columns["Kp"])}
    return [(valued("Kp", Kp), {n: c[of] for n, c in columns.items()}, run.facts) for Kp, of in rows.items()]


def figure_6(_: PaperLoops) -> list[Table]:
    """Admittance with the local model, without it, and the ideal."""
    run = responses([load_paper(name) for name in ("fig6", "pmw", "dc")])
    return [_named("fig6", run, _magnitudes(_three(run.columns), (LOW, HIGH)))]


def figure_7(paper: PaperLoops) -> list[Table]:
    """Admittance as the simulated experiment shows it."""
    started = time.perf_counter()
    columns = joined([paper.experiment(name) for name in CONTROLLERS])
    timings = {"compute_s": time.perf_counter() - started}
    facts = facts_of(load_paper("fig7").asking("simulate"), METHODS, {"computed": 3, "skipped": 0, "certified": 0}, timings)
    lines = [*_analysis(), *_three(columns, dots=True)]
    run = Table.of("simulate-response", columns, facts)
    return [_named("fig7", run, _magnitudes(lines, (LOW, (LOW[1], 2 * np.pi))))]


def _analysis() -> list[Line]:
    """The linear analysis of Figure 7's loops, dense enough for a line."""
    lines = []
    for hue, (name, overrides) in enumerate(CONTROLLERS.items()):
        found = respond(load_paper("fig7", overrides), np.linspace(0.1, 49.9, 499))
        lines.append(Line("", found.omega, 1e3 * np.abs(found.admittance), ideal=name == "DC", hue=hue))
    return lines


def figure_8(_: PaperLoops) -> list[Table]:
    """Transmitted impedance with the local model, without it, and the ideal."""
    run = responses([load_paper(name) for name in ("fig8", "pmw", "dc")])
    lines, level = _three(run.columns, "impedance_abs"), load_paper("fig8").values["environment.K_VE"]
    panels = (Panel(LOW, logarithmic=False), Panel(WHOLE, logarithmic=True))
    draw = partial(draw_magnitudes, lines, panels, "transmitted impedance (N/m)", level=(level, symbol("K_VE")))
    return [_named("fig8", run, draw)]


def _three(columns: Mapping[str, np.ndarray], name: str = "admittance_abs", *, dots: bool = False) -> list[Line]:
    lines = []
    for hue, label in enumerate(CONTROLLERS):
        rows = columns["controller"] == label.lower().replace("+", "-")
        lines.append(_line(label, columns, rows, name, ideal=label == "DC", hue=hue, dots=dots))
    return lines


def _line(label: str, columns: Mapping[str, np.ndarray], rows, name: str = "admittance_abs", **style) -> Line:
    """One curve, the rows in order of frequency. If the loop ignores an axis, its repeated rows are dropped."""
    omega, first = np.unique(columns["omega_Ts"][rows], return_index=True)
    scale = 1e3 if "admittance" in name else 1.0  # mm/N
    return Line(label, omega, scale * columns[name][rows][first], **style)


def _magnitudes(lines: list[Line], bands):
    panels = tuple(Panel(band, logarithmic=False) for band in bands)
    return partial(draw_magnitudes, lines, panels, "transmitted admittance (mm/N)")


FIGURES = (figure_2, figure_4, figure_5, figure_6, figure_7, figure_8)


def tables(progress: Callable[[int, int], None] | None = None) -> Iterator[Table]:
    """Give the tables of the figures, of the open choices, of passive filter banks and, last, of the statements; each is
    computed when the iteration reaches it.

    progress: called with the number of steps done and of all steps.
    """
    paper, done, steps = PaperLoops(), 0, len(FIGURES) + 2 + len(STATEMENTS)

    def step() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done, steps)

    for figure in FIGURES:
        yield from figure(paper)
        step()
    study = open_choices.open_choices()
    yield replace(study, text=choices_text(study.columns))
    step()
    banks = passive_bank.passive_bank()
    yield replace(with_figure(banks, passive_bank.figure()), text=bank_text(banks.columns))
    step()
    judged = verdicts.judge(paper, STATEMENTS, step)
    yield replace(judged, text=statements_text(judged.columns))
