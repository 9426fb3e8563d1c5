"""What the tables of a spec ask of the loop: the studies, checked in themselves and against the loop."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

from wavesweep.errors import Mistake
from wavesweep.spec.axes import Axis, axis_place, build_axis, logarithmic
from wavesweep.spec.checking import Mistakes, apart, nearest, show
from wavesweep.spec.design import Design, build_design
from wavesweep.spec.drawing import Drawing
from wavesweep.spec.experiment import SHOW, Experiment, build_experiment
from wavesweep.spec.for_all import ForAll, build_for_all, refuse_swept
from wavesweep.spec.keys import BAND_EDGES, BUILT_IN, MEASURED_KEYS, MESSAGES, STUDY_KEYS, Names
from wavesweep.spec.reading import Leaf
from wavesweep.spec.require import Require, build_require
from wavesweep.spec.resolving import LIMITS, Given, exceeds_limit
from wavesweep.spec.sorting import FOR_DESIGNS, VARIED, Sorted, names_in_list

DEFAULT_FREQUENCIES = Axis("frequency_hz", "bode.frequency_hz", logarithmic(0.1, 50.0, 400), 0.1, 50.0, False, "log")
OF_PORTS = 1e-5, 0.49  # of the tick's rate, the usual frequencies of responses between inputs and outputs


@dataclass(frozen=True, slots=True)
class Studies:
    """What a spec asks for, with its axes in the order of the spec.

    require: of every mode, by [sweep]. for_all: what answers have to hold for. route: the ends `from` and `to` of the responses
    that [bode] names. measured: the files that [measured] names.
    """

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

    usual: the input of a simulation that names no input.
    """
    keys, device = belongs.keys, given.device()
    along = _read_along(keys.get("sweep.along"), mistakes, names)
    require = build_require(belongs.below("sweep.require"), mistakes)
    axes: dict[str, list[Axis]] = {}
    for study in ("sweep", "bode", VARIED, FOR_DESIGNS):
        named = belongs.axes[study]
        built = [build_axis(study, name, parts, mistakes, names) for name, parts in named.items()]
        axes[study] = [axis for axis in built if axis]
        _refuse_repeated(study, named, names, mistakes)
        mistakes += _at_odds_with_filters(study, axes[study], given)
    for axis in axes["bode"]:
        if not axis.values:
            mistakes.refuse(axis.place, f"bode.{axis.name}", "num with start and stop, or a list", "only a span")
    frequencies = [axis for axis in axes["bode"] if axis.path == DEFAULT_FREQUENCIES.path]
    bode = tuple(axis for axis in axes["bode"] if axis not in frequencies)
    experiment = build_experiment(belongs, usual, mistakes)
    design = build_design(belongs, axes[VARIED], axes[FOR_DESIGNS], names, mistakes)
    if design:
        design = design.on((experiment.on(device) if device else experiment).values, mistakes)
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
    for path in ("bode.from", "bode.to", "simulate.from", SHOW):
        leaf = belongs.keys.get(path)
        what, ports = ("an input", "inputs") if path.endswith(".from") else ("an output", "outputs")
        known = [name for name, *_ in getattr(drawing, ports, ())]
        signals = drawing.signals if drawing and ports == "outputs" else ()
        for name in (names_in_list(leaf) if path == SHOW else [leaf.value]) if leaf else ():
            if name not in known:
                expected = f"{what} in [ports] of a drawn loop ({', '.join(known) or 'it has none'})"
                expected += " or a signal BLOCK.PORT" if signals else ""
                hint = nearest(name, (*known, *signals)) if isinstance(name, str) else ""
                yield leaf.mistake(path, expected, show(name), hint)
    channels = [block.name for block in drawing.channels] if drawing else []
    for path, leaf in belongs.below(MESSAGES).items():
        if path not in channels:
            expected = f"channels of a drawn loop ({', '.join(channels) or 'it has none'}), each with a list"
            yield leaf.mistake(f"{MESSAGES}.{path}".rstrip("."), expected, path or show(leaf.value), nearest(path, channels))


def unmeasurable(belongs: Sorted, drawing: Drawing) -> Iterator[Mistake]:
    """Yield the mistakes of files that [measured] names, of a wall or a hand that the drawn loop does not have."""
    for path, port, what in (("measured.z_width", drawing.wall, "a wall"), ("measured.response", drawing.hand, "a hand")):
        if port is None and (leaf := belongs.keys.get(path)):
            yield leaf.mistake(path, f"{what} in [ports], where it was measured", "none", of_key=True)


def axis_fault(name: str, names: Names = BUILT_IN) -> tuple[str, str] | None:
    """Return the text for "found" and a suggestion if `name` is not a numeric key, otherwise None."""
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
        if not name.startswith("filters.") or (study == VARIED and last in BAND_EDGES):  # which no design varies
            continue
        by_edges = f"{name}.{BAND_EDGES[0]}" in given.leaves
        if by_edges != (last in BAND_EDGES):
            used = "its band edges" if by_edges else "order and cutoff_hz"
            expected = f"an axis that fits {name}, given by {used}"
            yield Leaf(None, axis.place).mistake(f"{study}.{axis.name}", expected, axis.path, of_key=True)


def beyond_half(frequency: Axis, axes: Iterable[Axis], own: float, rate: str) -> Iterator[Mistake]:
    """Yield the mistake of frequencies of [bode] beyond half the rate, where the response to a held force is not defined.

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

    Every combination of a study's axes is computed, so a cutoff has to suit the lowest swept rate. A delay along with a
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
