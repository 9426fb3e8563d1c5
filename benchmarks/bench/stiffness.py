"""Run time against error in the critical stiffness: methods that a user might choose, and this tool."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from bench import rivals, this_tool
from bench.measuring import Pair, Patience, Row, at_first_too
from bench.problems import COLUMNS, PROBLEMS, Intervals, Problem, bundles, checked, digest, references, score
from wavesweep import Spec

PART = "stiffness"
LIBRARY, COMMAND = "this tool", "this tool, whole command"
DECOMPOSITION = "D-decomposition, numpy"
_TOLERANCES = (1e-3, 1e-6, 1e-9, 1e-12)


@dataclass(frozen=True)
class Method:
    """A method `solve(spec, setting)` and its settings: (setting, its name, columns of the problem), in order of cost.

    A grid of N points per axis has N columns; a search has all columns.
    """

    name: str
    solve: Callable[[Spec, Any], Intervals]
    settings: tuple[tuple[Any, str, int], ...]


def _grids(*sizes: int) -> tuple[tuple[Any, str, int], ...]:
    return tuple((size, f"{size} per axis", size) for size in sizes)


def _searches(*tolerances: Any) -> tuple[tuple[Any, str, int], ...]:
    return tuple((each, f"to {each:g} of the range", max(COLUMNS)) for each in tolerances)


def _angles(*numbers: int) -> tuple[tuple[Any, str, int], ...]:
    return tuple((number, f"{number} angles", max(COLUMNS)) for number in numbers)


def _refinements() -> tuple[tuple[Any, str, int], ...]:
    return tuple(((25, each), f"25 points, to {each:g} of the range", max(COLUMNS)) for each in _TOLERANCES)


METHODS = (
    Method("python-control, interconnect per point", rivals.interconnected, _grids(25, 50)),
    Method("python-control, feedback per point", rivals.feedback, _grids(25, 50, 100)),
    Method("numpy, a loop over points", rivals.looped, _grids(25, 50, 100, 200)),
    Method("numpy, batched grid", rivals.batched, _grids(25, 50, 100, 200)),
    Method("bisection, column by column", rivals.bisected, _searches(*_TOLERANCES)),
    Method("bisection, all columns at once", rivals.bisected_together, _searches(*_TOLERANCES)),
    Method("batched grid, refined", rivals.refined, _refinements()),
    Method("python-control, bisection with feedback", rivals.bisected_by_feedback, _searches(1e-2, 1e-6, 1e-9, 1e-10)),
    Method(DECOMPOSITION, rivals.decomposed, _angles(45, 90, 180, 450)),
)


def problems(*, quick: bool) -> tuple[Problem, ...]:
    """The problems that are measured. quick: only the one with the hole."""
    return PROBLEMS[1:2] if quick else PROBLEMS


def rows(problem: Problem, patience: Patience, *, quick: bool) -> Iterator[Row]:
    """Measure every method at every setting. quick: only the smallest problem of each kind."""
    for columns in COLUMNS[:1] if quick else COLUMNS:
        yield _own_row(problem, columns, patience)
    for method in METHODS:
        for setting, name, columns in method.settings[: 1 if quick else None]:
            few = min(COLUMNS) if quick else columns
            yield _row(problem, method, (setting, name, few), patience)
    yield _command_row(problem, min(COLUMNS) if quick else max(COLUMNS), patience)


def _row(problem: Problem, method: Method, chosen: tuple[Any, str, int], patience: Patience) -> Row:
    setting, name, columns = chosen
    spec = problem.ask(columns)
    method.solve(problem.ask(min(COLUMNS)), method.settings[0][0])  # imports
    answers: list[Intervals] = []
    pair = at_first_too(lambda: answers.append(method.solve(spec, setting)), partial(this_tool.library, spec), patience)
    return _measured(problem, (method.name, name), columns, *pair) | _scored(problem, columns, answers[-1])


def _own_row(problem: Problem, columns: int, patience: Patience) -> Row:
    call = partial(this_tool.library, problem.ask(columns))
    table = call()
    pair = at_first_too(call, call, patience)
    drawn = [part.loops.E.shape[0] for part in bundles(problem.ask(columns))]
    shared = "one loop" if sum(drawn) == 1 else f"{sum(drawn)} loops"
    named = (LIBRARY, f"{int(table.certified.sum())} of {len(table)} rows certified, columns of {shared}")
    return _measured(problem, named, columns, *pair) | _scored(problem, columns, this_tool.answer_of(table))


def _command_row(problem: Problem, columns: int, patience: Patience) -> Row:
    answers: list[Intervals] = []
    call = partial(this_tool.library, problem.ask(columns))
    pair = at_first_too(lambda: answers.append(this_tool.command(problem, columns)), call, patience)
    return _measured(problem, (COMMAND, "zwidth --no-plot"), columns, *pair) | _scored(problem, columns, answers[-1])


def _measured(
    problem: Problem, named: tuple[str, str], columns: int, pair: Pair, at_first: Mapping[str, float]
) -> dict[str, Any]:
    return {
        **at_first,
        "part": PART, "problem": problem.name, "method": named[0], "setting": named[1], "size": columns,
        "seconds": pair.first, "seconds_each": pair.first / columns, "ratio": pair.ratio, "yardstick": LIBRARY,
        "pairs": pair.pairs,
    }  # fmt: skip


def _scored(problem: Problem, columns: int, answer: Intervals) -> dict[str, Any]:
    known = references()["intervals"][problem.name]
    truth = checked(known, digest(problem.ask(max(COLUMNS))), problem.title)["columns"]
    span = (0.0, problem.stop)
    return asdict(score(answer, [truth[number] for number in problem.numbers(columns)], span))
