"""A spec as a value: every key resolved and every axis complete, without any default left open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from types import MappingProxyType

from wavesweep.core.drawing.drawing import RATE, Drawing, path_of
from wavesweep.core.errors import Mistake, SpecError, UsageError
from wavesweep.core.reading.axes import Axis
from wavesweep.core.reading.checking import Mistakes, nearest
from wavesweep.core.reading.keys import BAND_EDGES, BUILT_IN, KEYS, SYMBOLS, TURNED, Names
from wavesweep.core.reading.reading import Leaf, Place, plain
from wavesweep.core.spec.resolving import Given, is_frame, resolve, resolve_drawn
from wavesweep.core.spec.studies import Studies, fitting, unknown_end
from wavesweep.core.spec.writing import written
from wavesweep.simulation.keys import Experiment


@dataclass(frozen=True, slots=True, eq=False, kw_only=True, repr=False)
class Spec(Studies):
    """A request with all its values, made by `load`. Two specs are the same request if their `sha256` are equal."""

    name: str
    source: str | None
    _values: dict[str, float | int | str]
    _given: Given  # the keys of the loop as given, with their places; `with_values` starts from them
    for_simulation: bool = False  # whether [simulate] is part of the request, see `as_simulated`
    for_design: bool = False  # whether [design] is, see `as_designed`
    drawing: Drawing | None = None  # of a spec that draws its loop; its values are the tick's rate and the numbers

    @property
    def values(self) -> Mapping[str, float | int | str]:
        """The resolved value of every path (`environment.K_VE`), in the order and the units of `KEYS`; read-only."""
        return MappingProxyType(self._values)

    @property
    def files(self) -> list[Path]:
        """The file of the spec, and those that it names: measured points, and the record of a force; none for a dict."""
        own, record = Path(self.source or ""), self.simulate["record"]
        return [
            *filter(None, [self.source and own]),
            *(own.parent / each for each in (*self.measured.values(), record) if each),
        ]

    @property
    def given(self) -> frozenset[str]:
        """The paths of the keys of the loop and of [simulate] that were given, or follow from a device preset that was.

        Overrides by `--set` and values of `with_values` are given too. All others have their defaults. A swept key is given
        only if it has a value of its own as well; a slow rate appears as `rates.slow_hz`, and a filter's band edges under
        their own names.
        """
        device = self._given.device()
        return frozenset((*self._given.leaves, *self.experiment.given, *(device.numbers if device else ())))

    def builds(self, path: str, changes: Iterable[str]) -> bool:
        """Return whether a number decides how the loop is built, or others follow from it, so that it cannot vary smoothly.

        The fast rate does if a ratio follows from it and a slow rate, or a filter from the edges of its band. path: of the
        number. changes: paths that are given in addition to the spec's own.
        """
        given = (*self._given.leaves, *changes)
        alone = not any(each == "rates.slow_hz" or each.rpartition(".")[2] in BAND_EDGES for each in given)
        return self.names.keys[path].structural and not (path == "rates.fast_hz" and alone)

    @property
    def preset(self) -> str | None:
        """The name of the device in `device.preset`, None without one; its numbers are in `values` and `simulate`."""
        return str(self._given.leaves["device.preset"].value) if self._given.device() else None

    @property
    def assumed(self) -> frozenset[str]:
        """The paths of the device preset's numbers that have no public source and that the spec does not give itself."""
        device = self._given.device()
        numbers = device.numbers.items() if device else ()
        own = {*self._given.leaves, *self.experiment.given}
        return frozenset(path for path, number in numbers if number.assumed and path not in own)

    def without_hand(self) -> list[Mistake]:
        """The mistake of a drawn loop whose [ports] name no hand; empty for any other spec."""
        if self.drawing is None or self.drawing.hand:
            return []
        return [self.mistake("ports", "hand = { force = ..., displacement = ... }, where the hand's force acts", "no hand")]

    def without_entry(self) -> list[Mistake]:
        """The mistake of a drawn loop whose [ports] name neither a hand nor an input, which stays at rest."""
        if self.drawing is None or self.drawing.outside:
            return []
        expected = "inputs = { NAME = SIGNAL }, or hand = { force = ..., displacement = ... }, which something comes from"
        return [self.mistake("ports", expected, "neither")]

    @property
    def entry(self) -> str:
        """The signal from outside that [simulate] gives: that of the named input, or the first, which is a hand's force."""
        if self.drawing is None:
            return ""
        named = [signal for name, signal, _ in self.drawing.inputs if name == self.experiment.values["from"]]
        return (*named, *self.drawing.outside, "")[0]

    @property
    def routes(self) -> tuple[tuple[str, str], ...]:
        """Pairs of an input and an output of a drawn loop whose responses [bode] asks for; empty if it asks for the hand's.

        If it names neither end, they are those of a loop without a hand.
        """
        return self.routes_between(self.route.get("from"), self.route.get("to"))

    def routes_between(self, source: str | None, output: str | None) -> tuple[tuple[str, str], ...]:
        """The same for an input and an output, None for all. Errors: UsageError for an unknown name."""
        drawing, asked = self.drawing, source is not None or output is not None
        if drawing is None and asked:
            raise UsageError("from, to: expected a drawn loop, found a controller, whose responses are those at the hand")
        if drawing is None or (drawing.hand and not asked):
            return ()
        for end, name, ports in (("from", source, "inputs"), ("to", output, "outputs")):
            if name is not None and (fault := unknown_end(drawing, name, ports)):
                raise UsageError(str(Mistake("", end, *fault)))
        names = ([each[0] for each in ports] for ports in (drawing.inputs, drawing.outputs))
        return tuple(product(*(some if name is None else [name] for some, name in zip(names, (source, output), strict=True))))

    def unit_between(self, source: str, output: str) -> str:
        """The unit of the response from an input to an output, empty if one of their units is unknown."""
        units = {name: unit for name, _, unit in (*self.drawing.inputs, *self.drawing.outputs)}
        over, under = units[output], units[source]
        if not (over and under):
            return ""
        if under in (over, "1"):
            return "1" if over == under else over
        return f"{f'({over})' if '/' in over else over}/{f'({under})' if {'/', '*'} & {*under} else under}"

    def mistake(self, path: str, expected: str, found: str) -> Mistake:
        """Return a mistake about the key at `path`, at its place. expected, found: the two texts of it."""
        return self._given.leaf(path).place.mistake(path, expected, found)

    @property
    def source_place(self) -> Place:
        """The place of the whole source, from which a mistake finds its line."""
        return self._given.source

    @property
    def names(self) -> Names:
        """The keys that the spec's values have, and the symbols of some of them."""
        return self.drawing.names if self.drawing else BUILT_IN

    @property
    def kind(self) -> str:
        """The controller's name; "drawn" if the spec draws its loop."""
        return "drawn" if self.drawing else self._values["controller.kind"]

    @property
    def tick_hz(self) -> float:
        """The rate of the ticks, the fast rate, in Hz."""
        return self.drawing.rate(self._values) if self.drawing else self._values["rates.fast_hz"]

    @property
    def wall(self) -> tuple[str, ...]:
        """Paths of the wall's stiffness and damping; a drawn loop whose [ports] name no wall has none."""
        if self.drawing is None:
            return SYMBOLS["K_VE"], SYMBOLS["B_VE"]
        return tuple(path_of(name) for name in self.drawing.wall or ())

    @property
    def units_felt(self) -> tuple[str, str]:
        """Units of the stiffness and damping that are felt; a drawn loop whose wall has others may turn, and not slide."""
        stiffness, damping, *_ = (*(self.names.keys[path].unit for path in self.wall), "", "")
        return stiffness or self.at_port("N/m"), damping or self.at_port("N*s/m")

    def at_port(self, unit: str) -> str:
        """Return a unit at the hand's port, or its counterpart for torques and angles if the hand of a drawn loop turns."""
        return TURNED[unit] if self.drawing and self.drawing.turns else unit

    def own(self, path: str) -> float | int | str | None:
        """Return the own value of the key `path`; None if others stand for it, as order and cutoff of a filter for its band."""
        if path == "rates.slow_hz":
            return self._values["rates.fast_hz"] / self._values["rates.ratio"]
        return self._values.get(path)

    @property
    def delay_of_frame(self) -> bool:
        """Whether slow results are in place with the next frame, however long the one before is."""
        return is_frame(self._given)

    @property
    def step(self) -> str:
        """Over what time the slow environment integrates where frames vary: "elapsed" or "nominal"."""
        leaf = self._given.leaves.get("environment.step")
        return str(leaf.value) if leaf else "elapsed"

    def refuse_require(self, what: str) -> None:
        """Raise UsageError if [sweep] requires more than stability, which is all that `what` is about."""
        if self.require:
            expected = f"no [sweep] require with {what}, which is about stability alone"
            raise UsageError(
                f"{self.name}: expected {expected} (--set sweep.require= leaves it out; columns low_hz and high_hz of "
                "stability-region name the mode at each end), found one"
            )

    @property
    def frequency_hz(self) -> tuple[float, ...]:
        """The frequencies of the responses, in Hz."""
        return self._frequencies.values

    @property
    def _frequencies(self) -> Axis:
        return fitting(self.frequencies, self.bode, self.tick_hz, RATE if self.drawing else "rates.fast_hz")

    @property
    def simulate(self) -> Mapping[str, float | int | str | tuple | None]:
        """The resolved keys of [simulate] by their last name (`friction`), None if one is absent; read-only."""
        return MappingProxyType(self._on_device().values)

    @property
    def unread(self) -> list[str]:
        """The keys of [simulate] that are given, and that its input does not read."""
        return self._on_device().unread()

    def _on_device(self) -> Experiment:
        device = self._given.device()
        return self.experiment.on(device) if device else self.experiment

    @property
    def uneven(self) -> bool:
        """Whether the fast rate is no whole multiple of the slow one; never so for a drawn loop, which has a common tick."""
        return isinstance(self._values.get("rates.ratio"), float)

    def as_simulated(self) -> Spec:
        """Return the spec of `simulate`, whose digest covers [simulate] too.

        Errors: SpecError if the experiment does not fit the fast rate, or if a drawn loop has nothing that it could come from.
        """
        mistakes = Mistakes()
        self.experiment.refuse_beyond_limits(self.tick_hz, RATE if self.drawing else "rates.fast_hz", mistakes)
        mistakes += self.without_entry()
        if mistakes:
            raise SpecError(mistakes)
        return replace(self, for_simulation=True)

    def as_designed(self) -> Spec:
        """Return the spec with [design] as part of the request, in `tables()` and `sha256`.

        Errors: UsageError if the spec has no such table.
        """
        if self.design is None:
            raise UsageError(f"{self.name}: expected the tables [design.vary] and [design.wish], found none")
        return replace(self, for_design=True)

    def tables(self) -> dict[str, dict]:
        """Return the resolved spec as nested tables that JSON can hold.

        If a filter was given by its band edges, these are included along with the order and cutoff that follow from them. A
        slow rate appears as the ratio if that is a whole number. [simulate] is left out if nothing depends on it, see
        `as_simulated`.
        """
        tables: dict[str, dict] = {}
        for (*parents, last), value in self._written().items():
            table = tables
            for parent in parents:
                table = table.setdefault(parent, {})
            table[last] = value
        along = {"along": self.along} if self.along else {}
        require = {"require": self.require.written()} if self.require else {}
        tables["sweep"] = {**along, **require, **{axis.name: axis.written() for axis in self.sweep}}
        if self.for_all and (ranges := self.for_all.written()):
            tables["for_all"] = ranges
        bode = (self._frequencies, *self.bode)
        tables["bode"] = dict(self.route) | {axis.name: axis.written() for axis in bode}
        if self.measured:
            tables["measured"] = dict(self.measured)
        if self.for_simulation:
            tables["simulate"] = self._on_device().written()
        if self.for_design:
            tables["design"] = self.design.written()
        return tables

    def _written(self) -> dict[tuple[str, ...], object]:
        if self.drawing:
            return written(self.drawing, self._values, self._given)
        edges = {path: float(leaf.value) for path, leaf in self._given.leaves.items() if path.startswith("filters.")}
        known = {**edges, **self._values}
        if self.uneven:
            del known["rates.ratio"]
            known["rates.slow_hz"] = float(self._given.leaves["rates.slow_hz"].value)
        if self.delay_of_frame:
            known["environment.delay"] = "frame"
        if not known["device.delay"]:
            del known["device.delay"]  # so that the digest of a spec without it is what it was
        if "environment.step" in self._given.leaves:
            known["environment.step"] = self.step
        return {tuple(path.split(".")): known[path] for path in KEYS if path in known}

    @property
    def sha256(self) -> str:
        """The SHA-256 of `tables()` as JSON without spaces, unsorted, because the order of the axes is that of the rows."""
        import hashlib
        import json

        text = json.dumps(self.tables(), separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def with_values(self, changes: Mapping[str, float | int | str]) -> Spec:
        """Return the spec with other values for some paths or symbols, resolved and checked anew.

        `rates.ratio` replaces `rates.slow_hz`, and the other way round. Errors: SpecError with every mistake of the changes.
        """
        given, mistakes = self._given, Mistakes()
        for name, value in changes.items():
            if key := self.names.find(name):
                given = given.replaced(key.path, Leaf(plain(value), Place()), changes)
            else:
                known = (*self.names.symbols, *self.names.keys)
                mistakes.refuse(Place(), name, "a key of the spec", "an unknown key", nearest(name, known))
        values, wrong = resolve_drawn(self.drawing, self._values, given) if self.drawing else resolve(given)
        mistakes += wrong
        if mistakes:
            raise SpecError(mistakes)
        return replace(self, _values=values, _given=given)
