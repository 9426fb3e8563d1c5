"""The table [design]: numbers to vary, wishes, and what each design has to hold for."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from wavesweep.designs.wish_keys import OF_DEVICE, WISHES, Wish
from wavesweep.engine.drawing import Drawing, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, Leaf, Mistakes, Names, Place, Rejected, check, show
from wavesweep.haptics.controllers import WALL
from wavesweep.program.analyses.cuts import fault_of_cut
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.keys import BAND_EDGES, KEYS, MOST_SEED, VALUE_PATHS
from wavesweep.program.reading.sorting import Sorted
from wavesweep.program.reading.tables import Section, SpecTable, TableValue
from wavesweep.program.spec.studies import K_VE_SPAN, apart, hardware_of

if TYPE_CHECKING:
    from wavesweep.program.spec.schema import Shapes
    from wavesweep.program.spec.spec import Spec
    from wavesweep.program.spec.studies import Request

VARIED, FOR_DESIGNS, WISHED = (f"design.{name}" for name in ("vary", "for_all", "wish"))
# where the leaves of these are sorted to
RATIOS = "design.for_all ratios"
HANDS = "design.for_all.hand"
DESIGN_KEYS = Key.by_path(
    [
        Key.whole("design.seed", 0, "seed of the search", 0, MOST_SEED),
        Key.whole("design.population", 96, "designs of a generation", 8, 10_000),
        Key.whole("design.generations", 80, "generations of the search", 1, 100_000),
    ]
)
MOST_CHOICES = 1000  # whole numbers of a key that is varied
MOST_SCENARIOS = 4096
HAND_KEYS = {
    name: Key.several(KEYS[f"operator.{name}"]) for name in ("mass", "damping", "stiffness")
}
NOT_VARIED = (*WALL, "rates.fast_hz", "rates.slow_hz", "rates.ratio")  # walls belong to the wishes


@dataclass(frozen=True, slots=True)
class Design(TableValue):
    """The table [design].

    vary: axes of numbers; their values if they are choices, otherwise a span. for_all: axes with
    the values for which a design has to hold. hand: values of the operator's mass, damping and
    stiffness, empty if the hand is the spec's own. ratios: pairs of paths and the values of the
    first one over the second. settings: by the names of DESIGN_KEYS.
    """

    vary: tuple[Axis, ...]
    wishes: tuple[Wish, ...]
    for_all: tuple[Axis, ...]
    hand: Mapping[str, tuple[float, ...]]
    ratios: tuple[tuple[str, str, tuple[float, ...]], ...]
    settings: Mapping[str, int]
    place: Place = field(default=Place(), repr=False, compare=False)

    @property
    def only_walls(self) -> bool:
        """Whether the stiffest wall is the only wish, so that designs compare by it alone."""
        return [wish.name for wish in self.wishes] == ["z_width"]

    def with_hardware(self, hardware: Mapping[str, object], mistakes: Mistakes) -> Design:
        """Return the design with the numbers of the device that wishes do not give; add a mistake
        for each that is missing.

        hardware: numbers of the device, see `Spec.hardware`.
        """
        wishes = []
        for wish in self.wishes:
            lacking = {
                name: hardware[name]
                for name in OF_DEVICE
                if name in wish.kind.options and name not in wish.options
            }
            device_numbers = {name: float(value) for name, value in lacking.items() if value}
            wishes.append(replace(wish, options={**device_numbers, **wish.options}))
            for name in lacking.keys() - device_numbers:
                expected = f"{name} > 0 here, in [simulate] or of a device.preset"
                mistakes.refuse(self.place, f"design.wish.{wish.name}", expected, "none")
        return replace(self, wishes=tuple(wishes))

    def refuse_beyond_half(self, hz: float, rate: str, mistakes: Mistakes) -> None:
        """Add the mistakes of bands that end beyond half the rate, in Hz; rate: its path."""
        for wish in self.wishes:
            stop = max(wish.options.get("band_hz", ()), default=0.0)
            if stop > hz / 2:
                path = f"design.wish.{wish.name}.band_hz"
                half, highest = apart(hz / 2, stop)
                expected = f"numbers <= {half} (half of {rate})"
                mistakes.refuse(wish.places["band_hz"], path, expected, highest, of_key=False)

    def refuse_unsuited(self, drawing: Drawing, mistakes: Mistakes) -> None:
        """Add the mistakes of a design of this drawn loop."""
        wall = drawing.wall or ()
        faults = [*self.unsuited_wishes(drawing)]
        decides = "a wall whose numbers do not decide how the loop is built"
        faults += [("wish", decides, name) for name in sorted(drawing.shaping & set(wall))]
        self.refuse_unsuited_axes(set(map(path_of, wall)), mistakes)
        if self.hand:
            expected = "numbers of the drawing, in which the hand is a block"
            faults.append(("for_all.hand", expected, "hand"))
        for swept, reference, _ in self.ratios:
            ratio = f"{swept}/{reference}"
            expected = "a number of the drawing; write a ratio as an expression there"
            faults.append((f"for_all.{ratio}", expected, ratio))
        for path, expected, problem in faults:
            mistakes.refuse(self.place, f"design.{path}", expected, problem)

    def unsuited_wishes(self, drawing: Drawing) -> Iterator[tuple[str, str, str]]:
        """Yield key, what is expected and what is there instead for wishes whose ports this
        drawn loop does not have."""
        ports = {"wall": drawing.wall, "hand": drawing.hand}
        drawn_wishes = [name for name, kind in WISHES.items() if kind.ports is not None]
        for wish in self.wishes:
            if wish.name not in drawn_wishes:
                expected = f"one of {', '.join(drawn_wishes)} for a drawn loop"
                yield f"wish.{wish.name}", expected, wish.name
                continue
            if "cut" in wish.options:
                fault = fault_of_cut(drawing, wish.options["cut"])
                if fault:
                    yield f"wish.{wish.name}.cut", fault[0], fault[1]
            if "from" in wish.options:
                from wavesweep.program.analyses.signals import routed

                try:
                    routed(drawing, wish.options["from"], wish.options["to"], "")
                except UsageError as error:
                    end, _, fault = str(error).lstrip(".").partition(": expected ")
                    yield f"wish.{wish.name}.{end}", *fault.rsplit(", found ", 1)
            needed = {*wish.kind.ports}
            if {"walls", "B_VE"} & set(wish.options):
                needed.add("wall")
            for name in sorted(needed):
                if ports[name] is None:
                    yield f"wish.{wish.name}", f"a loop with a {name} in [ports]", "none"

    def refuse_unsuited_axes(self, wall: set[str], mistakes: Mistakes) -> None:
        """Add the mistakes of axes along which a drawn loop cannot be designed; wall: the paths
        of its wall's numbers."""
        not_of_wall = "a number that is not of the wall (walls belong to the wishes)"
        whole = "a whole number, or one that does not decide how the loop is built"
        for axis in self.vary:
            if axis.path in wall:
                mistakes.refuse(axis.place, f"design.vary.{axis.name}", not_of_wall, axis.name)
        for axis in self.for_all:
            path = f"design.for_all.{axis.name}"
            if axis.path in wall:
                mistakes.refuse(axis.place, path, not_of_wall, axis.name)
            elif axis.structural and not all(isinstance(value, int) for value in axis.values):
                mistakes.refuse(axis.place, path, whole, axis.name)

    def followers(self, values: Mapping, stop: float) -> Iterator[Axis]:
        """Yield the ranges of numbers that ratios set; values: the spec's own; stop: the largest
        stiffness of a wall."""
        ranges = {}
        for path, value in values.items():
            if isinstance(value, (int, float)):
                ranges[path] = value, value
        for axis in (*self.vary, *self.for_all):
            ranges[axis.path] = axis.start, axis.stop
        for key, listed in self.hand.items():
            ranges[f"operator.{key}"] = min(listed), max(listed)
        dampings = []
        stiffnesses = []
        for wish in self.wishes:
            dampings += wish.options.get("B_VE", ranges["environment.B_VE"])
            stiffnesses += wish.options.get("walls", ranges["environment.K_VE"])
            if wish.name in ("z_width", "felt"):
                stiffnesses += [0.0, stop]
        ranges["environment.B_VE"] = min(dampings), max(dampings)
        ranges["environment.K_VE"] = min(stiffnesses), max(stiffnesses)
        for swept, reference, factors in in_order(self.ratios):
            ranges[swept] = tuple(end(ranges[reference]) * end(factors) for end in (min, max))
            yield Axis(f"{swept}/{reference}", swept, (), *ranges[swept], False, None, self.place)

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        vary = {}
        for axis in self.vary:
            written = axis.written()
            vary[axis.name] = written if axis.values else {**written, "scale": axis.scale}
        for_all: dict[str, object] = {axis.name: list(axis.values) for axis in self.for_all}
        for swept, reference, values in self.ratios:
            for_all[f"{swept}/{reference}"] = list(values)
        if self.hand:
            for_all["hand"] = {key: list(values) for key, values in self.hand.items()}
        wishes = {wish.name: wish.written() for wish in self.wishes}
        tables = {"vary": vary, "wish": wishes} | ({"for_all": for_all} if for_all else {})
        return {**self.settings, **tables}


def distinct(values: Iterable[float]) -> tuple[float, ...]:
    """Return each of the numbers once."""
    return tuple(dict.fromkeys(float(value) for value in values))


def in_order(ratios: Sequence[tuple[str, str, object]]) -> list[tuple[str, str, object]]:
    """Return ratios (number, the number that it follows, values) so that each comes after the one
    that it follows.

    Those that follow themselves are left out.
    """
    ordered = []
    waiting = list(ratios)
    while waiting:
        following = {number for number, *_ in waiting}
        ready = [ratio for ratio in waiting if ratio[1] not in following]
        if not ready:
            break
        ordered += ready
        waiting = [ratio for ratio in waiting if ratio not in ready]
    return ordered


def build(request: Request) -> Design | None:
    """Return the design and add its mistakes; None if the spec has none, or a wrong one."""
    mistakes = request.mistakes
    varied = request.axes(VARIED)
    for_all = request.axes(FOR_DESIGNS)
    request.refuse_other_edges(VARIED, varied, spared=True)  # no design varies an edge
    request.refuse_other_edges(FOR_DESIGNS, for_all)
    leaves = {
        path: leaf
        for path, leaf in request.belongs.leaves.items()
        if path == "design" or path.startswith("design.")
    }
    if not leaves:
        return None
    design = _Reader(leaves, request.belongs, request.names, mistakes).design(varied, for_all)
    if any(mistake.key.startswith("design.") for mistake in mistakes):
        return None
    design = design.with_hardware(hardware_of(request.asked, request.given.device()), mistakes)
    if for_every := request.asked.get("for_all"):
        design = replace(design, for_all=(*design.for_all, *for_every.ends(design)))
    if request.hz:
        design.refuse_beyond_half(request.hz, request.rate, mistakes)
    if request.drawing:
        design.refuse_unsuited(request.drawing, mistakes)
    if request.values is not None:
        refuse_beyond_limits(request, design)
    return design


def refuse_beyond_limits(request: Request, design: Design) -> None:
    """Add the mistakes of numbers of a controller's loop that leave the range set by its other
    values."""
    swept = [axis.stop for axis in request.sweep if axis.path == "environment.K_VE"]
    wall = swept[0] if swept else K_VE_SPAN[1]
    followers = tuple(design.followers(request.values, wall))
    request.refuse_beyond_limits(VARIED, design.vary)
    request.refuse_beyond_limits(FOR_DESIGNS, design.for_all)
    request.refuse_beyond_limits(FOR_DESIGNS, followers)
    for axis in followers:
        for end in (axis.start, axis.stop):
            try:
                check(KEYS[axis.path], float(end))
            except Rejected as error:
                path = f"design.for_all.{axis.name}"
                found = f"{show(end)} of {axis.path}"
                request.mistakes.refuse(axis.place, path, error.expected, found)


class _Reader:
    """A reading of [design]."""

    def __init__(
        self, leaves: Mapping[str, Leaf], belongs: Sorted, names: Names, mistakes: Mistakes
    ) -> None:
        self.leaves = leaves
        self.parts = belongs.axes
        self.names = names
        self.mistakes = mistakes
        self.settings = {path: leaf for path, leaf in belongs.keys.items() if path in DESIGN_KEYS}

    def refuse(self, path: str, expected: str, found: str) -> None:
        """Add a mistake at the first leaf whose path begins so, or at the first of all."""
        leaves = [leaf for at, leaf in self.leaves.items() if at.startswith(f"design.{path}")]
        self.mistakes.refuse((*leaves, *self.leaves.values())[0], f"design.{path}", expected, found)

    def design(self, varied: Iterable[Axis], given: Iterable[Axis]) -> Design:
        settings = {path: key.default for path, key in DESIGN_KEYS.items()}
        settings |= self.mistakes.read(DESIGN_KEYS, self.settings)
        vary = tuple(self.varied(varied))
        wishes = tuple(self.wished())
        ratios = self.ratios()
        hand = self.hand()
        for_all = []
        for axis in given:
            values = axis.values or (axis.start, axis.stop)
            for_all.append(replace(axis, values=values, scale=None))
        self.refuse_absent("vary", "at least one number to vary")
        self.refuse_absent("wish", f"at least one of {', '.join(WISHES)}")
        free = [wish.name for wish in wishes if wish.bound is None]
        if len(free) > 2:
            found = f"{len(free)}: {', '.join(free)}"
            self.refuse("wish", "at most two wishes without a bound", found)
        self.refuse_numbers(for_all, ratios, hand)
        self.refuse_ratios(ratios)
        counts = [len(axis.values) for axis in for_all]
        counts += map(len, hand.values())
        counts += [len(values) for *_, values in ratios.values()]
        scenarios = math.prod(counts)
        if scenarios > MOST_SCENARIOS:
            expected = f"at most {MOST_SCENARIOS} combinations of values; list fewer"
            self.refuse("for_all", expected, f"{scenarios}")
        names = {path.rpartition(".")[2]: value for path, value in settings.items()}
        place = next(iter(self.leaves.values())).place.parent()
        return Design(vary, wishes, tuple(for_all), hand, tuple(ratios.values()), names, place)

    def refuse_absent(self, table: str, expected: str) -> None:
        """Add a mistake if a table of [design] has no keys."""
        if not any(path.startswith(f"design.{table}.") for path in self.leaves):
            self.refuse(table, expected, "none")

    def varied(self, axes: Iterable[Axis]) -> Iterator[Axis]:
        for axis in axes:
            path = f"vary.{axis.name}"
            if axis.path.rpartition(".")[2] in BAND_EDGES:
                self.refuse(path, "the order or the cutoff of a filter", "an edge of its band")
            elif axis.path in NOT_VARIED:
                expected = "a number of the device or the controller"
                self.refuse(path, expected, "one of the wall or the rates")
            elif not axis.structural or axis.values:
                yield axis
            elif self.names.keys[axis.path].type != "integer":
                expected = "a list of choices, since the loop is built anew for each"
                self.refuse(path, expected, "only a span")
            elif axis.stop - axis.start >= MOST_CHOICES:
                self.refuse(path, f"fewer than {MOST_CHOICES} whole numbers", "more")
            else:
                choices = tuple(range(int(axis.start), int(axis.stop) + 1))
                yield replace(axis, values=choices, scale=None)

    def wished(self) -> Iterator[Wish]:
        for name, leaves in self.parts[WISHED].items():
            path = f"design.wish.{name}"
            kind = WISHES.get(name)
            first = next(iter(leaves.values()))
            if not self.mistakes.is_known(name, WISHES, first, path, "an unknown wish"):
                continue
            itself = leaves.get("")
            if itself is not None and itself.value != {}:
                expected = f"a table such as {{ {kind.bound} = ... }}"
                self.mistakes.refuse(itself, path, expected, show(itself.value))
            given = {option: leaf for option, leaf in leaves.items() if option}
            options = self.mistakes.read(kind.keys, given, path)
            bound = options.pop(kind.bound, None)
            for option, value in options.items():
                if isinstance(value, tuple):
                    options[option] = distinct(value)
            if not self.lacks_signals(name, kind.options, options):
                places = {option: leaf.place for option, leaf in leaves.items()}
                yield Wish(name, bound, options, places)

    def lacks_signals(
        self, name: str, needed: Collection[str], given: Mapping[str, object]
    ) -> bool:
        """Whether a wish does not name the signals that it is about; adds the mistake."""
        missing = [option for option in ("cut", "from", "to") if option in needed]
        missing = [option for option in missing if option not in given]
        if "cut" in missing:
            expected = "cut, the signal at which the loop is cut, such as that which `wavesweep margins` names"
            self.refuse(f"wish.{name}", expected, "none")
        elif missing:
            expected = (
                "from and to, the input and the output of the response, as [ports] names them"
            )
            self.refuse(f"wish.{name}", expected, f"none of {' and '.join(missing)}")
        return bool(missing)

    def values(self, path: str, leaf: Leaf, key: Key) -> tuple[float, ...]:
        """The different numbers of a list."""
        return distinct(self.mistakes.check(Key.several(key), leaf, path) or ())

    def ratios(self) -> dict[str, tuple[str, str, tuple[float, ...]]]:
        """The ratios of [design.for_all] by name."""
        ratios = {}
        for name, leaves in self.parts[RATIOS].items():
            swept, reference = (self.names.find(side) for side in name.split("/"))
            if reference.numeric and reference.path in VALUE_PATHS:
                key = Key.positive(f"design.for_all.{name}", None, "1", "")
                ratios[name] = swept.path, reference.path, self.values(key.path, leaves[""], key)
            else:
                expected = "a ratio to a number that every spec has"
                self.refuse(f"for_all.{name}", expected, reference.path)
        return ratios

    def hand(self) -> dict[str, tuple[float, ...]]:
        """The hands of [design.for_all]."""
        path = "design.for_all.hand"
        leaves = dict(self.parts[HANDS]["hand"])
        table = leaves.pop("", None)
        if table:
            expected = "a table such as { damping = [0, 5] }"
            self.mistakes.refuse(table, path, expected, show(table.value))
        lists = self.mistakes.read(HAND_KEYS, leaves, path)
        return {key: distinct(values) for key, values in lists.items()}

    def refuse_numbers(
        self, axes: Iterable[Axis], ratios: Mapping[str, tuple], hand: Mapping[str, tuple]
    ) -> None:
        """Refuse numbers of [design.for_all] that it cannot have: walls and those given twice."""
        varied = {self.names.find(name).path for name in self.parts[VARIED]}
        said = dict.fromkeys(varied, "[design.vary]")
        numbers = [(axis.path, axis.name) for axis in axes]
        numbers += [(f"operator.{key}", f"hand.{key}") for key in hand]
        numbers += [(path, name) for name, (path, *_) in ratios.items()]
        for path, name in numbers:
            if path in WALL and name not in ratios:
                expected = "a number of device, operator or timing (walls belong to the wishes)"
                self.refuse(f"for_all.{name}", expected, name)
            elif path in said:
                if path in varied:
                    expected = "a number that is not varied"
                else:
                    expected = "each number once"
                self.refuse(f"for_all.{name}", expected, f"{path}, one of {said[path]}")
            said.setdefault(path, "[design.for_all] already")

    def refuse_ratios(self, ratios: Mapping[str, tuple]) -> None:
        """Refuse ratios of walls and of whole numbers, and those that lead to no number."""
        leading = in_order(list(ratios.values()))
        for name, ratio in ratios.items():
            if ratio[0] in WALL or self.names.keys[ratio[0]].structural:
                expected = "a ratio of a number that is neither a wall nor whole"
                self.refuse(f"for_all.{name}", expected, ratio[0])
            if ratio not in leading:
                expected = "ratios that lead to a number of the spec"
                self.refuse(f"for_all.{name}", expected, f"{ratio[0]}, which follows itself")


def demand(spec: Spec) -> None:
    """Raise UsageError if the spec has no such table."""
    if spec.design is None:
        raise UsageError(
            f"{spec.name}: expected the tables [design.vary] and [design.wish], found none; e.g. "
            '[design.vary] NAME = { start = 1, stop = 100, scale = "log" }, NAME being a number of the spec, and '
            "[design.wish] damping_ratio = { at_least = 0.3 }; `wavesweep keys design.wish` lists what can be wished for"
        )


def _takes_wish(rest: tuple[str, ...], leaf: Leaf, result: Sorted, names: Names) -> bool:
    """Put every leaf with the parts of its wish."""
    del names
    result.axes[WISHED][rest[0]][".".join(rest[1:])] = leaf
    return True


def _takes_hand_or_ratio(rest: tuple[str, ...], leaf: Leaf, result: Sorted, names: Names) -> bool:
    """Put a leaf with the parts of a hand, or under its ratio; other leaves are of axes."""
    ratio = ".".join(rest)
    if rest[0] == "hand":
        result.axes[HANDS]["hand"][".".join(rest[1:])] = leaf
    elif "/" in ratio and all(map(names.find, ratio.split("/"))):
        result.axes[RATIOS][ratio][""] = leaf
    else:
        return False
    return True


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    hand = shapes.keys(HAND_KEYS)
    wishes = {}
    for name, kind in WISHES.items():
        if kind.ports is not None or not shapes.drawn:
            wishes[name] = shapes.keys(kind.keys, description=shapes.described(kind))
    table = shapes.keys(TABLE.keys_in_it)
    table["properties"] |= {
        "vary": shapes.axes(),
        "wish": shapes.table(wishes),
        "for_all": shapes.table({"hand": hand}, shapes.reference("axis")),
    }
    return table


TABLE = SpecTable(
    path="design",
    build=build,
    keys=DESIGN_KEYS,
    sections={
        VARIED: Section(),
        FOR_DESIGNS: Section(takes=_takes_hand_or_ratio),
        WISHED: Section(takes=_takes_wish, dotted=False),
    },
    demand=demand,
    described={
        VARIED: {
            "description": "numbers that the search may change: NAME = { start, stop, scale } or a list of choices",
        },
        WISHED: {
            "description": "NAME = { at_least or at_most = bound, ... }; without a bound the quantity is to be as good as "
            "possible",
            "wishes": {
                wish: {
                    "unit": kind.unit,
                    "bound": kind.bound,
                    "options": list(kind.options),
                    "description": kind.description,
                }
                for wish, kind in WISHES.items()
            },
        },
        FOR_DESIGNS: {
            "description": "what each design has to hold for; the worst case counts: NAME = [values] of device, hand, delay or "
            'a ratio ("one key/another"); hand = { mass = [...], damping = [...], stiffness = [...] }',
        },
    },
    hint="[design] also has the tables vary, wish and for_all: `wavesweep keys design.vary` and so on.",
    schema=schema,
)
