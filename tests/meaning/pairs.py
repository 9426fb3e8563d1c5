"""Specs in which two keys may override each other: each key of the program's own tables, by any of its names, in any table or
by `--set`, with values in and outside of its range. Both readers take such a spec and mean the same, or both refuse it."""

import json
import math
import re
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from fractions import Fraction
from typing import NamedTuple

from meaning.machine import radius
from meaning.reading import drift_of, machine_of
from meaning.required import Found
from meaning.sets import set_of
from meaning.specs import Draw, controller, drawing, toml

from wavesweep.checker import balls
from wavesweep.checker import file as checker
from wavesweep.checker.balls import Refused
from wavesweep.checker.reader import for_all as for_all_reader
from wavesweep.checker.reader import with_numbers
from wavesweep.checker.reader.loops import Unreadable
from wavesweep.engine.drawing import TYPES, keys_of_block
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.engine.keys import Key, Names
from wavesweep.program.reading.keys import BUILT_IN
from wavesweep.program.spec import load
from wavesweep.program.spec.resolving import LIMITS, TWINS

# what numbers of a drawing may be called although keys of tables, parts of axes, or symbols are
NAMES = (
    "contact", "tick", "lost", "loss", "shares", "next", "late", "start", "stop", "values", "varying", "num", "scale",
    "numbers", "block", "rates", "require", "K_VE", "b", "from", "missing", "every",
    "lambda", "in",
)  # fmt: skip
MAY_VARY = ("rates.ratio", "environment.delay", "every")
WRONG = 0.06  # share of values and of axes that no key takes
CLOSE = 1e-9  # of radii
GROWN = 1e9  # a radius with which a frame has lost most digits of a double
# what the checker says of specs that it reads as the program does, and has no proof of
NO_PROOF = re.compile(r"no proof|at most \d|stands? alone|varies from frame to frame|in any order|takes more than")


class Pair(NamedTuple):
    """A spec, texts for `--set`, and the spec with these written into it."""

    tables: dict
    overrides: list[str]
    written: dict


def base(draw: Draw) -> dict:
    """A random spec that the program takes."""
    kind = draw.of((set_of, set_of, drawing, lambda seed: controller(seed, quick=True)))
    tables = tomllib.loads(toml(kind(int(draw.random.integers(10_000)))))
    while taken(tables)[0] is None:  # a constant number that varies
        tables = tomllib.loads(toml(set_of(int(draw.random.integers(10_000)))))
    return tables


def pair(number: int) -> Pair:
    """A random spec with two more keys."""
    draw = Draw([21, number])
    tables = base(draw)
    likely = [path for path in (*TWINS, *LIMITS) if "controller" in tables]
    if "numbers" in tables and draw.chance(0.5):
        other = draw.of(NAMES)
        tables = renamed(tables, draw.of(list(tables["numbers"])), other)
        likely = [f"numbers.{other}"]
    names = numbers_of(tables)
    likely = [path for path in likely if path in names.keys]
    values = load(tables).values
    first = draw.of(likely if likely and draw.chance(0.4) else list(names.keys))
    second = draw.of(related(first, names) if draw.chance(0.7) else list(names.keys))
    overrides = []
    for path in (first, second):
        table = draw.of(("own", "sweep", "for_all"))
        short = [symbol for symbol, full in names.symbols.items() if full == path]
        if table == "own":
            place = place_of(path, tables)
            value = scalar(draw, names.keys[path], values.get(path))
        elif draw.chance(0.1):
            place, value = draw.of(KEYS_OF_FOR_ALL)
        else:
            name = draw.of([path, *short])
            place = (table, *(name.split(".") if draw.chance(0.3) else [name]))
            value = axis(draw, table, names.keys[path], values.get(path))
        if draw.chance(0.3):
            text = draw.of(short) if table == "own" and short and draw.chance(0.5) else ".".join(map(json.dumps, place))
            in_toml = toml({"": {"v": [value]}}).partition(" = [")[2].strip()[:-1]
            overrides.append((f"{text}={in_toml}", place, value))
        else:
            put(tables, place, value)
    written = tables
    for _, place, value in overrides:
        written = replaced(written, place, value, names, tables)
    return Pair(tables, [text for text, *_ in overrides], written)


KEYS_OF_FOR_ALL = [
    (("for_all", name), value)
    for name, values in {
        "lost": (0, 1, 2, 17, -1, 0.5, True, [1]),
        "loss": (0.0, 0.1, 1.0, 1.5, -0.1, "x"),
        "contact": (True, False, 1),
        "tick": ({"late": 1e-4}, {"start": 1e-5, "stop": 0.1}, {"late": -1e-4}, {"late": 1e-4, "stop": 1.0}, {}),
    }.items()
    for value in values
]


def renamed(tables: dict, name: str, other: str) -> dict:
    """The tables with another name of a number."""
    if other in tables["numbers"]:
        return tables

    def of_value(value):
        if isinstance(value, dict):
            return {other if key == name else key: of_value(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [of_value(inner) for inner in value]
        return re.sub(rf"(?<![\w.]){name}(?![\w.])", other, value) if isinstance(value, str) else value

    changed = {table: of_value(inside) for table, inside in tables.items() if table != "block"}
    blocks = {block: {key: of_value(value) for key, value in keys.items()} for block, keys in tables["block"].items()}
    return changed | {"block": blocks}


def numbers_of(tables: dict) -> Names:
    """All numbers of a spec by path, keys of blocks among them."""
    if "controller" in tables:
        return BUILT_IN
    names = load(tables).names
    of_blocks = {
        f"block.{block}.{key}": meaning
        for block, keys in tables["block"].items()
        if keys["type"] in TYPES
        for key, meaning in keys_of_block(keys["type"]).items()
        if meaning.type in ("number", "integer", "string")
    }
    return Names({**names.keys, **of_blocks}, names.symbols)


def related(path: str, names: Names) -> list[str]:
    """Keys that may say something of the same quantity: itself, its twin, what limits it, and those of its table."""
    table = path.rpartition(".")[0]
    near = (path, TWINS.get(path, path), *LIMITS.get(path, ()))
    return [path, path, *(other for other in names.keys if other in near or other.rpartition(".")[0] == table)]


def place_of(path: str, tables: dict) -> tuple[str, ...]:
    """Where a spec has the value of a number; that of a class is a key of its block."""
    first, *names = path.split(".")
    if first == "numbers" and names[0] not in tables["numbers"]:
        block, _, key = names[0].partition("_")
        return "block", block, key
    return first, *names


def scalar(draw: Draw, key: Key, own):
    """A value of a key, mostly in its range; own: that of the spec."""
    if key.type == "string":
        return draw.of([*key.choices, *key.choices, "nope"])
    low, high = (math.nan if end is None else end for end in (key.low, key.high))
    if draw.chance(WRONG):
        return draw.of((low, low - 1, high, high + 1, 0, -1, 2.5, "x", True, math.inf, 1e70, 1e-70))
    own = own if isinstance(own, (int, float)) and own else draw.of((1, 2, 5))
    if key.type == "integer":
        return max(int(own) + draw.whole(-1, 1), int(key.low or 0))
    return float(f"{own * draw.size(0.6, 1.6):.3g}")


def axis(draw: Draw, table: str, key: Key, own):
    """An axis of [sweep] or a range of [for_all] of a key, mostly as it may be."""
    one, two = scalar(draw, key, own), scalar(draw, key, own)
    if isinstance(one, (int, float)) and isinstance(two, (int, float)):
        one, two = sorted((one, two))
    span = {"start": one, "stop": two}
    listed = {"values": [one, two]}
    varying = {"varying": True}
    if draw.chance(WRONG):
        wrong = ({"start": two, "stop": one}, {"start": one}, listed | {"start": one}, listed | {"shares": [1, 1]})
        return draw.of(([], {}, "x", one, *wrong))
    if table == "sweep":
        return draw.of(([one], [one, two], span, span | {"num": 2}, span | {"num": 2, "scale": "log"}))
    if not draw.chance(0.8 if key.path in MAY_VARY else WRONG):
        return draw.of(([one, two], listed, span, span, [one]))
    chances = listed | varying | draw.of(({"shares": [1, 3]}, {"next": [[1, 2], [3, 1]]}, {"shares": [0, 0]}, {"shares": [1]}))
    return draw.of((span | varying, listed | varying, chances, chances, span | {"num": 3}))


def put(tables: dict, place: tuple[str, ...], value) -> None:
    for name in place[:-1]:
        tables = tables.setdefault(name, {})
        if not isinstance(tables, dict):
            return
    tables[place[-1]] = value


def axes_of(table: dict, names: Names, before: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str, object]]:
    """(place, path, what is given) of each number of a table of axes."""
    for name, given in table.items():
        place = (*before, name)
        key = names.find(".".join(place))
        if key:
            yield place, key.path, given
        elif isinstance(given, dict):
            yield from axes_of(given, names, place)


def replaced(tables: dict, place: tuple[str, ...], value, names: Names, source: dict) -> dict:
    """The tables with a value in place of what they have by that key, and the source by its twin, in that table."""
    tables = deepcopy(tables)
    if place[0] in ("sweep", "for_all"):
        table = tables.setdefault(place[0], {})
        wanted = getattr(names.find(".".join(place[1:])), "path", "")
        from_source = {path for _, path, _ in axes_of(source.get(place[0], {}), names)}
        for other, path, _ in list(axes_of(table, names)):
            if path == wanted or path in from_source & {TWINS.get(wanted)}:
                remove(table, other)
    elif ".".join(place) in TWINS:
        tables.get("rates", {}).pop(TWINS[".".join(place)].rpartition(".")[2], None)
    put(tables, place, value)
    return tables


def remove(table: dict, place: tuple[str, ...]) -> None:
    """Take out a value, and the tables that are empty then."""
    first, *rest = place
    if rest:
        remove(table[first], tuple(rest))
    if not rest or not table[first]:
        del table[first]


# What both readers say


def judge_pair(number: int) -> list[Found]:
    """Both readers of a spec with two more keys, and the spec with `--set` against the same with these written into it."""
    tables, overrides, written = pair(number)
    theirs, why = computed(written)
    found = []
    if overrides:
        (spec, mistakes), (other, others) = taken(tables, overrides), taken(written)
        found.append(Found("--set", of_spec(spec) == of_spec(other), others or of_spec(other), mistakes or of_spec(spec)))
    text = toml(written)
    try:
        mine = Read(checker.spec_of(text.encode()), taken(written)[0])
    except (Unreadable, Refused, *BEHIND) as error:
        what = "refused alike" if theirs is None else "has no proof"
        return [*found, Found(what, theirs is None or bool(NO_PROOF.search(str(error))), f"{error}", why or "taken")]
    if theirs is None:
        unread = all(line.startswith(OF_STUDIES) for line in why.split("\n"))
        return [*found, Found("an axis" if unread else "refused", unread, "taken", why)]
    return [*found, *mine.sets(), *radii(written, theirs)]


# what the checker says in a sentence before it reads a loop
BEHIND = (AttributeError, IndexError, KeyError, TypeError, ValueError, ZeroDivisionError)
OF_STUDIES = ("sweep", "bode", "design")  # tables that the checker does not read


def taken(tables: dict, overrides=()):
    """The program's spec, None if it refuses it, and its mistakes."""
    try:
        return load(tables, overrides), ""
    except (SpecError, UsageError) as error:
        return None, re.sub(r"(?m)^--set .*?: (?=[\w.\"]+: )", "", str(error))


def computed(tables: dict):
    """The same of a spec whose axes, ranges and frames are computed too, at both ends of each."""
    from wavesweep.for_all.varying import Rules  # a capability, which may be away

    spec, why = taken(tables)
    if spec is not None:
        try:
            for at in (0, -1):
                ranges = spec.for_all.unknown if spec.for_all else ()
                changed = spec.with_values({each.name: place_in(each, at) for each in (*spec.sweep, *ranges)})
                if spec.for_all and spec.for_all.changing:
                    Rules.of(spec).plan(changed.values)
        except SpecError as error:
            return None, f"{error}"
    return spec, why


def of_spec(spec):
    """What is compared of two readings of one spec: values, and axes by path."""
    if spec is None:
        return None
    ranges = spec.for_all.axes if spec.for_all else ()
    return {
        "values": dict(spec.values),
        "sweep": sorted((axis.path, axis.values, axis.start, axis.stop) for axis in spec.sweep),
        "for_all": sorted((axis.path, axis.values, axis.start, axis.stop) for axis in ranges),
    }


class Read:
    """The checker's reading: of the loop with the numbers at both ends of all axes, for all members of [for_all]."""

    def __init__(self, tables: dict, spec):
        self.tables, self.spec = tables, spec
        self.for_all = for_all_reader.read(tables, balls.exact)
        random = self.for_all.shares or self.for_all.following or self.for_all.loss
        kind = "mean square" if random else "for all" if "for_all" in tables else "modes"
        members = self.for_all.members
        for at in (0, -1):
            numbers = self.swept(at)
            claim = checker.Claim(kind, numbers=numbers, sides=dict(self.for_all.ranges))
            checker.schedules_of(tables, claim, members[at] if kind != "modes" else {})

    def swept(self, at: int) -> dict[str, Fraction]:
        """The values of the swept numbers at an end, by their names there; none of a spec that the program refuses."""
        ends = {} if self.spec is None else {each.name: place_in(each, at) for each in self.spec.sweep}
        return {name: balls.exact(str(value)) for name, value in ends.items()}

    def sets(self) -> Iterator[Found]:
        """Numbers of [for_all] with their ranges and values, which of them vary, and what is lost."""
        asked = self.spec.for_all
        theirs = {}
        for each in asked.axes if asked else ():
            values = each.choices if each.start < each.stop else (each.start,)
            theirs[each.path] = each in asked.changing, [float(value) for value in values or (each.start, each.stop)]
        mine = {}
        for kind in ("varying", "listed", "ranges"):
            for name, values in getattr(self.for_all, kind).items():
                path = self.spec.names.find(name).path
                mine[path] = (
                    kind == "varying" and len(values) > 1,
                    [float(value) if value != "frame" else value for value in values],
                )
        yield Found("sets", mine == theirs, mine, theirs)
        lost = getattr(asked, "lost", 0), float(getattr(asked, "loss", 0))
        yield Found("lost", (self.for_all.lost, float(self.for_all.loss)) == lost, self.for_all, lost)


def radii(tables: dict, spec) -> Iterator[Found]:
    """Of the loop with its own numbers, and with those at both ends of its axes and of constant ranges."""
    import wavesweep

    loop = wavesweep.compile(spec)
    ranges = spec.for_all.unknown if spec.for_all else ()
    for at in (None, 0, -1):
        ends = {} if at is None else {each.name: place_in(each, at) for each in (*spec.sweep, *ranges)}
        changed = with_numbers(tables, ends)
        mine = radius(machine_of(changed).monodromy(), drift_of(changed))
        if spec.kind == "dc":  # a tick of it is a frame there
            mine **= float(spec.with_values(ends).values["rates.ratio"])
        theirs = float(loop.spectral_radius(**ends).squeeze()) if ends else float(loop.spectral_radius())
        if mine > GROWN and math.isnan(theirs):  # which says that rounding moves it
            continue
        yield Found("radius", abs(mine - theirs) <= CLOSE * max(1.0, mine), (ends, mine), theirs)


def place_in(axis, at: int) -> float:
    """The first or the last value of an axis; of a span one in it, as a wall of 0 has more drifts than others."""
    if axis.choices:
        return axis.choices[at]
    return axis.start + (0.3 if at == 0 else 0.8) * (axis.stop - axis.start)
