"""A spec as a value: every key resolved and every axis complete, without any default left open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType

from wavesweep.engine.drawing import RATE, Drawing, path_of
from wavesweep.engine.errors import Mistake, SpecError, UsageError
from wavesweep.engine.keys import PORT_UNITS, Leaf, Mistakes, Names, Place, nearest, plain
from wavesweep.program.columns import RATIO
from wavesweep.program.reading.axes import Axis
from wavesweep.program.reading.keys import BAND_EDGES, BUILT_IN, KEYS, SYMBOLS
from wavesweep.program.reading.tables import TableValue, table_at, tables
from wavesweep.program.spec.resolving import Given, is_frame, resolve, resolve_drawn
from wavesweep.program.spec.studies import (
    FARTHEST_FACTOR,
    K_VE_SPAN,
    Studies,
    axis_fault,
    fitting,
    hardware_of,
    unknown_end,
)
from wavesweep.program.spec.writing import written


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Spec(Studies):
    """A request with all its values, made by `load`. Two specs are the same request if their
    `sha256` are equal.

    The value of a capability's table is an attribute of the table's name; it is None if the spec
    has no such table.
    """

    name: str
    source: str | None
    _values: dict[str, float | int | str]
    # the keys of the loop as given, with their places; `with_values` starts from them
    _given: Given
    # names of tables that are part of this request and not of every one, see `asking`
    parts: frozenset[str] = frozenset()
    # of a spec that draws its loop; its values are the tick's rate and the numbers
    drawing: Drawing | None = None

    def __repr__(self) -> str:
        """Its name, what it describes and its file."""
        if self.drawing:
            of_what = f"{len(self.drawing.blocks)} blocks drawn"
        else:
            of_what = self.kind
        return f"<Spec {self.name}: {of_what}, {self.source or 'from tables'}>"

    def __getattr__(self, name: str) -> TableValue | None:
        """The value of the table of that name, with the numbers of the spec's device."""
        asked = object.__getattribute__(self, "asked")
        if name not in asked:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        value = asked[name]
        if value is None:
            return None
        return value.on(self._given.device())

    def _asked(self) -> list[TableValue]:
        """The values of the tables that the spec has."""
        return [value for value in self.asked.values() if value is not None]

    @property
    def members(self) -> str:
        """The name of the table that answers can hold for, beside the spec's own numbers; empty
        if they are of these alone."""
        return next((value.members for value in self._asked() if value.members), "")

    @property
    def changing(self) -> tuple[Axis, ...]:
        """The axes of numbers that may change in every frame."""
        return tuple(axis for value in self._asked() for axis in value.changing)

    @property
    def values(self) -> Mapping[str, float | int | str]:
        """The resolved value of every path (`environment.K_VE`), in the order and the units of
        `KEYS`; read-only."""
        return MappingProxyType(self._values)

    @property
    def files(self) -> list[Path]:
        """The file of the spec, and those that its tables name; none for a dict."""
        spec_file = [Path(self.source)] if self.source else []
        folder = Path(self.source or "").parent
        return spec_file + [folder / name for value in self._asked() for name in value.files]

    @property
    def given(self) -> frozenset[str]:
        """The paths of the keys of the loop and of its device that were given, or follow from a
        device preset that was.

        Overrides by `--set` and values of `with_values` are given too. All others have their
        defaults. A swept key is given only if it has a value of its own as well; a slow rate
        appears as `rates.slow_hz`, and a filter's band edges under their own names.
        """
        device = self._given.device()
        return self._own() | (device.numbers.keys() if device else frozenset())

    def builds(self, path: str, changes: Iterable[str]) -> bool:
        """Return whether a number decides how the loop is built, or others follow from it, so that
        it cannot vary smoothly.

        The fast rate does if a ratio follows from it and a slow rate, or a filter from the edges of
        its band. path: of the number. changes: paths that are given in addition to the spec's own.
        """
        if path != "rates.fast_hz":
            return self.names.keys[path].structural
        paths = (*self._given.leaves, *changes)
        return any(
            path_given == "rates.slow_hz" or path_given.rpartition(".")[2] in BAND_EDGES
            for path_given in paths
        )

    @property
    def slow_hz_written(self) -> float | None:
        """The slow rate as the spec writes it (Hz); None if it gives a ratio."""
        leaf = self._given.leaves.get("rates.slow_hz")
        return None if leaf is None else float(leaf.value)

    @property
    def preset(self) -> str | None:
        """The name of the device in `device.preset`, None without one; its numbers are in
        `values` and `hardware`."""
        if self._given.device():
            return str(self._given.leaves["device.preset"].value)
        return None

    @property
    def assumed(self) -> frozenset[str]:
        """The paths of the device preset's numbers that have no public source and that the spec
        does not give itself."""
        device = self._given.device()
        of_spec = self._own()
        numbers = device.numbers.items() if device else ()
        return frozenset(path for path, number in numbers if number.assumed and path not in of_spec)

    def _own(self) -> frozenset[str]:
        """The paths of the keys that the spec itself gives."""
        in_tables = (path for value in self._asked() for path in value.given)
        return frozenset((*self._given.leaves, *in_tables))

    @property
    def hardware(self) -> Mapping[str, float | None]:
        """Friction, resolution and largest force of the device, as a table or else the device
        preset gives them."""
        return hardware_of(self.asked, self._given.device())

    def without_hand(self) -> list[Mistake]:
        """The mistake of a drawn loop whose [ports] name no hand; empty for any other spec."""
        if self.drawing is None or self.drawing.hand:
            return []
        expected = "hand = { force = ..., displacement = ... }, where the hand's force acts"
        return [self.mistake("ports", expected, "no hand")]

    @property
    def routes(self) -> tuple[tuple[str, str], ...]:
        """Pairs of an input and an output of a drawn loop whose responses [bode] asks for; empty if
        it asks for the hand's.

        If it names neither end, they are those of a loop without a hand.
        """
        return self.routes_between(self.route.get("from"), self.route.get("to"))

    def routes_between(self, source: str | None, output: str | None) -> tuple[tuple[str, str], ...]:
        """The same for an input and an output, None for all. Errors: UsageError for an unknown
        name."""
        drawing = self.drawing
        names_a_signal = source is not None or output is not None
        if drawing is None and names_a_signal:
            raise UsageError(
                "from, to: expected a drawn loop, found a controller, whose responses are those at the hand"
            )
        if drawing is None or (drawing.hand and not names_a_signal):
            return ()
        for end, name, ports in (("from", source, "inputs"), ("to", output, "outputs")):
            fault = None if name is None else unknown_end(drawing, name, ports)
            if fault:
                raise UsageError(str(Mistake("", end, *fault)))
        sources = [name for name, *_ in drawing.inputs] if source is None else [source]
        outputs = [name for name, *_ in drawing.outputs] if output is None else [output]
        return tuple(product(sources, outputs))

    def unit_between(self, source: str, output: str) -> str:
        """The unit of the response from an input to an output, empty if one of their units is
        unknown."""
        units = {name: unit for name, _, unit in (*self.drawing.inputs, *self.drawing.outputs)}
        over = units[output]
        under = units[source]
        if not (over and under):
            return ""
        if under in (over, "1"):
            return RATIO if over == under else over
        if "/" in over:
            over = f"({over})"
        if "/" in under or "*" in under:
            under = f"({under})"
        return f"{over}/{under}"

    def mistake(self, path: str, expected: str, found: str) -> Mistake:
        """Return a mistake about the key at `path`, at its place. expected, found: the two texts
        of it."""
        return self._given.leaf(path).place.mistake(path, expected, found)

    @property
    def source_place(self) -> Place:
        """The place of the whole source, from which a mistake finds its line."""
        return self._given.source

    @property
    def names(self) -> Names:
        """The keys that the spec's values have, and the symbols of some of them."""
        if self.drawing:
            return self.drawing.names
        return BUILT_IN

    @property
    def kind(self) -> str:
        """The controller's name; "drawn" if the spec draws its loop."""
        if self.drawing:
            return "drawn"
        return self._values["controller.kind"]

    @property
    def tick_hz(self) -> float:
        """The rate of the ticks, the fast rate, in Hz."""
        if self.drawing:
            return self.drawing.rate(self._values)
        return self._values["rates.fast_hz"]

    @property
    def wall(self) -> tuple[str, ...]:
        """Paths of the wall's stiffness and damping; a drawn loop whose [ports] name no wall has
        none."""
        if self.drawing is None:
            return SYMBOLS["K_VE"], SYMBOLS["B_VE"]
        return tuple(path_of(name) for name in self.drawing.wall or ())

    def at_port(self, unit: str) -> str:
        """Return a unit at the hand's port, or its counterpart for torques and angles, or for
        voltages and charges, if those are at the port of a drawn loop."""
        for key, units in PORT_UNITS.items():
            if self.drawing and getattr(self.drawing, key):
                return units[unit]
        return unit

    def own(self, path: str) -> float | int | str | None:
        """Return the own value of the key `path`; None if others stand for it, as order and
        cutoff of a filter for its band."""
        if path == "rates.slow_hz":
            return self._values["rates.fast_hz"] / self._values["rates.ratio"]
        return self._values.get(path)

    @property
    def delay_of_frame(self) -> bool:
        """Whether slow results are in place with the next frame, however long the one before is."""
        return is_frame(self._given)

    @property
    def step(self) -> str:
        """Over what time the slow environment integrates where frames vary: "elapsed" or
        "nominal"."""
        leaf = self._given.leaves.get("environment.step")
        return str(leaf.value) if leaf else "elapsed"

    def refuse_require(self, what: str) -> None:
        """Raise UsageError if a table asks for more than stability, which is all that `what` is
        about."""
        for value in self._asked():
            value.refuse_stability_alone(self.name, what)

    @property
    def frequency_hz(self) -> tuple[float, ...]:
        """The frequencies of the responses, in Hz."""
        return self._frequencies.values

    @property
    def _frequencies(self) -> Axis:
        """The axis of the responses' frequencies, below half the rate of the ticks."""
        rate = RATE if self.drawing else "rates.fast_hz"
        return fitting(self.frequencies, self.bode, self.tick_hz, rate)

    @property
    def uneven(self) -> bool:
        """Whether the fast rate is no whole multiple of the slow one; never so for a drawn loop,
        which has a common tick."""
        return isinstance(self._values.get("rates.ratio"), float)

    def asking(self, table: str) -> Spec:
        """Return the spec with a table as part of the request, in `tables()` and `sha256`. table:
        its path.

        Errors: UsageError or SpecError if the spec does not have it, or if it does not fit the
        loop.
        """
        table_at(table).demand(self)
        return replace(self, parts=self.parts | {table})

    def tables(self) -> dict[str, dict]:
        """Return the resolved spec as nested tables that JSON can hold.

        If a filter was given by its band edges, these are included along with the order and cutoff
        that follow from them. A slow rate appears as the ratio if that is a whole number. Tables on
        which nothing depends are left out, see `asking`.
        """
        loop: dict[str, dict] = {}
        for (*parents, last), value in self._written().items():
            table = loop
            for parent in parents:
                table = table.setdefault(parent, {})
            table[last] = value
        with_axes, of_capabilities, inside = self._written_tables()
        axis_key = {"along": self.along} if self.along else {}
        swept = {axis.name: axis.written() for axis in self.sweep}
        loop["sweep"] = {**axis_key, **inside.pop("sweep", {}), **swept}
        for parent, tables_in_it in inside.items():
            with_axes[parent] = with_axes.get(parent, {}) | tables_in_it
        bode = dict(self.route)
        for axis in (self._frequencies, *self.bode):
            bode[axis.name] = axis.written()
        return loop | with_axes | {"bode": bode} | of_capabilities

    def _written_tables(self) -> tuple[dict, dict, dict]:
        """The tables of capabilities: those that hold axes as [sweep] does, all others, and those
        in others, by these."""
        with_axes: dict[str, dict] = {}
        of_capabilities: dict[str, dict] = {}
        inside: dict[str, dict] = {}
        # the order decides the digest
        for table in sorted(tables().values(), key=lambda table: not table.always):
            value = getattr(self, table.name)
            if value is None or not (table.always or table.name in self.parts):
                continue
            table_written = value.written()
            if not table_written:
                continue
            parent = table.path.rpartition(".")[0]
            if parent:
                inside.setdefault(parent, {})[table.name] = table_written
            elif table.path in table.sections:
                with_axes[table.name] = table_written
            else:
                of_capabilities[table.name] = table_written
        return with_axes, of_capabilities, inside

    def _written(self) -> dict[tuple[str, ...], object]:
        """The values of the loop by their paths, as a spec could give them."""
        if self.drawing:
            return written(self.drawing, self._values, self._given)
        names: dict[str, object] = {}
        for path, leaf in self._given.leaves.items():
            if path.startswith("filters."):  # also the edges of a band
                names[path] = float(leaf.value)
        names |= self._values
        if self.uneven:
            del names["rates.ratio"]
            names["rates.slow_hz"] = float(self._given.leaves["rates.slow_hz"].value)
        if self.delay_of_frame:
            names["environment.delay"] = "frame"
        for path in ("device.delay", "device.dead_time"):
            if not names[path]:
                del names[path]  # so that the digest of a spec without it is what it was
        if "environment.step" in self._given.leaves:
            names["environment.step"] = self.step
        return {tuple(path.split(".")): names[path] for path in KEYS if path in names}

    @property
    def sha256(self) -> str:
        """The SHA-256 of `tables()` as JSON without spaces, unsorted, because the order of the
        axes is that of the rows."""
        import hashlib
        import json

        text = json.dumps(self.tables(), separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def with_values(self, changes: Mapping[str, float | int | str]) -> Spec:
        """Return the spec with other values for some paths or symbols, resolved and checked anew.

        `rates.ratio` replaces `rates.slow_hz`, and the other way round. Errors: SpecError with
        every mistake of the changes.
        """
        changed = self._given
        mistakes = Mistakes()
        for name, value in changes.items():
            key = self.names.find(name)
            if key:
                changed = changed.replaced(key.path, Leaf(plain(value), Place()), changes)
            else:
                near = nearest(name, (*self.names.symbols, *self.names.keys))
                mistakes.refuse(Place(), name, "a key of the spec", "an unknown key", near)
        if self.drawing:
            values, wrong = resolve_drawn(self.drawing, self._values, changed)
        else:
            values, wrong = resolve(changed)
        mistakes += wrong
        if mistakes:
            raise SpecError(mistakes)
        return replace(self, _values=values, _given=changed)


def sweep_axes(
    spec: Spec, along: str | None = None, swept: bool = True
) -> tuple[Axis, tuple[Axis, ...]]:
    """Return the axis of [sweep] along which intervals are wanted (`spec.along` by default), and
    the other axes.

    along: a symbol or a path; K_VE is the stiffness that the [ports] of a drawn loop name, and has
    a default span if the spec gives none. swept: whether the others are swept; then those that have
    only a span are left out. If they are not, a number without a span has one of FARTHEST_FACTOR
    about its value. Errors: SpecError if `along` is not a numeric key or has no span.
    """
    name = _axis_name(spec, along)
    if fault := axis_fault(name, spec.names):
        raise SpecError([Mistake("", "along", "the name of a numeric key", *fault)])
    path = spec.names.find(name).path
    if spec.builds(path, [axis.path for axis in spec.sweep]):
        raise UsageError(no_axis(spec, name))
    wanted = _axis_or_default(spec, name, path, swept)
    if wanted is None or not wanted.start < wanted.stop:
        place = wanted.place if wanted else spec.source_place.under(("sweep",))
        expected = f"a span to search, `{name} = {{ start = ..., stop = ... }}` in [sweep]"
        problem = "a single value" if wanted else "none"
        raise SpecError([place.mistake(f"sweep.{name}", expected, problem)])
    return wanted, tuple(
        axis for axis in spec.sweep if axis.path != path and (axis.values or not swept)
    )


def _axis_name(spec: Spec, along: str | None) -> str:
    """Return the name of the axis along which intervals are wanted; `K_VE` of a drawn loop is
    the stiffness of its wall."""
    name = spec.along if along is None else along
    if not isinstance(name, str):
        raise UsageError(f"along: expected the name of a number, found {along!r:.60}")
    if spec.drawing and not spec.names.find(name):
        if along == "K_VE" and not spec.wall:
            expected = "wall = { stiffness = ..., damping = ... }, the numbers of a wall; or wavesweep stability-region, which is "
            expected += "along any number"
            raise SpecError([spec.mistake("ports", expected, "no wall")])
        if not name:
            expected = "along = ..., the number whose stable intervals are wanted"
            text_found = "none, and not a single axis that is only a span"
            raise SpecError([spec.mistake("sweep", expected, text_found)])
        if along == "K_VE":
            return spec.drawing.wall[0]
    return name


def _axis_or_default(spec: Spec, name: str, path: str, swept: bool) -> Axis | None:
    """Return the axis of [sweep] over a key, or one with a default span; None if it has neither."""
    for axis in spec.sweep:
        if axis.path == path and (swept or axis.start < axis.stop):
            return axis
    value = spec.own(path)
    structural = spec.names.keys[path].structural
    if path in spec.wall[:1]:
        return Axis(name, path, (), *K_VE_SPAN, structural, "linear")
    if value and not swept and not structural:
        ends = sorted((value / FARTHEST_FACTOR, value * FARTHEST_FACTOR))
        return Axis(name, path, (), *ends, structural, "linear")
    return None


def no_axis(spec: Spec, name: str) -> str:
    """Return the message that a number has no intervals, since it decides how the loop is built;
    spec, name: of the axis."""
    if name == "rates.fast_hz":
        return (
            f"intervals along {name}: expected a ratio of the rates, and filters by order and cutoff, found a slow rate or the "
            "edges of a band, with which a ratio or an order jumps; give rates.ratio, or order and cutoff_hz"
        )
    return (
        f"intervals along {name}: expected a number that the loop varies with smoothly, found one that decides "
        f"how it is built; sweep it as values ({name} = [...]) and look along another axis"
        f"{'' if spec.drawing else ', such as K_VE'}"
    )
