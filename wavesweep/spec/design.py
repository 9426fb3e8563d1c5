"""The table [design]: numbers to vary, wishes, and what each design has to hold for, read with all mistakes at once."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from wavesweep.errors import Mistake
from wavesweep.spec.axes import Axis, build_axis
from wavesweep.spec.checking import Rejected, apart, check, nearest, show
from wavesweep.spec.drawing import Drawing, path_of
from wavesweep.spec.keys import BAND_EDGES, KEYS, SIMULATE_KEYS, VALUE_PATHS, Key, Names
from wavesweep.spec.reading import Leaf, Place

MOST_CHOICES = 1000  # whole numbers of a key that is varied
MOST_SCENARIOS = 4096
HAND = ("mass", "damping", "stiffness")
SECTIONS = ("vary", "wish", "for_all")
NO_RATIO = ("environment.K_VE", "environment.B_VE")  # walls belong to the wishes
NOT_VARIED = ("environment.K_VE", "environment.B_VE", "rates.fast_hz", "rates.slow_hz", "rates.ratio")

DESIGN_KEYS = MappingProxyType(
    {
        "seed": Key("design.seed", "integer", 0, "1", "seed of the search", low=0, high=2**53 - 1),
        "population": Key("design.population", "integer", 96, "1", "designs of a generation", low=8, high=10_000),
        "generations": Key("design.generations", "integer", 80, "1", "generations of the search", low=1, high=100_000),
    }
)
_STIFFNESS, _DAMPING = KEYS["environment.K_VE"], KEYS["environment.B_VE"]
_BAND = Key("band_hz", "number", None, "Hz", "lowest and highest frequency", low=0.0, above_low=True)
# Options of a wish: name -> (key of each number, how many; None for any).
_OF_WALL = {"B_VE": (_DAMPING, None)}
_WALLS = {"walls": (_STIFFNESS, None), **_OF_WALL}
# Of these, numbers that [simulate] or the device gives if the wish does not: by option, those of the wishes that need them.
_OF_DEVICE = {name: SIMULATE_KEYS[f"simulate.{name}"] for name in ("resolution", "max_force")}


@dataclass(frozen=True, slots=True)
class WishKind:
    """A quantity that may be wished for. more: whether more of it is better.

    ports: names in the [ports] of a drawn loop that it needs; None if no drawn loop has it.
    """

    unit: str
    more: bool
    description: str
    options: Mapping[str, tuple[Key, int | None]]
    ports: tuple[str, ...] | None = None

    @property
    def bound(self) -> str:
        """The key of its bound."""
        return "at_least" if self.more else "at_most"


WISHES = MappingProxyType(
    {
        "z_width": WishKind(
            "N/m",
            True,
            "stiffest wall up to which every wall is stable, at most that of sweep.K_VE or 20000",
            _OF_WALL,
            ("wall",),
        ),
        "felt": WishKind(
            "N/m",
            True,
            "stiffness felt of that wall at rest or, with a band, the least size of the impedance that it adds to free motion",
            {"band_hz": (_BAND, 2), **_OF_WALL},
            ("wall", "hand"),
        ),
        "free_motion": WishKind(
            "N/m",
            False,
            "largest size over the band of the impedance of free motion, that without the wall",
            {"band_hz": (_BAND, 2)},
            ("wall", "hand"),
        ),
        "transparency": WishKind(
            "1",
            False,
            "root mean square over the band of |ln(H/H_dc)|, H the transmitted admittance and H_dc that of direct coupling",
            {"band_hz": (_BAND, 2), **_WALLS},
        ),
        "channel": WishKind("1", False, "norm of the wave channel", {}),
        "port": WishKind("m/N", True, "passivity margin of the hand's port of stable loops", _WALLS, ("hand",)),
        "damping_ratio": WishKind("1", True, "least damping ratio of all modes, as [sweep] require has it", _WALLS, ()),
        "settling": WishKind("s", False, "time constant of the slowest mode, in which it falls to 1/e", _WALLS, ()),
        "delay_margin": WishKind("tick", True, "further delay of the slow result up to which every delay is stable", _WALLS),
        "chatter": WishKind(
            "N",
            False,
            "bound on the force that the rounding of an encoder of this resolution, or that of [simulate], adds to a wall",
            {"resolution": (_OF_DEVICE["resolution"], 1), **_WALLS},
            ("hand",),
        ),
        "depth": WishKind(
            "m",
            True,
            "depth to which a wall can be pressed, slowly, with motors of this force, or that of [simulate]",
            {"max_force": (_OF_DEVICE["max_force"], 1), **_WALLS},
            ("hand",),
        ),
    }
)


@dataclass(frozen=True, slots=True)
class Wish:
    """A wish: the name of its kind, its bound (None: as good as possible), and its options as tuples of numbers.

    places: of its keys.
    """

    name: str
    bound: float | None
    options: Mapping[str, tuple[float, ...]]
    places: Mapping[str, Place] = field(default_factory=dict, repr=False, compare=False)

    @property
    def kind(self) -> WishKind:
        """What is wished for."""
        return WISHES[self.name]

    def margin(self, value: Any) -> Any:
        """Return the margin to the bound, as a share of it (of 1e-6 if it is 0); negative if the bound is violated."""
        share = (value - self.bound) / (abs(self.bound or 0.0) or 1e-6)
        return share if self.kind.more else -share

    def written(self) -> dict[str, object]:
        """Return the wish as a spec could give it."""
        bound = {} if self.bound is None else {self.kind.bound: self.bound}
        single = [name for name, (_, count) in self.kind.options.items() if count == 1]
        return bound | {name: values[0] if name in single else list(values) for name, values in self.options.items()}


@dataclass(frozen=True, slots=True)
class Design:
    """The table [design].

    vary: axes of numbers; their values if they are choices, otherwise a span. for_all: axes with the values for which a design
    has to hold. hand: values of the operator's mass, damping and stiffness, empty if the hand is the spec's own. ratios: pairs
    of paths and the values of the first one over the second. settings: by the names of DESIGN_KEYS.
    """

    vary: tuple[Axis, ...]
    wishes: tuple[Wish, ...]
    for_all: tuple[Axis, ...]
    hand: Mapping[str, tuple[float, ...]]
    ratios: tuple[tuple[str, str, tuple[float, ...]], ...]
    settings: Mapping[str, int]
    place: Place = field(default=Place(), repr=False, compare=False)

    def on(self, experiment: Mapping[str, object]) -> tuple[Design, list[Mistake]]:
        """Return the design with the numbers of the device that wishes do not give, and mistakes where there are none.

        experiment: the numbers of [simulate] by their last name.
        """
        wishes, mistakes = [], []
        for wish in self.wishes:
            lacking = [name for name in _OF_DEVICE if name in wish.kind.options and name not in wish.options]
            known = {name: (float(experiment[name]),) for name in lacking if experiment[name]}
            wishes.append(replace(wish, options={**known, **wish.options}))
            for name in (name for name in lacking if name not in known):
                expected = f"{name} > 0 here, in [simulate] or of a device.preset"
                mistakes.append(self._mistake(f"wish.{wish.name}", expected, "none"))
        return replace(self, wishes=tuple(wishes)), mistakes

    def beyond_half(self, hz: float, rate: str) -> Iterator[Mistake]:
        """Yield the mistakes of bands that end beyond half the rate, in Hz; rate: its path."""
        for wish in self.wishes:
            stop = max(wish.options.get("band_hz", ()), default=0.0)
            if stop > hz / 2:
                path, (expected, found) = f"design.wish.{wish.name}.band_hz", apart(hz / 2, stop)
                yield Leaf(None, wish.places["band_hz"]).mistake(path, f"numbers <= {expected} (half of {rate})", found)

    def unsuited(self, drawing: Drawing) -> Iterator[Mistake]:
        """Yield the mistakes of a design of this drawn loop."""
        ports = {"wall": drawing.wall, "hand": drawing.hand}
        known = [name for name, kind in WISHES.items() if kind.ports is not None]
        for wish in self.wishes:
            path = f"wish.{wish.name}"
            if wish.name not in known:
                yield self._mistake(path, f"one of {', '.join(known)} for a drawn loop", wish.name)
                continue
            needed = {*wish.kind.ports, *(["wall"] if {"walls", "B_VE"} & set(wish.options) else [])}
            for name in sorted(name for name in needed if ports[name] is None):
                yield self._mistake(path, f"a loop with a {name} in [ports]", "none")
        yield from self._unsuited_numbers(drawing)
        if self.hand:
            yield self._mistake("for_all.hand", "numbers of the drawing, in which the hand is a block", "hand")
        for one, other, _ in self.ratios:
            expected = "a number of the drawing; write a ratio as an expression there"
            yield self._mistake(f"for_all.{one}/{other}", expected, f"{one}/{other}")

    def _unsuited_numbers(self, drawing):
        wall = {path_of(name): name for name in drawing.wall or ()}
        for name in sorted(drawing.shaping & set(wall.values())):
            yield self._mistake("wish", "a wall whose numbers do not decide how the loop is built", name)
        for section, axes in (("vary", self.vary), ("for_all", self.for_all)):
            for axis in axes:
                whole = all(isinstance(value, int) for value in axis.values)
                if axis.path in wall:
                    expected, found = "a number that is not of the wall (walls belong to the wishes)", wall[axis.path]
                    yield self._mistake(f"{section}.{axis.name}", expected, found, axis.place)
                elif section == "for_all" and axis.structural and not whole:
                    expected = "a whole number, or one that does not decide how the loop is built"
                    yield self._mistake(f"for_all.{axis.name}", expected, axis.name, axis.place)

    def _mistake(self, path: str, expected: str, found: str, place: Place | None = None) -> Mistake:
        return Leaf(None, place or self.place).mistake(f"design.{path}", expected, found, of_key=True)

    def followers(self, values: Mapping, stop: float) -> Iterator[Axis]:
        """Yield the ranges of numbers that ratios set; values: the spec's own; stop: the largest stiffness of a wall."""
        known = {path: (value, value) for path, value in values.items() if isinstance(value, (int, float))}
        known |= {axis.path: (axis.start, axis.stop) for axis in (*self.vary, *self.for_all)}
        known |= {f"operator.{part}": (min(given), max(given)) for part, given in self.hand.items()}
        dampings = [damping for wish in self.wishes for damping in wish.options.get("B_VE", known["environment.B_VE"])]
        stiffnesses = [wall for wish in self.wishes for wall in wish.options.get("walls", known["environment.K_VE"])]
        searched = (0.0, stop) if any(wish.name in ("z_width", "felt") for wish in self.wishes) else ()
        known["environment.B_VE"] = min(dampings), max(dampings)
        known["environment.K_VE"] = tuple(end((*stiffnesses, *searched)) for end in (min, max))
        for one, other, factors in in_order(self.ratios):
            known[one] = tuple(end(known[other]) * end(factors) for end in (min, max))
            yield Axis(f"{one}/{other}", one, (), *known[one], False, None, self.place)

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        for_all = {axis.name: list(axis.values) for axis in self.for_all}
        for_all |= {f"{one}/{other}": list(values) for one, other, values in self.ratios}
        for_all |= {"hand": {part: list(values) for part, values in self.hand.items()}} if self.hand else {}
        return {
            **self.settings,
            "vary": {axis.name: _varied(axis) for axis in self.vary},
            "wish": {wish.name: wish.written() for wish in self.wishes},
            **({"for_all": for_all} if for_all else {}),
        }


def in_order(ratios: Sequence[tuple[str, str, object]]) -> list[tuple[str, str, object]]:
    """Return ratios (number, the number that it follows, values) so that each comes after the one that it follows."""
    ordered, waiting = [], list(ratios)
    while waiting:
        open_ = {one for one, *_ in waiting}
        ordered += [each for each in waiting if each[1] not in open_]
        waiting = [each for each in waiting if each[1] in open_]
    return ordered


def _varied(axis: Axis) -> object:
    return axis.written() if axis.values else {"start": axis.start, "stop": axis.stop, "scale": axis.scale}


def build_design(leaves: Mapping[tuple[str, ...], Leaf], names: Names) -> tuple[Design | None, list[Mistake]]:
    """Return the design of the leaves below [design], by their paths without "design"; None if there are none or mistakes."""
    if not leaves:
        return None, []
    reader = _Reader(leaves, names)
    reader.sort()
    settings = {name: reader.number(key, reader.settings.get(name)) for name, key in DESIGN_KEYS.items()}
    vary = tuple(reader.varied())
    wishes = tuple(reader.wished())
    for_all, ratios, hand = reader.scenarios()
    reader.refuse_nothing(wishes)
    design = Design(vary, wishes, for_all, hand, ratios, settings, next(iter(leaves.values())).place.parent())
    scenarios = math.prod(
        len(values) for values in [*(axis.values for axis in for_all), *hand.values(), *(r[2] for r in ratios)]
    )
    if scenarios > MOST_SCENARIOS:
        reader.refuse("for_all", f"at most {MOST_SCENARIOS} combinations", f"{scenarios}")
    return (None if reader.mistakes else design), reader.mistakes


class _Reader:
    def __init__(self, leaves, names):
        self.leaves, self.names = leaves, names
        self.mistakes, self.settings = [], {}
        self.parts = {section: {} for section in SECTIONS}
        self.first = {}
        self.written = {}  # path of a number that a ratio sets -> the ratio's key

    def refuse(self, path, expected, found, suggestion="", leaf=None):
        leaf = leaf or next((leaf for at, leaf in self.leaves.items() if ".".join(at).startswith(path)), None)
        leaf = leaf or next(iter(self.leaves.values()))
        self.mistakes.append(leaf.mistake(f"design.{path}", expected, found, suggestion, of_key=True))

    def sort(self):
        for (first, *rest), leaf in self.leaves.items():
            if first in DESIGN_KEYS and not rest:
                self.settings[first] = leaf
            elif first not in SECTIONS:
                expected = f"one of {', '.join((*SECTIONS, *DESIGN_KEYS))}"
                self.refuse(first, expected, "an unknown key", nearest(first, (*SECTIONS, *DESIGN_KEYS)), leaf)
            elif not rest:
                if leaf.value != {}:
                    self.refuse(first, "a table", show(leaf.value), leaf=leaf)
            else:
                name, parts = self._named(first, rest)
                self.parts[first].setdefault(name, {})[".".join(parts)] = leaf

    def _named(self, section, rest):
        """The name of an axis, a wish, a ratio or the hand, and the parts below it."""
        if section == "wish" or rest[0] == "hand":
            return rest[0], rest[1:]
        for length in range(1, len(rest) + 1):
            name = ".".join(rest[:length])
            if self.names.find(name) or all(map(self.names.find, name.split("/"))):
                return name, rest[length:]
        return ".".join(rest), ()

    def number(self, key, leaf):
        if leaf is None:
            return key.default
        try:
            return check(key, leaf.value)
        except Rejected as error:
            self.mistakes.append(leaf.mistake(key.path, error.expected, error.found))
            return key.default

    def varied(self) -> Iterator[Axis]:
        for name, parts in self.parts["vary"].items():
            axis = self._axis("vary", name, parts)
            if axis is None:
                continue
            if axis.path.rpartition(".")[2] in BAND_EDGES:
                self.refuse(f"vary.{name}", "the order or the cutoff of a filter", "an edge of its band")
            elif axis.path in NOT_VARIED:
                self.refuse(f"vary.{name}", "a number of the device or the controller", "one of the wall or the rates")
            elif axis.structural and not axis.values and self.names.keys[axis.path].type != "integer":
                self.refuse(f"vary.{name}", "a list of choices, since the loop is built anew for each", "only a span")
            elif axis.structural and not axis.values:
                if axis.stop - axis.start >= MOST_CHOICES:
                    self.refuse(f"vary.{name}", f"fewer than {MOST_CHOICES} whole numbers", "more")
                values = tuple(range(int(axis.start), int(axis.stop) + 1))
                yield Axis(axis.name, axis.path, values, axis.start, axis.stop, True, None, axis.place)
            else:
                yield axis

    def _axis(self, section, name, parts):
        if self.names.find(name) is None:
            numeric = (*self.names.symbols, *self.names.numeric)
            self.refuse(f"{section}.{name}", "the name of a numeric key", "an unknown one", nearest(name, numeric))
            return None
        axis, wrong = build_axis(f"design.{section}", name, parts, self.names)
        self.mistakes += wrong
        path = self.names.find(name).path
        if (first := self.first.setdefault((section, path), name)) != name:
            self.refuse(f"{section}.{name}", "each key once", f"the key of {section}.{first} again")
        return axis

    def wished(self) -> Iterator[Wish]:
        for name, parts in self.parts["wish"].items():
            if name not in WISHES:
                self.refuse(f"wish.{name}", f"one of {', '.join(WISHES)}", "an unknown wish", nearest(name, WISHES))
                continue
            kind = WISHES[name]
            bound, options = None, {}
            for part, leaf in parts.items():
                path = f"wish.{name}.{part}"
                if part == "" and leaf.value == {}:
                    continue
                if part == kind.bound:
                    bound = self.number(Key(f"design.{path}", "number", None, kind.unit, ""), leaf)
                elif part in kind.options:
                    options[part] = self._numbers(path, leaf, *kind.options[part])
                elif part == "":
                    self.refuse(f"wish.{name}", f"a table such as {{ {kind.bound} = ... }}", show(leaf.value), leaf=leaf)
                else:
                    known = (kind.bound, *kind.options)
                    self.refuse(path, f"one of {', '.join(known)}", "an unknown key", nearest(part, known), leaf)
            if "band_hz" in options and len(options["band_hz"]) == 2 and not options["band_hz"][0] < options["band_hz"][1]:
                self.refuse(f"wish.{name}.band_hz", "the lowest frequency first", show(list(options["band_hz"])))
            yield Wish(name, bound, options, {part: leaf.place for part, leaf in parts.items()})

    def _numbers(self, path, leaf, key, count):
        alone = count == 1
        if not alone and (not isinstance(leaf.value, list) or not leaf.value or (count and len(leaf.value) != count)):
            self.refuse(path, f"a list of {f'{count} ' if count else ''}numbers", show(leaf.value), leaf=leaf)
            return ()
        found = []
        for index, item in enumerate([leaf.value] if alone else leaf.value):
            try:
                found.append(float(check(key, item)))
            except Rejected as error:
                at = "" if alone else f"[{index}]"
                self.mistakes.append(leaf.mistake(f"design.{path}{at}", error.expected, error.found))
        return tuple(dict.fromkeys(found))

    def scenarios(self):
        axes, ratios, hand = [], [], {}
        for name, parts in self.parts["for_all"].items():
            if name == "hand":
                hand = self._hand(parts)
            elif "/" in name and all(map(self.names.find, name.split("/"))) and name.count("/") == 1:
                one, other = (self.names.find(each).path for each in name.split("/"))
                self.written[one] = name
                if not self.names.keys[other].numeric or other not in VALUE_PATHS:
                    self.refuse(f"for_all.{name}", "a ratio to a number that every spec has", other)
                    continue
                key = Key(f"design.for_all.{name}", "number", None, "1", "", low=0.0, above_low=True)
                values = self._numbers(f"for_all.{name}", next(iter(parts.values())), key, None)
                ratios.append((one, other, values))
            else:
                axis = self._axis("for_all", name, parts)
                if axis is not None and axis.path in ("environment.K_VE", "environment.B_VE"):
                    self.refuse(f"for_all.{name}", "a number of device, operator or timing (walls belong to the wishes)", name)
                elif axis is not None:
                    ends = axis.values or (axis.start, axis.stop)
                    axes.append(Axis(axis.name, axis.path, ends, axis.start, axis.stop, axis.structural, None, axis.place))
        self._refuse_twice(axes, ratios, hand)
        return tuple(axes), tuple(ratios), hand

    def _refuse_twice(self, axes, ratios, hand):
        """Refuse numbers of which more than one thing is said, and ratios that lead to no number."""
        varied = {self.names.find(name).path for name in self.parts["vary"] if self.names.find(name)}
        said = dict.fromkeys(varied, "[design.vary]")
        names = {axis.path: axis.name for axis in axes} | self.written
        hands = [f"operator.{part}" for part in hand]
        for path in [*(axis.path for axis in axes), *hands, *(one for one, *_ in ratios)]:
            if path in said:
                expected = "a number that is not varied" if path in varied else "each number once"
                key = f"hand.{path.rpartition('.')[2]}" if path in hands else names.get(path, path)
                self.refuse(f"for_all.{key}", expected, f"{path}, one of {said[path]}")
            said.setdefault(path, "[design.for_all] already")
        follows = {one: other for one, other, _ in ratios}
        for one, other, _ in ratios:
            name = self.written[one]
            if one in NO_RATIO or self.names.keys[one].structural:
                self.refuse(f"for_all.{name}", "a ratio of a number that is neither a wall nor whole", one)
            passed, last = [one], other
            while last in follows and last not in passed:
                passed.append(last)
                last = follows[last]
            if last in passed:
                self.refuse(f"for_all.{name}", "ratios that lead to a number of the spec", " to ".join([*passed, last]))

    def _hand(self, parts):
        found = {}
        for part, leaf in parts.items():
            if part == "":
                self.refuse("for_all.hand", "a table such as { damping = [0, 5] }", show(leaf.value), leaf=leaf)
                continue
            if part not in HAND:
                self.refuse(f"for_all.hand.{part}", f"one of {', '.join(HAND)}", "an unknown key", nearest(part, HAND), leaf)
                continue
            values = self._numbers(f"for_all.hand.{part}", leaf, KEYS[f"operator.{part}"], None)
            found[part] = values
        return found

    def refuse_nothing(self, wishes):
        """Refuse a design without numbers to vary or wishes, or with more than two that have no bound."""
        if not self.parts["vary"]:
            self.refuse("vary", "at least one number to vary", "none")
        if not self.parts["wish"]:
            self.refuse("wish", f"at least one of {', '.join(WISHES)}", "none")
        free = [wish.name for wish in wishes if wish.bound is None]
        if len(free) > 2:
            self.refuse("wish", "at most two wishes without a bound", f"{len(free)}: {', '.join(free)}")
