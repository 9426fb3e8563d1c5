"""The tables [sweep], [bode] and [simulate], checked in themselves and against the loop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from wavesweep.errors import Mistake
from wavesweep.spec.axes import Axis, axis_place, build_axis, linear, logarithmic
from wavesweep.spec.checking import Mistakes, apart, nearest, show
from wavesweep.spec.design import Design, build_design
from wavesweep.spec.devices import HapticDevice
from wavesweep.spec.drawing import Drawing
from wavesweep.spec.for_all import ForAll, build_for_all, refuse_swept
from wavesweep.spec.frames import FRAMES, build_frames
from wavesweep.spec.keys import BAND_EDGES, BUILT_IN, INPUTS, MEASURED_KEYS, SIMULATE_KEYS, STUDY_KEYS, Names
from wavesweep.spec.reading import Leaf, Place
from wavesweep.spec.require import Require, build_require
from wavesweep.spec.resolving import LIMITS, Given, exceeds_limit
from wavesweep.spec.sorting import FREQUENCIES, Sorted

DEFAULT_FREQUENCIES = Axis("frequency_hz", "bode.frequency_hz", logarithmic(0.1, 50.0, 400), 0.1, 50.0, False, "log")
OF_PORTS = 1e-5, 0.49  # of the tick's rate, the usual frequencies of responses between inputs and outputs
MOST_TICKS = 1_000_000  # about 1 GB of rows while the loop is marched
SECONDS = 10.0  # of an input that has no length of its own


def _default(values: tuple[float, ...], scale: str | None = None) -> Axis:
    return Axis("frequency_hz", FREQUENCIES, values, values[0], values[-1], False, scale)


# The steps pass by 25 and 50 Hz, where with the default rates a sine is its own image.
INPUT_FREQUENCIES = {
    "sine": _default((5.0,)),
    "stepped-sine": _default(linear(0.5, 49.5, 50), "linear"),
    "chirp": _default((0.1, 50.0)),
}

FORCES = tuple(name for name in INPUTS if name != "record")
# Keys that only some inputs read.
READ_BY = {
    "amplitude": FORCES,
    "frequency_hz": tuple(INPUT_FREQUENCIES),
    "settle_s": ("sine", "stepped-sine"),
    "periods": ("stepped-sine",),
    "at_s": ("step", "pulse"),
    "width_s": ("pulse",),
    "record": ("record",),
}


@dataclass(frozen=True, slots=True)
class Experiment:
    """The keys of [simulate] by their last name, resolved, None if one is absent; and their places.

    `frequency_hz` is a tuple: one for a sine, all of a stepped sine, both ends of a chirp. `frames` are of type `Frame`.
    """

    values: dict[str, float | int | str | tuple | None]
    frequencies: Axis | None
    given: Mapping[str, Leaf] = field(repr=False)

    def written(self) -> dict[str, object]:
        """Return the table as a spec could give it."""
        present = {name: value for name, value in self.values.items() if value is not None}
        frequencies = {"frequency_hz": self.frequencies.written()} if self.frequencies else {}
        frames = {"frames": [each.written() for each in present["frames"]]} if "frames" in present else {}
        return present | frequencies | frames

    def on(self, device: HapticDevice) -> Experiment:
        """Return the experiment with the limits of a device, except for keys that are given themselves."""
        known = {name: value for name, value in device.simulation().items() if f"simulate.{name}" not in self.given}
        return replace(self, values=self.values | known)

    def unread(self) -> list[str]:
        """Return the keys that are given, and not as their defaults, and that the input does not read."""
        given = {path: leaf.value for path, leaf in self.given.items()} | {FREQUENCIES: self.frequencies}
        paths = {name: f"simulate.{name}" for name, inputs in READ_BY.items() if self.values["input"] not in inputs}
        return [name for name, path in paths.items() if path in given and given[path] != SIMULATE_KEYS[path].default]

    def beyond_limits(self, fast_hz: float, rate: str = "rates.fast_hz") -> Iterator[Mistake]:
        """Yield the mistakes that only a simulation has to be without. fast_hz, rate: the fast rate and the path of its key."""
        half, most = fast_hz / 2, MOST_TICKS / fast_hz
        if self.frequencies and self.values["frequency_hz"] and not self.frequencies.stop < half:
            expected, found = f"numbers < {half!r} (half of {rate})", show(self.frequencies.stop)
            yield self._leaf("frequency_hz").mistake(FREQUENCIES, expected, found)
        seconds = self._seconds()
        if seconds > most:
            name = "frequency_hz" if self.values["duration_s"] is None else "duration_s"
            expected = f"at most {most:g} s ({MOST_TICKS} ticks at {rate})"
            yield self._leaf(name).mistake(f"simulate.{name}", expected, f"{seconds:g} s")
        if self.values["duration_s"] is not None and 0 < seconds * fast_hz <= 0.5:
            yield self._leaf("duration_s").mistake("simulate.duration_s", f"at least a tick ({1 / fast_hz:g} s)", show(seconds))
        sets_in, width = self.values["at_s"], self.values["width_s"]
        if self.values["input"] in ("step", "pulse") and not min(sets_in, most) * fast_hz + 0.5 < min(seconds, most) * fast_hz:
            yield self._leaf("at_s").mistake("simulate.at_s", f"a number < {seconds!r} (simulate.duration_s)", show(sets_in))
        if self.values["input"] == "pulse" and width * fast_hz <= 0.5:
            yield self._leaf("width_s").mistake("simulate.width_s", f"at least a tick ({1 / fast_hz:g} s)", show(width))

    def _leaf(self, name: str) -> Leaf:
        """Return the given leaf of a key, or an empty one at the place of its table."""
        table = next((leaf.place.parent() for leaf in self.given.values()), Place())
        return self.given.get(f"simulate.{name}") or Leaf(None, table)

    def _seconds(self) -> float:
        values = self.values
        if values["duration_s"] is not None or values["input"] != "stepped-sine":
            return values["duration_s"] or 0.0
        return sum(step_seconds(f, values["settle_s"], values["periods"]) for f in values["frequency_hz"] or ())


def step_seconds(frequency_hz: float, settle_s: float, periods: int) -> float:
    """Return the duration (s) of a step of the stepped sine: settling, then whole periods and at least a second."""
    return settle_s + max(periods, math.ceil(frequency_hz)) / frequency_hz


def build_experiment(belongs: Sorted, usual: str, mistakes: Mistakes) -> Experiment:
    """Return the experiment and add its mistakes; limits that the fast rate sets are checked by `beyond_limits`.

    usual: the input if none is given.
    """
    given = {f"simulate.{name}": leaf for name, leaf in belongs.below("simulate").items()}
    checked = mistakes.read(SIMULATE_KEYS, {path: leaf for path, leaf in given.items() if path != FRAMES})
    if FRAMES in given:
        checked[FRAMES] = build_frames(given[FRAMES], mistakes)
    defaults = {path: key.default for path, key in SIMULATE_KEYS.items()} | {"simulate.input": usual}
    values = {path.removeprefix("simulate."): value for path, value in (defaults | checked).items()}
    parts, before = belongs.axes["simulate"].get("frequency_hz", {}), len(mistakes)
    alone = parts.get("")
    if alone and alone.value == [] and values["input"] not in INPUT_FREQUENCIES:  # as `Experiment.written` has it
        axis = None
    elif alone and isinstance(alone.value, (int, float)):
        axis = build_axis("simulate", "frequency_hz", {"": replace(alone, value=[alone.value])}, mistakes)
    else:
        axis = build_axis("simulate", "frequency_hz", parts, mistakes) if parts else None
    if len(mistakes) == before and ("simulate.input" in checked or "simulate.input" not in given):
        axis = axis or INPUT_FREQUENCIES.get(values["input"])
        values["frequency_hz"] = _frequencies(values["input"], axis, parts, mistakes)
    if values["duration_s"] is None and values["input"] not in ("stepped-sine", "record"):
        values["duration_s"] = SECONDS
    if values["input"] == "record" and values["record"] is None:
        expected = "the name of a CSV file for this input"
        mistakes.refuse(given["simulate.input"], "simulate.record", expected, "nothing", of_key=False)
    if parts:
        given[FREQUENCIES] = Leaf(None, axis_place(parts))
    return Experiment(values, axis, given)


def _frequencies(kind: str, axis: Axis | None, parts: Mapping[str, Leaf], mistakes: Mistakes) -> tuple[float, ...]:
    """Return the frequencies of this input; too many of them, or only a span, are a mistake."""
    if kind not in INPUT_FREQUENCIES:
        return ()
    ends = axis.values or (axis.start, axis.stop)
    if kind == "chirp":
        if len(ends) <= 2 and ends[0] <= ends[-1]:
            return ends[0], ends[-1]
        expected = "one or two frequencies for a chirp, the lower one first"
        found = f"{len(ends)} frequencies" if len(ends) > 2 else " and ".join(map(repr, ends))
    elif kind == "sine" and len(axis.values) != 1:
        found = f"{len(axis.values)} frequencies" if axis.values else "a span"
        expected = 'one frequency for a sine (several are for input = "stepped-sine")'
    elif axis.values:
        return axis.values
    else:
        expected, found = "num beside start and stop, or a list", "only a span"
    mistakes.refuse(axis_place(parts), FREQUENCIES, expected, found)
    return ()


@dataclass(frozen=True, slots=True)
class Studies:
    """`along`, the axes of both sweeps in the spec's order, the frequencies as an axis, the experiment, the design, what
    [sweep] requires of every mode, what answers have to hold for, the ends `from` and `to` of the responses that [bode]
    names, and the files that [measured] names."""

    along: str
    sweep: tuple[Axis, ...]
    bode: tuple[Axis, ...]
    frequencies: Axis
    experiment: Experiment
    design: Design | None = None
    require: Require | None = None
    for_all: ForAll | None = None
    route: Mapping[str, str] = field(default_factory=dict)
    measured: Mapping[str, str] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[tuple[str, tuple[Axis, ...]], ...]:
        """The axes of each study by its name."""
        designed = (("design.vary", self.design.vary), ("design.for_all", self.design.for_all)) if self.design else ()
        ranges = (("for_all", self.for_all.axes),) if self.for_all else ()
        return ("sweep", self.sweep), ("bode", self.bode), *designed, *ranges


def build_studies(belongs: Sorted, given: Given, mistakes: Mistakes, names: Names = BUILT_IN, usual: str = "sine") -> Studies:
    """Return the studies and add their mistakes; limits that the loop's values set are checked by `beyond_limits`.

    usual: the input of a simulation if none is given.
    """
    keys, device = belongs.keys, given.device()
    along = _read_along(keys.get("sweep.along"), mistakes, names)
    require = build_require(belongs.below("sweep.require"), mistakes)
    axes: dict[str, list[Axis]] = {}
    for study in ("sweep", "bode"):
        named = belongs.axes[study]
        built = [build_axis(study, name, parts, mistakes, names) for name, parts in named.items()]
        axes[study] = [axis for axis in built if axis]
        _refuse_repeated(study, named, names, mistakes)
        mistakes += _at_odds_with_filters(study, axes[study], given)
    for axis in axes["bode"]:
        if not axis.values:
            mistakes.refuse(axis.place, f"bode.{axis.name}", "num beside start and stop, or a list", "only a span")
    frequencies = [axis for axis in axes["bode"] if axis.path == DEFAULT_FREQUENCIES.path]
    bode = tuple(axis for axis in axes["bode"] if axis not in frequencies)
    experiment = build_experiment(belongs, usual, mistakes)
    design = build_design(belongs.design, names, mistakes)
    if design:
        design = design.on((experiment.on(device) if device else experiment).values, mistakes)
        for section, of_design in (("vary", design.vary), ("for_all", design.for_all)):
            mistakes += _at_odds_with_filters(f"design.{section}", of_design, given)
    for_all = build_for_all(belongs.axes["for_all"], keys.get("for_all.lost"), mistakes, names)
    if for_all:
        mistakes += refuse_swept({axis.path for axis in axes["sweep"]}, for_all)
        design = design and replace(design, for_all=(*design.for_all, *for_all.ends(design)))
    route = {name: str(keys[f"bode.{name}"].value) for name in ("from", "to") if f"bode.{name}" in keys}
    files = mistakes.read(MEASURED_KEYS, {f"measured.{name}": leaf for name, leaf in belongs.below("measured").items()})
    measured = {path.removeprefix("measured."): name for path, name in files.items()}
    frequency = (*frequencies, DEFAULT_FREQUENCIES)[0]
    return Studies(along, tuple(axes["sweep"]), bode, frequency, experiment, design, require, for_all, route, measured)


def usual_frequencies(studies: Studies, hz: float) -> Studies:
    """Return the studies with frequencies that suit the rate of the tick, in Hz, if the spec gives none."""
    if studies.frequencies is not DEFAULT_FREQUENCIES:
        return studies
    start, stop = (share * hz for share in OF_PORTS)
    usual = replace(DEFAULT_FREQUENCIES, values=logarithmic(start, stop, 400), start=start, stop=stop)
    return replace(studies, frequencies=usual)


def unknown_ends(belongs: Sorted, drawing: Drawing | None) -> Iterator[Mistake]:
    """Yield the mistakes of inputs and outputs that [bode] and [simulate] name, and the loop does not have.

    drawing: None of a controller, which has a hand alone.
    """
    for path in ("bode.from", "bode.to", "simulate.from"):
        if leaf := belongs.keys.get(path):
            what, ports = ("an output", "outputs") if path == "bode.to" else ("an input", "inputs")
            known = [name for name, *_ in getattr(drawing, ports, ())]
            if leaf.value not in known:
                expected = f"{what} in [ports] of a drawn loop ({', '.join(known) or 'it has none'})"
                hint = nearest(leaf.value, known) if isinstance(leaf.value, str) else ""
                yield leaf.mistake(path, expected, show(leaf.value), hint)


def unmeasurable(belongs: Sorted, drawing: Drawing) -> Iterator[Mistake]:
    """Yield the mistakes of files that [measured] names, of a wall or a hand that the drawn loop does not have."""
    for path, port, what in (("measured.z_width", drawing.wall, "a wall"), ("measured.response", drawing.hand, "a hand")):
        if port is None and (leaf := belongs.keys.get(path)):
            yield leaf.mistake(path, f"{what} in [ports], of which it was measured", "none", of_key=True)


def axis_fault(name: str, names: Names = BUILT_IN) -> tuple[str, str] | None:
    """Return the text for "found" and a suggestion if `name` is no numeric key, otherwise None."""
    key = names.find(name)
    if name in names.following:
        return f"{show(name)}, which follows from other numbers", ""
    if key is None:
        return show(name), nearest(name, names.symbols) or nearest(name, names.numeric)
    return None if key.numeric else (f"{show(name)}, which takes no number", "")


def _read_along(leaf: Leaf | None, mistakes: Mistakes, names: Names) -> str:
    key = STUDY_KEYS["sweep.along"]
    if leaf is None or (name := mistakes.check(key, leaf)) is None:  # of a drawn loop, which has no K_VE, `load` finds it
        return key.default
    if fault := axis_fault(name, names):
        mistakes.refuse(leaf, key.path, "the name of a numeric key", *fault, of_key=False)
    return name


def _refuse_repeated(study: str, named: Mapping[str, Mapping[str, Leaf]], names: Names, mistakes: Mistakes) -> None:
    first: dict[str, str] = {}
    for name, parts in named.items():
        path = getattr(names.find(name), "path", name)
        path = "rates.ratio" if path == "rates.slow_hz" else path  # one quantity
        if path in first:
            found = f"the key of the axis {first[path]} again"
            mistakes.refuse(axis_place(parts), f"{study}.{name}", "each key once", found)
        first.setdefault(path, name)


def _at_odds_with_filters(study: str, axes: Iterable[Axis], given: Given) -> Iterator[Mistake]:
    for axis in axes:
        name, _, last = axis.path.rpartition(".")
        if not name.startswith("filters."):
            continue
        by_edges = f"{name}.{BAND_EDGES[0]}" in given.leaves
        if by_edges != (last in BAND_EDGES):
            used = "its band edges" if by_edges else "order and cutoff_hz"
            expected = f"an axis that fits {name}, given by {used}"
            yield Leaf(None, axis.place).mistake(f"{study}.{axis.name}", expected, axis.path, of_key=True)


def beyond_half(frequency: Axis, axes: Iterable[Axis], own: float, rate: str) -> Iterator[Mistake]:
    """Yield the mistake of frequencies of [bode] beyond half the rate, which a force that is held over a tick does not have.

    axes: of the responses, among which the rate may be; own: its value otherwise, in Hz; rate: its path.
    """
    least = min((axis.start for axis in axes if axis.path == rate), default=own)
    if frequency.stop > least / 2:
        expected, found = apart(least / 2, frequency.stop)
        yield Leaf(None, frequency.place).mistake(frequency.path, f"numbers <= {expected} (half of {rate})", found)


def fitting(frequency: Axis, axes: Iterable[Axis], own: float, rate: str) -> Axis:
    """Return the frequencies of [bode], the default ones lower if half the rate is; axes, own, rate: see `beyond_half`."""
    least = min((axis.start for axis in axes if axis.path == rate), default=own)
    if frequency is not DEFAULT_FREQUENCIES or frequency.stop <= least / 2:
        return frequency
    stop, num = least / 2, len(frequency.values)
    start = stop * frequency.start / frequency.stop
    return replace(frequency, values=logarithmic(start, stop, num), start=start, stop=stop)


def beyond_limits(study: str, axes: Iterable[Axis], values: Mapping) -> Iterator[Mistake]:
    """Yield the mistakes of axes that leave the range set by the other values of the loop.

    Every combination of a study's axes is computed, so a cutoff has to suit the lowest swept rate. A delay beside a
    swept ratio is left to `with_values`, which sees each combination.
    """
    swept = {axis.path: axis for axis in axes}
    if "rates.fast_hz" in swept:
        values = {**values, "rates.fast_hz": swept["rates.fast_hz"].start}
    for axis in axes:
        if axis.path == "environment.delay" and set(LIMITS[axis.path]) & set(swept):
            continue
        expected = exceeds_limit(axis.path, axis.stop, values)
        if expected:
            yield Leaf(None, axis.place).mistake(f"{study}.{axis.name}", expected, show(axis.stop), of_key=True)
