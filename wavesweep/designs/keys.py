"""The table [design]: numbers to vary, and wishes. What each design has to hold for is in [for_all]."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from wavesweep.designs.wish_keys import WISHES, Wish, word_of
from wavesweep.engine.drawing import Drawing, path_of
from wavesweep.engine.errors import UsageError
from wavesweep.engine.keys import Key, Leaf, Mistakes, Names, Place, show
from wavesweep.haptics.controllers import WALL
from wavesweep.program.analyses.cuts import fault_of_cut
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.keys import BAND_EDGES, MOST_SEED
from wavesweep.program.reading.sorting import Sorted
from wavesweep.program.reading.tables import Section, SpecTable, TableValue, several
from wavesweep.program.spec.studies import apart

if TYPE_CHECKING:
    from wavesweep.program.spec.schema import Shapes
    from wavesweep.program.spec.spec import Spec
    from wavesweep.program.spec.studies import Request

VARIED, WISHED = (f"design.{name}" for name in ("vary", "wish"))
DESIGN_KEYS = Key.by_path(
    [
        Key.whole("design.seed", 0, "seed of the search", 0, MOST_SEED),
        Key.whole(
            "design.population", 96, "designs of a generation, 32 of one number alone", 8, 10_000
        ),
        Key.whole(
            "design.generations",
            80,
            "generations of the search, 12 of one number alone",
            1,
            100_000,
        ),
    ]
)
OF_ONE_NUMBER = {"design.population": 32, "design.generations": 12}  # finds it to 1e-4 of its range
MOST_CHOICES = 1000  # whole numbers of a key that is varied
NOT_VARIED = (*WALL, "rates.fast_hz", "rates.slow_hz", "rates.ratio")  # walls belong to the wishes


@dataclass(frozen=True, slots=True)
class Design(TableValue):
    """The table [design].

    vary: axes of numbers; their values if they are choices, otherwise a span. settings: by the
    names of DESIGN_KEYS.
    """

    vary: tuple[Axis, ...]
    wishes: tuple[Wish, ...]
    settings: Mapping[str, int]
    place: Place = field(default=Place(), repr=False, compare=False)

    @property
    def only_walls(self) -> bool:
        """Whether the stiffest wall is the only wish, so that designs compare by it alone."""
        return [wish.name for wish in self.wishes] == ["z_width"]

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
        for axis in self.vary:
            if axis.path in map(path_of, wall):
                expected = "a number that is not of the wall (walls belong to the wishes)"
                mistakes.refuse(axis.place, f"design.vary.{axis.name}", expected, axis.name)
        for path, expected, problem in faults:
            mistakes.refuse(self.place, f"design.{path}", expected, problem)

    def refuse_unknown_signals(self, request: Request) -> None:
        """Add the mistakes of wishes about signals that the loop does not have, or at which it
        cannot be cut."""
        from wavesweep.program.analyses.signals import faults_of_ends

        for wish in self.wishes:
            ends = wish.options.get("from"), wish.options.get("to"), wish.options.get("cut")
            loop = request.loop((*request.sweep, *self.vary)) if any(ends) else None
            if loop is None:
                continue
            faults = [*faults_of_ends(loop, *ends[:2])] if ends[0] else []
            fault = fault_of_cut(loop, ends[2]) if ends[2] else None
            if fault:
                faults.append(("cut", *fault))
            for key, *said in faults:
                path = f"design.wish.{wish.name}.{key}"
                request.mistakes.refuse(wish.places[key], path, *said, of_key=False)

    def unsuited_wishes(self, drawing: Drawing) -> Iterator[tuple[str, str, str]]:
        """Yield key, what is expected and what is there instead for wishes whose ports this
        drawn loop does not have."""
        ports = {"wall": drawing.wall, "hand": drawing.hand}
        drawn_wishes = [name for name, kind in WISHES.items() if kind.ports is not None]
        for wish in self.wishes:
            if wish.word not in drawn_wishes:
                expected = f"one of {', '.join(drawn_wishes)} for a drawn loop"
                yield f"wish.{wish.name}", expected, wish.name
                continue
            needed = {*wish.kind.ports}
            if {"walls", "B_VE"} & set(wish.options):
                needed.add("wall")
            for name in sorted(needed):
                if ports[name] is None:
                    yield f"wish.{wish.name}", f"a loop with a {name} in [ports]", "none"

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        vary = {}
        for axis in self.vary:
            written = axis.written()
            vary[axis.name] = written if axis.values else {**written, "scale": axis.scale}
        wishes = {wish.name: wish.written() for wish in self.wishes}
        return {**self.settings, "vary": vary, "wish": wishes}


def distinct(values: Iterable[float]) -> tuple[float, ...]:
    """Return each of the numbers once."""
    return tuple(dict.fromkeys(float(value) for value in values))


def build(request: Request) -> Design | None:
    """Return the design and add its mistakes; None if the spec has none, or a wrong one."""
    mistakes = request.mistakes
    varied = request.axes(VARIED)
    request.refuse_other_edges(VARIED, varied, spared=True)  # no design varies an edge
    leaves = {
        path: leaf
        for path, leaf in request.belongs.leaves.items()
        if path == "design" or path.startswith("design.")
    }
    if not leaves:
        return None
    design = _Reader(leaves, request.belongs, request.names, mistakes).design(varied)
    if any(mistake.key.startswith("design.") for mistake in mistakes):
        return None
    if request.hz:
        design.refuse_beyond_half(request.hz, request.rate, mistakes)
    if request.drawing:
        design.refuse_unsuited(request.drawing, mistakes)
    if not any(mistake.key.startswith("design.") for mistake in mistakes):
        design.refuse_unknown_signals(request)
    if request.values is not None:
        request.refuse_beyond_limits(VARIED, design.vary)
    return design


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
        leaves = [leaf for place, leaf in self.leaves.items() if place.startswith(f"design.{path}")]
        self.mistakes.refuse((*leaves, *self.leaves.values())[0], f"design.{path}", expected, found)

    def design(self, varied: Iterable[Axis]) -> Design:
        settings = {path: key.default for path, key in DESIGN_KEYS.items()}
        vary = tuple(self.varied(varied))
        if len(vary) == 1:
            settings |= OF_ONE_NUMBER
        settings |= self.mistakes.read(DESIGN_KEYS, self.settings)
        wishes = tuple(self.wished([axis.name for axis in vary]))
        self.refuse_absent("vary", "at least one number to vary")
        self.refuse_absent("wish", f"at least one of {', '.join(WISHES)}")
        free = [wish.name for wish in wishes if wish.bound is None]
        if len(free) > 2:
            text_found = f"{len(free)}: {', '.join(free)}"
            self.refuse("wish", "at most two wishes without a bound", text_found)
        names = {path.rpartition(".")[2]: value for path, value in settings.items()}
        place = next(iter(self.leaves.values())).place.parent()
        return Design(vary, wishes, names, place)

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
                yield replace(axis, values=tuple(axis.choices), scale=None)

    def wished(self, varied: Sequence[str]) -> Iterator[Wish]:
        """The wishes, of which some are for one of the varied numbers."""
        named: set[str] = set()
        for name, leaves in self.separate_wishes():
            path = f"design.wish.{name}"
            kind = WISHES.get(word_of(name))
            first = next(iter(leaves.values()))
            is_known = self.mistakes.is_known(word_of(name), WISHES, first, path, "an unknown wish")
            if name in named:
                self.mistakes.refuse(first, path, "one wish of this name", f"{name} again")
            elif is_known:
                named.add(name)
            if not is_known:
                continue
            itself = leaves.get("")
            option_leaves = {option: leaf for option, leaf in leaves.items() if option}
            if itself is not None and isinstance(itself.value, str) and "number" in kind.options:
                option_leaves = {"number": itself}
            elif itself is not None and itself.value != {}:
                expected = f"a table such as {{ {kind.bound} = ... }}"
                self.mistakes.refuse(itself, path, expected, show(itself.value))
            options = self.mistakes.read(kind.keys, option_leaves, path)
            bound = options.pop(kind.bound, None)
            for option, value in options.items():
                if isinstance(value, tuple):
                    options[option] = distinct(value)
            if "number" in kind.options and options.get("number") not in varied:
                expected = f"a number of [design.vary] ({', '.join(varied)})"
                self.refuse(f"wish.{name}", expected, show(options.get("number", "none")))
            elif not self.lacks_signals(name, kind.options, options):
                places = {option: leaf.place for option, leaf in leaves.items()}
                yield Wish(name, bound, options, places)

    def separate_wishes(self) -> Iterator[tuple[str, Mapping[str, Leaf]]]:
        """Yield the name and the leaves of each wish; those of a list are NAME, NAME_2 and so on."""
        for name, leaves in self.parts[WISHED].items():
            for number, leaves_of_wish in enumerate(several(leaves), 1):
                yield (name if number == 1 else f"{name}_{number}"), leaves_of_wish

    def lacks_signals(
        self, name: str, needed: Collection[str], options: Mapping[str, object]
    ) -> bool:
        """Whether a wish does not name the signals that it is about; adds the mistake."""
        missing = [option for option in ("cut", "from", "to") if option in needed]
        missing = [option for option in missing if option not in options]
        if "cut" in missing:
            expected = "cut, the signal at which the loop is cut, such as that which `wavesweep margins` names"
            self.refuse(f"wish.{name}", expected, "none")
        elif missing:
            expected = (
                "from and to, the input and the output of the response, as [ports] names them"
            )
            self.refuse(f"wish.{name}", expected, f"none of {' and '.join(missing)}")
        return bool(missing)


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


def schema(shapes: Shapes) -> dict[str, Any]:
    """Return the JSON Schema of the table."""
    wishes = {}
    numbered = {}
    for name, kind in WISHES.items():
        if kind.ports is not None or not shapes.drawn:
            wish = shapes.keys(kind.keys, description=shapes.described(kind))
            wishes[name] = shapes.several(wish)
            if "number" in kind.options:  # also as its name alone
                wishes[name]["anyOf"].append({"type": "string"})
            numbered[f"^{name}_[2-9]$"] = wish
    table = shapes.keys(TABLE.keys_in_it)
    table["properties"] |= {
        "vary": shapes.axes(),
        "wish": shapes.table(wishes, patternProperties=numbered),
    }
    return table


TABLE = SpecTable(
    path="design",
    build=build,
    keys=DESIGN_KEYS,
    sections={
        VARIED: Section(),
        WISHED: Section(takes=_takes_wish, dotted=False),
    },
    demand=demand,
    described={
        VARIED: {
            "description": "numbers that the search may change: NAME = { start, stop, scale } or a list of choices",
        },
        WISHED: {
            "description": "NAME = { at_least or at_most = bound, ... }, or a list of these; without a bound the quantity "
            "is to be as good as possible",
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
    },
    hint="[design] also has the tables vary and wish: `wavesweep keys design.vary` and so on.",
    schema=schema,
)
