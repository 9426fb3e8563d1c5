"""The table [design]: numbers to vary, wishes, and what each design has to hold for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from wavesweep.controllers import WALL
from wavesweep.spec.axes import Axis
from wavesweep.spec.checking import Mistakes, apart, show
from wavesweep.spec.drawing import Drawing, path_of
from wavesweep.spec.keys import BAND_EDGES, DESIGN_KEYS, KEYS, SIMULATE_KEYS, VALUE_PATHS, Key, Names, number
from wavesweep.spec.reading import Leaf, Place
from wavesweep.spec.sorting import HANDS, RATIOS, VARIED, WISHED, Sorted

MOST_CHOICES = 1000  # whole numbers of a key that is varied
MOST_SCENARIOS = 4096
HAND = ("mass", "damping", "stiffness")
NOT_VARIED = (*WALL, "rates.fast_hz", "rates.slow_hz", "rates.ratio")  # walls belong to the wishes

_STIFFNESS, _DAMPING = KEYS["environment.K_VE"], KEYS["environment.B_VE"]
_BAND = number("band_hz", None, "Hz", "lowest and highest frequency", positive=True)
# Options of a wish: name -> (key of each number, how many; None for any).
_OF_WALL = {"B_VE": (_DAMPING, None)}
_WALLS = {"walls": (_STIFFNESS, None), **_OF_WALL}
# Of these, numbers that [simulate] or the device gives if the wish does not: by option, those of the wishes that need them.
_OF_DEVICE = {name: SIMULATE_KEYS[f"simulate.{name}"] for name in ("resolution", "max_force")}


@dataclass(frozen=True, slots=True)
class WishKind:
    """A quantity that may be wished for. more: whether more of it is better. title: its name in figures.

    ports: names in the [ports] of a drawn loop that it needs; None if no drawn loop has it.
    """

    unit: str
    more: bool
    title: str
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
            "stiffest wall",
            "stiffest wall up to which every wall is stable, at most that of sweep.K_VE or 20000",
            _OF_WALL,
            ("wall",),
        ),
        "felt": WishKind(
            "N/m",
            True,
            "stiffness felt",
            "stiffness felt of that wall at rest or, with a band, the least size of the impedance that it adds to free motion",
            {"band_hz": (_BAND, 2), **_OF_WALL},
            ("wall", "hand"),
        ),
        "free_motion": WishKind(
            "N/m",
            False,
            "impedance of free motion",
            "largest size over the band of the impedance of free motion, that without the wall",
            {"band_hz": (_BAND, 2)},
            ("wall", "hand"),
        ),
        "transparency": WishKind(
            "1",
            False,
            "error of the response",
            "root mean square over the band of |ln(H/H_dc)|, H the transmitted admittance and H_dc that of direct coupling",
            {"band_hz": (_BAND, 2), **_WALLS},
        ),
        "channel": WishKind("1", False, "norm of the wave channel", "norm of the wave channel", {}),
        "port": WishKind(
            "m/N", True, "margin of the hand's port", "passivity margin of the hand's port of stable loops", _WALLS, ("hand",)
        ),
        "damping_ratio": WishKind(
            "1",
            True,
            "least damping ratio of all modes",
            "least damping ratio of all modes, as [sweep] require has it",
            _WALLS,
            (),
        ),
        "settling": WishKind(
            "s",
            False,
            "time constant of the slowest mode",
            "time constant of the slowest mode, in which it falls to 1/e",
            _WALLS,
            (),
        ),
        "delay_margin": WishKind(
            "tick", True, "delay margin", "further delay of the slow result up to which every delay is stable", _WALLS
        ),
        "chatter": WishKind(
            "N",
            False,
            "force of the encoder's rounding, at most",
            "bound on the force that the rounding of an encoder of this resolution, or that of [simulate], adds to a wall",
            {"resolution": (_OF_DEVICE["resolution"], 1), **_WALLS},
            ("hand",),
        ),
        "depth": WishKind(
            "m",
            True,
            "depth at the force of the motors",
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

    def on(self, experiment: Mapping[str, object], mistakes: Mistakes) -> Design:
        """Return the design with the numbers of the device that wishes do not give; add a mistake for each that is missing.

        experiment: the numbers of [simulate] by their last name.
        """
        wishes = []
        for wish in self.wishes:
            lacking = [name for name in _OF_DEVICE if name in wish.kind.options and name not in wish.options]
            known = {name: (float(experiment[name]),) for name in lacking if experiment[name]}
            wishes.append(replace(wish, options={**known, **wish.options}))
            for name in (name for name in lacking if name not in known):
                expected = f"{name} > 0 here, in [simulate] or of a device.preset"
                mistakes.refuse(self.place, f"design.wish.{wish.name}", expected, "none")
        return replace(self, wishes=tuple(wishes))

    def refuse_beyond_half(self, hz: float, rate: str, mistakes: Mistakes) -> None:
        """Add the mistakes of bands that end beyond half the rate, in Hz; rate: its path."""
        for wish in self.wishes:
            stop = max(wish.options.get("band_hz", ()), default=0.0)
            if stop > hz / 2:
                path, (expected, found) = f"design.wish.{wish.name}.band_hz", apart(hz / 2, stop)
                mistakes.refuse(wish.places["band_hz"], path, f"numbers <= {expected} (half of {rate})", found, of_key=False)

    def refuse_unsuited(self, drawing: Drawing, mistakes: Mistakes) -> None:
        """Add the mistakes of a design of this drawn loop."""
        ports = {"wall": drawing.wall, "hand": drawing.hand}
        known = [name for name, kind in WISHES.items() if kind.ports is not None]
        for wish in self.wishes:
            path = f"design.wish.{wish.name}"
            if wish.name not in known:
                mistakes.refuse(self.place, path, f"one of {', '.join(known)} for a drawn loop", wish.name)
                continue
            needed = {*wish.kind.ports, *(["wall"] if {"walls", "B_VE"} & set(wish.options) else [])}
            for name in sorted(name for name in needed if ports[name] is None):
                mistakes.refuse(self.place, path, f"a loop with a {name} in [ports]", "none")
        wall = {path_of(name): name for name in drawing.wall or ()}
        for name in sorted(drawing.shaping & set(wall.values())):
            expected = "a wall whose numbers do not decide how the loop is built"
            mistakes.refuse(self.place, "design.wish", expected, name)
        for axis, path in self._paths():
            whole = all(isinstance(value, int) for value in axis.values)
            if axis.path in wall:
                expected = "a number that is not of the wall (walls belong to the wishes)"
                mistakes.refuse(axis.place, path, expected, wall[axis.path])
            elif axis in self.for_all and axis.structural and not whole:
                expected = "a whole number, or one that does not decide how the loop is built"
                mistakes.refuse(axis.place, path, expected, axis.name)
        if self.hand:
            expected = "numbers of the drawing, in which the hand is a block"
            mistakes.refuse(self.place, "design.for_all.hand", expected, "hand")
        for one, other, _ in self.ratios:
            expected = "a number of the drawing; write a ratio as an expression there"
            mistakes.refuse(self.place, f"design.for_all.{one}/{other}", expected, f"{one}/{other}")

    def _paths(self) -> Iterator[tuple[Axis, str]]:
        """Yield each axis and its path in the spec."""
        yield from ((axis, f"design.vary.{axis.name}") for axis in self.vary)
        yield from ((axis, f"design.for_all.{axis.name}") for axis in self.for_all)

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
            "vary": {
                axis.name: axis.written() if axis.values else {**axis.written(), "scale": axis.scale} for axis in self.vary
            },
            "wish": {wish.name: wish.written() for wish in self.wishes},
            **({"for_all": for_all} if for_all else {}),
        }


def in_order(ratios: Sequence[tuple[str, str, object]]) -> list[tuple[str, str, object]]:
    """Return ratios (number, the number that it follows, values) so that each comes after the one that it follows."""
    ordered, waiting = [], list(ratios)
    while waiting:
        open_ = {one for one, *_ in waiting}
        ordered += [ratio for ratio in waiting if ratio[1] not in open_]
        waiting = [ratio for ratio in waiting if ratio[1] in open_]
    return ordered


def build_design(
    belongs: Sorted, varied: Sequence[Axis], for_all: Sequence[Axis], names: Names, mistakes: Mistakes
) -> Design | None:
    """Return the design and add its mistakes; None if the spec has none, or a wrong one.

    varied, for_all: the axes of [design.vary] and of [design.for_all].
    """
    if not belongs.design:
        return None
    design = _Reader(belongs, names, mistakes).design(varied, for_all)
    return None if any(mistake.key.startswith("design.") for mistake in mistakes) else design


class _Reader:
    """A reading of [design]."""

    def __init__(self, belongs: Sorted, names: Names, mistakes: Mistakes) -> None:
        self.leaves, self.parts, self.names, self.mistakes = belongs.design, belongs.axes, names, mistakes
        self.settings = {path: leaf for path, leaf in belongs.keys.items() if path in DESIGN_KEYS}

    def refuse(self, path: str, expected: str, found: str) -> None:
        """Add a mistake at the first leaf whose path begins so, or at the first of all."""
        leaves = [leaf for at, leaf in self.leaves.items() if at.startswith(f"design.{path}")]
        self.mistakes.refuse((*leaves, *self.leaves.values())[0], f"design.{path}", expected, found)

    def design(self, varied: Iterable[Axis], for_all: Iterable[Axis]) -> Design:
        defaults = {path: key.default for path, key in DESIGN_KEYS.items()}
        settings = (defaults | self.mistakes.read(DESIGN_KEYS, self.settings)).items()
        vary = tuple(self.varied(varied))
        wishes = tuple(self.wished())
        axes, ratios, hand = self.scenarios(for_all)
        for section, expected in (("vary", "at least one number to vary"), ("wish", f"at least one of {', '.join(WISHES)}")):
            if not any(path.startswith(f"design.{section}.") for path in self.leaves):
                self.refuse(section, expected, "none")
        free = [wish.name for wish in wishes if wish.bound is None]
        if len(free) > 2:
            self.refuse("wish", "at most two wishes without a bound", f"{len(free)}: {', '.join(free)}")
        several = [*(axis.values for axis in axes), *hand.values(), *(factors for *_, factors in ratios)]
        if (scenarios := math.prod(map(len, several))) > MOST_SCENARIOS:
            self.refuse("for_all", f"at most {MOST_SCENARIOS} combinations", f"{scenarios}")
        names = {path.rpartition(".")[2]: value for path, value in settings}
        return Design(vary, wishes, axes, hand, ratios, names, next(iter(self.leaves.values())).place.parent())

    def varied(self, axes: Iterable[Axis]) -> Iterator[Axis]:
        for axis in axes:
            path = f"vary.{axis.name}"
            if axis.path.rpartition(".")[2] in BAND_EDGES:
                self.refuse(path, "the order or the cutoff of a filter", "an edge of its band")
            elif axis.path in NOT_VARIED:
                self.refuse(path, "a number of the device or the controller", "one of the wall or the rates")
            elif not axis.structural or axis.values:
                yield axis
            elif self.names.keys[axis.path].type != "integer":
                self.refuse(path, "a list of choices, since the loop is built anew for each", "only a span")
            elif axis.stop - axis.start >= MOST_CHOICES:
                self.refuse(path, f"fewer than {MOST_CHOICES} whole numbers", "more")
            else:
                yield replace(axis, values=tuple(range(int(axis.start), int(axis.stop) + 1)), scale=None)

    def wished(self) -> Iterator[Wish]:
        for name, parts in self.parts[WISHED].items():
            path, kind = f"design.wish.{name}", WISHES.get(name)
            if not self.mistakes.is_known(name, WISHES, next(iter(parts.values())), path, "an unknown wish"):
                continue
            bound, options = None, {}
            for part, leaf in parts.items():
                if part == kind.bound:
                    bound = self.mistakes.check(number(f"{path}.{part}", None, kind.unit, ""), leaf)
                elif part in kind.options:
                    options[part] = self._numbers(f"{path}.{part}", leaf, *kind.options[part])
                elif part:
                    self.mistakes.is_known(part, (kind.bound, *kind.options), leaf, f"{path}.{part}")
                elif leaf.value != {}:
                    self.mistakes.refuse(leaf, path, f"a table such as {{ {kind.bound} = ... }}", show(leaf.value))
            band = options.get("band_hz", ())
            if len(band) == 2 and not band[0] < band[1]:
                self.refuse(f"wish.{name}.band_hz", "the lowest frequency first", show(list(band)))
            yield Wish(name, bound, options, {part: leaf.place for part, leaf in parts.items()})

    def _numbers(self, path: str, leaf: Leaf, key: Key, count: int | None = None) -> tuple[float, ...]:
        """The different numbers of a list; count: of its numbers, None for any. One number stands alone, without a list."""
        if count == 1:
            items = {path: leaf.value}
        elif isinstance(leaf.value, list) and leaf.value and count in (None, len(leaf.value)):
            items = {f"{path}[{index}]": item for index, item in enumerate(leaf.value)}
        else:
            self.mistakes.refuse(leaf, path, f"a list of {f'{count} ' if count else ''}numbers", show(leaf.value))
            return ()
        numbers = (self.mistakes.check(key, replace(leaf, value=item), at) for at, item in items.items())
        return tuple(dict.fromkeys(float(number) for number in numbers if number is not None))

    def scenarios(
        self, given: Iterable[Axis]
    ) -> tuple[tuple[Axis, ...], tuple[tuple[str, str, tuple[float, ...]], ...], dict[str, tuple]]:
        """The axes, the ratios and the hands of [design.for_all]; given: its axes."""
        axes, ratios, hand = [], {}, self._hand(self.parts[HANDS]["hand"])
        for name, parts in self.parts[RATIOS].items():
            one, other = (self.names.find(each) for each in name.split("/"))
            if other.numeric and other.path in VALUE_PATHS:
                key = number(f"design.for_all.{name}", None, "1", "", positive=True)
                ratios[name] = one.path, other.path, self._numbers(key.path, parts[""], key)
            else:
                self.refuse(f"for_all.{name}", "a ratio to a number that every spec has", other.path)
        for axis in given:
            if axis.path in WALL:
                expected = "a number of device, operator or timing (walls belong to the wishes)"
                self.refuse(f"for_all.{axis.name}", expected, axis.name)
            else:
                axes.append(replace(axis, values=axis.values or (axis.start, axis.stop), scale=None))
        self._refuse_twice(axes, ratios, hand)
        return tuple(axes), tuple(ratios.values()), hand

    def _refuse_twice(self, axes: list[Axis], ratios: Mapping[str, tuple], hand: Mapping[str, tuple]) -> None:
        """Refuse numbers that are given twice, and ratios that lead to no number."""
        varied = {self.names.find(name).path for name in self.parts[VARIED]}
        said = dict.fromkeys(varied, "[design.vary]")
        numbers = [(axis.path, axis.name) for axis in axes] + [(f"operator.{part}", f"hand.{part}") for part in hand]
        for path, name in [*numbers, *((one, name) for name, (one, *_) in ratios.items())]:
            if path in said:
                expected = "a number that is not varied" if path in varied else "each number once"
                self.refuse(f"for_all.{name}", expected, f"{path}, one of {said[path]}")
            said.setdefault(path, "[design.for_all] already")
        follows = {one: other for one, other, _ in ratios.values()}
        for name, (one, other, _) in ratios.items():
            if one in WALL or self.names.keys[one].structural:
                self.refuse(f"for_all.{name}", "a ratio of a number that is neither a wall nor whole", one)
            passed, last = [one], other
            while last in follows and last not in passed:
                passed.append(last)
                last = follows[last]
            if last in passed:
                self.refuse(f"for_all.{name}", "ratios that lead to a number of the spec", " to ".join([*passed, last]))

    def _hand(self, parts: Mapping[str, Leaf]) -> dict[str, tuple[float, ...]]:
        if whole := parts.get(""):
            expected = "a table such as { damping = [0, 5] }"
            self.mistakes.refuse(whole, "design.for_all.hand", expected, show(whole.value))
        known = {part: leaf for part, leaf in parts.items() if part}
        path = "design.for_all.hand"
        return {
            part: self._numbers(f"{path}.{part}", leaf, KEYS[f"operator.{part}"])
            for part, leaf in known.items()
            if self.mistakes.is_known(part, HAND, leaf, f"{path}.{part}")
        }
