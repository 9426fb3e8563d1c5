"""The section of a report on a run."""

from collections.abc import Callable
from dataclasses import replace

from wavesweep.program.spec import Spec, load
from wavesweep.program.tables.table import Table

TITLE, PLACE = "Simulation", 3


def section(spec: Spec, _: str) -> tuple[str, Callable[[], Table]]:
    """The command of the table, with {} for the spec, and what makes it: with a step, unless the
    spec has another input."""
    from wavesweep.simulation.table import simulate

    if "simulate.input" in spec.given:
        return "simulate {}", lambda: simulate(spec.asking("simulate"))[0]
    return "simulate {} --set simulate.input=step", lambda: simulate(_with_step(spec))[0]


def _with_step(spec: Spec) -> Spec:
    """The spec of `simulate` with a step in place of the sine that is the default of a hand's
    force."""
    tables = replace(spec, parts=frozenset({"simulate"})).tables()
    settings = {name: value for name, value in tables["simulate"].items() if name != "frequency_hz"}
    run = load(tables | {"simulate": settings | {"input": "step"}})
    return replace(run, name=spec.name, source=spec.source).asking("simulate")
