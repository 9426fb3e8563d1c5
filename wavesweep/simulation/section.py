"""The section of a report on a run."""

from collections.abc import Callable, Iterator
from dataclasses import replace

from wavesweep.program.spec import Spec, load
from wavesweep.program.tables.table import Table

TITLE, PLACE = "Simulation", 3


def sections(spec: Spec, _: str) -> Iterator[tuple[str, str, Callable[[], Table]]]:
    """Yield the title, the command of the table, with {} for the spec, and what makes it: with a
    step, unless the spec has another input."""
    from wavesweep.simulation.table import simulate

    if "simulate.input" in spec.given:
        yield TITLE, "simulate {}", lambda: simulate(spec.asking("simulate"))[0]
    else:
        with_step = "simulate {} --set simulate.input=step"
        yield TITLE, with_step, lambda: simulate(_with_step(spec))[0]


def _with_step(spec: Spec) -> Spec:
    """The spec of `simulate` with a step in place of the sine that is the default of a hand's
    force."""
    tables = replace(spec, parts=frozenset({"simulate"})).tables()
    settings = {name: value for name, value in tables["simulate"].items() if name != "frequency_hz"}
    run = load(tables | {"simulate": settings | {"input": "step"}})
    return replace(run, name=spec.name, source=spec.source).asking("simulate")
