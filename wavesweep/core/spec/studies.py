"""What the tables of a spec ask of the loop: the studies, checked in themselves and against the loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from wavesweep.core.drawing.drawing import Drawing
from wavesweep.core.reading.axes import Axis, axis_place, build_axis, logarithmic
from wavesweep.core.reading.checking import Mistakes, Rejected, apart, check, nearest, show
from wavesweep.core.reading.keys import BAND_EDGES, BUILT_IN, KEYS, MEASURED_KEYS, MESSAGES, STUDY_KEYS, Names
from wavesweep.core.reading.reading import Place
from wavesweep.core.reading.sorting import FOR_DESIGNS, VARIED, Sorted, names_in_list
from wavesweep.core.spec.resolving import LIMITS, Given, exceeds_limit
from wavesweep.designs.keys import Design, build_design
from wavesweep.for_all.keys import ForAll, build_for_all
from wavesweep.require.keys import Require, build_require
from wavesweep.simulation.keys import SHOW, Experiment, build_experiment

K_VE_SPAN = (0.0, 20000.0)  # N/m, where K_VE is wanted and the spec gives it no span
DEFAULT_FREQUENCIES = Axis("frequency_hz", "bode.frequency_hz", logarithmic(0.1, 50.0, 400), 0.1, 50.0, False, "log")
OF_PORTS = 1e-5, 0.49  # of the tick's rate, the usual frequencies of responses between inputs and outputs


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Studies:
    """What a spec asks for, with its axes in the order of the spec.

    along: name of the axis whose stable intervals are wanted, as written. sweep: the axes of [sweep], that one among them.
    bode: those of [bode] without the frequencies. design: the table [design]. require: what [sweep] requires of every mode,
    None if it is stability alone. for_all: what every answer has to hold for; None if it is for the spec's own numbers alone
    and there are no channels. route: the ends `from` and `to` of the responses that [bode] names. measured: the files that
    [measured] names, `z_width` and `response`, relative to the spec's folder.
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

    def axes_of_studies(self) -> tuple[tuple[str, tuple[Axis, ...]], ...]:
        """The axes of each study by its name."""
        designed = (("design.vary", self.design.vary), ("design.for_all", self.design.for_all)) if self.design else ()
        return ("sweep", self.sweep), ("bode", self.bode), *designed, ("for_all", self.for_all.axes if self.for_all else ())


def build_studies(
    belongs: Sorted,
    given: Given,
    mistakes: Mistakes,
    names: Names = BUILT_IN,
    drawing: Drawing | None = None,
    hz: float | None = None,
) -> Studies:
    """Return the studies and add their mistakes; limits that the loop's values set are checked by `refuse_beyond_limits`.

    drawing: of a drawn loop, None if it has mistakes. hz: the rate of the tick, None if it is not known.
    """
    keys, device, drawn = belongs.keys, given.device(), names is not BUILT_IN
    stepped = drawing is not None and drawing.hand is None and drawing.inputs  # a step of an input is what its user looks at
    axes = {study: _axes(study, belongs, given, names, mistakes) for study in ("sweep", "bode", VARIED, FOR_DESIGNS)}
    frequencies = [axis for axis in axes["bode"] if axis.path == DEFAULT_FREQUENCIES.path] or [DEFAULT_FREQUENCIES]
    if stepped and hz and frequencies == [DEFAULT_FREQUENCIES]:
        start, stop = (share * hz for share in OF_PORTS)
        frequencies = [replace(DEFAULT_FREQUENCIES, values=logarithmic(start, stop, 400), start=start, stop=stop)]
    experiment = build_experiment(belongs, "step" if stepped else "sine", mistakes)
    design = build_design(belongs, axes[VARIED], axes[FOR_DESIGNS], names, mistakes)
    if design:
        design = design.on((experiment.on(device) if device else experiment).values, mistakes)
    for_all = build_for_all(belongs.axes["for_all"], keys.get("for_all.lost"), mistakes, names)
    for axis in for_all.axes if for_all else ():
        if axis.path in {other.path for other in axes["sweep"]}:
            mistakes.refuse(axis.place, f"for_all.{axis.name}", "a number that [sweep] does not have as well", axis.name)
    if for_all and design:
        design = replace(design, for_all=(*design.for_all, *for_all.ends(design)))
    along = mistakes.check(STUDY_KEYS["sweep.along"], keys["sweep.along"]) if "sweep.along" in keys else None
    if along is None and drawn:  # the only span, or the wall's stiffness
        spans = [axis.name for axis in axes["sweep"] if not axis.values]
        along = spans[0] if len(spans) == 1 else (*((drawing and drawing.wall) or ()), "")[0]
    elif along and (fault := axis_fault(along, names)):
        mistakes.refuse(keys["sweep.along"], "sweep.along", "the name of a numeric key", *fault, of_key=False)
    files = mistakes.read(MEASURED_KEYS, {f"measured.{name}": leaf for name, leaf in belongs.below("measured").items()})
    return Studies(
        along=STUDY_KEYS["sweep.along"].default if along is None else along,
        sweep=tuple(axes["sweep"]),
        bode=tuple(axis for axis in axes["bode"] if axis.path != DEFAULT_FREQUENCIES.path),
        frequencies=frequencies[0],
        experiment=experiment,
        design=design,
        require=build_require(belongs.below("sweep.require"), mistakes),
        for_all=for_all or (ForAll(()) if drawing and drawing.channels else None),
        route={name: str(keys[f"bode.{name}"].value) for name in ("from", "to") if f"bode.{name}" in keys},
        measured={path.removeprefix("measured."): name for path, name in files.items()},
    )


def refuse_unknown_ends(belongs: Sorted, drawing: Drawing | None, mistakes: Mistakes) -> None:
    """Add the mistakes of inputs, outputs, channels and ports that studies name, and the loop does not have.

    drawing: None of a controller, which has a hand alone.
    """
    for path in ("bode.from", "bode.to", "simulate.from", SHOW):
        leaf = belongs.keys.get(path)
        for name in (names_in_list(leaf) if path == SHOW else [leaf.value]) if leaf else ():
            if fault := unknown_end(drawing, name, "inputs" if path.endswith(".from") else "outputs"):
                mistakes.refuse(leaf, path, *fault, of_key=False)
    channels = [block.name for block in drawing.channels] if drawing else []
    for path, leaf in belongs.below(MESSAGES).items():
        if path not in channels:
            expected = f"channels of a drawn loop ({', '.join(channels) or 'it has none'}), each with a list"
            found = path or show(leaf.value), nearest(path, channels)
            mistakes.refuse(leaf, f"{MESSAGES}.{path}".rstrip("."), expected, *found, of_key=False)
    for path, port, what in (("measured.z_width", "wall", "a wall"), ("measured.response", "hand", "a hand")):
        if drawing and getattr(drawing, port) is None and path in belongs.keys:
            mistakes.refuse(belongs.keys[path], path, f"{what} in [ports], where it was measured", "none")


def unknown_end(drawing: Drawing | None, name: object, ports: str) -> tuple[str, str, str] | None:
    """Return expected and found text and a suggestion if a name is none of the `inputs` or `outputs` of a loop, else None."""
    known = [each for each, *_ in getattr(drawing, ports, ())]
    if name in known:
        return None
    signals = drawing.signals if drawing and ports == "outputs" else ()
    what = f"an {ports[:-1]} in [ports] of a drawn loop ({', '.join(known) or 'it has none'})"
    hint = nearest(name, (*known, *signals)) if isinstance(name, str) else ""
    return f"{what} or a signal BLOCK.PORT" if signals else what, show(name), hint


def axis_fault(name: str, names: Names = BUILT_IN) -> tuple[str, str] | None:
    """Return the text for "found" and a suggestion if `name` is not a numeric key, otherwise None."""
    key = names.find(name)
    if name in names.following:
        return f"{show(name)}, which follows from other numbers", ""
    if key is None:
        return show(name), nearest(name, names.symbols) or nearest(name, names.numeric)
    return None if key.numeric else (f"{show(name)}, which takes no number", "")


def _axes(study: str, belongs: Sorted, given: Given, names: Names, mistakes: Mistakes) -> list[Axis]:
    """Return the axes of a table, and add their mistakes."""
    axes, first = [], {}
    for name, parts in belongs.axes[study].items():
        path = getattr(names.find(name), "path", name)
        path = "rates.ratio" if path == "rates.slow_hz" else path  # one quantity
        if path in first:
            found = f"the key of the axis {first[path]} again"
            mistakes.refuse(axis_place(parts), f"{study}.{name}", "each key once", found)
        first.setdefault(path, name)
        axis = build_axis(study, name, parts, mistakes, names)
        axes += [axis] if axis else []
    for axis in axes:
        table, _, last = axis.path.rpartition(".")
        by_edges, edge = f"{table}.{BAND_EDGES[0]}" in given.leaves, last in BAND_EDGES
        if table.startswith("filters.") and by_edges != edge and not (study == VARIED and edge):  # which no design varies
            expected = f"an axis that fits {table}, given by {'its band edges' if by_edges else 'order and cutoff_hz'}"
            mistakes.refuse(axis.place, f"{study}.{axis.name}", expected, axis.path)
        if study == "bode" and not axis.values:
            mistakes.refuse(axis.place, f"bode.{axis.name}", "num with start and stop, or a list", "only a span")
    return axes


def refuse_beyond_rate(studies: Studies, hz: float, rate: str, mistakes: Mistakes) -> None:
    """Add the mistakes of frequencies and times that do not fit the rate of the tick (Hz); rate: its path.

    Defaults are not checked, since the command that reads them may never run.
    """
    if studies.frequencies.place != Place():
        refuse_beyond_half(studies.frequencies, studies.bode, hz, rate, mistakes)
    if studies.experiment.given:
        studies.experiment.refuse_beyond_limits(hz, rate, mistakes)
    if studies.design:
        studies.design.refuse_beyond_half(hz, rate, mistakes)


def refuse_beyond_half(frequency: Axis, axes: Iterable[Axis], own: float, rate: str, mistakes: Mistakes) -> None:
    """Add the mistake of frequencies of [bode] beyond half the rate, where the response to a held force is not defined.

    axes: of the responses, among which the rate may be; own: its value otherwise, in Hz; rate: its path.
    """
    least = min((axis.start for axis in axes if axis.path == rate), default=own)
    if frequency.stop > least / 2:
        expected, found = apart(least / 2, frequency.stop)
        mistakes.refuse(frequency.place, frequency.path, f"numbers <= {expected} (half of {rate})", found, of_key=False)


def fitting(frequency: Axis, axes: Iterable[Axis], own: float, rate: str) -> Axis:
    """Return the frequencies of [bode], the default ones lower if half the rate is; axes, own, rate: as above."""
    least = min((axis.start for axis in axes if axis.path == rate), default=own)
    if frequency is not DEFAULT_FREQUENCIES or frequency.stop <= least / 2:
        return frequency
    stop, num = least / 2, len(frequency.values)
    start = stop * frequency.start / frequency.stop
    return replace(frequency, values=logarithmic(start, stop, num), start=start, stop=stop)


def refuse_beyond_limits(studies: Studies, values: Mapping, mistakes: Mistakes) -> None:
    """Add the mistakes of axes of a controller's loop that leave the range set by its other values.

    Every combination of a study's axes is computed, so a cutoff has to suit the lowest swept rate. A delay along with a
    swept ratio is left to `with_values`, which sees each combination.
    """
    wall = next((axis.stop for axis in studies.sweep if axis.path == "environment.K_VE"), K_VE_SPAN[1])
    followers = tuple(studies.design.followers(values, wall)) if studies.design else ()  # set by ratios of [design.for_all]
    for study, axes in (*studies.axes_of_studies(), ("design.for_all", followers)):
        swept = {axis.path: axis for axis in axes}
        known = {**values, "rates.fast_hz": swept["rates.fast_hz"].start} if "rates.fast_hz" in swept else values
        for axis in axes:
            if axis.path == "environment.delay" and set(LIMITS[axis.path]) & set(swept):
                continue
            if expected := exceeds_limit(axis.path, axis.stop, known):
                mistakes.refuse(axis.place, f"{study}.{axis.name}", expected, show(axis.stop))
    for axis, end in ((each, end) for each in followers for end in (each.start, each.stop)):
        try:
            check(KEYS[axis.path], float(end))
        except Rejected as error:
            mistakes.refuse(axis.place, f"design.for_all.{axis.name}", error.expected, f"{show(end)} of {axis.path}")
