"""A loop as a list of instants in exact time.

Between two instants the plants move by the exponential of their matrix, with everything else held. At an instant the equations
of what happens there are solved together, and the memory is written anew.

A form is a dict from names to coefficients. Names that begin with "@" are memory, those that begin with "!" are inputs from
outside, all others are variables of one instant.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Protocol

MOST_TICKS = 20_000  # of a period, and of a delay
MOST_LATE = 1000  # ticks of a dead time


class Unreadable(Exception):
    """What a spec says is not known here, or has no meaning, or would take too long."""


def bounded(count, name: str) -> int:
    """A number of ticks or of runs."""
    if not 0 <= count <= MOST_TICKS:
        raise Unreadable(f"{name} of {float(count):g}; at most {MOST_TICKS}")
    return int(count)


class Arithmetic(Protocol):
    """What coefficients are computed with: values with + - * / ** and a truth that is False of an exact 0 alone."""

    pi: Any

    def number(self, given): ...
    def whole(self, value) -> int: ...
    def exact(self, value) -> Fraction: ...
    def time(self, value): ...
    def least(self, time) -> Fraction: ...
    def ends(self, value) -> tuple[Fraction, Fraction]: ...
    def sqrt(self, value): ...
    def sin(self, value): ...
    def cos(self, value): ...
    def tan(self, value): ...
    def exp(self, value): ...
    def log(self, value): ...
    def at_least(self, value, other) -> bool: ...


def exact(number) -> Fraction:
    """The decimal number that a spec has, not the double nearest to it."""
    return Fraction(str(number))


def form(*terms, **named) -> dict[str, Any]:
    """The sum of (coefficient, name) and of forms."""
    total = dict(named)
    for term in terms:
        pairs = term.items() if isinstance(term, dict) else [(term[1], term[0])]
        for name, coefficient in pairs:
            total[name] = total[name] + coefficient if name in total else coefficient
    return total


def scaled(factor, terms) -> dict[str, Any]:
    return {name: factor * coefficient for name, coefficient in terms.items()}


# Memory of what comes in from outside, and of what is shown, in the tick whose number follows.
INPUT, OUTPUT = "@input ", "@output "


@dataclass
class Instant:
    """What happens at once: variables from equations, and memory that is written afterwards."""

    equations: dict[str, dict] = field(default_factory=dict)
    writes: dict[str, dict] = field(default_factory=dict)


@dataclass
class Schedule:
    """The instants of one period in order: (time in s, kind), and what each kind is.

    A time may depend on numbers that have any value of a range; the order is that of their least ones.
    """

    period: Fraction
    kinds: dict[object, Instant]
    times: list[tuple[Any, object]]
    motion: Instant  # its writes are the derivatives of the memory that moves between instants
    # place in `times` -> number of the tick whose instant it is
    ticks: dict[int, int] = field(default_factory=dict)
    # name of a signal -> variable of a tick's instant
    shown: dict[str, str] = field(default_factory=dict)

    @staticmethod
    def of(period, kinds, rank: list, motion: Instant, shown: dict, least) -> "Schedule":
        """rank: (time, order, kind) of all instants; at one time they come in this order, and that of a tick is 1."""
        rank = sorted(rank, key=lambda row: (least(row[0]), row[1]))
        times = [(time, kind) for time, _, kind in rank]
        ticks = [index for index, (_, order, _) in enumerate(rank) if order == 1]
        return Schedule(
            period, kinds, times, motion, {index: n for n, index in enumerate(ticks)}, shown
        )


def instants_of(schedules: Iterable[Schedule]) -> dict[int, Instant]:
    """What happens in some schedules, by its identity: those of one loop share it."""
    instants = [
        each for schedule in schedules for each in (*schedule.kinds.values(), schedule.motion)
    ]
    return {id(each): each for each in instants}


class Keys:
    """The tables of a spec; remembers which keys were asked for."""

    def __init__(self, tables: dict):
        self.tables = tables
        self.asked: set[str] = set()

    def __call__(self, path: str, default=None):
        self.asked.add(path)
        table = self.tables
        for name in path.split("."):
            if not isinstance(table, dict) or name not in table:
                return default
            table = table[name]
        return table


def ticks_and_rest(seconds, T: Fraction, path: str, arithmetic) -> tuple[int, Any]:
    """A dead time in whole ticks and the rest (s)."""
    if arithmetic.ends(seconds / T)[1] > MOST_LATE:
        raise Unreadable(f"{path} is more than {MOST_LATE} ticks")
    whole = math.floor(arithmetic.least(seconds) / arithmetic.exact(T))
    return whole, seconds - whole * T


def warped(hertz, T: Fraction, path: str, arithmetic):
    """tan(pi f T) of a frequency, with which the bilinear transform keeps it."""
    share = hertz * T
    if arithmetic.ends(share)[1] >= Fraction(1, 2):
        raise Unreadable(f"{path} is not below half the rate of its filter")
    return arithmetic.tan(arithmetic.pi * share)


def rows_of(names, of_states, states, of_inputs, inputs) -> dict[str, dict]:
    """x+ = A x + B u, or y = C x + D u: a form for each name, without inputs that it does not have."""
    forms = {}
    for name, row, fed in zip(names, of_states, of_inputs, strict=True):
        own = {into: entry for into, entry in zip(inputs, fed, strict=True) if entry}
        forms[name] = form(dict(zip(states, row, strict=True)), own)
    return forms


def shifted(memory: str, count: int, newest: dict) -> dict[str, dict]:
    """What is written to memory 0 .. count: the newest in front of all others."""
    older = {f"{memory}{age + 1}": {f"{memory}{age}": 1} for age in range(count)}
    return {f"{memory}0": newest} | older


# Small matrices as lists of rows, of coefficients of any kind.


def product(A, B):
    columns = transposed(B)
    return [[dot(row, column) for column in columns] for row in A]


def dot(row, column):
    return sum((a * b for a, b in zip(row[1:], column[1:], strict=True)), start=row[0] * column[0])


def transposed(matrix):
    return [list(column) for column in zip(*matrix, strict=True)]


def plus(A, B):
    pairs = zip(A, B, strict=True)
    return [[a + b for a, b in zip(row, addend, strict=True)] for row, addend in pairs]


def times(factor, matrix):
    return [[factor * entry for entry in row] for row in matrix]


def outer(column, row):
    return [[a * b for b in row] for a in column]


def diagonal(entries):
    size = range(len(entries))
    return [[entries[row] if row == column else 0 for column in size] for row in size]


def identity(size):
    return diagonal([1] * size)


def inverse(matrix, above_0):
    """Of a positive definite matrix, by elimination along its diagonal; above_0: raises for a pivot that is not."""
    size = len(matrix)
    rows = [[*row, *unit] for row, unit in zip(matrix, identity(size), strict=True)]
    for pivot_row in range(size):
        pivot = rows[pivot_row][pivot_row]
        above_0(pivot)
        rows[pivot_row] = [entry / pivot for entry in rows[pivot_row]]
        for row_number in range(size):
            if row_number != pivot_row:
                factor = rows[row_number][pivot_row]
                pairs = zip(rows[row_number], rows[pivot_row], strict=True)
                rows[row_number] = [entry - factor * of_pivot for entry, of_pivot in pairs]
    return [row[size:] for row in rows]
