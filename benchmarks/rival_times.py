"""All stable walls of 200 columns: the processor time of this tool, with its certificate, and of other methods beside it.

    OPENBLAS_NUM_THREADS=1 python benchmarks/rival_times.py

Prints a table for docs/speed.md. The problems and the methods are those of `python benchmarks/bench`, which measures many more
of them. Both methods of a ratio take turns in one process; each has two numbers: with loops that are known from a call before,
and at a first call, which compiles them. A method that finds another number of intervals in some columns has that in place.
"""

from bench import rivals
from bench.measuring import FULL, Row
from bench.problems import COLUMNS, PROBLEMS, Problem
from bench.stiffness import DECOMPOSITION, Method, _own_row, _row
from wavesweep.program.sweep.estimates import short

SEARCHED = 1e-9  # of the range, to which searches go
OTHERS = (
    (
        Method(DECOMPOSITION, rivals.decomposed, ((45, "45 angles", max(COLUMNS)),)),
        "D-decomposition by hand in numpy, 45 angles",
    ),
    (Method(DECOMPOSITION, rivals.decomposed, ((180, "180 angles", max(COLUMNS)),)), "the same, 180 angles"),
    (Method("refined", rivals.refined, (((25, SEARCHED), "", max(COLUMNS)),)), "batched grid, refined by bisection"),
    (
        Method("bisection", rivals.bisected_together, ((SEARCHED, "", max(COLUMNS)),)),
        "bisection for the largest stiffness, vectorised",
    ),
    (
        Method("feedback", rivals.bisected_by_feedback, ((SEARCHED, "", max(COLUMNS)),)),
        "the same with python-control's `feedback`",
    ),
)
TITLES = {
    "fig4": "Fig. 4, columns share a loop",
    "fig4-b25": "with a hole, likewise",
    "pmw-lm": "`pmw-lm`, a loop each",
    "five-axes": "five axes, a loop for two",
}


def main() -> None:
    """Print the table."""
    print(f"| | {' | '.join(TITLES[problem.name] for problem in PROBLEMS)} |")
    print(f"| --- |{' --- |' * len(PROBLEMS)}")
    own_rows = [_own_row(problem, max(COLUMNS), FULL) for problem in PROBLEMS]
    print(_line("this tool, us a column", [_own_times(row) for row in own_rows]), flush=True)
    print(_line("its largest error", [f"{row['error_max']:.0e}" for row in own_rows]), flush=True)
    for method, title in OTHERS:
        print(_line(f"{title}, times as long", [_beside(problem, method) for problem in PROBLEMS]), flush=True)


def _own_times(row: Row) -> str:
    columns = row["size"]
    return f"{1e6 * row['seconds'] / columns:.0f}, {1e6 * row['first_seconds'] / columns:.0f}"


def _beside(problem: Problem, method: Method) -> str:
    row = _row(problem, method, method.settings[0], FULL)
    if row["wrong"]:
        return f"misses {row['there'] - row['found']:.0f} of {row['there']:.0f}"
    return f"{short(row['ratio'])}, {short(row['first_ratio'])}"


def _line(title: str, cells: list[str]) -> str:
    return f"| {title} | {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
