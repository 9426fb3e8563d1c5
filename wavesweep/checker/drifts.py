"""Drifts: directions of memory and variables that every equation keeps, so that nothing opposes a motion along them.

A file names what takes part in one, first a memory whose share is 1. The shares of the others follow from the equations.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from .balls import Cell, Number, Refused, add, negative, number
from .identities import Identities
from .reader.loops import INPUT, OUTPUT, Schedule, instants_of

Form = dict[str, Number]
APART = "~"  # in the name of a variable, before a number


def drifts_of(
    schedules: list[Schedule], named: Iterable[list[str]], live: set[str], middle: Cell
) -> list[Form]:
    """The shares over the memory of each drift in all kinds of frames, first those of a memory of its own.

    middle: of the sides; there no divisor may be 0, so that one is 0 at places without an inside alone, and what holds elsewhere
    holds there too. A sum that nothing reads is a drift although it goes on with another one.
    """
    drifts: list[Form] = []
    silent: set[str] = set()
    for names in named:
        v = drift_of(at_rest(schedules, live - silent), names, middle)
        if is_unread(schedules, names, live):
            silent.update(names)
        if any(name.startswith((INPUT, OUTPUT)) for name in v):
            raise Refused(f"an input, or an output, takes part in the drift of {names[0]}")
        drifts.append({name: share for name, share in v.items() if name in live})
    for v, names in zip(drifts, named, strict=True):
        if names[0] not in v or sum(names[0] in drift for drift in drifts) > 1:
            raise Refused(f"a drift of {names[0]}, which is no memory of its own")
    return drifts


def drift_of(equations: list[Form], names: list[str], middle: Cell) -> Form:
    """The shares of a drift. Refused, unless every equation holds for them whatever the sides are."""
    identities = Identities()
    first, *followers = names
    unknown = {name for row in equations for name in row if name.partition(APART)[0] in followers}
    rows = [
        {name: c for name, c in row.items() if name in unknown or name == first}
        for row in equations
    ]
    remaining = [dict(row) for row in rows]
    steps: list[tuple[str, Form]] = []
    while unknown:
        row, name = _next(remaining, unknown, identities)
        pivot = row.pop(name)
        solved = {unknown_name: -c / pivot for unknown_name, c in row.items()}
        row.clear()
        for equation in remaining:
            if name in equation:
                share = equation.pop(name)
                for unknown_name, c in solved.items():
                    equation[unknown_name] = (
                        equation[unknown_name] + share * c
                        if unknown_name in equation
                        else share * c
                    )
        steps.append((name, solved))
        unknown.discard(name)
    v = {first: number(1)}
    for name, solved in reversed(steps):
        v[name] = _sum(c * v[unknown_name] for unknown_name, c in solved.items())
    for share in v.values():
        share.value(middle)
    if not all(identities.vanishes(_sum(c * v[name] for name, c in row.items())) for row in rows):
        raise Refused(f"not every equation keeps the drift of {first}")
    return v


def _next(rows, unknown, identities) -> tuple[Form, str]:
    """An equation of as few unknowns as there are, and one of them whose coefficient is not 0."""
    for row in sorted(rows, key=lambda row: sum(name in unknown for name in row)):
        named = sorted(unknown.intersection(row), key=lambda name: (len(row[name].parts), name))
        for name in named:
            if not identities.vanishes(row[name]):
                return row, name
            del row[name]
    raise Refused(f"no equation says the share of {min(unknown)} in a drift")


def is_unread(schedules: Iterable[Schedule], drift: list[str], live: set[str]) -> bool:
    """Whether it is one memory and what is made of that alone, as a sum that is only shown, on which no other memory depends."""
    first = drift[0]
    return live.intersection(drift) == {first} and not needed(schedules, live - {first}) & {*drift}


def needed(schedules: Iterable[Schedule], memory: set[str]) -> set[str]:
    """A memory, and all on which it depends."""
    instants = instants_of(schedules).values()
    wanted: set[str] = set()
    more = memory
    while more:
        wanted |= more
        terms_of = (
            each.get(name, {})
            for instant in instants
            for each in (instant.equations, instant.writes)
            for name in more
        )
        more = {
            name_read for terms in terms_of for name_read, c in terms.items() if number(c)
        } - wanted
    return wanted


def at_rest(schedules: Iterable[Schedule], memory: set[str]) -> list[Form]:
    """What is left at rest of each equation on which a memory depends, where it stays as it is and derivatives are 0; each but once.

    A variable with another equation at other instants may have another value there, and has a number after APART in its name.
    """
    names_of_equations: dict[frozenset, Form] = {}
    motions = {id(schedule.motion) for schedule in schedules}
    wanted = needed(schedules, memory)
    variants: dict[str, dict[frozenset, str]] = {}
    for key, instant in sorted(instants_of(schedules).items(), key=lambda item: item[0] in motions):
        here = {}
        for name, terms in instant.equations.items():
            names_of_terms = variants.setdefault(name, {})
            here[name] = names_of_terms.setdefault(
                _contents(terms), f"{name}{APART}{len(names_of_terms)}" if names_of_terms else name
            )
        for written, equations in ((False, instant.equations), (True, instant.writes)):
            for name, terms in equations.items():
                if name not in wanted:
                    continue
                row = {
                    here.get(name_read, name_read): number(c)
                    for name_read, c in terms.items()
                    if not name_read.startswith(("!", INPUT))
                }
                own = here.get(name, name)
                if not (written and key in motions):
                    row[own] = row.get(own, number(0)) - 1
                row = {name_read: c for name_read, c in row.items() if c}
                names_of_equations.setdefault(_contents(row), row)
    return list(names_of_equations.values())


def _contents(terms: Mapping[str, Any]) -> frozenset:
    """What two rows have in common if they say the same, whatever comes in."""
    return frozenset(
        (name, _content(number(c)))
        for name, c in terms.items()
        if not name.startswith(("!", INPUT))
    )


def _content(c: Number):
    """The same for two numbers if they are the same by what they are made of."""
    return c if c.exact is None else frozenset(c.exact.items())


def _sum(terms: Iterable[Number]) -> Number:
    total = number(0)
    for term in terms:
        total = total + term
    return total


def reduced(cell: Cell, A, drifts: list[Form]) -> dict[str, dict[str, tuple]]:
    """A matrix without the directions v with A v = v, in coordinates x - v x_k with the memory k of v."""
    A = {name: dict(row) for name, row in A.items()}
    for v in drifts:
        k = next(iter(v))
        row_of_memory = A.pop(k)
        for name, row in A.items():
            if name in v:
                share = negative(v[name].value(cell))
                for column, c in row_of_memory.items():
                    term = cell.ring.multiply(share, c)
                    row[column] = add(row[column], term) if column in row else term
            row.pop(k, None)
    return A
