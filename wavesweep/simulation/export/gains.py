"""The numbers of a spec that a controller in C can have as variables: those that determine its
coefficients by arithmetic.

Each coefficient of the ticks remembers how the simulation computed it, and C repeats these
operations. A number is such a gain only if the coefficients of a loop with another value of it are
reproduced to the last bit. A cutoff, a rate or an order acts through other functions or decides how
a tick is built, and stays a constant.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from wavesweep.engine.errors import WavesweepError
from wavesweep.program.spec import Spec
from wavesweep.simulation.export.text import factor
from wavesweep.simulation.named import Named, again
from wavesweep.simulation.tick_sums import Program

LONGEST_EXPRESSION = 100  # letters of an expression, from which a part of it has a line of its own


class Gains(NamedTuple):
    """paths: of the numbers that are variables. constants: of those that act on the coefficients
    in other ways."""

    paths: tuple[str, ...]
    constants: tuple[str, ...]


def gains_of(spec: Spec, made: Callable[[Mapping[str, Any]], Any], fixed: Sequence[str]) -> Gains:
    """Return which numbers of a spec are gains. made: an `ExportedController` with these values.
    fixed: left out."""
    paths = []
    constants = []
    for path, value in spec.values.items():
        if isinstance(value, str) or path in fixed:
            continue
        follows, read = _follows(spec, made, [*paths, path])
        if not follows:
            constants.append(path)
        elif path in read:
            paths.append(path)
    return Gains(tuple(paths), tuple(constants))


def named(values: Mapping[str, Any], paths: Sequence[str]) -> dict[str, Any]:
    """The values of a spec's keys, those at some paths as numbers with names."""
    return {**values, **{path: Named(values[path], path) for path in paths}}


def _follows(spec, made, paths):
    """Whether C would compute all coefficients right for other values of some numbers, and what
    is read of these."""
    moved = {
        path: float(spec.values[path]) + 0.27 * max(1.0, abs(spec.values[path])) for path in paths
    }
    as_given = made(named(spec.values, paths))
    try:
        fresh = made(named({**spec.values, **moved}, paths))
    except (WavesweepError, ArithmeticError, ValueError):
        return False, {}
    first_seen: dict[int | str, float] = {}
    alike = _sources(as_given.programs) == _sources(fresh.programs)
    alike = alike and as_given.ticks.kinds == fresh.ticks.kinds
    expected = [again(value, moved, first_seen) for value in _coefficients(as_given.programs)]
    return alike and expected == [*map(float, _coefficients(fresh.programs))], first_seen


def _lines(programs):
    return [
        line for program in programs for line in (*program.first, *program.second, *program.keeps)
    ]


def _sources(programs):
    """What each line computes, and what it reads."""
    return [(line[0], [source for _, source in line[1]]) for line in _lines(programs)]


def _coefficients(programs) -> Iterator[float]:
    for program in programs:
        yield from (program.wall.yields, program.wall.slows) if program.wall else ()
        yield from (limit for pair in program.limits.values() for limit in pair)
    yield from (value for _, terms in _lines(programs) for value, _ in terms)


class CoefficientTable:
    """The coefficients that follow from gains, as C computes them. members: path -> what C calls
    the gain.

    lines: of C, in their order. count: of the coefficients.
    """

    def __init__(self, members: Mapping[str, str]) -> None:
        self.members = members
        self.lines = []
        self.count = 0
        self._texts: dict[int, str] = {}
        self._places: dict[str, str] = {}

    def _with_places(self, lines):
        placed = []
        for target, terms in lines:
            placed.append((target, tuple((self._placed(value), source) for value, source in terms)))
        return placed

    def with_places(self, program: Program) -> Program:
        """The program with the coefficients' places in C as their names."""
        wall = program.wall
        first = self._with_places(program.first)
        second = self._with_places(program.second)
        keeps = self._with_places(program.keeps)
        met = wall and wall._replace(
            yields=self._placed(wall.yields), slows=self._placed(wall.slows)
        )
        limits = {place: tuple(map(self._placed, pair)) for place, pair in program.limits.items()}
        return program._replace(first=first, wall=met, second=second, keeps=keeps, limits=limits)

    def _placed(self, value):
        if not isinstance(value, Named):
            return value
        text = _bare(self._written(value.made))
        if text not in self._places:
            self._places[text] = f"s->c[{self.count}]"
            self.lines.append(f"    {self._places[text]} = {text};")
            self.count += 1
        return Named(value, self._places[text])

    def _text(self, value):
        """A part of an expression in C."""
        if not isinstance(value, Named):
            return factor(value)
        if id(value) not in self._texts:
            text = self._written(value.made)
            if len(text) > LONGEST_EXPRESSION:
                text, expression = f"part_{len(self.lines)}", text
                self.lines.append(f"    const double {text} = {_bare(expression)};")
            self._texts[id(value)] = text
        return self._texts[id(value)]

    def _written(self, made):
        if isinstance(made, str):
            return f"s->gains.{self.members[made]}"
        sign, first, *operands = (
            operand if isinstance(operand, str) else self._text(operand) for operand in made
        )
        if operands:
            return f"({first} {sign} {operands[0]})"
        if sign == "sqrt":
            return f"sqrt({_bare(first)})"
        return f"(-{first})"


def _bare(text):
    """An expression without the parentheses around all of it."""
    if text.startswith("("):
        return text[1:-1]
    return text
