"""The law of attack: of what a spec says must hold for a set, the worst that a rude search finds holds it at the ends that are
proved, and what is printed as refuting it grows."""

from functools import partial

import numpy as np
from meaning.machine import radius
from meaning.members import LOST, RATIO, Frame, Messages, asked_of, family_of, read_refuter, with_numbers
from meaning.moments import growth_at_random
from meaning.reading import drift_of, machine_of
from meaning.required import Found
from meaning.sets import set_of
from meaning.walls import judge_refuting_wall, judge_walls

INSIDE = 0.999  # of a proved end, where members are looked for that grow
GROWS = 1e-7  # of a radius: what grows by less may be rounding
REPLAYED = 1e-9  # by which a radius of 1 or more is less in doubles
MEMBERS = 4  # members whose patterns are searched
WORDS = 250  # patterns of a member that are tried before the best are changed
CHANGES = 60  # changes of a best pattern


def judge_attacked(number: int, tables: dict | None = None) -> list[Found]:
    """What is claimed of a random spec's set, against what is met in it."""
    import wavesweep
    from wavesweep.engine.errors import SpecError, UsageError

    tables = tables or set_of(number)
    try:
        table = wavesweep.stability_region(tables)
    except (SpecError, UsageError) as error:
        return [Found("refused", True, None, str(error))]
    if impossible := _cannot_vary(tables):
        return [Found("a constant number varies", False, impossible, "accepted")]
    rows = table[(table["guarantee"] != "spec") & (table["intervals"] > 0)]
    found = [Found("sets without a row", True, None, None)] if rows.empty else []
    random = np.random.default_rng(number)
    for row in rows.to_dict("records"):
        found += judge_row(tables, row, random)
    return found


def contradictions(tables: dict) -> list[Found]:
    """What an attack meets that the rows of a spec with a set do not allow."""
    return [one for one in judge_attacked(0, tables) if not one.same]


def growth(tables: dict, word, **numbers) -> float:
    """What a pattern that goes on for ever multiplies the motion by, in the spec with these numbers; drifts are left out."""
    member = with_numbers(tables, numbers)
    return radius(family_of(member, asked_of(tables)).march(word), drift_of(_alone(member)))


def _cannot_vary(tables) -> str:
    """A number that varies and may not: only lengths of frames and delays of results do."""
    every = str([block.get("every") for block in tables.get("block", {}).values()])
    for name in asked_of(tables).varying:
        if name not in (RATIO, "environment.delay") and name not in every:
            return name
    return ""


def judge_row(tables: dict, row: dict, random) -> list[Found]:
    """One row of a set: both of its ends, and what refutes beyond them."""
    along = row["along"]
    drift = drift_of(with_numbers(_alone(tables), {along: (row["low"] + row["high"]) / 2}))
    asked = asked_of(tables)
    at = partial(with_numbers, tables)
    kind = row["guarantee"]
    if kind == "contact":
        inside = at({along: INSIDE * row["high"]})
        found = judge_walls(tables, inside, row, random)
        if row["counterexample"] and not np.isnan(row["fails_from"]):
            found.append(judge_refuting_wall(at({along: row["fails_from"]}), row["counterexample"], drift))
        return found
    found = []
    for end in ("high", "low"):
        value = row[end] * (INSIDE if end == "high" else 2 - INSIDE)
        if not (row["low"] < value < row["high"]):
            continue
        if kind == "mean_square":
            worst = max(growth_at_random(member, asked) for _, member in members(at({along: value}), asked, random))
            found.append(Found(f"proved {end} in mean square", worst <= 1 + GROWS, worst, (value, row["counterexample"])))
        else:
            worst, by = attack(at({along: value}), asked, drift, random)
            found.append(Found(f"proved {end}", worst <= 1 + GROWS, (worst, by), (value, row["counterexample"])))
    text = row["counterexample"]
    both = text.startswith("below: ")
    low, _, high = text.removeprefix("below: ").partition("; from: ") if both else (text, "", text)
    for end, said in (("fails_from", high), ("fails_below", low)):
        value = row[end]
        if np.isnan(value) or said.endswith("..."):
            continue
        if kind == "mean_square":
            best = max(growth_at_random(member, asked) for _, member in members(at({along: value}), asked, random, said))
        else:
            best = replayed(at({along: value}), asked, drift, said)
        found.append(
            Found(f"refuted {end}{' in mean square' * (kind == 'mean_square')}", best > 1 - REPLAYED, best, (value, said))
        )
    return found


def _alone(tables: dict) -> dict:
    """The spec without its set."""
    return {name: table for name, table in tables.items() if name != "for_all"}


def members(tables: dict, asked, random, said: str = "") -> list[tuple[dict, dict]]:
    """Some members of the numbers that are not known, each with the spec that it is; said: of a refuter, which has its own."""
    if said:
        numbers, _ = read_refuter(said)
        return [(numbers, with_numbers(tables, whole_as_whole(numbers)))]
    points: list[dict] = [{}]
    for name, values in asked.listed.items():
        points = [{**point, name: value} for point in points for value in values]
    corners = points
    for name, (low, high) in asked.ranges.items():
        corners = [{**point, name: value} for point in corners for value in (low, high)]
        points = [{**point, name: float(random.uniform(low, high))} for point in points for _ in range(3)]
    both = corners + points if asked.ranges else corners
    return [(numbers, with_numbers(tables, numbers)) for numbers in both]


def whole_as_whole(numbers) -> dict:
    """Numbers as the spec has them, whole ones without a point."""
    return {
        name: int(value) if value == int(value) and name in ("n", RATIO, "environment.delay") else value
        for name, value in numbers.items()
    }


def attack(tables: dict, asked, drift: int, random) -> tuple[float, object]:
    """The largest growth that is met among members and patterns, and where."""
    found = []
    for numbers, member in members(tables, asked, random):
        family = family_of(member, asked)
        if family is None:
            found.append((radius(machine_of(member).monodromy(), drift), numbers))
        else:
            word = first_of(family, asked)
            found.append((radius(family.march(word), drift), numbers, word, family))
    found.sort(key=lambda each: -each[0])
    if len(found[0]) == 2:
        return found[0]
    best = (0.0, None)
    for _, numbers, _, family in found[:MEMBERS]:
        size, word = worst_pattern(family, asked, drift, random)
        if size > best[0]:
            best = size, (numbers, word)
    return best


def first_of(family, asked):
    if isinstance(family, Messages):
        return family.in_time()
    return (asked.tick[0],) if asked.tick else (family.symbols()[0],)


def worst_pattern(family, asked, drift, random) -> tuple[float, object]:
    """The pattern that grows most per tick, of short ones, random ones and changes of the best."""
    rates: dict[object, float] = {}

    def rate(word):
        key = tuple(sorted(word.items())) if isinstance(word, dict) else word
        if key not in rates:
            if not family.allowed(word):
                rates[key] = -1.0
            else:
                size = radius(family.march(word), drift)
                rates[key] = size ** (1 / family.ticks(word))
        return rates[key]

    tried = [drawn_pattern(family, asked, random) for _ in range(WORDS)]
    best = sorted(tried, key=rate)[-3:]
    for word in best:
        for _ in range(CHANGES):
            other = changed(word, family, asked, random)
            if rate(other) > rate(word):
                word = other  # noqa: PLW2901 the climb goes on from it
        tried.append(word)
    worst = max(tried, key=rate)
    return rate(worst) ** family.ticks(worst), worst


def drawn_pattern(family, asked, random):
    """A random pattern, mostly short."""
    length = int(random.choice((1, 1, 2, 2, 3, 3, 4, 5, 6, 8, 12)))
    if isinstance(family, Messages):
        return {link.name: tuple(_fate(link, random) for _ in range(length)) for link in family.links}
    if asked.tick:
        period = len(family.kinds)
        ends = [*asked.tick, sum(asked.tick) / 2]
        return tuple(float(ends[int(random.choice((0, 0, 0, 1, 1, 1, 2)))]) for _ in range(period * min(length, 4)))
    symbols = family.symbols()
    return tuple(symbols[int(at)] for at in random.integers(len(symbols), size=length))


def _fate(link, random):
    if link.lost and random.random() < 0.5:
        return LOST
    return int(random.choice((0, link.late, random.integers(link.late + 1))))


def changed(word, family, asked, random):
    """The same pattern with one place another, one more, or one less."""
    if isinstance(word, dict):
        link = family.links[int(random.integers(len(family.links)))]
        return {**word, link.name: _changed(word[link.name], lambda: _fate(link, random), random)}
    if asked.tick:
        at = int(random.integers(len(word)))
        return (*word[:at], asked.tick[int(word[at] != asked.tick[1])], *word[at + 1 :])
    symbols = family.symbols()
    return _changed(word, lambda: symbols[int(random.integers(len(symbols)))], random)


def _changed(word, draw, random):
    at = int(random.integers(len(word)))
    way = random.random()
    if way < 0.5:
        return (*word[:at], draw(), *word[at + 1 :])
    if way < 0.75 or len(word) == 1:
        return (*word[:at], draw(), *word[at:])
    return (*word[:at], *word[at + 1 :])


def replayed(tables: dict, asked, drift: int, said: str) -> float:
    """The radius of what a counterexample says, or 0 if it is not of the set."""
    numbers, word = read_refuter(said)
    if not _within(asked, numbers):
        return 0.0
    member = with_numbers(tables, whole_as_whole(numbers))
    family = family_of(member, asked)
    if family is None:
        return radius(machine_of(member).monodromy(), drift)
    if word is None:
        return 0.0
    if isinstance(family, Messages):
        word = {**family.in_time(), **word}
        fits = all(late is LOST or late <= link.late for link in family.links for late in word[link.name])
    elif asked.tick:
        fits = all(asked.tick[0] <= time <= asked.tick[1] * (1 + 1e-15) for time in word)
    else:
        word = tuple(Frame(frame.ticks, family.delays[0] if frame.delay == "own" else frame.delay) for frame in word)
        fits = set(word) <= set(family.symbols())
    if not (fits and family.allowed(word)):
        return 0.0
    return radius(family.march(word), drift)


def _within(asked, numbers) -> bool:
    """Whether the numbers of a counterexample are in the set."""
    for name, value in numbers.items():
        if name in asked.listed and value not in asked.listed[name]:
            return False
        if name in asked.ranges and not asked.ranges[name][0] <= value <= asked.ranges[name][1]:
            return False
    return True
